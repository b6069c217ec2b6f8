"""`HardSpheres`: spheres that fly straight and collide at exact times, simulated from event to event."""

from __future__ import annotations

import math
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import as_numbers
from collision_monitor.errors import InputError
from collision_monitor.world.hard_spheres.event_loop import (
    DONE,
    EVENTS_PER_CALL,
    LOG_FULL,
    PAUSED,
    ROWS_FULL,
    run_events,
    start,
)
from collision_monitor.world.hard_spheres.starting_points import overlapping_spheres, place_spheres, thermal
from collision_monitor.world.hard_spheres.state import (
    COLLISIONS,
    EPOCH,
    LOGGED,
    VELOCITY,
    VIRIAL,
    WALL_IMPULSE,
    Floats,
    largest_half_cell,
    make_state,
    positions_at,
    with_wider_rows,
)

Walls = Literal["reflecting", "periodic"]

COLLISION: Final = np.dtype([("time", np.float64), ("a", np.int32), ("b", np.int32)])
"""A collision at a time (s) of sphere `a` with sphere `b`. Walls are -1 (x = 0), -2 (x = side), -3 (y = 0) to -6."""

MOST_SPHERES: Final = 100_000
PACKINGS: Final = (1e-6, 0.7)
"""Range of the packing. Equal spheres cannot fill more than 0.7405 of space."""
LARGEST_RATIO: Final = 10.0
"""Largest ratio of two radii. Lists of large spheres among small ones grow with its third power."""
EVENTS_AT_START: Final = 150
"""Events per sphere before time 0, in which the lattice of the start melts."""
LOG_ROWS: Final = 100_000
TOUCHING: Final = 1e-12
"""Part of its radius by which a sphere that has just collided may overlap the other or a wall: round-off."""


class HardSpheres:
    """Hard spheres in a cube, simulated from event to event: no time step, no overlap, no collision missed.

    Each collision happens at its exact time, to round-off. The same arguments give the same bits, and it does not
    matter into how many runs a time is divided. A sphere of 1 m diameter has a mass of 1 kg; all have one density.
    Source: slides "List of collisions"; B. J. Alder and T. E. Wainwright, J. Chem. Phys. 31, 459 (1959);
    F. Smallenburg, Eur. Phys. J. E 45, 22 (2022).
    """

    def __init__(
        self,
        count: int,
        packing: float,
        seed: int = 1,
        restitution: float = 1.0,
        radii: ArrayLike = 0.5,
        walls: Walls = "reflecting",
    ) -> None:
        """Place `count` spheres at random in a cube that they fill by the part `packing`, in thermal equilibrium.

        radii: m, one number or (count,). Velocities have a standard deviation of 1 m/s along each axis for the mean
        mass. restitution: of spheres and walls. walls: "reflecting" turns spheres back; "periodic" repeats the cube in
        space. Raises InputError.
        """
        if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_SPHERES:
            raise InputError(f"count: expected a whole number from 1 to {MOST_SPHERES}, got {count!r}")
        if not PACKINGS[0] <= packing <= PACKINGS[1]:
            raise InputError(f"packing: expected {PACKINGS[0]:g} to {PACKINGS[1]:g}, got {packing!r}")
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise InputError(f"seed: expected a whole number from 0, got {seed!r}")
        sizes = _radii(radii, count)
        periodic = _is_periodic(walls)
        side = float((4.0 / 3.0 * np.pi * (sizes**3).sum() / packing) ** (1.0 / 3.0))
        _check_side(side, sizes, periodic, "packing")
        restitution = _restitution(restitution)
        random = np.random.default_rng(seed)
        masses = _masses(sizes)
        positions = place_spheres(sizes, side, periodic, random)
        self._begin(positions, thermal(masses, periodic, random), sizes, side, periodic, 1.0)
        self._melt()
        self._begin(self.positions, self.velocities, sizes, side, periodic, restitution)

    @classmethod
    def placed(
        cls,
        positions: ArrayLike,
        velocities: ArrayLike,
        side: float,
        *,
        restitution: float = 1.0,
        radii: ArrayLike = 0.5,
        walls: Walls = "reflecting",
    ) -> HardSpheres:
        """Start with these positions (N, 3) (m) and velocities (N, 3) (m/s) in a cube from 0 to `side` (m).

        Raises InputError, also if spheres overlap each other or a wall by more than round-off.
        """
        at, moving = _rows(positions, "positions"), _rows(velocities, "velocities")
        if len(at) != len(moving) or not 1 <= len(at) <= MOST_SPHERES:
            raise InputError(
                f"positions and velocities: expected one row for each of 1 to {MOST_SPHERES} spheres, "
                f"got {len(at)} and {len(moving)} rows"
            )
        sizes, periodic = _radii(radii, len(at)), _is_periodic(walls)
        if not (math.isfinite(side) and side > 0.0):
            raise InputError(f"side: expected a finite length above 0 m, got {side!r}")
        _check_side(float(side), sizes, periodic, "side")
        within = (1.0 - TOUCHING) * sizes
        if not periodic and not ((at >= within[:, None]) & (at <= side - within[:, None])).all():
            raise InputError(f"positions: expected all spheres between the walls at 0 and {side:g} m, got some outside")
        pairs = overlapping_spheres(at, within, float(side) if periodic else None)
        if len(pairs):
            raise InputError(f"positions: expected no overlaps, spheres {pairs[0, 0]} and {pairs[0, 1]} overlap")
        spheres = cls.__new__(cls)
        spheres._begin(at, moving, sizes, float(side), periodic, _restitution(restitution))
        return spheres

    def _begin(
        self, positions: Floats, velocities: Floats, radii: Floats, side: float, periodic: bool, restitution: float
    ) -> None:
        self.radii, self.masses, self.side = radii, _masses(radii), side
        self.time = 0.0
        """Time since the start (s)."""
        self._state = make_state(
            positions, velocities, radii, self.masses, side=side, periodic=periodic, restitution=restitution
        )
        while not start(self._state):
            self._widen()
        self._kinetic_at_start = self.energy
        self._run_began, self._totals_at_begin = 0.0, self._state.totals.copy()
        self._log_times, self._log_pairs = np.zeros(0), np.zeros((0, 2), np.int32)

    def _melt(self) -> None:
        """Simulate EVENTS_AT_START events for each sphere."""
        left = EVENTS_AT_START * len(self.radii)
        while left > 0:
            part = min(left, EVENTS_PER_CALL)
            if run_events(self._state, math.inf, part, self._log_times, self._log_pairs) == ROWS_FULL:
                self._widen()
            left -= part
        if self._state.times[1] < math.inf:
            self.time = float(self._state.totals[EPOCH] + self._state.times[1])

    def _widen(self) -> None:
        self._state = with_wider_rows(self._state)

    def run(self, seconds: float, record: bool = False) -> NDArray[np.void]:
        """Simulate this time (s) and return the collisions in it in order, (n,) of COLLISION; none unless `record`.

        Raises InputError.
        """
        if not (math.isfinite(seconds) and seconds >= 0.0):
            raise InputError(f"seconds: expected a finite time of at least 0 s, got {seconds!r}")
        self._run_began, self._totals_at_begin = self.time, self._state.totals.copy()
        self._kinetic_at_start = self.energy
        until = self.time + seconds
        rows = LOG_ROWS if record else 0
        log = np.zeros(rows), np.zeros((rows, 2), np.int32)
        parts: list[NDArray[np.void]] = []
        reason = PAUSED
        while reason != DONE:
            reason = run_events(self._state, until, EVENTS_PER_CALL, *log)
            if reason == ROWS_FULL:
                self._widen()
            if reason == LOG_FULL or (record and reason == DONE):
                parts.append(self._logged(*log))
        self.time = until
        return np.concatenate(parts) if parts else np.zeros(0, COLLISION)

    def _logged(self, times: Floats, pairs: NDArray[np.int32]) -> NDArray[np.void]:
        """Take the rows of the log out of it."""
        rows = int(self._state.totals[LOGGED])
        taken = np.zeros(rows, COLLISION)
        taken["time"], taken["a"], taken["b"] = times[:rows], pairs[:rows, 0], pairs[:rows, 1]
        self._state.totals[LOGGED] = 0
        return taken

    @property
    def positions(self) -> Floats:
        """Centres at `time`, (N, 3) from 0 to `side` (m)."""
        at = positions_at(self._state, self.time)
        return np.asarray(np.mod(at, self.side) if self.is_periodic else at)

    @property
    def velocities(self) -> Floats:
        """Velocities at `time`, (N, 3) (m/s)."""
        return self._state.spheres[:, VELOCITY : VELOCITY + 3].copy()

    @property
    def is_periodic(self) -> bool:
        """Whether the cube is repeated in space."""
        return self._state.per_side != 0.0

    @property
    def collisions(self) -> int:
        """Number of collisions of two spheres since the start."""
        return int(self._state.totals[COLLISIONS])

    @property
    def packing(self) -> float:
        """Part of the cube that the spheres fill."""
        return float(4.0 / 3.0 * np.pi * (self.radii**3).sum() / self.side**3)

    @property
    def energy(self) -> float:
        """Kinetic energy (J)."""
        return float(0.5 * (self.masses * (self.velocities**2).sum(axis=1)).sum())

    @property
    def momentum(self) -> Floats:
        """Total momentum, (3,) (kg m/s)."""
        return np.asarray((self.masses[:, None] * self.velocities).sum(axis=0))

    @property
    def pressure(self) -> float:
        """Mean pressure (Pa) in the last run; NaN before the first.

        Periodic walls: by the virial of the collisions. Reflecting walls: the momentum that they took, by area and
        time. With restitution below 1, the kinetic part of the virial is the mean of the run's start and end.
        """
        seconds = self.time - self._run_began
        if seconds <= 0.0:
            return math.nan
        since = self._state.totals - self._totals_at_begin
        if not self.is_periodic:
            return float(since[WALL_IMPULSE] / (6.0 * self.side**2 * seconds))
        kinetic = self.energy + self._kinetic_at_start
        return float((kinetic + since[VIRIAL] / seconds) / (3.0 * self.side**3))

    @property
    def compressibility(self) -> float:
        """Pressure of the last run divided by that of an ideal gas of as many spheres and the same energy."""
        return self.pressure * self.side**3 / (self.energy + self._kinetic_at_start) * 3.0


def carnahan_starling(packing: float) -> float:
    """Compressibility of a fluid of equal hard spheres: N. F. Carnahan and K. E. Starling, J. Chem. Phys. 51 (1969)."""
    return (1.0 + packing + packing**2 - packing**3) / (1.0 - packing) ** 3


def _masses(radii: Floats) -> Floats:
    return np.asarray((2.0 * radii) ** 3)


def _radii(radii: ArrayLike, count: int) -> Floats:
    sizes = as_numbers(radii, "radii")
    if sizes.shape not in ((), (count,)):
        raise InputError(f"radii: expected one number or {count} numbers, got an array of shape {sizes.shape}")
    if not (np.isfinite(sizes).all() and (sizes > 0.0).all()):
        raise InputError("radii: expected finite lengths above 0 m, got others")
    if sizes.max() > LARGEST_RATIO * sizes.min():
        raise InputError(
            f"radii: expected at most {LARGEST_RATIO:g} times the smallest, got {sizes.min():g} to {sizes.max():g} m"
        )
    return np.broadcast_to(sizes, (count,)).copy()


def _rows(values: ArrayLike, name: str) -> Floats:
    array = as_numbers(values, name)
    if array.ndim != 2 or array.shape[1] != 3 or not np.isfinite(array).all():
        raise InputError(f"{name}: expected an array (N, 3) of finite numbers, got shape {array.shape}")
    return array


def _restitution(value: float) -> float:
    if not 0.0 <= value <= 1.0:
        raise InputError(f"restitution: expected 0 to 1, got {value!r}")
    return float(value)


def _is_periodic(walls: Any) -> bool:
    if walls not in get_args(Walls):
        raise InputError(f"walls: expected one of {', '.join(get_args(Walls))}, got {walls!r}")
    return bool(walls == "periodic")


def _check_side(side: float, radii: Floats, periodic: bool, name: str) -> None:
    """Refuse a cube that is too narrow. Raises InputError."""
    largest = float(radii.max())
    if not periodic and side <= 2.0 * largest:
        raise InputError(f"{name}: expected a cube wider than the largest sphere, {2 * largest:g} m, got {side:g} m")
    if periodic and largest_half_cell(len(radii), largest, side, True) < 0.01 * largest:
        raise InputError(
            f"{name}: expected a cube of more than {6.05 * largest:g} m with periodic walls, so that a sphere meets at "
            f"most one image of another, got {side:g} m; take more spheres or reflecting walls"
        )
