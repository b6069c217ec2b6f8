"""Kernels for one frame of full detection: every pose is new, and nothing is carried over from the frame before.

The bodies are divided into blocks, and each stage runs block by block: bounds, cells, sort by cell, gather, search with
the narrow phase, sort of the hits, output. Gather, search and output can run on several threads.
Each pair is computed from its two poses alone and the hits are sorted, so the result does not depend on the blocks.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numba import prange

from collision_monitor._jit import device, inlined, kernel, parallel_kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor.broad_phase.dense_grid import (
    AHEAD,
    PAD,
    Bounds,
    CellGrid,
    find_buckets,
    gather_centres,
    partners,
    places,
    plan_cells,
    searches,
    sort_by_cell,
)
from collision_monitor.broad_phase.size_classes import CLASSES, STARTING
from collision_monitor.narrow_phase.box_box import axis_direction, sat, touching_features
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    CONTACT_SIZE,
    DISTANCE,
    NORMAL,
    POINT_A,
    POINT_B,
    first_column,
)
from collision_monitor.narrow_phase.dispatch import contact_within
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.sphere_sphere import sphere_sphere_contact
from collision_monitor.narrow_phase.work_memory import WORK_SIZE
from collision_monitor.shapes.shape_table import ShapeTable
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

SPHERES, BOXES, ANY = 0, 1, 2
"""Kinds of narrow phase: only spheres, only boxes without margin, or the table of pair tests."""

CHUNK: Final = 256
"""Candidates collected before the narrow phase tests them, so that both loops stay in the caches."""

DETECTED: Final = np.dtype(
    [
        ("signed_distance", np.float64),  # m
        ("error_bound", np.float64),  # m
        ("normal", np.float64, 3),  # unit, from A to B
        ("point", np.float64, 3),  # m, in the world: the middle between the witness points
        ("point_a", np.float64, 3),
        ("point_b", np.float64, 3),
    ]
)
"""A row of the output."""

_SIGNED_DISTANCE: Final = first_column(DETECTED, "signed_distance")
_ERROR_BOUND: Final = first_column(DETECTED, "error_bound")
_NORMAL: Final = first_column(DETECTED, "normal")
_POINT: Final = first_column(DETECTED, "point")
_POINT_A: Final = first_column(DETECTED, "point_a")
_POINT_B: Final = first_column(DETECTED, "point_b")
DETECTED_SIZE: Final = DETECTED.itemsize // 8


class Frame(NamedTuple):
    """Memory of one detector for N bodies in B blocks; "sorted" means by cell, in the order of the grid's places."""

    body: Any  # (N, 4) float64: half extents of a box or radius of a sphere; bounding radius plus half the margin (m)
    bounds: Any  # (B, 6) float64: lower and upper corner of each block's positions (m)
    extent: Any  # (3, N + PAD) float64: sorted bounding radii in row 0 (m)
    size: Any  # (N, 3) float64: sorted; half extents of a box or radius of a sphere (m)
    rotation: Any  # (N, 3, 3) float64, sorted
    found: Any  # (B, N + CHUNK + PAD) int32: places of the candidates
    owner: Any  # (B, N + CHUNK + PAD) int32: places of the bodies that found them
    work: Any  # (B, WORK_SIZE) float64
    begins: Any  # (N + 1,) int32: scratch memory of the final sort
    hits: Any  # (B,) int64: number of contacts of each block
    good: Any  # (B,) bool: whether the block's input is valid


class CandidateTest(NamedTuple):
    """Parameters of the test of every candidate."""

    table: Any  # ShapeTable
    path: Any  # SPHERES, BOXES or ANY
    limit: Any  # m: largest distance of a contact


class Hits(NamedTuple):
    """Contacts of a frame before they are sorted; enlarged when a frame has more."""

    pair: Any  # (B, H + 1, 2) int32; the last element receives the contacts that do not fit
    contact: Any  # (B, H + 1, CONTACT_SIZE) float64
    order: Any  # (2, B * H) int32


def make_frame(body: Any, blocks: int) -> Frame:
    """Allocate the memory for bodies (N, 4)."""
    n = len(body)
    return Frame(
        body=body,
        bounds=np.zeros((blocks, 6)),
        extent=np.zeros((3, n + PAD)),
        size=np.zeros((n, 3)),
        rotation=np.zeros((n, 3, 3)),
        found=np.zeros((blocks, n + CHUNK + PAD), np.int32),
        owner=np.zeros((blocks, n + CHUNK + PAD), np.int32),
        work=np.zeros((blocks, WORK_SIZE)),
        begins=np.zeros(n + 1, np.int32),
        hits=np.zeros(blocks, np.int64),
        good=np.zeros(blocks, np.bool_),
    )


def make_hits(blocks: int, capacity: int) -> Hits:
    """Allocate memory for `capacity` contacts in each block."""
    return Hits(
        pair=np.zeros((blocks, capacity + 1, 2), np.int32),
        contact=np.zeros((blocks, capacity + 1, CONTACT_SIZE)),
        order=np.zeros((2, blocks * capacity), np.int32),
    )


# A stage processes block b of n items and stores its result in frame[b]. It does so in a function of its own, because
# numba loses an assignment to an element of a tuple's array inside the parallel loop itself.


@inlined
def _block(b: Any, frame: Any, n: int) -> Any:
    """Begin and end of block b of n items."""
    blocks = frame.bounds.shape[0]
    return b * n // blocks, (b + 1) * n // blocks


@device
def _bounds(positions: Any, frame: Any, b: Any) -> None:
    """Compute the corners of the positions, and check that all are finite and within LARGEST_INPUT."""
    begin, end = _block(b, frame, positions.shape[0])
    lx = ly = lz = np.inf
    hx = hy = hz = -np.inf
    good = True
    for i in range(begin, end):
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        good &= (abs(x) <= LARGEST_INPUT) & (abs(y) <= LARGEST_INPUT) & (abs(z) <= LARGEST_INPUT)
        lx, ly, lz = min(lx, x), min(ly, y), min(lz, z)
        hx, hy, hz = max(hx, x), max(hy, y), max(hz, z)
    out = frame.bounds[b]
    out[0], out[1], out[2], out[3], out[4], out[5] = lx, ly, lz, hx, hy, hz
    frame.good[b] = good


@device
def _cells(grid: Any, frame: Any) -> Any:
    """Plan the cells within the bounds of all blocks; return their number."""
    lx, ly, lz = frame.bounds[0, 0], frame.bounds[0, 1], frame.bounds[0, 2]
    hx, hy, hz = frame.bounds[0, 3], frame.bounds[0, 4], frame.bounds[0, 5]
    for b in range(1, frame.bounds.shape[0]):
        lx, ly, lz = min(lx, frame.bounds[b, 0]), min(ly, frame.bounds[b, 1]), min(lz, frame.bounds[b, 2])
        hx, hy, hz = max(hx, frame.bounds[b, 3]), max(hy, frame.bounds[b, 4]), max(hz, frame.bounds[b, 5])
    return plan_cells(lx, ly, lz, hx, hy, hz, grid)


@device
def _buckets(positions: Any, grid: Any, frame: Any, b: Any) -> None:
    begin, end = _block(b, frame, positions.shape[0])
    find_buckets(positions, grid, begin, end)


@device
def _gather(path: int, positions: Any, quaternions: Any, grid: Any, frame: Any, b: Any) -> None:
    """Copy the search's input into the order of the cells, and check that all quaternions are of unit length."""
    begin, end = _block(b, frame, positions.shape[0])
    gather_centres(positions, grid, begin, end)
    good = True
    for p in range(begin, end):
        ahead = np.intp(grid.order[min(p + AHEAD, end - 1)])
        prefetch(frame.body, ahead)
        prefetch(quaternions, ahead)
        i = grid.order[p]
        frame.extent[0, p] = frame.body[i, 3]
        x, y, z, w = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
        squared = x * x + y * y + z * z + w * w
        good &= abs(sqrt(squared) - 1.0) <= UNIT_QUATERNION
        frame.size[p, 0], frame.size[p, 1], frame.size[p, 2] = frame.body[i, 0], frame.body[i, 1], frame.body[i, 2]
        if path == SPHERES:
            continue
        s = 2.0 / squared
        R = frame.rotation[p]
        R[0, 0] = 1.0 - s * (y * y + z * z)
        R[0, 1] = s * (x * y - w * z)
        R[0, 2] = s * (x * z + w * y)
        R[1, 0] = s * (x * y + w * z)
        R[1, 1] = 1.0 - s * (x * x + z * z)
        R[1, 2] = s * (y * z - w * x)
        R[2, 0] = s * (x * z - w * y)
        R[2, 1] = s * (y * z + w * x)
        R[2, 2] = 1.0 - s * (x * x + y * y)
    frame.good[b] = good


@inlined
def _boxes(a: Any, b: Any, pose: Any, out: Any, work: Any) -> bool:
    gap, axis, sign = sat((a[0], a[1], a[2]), (b[0], b[1], b[2]), pose, 0.0)
    if gap > 0.0:
        return False
    touching_features(a, b, pose, gap, axis_direction(axis, sign, pose), out, work)
    return True


@inlined
def _ask_for(table: Any, path: int, order: Any, size: Any, rotation: Any, q: Any) -> None:
    """Prefetch what a test of place q reads, as the candidates are in random memory order."""
    prefetch(rotation, q)
    prefetch(rotation, q + 1)  # the rest of the matrix, which is longer than a cache line
    if path == BOXES:
        prefetch(size, q)
    else:
        prefetch(table.size, np.intp(order[q]))
        prefetch(table.margin, np.intp(order[q]))


@device
def _narrow(test: Any, grid: Any, frame: Any, hits: Any, b: Any, candidates: int, count: int) -> int:
    """Test the first `candidates` of block b; append contacts from place `count` on, return the new number."""
    table, path, limit = test.table, test.path, test.limit
    found, owner, work = frame.found[b], frame.owner[b], frame.work[b]
    pair, contact = hits.pair[b], hits.contact[b]
    order, centre, size, rotation = grid.order, grid.centre, frame.size, frame.rotation
    last = pair.shape[0] - 1
    for k in range(candidates):
        if path != SPHERES:
            _ask_for(table, path, order, size, rotation, np.intp(found[min(k + AHEAD, candidates - 1)]))
        p, q = owner[k], found[k]
        i, j = order[p], order[q]
        if i > j:
            i, j, p, q = j, i, q, p
        apart = (centre[0, q] - centre[0, p], centre[1, q] - centre[1, p], centre[2, q] - centre[2, p])
        at = min(count, last)
        out = contact[at]
        if path == SPHERES:
            sphere_sphere_contact(size[p, 0], size[q, 0], apart, out)
            touching = out[DISTANCE] <= limit
        elif path == BOXES:
            touching = _boxes(size[p], size[q], PairPose(rotation[p], rotation[q], apart), out, work)
        else:
            touching = contact_within(table, i, j, PairPose(rotation[p], rotation[q], apart), limit, out, work)
        if touching:
            pair[at, 0] = i
            pair[at, 1] = j
            count += 1
    return count


@device
def _search(table: Any, path: int, limit: float, grid: Any, frame: Any, hits: Any, b: Any) -> None:
    """Find the contacts of a block of places with all their partners; store their number in frame.hits[b]."""
    begin, end = _block(b, frame, grid.order.size)
    found, owner = frame.found[b], frame.owner[b]
    test = CandidateTest(table, path, limit)
    n = count = 0
    for a in range(STARTING):
        first, behind = places(grid, a)
        first, behind = max(first, begin), min(behind, end)
        if first >= behind:
            continue
        for c in range(CLASSES):
            if not searches(grid, a, c):
                continue
            for p in range(first, behind):
                m = partners(grid, Bounds(frame.extent, True), a, c, p, found, n)
                for k in range(n, m):
                    owner[k] = p
                n = m
                if n >= CHUNK:
                    count = _narrow(test, grid, frame, hits, b, n, count)
                    n = 0
    frame.hits[b] = _narrow(test, grid, frame, hits, b, n, count)


@device
def _sort_hits(frame: Any, hits: Any) -> int:
    """Sort the indices of the hits by first and second body into order[0], with two stable counting sorts."""
    begins, order, pair = frame.begins, hits.order, hits.pair
    stride = pair.shape[1]
    total = 0
    for b in range(frame.hits.size):
        for k in range(frame.hits[b]):
            order[0, total] = b * stride + k
            total += 1
    for step in range(2):
        column = 1 - step
        source, target = step, 1 - step
        begins[:] = 0
        for k in range(total):
            at = order[source, k]
            begins[pair[at // stride, at % stride, column] + 1] += 1
        for i in range(1, begins.size):
            begins[i] += begins[i - 1]
        for k in range(total):
            at = order[source, k]
            body = pair[at // stride, at % stride, column]
            order[target, begins[body]] = at
            begins[body] += 1
    return total


@device
def _write(positions: Any, frame: Any, hits: Any, total: int, pairs: Any, contacts: Any, part: Any) -> None:
    """Write a block of the sorted hits to the output arrays, with witness points in the world frame."""
    begin, end = _block(part, frame, total)
    stride = hits.pair.shape[1]
    for k in range(begin, end):
        ahead = hits.order[0, min(k + AHEAD, end - 1)]
        contact = hits.contact[ahead // stride]
        prefetch(contact, np.intp(ahead % stride))
        prefetch(contact, np.intp(ahead % stride + 1))  # also covers the end of the row `ahead`
        at = hits.order[0, k]
        b, h = at // stride, at % stride
        i = hits.pair[b, h, 0]
        pairs[k, 0] = i
        pairs[k, 1] = hits.pair[b, h, 1]
        contacts[k, _SIGNED_DISTANCE] = hits.contact[b, h, DISTANCE]
        contacts[k, _ERROR_BOUND] = hits.contact[b, h, BOUND]
        for c in range(3):
            on_a = positions[i, c] + hits.contact[b, h, POINT_A + c]
            on_b = positions[i, c] + hits.contact[b, h, POINT_B + c]
            contacts[k, _NORMAL + c] = hits.contact[b, h, NORMAL + c]
            contacts[k, _POINT + c] = on_a + 0.5 * (on_b - on_a)
            contacts[k, _POINT_A + c] = on_a
            contacts[k, _POINT_B + c] = on_b


# Index of the first array of each tuple in the argument `memory` of a kernel.
_GRID: Final = len(ShapeTable._fields)
_FRAME: Final = _GRID + len(CellGrid._fields)
_HITS: Final = _FRAME + len(Frame._fields)
_END: Final = _HITS + len(Hits._fields)

BAD_POSITION: Final = -1
BAD_QUATERNION: Final = -2


@device
def _finish(frame: Any, hits: Any, pairs: Any) -> int:
    """Sort the hits and return their number; if they do not fit, return -3 - the capacity that is needed."""
    most = total = 0
    for b in range(frame.hits.size):
        most = max(most, frame.hits[b])
        total += frame.hits[b]
    if most >= hits.pair.shape[1] or total > pairs.shape[0]:
        return -3 - max(most, total)
    return _sort_hits(frame, hits)


@device
def _into_cells(positions: Any, grid: Any, frame: Any) -> bool:
    """Sort the bodies by cell, on one thread. Return whether all positions are finite, without which none is sorted."""
    blocks = frame.bounds.shape[0]
    for b in range(blocks):
        _bounds(positions, frame, b)
    if not frame.good.all():
        return False
    cells = _cells(grid, frame)
    for b in range(blocks):
        _buckets(positions, grid, frame, b)
    sort_by_cell(positions.shape[0], cells, grid)
    return True


@kernel
def detect(path: int, limit: float, positions: Any, quaternions: Any, pairs: Any, contacts: Any, *memory: Any) -> int:
    """Detect on one thread; return the number of contacts or a negative code (BAD_POSITION, BAD_QUATERNION, `_finish`).

    memory: the arrays of the shape table, the grid, the frame and the hits. A separate array argument costs 20 ns, an
    array in a named tuple 200 ns.
    """
    table, grid = ShapeTable(*memory[:_GRID]), CellGrid(*memory[_GRID:_FRAME])
    frame, hits = Frame(*memory[_FRAME:_HITS]), Hits(*memory[_HITS:_END])
    blocks = frame.bounds.shape[0]
    if not _into_cells(positions, grid, frame):
        return BAD_POSITION
    for b in range(blocks):
        _gather(path, positions, quaternions, grid, frame, b)
    if not frame.good.all():
        return BAD_QUATERNION
    for b in range(blocks):
        _search(table, path, limit, grid, frame, hits, b)
    total = _finish(frame, hits, pairs)
    for b in range(blocks):
        _write(positions, frame, hits, total, pairs, contacts, b)
    return total


@parallel_kernel
def detect_parallel(
    path: int, limit: float, positions: Any, quaternions: Any, pairs: Any, contacts: Any, *memory: Any
) -> int:
    """Detect as `detect` does, with one thread per block for the stages that are worth a second thread.

    The parallel loop's b is cast to its type in `detect`, so that both share their compiled stages.
    """
    table, grid = ShapeTable(*memory[:_GRID]), CellGrid(*memory[_GRID:_FRAME])
    frame, hits = Frame(*memory[_FRAME:_HITS]), Hits(*memory[_HITS:_END])
    blocks = frame.bounds.shape[0]
    if not _into_cells(positions, grid, frame):
        return BAD_POSITION
    for b in prange(blocks):
        _gather(path, positions, quaternions, grid, frame, np.int64(b))
    if not frame.good.all():
        return BAD_QUATERNION
    for b in prange(blocks):
        _search(table, path, limit, grid, frame, hits, np.int64(b))
    total = _finish(frame, hits, pairs)
    for b in prange(blocks):
        _write(positions, frame, hits, total, pairs, contacts, np.int64(b))
    return total
