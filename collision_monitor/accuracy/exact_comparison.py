"""Comparison of single answers with exact ones: the error of each number, relative to its stated bound."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy import exact
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.query.contact.contact import contact
from collision_monitor.query.impact.time_of_impact import time_of_impact
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Sphere

Rng = np.random.Generator
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Configuration:
    """Parameters of a random pair of bodies. None: chosen at random.

    size: m. ratio: size of the second to the first body. origin, gap, thickness (of the boxes): in sizes. speed: m/s.
    spin: rad/s. horizon: s. angle: rad, between the orientations.
    """

    size: float = 1.0
    ratio: float = 1.0
    origin: float = 0.0
    gap: float | None = None
    speed: float = 1.0
    spin: float = 0.0
    horizon: float = 2.0
    angle: float | None = None
    thickness: float | None = None


@dataclass(frozen=True)
class Sample:
    """Comparison of one answer with the exact one.

    error: relative to the sizes of both bodies, or to the time of impact. ratio: error divided by the stated bound. If
    it is above 1, the exact answer is outside the bound. finite: whether all numbers of the answer are finite.
    """

    quantity: str
    error: float
    ratio: float
    finite: bool


def _turn(rng: Rng) -> Floats:
    q = rng.normal(size=4)
    return np.asarray(q / np.linalg.norm(q))


def _direction(rng: Rng) -> Floats:
    d = rng.normal(size=3)
    return np.asarray(d / np.linalg.norm(d))


def _near(turn: Floats, angle: float, rng: Rng) -> Floats:
    """Rotate an orientation by an angle (rad) about a random axis."""
    axis = _direction(rng) * math.sin(angle / 2)
    x, y, z, w = *axis, math.cos(angle / 2)
    a, b, c, d = turn
    q = np.array([
        w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c,
    ])  # fmt: skip
    return np.asarray(q / np.linalg.norm(q))


def samples_of(case: Configuration, rng: Rng) -> Iterator[Sample]:
    """Yield one comparison of each quantity, on random bodies of this configuration."""
    size, other = case.size, case.size * case.ratio
    at = case.origin * size * _direction(rng)
    gap = (case.gap if case.gap is not None else rng.uniform(0.05, 1.0)) * size
    u = _turn(rng)
    v = _near(u, case.angle, rng) if case.angle is not None else _turn(rng)
    away = _direction(rng)

    r, s = size * rng.uniform(0.3, 0.5), other * rng.uniform(0.3, 0.5)
    scale = size + other
    a, b = Pose(at), Pose(at + (r + s + gap) * away)
    truth = exact.exact_sphere_sphere(a.position, b.position, r, s)
    yield _compared("sphere–sphere", contact(Sphere(r), a, Sphere(s), b), truth, scale)

    box = other * rng.uniform(0.5, 1.0, 3)
    if case.thickness is not None:
        box[rng.integers(3)] = other * case.thickness
    b = Pose(at + _facing(box, v, rng, r + gap), v)
    truth = exact.sphere_box(a.position, r, b.position, b.quaternion, box)
    yield _compared("sphere–box", contact(Sphere(r), a, Box(box), b), truth, scale)

    core_a, core_b = size * rng.uniform(0.5, 1.0), other * rng.uniform(0.5, 1.0)
    a = Pose(at, u)
    b = Pose(at + away * (r + s + gap) + (core_a * rng.uniform(-0.3, 0.3)) * _direction(rng), v)
    truth = exact.capsule_capsule(a.position, a.quaternion, r, core_a, b.position, b.quaternion, s, core_b)
    yield _compared("capsule–capsule", contact(Capsule(r, core_a), a, Capsule(s, core_b), b), truth, scale)

    mine = size * rng.uniform(0.5, 1.0, 3)
    if case.thickness is not None:
        mine[rng.integers(3)] = size * case.thickness
    depth = case.gap * size if case.gap is not None else size * rng.uniform(0.01, 0.1)
    inside = _facing(box, v, rng, mine.min() / 4 - min(depth, mine.min() / 8))
    a, b = Pose(at - inside, u), Pose(at, v)
    overlap = exact.box_box_depth(a.position, a.quaternion, mine, b.position, b.quaternion, box)
    if overlap is not None:
        yield _compared("box–box depth", contact(Box(mine), a, Box(box), b), overlap, scale)

    yield _meeting("spheres meet", case, Sphere(r), Sphere(s), (r + s + gap) * away, rng, at)
    yield _meeting(
        "boxes meet", case, Box(mine), Box(box), (mine + box) / 2 * away / np.abs(away).max() + gap * away, rng, at
    )


def _facing(box: Floats, turn: Floats, rng: Rng, gap: float) -> Floats:
    """Offset from a point to the centre of a box. The point is at a distance of `gap` from a random face of the box."""
    k = int(rng.integers(3))
    local = box / 2 * rng.uniform(-0.9, 0.9, 3)
    local[k] = box[k] / 2 + gap
    return np.asarray(-(Pose((0, 0, 0), turn).rotation @ local))


def _compared(quantity: str, answer: Any, truth: Decimal, scale: float) -> Sample:
    numbers = (answer.signed_distance, answer.error_bound, *answer.normal, *answer.point_a, *answer.point_b)
    if not np.isfinite(numbers).all():
        return Sample(quantity, math.inf, math.inf, finite=False)
    error = float(abs(Decimal(answer.signed_distance) - truth))
    return Sample(quantity, error / scale, _ratio(error, answer.error_bound), finite=True)


def _ratio(error: float, bound: float) -> float:
    return error / bound if bound > 0.0 else 0.0 if error == 0.0 else math.inf


def _meeting(
    quantity: str, case: Configuration, shape_a: Any, shape_b: Any, offset: Floats, rng: Rng, at: Floats
) -> Sample:
    """Compare the interval of the first impact with the exact time. The error is that of the lower end."""
    spheres = isinstance(shape_a, Sphere)
    distance = float(np.linalg.norm(offset))
    velocity = -offset / distance * case.speed + 0.05 * case.speed * rng.normal(size=3)
    start = at + offset  # rounded here, so that the exact answer has the same input
    p = start - at
    # spin does not change a ball; boxes do not spin, because the exact answer needs aligned boxes
    spin = case.spin * _direction(rng) if spheres else np.zeros(3)
    a, b = Motion(Pose(at), (0, 0, 0), spin), Motion(Pose(start), velocity, -spin)
    tolerance = 1e-9 * case.size
    answer = time_of_impact(shape_a, a, shape_b, b, case.horizon, tolerance)
    if spheres:
        truth = exact.spheres_meet(p, velocity, (shape_a.radius, shape_b.radius))
    else:
        truth = exact.aligned_boxes_meet(p, velocity, shape_a.size, shape_b.size)
    horizon = Decimal(case.horizon)
    if truth is None or truth > horizon:
        wrong = answer.status == "hit" and Decimal(answer.upper) < horizon * Decimal("0.999999")
        return Sample(quantity, 0.0, 2.0 if wrong else 0.0, finite=True)
    if answer.status == "clear" or math.isnan(answer.lower) or math.isnan(answer.upper):
        return Sample(quantity, math.inf, math.inf, finite=answer.status != "clear")
    late = Decimal(answer.lower) - truth
    early = truth - Decimal(answer.upper) if math.isfinite(answer.upper) else Decimal(-1)
    scale = max(float(truth), case.horizon * 1e-9)
    slack = 4e-16 * scale + 4e-16 * float(np.abs(at).max()) / case.speed
    outside = max(float(late), float(early), 0.0)
    return Sample(quantity, float(abs(late)) / scale, 2.0 if outside > slack else outside / slack, finite=True)


def stamp_samples() -> Iterator[Sample]:
    """Yield a comparison of a monitor's answers at stamps near 2^63 ns with those near 0."""
    answers = []
    for begin in (0, 2**63 - 10**10):
        monitor = Monitor("exact")
        monitor.add(1, Sphere(0.5))
        monitor.add(2, Box((1, 1, 1)))
        rows = []
        for k in range(20):
            poses = [(0.05 * k, 0, 0, 0, 0, 0, 1), (3, 0.1, 0, 0, 0, 0, 1)]
            result = monitor.step(begin + k * 50_000_000, [1, 2], poses, [(1, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 1)])
            rows += result.predictions["lower"].tolist() + result.contact_rows["signed_distance"].tolist()
        answers.append(np.array(rows))
    early, late = answers
    same = early.shape == late.shape
    error = float(np.nanmax(np.abs(early - late))) if same and len(early) else math.inf
    yield Sample("monitor", error, 0.0 if same and error <= 1e-6 else 2.0, finite=bool(np.isfinite(late).all()))
