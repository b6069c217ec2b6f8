"""Every pair of kinds through contact, time of impact, monitor and snapshot, certified by support functions in NumPy.

A distance is right within its bound if a plane along the normal keeps the shapes that far apart, and the witness points
are points of the shapes that far from each other.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import pytest
from shapes import CONVEX_SOLIDS, EXAMPLES, is_planar

import collision_monitor as cm
from collision_monitor.records import STATE, ShapeType
from collision_monitor.shapes.registry import Shape, kind_of

PAIRS = list(combinations_with_replacement(CONVEX_SOLIDS, 2))
ALL_PAIRS = [pair for pair in combinations_with_replacement(EXAMPLES, 2) if is_planar(pair[0]) == is_planar(pair[1])]


def pair_name(pair: tuple[ShapeType, ShapeType]) -> str:
    return "-".join(ShapeType(number).name.lower() for number in pair)


def reach(shape: Shape, pose: cm.Pose, d: np.ndarray) -> np.ndarray:
    return np.asarray(d @ pose.position + kind_of(shape).support(shape, d @ pose.rotation))


def random_pose(rng: np.random.Generator, spread: float) -> cm.Pose:
    q = rng.normal(size=4)
    return cm.Pose(rng.uniform(-spread, spread, 3), q / np.linalg.norm(q))


def directions(count: int) -> np.ndarray:
    d = np.random.default_rng(2).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("pair", PAIRS, ids=pair_name)
def test_a_distance_is_certified_by_its_normal_and_its_witness_points(pair: tuple[ShapeType, ShapeType]) -> None:
    a, b = (CONVEX_SOLIDS[number] for number in pair)
    rng, many = np.random.default_rng(5), directions(4000)
    apart = 0
    for spread in (0.3, 0.8, 1.2, 3.0) * 4:
        pose_a, pose_b = random_pose(rng, spread), random_pose(rng, spread)
        c = cm.contact(a, pose_a, b, pose_b)
        swapped = cm.contact(b, pose_b, a, pose_a)
        assert swapped.signed_distance == pytest.approx(c.signed_distance, abs=c.error_bound + swapped.error_bound)
        tolerance = c.error_bound + 1e-12
        gap = -reach(b, pose_b, -c.normal[None])[0] - reach(a, pose_a, c.normal[None])[0]
        # beside round surfaces, the stated normal is the direction between the points, which certifies a little less
        assert gap >= c.signed_distance - tolerance - (1e-8 if kind_of(a).curved or kind_of(b).curved else 0.0)
        sampled = (-reach(b, pose_b, -many) - reach(a, pose_a, many)).max()
        assert sampled <= c.signed_distance + tolerance
        np.testing.assert_allclose(c.point_b - c.point_a, c.signed_distance * c.normal, atol=tolerance)
        if c.signed_distance > 0.0:
            apart += 1
            for shape, pose, point in ((a, pose_a, c.point_a), (b, pose_b, c.point_b)):
                outside = (point @ many.T - reach(shape, pose, many)).max()
                assert outside <= 2.0 * tolerance + 1e-7
        assert cm.overlap(a, pose_a, b, pose_b) == (c.signed_distance <= 0.0) or abs(c.signed_distance) <= tolerance
        assert cm.distance(a, pose_a, b, pose_b) == c.signed_distance
    assert apart > 2


@pytest.mark.parametrize("pair", PAIRS, ids=pair_name)
def test_at_the_time_of_impact_they_touch_and_before_they_do_not(pair: tuple[ShapeType, ShapeType]) -> None:
    a, b = (CONVEX_SOLIDS[number] for number in pair)
    rng, hits = np.random.default_rng(7), 0
    for _ in range(6):
        start = cm.Pose(rng.normal((3.0, 0, 0), 0.1), random_pose(rng, 1.0).quaternion)
        A = cm.Motion(random_pose(rng, 0.1), (0.5, 0, 0), rng.normal(0, 0.5, 3))
        B = cm.Motion(start, (-1.5, 0, 0), rng.normal(0, 0.5, 3))
        found = cm.time_of_impact(a, A, b, B, horizon=3.0)
        assert found.status == "hit"
        hits += 1
        at = cm.contact(a, A.at(found.upper), b, B.at(found.upper))
        assert abs(at.signed_distance) <= 1e-4
        for t in np.linspace(0.0, found.lower, 6)[:-1]:
            assert cm.contact(a, A.at(t), b, B.at(t)).signed_distance > -1e-9
    assert hits == 6


@pytest.mark.parametrize("pair", ALL_PAIRS, ids=pair_name)
def test_the_monitor_agrees_with_single_queries_and_goes_on_from_a_snapshot(pair: tuple[ShapeType, ShapeType]) -> None:
    """Contacts now, predictions, uncertain ones, and the same bytes after a restoration."""
    if pair == (ShapeType.HALF_SPACE, ShapeType.HALF_SPACE):
        return  # both are static, and such pairs are not monitored
    a, b = EXAMPLES[pair[0]], EXAMPLES[pair[1]]
    planar = is_planar(pair[0])
    monitor = cm.Monitor(cm.Profile.named("exact"))
    unbounded = [isinstance(shape, cm.HalfSpace) for shape in (a, b)]
    for k, shape in enumerate((a, b)):
        pose = cm.Pose((0.0, 0.0, 0.0)) if unbounded[k] else None
        monitor.add(k + 1, shape, static=unbounded[k], pose=pose)
    rng = np.random.default_rng(11)
    seen = set()
    for step in range(8):
        moving = [k for k in range(2) if not unbounded[k]]
        rows = np.zeros(len(moving), STATE)
        rows["id"] = [k + 1 for k in moving]
        rows["quaternion"] = (0, 0, np.sin(0.3), np.cos(0.3))
        rows["position"] = rng.normal(0, 0.2, (len(moving), 3)) * (1, 1, 0 if planar else 1)
        gap = 3.0 - 0.45 * step
        rows["position"][-1] += (gap, 0, 0) if not any(unbounded) else (0, 0.6 * gap, 0.8 * gap)
        rows["linear"][-1] = (-1.0, 0, 0) if not any(unbounded) else (0, -0.6, -0.8)
        rows["position_stddev"] = 0.01
        result = monitor.step(step * 10**8, rows)
        seen |= {"contact"} if len(result.contacts) else set()
        seen |= {"prediction"} if len(result.predictions) else set()
        poses = {int(r["id"]): cm.Pose(r["position"], r["quaternion"]) for r in rows}
        if len(result.contacts):
            c = result.contacts[0]
            single = cm.contact(a, poses.get(1, cm.Pose()), b, poses.get(2, cm.Pose()))
            bound = float(c["error_bound"]) + single.error_bound + 1e-9
            assert float(c["signed_distance"]) == pytest.approx(single.signed_distance, abs=bound)
        restored = cm.Monitor.restored(cm.Profile.named("exact"), monitor.snapshot())
        later = np.zeros(0, STATE)
        one, other = (each.step(step * 10**8 + 10**7, later) for each in (monitor, restored))
        assert one.contacts.tobytes() == other.contacts.tobytes()
        assert one.predictions.tobytes() == other.predictions.tobytes()
    assert seen == {"contact", "prediction"}
