"""Features in published contacts, against `contact_features`; the bound of the depth of compounds."""

from __future__ import annotations

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor import Pose
from collision_monitor.query.contact import contact
from collision_monitor.query.features import contact_features

ROCK = cm.ConvexHull(np.random.default_rng(3).normal(size=(24, 3)) * 0.4)
CUBE = cm.ConvexHull([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SHAPES = [cm.Box((0.7, 0.9, 0.5)), cm.Cylinder(0.4, 0.7), cm.Cone(0.5, 0.9), ROCK, CUBE]
FLOOR = cm.HalfSpace((0, 0, 1))
L_SHAPE = [(cm.Box((2, 0.5, 0.5)), Pose()), (cm.Box((0.5, 0.5, 2)), Pose((0.75, 0, 0.75)))]


def random_pose(rng, reach):
    q = rng.normal(size=4)
    return Pose(rng.uniform(-reach, reach, 3), q / np.linalg.norm(q))


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
