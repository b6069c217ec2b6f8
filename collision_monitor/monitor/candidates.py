"""Stage 3, candidates: which pairs a body that starts a new motion, or is predicted further, has to be predicted in."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.broad_phase.dense_grid import box_pairs
from collision_monitor.broad_phase.hashed_grid import (
    HashedGrid,
    make_hashed_grid,
    query_box,
    read_boxes,
    regridded,
    remove_boxes,
)
from collision_monitor.broad_phase.region import regions_overlap
from collision_monitor.monitor.roster import FIRST_CAPACITY, Roster
from collision_monitor.monitor.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.prediction.impact_record import pair_key
from collision_monitor.prediction.motion import swept_box

MOST_QUERIES: Final = 0.01
"""Part of the bodies up to which each is looked up in the hashed grid; for more, a new grid is built and swept once."""

Pairs = NDArray[np.int32]


class Candidates(Stage):
    """The grid of swept boxes, and the pairs of bodies whose boxes meet."""

    SAVED = ("grid",)
    CACHES = ("_found",)

    def __init__(self) -> None:
        self.grid: HashedGrid = make_hashed_grid(FIRST_CAPACITY)
        self._found = np.zeros((1024, 2), np.int32)

    def enlarge(self, capacity: int) -> None:
        """Make room for so many bodies; the boxes stay."""
        if len(self.grid.box) < capacity:
            self.grid = regridded(self.grid.box, capacity)

    def forget(self, slots: NDArray[np.int32]) -> None:
        """Take the boxes of these bodies out of the grid."""
        remove_boxes(self.grid, slots)

    def find(self, step: StepContext, which: NDArray[np.int32]) -> Pairs:
        """Pairs (P, 2) of the bodies in `which` with all whose swept boxes meet theirs, but for those never checked."""
        pairs = self._partners(step, which)
        pairs = pairs[: keep_checked(step.roster.bodies, step.roster.allowed_keys, pairs)]
        step.work.candidate_pairs = len(pairs)
        return pairs

    def _partners(self, step: StepContext, which: NDArray[np.int32]) -> Pairs:
        bodies, top, margin = step.roster.bodies, step.roster.top, step.profile.contact_margin
        is_new = np.zeros(len(self.grid.box), np.bool_)
        is_new[which] = True
        if len(which) > MOST_QUERIES * top:
            centre, half = np.empty((2, top, 3))
            read_boxes(self.grid.box, centre, half)
            pairs = box_pairs(centre, half, is_new[:top])
            return pairs[: keep_new(bodies, self.grid, pairs, is_new, step.now, margin)]
        search = Search(which, is_new, np.empty(len(self.grid.box), np.int32))
        while True:  # at most twice: the second time there is room for all
            n = int(find_partners(bodies, self.grid, search, step.now, margin, self._found))
            if n <= len(self._found):
                return self._found[:n]
            self._found = np.zeros((2 * n, 2), np.int32)

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        snapshot.arrays["boxes"] = self.grid.box[: len(snapshot.arrays["bodies.used"])].copy()

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        top = len(snapshot.arrays["bodies.used"])
        boxes = snapshot.array("boxes", self.grid.box, top)
        self.grid = regridded(boxes, max(top, len(self.grid.box)))


def is_checked(roster: Roster, i: int, j: int) -> bool:
    """Whether the bodies i and j have been seen and their pair is checked."""
    slots = np.array([[i, j]], np.int32)
    seen = roster.bodies.seen[slots].all()
    return bool(seen) and keep_checked(roster.bodies, roster.allowed_keys, slots) == 1


@device
def _allowed(allowed, id_a, id_b):
    """Is the pair in the sorted keys (smaller id << 32 | larger id)?"""
    if allowed.size == 0:
        return False
    key = pair_key(id_a, id_b)
    k = np.searchsorted(allowed, key)
    return k < allowed.size and allowed[k] == key


class Search(NamedTuple):
    """A search for partners in the grid."""

    which: Any  # (M,) int32: the bodies that look for partners
    is_new: Any  # (N,) bool: marks these
    found: Any  # (N,) int32: scratch


@inlined
def _finds(bodies, is_new, i, j):
    """Of a pair whose boxes meet: is it for i, which starts anew or is predicted further, to look at what is new?

    Where both are new, for the one that was predicted less far, or else has the smaller slot; and there is nothing to
    look at with one that is predicted no further than i was before.
    """
    covered = bodies.motion[i].covered
    if not is_new[i]:
        return False
    if not is_new[j]:
        return bodies.motion[j].cover > covered
    other = bodies.motion[j].covered
    return covered < other or (covered == other and i < j)


@kernel
def find_partners(bodies, grid, search, now, margin, pairs):
    """Pairs of each body of the search with all whose swept box meets its own, each pair once, into pairs (P, 2).

    Only what a body sweeps after the time until which it was predicted before can meet what is not known yet.
    Returns how many there are; more than P: call again with more room.
    """
    which, is_new, found = search
    n = 0
    for k in range(which.size):
        i = which[k]
        swept = swept_box(bodies, i, max(now, bodies.motion[i].covered), margin)
        for m in range(query_box(grid, swept, i, found)):
            j = found[m]
            if not _finds(bodies, is_new, i, j):
                continue
            if n < pairs.shape[0]:
                pairs[n, 0] = i
                pairs[n, 1] = j
            n += 1
    return n


@kernel
def keep_new(bodies, grid, pairs, is_new, now, margin):
    """Move those of the pairs (P, 2) of overlapping boxes, one of them new, to the front that `find_partners` finds.

    Returns how many. Where most boxes are looked at anyway, all their pairs are found sooner by one sweep.
    """
    n = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if not _finds(bodies, is_new, i, j):
            i, j = j, i
            if not _finds(bodies, is_new, i, j):
                continue
        covered = bodies.motion[i].covered
        if covered > now:  # else what is new of it is its whole box
            swept = swept_box(bodies, i, covered, margin)
            if not regions_overlap(swept, grid.box[j]):
                continue
        pairs[n, 0], pairs[n, 1] = i, j
        n += 1
    return n


@kernel
def keep_checked(bodies, allowed, pairs):
    """Move the pairs (P, 2) that are checked to the front; returns how many.

    Static pairs, groups that ignore each other and allowed pairs are left out.
    """
    n = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if bodies.static[i] and bodies.static[j]:
            continue
        if (bodies.group[i] & bodies.mask[j]) == 0 or (bodies.group[j] & bodies.mask[i]) == 0:
            continue
        if _allowed(allowed, bodies.id[i], bodies.id[j]):
            continue
        pairs[n, 0], pairs[n, 1] = i, j
        n += 1
    return n
