"""Tests of contacts that are carried over while their pair has hardly moved, against answers that are all new."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.records import Phase
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose, from_rotation_vector
from collision_monitor.shapes.registry import Box, Capsule, Cylinder, HalfSpace, Sphere

TOLERANCE, RATE = 2e-3, 50.0
SHAPES = (Box((0.5, 0.4, 0.3)), Capsule(0.15, 0.4), Cylinder(0.2, 0.4), Sphere(0.25), [(Box((0.4,) * 3), Pose())] * 2)


def drifting(speed: float, spin: float, seed: int, *, steps: int = 40, tolerance: float = TOLERANCE):
    """Yield the answers of a monitor with the tolerance and of one without, to bodies in a heap that drift slowly."""
    rng = np.random.default_rng(seed)
    n = 40
    monitors = [Monitor(Profile(distance_tolerance=value, horizon=0.0)) for value in (tolerance, 0.0)]
    for monitor in monitors:
        monitor.add(99, HalfSpace((0, 0, 1), 0.0), static=True, pose=Pose())
        for i in range(n):
            monitor.add(i, SHAPES[i % len(SHAPES)])
    position = rng.uniform(0, 1.1, (n, 3))
    linear, angular = rng.normal(scale=speed, size=(n, 3)), rng.normal(scale=spin, size=(n, 3))
    turn = rng.normal(size=(n, 3))
    for k in range(steps):
        poses = np.hstack([position + linear * k / RATE, from_rotation_vector(turn + angular * k / RATE)])
        yield [each.step(round(k * 1e9 / RATE), np.arange(n), poses, np.hstack([linear, angular])) for each in monitors]


@pytest.mark.parametrize(("speed", "spin"), [(0.0, 0.0), (0.01, 0.02), (0.05, 0.0), (0.0, 0.1), (1.0, 1.0)])
def test_carried_answers_hold_within_their_bound_and_the_tolerance(speed: float, spin: float) -> None:
    spared = 0
    for mine, truth in drifting(speed, spin, 3):
        a, b = mine.contacts, truth.contacts
        for name in ("id_a", "id_b", "phase", "duration", "status"):
            assert np.array_equal(a[name], b[name]), name
        off = np.abs(a["signed_distance"] - b["signed_distance"])
        assert np.all(off <= a["error_bound"] + b["error_bound"] + 1e-12)
        assert np.all(a["error_bound"] <= b["error_bound"] + TOLERANCE + 1e-12)
        assert np.array_equal(mine.ended["id_b"], truth.ended["id_b"])
        spared += truth.status.narrow_phase_tests - mine.status.narrow_phase_tests
    assert spared > 100 if speed < 0.5 else spared >= 0


def test_a_tolerance_of_zero_and_the_first_contact_are_answered_anew() -> None:
    for mine, truth in drifting(0.01, 0.02, 3, steps=10, tolerance=0.0):
        assert mine.contact_rows.tobytes() == truth.contact_rows.tobytes()
        assert mine.status == truth.status
    (mine, truth), *_ = drifting(0.01, 0.02, 3, steps=1)
    assert mine.contact_rows.tobytes() == truth.contact_rows.tobytes()
    assert set(mine.contacts["phase"]) == {Phase.BEGIN}


def two_boxes() -> Monitor:
    monitor = Monitor(Profile(distance_tolerance=0.01, horizon=0.0))
    for i in (1, 2):
        monitor.add(i, Box((1, 1, 1)))
    return monitor


def distance(monitor: Monitor, k: int, *positions: tuple[float, float, float]) -> tuple[float, float]:
    poses = [(*position, 0, 0, 0, 1) for position in positions]
    (row,) = monitor.step(k * 10**7, [1, 2], poses).contacts
    return float(row["signed_distance"]), float(row["point_a"][0])


def test_a_pair_that_moves_together_keeps_its_answer_and_its_points_follow() -> None:
    monitor = two_boxes()
    first, at = distance(monitor, 0, (0, 0, 0), (0.9, 0, 0))
    assert distance(monitor, 1, (5, 0, 0), (5.9, 0, 0)) == pytest.approx((first, at + 5))
    assert monitor.last.status.narrow_phase_tests == 0
    assert distance(monitor, 2, (5, 0, 0), (5.895, 0, 0))[0] == pytest.approx(first)
    assert monitor.last.contacts["error_bound"][0] == pytest.approx(0.005, abs=1e-7)
    assert distance(monitor, 3, (5, 0, 0), (5.885, 0, 0))[0] == pytest.approx(first - 0.015)
    assert monitor.last.contacts["error_bound"][0] < 1e-8
    assert monitor.last.status.narrow_phase_tests == 1


def test_a_pair_that_separates_along_its_normal_keeps_an_answer_that_follows() -> None:
    monitor = two_boxes()
    first, _ = distance(monitor, 0, (0, 0, 0), (0.9, 0, 0))
    assert distance(monitor, 1, (0, 0, 0), (0.98, 0, 0))[0] == pytest.approx(first + 0.08, abs=1e-6)
    assert monitor.last.contacts["error_bound"][0] < 1e-6
    assert monitor.last.status.narrow_phase_tests == 0


def test_new_shapes_and_restored_monitors() -> None:
    monitor = two_boxes()
    distance(monitor, 0, (0, 0, 0), (0.9, 0, 0))
    monitor.add(2, Box((1.1, 1, 1)), replace=True)
    assert distance(monitor, 1, (0, 0, 0), (0.9, 0, 0))[0] == pytest.approx(-0.15)
    again = Monitor.restored(monitor.profile, monitor.snapshot())
    found = [each.step(2 * 10**7, [2], [(0.905, 0, 0, 0, 0, 0, 1)]) for each in (monitor, again)]
    assert found[0].contact_rows.tobytes() == found[1].contact_rows.tobytes()
    assert found[0].status.narrow_phase_tests == found[1].status.narrow_phase_tests == 0


def test_another_piece_of_a_compound_may_come_closer_while_the_nearest_separates() -> None:
    monitor = Monitor(Profile(distance_tolerance=0.01, contact_margin=0.05, horizon=0.0))
    monitor.add(1, [(Box((1, 1, 1)), Pose((x, 0, 0))) for x in (-1.005, 1.006)])
    monitor.add(2, Box((1, 1, 1)))
    assert distance(monitor, 0, (0, 0, 0), (0, 0, 0))[0] == pytest.approx(0.005)
    distance(monitor, 1, (0, 0, 0), (0.004, 0, 0))
    (row,) = monitor.last.contacts
    assert abs(row["signed_distance"] - 0.002) <= row["error_bound"]
