"""The last positions and velocities of a robot's joints, from sensor_msgs/JointState."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.robots.kinematic_tree import KinematicTree
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

NANOSECOND: Final = 1e-9

_SHOWN: Final = 5

MOST_NAMES: Final = 10_000
"""Joints of a message. A humanoid has 60."""

_MOST_LAYOUTS: Final = 32
"""Different lists of names that are remembered. Each publisher of a robot has one."""

_LONGEST_LAYOUT: Final = 100_000
"""Characters of all names of a list that is remembered."""


class JointTable:
    """Joints by the columns of a tree. fresh (J,): whether a joint has news that `at` has not returned yet.

    Several publishers may share a topic, each with its own joints. A message without velocities, as some drivers send,
    leaves them to the difference of two positions. max_age: s up to which a position may be old. A message that is
    older than the last one is late and ignored, until `restart`.
    """

    def __init__(self, tree: KinematicTree, max_age: float) -> None:
        count = len(tree.joints)
        self.fresh: Mask = np.zeros(count, np.bool_)
        self._columns = {name: j for j, name in enumerate(tree.joints)}
        self._wraps = tree.wraps
        self._max_age = round(max_age / NANOSECOND)
        self._values = np.zeros((count, 2))
        self._stamps = np.zeros(count, np.int64)
        self._seen = np.zeros(count, np.bool_)
        self._speed_known = np.zeros(count, np.bool_)
        self._layouts: dict[tuple[str, ...], tuple[NDArray[np.intp], NDArray[np.intp]]] = {}

    def take(self, message: Any, stamp_ns: int) -> str | None:
        """Store the joints of a JointState. Return the reason if it, or a part of it, cannot be used."""
        if len(message.name) > MOST_NAMES:
            return f"expected at most {MOST_NAMES} joints in a message, got {len(message.name)}"
        names = tuple(message.name)
        position, velocity = np.asarray(message.position), np.asarray(message.velocity)
        if len(position) != len(names) or len(velocity) not in (0, len(names)):
            return (
                f"expected a position, and a velocity or none, for each of {len(names)} joints, "
                f"got {len(position)} positions and {len(velocity)} velocities"
            )
        places, columns = self._layout(names)
        given = position[places]
        late = self._seen[columns] & (self._stamps[columns] > stamp_ns)
        usable = (np.abs(given) <= LARGEST_INPUT) & ~late
        if not usable.all():
            places, columns, given = places[usable], columns[usable], given[usable]
        if len(velocity):
            speed = velocity[places]
            known = np.abs(speed) <= LARGEST_INPUT
        else:
            speed, known = self._difference(columns, given, stamp_ns)
        self._values[columns, 0] = given
        self._values[columns, 1] = np.where(known, speed, 0.0)
        self._speed_known[columns] = known
        self._stamps[columns] = stamp_ns
        self._seen[columns] = self.fresh[columns] = True
        bad = [names[k] for k in np.flatnonzero(~(np.abs(position) <= LARGEST_INPUT))[:_SHOWN]]
        return f"expected finite positions, got others for {', '.join(bad):.200}" if bad else None

    def restart(self) -> None:
        """Forget all earlier times."""
        self._seen[:] = self.fresh[:] = False

    def at(self, now_ns: int) -> tuple[Floats, Mask, Mask]:
        """Return positions and velocities (J, 2) at a time, and whether positions (J,) and velocities (J,) are known.

        A joint moves on at its velocity since its message, and is unknown beyond `max_age`.
        """
        age = now_ns - self._stamps
        known = self._seen & (np.abs(age) <= self._max_age)
        values = self._values.copy()
        values[:, 0] += values[:, 1] * np.where(known, age * NANOSECOND, 0.0)
        self.fresh[:] = False
        return values, known, self._speed_known

    def _layout(self, names: tuple[str, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the places of our joints in the message, and their columns."""
        known = self._layouts.get(names)
        if known is None:
            found = {self._columns[name]: k for k, name in enumerate(names) if name in self._columns}
            known = np.array([*found.values()], np.intp), np.array([*found], np.intp)
            if len(self._layouts) >= _MOST_LAYOUTS:
                self._layouts.clear()
            if sum(map(len, names)) <= _LONGEST_LAYOUT:
                self._layouts[names] = known
        return known

    def _difference(self, columns: NDArray[np.intp], given: Floats, stamp_ns: int) -> tuple[Floats, Mask]:
        """Return velocities from the last positions, and whether they are known."""
        elapsed = stamp_ns - self._stamps[columns]
        known = self._seen[columns] & (elapsed > 0) & (elapsed <= self._max_age)
        moved = given - self._values[columns, 0]
        moved = np.where(self._wraps[columns], np.remainder(moved + np.pi, 2.0 * np.pi) - np.pi, moved)
        return moved / np.where(known, elapsed * NANOSECOND, 1.0), known
