"""Contact patches of polytopes against the corners of clipped half-planes, and names of the touching features."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from pairs import AB, BA
from scipy.spatial import HalfspaceIntersection

import collision_monitor as cm
from collision_monitor import Box, ConvexHull, HalfSpace, Mesh, Pose, Sphere, contact
from collision_monitor.geometry.contact_features import FeaturePair
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.narrow_phase.manifold import manifold_batch
from collision_monitor.shapes.shape_table import ShapeTableBuilder

GROUND = HalfSpace((0, 0, 1))


def about_z(angle):
    return (0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))


def shared_corners(size_a, size_b, x, y, angle):
    """Corners of the intersection of two rectangles in the plane, by the half-planes of their sides."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rows = []
    for size, center, R in ((size_a, np.zeros(2), np.eye(2)), (size_b, np.array([x, y]), turn)):
        for axis in range(2):
            for sign in (1.0, -1.0):
                normal = sign * R[:, axis]
                rows.append([*normal, -normal @ center - size[axis] / 2])
    corners = HalfspaceIntersection(np.array(rows), np.array([x, y]) / 2).intersections
    return np.unique(corners.round(9), axis=0)


def same_points(found, expected, atol=1e-9):
    return len(found) == len(expected) and any(
        np.allclose(found[list(order)], expected, atol=atol) for order in permutations(range(len(found)))
    )


def as_hull(box):
    return ConvexHull([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)] * np.array(box.size))


@pytest.mark.parametrize("gap", [0.3, 0.0, -0.05])
@pytest.mark.parametrize("convert", [lambda box: box, as_hull], ids=["box", "hull"])
def test_face_on_face_is_what_the_sides_cut_out(gap, convert):
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(25):
        low, high = Box((*rng.uniform(0.6, 2, 2), 0.4)), Box((*rng.uniform(0.6, 2, 2), 0.6))
        x, y, angle = rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(0, np.pi)
        q = rng.normal(size=4)
        X = Pose(rng.uniform(-5, 5, 3), q / np.linalg.norm(q))
        Y = X @ Pose((x, y, 0.5 + gap), about_z(angle))
        c = contact(convert(low), X, convert(high), Y)
        found = (c.points_a - X.position) @ X.rotation
        np.testing.assert_allclose(found[:, 2], 0.2, atol=1e-9)
        np.testing.assert_allclose(c.points_b, c.points_a + c.signed_distance * c.normal)
        corners = shared_corners(low.size, high.size, x, y, angle)
        seen.add(len(corners))
        if len(corners) <= 4:
            assert same_points(found[:, :2], corners)
        else:
            assert len(found) == 4
            for point in found[:, :2]:
                assert np.linalg.norm(corners - point, axis=1).min() < 1e-9
        s = contact(convert(high), Y, convert(low), X)
        assert same_points(s.points_b, c.points_a)
    assert {4, 8} & seen and max(seen) > 4


def test_the_four_of_many_corners_are_spread_out():
    angle = 2 * np.pi * np.arange(40) / 40
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    prism = ConvexHull([[x, y, z] for x, y in ring for z in (0.0, 1.0)])
    for turn in np.linspace(0, 3, 7):
        c = contact(prism, Pose((0, 0, -0.01), about_z(turn)), GROUND, Pose())
        assert len(c.points_a) == 4
        np.testing.assert_allclose(np.linalg.norm(c.points_a[:, :2], axis=1), 1.0)
        x, y = c.points_a[:, :2].T
        assert abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 > 1.9  # a square has 2
        again = contact(prism, Pose((0, 0, -0.01), about_z(turn + 1e-15)), GROUND, Pose())
        np.testing.assert_allclose(again.points_a, c.points_a, atol=1e-12)


def test_edges_and_corners():
    box = Box((1, 1, 1))
    on_edge = Pose((0, 0, np.sqrt(0.5) - 0.01), (np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8)))
    c = contact(box, on_edge, GROUND, Pose())
    assert same_points(c.points_a, np.array([[-0.5, 0, -0.01], [0.5, 0, -0.01]]))
    # an edge on a face: the patch ends at the face's border
    slab = Box((0.4, 3, 0.2))
    c = contact(slab, Pose((0, 0, -0.1)), box, on_edge)
    assert same_points(c.points_a, np.array([[-0.2, 0, 0], [0.2, 0, 0]]))
    # two edges along each other: the patch is their common interval
    under = Pose((0.3, 0, -np.sqrt(0.5) - 0.03), on_edge.quaternion)
    c = contact(box, under, box, on_edge)
    assert c.signed_distance == pytest.approx(0.02)
    assert same_points(c.points_a, np.array([[-0.2, 0, -0.03], [0.5, 0, -0.03]]))
    # crossed edges, a corner and a ball touch at one point
    crossed = Pose((0, 0, -np.sqrt(2)), about_z(1.0)) @ on_edge
    ball = Sphere(1)
    for a, X, b, Y in (
        (box, crossed, box, on_edge),
        (ball, Pose(), GROUND, Pose()),
        (ball, Pose(), box, Pose((1.2, 0, 0))),
    ):
        c = contact(a, X, b, Y)
        np.testing.assert_array_equal(c.points_a, c.point_a[None])
        np.testing.assert_array_equal(c.points_b, c.point_b[None])


@pytest.mark.parametrize("gap", [0.2, 0.0, -0.05])
def test_edges_in_the_plane_share_an_interval(gap):
    """A polygon stands on a concave one, edge on edge; the patch is the common part, on the line between them."""
    rng = np.random.default_rng(9)
    bench = cm.Polygon([(0, 0), (6, 0), (6, 1), (4, 1), (4, 0.2), (2, 0.2), (2, 1), (0, 1)])  # two seats 1 m high
    for _ in range(20):
        width, at = rng.uniform(0.4, 1.5), rng.uniform(0.3, 0.8)
        foot = cm.Polygon([(0, 0), (width, 0), (0.7 * width, 0.5), (0.2 * width, 0.8)])
        turn, left = rng.uniform(0, 7), rng.choice([0.0, 4.0])
        X = Pose((*rng.uniform(-9, 9, 2), 0), about_z(turn))
        c = contact(bench, X, foot, X @ Pose((left + at, 1 + gap, 0)))
        expected = np.array([[left + at, 1, 0], [min(left + at + width, left + 2), 1, 0]])
        assert same_points((c.points_a - X.position) @ X.rotation, expected)
        np.testing.assert_allclose(c.points_b, c.points_a + c.signed_distance * c.normal, atol=1e-12)
        assert c.signed_distance == pytest.approx(gap, abs=1e-12)
        tilted = contact(bench, X, foot, X @ Pose((left + at, 1 + gap + 0.3, 0), about_z(0.01)))
        assert len(tilted.points_a) == 1  # on its corner
    round_one = contact(bench, Pose(), cm.Circle(0.5), Pose((1, 1.4, 0)))
    np.testing.assert_array_equal(round_one.points_a, round_one.point_a[None])


def test_a_floor_of_triangles_is_one_face():
    n = 9
    x, y = np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    k = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + n, k + n + 1], 1), np.stack([k, k + n + 1, k + 1], 1)])
    box = Box((1.3, 0.9, 0.5))
    pose = Pose((0.1, 0.2, 0.25), about_z(0.4))
    c = contact(Mesh(vertices, faces), Pose(), box, pose)
    below = np.array([[i * 0.65, j * 0.45, -0.25] for i in (-1, 1) for j in (-1, 1)])
    corners = below @ pose.rotation.T + pose.position
    assert same_points(c.points_a, corners)
    # four wheels of a cart
    wheels = [(Sphere(0.1), Pose((i, j, 0.1))) for i in (-1.0, 1.0) for j in (-0.5, 0.5)]
    c = contact(wheels, Pose((0, 0, 0), about_z(0.3)), GROUND, Pose())
    assert len(c.points_a) == 4 and np.allclose(np.linalg.norm(c.points_a[:, :2], axis=1), np.hypot(1, 0.5))


def test_the_batch_is_the_same_and_mirrors():
    rng = np.random.default_rng(4)
    builder = ShapeTableBuilder(slots=2)
    builder.append(Box((1, 2, 0.4)), margin=0.01)
    builder.append(as_hull(Box((1.5, 0.8, 0.6))), margin=0.02)
    position = np.array([[1.0, 2.0, 3.0], [1.1, 2.2, 3.5]])
    rotation = np.stack([np.eye(3), Pose((0, 0, 0), about_z(rng.uniform(0, 3))).rotation])
    rows = contact_batch(builder.table, position, rotation, AB)
    mirrored = contact_batch(builder.table, position, rotation, BA)
    (count,), (points,) = manifold_batch(builder.table, position, rotation, AB, rows)
    (other,), (back,) = manifold_batch(builder.table, position, rotation, BA, mirrored)
    assert count == other == 4
    # the points are on the grown surfaces, in the plane of the pair's witness points
    np.testing.assert_allclose(points[:, 2], 0.21, atol=1e-9)
    on_a = back + position[1] - position[0] + mirrored[0, 0] * mirrored[0, 1:4]
    assert same_points(points, on_a)


def test_touching_features_have_names():
    box, corner_down = Box((2, 2, 2)), ConvexHull([(0, 0, 0), (1, 1, 1), (-1, 1, 1), (0, -1, 1)])
    X, Y = Pose((5, 0, 0)), Pose((5.2, 0.1, 0.95))
    c = contact(box, X, corner_down, Y)
    found = cm.contact_features(c, box, X, corner_down, Y)
    assert found.pair is FeaturePair.VF and str(found) == "face 4 of A on vertex 0 of B"
    assert str(cm.contact_features(contact(corner_down, Y, box, X), corner_down, Y, box, X)) == (
        "vertex 0 of A on face 4 of B"
    )
    c = contact(box, X, box, Pose((7.5, 2.5, 0)))
    found = cm.contact_features(c, box, X, box, Pose((7.5, 2.5, 0)))
    assert found.pair is FeaturePair.EE and str(found) == "edge 3-7 of A on edge 0-4 of B"
    mesh = Mesh([(0, 0, 0), (4, 0, 0), (0, 4, 0), (4, 4, 0)], [(0, 1, 2), (1, 3, 2)])
    c = contact(corner_down, Pose((3, 3, 0.1)), mesh, Pose())
    assert str(cm.contact_features(c, corner_down, Pose((3, 3, 0.1)), mesh, Pose())) == "vertex 0 of A on face 1 of B"
    with pytest.raises(cm.UnsupportedError, match=r"Sphere has no vertices, .* supported are Box, .*ConvexHull, Mesh"):
        cm.contact_features(contact(Sphere(1), X, box, X), Sphere(1), X, box, X)
