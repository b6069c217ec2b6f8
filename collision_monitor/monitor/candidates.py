"""Stage 3, candidates: find the pairs to predict for the bodies that start a new motion or are predicted further."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor._jit.settled import settled
from collision_monitor.broad_phase.box_pairs import box_pairs
from collision_monitor.broad_phase.hashed_grid import HashedGrid, make_hashed_grid, read_boxes, regridded, remove_boxes
from collision_monitor.broad_phase.region import regions_overlap
from collision_monitor.broad_phase.sorted_boxes import SortedBoxes, note_changed, overlapping_boxes, sorted_boxes
from collision_monitor.impact.impact_record import pair_key
from collision_monitor.monitor.state.roster import FIRST_CAPACITY, Roster
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.motion.bodies import BodyTable
from collision_monitor.motion.motion import swept_box

MOST_TESTS: Final = 6_000
"""Up to this number of pairs of a body to predict and any body, each is tested. For more, there are the grids."""

MOST_QUERIES: Final = 0.02
"""Up to this fraction of the bodies, each searches the sorted boxes. For more, all boxes are sorted anew and swept."""

MOSTLY_NEW: Final = 0.5
"""From this fraction of the bodies on, the sweep does not sort out the others, which takes up to twice the time."""

PREFETCH_AHEAD: Final = 4
"""How many pairs ahead the bodies are prefetched."""

Pairs = NDArray[np.int32]


class Candidates(Stage):
    """The bodies' swept boxes; finds the pairs of bodies whose boxes overlap."""

    SAVED = ("grid",)
    CACHES = ("_found", "_sorted", "_changed")

    def __init__(self) -> None:
        self.grid: HashedGrid = make_hashed_grid(FIRST_CAPACITY)
        self._found = np.zeros((1024, 2), np.int32)
        self._sorted: SortedBoxes | None = None
        self._changed: list[NDArray[np.int32]] = []  # bodies with new boxes that are not in the list of `_sorted` yet

    def enlarge(self, capacity: int) -> None:
        """Make room for `capacity` bodies; the boxes stay."""
        if len(self.grid.box) < capacity:
            self.grid = regridded(self.grid.box, capacity)

    def forget(self, slots: NDArray[np.int32]) -> None:
        """Remove the boxes of these bodies from the grid."""
        remove_boxes(self.grid, slots)

    def find(self, step: StepContext, which: NDArray[np.int32]) -> Pairs:
        """Find the checked pairs (P, 2) of the bodies in `which` with all bodies whose swept boxes overlap theirs."""
        pairs = self._partners(step, which)
        if len(pairs):
            pairs = pairs[: keep_checked(*filters_of(step.roster.bodies), step.roster.allowed_keys, pairs)]
        step.work.candidate_pairs = len(pairs)
        return pairs

    def _partners(self, step: StepContext, which: NDArray[np.int32]) -> Pairs:
        bodies, top, margin = step.roster.bodies, step.roster.top, step.profile.contact_margin
        is_new = np.zeros(len(self.grid.box), np.bool_)
        is_new[which] = True
        self._note(which, top)
        is_small = len(which) * top <= MOST_TESTS
        if len(which) > MOST_QUERIES * top and not is_small:
            centre, half = np.empty((2, top, 3))
            read_boxes(self.grid.box, centre, half)
            pairs = box_pairs(centre, half, is_new[:top] if len(which) < MOSTLY_NEW * top else None)
            return pairs[: keep_new(bodies, self.grid.box, pairs, is_new, step.now, margin)]
        search = GridSearch(which, is_new, np.empty(len(self.grid.box) + 1, np.int32))
        changed = which[:0]
        if not is_small:
            self._sorted = self._sorted or sorted_boxes(self.grid.box, top)
            changed, self._changed = np.concatenate([changed, *self._changed]), []
        while True:  # at most twice: the second time the array is large enough
            if is_small:
                n = int(sweep(bodies, self.grid.box, search, top, step.now, margin, self._found))
            else:
                boxes = self.grid.box, self._sorted, changed
                n = int(find_partners(bodies, boxes, search, step.now, margin, self._found))
            if n <= len(self._found):
                return self._found[:n]
            self._found = np.zeros((2 * n, 2), np.int32)

    def _note(self, which: NDArray[np.int32], top: int) -> None:
        """Note that the boxes of these bodies have changed. Drop the sorted boxes if their list has no room."""
        boxes = self._sorted
        if boxes is None:
            return
        self._changed.append(which)
        count = boxes.count[0] + sum(map(len, self._changed))
        fits = len(boxes.place) == len(self.grid.box) and boxes.grid.order.size == top
        if not fits or count > len(boxes.changed):
            self._sorted, self._changed = None, []

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        snapshot.arrays["boxes"] = self.grid.box[: len(snapshot.arrays["bodies.used"])].copy()

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        top = len(snapshot.arrays["bodies.used"])
        boxes = snapshot.array("boxes", self.grid.box, top)
        self.grid = regridded(boxes, max(top, len(self.grid.box)))
        self._sorted, self._changed = None, []


_NONE_ALLOWED: Final = np.zeros(0, np.uint64)


def filters_of(bodies: BodyTable) -> tuple[Any, Any, Any, Any]:
    """Columns of the bodies that `keep_checked` reads."""
    return bodies.static, bodies.group, bodies.mask, bodies.id


def is_checked(roster: Roster, i: int, others: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether body i and each of these other bodies (n,) have a state and their pair is checked."""
    bodies = roster.bodies
    pairs = np.stack([np.full_like(others, i), others], axis=1)
    count = keep_checked(*filters_of(bodies), _NONE_ALLOWED, pairs)  # a query of all allowed pairs would sort them anew
    kept = pairs[:count, 1]
    allowed = [roster.allows(int(bodies.id[i]), object_id) for object_id in bodies.id[others].tolist()]
    return bodies.seen[i] & bodies.seen[others] & np.isin(others, kept) & ~np.array(allowed, np.bool_)


@device
def _allowed(allowed: Any, id_a: int, id_b: int) -> bool:
    """Whether the pair is in the sorted keys (smaller id << 32 | larger id)."""
    if allowed.size == 0:
        return False
    key = pair_key(id_a, id_b)
    k = np.searchsorted(allowed, key)
    return k < allowed.size and allowed[k] == key


class GridSearch(NamedTuple):
    """A search for partners in the grid."""

    which: Any  # (M,) int32: the bodies to find partners for
    is_new: Any  # (N,) bool: marks these bodies
    found: Any  # (N,) int32: scratch


@inlined
def _finds(bodies: BodyTable, is_new: Any, i: int, j: int) -> bool:
    """Whether body i of a pair with overlapping boxes is the one that reports it, so that each pair is found once.

    Body i must start anew or be predicted further. If both bodies do, the one that was predicted less far reports the
    pair, on a tie the one with the smaller slot. A body that is not new counts only if it is predicted further than i
    was before: otherwise the pair is known already.
    """
    covered = bodies.motion[i].covered
    if not is_new[i]:
        return False
    if not is_new[j]:
        return bodies.motion[j].cover > covered
    other = bodies.motion[j].covered
    return covered < other or (covered == other and i < j)


@settled
@kernel
def find_partners(bodies: Any, boxes: Any, search: Any, now: Any, margin: Any, pairs: Any) -> Any:
    """Write the pairs of each body of the search with all bodies whose swept box overlaps its own, each pair once.

    A body that is predicted further needs only the box that it sweeps after the time until which it was predicted
    before: earlier impacts are known. boxes: all boxes (N,) GRID_BOX, SortedBoxes, and the bodies (K,) to note in their
    list. pairs (P, 2). Returns the number of pairs; if it exceeds P, call again with a larger array.
    """
    box, by_cell, changed = boxes
    which, is_new, found = search
    note_changed(by_cell, box, changed)
    n = 0
    for k in range(which.size):
        prefetch(bodies.motion, np.intp(which[min(k + 1, which.size - 1)]))
        i = which[k]
        swept = swept_box(bodies, i, max(now, bodies.motion[i].covered), margin)
        overlaps = overlapping_boxes(by_cell, swept, found)
        for m in range(overlaps):
            prefetch(bodies.motion, np.intp(found[m]))
        for m in range(overlaps):
            j = found[m]
            if j == i or not _finds(bodies, is_new, i, j) or box[j].level < 0:
                continue
            if n < pairs.shape[0]:
                pairs[n, 0] = i
                pairs[n, 1] = j
            n += 1
    return n


@device
def _reporter(bodies: BodyTable, box: Any, i: int, j: int, is_new: Any, now: float, margin: float) -> int:
    """The body of a pair with overlapping boxes that reports it in `find_partners`; -1: neither."""
    if not _finds(bodies, is_new, i, j):
        i, j = j, i
        if not _finds(bodies, is_new, i, j):
            return -1
    covered = bodies.motion[i].covered
    if covered > now:  # else its whole box is new
        swept = swept_box(bodies, i, covered, margin)
        if not regions_overlap(swept, box[j]):
            return -1
    return i


@settled
@kernel
def sweep(bodies: BodyTable, box: Any, search: GridSearch, top: int, now: float, margin: float, pairs: Any) -> int:
    """As `find_partners`, but by a test of each body of the search with all bodies in the first `top` slots.

    box (N,): GRID_BOX. If there are few bodies, this is faster than a grid.
    """
    which, is_new, _ = search
    n = 0
    for i in which:
        for j in range(top):
            if (is_new[j] and j <= i) or box[j].level < 0 or not regions_overlap(box[i], box[j]):
                continue
            first = _reporter(bodies, box, i, j, is_new, now, margin)
            if first < 0:
                continue
            if n < pairs.shape[0]:
                pairs[n, 0], pairs[n, 1] = first, i + j - first
            n += 1
    return n


@settled
@kernel
def keep_new(bodies: BodyTable, box: Any, pairs: Any, is_new: Any, now: float, margin: float) -> int:
    """Move the pairs (P, 2) that `find_partners` would find to the front; return their number.

    The pairs are those of overlapping boxes with at least one new body, found by one sweep over all boxes. If many
    bodies are new, the sweep is faster than one query for each.
    """
    n = 0
    for k in range(pairs.shape[0]):
        ahead = min(k + PREFETCH_AHEAD, pairs.shape[0] - 1)
        prefetch(bodies.motion, np.intp(pairs[ahead, 0]))
        prefetch(bodies.motion, np.intp(pairs[ahead, 1]))
        prefetch(box, np.intp(pairs[ahead, 0]))
        prefetch(box, np.intp(pairs[ahead, 1]))
        i, j = pairs[k, 0], pairs[k, 1]
        first = _reporter(bodies, box, i, j, is_new, now, margin)
        if first >= 0:
            pairs[n, 0], pairs[n, 1] = first, i + j - first
            n += 1
    return n


@settled
@kernel
def keep_checked(static: Any, group: Any, mask: Any, ids: Any, allowed: Any, pairs: Any) -> int:
    """Move the pairs (P, 2) that are checked to the front; return their number.

    Pairs of two static bodies, pairs whose groups ignore each other and allowed pairs are not checked.
    """
    n = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if static[i] and static[j]:
            continue
        if (group[i] & mask[j]) == 0 or (group[j] & mask[i]) == 0:
            continue
        if _allowed(allowed, ids[i], ids[j]):
            continue
        pairs[n, 0], pairs[n, 1] = i, j
        n += 1
    return n
