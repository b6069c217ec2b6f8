"""First impact of two bodies that touch at the start: they part, slide, roll or rest, or they penetrate.

Along a fixed direction in which two convex pieces do not overlap, the gap after a time t has a lower bound that is
concave in t (see impact/advance.py). Between two times, the bound is at least the smaller of its values there. If
it keeps the pieces from overlapping until they are apart, or for the whole horizon, touching is no impact.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import TooCostlyError
from collision_monitor.impact.impact_record import HIT
from collision_monitor.motion.bodies import Multibody
from collision_monitor.narrow_phase.contact_row import as_contacts
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.query.contact.contact import contact
from collision_monitor.query.impact.moving_pair import MotionQuery, MovingShape, first_impacts, lay_out_pair
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import kind_of

Array = NDArray[np.float64]

PARTING_TIMES: Final = 80
"""Number of times tried for the parting of touching shapes: the horizon, half of it, …, down to 1e-24 of it."""

MOST_PAIRS: Final = 1_000_000
"""Most pairs of pieces to follow, 2 s. Two meshes that coincide have more, and all of them touch."""

AT_ONCE: Final = 10_000
"""Pairs of pieces whose first impacts are computed together."""

MOST_TRIES: Final = 4_000
"""Most directions to try for the pairs of pieces that touch, 1 s. Thousands of slivers in one line need more."""

DEEPENING_TIMES: Final = 40
"""Number of times tried for their penetration, a distance query each: down to 1e-12 of the horizon."""

MANY_PIECES: Final = 10_000
"""Pieces of two objects from which on a distance query takes so long that every fifth of these times is tried."""

_HERE: Final = Pose()

ALIGNED: Final = 1e-12
"""Sine of an angle that counts as zero. It changes a support value by this part of the size, less than GJK_TOUCHING.
Larger: the change comes near GJK_TOUCHING. Smaller: a wheel whose axis is rounded no longer rolls."""


class ImpactInterval(NamedTuple):
    """First impact (s) of bodies that touch at the start; lower is infinite for none, upper for an uncertain one."""

    lower: float
    upper: float


def _interval(event: np.void) -> ImpactInterval:
    return ImpactInterval(float(event["lower"]), float(event["upper"]) if event["status"] == HIT else math.inf)


def follow(a: MovingShape, b: MovingShape, query: MotionQuery, round_off: float) -> ImpactInterval:
    """First impact of two bodies that touch at the start: the time at which they are deeper than `round_off` (m).

    Raises TooCostlyError for more than MOST_PAIRS pairs of pieces, or MOST_TRIES directions.
    """
    if len(a.pieces) * len(b.pieces) > MOST_PAIRS:
        raise TooCostlyError(f"expected at most {MOST_PAIRS} pairs of pieces, got {len(a.pieces) * len(b.pieces)}")
    multibody = lay_out_pair(a, b, query.horizon, apart=True)
    touching, later = _pairs(a, b, multibody, query)
    directions = list({normal.tobytes(): normal for _, _, normal in touching}.values())
    tries = 0
    for i, j, normal in touching:
        parted = -math.inf
        for n in chain([normal], directions):
            tries += 1
            if tries > MOST_TRIES:
                raise TooCostlyError(f"expected at most {MOST_TRIES} directions in which touching pieces part")
            parted = max(parted, _parting_time(_Piece(a, i), _Piece(b, j), n, query, round_off))
            if parted > 0.0:
                break
        if parted <= 0.0:
            pairs = np.array([(i, len(a.pieces) + j) for i, j, _ in touching], np.int32)
            return ImpactInterval(0.0, _deep_by(a, b, multibody, pairs, query, round_off))
        if parted < query.horizon:
            again = first_impacts(multibody, np.array([[i, len(a.pieces) + j]], np.int32), parted, query)
            later += [_interval(event) for event in again]
    if not later:
        return ImpactInterval(math.inf, math.inf)
    lower, upper = min(e.lower for e in later), min(e.upper for e in later)
    # what slides over a surface is near its next triangle for long, and a later one may certainly be deep
    return ImpactInterval(lower, upper if upper < math.inf else _sampled_depth(a, b, query, _wanted(query, round_off)))


def _pairs(
    a: MovingShape, b: MovingShape, multibody: Multibody, query: MotionQuery
) -> tuple[list[tuple[int, int, Array]], list[ImpactInterval]]:
    """Return the pairs of pieces that touch, as (i, j, normal), and the impacts of the other pairs."""
    n, m = len(a.pieces), len(b.pieces)
    rotation = np.stack([body.motion.pose.rotation @ pose.rotation for body in (a, b) for _, pose in body.pieces])
    offset = b.motion.pose.position - a.motion.pose.position
    position = np.stack([body.motion.pose.rotation @ pose.position for body in (a, b) for _, pose in body.pieces])
    position[n:] += offset
    touching: list[tuple[int, int, Array]] = []
    later: list[ImpactInterval] = []
    pairs = np.stack(np.meshgrid(np.arange(n), np.arange(n, n + m), indexing="ij"), axis=-1).reshape(-1, 2)
    for first in range(0, n * m, AT_ONCE):
        events = first_impacts(multibody, pairs[first : first + AT_ONCE].astype(np.int32), 0.0, query)
        later += [_interval(event) for event in events if event["lower"] > 0.0]
        at_once = np.array([(e["i"], e["j"]) for e in events if e["lower"] <= 0.0], np.int32).reshape(-1, 2)
        normals = as_contacts(contact_batch(multibody.table, position, rotation, at_once))["normal"]
        touching += [(int(i), int(j) - n, normal) for (i, j), normal in zip(at_once, normals, strict=True)]
    return touching, later


class _Piece:
    """Convex piece of a moving body at the start, in world axes, relative to the body's origin."""

    def __init__(self, body: MovingShape, index: int) -> None:
        self.shape, pose = body.pieces[index]
        self.origin, self.velocity, self.angular = body.motion.pose.position, body.motion.linear, body.motion.angular
        self.acceleration = body.motion.acceleration
        self.rotation = body.motion.pose.rotation @ pose.rotation
        self.offset = body.motion.pose.rotation @ pose.position
        self.rate = float(np.linalg.norm(self.angular))
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        unbounded = self.rate == 0.0
        self.radius = (
            0.0 if unbounded else float(np.linalg.norm(reach([(self.shape, _HERE)], axes).reshape(2, 3).max(0)))
        )

    def support(self, directions: Array) -> Array:
        """Return max d . x (n,) over its points x about its own origin, for directions d (n, 3) of any length."""
        length = np.linalg.norm(directions, axis=1)
        unit = directions / length[:, None]
        return np.asarray(length * reach([(self.shape, _HERE)], unit @ self.rotation))

    def advance(self, n: Array, times: Array) -> Array:
        """Return upper bounds (T,) on the growth (m) of its reach along n (3,) by its rotation in the times (T,)."""
        if self.rate == 0.0:
            return np.zeros(len(times))
        axis = self.angular / self.rate
        across = float(np.linalg.norm(np.cross(n, axis)))
        if across <= ALIGNED:
            return np.zeros(len(times))
        turn = np.cross(n, self.angular)
        bend = 0.5 * (self.rate * times) ** 2 * across
        farther = times * float(turn @ self.offset) + bend * float(np.linalg.norm(self.offset))
        if not self._is_round_about(axis):
            turned = n + times[:, None] * turn
            farther = farther + self.support(turned) - self.support(n[None]) + bend * self.radius
        return np.asarray(farther)

    def _is_round_about(self, axis: Array) -> bool:
        """Whether a rotation about the axis (3,) through its own origin leaves the piece unchanged."""
        kind = kind_of(self.shape)
        along = float(np.linalg.norm(np.cross(self.rotation[:, 2], axis))) <= ALIGNED
        return kind.ball or (kind.revolved and along)


def _parting_time(a: _Piece, b: _Piece, n: Array, query: MotionQuery, round_off: float) -> float:
    """Return a time until which they certainly get no deeper: one at which they are apart, or the horizon; else 0."""
    between = b.origin - a.origin + (b.offset - a.offset)
    gap = float(n @ between) - float(a.support(n[None])[0]) - float(b.support(-n[None])[0]) - query.separation
    if not gap >= -round_off:
        return 0.0
    times: Array = query.horizon * np.exp2(-np.arange(PARTING_TIMES, dtype=np.float64))
    least = gap + times * float(n @ (b.velocity - a.velocity)) - a.advance(n, times) - b.advance(-n, times)
    # only an acceleration that closes the gap keeps the bound concave
    least += 0.5 * times**2 * min(0.0, float(n @ (b.acceleration - a.acceleration)))
    # twice the tolerance: the SAT gap of boxes is at least half of their distance, enough for a new start
    clear = np.flatnonzero(least > 2.0 * query.tolerance)
    if len(clear):
        return float(times[clear[0]])
    return query.horizon if least[0] >= -round_off else 0.0


def _deep_by(
    a: MovingShape, b: MovingShape, multibody: Multibody, pairs: NDArray[np.int32], query: MotionQuery, round_off: float
) -> float:
    """Return a time (s) at which they are certainly deeper than `round_off` (m), an early one if easy, or infinity."""
    wanted = _wanted(query, round_off)
    events = first_impacts(multibody, pairs, 0.0, query, wanted)
    sure = [float(e["upper"]) for e in events if e["status"] == HIT and e["upper"] <= query.horizon]
    if sure:
        return min(sure)
    return _sampled_depth(a, b, query, wanted)


def _wanted(query: MotionQuery, round_off: float) -> float:
    """Distance (m) below which they are certainly deeper than round-off."""
    return query.separation - 2.0 * round_off


def _sampled_depth(a: MovingShape, b: MovingShape, query: MotionQuery, wanted: float) -> float:
    """Return an early one of some times (s) at which they are nearer than `wanted` (m), or infinity."""
    found = math.inf
    step = 1 if len(a.pieces) + len(b.pieces) < MANY_PIECES else 5
    for t in query.horizon * 0.5 ** np.arange(0, DEEPENING_TIMES, step):
        distance = contact(a.shapes, a.motion.at(t), b.shapes, b.motion.at(t)).signed_distance
        if distance < wanted:
            found = float(t)
        elif found < math.inf:
            break
    return found
