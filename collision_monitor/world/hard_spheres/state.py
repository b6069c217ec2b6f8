"""The arrays of an event-driven simulation, as its kernels see them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit.prefetch import CACHE_LINE

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]

X, VELOCITY, CLOCK, RADIUS = 0, 3, 6, 7
"""Columns of `State.spheres`. The eight numbers that a prediction reads fill one cache line."""

NOTHING: Final = -1
"""End of a list; no sphere."""
CELL_EXIT: Final = -2
WALL: Final = -3
"""Codes of events without a partner: the exit from the cell, and WALL - k for a wall across axis k."""

COLLISIONS, WALL_HITS, VIRIAL, WALL_IMPULSE, EPOCH, LOGGED = range(6)
"""Elements of `State.totals`: pair collisions, wall collisions, sum of r_ij . dp (J), momentum that the walls took
(kg m/s), time (s) at which the local clocks were last set back, and rows of the log."""

ROW_LINES: Final = 3
"""Cache lines in a row of neighbours at first. An odd number spreads the rows' starts over all sets of the cache."""


class State(NamedTuple):
    """N spheres in a cube with one corner at the origin. Each sphere has a clock, a cell, a list and one event."""

    spheres: Floats
    """(N, 8): position (m) and velocity (m/s) at the sphere's clock (s), that clock, and the radius (m)."""
    centres: Floats
    """(N, 4): centre of the cell, a cube that the sphere's centre stays in until its next cell exit (m), and radius."""
    masses: Floats
    """(N,) kg."""
    last_hit: Floats
    """(N,) time of the last collision (s)."""
    neighbours: Indices
    """(N, capacity): spheres whose cells are near enough for a collision."""
    counts: Indices
    """(N,) neighbours in each row."""
    heads: Indices
    """(grid**3,) first sphere of each box of the grid, or NOTHING."""
    following: Indices
    """(N,) next sphere in the same box of the grid, or NOTHING."""
    preceding: Indices
    """(N,) previous sphere in the same box of the grid, or NOTHING."""
    boxes: Indices
    """(N,) index of the box that holds the cell's centre."""
    partners: Indices
    """(N,) partner of each sphere's event, or a code."""
    expected: Indices
    """(N,) number of hits of the partner at the time of prediction; with another number the event is invalid."""
    hits: Indices
    """(N,) number of collisions of each sphere, modulo 2**32."""
    times: Floats
    """(2 * leaves,) tournament tree: element 1 is the earliest event, sphere i is at leaves + i."""
    winners: Indices
    """(2 * leaves,) sphere of each element of `times`."""
    totals: Floats
    """(6,) counters and sums."""
    side: float
    """Side of the cube (m)."""
    per_side: float
    """1 / side with periodic walls, 0 with reflecting walls: a difference d has the nearest image d - side * rint(d *
    per_side), and all its images are itself without periodicity."""
    half_cell: float
    """Half the side of a sphere's cell (m)."""
    grid_per_metre: float
    grid: int
    """Boxes of the grid along an axis, at least 3 with periodic walls."""
    restitution: float
    contact_duration: float
    """Collisions that follow another within this time are elastic (s)."""
    set_back: float
    """The clocks are set back when they exceed this (s), so that round-off does not grow with time. A power of two."""


def aligned(shape: tuple[int, ...], dtype: type = np.float64) -> NDArray[np.generic]:
    """Zeros that begin at a cache line."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.zeros(size + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % CACHE_LINE
    array: NDArray[np.generic] = memory[start : start + size].view(dtype).reshape(shape)
    return array
