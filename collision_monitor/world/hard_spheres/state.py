"""The arrays of an event-driven simulation, as its kernels see them."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit.prefetch import CACHE_LINE
from collision_monitor.world.hard_spheres.event_tree import empty_tree

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]

X, VELOCITY, CLOCK, RADIUS = 0, 3, 6, 7
"""Columns of `State.spheres`. The eight numbers that a prediction reads fill one cache line."""

NOTHING: Final = -1
"""End of a list; no sphere."""
CELL_EXIT: Final = -2
WALL: Final = -3
"""Codes of events without a partner: the exit from the cell, and WALL - k for a wall across axis k."""

COLLISIONS, VIRIAL, WALL_IMPULSE, EPOCH, LOGGED = range(5)
"""Elements of `State.totals`: collisions of two spheres, the sum of -r_ij . dp_i (J), the momentum that the walls took
(kg m/s), the time (s) to which the clocks were last set back, and rows of the log."""

CELL: Final = 0.2
"""Half the side of a sphere's cell as part of the mean distance of neighbours. Larger: longer lists. Smaller: more
cell exits. 0.15 to 0.3 differ by less than 15 % at packings 0.1 to 0.45."""
ROW_LINES: Final = 3
"""Cache lines in a row of neighbours. An odd number spreads the starts of the rows over all sets of the cache."""
INDICES_PER_LINE: Final = CACHE_LINE // 4
USUAL: Final = 4
"""Spheres that a box of the grid holds at most in the usual case; more are correct but slower."""
CONTACT_DURATION: Final = 1e-5
"""Contact duration as part of the time in which a sphere of mean speed passes the mean distance of neighbours.
Larger: dissipation is lost. Smaller: an inelastic collapse takes more collisions."""
SET_BACK: Final = 4.0
"""Times after which clocks are set back, in the same unit; rounded to a power of two seconds, which is exact."""


class State(NamedTuple):
    """N spheres in a cube with one corner at the origin. Each sphere has a clock, a cell, a list and one event."""

    spheres: Floats
    """(N, 8): position (m) and velocity (m/s) at the sphere's clock (s), that clock, and the radius (m)."""
    centres: Floats
    """(N, 4): centre of the cell, a cube that holds the sphere's centre until its next cell exit (m), and radius."""
    masses: Floats
    """(N,) kg."""
    last_hit: Floats
    """(N,) time of the last collision (s)."""
    neighbours: Indices
    """(N, capacity): spheres whose cells are near enough for a collision."""
    counts: Indices
    """(N,) neighbours in each row."""
    members: Indices
    """(grid**3, capacity): number of spheres in each box of the grid, then the spheres."""
    candidates: Indices
    """Scratch memory: spheres of a box and of those around it."""
    boxes: Indices
    """(N,) index of the grid's box that holds the centre of the sphere's cell."""
    partners: Indices
    """(N,) partner of each sphere's event, or a code."""
    expected: Indices
    """(N,) hits of the partner at the time of prediction; if it has more by now, the event is invalid."""
    hits: Indices
    """(N,) collisions of each sphere, modulo 2**32."""
    times: Floats
    """(2 * leaves,) tournament tree: element 1 is the earliest event, sphere i is at leaves + i (s)."""
    winners: Indices
    """(2 * leaves,) sphere of each element of `times`."""
    totals: Floats
    """(6,) counters and sums."""
    side: float
    """Side of the cube (m)."""
    per_side: float
    """1 / side with periodic walls, 0 with reflecting walls. The nearest image of a difference d is
    d - side * rint(d * per_side), which is d itself between reflecting walls."""
    half_cell: float
    """Half the side of a sphere's cell (m)."""
    grid_per_metre: float
    grid: int
    """Boxes of the grid along an axis, at least 3 with periodic walls; a box is as wide as the reach of a list."""
    restitution: float
    contact_duration: float
    """Collisions within this time of another are elastic (s)."""
    set_back: float
    """The clocks are set back when they exceed this (s), so that round-off does not grow with the simulated time."""


def make_state(
    positions: Floats,
    velocities: Floats,
    radii: Floats,
    masses: Floats,
    *,
    side: float,
    periodic: bool,
    restitution: float,
    duration: float = math.inf,
) -> State:
    """Create the state at time 0, without events; see `event_loop.start`. For a short duration (s), lists are short."""
    count = len(radii)
    spheres, centres = _aligned((count, 8)), _aligned((count, 4))
    spheres[:, X : X + 3], spheres[:, VELOCITY : VELOCITY + 3] = positions, velocities
    spheres[:, RADIUS] = centres[:, 3] = radii
    fastest = float(np.abs(velocities).max()) or 1.0
    half_cell = min(largest_half_cell(count, float(radii.max()), side, periodic), fastest * duration)
    grid = max(1, int(side / (2.0 * (float(radii.max()) + half_cell) * (1.0 + 1e-9))))
    times, winners = empty_tree(count)
    speed = math.sqrt(float((velocities**2).sum()) / count) or 1.0
    passing = side / count ** (1.0 / 3.0) / speed
    return State(
        spheres=spheres,
        centres=centres,
        masses=masses.copy(),
        last_hit=np.full(count, -np.inf),
        neighbours=_aligned((count, INDICES_PER_LINE * ROW_LINES), np.int32),
        counts=np.zeros(count, np.int32),
        members=_aligned((grid**3, INDICES_PER_LINE), np.int32),
        candidates=_candidates(INDICES_PER_LINE),
        boxes=np.full(count, NOTHING, np.int32),
        partners=np.full(count, NOTHING, np.int32),
        expected=np.zeros(count, np.int32),
        hits=np.zeros(count, np.int32),
        times=times,
        winners=winners,
        totals=np.zeros(5),
        side=side,
        per_side=1.0 / side if periodic else 0.0,
        half_cell=half_cell,
        grid_per_metre=grid / side,
        grid=grid,
        restitution=restitution,
        contact_duration=CONTACT_DURATION * passing,
        set_back=2.0 ** round(math.log2(SET_BACK * passing)),
    )


def positions_at(state: State, time: float) -> Floats:
    """Return the centres (N, 3) at a time (s since the start) before which nothing is due; periodic: not wrapped."""
    since = time - state.totals[EPOCH] - state.spheres[:, CLOCK, None]
    return np.asarray(state.spheres[:, X : X + 3] + since * state.spheres[:, VELOCITY : VELOCITY + 3])


def largest_half_cell(count: int, radius: float, side: float, periodic: bool) -> float:
    """Return half the side of the cells (m); at most 0 if periodic walls are too near for spheres of this radius (m).

    With periodic walls, the grid needs three boxes along an axis, and two spheres whose cells are within reach must
    stay nearer than half the side, so that only their nearest images can touch.
    """
    half: float = CELL * side / count ** (1.0 / 3.0)
    if not periodic:
        return half
    return min(half, (side / 3.0 - 2.0 * radius) / 2.1, (side / 2.0 - 2.0 * radius) / 4.1)


def with_wider_rows(state: State) -> State:
    """Copy the lists and the boxes into rows of about twice the capacity."""
    lines = 2 * (state.neighbours.shape[1] // INDICES_PER_LINE) + 1
    members = _wider(state.members, 2 * state.members.shape[1])
    neighbours = _wider(state.neighbours, lines * INDICES_PER_LINE)
    return state._replace(neighbours=neighbours, members=members, candidates=_candidates(members.shape[1]))


def _wider(rows: Indices, capacity: int) -> Indices:
    wider: Indices = _aligned((len(rows), capacity), np.int32)
    wider[:, : rows.shape[1]] = rows
    return wider


def _candidates(capacity: int) -> Indices:
    """Memory for the spheres of 27 full boxes."""
    return np.zeros(27 * capacity, np.int32)


def _aligned(shape: tuple[int, ...], dtype: type = np.float64) -> NDArray[Any]:
    """Zeros that begin at a cache line."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.zeros(size + CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % CACHE_LINE
    return memory[start : start + size].view(dtype).reshape(shape)
