"""Probabilities by cutting planes, against the slow method that follows each sample exactly (sampled_impacts.py)."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.monitor import pair_probabilities
from collision_monitor.monitor.uncertain_predictions import sigmas_for
from collision_monitor.records import STATE
from collision_monitor.settings.profile import Profile
from collision_monitor.uncertainty.pair_errors import ROUNDING
from collision_monitor.uncertainty.plane_impacts import FACETS
from collision_monitor.uncertainty.plane_memory import make_plane_memory
from collision_monitor.uncertainty.plane_probability import LEFT, plane_probabilities
from collision_monitor.uncertainty.sampled_impacts import Sampling, impact_probabilities
from collision_monitor.uncertainty.samples.error_samples import make_workspace
from collision_monitor.uncertainty.samples.normal_samples import normal_samples, sample_columns

SAMPLES = 1024
SHAPES = {
    "ball": cm.Sphere(0.4),
    "box": cm.Box((0.9, 0.5, 0.7)),
    "capsule": cm.Capsule(0.2, 0.8),
    "cylinder": cm.Cylinder(0.3, 0.8),
    "cone": cm.Cone(0.4, 0.9),
    "ellipsoid": cm.Ellipsoid((0.5, 0.3, 0.4)),
    "hull": cm.ConvexHull(np.random.default_rng(1).normal(0, 0.3, (12, 3))),
    "ball aside": [(cm.Sphere(0.3), cm.Pose((0.4, 0.2, 0)))],
    "two boxes": [(cm.Box((0.8, 0.5, 0.3)), cm.Pose()), (cm.Box((0.1, 0.4, 0.9)), cm.Pose((0.3, 0, 0.4)))],
}


UPRIGHT = {
    "person": cm.Cylinder(0.25, 1.75),
    "disc": cm.Circle(0.4),
    "polygon": cm.Polygon([(0.5, -0.3), (0.4, 0.4), (-0.6, 0.2)]),
}

CORNERS = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
DENTED = cm.Mesh(
    [*CORNERS, (0.2, 0.0, 0.0)],  # a cube with the face at x = 0.5 pressed in
    [
        (0, 1, 3), (0, 3, 2), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
        (4, 6, 8), (6, 7, 8), (7, 5, 8), (5, 4, 8),
    ],
)  # fmt: skip


def sampling_for(monitor: cm.Monitor, stated: bool) -> Sampling:
    """Settings of the default profile."""
    p = Profile()
    return Sampling(
        monitor._settings.impact, p.horizon, p.stale_acceleration, stated, sigmas_for(p.min_probability),
        sigmas_for(p.min_probability * (1.0 - p.confidence)), p.min_probability, p.confidence, monitor._roster.planar,
        *normal_samples(SAMPLES),
    )  # fmt: skip


def both_methods(monitor: cm.Monitor, stated: bool, *, swapped: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Answers (1, 4) for the pair of slots 0 and 1, or 1 and 0: exact samples, and planes."""
    roster, spread, sampling = monitor._roster, monitor._uncertain.spread, sampling_for(monitor, stated)
    pairs, work, answers = np.array([[1, 0] if swapped else [0, 1]], np.int32), make_workspace(), np.empty((2, 1, 4))
    impact_probabilities(roster.multibody, spread, pairs, 0.0, sampling, work, answers[0])
    columns, memory = sample_columns(SAMPLES), make_plane_memory(SAMPLES)
    plane_probabilities(roster.multibody, spread, pairs, 0.0, sampling, columns, memory, work, answers[1])
    return answers[0], answers[1]


class Case(NamedTuple):
    """Random pairs: their shapes, how fast they turn (rad/s), and their errors."""

    shapes: tuple[str, ...] = tuple(SHAPES)
    spin: float = 0.0
    noise: tuple[float, float] = (0.02, 0.2)  # m and m/s
    turned: float = 0.0  # rad
    turning: float = 0.0  # rad/s
    upright: bool = False
    fewest: int = 25  # pairs to compare; the others are certain, or left to the exact method


CASES = {
    "straight": Case(),
    "turned": Case(turned=0.03, turning=0.03),
    "much turned": Case(turned=0.15),
    "turning": Case(spin=1.0, noise=(0.003, 0.01), turned=0.005, turning=0.005),
    "people": Case(("person",), upright=True),
    "tilted people": Case(("person",), upright=True, spin=0.3, turned=0.02, turning=0.02),
    "plane": Case(("disc", "polygon"), 0.3, (0.01, 0.03), turned=0.02, turning=0.02, upright=True, fewest=20),
}


def random_pair(rng: np.random.Generator, first: str, second: str, case: Case) -> tuple[cm.Monitor, bool]:
    """A monitor of two shapes that come near each other, after its first step, and whether they are stated to meet."""
    monitor = cm.Monitor()
    for k, name in enumerate((first, second)):
        monitor.add(k, SHAPES[name] if name in SHAPES else UPRIGHT[name])
    rows = np.zeros(2, STATE)
    rows["id"] = 0, 1
    level = np.array([1.0, 1.0, 0.0 if case.upright else 1.0])
    velocity = rng.normal(0, 1, 3) * level
    across = np.cross(velocity, rng.normal(0, 1, 3) * (1.0 - level) if case.upright else rng.normal(0, 1, 3))
    away = rng.uniform(0.7, 1.6)
    rows["position"][1] = -velocity * away + across / np.linalg.norm(across) * rng.uniform(0.0, 1.2)
    rows["linear"][1] = velocity
    rows["angular"] = case.spin * rng.normal(0, 1, (2, 3)) * (1.0 - level if case.upright else 1.0)
    q = np.array([[0.0, 0.0, 0.0, 1.0]] * 2) if case.upright else rng.normal(0, 1, (2, 4))
    rows["quaternion"] = q / np.linalg.norm(q, axis=1, keepdims=True)
    rows["position_stddev"], rows["velocity_stddev"] = rng.uniform(*case.noise, 2)
    rows["orientation_stddev"], rows["angular_velocity_stddev"] = case.turned, case.turning
    reported = monitor.step(0, rows)
    stated = bool((reported.predictions["status"] != 2).any())
    return monitor, stated


@pytest.mark.parametrize("name", CASES)
def test_planes_agree_with_exact_samples(name: str) -> None:
    case, rng = CASES[name], np.random.default_rng(3)
    errors, earliest = [], []
    for _ in range(60):
        first, second = rng.choice(case.shapes, 2)
        monitor, stated = random_pair(rng, str(first), str(second), case)
        if monitor.last is not None and len(monitor.last.contacts):
            continue
        exact, planes = (np.nan_to_num(answer[0], posinf=inf) for answer in both_methods(monitor, stated))
        if max(exact[3], planes[3]) < 0.01 or planes[3] == LEFT:
            continue
        errors.append(planes[3] - exact[3])
        if min(exact[3], planes[3]) > 0.05:
            earliest.append(planes[0] - exact[0])
    assert len(errors) > case.fewest
    assert np.sqrt(np.mean(np.square(errors))) < 0.006
    assert np.abs(errors).max() < 0.03
    assert abs(np.median(earliest)) < 0.01


@pytest.mark.parametrize("turned", [0.0, 0.05, 0.2])
def test_samples_that_are_foretold_are_as_good_as_those_that_are_followed(turned: float) -> None:
    rng, case = np.random.default_rng(4), Case(spin=1.0, noise=(0.03, 0.2), turned=turned, turning=turned)
    pairs, work, answers = np.array([[0, 1]], np.int32), make_workspace(), np.empty((2, 1, 4))
    errors, earlier, counts = [], [], []
    for _ in range(60):
        first, second = rng.choice(case.shapes, 2)
        monitor, stated = random_pair(rng, str(first), str(second), case)
        roster, spread, sampling = monitor._roster, monitor._uncertain.spread, sampling_for(monitor, stated)
        followed = [
            impact_probabilities(
                roster.multibody, spread, pairs, 0.0, sampling._replace(stops_early=early), work, answers[int(early)]
            )
            for early in (False, True)
        ]
        all_followed, some_followed = np.nan_to_num(answers[:, 0], posinf=inf)
        if all_followed[3] > 0.01:
            errors.append(some_followed[3] - all_followed[3])
            counts.append(followed[1] / followed[0])
            earlier.append(all_followed[0] - some_followed[0])
    assert len(errors) > 20
    assert 0.0 <= np.median(earlier) < 0.02
    assert np.sqrt(np.mean(np.square(errors))) < 0.004
    assert np.abs(errors).max() < 0.02
    assert np.mean(counts) < 0.7


def test_swapped_bodies_have_nearly_the_same_answers() -> None:
    rng = np.random.default_rng(8)
    for case in (CASES["straight"], CASES["turned"], CASES["turning"]):
        for _ in range(10):
            first, second = rng.choice(case.shapes, 2)
            seed = int(rng.integers(1 << 30))
            monitor, stated = random_pair(np.random.default_rng(seed), str(first), str(second), case)
            _, one = both_methods(monitor, stated)
            _, other = both_methods(monitor, stated, swapped=True)
            np.testing.assert_allclose(*np.nan_to_num([one[0, 3], other[0, 3]]), atol=0.03)


@pytest.mark.parametrize("change", ["mesh", "cloud"])
@pytest.mark.parametrize("distance", [3.0, 4.05])
def test_meshes_and_clouds_are_left_to_the_exact_method(change: str, distance: float) -> None:
    shapes = {"mesh": DENTED, "cloud": cm.Points(np.random.default_rng(2).uniform(-0.5, 0.5, (500, 3)), 0.01)}
    monitor = cm.Monitor()
    monitor.add(0, shapes[change])
    monitor.add(1, cm.Box((1, 1, 1)))
    rows = np.zeros(2, STATE)
    rows["id"], rows["quaternion"][:, 3] = (0, 1), 1.0
    rows["position"][1], rows["linear"][1] = (distance, 0.2, 0.1), (-1.5, 0, 0)
    rows["position_stddev"] = 0.05
    reported = monitor.step(0, rows).predictions
    exact, planes = both_methods(monitor, distance == 3.0)
    assert planes[0, 3] == LEFT
    assert reported["probability"][0] == pytest.approx(exact[0, 3], abs=0.02)  # with an eighth of the samples
    assert (exact[0, 3] > 0.9) == (distance == 3.0)


@pytest.mark.parametrize("stddev", [10.0, 1000.0])
def test_absurd_errors_have_bounded_answers(stddev: float) -> None:
    monitor = cm.Monitor()
    rows = np.zeros(4, STATE)
    for k, shape in enumerate((cm.Box((1, 2, 1)), cm.Capsule(0.3, 1), cm.Cylinder(0.3, 1), cm.Sphere(0.4))):
        monitor.add(k, shape)
    rows["id"], rows["quaternion"][:, 3] = np.arange(4), 1.0
    rows["position"][:, 0] = 3.0 * np.arange(4)
    for name in ("position", "orientation", "velocity", "angular_velocity"):
        rows[f"{name}_stddev"] = stddev
    reported = monitor.step(0, rows).predictions
    assert not np.isnan(reported["probability"]).any()
    assert ((reported["probability"] >= 0.0) & (reported["probability"] <= 1.0)).all()


@pytest.mark.parametrize("size", [1e-2, 1.0, 30.0, 1e3, 1e5, 1e14])
@pytest.mark.parametrize("stddev", [0.02, 1e-6])
@pytest.mark.parametrize("turned", [0.0, 0.2])
def test_single_precision_is_enough_or_the_pair_is_left(size: float, stddev: float, turned: float) -> None:
    """stddev: of position, in sizes of the bodies; turned: of orientation, in that of position."""
    corners = size * np.random.default_rng(1).normal(0, 0.3, (12, 3))
    shapes = (cm.Box((0.9 * size, 0.5 * size, 0.7 * size)), cm.Cylinder(0.3 * size, 0.8 * size), cm.ConvexHull(corners))
    compared = 0
    for seed in range(9):
        rng, monitor, rows = np.random.default_rng(seed), cm.Monitor(), np.zeros(2, STATE)
        for k in range(2):
            monitor.add(k, shapes[(seed // 3 + k * seed) % 3])
        rows["id"], rows["quaternion"] = (0, 1), rng.normal(0, 1, (2, 4))
        rows["quaternion"] /= np.linalg.norm(rows["quaternion"], axis=1, keepdims=True)
        across = rng.uniform(0.3, 0.7) * np.array([0.0, 0.6, 0.8])
        rows["position"][1], rows["linear"][1, 0] = size * (across - (2.0, 0, 0)), 1.5 * size
        rows["position_stddev"], rows["orientation_stddev"] = stddev * size, turned * stddev
        reported = monitor.step(0, rows)
        stated = bool((reported.predictions["status"] != 2).any())
        exact, planes = (np.nan_to_num(answer[0, 3]) for answer in both_methods(monitor, stated))
        if planes != LEFT:
            assert planes == pytest.approx(exact, abs=0.02), seed
            compared += 1
    tolerance = max(FACETS * stddev * size, Profile().impact_tolerance)
    left = (turned > 0.0 and ROUNDING * size > tolerance) or stddev * size >= 1e12
    assert compared == 0 if left else compared >= 6


def test_the_columns_are_the_same_samples() -> None:
    for count in (16, 100, 1024):
        points, weights = normal_samples(count)
        columns = sample_columns(count)
        order = np.lexsort(columns.points)
        np.testing.assert_array_equal(columns.points.T[order], points[np.lexsort(points.T)].astype(np.float32))
        assert columns.weights.sum() == pytest.approx(1.0)
        assert weights.sum() == pytest.approx(1.0)


def test_another_number_of_samples_is_possible() -> None:
    """The scratch memory follows the profile while the monitor runs."""
    answers = []
    rng = np.random.default_rng(4)
    monitor, _ = random_pair(rng, "box", "capsule", CASES["straight"])
    for count in (1024, 64, 4096, 1024):
        monitor.profile = monitor.profile.replace(uncertainty_samples=count)
        rows = np.zeros(0, STATE)
        reported = monitor.step(0, rows).predictions
        answers.append(float(reported["probability"][0]) if len(reported) else 0.0)
    assert pair_probabilities.ANSWERS[3] == "probability"
    assert answers[0] == answers[3]
    assert np.ptp(answers) < 0.05
