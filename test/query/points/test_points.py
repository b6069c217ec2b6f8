"""Clouds of points against balls at each of their points, against FCL, and their bad input."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.shapes.kinds.points import MOST_CLOUD_POINTS

TORUS = trimesh.creation.torus(1.0, 0.35, major_sections=14, minor_sections=8)
BALL = trimesh.creation.icosphere(1)
RING = cm.Mesh(TORUS.vertices, TORUS.faces)
SOLIDS = [
    cm.Sphere(0.4),
    cm.Box((0.5, 0.7, 0.4)),
    cm.Box((1.0, 0.5, 0.0)),
    cm.Capsule(0.2, 0.8),
    cm.Cylinder(0.25, 0.7),
    cm.Cone(0.3, 0.8),
    cm.Ellipsoid((0.3, 0.5, 0.2)),
    cm.ConvexHull(np.random.default_rng(1).normal(size=(12, 3)) * 0.35),
    cm.Mesh(0.5 * BALL.vertices, BALL.faces),
    cm.HalfSpace((0.1, 0.2, 1.0), -0.2),
]
OTHERS = [*SOLIDS, RING, cm.Mesh(TORUS.vertices, TORUS.faces[20:])]


def name_of(shape: cm.Points) -> str:
    return type(shape).__name__


def random_pose(rng: np.random.Generator, far: float) -> cm.Pose:
    return cm.Pose(far * rng.normal(size=3), Rotation.random(rng=rng).as_quat())


def cases(other: object, count: int, seed: int):
    """Clouds near another shape, with their poses; some far apart, some deep in it."""
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        points = rng.choice([0.2, 1.0]) * rng.normal(size=(int(rng.integers(1, 90)), 3))
        points += rng.choice([0.0, 1.5]) * rng.normal(size=3)
        Y = cm.Pose() if isinstance(other, cm.HalfSpace) else random_pose(rng, 0.5)
        yield cm.Points(points, (0.0, 0.02, 0.1)[k % 3]), random_pose(rng, 0.7), Y


def least_of_balls(cloud: cm.Points, X: cm.Pose, other: cm.Points, Y: cm.Pose) -> tuple[float, float]:
    """Distance of the nearest or deepest ball, and its error bound (m)."""
    tiny = 0.0 if cloud.radius else 1e-9
    ball = cm.Sphere(cloud.radius or tiny)
    found = [cm.contact(ball, cm.Pose(p), other, Y) for p in cloud.points @ X.rotation.T + X.position]
    best = min(found, key=lambda each: each.signed_distance)
    return best.signed_distance + tiny, best.error_bound


@pytest.mark.parametrize("other", OTHERS, ids=name_of)
def test_a_contact_is_that_of_its_nearest_or_deepest_ball(other):
    overlapping = 0
    for cloud, X, Y in cases(other, 18, 1):
        found = cm.contact(cloud, X, other, Y)
        expected, bound = least_of_balls(cloud, X, other, Y)
        overlapping += expected < 0.0
        if isinstance(other, cm.Mesh) and expected < 0.0:  # inside a mesh, the surface is what is nearest
            assert found.signed_distance < 0.0 or not other.surface.closed
            assert abs(found.signed_distance - expected) <= found.error_bound + bound
        else:
            assert found.signed_distance == pytest.approx(expected, abs=1e-9 + bound)
        assert found.point_b == pytest.approx(found.point_a + found.signed_distance * found.normal)
        assert len(found.points_a) == 1
        assert cm.distance(cloud, X, other, Y) == found.signed_distance
        assert cm.overlap(cloud, X, other, Y) == found.overlaps
        swapped = cm.contact(other, Y, cloud, X)
        assert swapped.signed_distance == pytest.approx(found.signed_distance, abs=1e-9)
        Z = random_pose(np.random.default_rng(3), 10.0)
        if not isinstance(other, cm.HalfSpace):
            moved = cm.contact(cloud, Z @ X, other, Z @ Y)
            assert moved.signed_distance == pytest.approx(found.signed_distance, abs=1e-9)
    assert overlapping


def test_two_clouds_are_as_far_apart_as_their_nearest_points():
    rng = np.random.default_rng(5)
    for far in (0.1, 1.0, 4.0):
        a, b = cm.Points(rng.normal(size=(70, 3)), 0.05), cm.Points(rng.normal(size=(1, 3)), 0.2)
        X, Y = random_pose(rng, far), random_pose(rng, far)
        A, B = (s.points @ at.rotation.T + at.position for s, at in ((a, X), (b, Y)))
        expected = np.linalg.norm(A[:, None] - B, axis=2).min() - 0.25
        assert cm.distance(a, X, b, Y) == pytest.approx(expected, abs=1e-12)


def test_a_large_cloud_has_the_distances_of_fcl():
    fcl = pytest.importorskip("fcl")
    rng = np.random.default_rng(7)
    points = rng.normal(size=(20_000, 3)) * (5, 5, 0.5)
    cloud = cm.Points(points, 0.03)
    X = random_pose(rng, 1.0)
    world = points @ X.rotation.T + X.position
    for box in (cm.Box((0.4, 0.2, 0.9)), cm.Cylinder(0.3, 1.0)):
        geometry = fcl.Box(*box.size) if isinstance(box, cm.Box) else fcl.Cylinder(box.radius, box.length)
        for far in (3.0, 6.0):
            Y = random_pose(rng, far)
            one = fcl.CollisionObject(geometry, fcl.Transform(Y.rotation, Y.position))
            near = world[np.linalg.norm(world - Y.position, axis=1).argsort()[:400]]
            ball = fcl.Sphere(0.03)
            each = [fcl.distance(fcl.CollisionObject(ball, fcl.Transform(np.eye(3), p)), one) for p in near]
            found = cm.contact(cloud, X, box, Y)
            if min(each) > 0.0:
                assert found.signed_distance == pytest.approx(min(each), abs=1e-5)
            else:
                assert found.overlaps


@pytest.mark.parametrize("other", [each for each in OTHERS if not isinstance(each, cm.HalfSpace)], ids=name_of)
def test_a_time_of_impact_is_certified(other):
    hits = 0
    for k in range(5):
        rng = np.random.default_rng((9, k))
        cloud = cm.Points(0.7 * rng.normal(size=(60, 3)), 0.03)
        A = cm.Motion(random_pose(rng, 0.0), angular=0.5 * rng.normal(size=3))
        start = cm.Pose((0, 0, 4), Rotation.random(rng=rng).as_quat())
        B = cm.Motion(start, linear=(0, 0.2 * k, -3), angular=rng.normal(size=3))
        found = cm.time_of_impact(cloud, A, other, B)
        hits += found.status == "hit"
        for t in np.linspace(0.0, min(found.lower, 2.0), 12)[:-1]:
            assert cm.distance(cloud, A.at(t), other, B.at(t)) > 0.0
        certain = not isinstance(other, cm.Mesh) or other.surface.certain  # else it may meet what is missing
        if found.status == "hit" and certain:
            assert cm.distance(cloud, A.at(found.lower), other, B.at(found.lower)) <= 2e-6
            assert found.upper - found.lower < 1e-5
        twists = [np.concatenate([each.linear, each.angular]) for each in (A, B)]
        poses = [np.concatenate([each.pose.position, each.pose.quaternion]) for each in (A, B)]
        both = cm.times_of_impact(cloud, poses[0], twists[0], other, poses[1], twists[1])
        assert both.lower[0] == pytest.approx(found.lower, abs=1e-12)
    assert hits


def test_a_cloud_that_touches_at_the_start_may_part_slide_or_go_deeper():
    floor = np.array([(0.0, 0.0, 0.0), (0.1, 0.1, 0.0), (3.0, 0.0, -0.5), (-1.0, 1.0, -0.5)])
    cloud, box = cm.Points(floor, 0.25), cm.Box((1, 1, 1))
    on_top = cm.Pose((0, 0, 0.75))
    still = cm.Motion(cm.Pose())
    assert cm.time_of_impact(cloud, still, box, cm.Motion(on_top, linear=(0, 0, 1))).status == "clear"
    assert cm.time_of_impact(cloud, still, box, cm.Motion(on_top, linear=(1, 0, 0))).status == "clear"
    sinks = cm.time_of_impact(cloud, still, box, cm.Motion(on_top, linear=(0, 0, -1)))
    assert sinks.lower == 0.0 and sinks.upper < 1e-5
    bare = cm.Points(floor)
    slides = cm.time_of_impact(bare, still, box, cm.Motion(cm.Pose((0, 0, 0.5)), linear=(1, 0, 0)))
    assert slides.status == "clear"


def test_compounds_with_a_cloud_and_open_meshes():
    cloud = cm.Points([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)], 0.1)
    both = [(cloud, cm.Pose((0, 0, 1))), (cm.Sphere(0.5), cm.Pose((0, 3, 0)))]
    assert cm.distance(both, cm.Pose(), cm.Sphere(1.0), cm.Pose((4, 0, 3))) == pytest.approx(0.9)
    assert cm.distance(both, cm.Pose(), cm.Box((1, 1, 1)), cm.Pose((0, 5, 0))) == pytest.approx(1.0)
    found = cm.time_of_impact(both, cm.Motion(cm.Pose()), cm.Box((1, 1, 1)), cm.Motion(cm.Pose((0, 5, 0)), (0, -1, 0)))
    assert found.lower == pytest.approx(1.0, abs=1e-6)
    open_ball = cm.Mesh(BALL.vertices, BALL.faces[4:])
    inside = cm.contact(cloud, cm.Pose(), open_ball, cm.Pose())
    assert inside.signed_distance - inside.error_bound < 0.0


@pytest.mark.parametrize("shape", SOLIDS, ids=name_of)
def test_the_points_of_a_robot_are_found(shape):
    rng = np.random.default_rng(2)
    cloud = cm.Points(rng.normal(size=(120, 3)), 0.02)
    X, Y = random_pose(rng, 0.3), cm.Pose() if isinstance(shape, cm.HalfSpace) else random_pose(rng, 0.3)
    at = cloud.points @ X.rotation.T + X.position
    expected = [cm.distance(cm.Sphere(0.02), cm.Pose(p), shape, Y) <= 0.1 for p in at]
    assert cm.points_within(cloud, X, shape, Y, 0.1).tolist() == expected
    assert any(expected)


def test_its_text_and_features():
    cloud = cm.Points([(0, 0, 0), (1, 0, 0)], 0.1)
    found = cm.contact(cloud, cm.Pose(), cm.Box((1, 1, 1)), cm.Pose((3, 0, 0)))
    assert repr(found) == "Contact(1.4 m ± 6e-14, points vertex 1 – box face 1)" or "points vertex 1" in repr(found)
    features = cm.contact_features(found, cloud, cm.Pose(), cm.Box((1, 1, 1)), cm.Pose((3, 0, 0)))
    assert features.a.vertices == (1,)
    assert repr(cloud) == "Points(2 points, radius=0.1)"


@pytest.mark.parametrize(
    ("points", "radius", "text"),
    [
        ([(0, 0, np.nan)], 0.1, "Points: expected finite coordinates"),
        ([(0, 0, np.inf)], 0.1, "Points: expected finite coordinates"),
        (np.zeros((0, 3)), 0.1, "Points: expected at least 1 points"),
        (np.zeros((4, 2)), 0.1, r"Points: expected at least 1 points, shape \(n, 3\), got shape \(4, 2\)"),
        ("cloud", 0.1, "Points: expected an array"),
        ([(0, 0, 0)], -1.0, "Points radius: expected 0 or a positive number"),
        ([(0, 0, 0)], np.nan, "Points radius: expected 0 or a positive number"),
        (np.zeros((MOST_CLOUD_POINTS + 1, 3)), 0.1, f"expected at most {MOST_CLOUD_POINTS} points, got"),
    ],
)
def test_impossible_clouds_are_refused(points, radius, text):
    with pytest.raises(cm.ShapeError, match=text):
        cm.Points(points, radius)


def test_what_a_cloud_does_not_offer_is_refused_with_text():
    cloud = cm.Points([(0, 0, 0)], 0.1)
    with pytest.raises(cm.UnsupportedError, match="Points"):
        cm.contact(cloud, cm.Pose(), cm.Sphere(1), cm.Pose(), model="sphere")
    with pytest.raises(cm.UnsupportedError, match="Circle and Polygon meet each other only"):
        cm.contact(cloud, cm.Pose(), cm.Circle(1), cm.Pose())
    with pytest.raises(cm.UnsupportedError, match="points_within: expected solid shapes"):
        cm.points_within(cloud, cm.Pose(), cm.Circle(1), cm.Pose())


@pytest.mark.parametrize("points", [np.zeros((300, 3)), np.full((9, 3), 1e-300), 1e9 * np.eye(3)])
def test_degenerate_clouds_have_a_distance(points):
    cloud = cm.Points(points, 0.5)
    expected = np.linalg.norm(points - (0, 0, 3), axis=1).min() - 1.5
    assert cm.distance(cloud, cm.Pose(), cm.Sphere(1), cm.Pose((0, 0, 3))) == pytest.approx(expected)


def test_a_point_meets_solids_within_the_tolerance():
    """A point has no size that tells how exact to be; the advance ends within the tolerance nevertheless."""
    rng = np.random.default_rng(7)
    hits = 0
    for k in range(20):
        solid = (cm.Ellipsoid((0.1, 0.2, 0.4)), cm.ConvexHull(0.3 * rng.normal(size=(10, 3))), cm.Cone(0.2, 0.5))[k % 3]
        p = rng.normal(size=3)
        p *= 2.0 / np.linalg.norm(p)
        motions = cm.Motion(cm.Pose(), angular=rng.normal(size=3)), cm.Motion(cm.Pose(p), -p, rng.normal(size=3))
        found = cm.time_of_impact(cm.Points(np.zeros((1, 3)), 0.0), motions[0], solid, motions[1])
        if found.status != "clear":
            hits += 1
            poses = motions[0].at(found.lower), motions[1].at(found.lower)
            at = cm.contact(cm.Points(np.zeros((1, 3)), 0.0), poses[0], solid, poses[1])
            assert found.status == "hit" and abs(at.signed_distance) <= 1.1e-6 + at.error_bound
    assert hits > 10
