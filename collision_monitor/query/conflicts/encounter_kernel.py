"""Kernels of `conflicts`: the swept boxes of a fleet, and entries and exits of many pairs of bodies at once."""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor.impact.body_impact import ImpactQuery, Scratch, Window
from collision_monitor.motion.bodies import Parts
from collision_monitor.motion.motion import MOTION, swept_box
from collision_monitor.motion.trajectory import carry
from collision_monitor.query.conflicts.fleet import FleetPieces
from collision_monitor.query.impact.exit_kernel import ExitMemory, ExitSearch, find_exit
from collision_monitor.query.impact.impact_kernel import DECIDED, TOUCHES, first_impact_in, set_motion
from collision_monitor.shapes.shape_table import ShapeTable


class Swept(NamedTuple):
    """One body as `swept_box` reads it."""

    motion: Any  # (1,) MOTION
    static: Any  # (1,) bool
    pieces: Any  # (0,) MOTION: no more pieces


def one_swept() -> Swept:
    """Make the memory of `sweep_boxes`."""
    motion = np.zeros(1, MOTION)
    motion["until"] = inf
    return Swept(motion, np.zeros(1, np.bool_), np.zeros(0, MOTION))


@inlined
def _piece_at(pieces: Any, i: int, t: float) -> Any:
    """Index of the piece of body i that holds at time t, by bisection."""
    low, high = pieces.first[i], pieces.first[i + 1] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if pieces.begins[middle] <= t:
            low = middle
        else:
            high = middle - 1
    return low


@inlined
def _end_of(pieces: Any, i: int, k: Any) -> float:
    """Time (s) to which piece k of body i holds."""
    end: float = pieces.begins[k + 1] if k + 1 < pieces.first[i + 1] else inf
    return end


@kernel
def sweep_boxes(
    pieces: FleetPieces, count: int, begin: float, end: float, margins: Any, one: Swept, centre: Any, half: Any
) -> None:
    """Write boxes that contain the first `count` bodies between two times (s), to centre and half (N, 3) in m.

    margins (N,): m beyond the bodies. half is NaN where the motion is unknown.
    """
    m = one.motion[0]
    for i in range(count):
        stop = min(end, pieces.until[i])
        if not begin < stop:
            half[i, 0] = half[i, 1] = half[i, 2] = np.nan
            continue
        k, t = _piece_at(pieces, i, begin), begin
        m.radius = pieces.radius[i]
        lx = ly = lz = inf
        hx = hy = hz = -inf
        while t < stop:
            leave, start = min(stop, _end_of(pieces, i, k)), pieces.begins[k]
            set_motion(m, pieces.numbers, k)
            m.tube_0, m.cover = pieces.tubes[k], leave - start
            box = swept_box(one, 0, t - start, margins[i])
            lx, ly, lz = min(lx, box.x - box.hx), min(ly, box.y - box.hy), min(lz, box.z - box.hz)
            hx, hy, hz = max(hx, box.x + box.hx), max(hy, box.y + box.hy), max(hz, box.z + box.hz)
            k, t = k + 1, leave
        centre[i, 0], centre[i, 1], centre[i, 2] = 0.5 * (lx + hx), 0.5 * (ly + hy), 0.5 * (lz + hz)
        half[i, 0], half[i, 1], half[i, 2] = 0.5 * (hx - lx), 0.5 * (hy - ly), 0.5 * (hz - lz)


@inlined
def _carry_pair(pieces: Any, ki: Any, kj: Any, t: float, to: Any, memory: Any) -> None:
    """Write the motions of two pieces as they go on from time t to `to` (2, NUMBERS)."""
    carry(pieces.numbers, ki, t - pieces.begins[ki], to[0], memory.quaternion)
    carry(pieces.numbers, kj, t - pieces.begins[kj], to[1], memory.quaternion)


@kernel
def find_entries(
    table: ShapeTable, parts: Parts, scratch: Scratch, moving: Any, pieces: FleetPieces, pairs: Any, windows: Any,
    query: Any, memory: ExitMemory, rows: Any,
) -> None:  # fmt: skip
    """Write the first impacts of pairs (W, 2) of bodies in windows (W, 2) of time (s) to rows (W, 3).

    A row is lower, upper (s, infinite for none), and DECIDED, or TOUCHES where only a single query answers: the bodies
    touch at the begin of a piece. query (4,): of MotionQuery; moving: see `impacts_of_chains`.
    """
    search, motion = ImpactQuery(query[2], query[1], int(query[3])), moving[0]
    for w in range(len(rows)):
        i, j, t, end = pairs[w, 0], pairs[w, 1], windows[w, 0], windows[w, 1]
        ki, kj, chains = _piece_at(pieces, i, t), _piece_at(pieces, j, t), (pieces.chain[i], pieces.chain[j])
        lower, upper, code = inf, inf, DECIDED
        while True:
            stop = min(end, _end_of(pieces, i, ki), _end_of(pieces, j, kj))
            _carry_pair(pieces, ki, kj, t, memory.now, memory)
            set_motion(motion[0], memory.now, 0)
            set_motion(motion[1], memory.now, 1)
            motion[0].tube_0, motion[1].tube_0 = pieces.tubes[ki], pieces.tubes[kj]
            found = first_impact_in(table, parts, chains, Window(0.0, stop - t), search, scratch, moving)
            lower, code = min(lower, t + found[0]), found[2]
            if found[1] < inf and code == DECIDED:
                upper = t + found[1]
            if upper < inf or code == TOUCHES or not stop < end:
                break
            t = stop
            ki, kj = _piece_at(pieces, i, t), _piece_at(pieces, j, t)
        rows[w, 0], rows[w, 1], rows[w, 2] = lower, upper, code
    motion[0].tube_0 = motion[1].tube_0 = 0.0


@kernel
def find_exits(
    table: ShapeTable, parts: Parts, scratch: Scratch, pieces: FleetPieces, pairs: Any, windows: Any, query: Any,
    memory: ExitMemory, state: Any, rows: Any,
) -> None:  # fmt: skip
    """Write until when contacts of pairs (W, 2) last, and a time without (s; infinite for none) to rows (W, 2).

    windows (W, 2): a time (s) of the contact, and the end of the search. query (4,): of MotionQuery; state (4,):
    memory. Not for meshes, whose surfaces do not show that one body is inside the other.
    """
    for w in range(len(rows)):
        i, j, t, end = pairs[w, 0], pairs[w, 1], windows[w, 0], windows[w, 1]
        chains, arms = (pieces.chain[i], pieces.chain[j]), (pieces.arm[i], pieces.arm[j])
        rows[w, 0], rows[w, 1] = t, inf
        while t < end:
            ki, kj = _piece_at(pieces, i, t), _piece_at(pieces, j, t)
            stop = min(end, _end_of(pieces, i, ki), _end_of(pieces, j, kj))
            _carry_pair(pieces, ki, kj, t, memory.start, memory)
            tube = pieces.tubes[ki] + pieces.tubes[kj]
            search = ExitSearch(memory.start, arms, tube, stop - t, query[2], query[1])
            state[0], state[1], state[2], state[3] = 0.0, 0.0, -inf, 0.0
            is_apart = find_exit(table, parts, chains, search, state, memory, scratch)
            rows[w, 0] = max(rows[w, 0], t + state[2])
            if is_apart:
                rows[w, 1] = t + state[0] + state[1]
                break
            t = stop
