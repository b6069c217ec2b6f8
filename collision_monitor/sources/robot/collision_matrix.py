"""moveit_msgs/AllowedCollisionMatrix: the pairs of names whose contact is expected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.robots.urdf import LONGEST_LINK_NAME

Answers = NDArray[np.int8]
Places = tuple[NDArray[np.intp], NDArray[np.int8]]
"""Of names: their rows of the matrix, -1 without one, and their defaults."""

MOST_ENTRIES: Final = 5_000
"""Names of a matrix, which has as many rows and columns."""

UNKNOWN, DENIED, ALLOWED = -1, 0, 1


class CollisionMatrix:
    """Answers for pairs of names. Raises InputError for a matrix that is not square, or too large."""

    def __init__(self, message: Any) -> None:
        names = list(message.entry_names)
        count = len(names)
        if max(count, len(message.default_entry_names)) > MOST_ENTRIES:
            raise InputError(f"allowed collision matrix: expected at most {MOST_ENTRIES} names, got more")
        rows = [np.asarray(entry.enabled, np.bool_) for entry in message.entry_values]
        if len(rows) != count or any(len(row) != count for row in rows):
            raise InputError(
                f"allowed collision matrix: expected {count} rows of {count} values, as entry_names, "
                f"got {len(rows)} rows of {sorted({len(row) for row in rows}) or 0!s:.80}"
            )
        if len(message.default_entry_names) != len(message.default_entry_values):
            raise InputError(
                f"allowed collision matrix: expected {len(message.default_entry_names)} default values, "
                f"got {len(message.default_entry_values)}"
            )
        self._rows = {name: i for i, name in enumerate(names) if len(name) <= LONGEST_LINK_NAME}
        allowed = np.array(rows, np.bool_).reshape(count, count)
        self._allowed = allowed | allowed.T
        defaults = zip(message.default_entry_names, map(bool, message.default_entry_values), strict=True)
        self._defaults = {name: value for name, value in defaults if len(name) <= LONGEST_LINK_NAME}

    def forget(self, name: str) -> None:
        """Take a name out, as MoveIt does with an object that is removed: its next owner is another object."""
        self._rows.pop(name, None)
        self._defaults.pop(name, None)

    def places(self, names: Sequence[str]) -> Places:
        """Return the places of names in the matrix."""
        rows = np.array([self._rows.get(name, -1) for name in names], np.intp)
        return rows, np.array([self._defaults.get(name, UNKNOWN) for name in names], np.int8)

    def answers(self, name: str, others: Places) -> Answers:
        """Return ALLOWED, DENIED or UNKNOWN for a name and each of the others.

        The defaults of two names count together: both have to allow it. Source: MoveIt,
        collision_detection/collision_matrix.h, getAllowedCollision and getDefaultEntry.
        """
        rows, of_others = others
        row, own = self._rows.get(name, -1), self._defaults.get(name, UNKNOWN)
        found = of_others if own == UNKNOWN else np.where(of_others == UNKNOWN, own, of_others & own)
        if row < 0:
            return np.asarray(found, np.int8)
        return np.where(rows >= 0, self._allowed[row, np.maximum(rows, 0)], found).astype(np.int8)
