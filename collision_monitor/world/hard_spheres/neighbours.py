"""Cells and neighbour lists: each sphere has a cell of its own, and a list of the spheres with cells within reach.

A cell is a cube that the sphere's centre stays in. When the centre leaves it, the sphere gets a new cell ahead of
itself, and its list is made again from the boxes of a grid. Collisions then need only the lists, and a fast sphere in
an empty region crosses a whole cell instead of half a cell. Source: neighbour lists, L. Verlet (1967), rebuilt for
single particles as in F. Smallenburg, Eur. Phys. J. E 45, 22 (2022); cells ahead of the spheres: own.
"""

from __future__ import annotations

import math

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor.tolerances import ROUNDED_UP
from collision_monitor.world.hard_spheres.state import CLOCK, NOTHING, RADIUS, USUAL, VELOCITY, Indices, State, X

LEAD = 0.8
"""Distance from the sphere to its new cell's centre as part of the half cell. Larger: spheres that are deflected soon
leave sooner. Smaller: spheres that fly straight leave sooner. 0.5 to 0.95 differ by less than 5 % at packings 0.1 to
0.45; 0 costs a third more at packing 0.1."""


@inlined
def move(state: State, i: int, now: float) -> None:
    """Advance sphere i on its straight path to `now` (s)."""
    spheres = state.spheres
    since = now - spheres[i, CLOCK]
    for axis in range(3):
        spheres[i, X + axis] += since * spheres[i, VELOCITY + axis]
    spheres[i, CLOCK] = now


@inlined
def new_cell(state: State, i: int, now: float) -> bool:
    """Give sphere i a new cell and a new list at `now` (s); return False if a row of the arrays is full."""
    spheres, centres, side = state.spheres, state.centres, state.side
    move(state, i, now)
    fastest = 0.0
    for axis in range(3):
        fastest = max(fastest, abs(spheres[i, VELOCITY + axis]))
    lead = LEAD * state.half_cell / fastest if fastest > 0.0 else 0.0
    for axis in range(3):
        spheres[i, X + axis] -= side * math.floor(spheres[i, X + axis] * state.per_side)
        centres[i, axis] = spheres[i, X + axis] + lead * spheres[i, VELOCITY + axis]
    _leave_lists(state, i)
    bx, by, bz = _along(state, i, 0), _along(state, i, 1), _along(state, i, 2)
    if not _enter_box(state, i, (bx * state.grid + by) * state.grid + bz):
        return False
    return _make_list(state, i, _gather(state, bx, by, bz))


@inlined
def _remove(row: Indices, first: int, end: int, value: int) -> bool:
    """Overwrite a value in row[first:end] by the last one; return whether it was there.

    The search has no early exit, because a mispredicted branch costs more than the rest of a short row.
    """
    place = -1
    for m in range(first, end):
        if row[m] == value:
            place = m
    if place < 0:
        return False
    row[place] = row[end - 1]
    return True


@inlined
def _leave_lists(state: State, i: int) -> None:
    for m in range(state.counts[i]):
        j = state.neighbours[i, m]
        if _remove(state.neighbours[j], 0, state.counts[j], i):
            state.counts[j] -= 1
    state.counts[i] = 0


@inlined
def _wrap(index: int, grid: int, periodic: bool) -> int:
    """Index of a box of the grid along an axis, from -1 to grid; NOTHING outside of reflecting walls."""
    if 0 <= index < grid:
        return index
    if not periodic:
        return NOTHING
    return index - grid if index > 0 else index + grid


@inlined
def _along(state: State, i: int, axis: int) -> int:
    """Index along an axis of the grid's box that holds the centre of sphere i's cell; beyond a wall, the nearest."""
    index: int = math.floor(state.centres[i, axis] * state.grid_per_metre)
    if state.per_side != 0.0:
        return _wrap(index, state.grid, True)
    return min(max(index, 0), state.grid - 1)


@inlined
def _enter_box(state: State, i: int, box: int) -> bool:
    """Move sphere i to this box of the grid; return False if the box is full."""
    members, old = state.members, state.boxes[i]
    if box == old:
        return True
    if members[box, 0] + 1 >= members.shape[1]:
        return False
    if old != NOTHING and _remove(members[old], 1, members[old, 0] + 1, i):
        members[old, 0] -= 1
    members[box, 0] += 1
    members[box, members[box, 0]] = i
    state.boxes[i] = box
    return True


@inlined
def _gather(state: State, bx: int, by: int, bz: int) -> int:
    """Copy the spheres of a box and of the 26 around it into `candidates` and return their number."""
    grid, members, candidates = state.grid, state.members, state.candidates
    periodic = state.per_side != 0.0
    found: int = 0
    for nx in range(bx - 1, bx + 2):
        x = _wrap(nx, grid, periodic)
        for ny in range(by - 1, by + 2):
            y = _wrap(ny, grid, periodic)
            for nz in range(bz - 1, bz + 2):
                z = _wrap(nz, grid, periodic)
                if min(x, y, z) < 0:
                    continue
                box = (x * grid + y) * grid + z
                for m in range(USUAL):  # a fixed number, also beyond the last, as that needs no branch
                    candidates[found + m] = members[box, 1 + m]
                for m in range(USUAL, members[box, 0]):
                    candidates[found + m] = members[box, 1 + m]
                found += int(members[box, 0])
    return found


@inlined
def _make_list(state: State, i: int, found: int) -> bool:
    """Enter sphere i and the candidates with cells within reach into each other's lists; return False if one is full.

    A list that is not complete stays consistent: `_leave_lists` takes back the entries that are there.
    """
    side, per_side, centres = state.side, state.per_side, state.centres
    neighbours, counts, candidates = state.neighbours, state.counts, state.candidates
    capacity = neighbours.shape[1]
    cx, cy, cz, radius = centres[i, 0], centres[i, 1], centres[i, 2], state.spheres[i, RADIUS]
    width = 2.0 * state.half_cell * (1.0 + ROUNDED_UP)
    count = 0
    for m in range(found):
        j = candidates[m]
        dx, dy, dz = centres[j, 0] - cx, centres[j, 1] - cy, centres[j, 2] - cz
        dx = max(abs(dx - side * np.rint(dx * per_side)) - width, 0.0)
        dy = max(abs(dy - side * np.rint(dy * per_side)) - width, 0.0)
        dz = max(abs(dz - side * np.rint(dz * per_side)) - width, 0.0)
        contact = radius + centres[j, 3]
        if count == capacity:
            return False
        neighbours[i, count] = j
        count += (dx * dx + dy * dy + dz * dz < contact * contact) & (j != i)
    counts[i] = count
    for m in range(count):
        j = neighbours[i, m]
        if counts[j] == capacity:
            return False
        neighbours[j, counts[j]] = i
        counts[j] += 1
    return True
