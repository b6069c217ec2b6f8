"""moveit_msgs/AllowedCollisionMatrix: the pairs of names whose contact is expected."""

from __future__ import annotations

from typing import Any

import numpy as np

from collision_monitor.errors import InputError


class CollisionMatrix:
    """Answers for pairs of names. Raises InputError for a matrix that is not square."""

    def __init__(self, message: Any) -> None:
        self._rows = {name: i for i, name in enumerate(message.entry_names)}
        count = len(message.entry_names)
        rows = [np.asarray(entry.enabled, np.bool_) for entry in message.entry_values]
        if len(rows) != count or any(len(row) != count for row in rows):
            raise InputError(
                f"allowed collision matrix: expected {count} rows of {count} values, as entry_names, "
                f"got {len(rows)} rows of {sorted({len(row) for row in rows}) or 0}"
            )
        if len(message.default_entry_names) != len(message.default_entry_values):
            raise InputError(
                f"allowed collision matrix: expected {len(message.default_entry_names)} default values, "
                f"got {len(message.default_entry_values)}"
            )
        self._allowed = np.array(rows, np.bool_).reshape(count, count)
        self._defaults = dict(zip(message.default_entry_names, map(bool, message.default_entry_values), strict=True))

    def allows(self, a: str, b: str) -> bool | None:
        """Return whether contact is expected; None if the matrix does not say.

        The defaults of two names count together: both have to allow it. Source: MoveIt,
        collision_detection/collision_matrix.h, getAllowedCollision and getDefaultEntry.
        """
        i, j = self._rows.get(a), self._rows.get(b)
        if i is not None and j is not None:
            return bool(self._allowed[i, j] or self._allowed[j, i])
        defaults = [self._defaults[name] for name in (a, b) if name in self._defaults]
        return all(defaults) if defaults else None
