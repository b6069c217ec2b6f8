"""The measures of pairs of objects that rules limit: a structure of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Slots = NDArray[np.int32]

COLUMNS: Final = (
    *("time_to_collision", "time_to_collision_upper", "probability", "distance", "distance_error", "closing_speed"),
    "impact_speed",
    *("time_to_closest_approach", "distance_at_closest_approach", "required_deceleration", "time_headway"),
    *("post_encroachment_time", "separation_margin"),
)
"""The numbers of CollisionAlert.msg, in its order."""


class Measures:
    """Measures of n pairs of bodies. NaN: not measured.

    keys (n,): of the pairs (`pair_key`), ascending. i, j (n,): their body slots; i has the smaller id. points
    (n, 2, 3): nearest points of both in m. uncertain (n,): the monitor could not settle the pair, or a state of it is
    stale. is_certain_hit (n,): it is predicted to collide with certainty. quiet: by measure, which pairs (n,) its
    thresholds leave out. reached (n,): the highest level whose thresholds are passed, also where they leave pairs out.
    """

    def __init__(self, keys: NDArray[np.uint64], i: Slots, j: Slots) -> None:
        self.keys, self.i, self.j = keys, i, j
        self.points = np.full((len(keys), 2, 3), np.nan)
        self.uncertain = np.zeros(len(keys), np.bool_)
        self.is_certain_hit = np.zeros(len(keys), np.bool_)
        self.quiet: Mapping[str, NDArray[np.bool_]] = {}
        self.reached = np.zeros(len(keys), np.uint8)
        self._columns = {name: np.full(len(keys), np.nan) for name in COLUMNS}
        self["time_to_collision"] = self["time_to_collision_upper"] = np.full(len(keys), np.inf)
        self["probability"] = np.zeros(len(keys))

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, name: str) -> Array:
        return self._columns[name]

    def __setitem__(self, name: str, values: Array) -> None:
        self._columns[name] = values.astype(np.float64)

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Measures:
        """Return the measures of some pairs."""
        taken = Measures.__new__(Measures)
        taken.keys, taken.i, taken.j = self.keys[which], self.i[which], self.j[which]
        taken.points, taken.uncertain = self.points[which], self.uncertain[which]
        taken.is_certain_hit, taken.reached = self.is_certain_hit[which], self.reached[which]
        taken.quiet = {name: mask[which] for name, mask in self.quiet.items()}
        taken._columns = {name: column[which] for name, column in self._columns.items()}
        return taken

    def fill(self, other: Measures) -> None:
        """Copy what was measured of those pairs of `other` that are here too."""
        here = np.isin(other.keys, self.keys)
        at = np.searchsorted(self.keys, other.keys[here])
        self.points[at], self.uncertain[at] = other.points[here], self.uncertain[at] | other.uncertain[here]
        self.is_certain_hit[at] = other.is_certain_hit[here]
        for name, column in self._columns.items():
            column[at] = other[name][here]
