"""Features in published contacts, against `contact_features`; the bound of the depth of compounds."""

from __future__ import annotations

import numpy as np
import pytest
from named_features import agrees, off_feature, random_pose

import collision_monitor as cm
from collision_monitor import Pose
from collision_monitor.query.contact.contact import contact
from collision_monitor.query.contact.features import feature_of, shape_tie
from collision_monitor.query.contact.features_in_contact import contact_features

ROCK = cm.ConvexHull(np.random.default_rng(3).normal(size=(24, 3)) * 0.4)
CUBE = cm.ConvexHull([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SHAPES = [cm.Box((0.7, 0.9, 0.5)), cm.Cylinder(0.4, 0.7), cm.Cone(0.5, 0.9), ROCK, CUBE]
FLOOR = cm.HalfSpace((0, 0, 1))
L_SHAPE = [(cm.Box((2, 0.5, 0.5)), Pose()), (cm.Box((0.5, 0.5, 2)), Pose((0.75, 0, 0.75)))]


def published(a, X, b, Y):
    """The contact of two objects, as a monitor reports it."""
    monitor = cm.Monitor(cm.Profile(contact_margin=100.0))
    monitor.add(1, a)
    monitor.add(2, b, static=True, pose=Y)
    found = monitor.step(0, [1], [[*X.position, *X.quaternion]], np.zeros((1, 6))).contacts
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("a", SHAPES, ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("b", [*SHAPES[1:], FLOOR], ids=lambda s: type(s).__name__)
def test_the_features_are_those_of_contact_features(a, b):
    rng = np.random.default_rng(1)
    for k in range(6):
        X = random_pose(rng, 0.5) if k else Pose((0, 0, 0.6))
        Y = Pose() if b is FLOOR else Pose((0, 0, -2.0)) @ random_pose(rng, 0.5)
        row = published(a, X, b, Y)
        expected = contact_features(contact(a, X, b, Y), a, X, b, Y)
        for side, shape, feature in (("a", a, expected.a), ("b", b, expected.b)):
            kind, index = row[f"feature_type_{side}"], row[f"feature_index_{side}"]
            if k and row["signed_distance"] > 0.0:  # in general position the two agree
                assert kind == feature.type
            if isinstance(shape, cm.ConvexHull):
                assert kind in (1, 2, 3)
                if kind == feature.type == 1:
                    assert index == feature.vertices[0]
            elif kind == feature.type and kind in (1, 3):
                assert index == (feature.vertices[0] if kind == 1 else feature.face)


@pytest.mark.parametrize(
    ("shape", "quaternion", "kind", "index"),
    [
        (cm.Box((1, 1, 2)), (0, 0, 0, 1), 3, 5),
        (cm.Cylinder(0.5, 2), (0, 0, 0, 1), 3, 1),
        (cm.Cylinder(0.5, 2), (1, 0, 0, 0), 3, 0),
        (cm.Cylinder(0.5, 2), (np.sqrt(0.5), 0, 0, np.sqrt(0.5)), 4, 0),
        (cm.Cylinder(0.5, 2), (np.sin(0.2), 0, 0, np.cos(0.2)), 2, 1),
        (cm.Cone(0.5, 2), (0, 0, 0, 1), 3, 0),
        (cm.Cone(0.5, 2), (1, 0, 0, 0), 1, 0),
        (cm.Capsule(0.5, 1), (0, 0, 0, 1), 4, 0),
        (cm.Ellipsoid((1, 0.5, 1)), (0, 0, 0, 1), 4, 0),
        (CUBE, (0, 0, 0, 1), 3, 0),
        (CUBE, (np.sin(np.pi / 8), 0, 0, np.cos(np.pi / 8)), 2, 0),
    ],
)
def test_shapes_on_a_floor(shape, quaternion, kind, index):
    row = published(shape, Pose((0.3, 0.2, 0.9), quaternion), FLOOR, Pose())
    assert (row["feature_type_a"], row["feature_index_a"]) == (kind, index)
    assert (row["feature_type_b"], row["feature_index_b"]) == (3, 0)


U = [(0, 0), (0.3, 0), (0.7, 0), (1, 0), (1, 0.3), (1, 1), (0.7, 1), (0.7, 0.3), (0.3, 0.3), (0.3, 1), (0, 1), (0, 0.3)]
QUADS = [(0, 1, 8, 11), (1, 2, 7, 8), (2, 3, 4, 7), (7, 4, 5, 6), (11, 8, 9, 10)]


def u_mesh(height=0.8):
    """A closed mesh with the outline of a U."""
    flat, n = np.array(U) - 0.5, len(U)
    vertices = np.vstack([np.column_stack([flat, np.full(n, z)]) for z in (-height / 2, height / 2)])
    faces = []
    for a, b, c, d in QUADS:
        faces += [(a + n, b + n, c + n), (a + n, c + n, d + n), (a, c, b), (a, d, c)]
    for k in range(n):
        m = (k + 1) % n
        faces += [(k, m, m + n), (k, m + n, k + n)]
    return cm.Mesh(vertices, faces)


SOLIDS = {
    "box": cm.Box((0.7, 0.9, 0.5)), "cylinder": cm.Cylinder(0.4, 0.7), "cone": cm.Cone(0.5, 0.9), "rock": ROCK,
    "u": u_mesh(), "ellipsoid": cm.Ellipsoid((0.6, 0.4, 0.3)), "capsule": cm.Capsule(0.2, 0.7),
    "sphere": cm.Sphere(0.4),
}  # fmt: skip
NAMED = ("box", "cylinder", "cone", "rock", "u")


@pytest.mark.parametrize("second", SOLIDS)
@pytest.mark.parametrize("first", NAMED)
def test_the_feature_contains_the_published_point(first, second):
    """Also where EPA's normal is off by 1e-6, and where the triangles of two solids meet along another normal."""
    rng = np.random.default_rng(5)
    a, b = SOLIDS[first], SOLIDS[second]
    overlapping = 0
    for _ in range(16):
        X, Y = random_pose(rng, 0.2), random_pose(rng, 0.4)
        row = published(a, X, b, Y)
        overlapping += row["signed_distance"] <= 0.0
        for side, name, shape, pose, sign in (("a", first, a, X, 1.0), ("b", second, b, Y, -1.0)):
            kind, index = int(row[f"feature_type_{side}"]), int(row[f"feature_index_{side}"])
            if name not in NAMED:
                assert kind == 4
                continue
            point = row[f"point_{side}"]
            assert off_feature(shape, (point - pose.position) @ pose.rotation, kind, index) < 2e-6
            off = min(float(row["error_bound"]), 1e-5)
            expected = feature_of(shape, pose, point, sign * row["normal"], shape_tie(a, b), off)
            assert agrees(shape, kind, index, expected), (kind, index, expected)
    assert overlapping > 5


def test_a_rim_in_the_middle_of_a_face_touches_the_face():
    box, cylinder = cm.Box((1, 1, 1)), cm.Cylinder(0.2, 1.0)
    q = Pose.from_euler(0.3, 0.2, 0).quaternion
    deep = -contact(box, Pose(), cylinder, Pose((0.1, 0.1, 1.0), q)).signed_distance
    row = published(cylinder, Pose((0.1, 0.1, 1.0 + deep - 0.001), q), box, Pose())
    assert row["signed_distance"] == pytest.approx(-0.001, abs=1e-5)
    assert (row["feature_type_a"], row["feature_index_a"]) == (2, 1)
    assert (row["feature_type_b"], row["feature_index_b"]) == (3, 4)


def test_polygons_name_the_edge_after_its_first_corner():
    square = cm.Polygon([(-1, -1), (-1, 1), (1, 1), (1, -1)])  # clockwise
    other = cm.Polygon([(0, 0), (1, 0.5), (1, -0.5)])
    row = published(square, Pose(), other, Pose((1.5, 0.2, 0)))
    assert (row["feature_type_a"], row["feature_index_a"]) == (2, 2)  # from (1, 1) to (1, -1)
    assert (row["feature_type_b"], row["feature_index_b"]) == (1, 0)
    below = published(square, Pose(), other, Pose((-0.5, -1.9, 0)))
    assert (below["feature_type_a"], below["feature_index_a"]) == (2, 3)  # from the last corner to the first


def test_the_bound_of_overlapping_compounds_holds_the_way_out():
    rng = np.random.default_rng(2)
    deep = 0
    for _ in range(60):
        X, Y = random_pose(rng, 0.6), random_pose(rng, 0.6)
        row = published(L_SHAPE, X, L_SHAPE, Y)
        if row["signed_distance"] > 0.0:
            continue
        deep += 1
        depth = -row["signed_distance"] + row["error_bound"] + 1e-9
        moved = Pose(Y.position + depth * row["normal"], Y.quaternion)
        assert contact(L_SHAPE, X, L_SHAPE, moved).signed_distance > 0.0
    assert deep > 10
