"""Features of round shapes, polygons and half-spaces at the witness points of contacts, in words."""

from __future__ import annotations

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor import Pose
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.contact_features import FeaturePair, FeatureType
from collision_monitor.query.contact.features import feature_of

FLOOR = cm.HalfSpace((0, 0, 1))
UPRIGHT, LYING = (0, 0, 0, 1), (np.sqrt(0.5), 0, 0, np.sqrt(0.5))  # lying: +z to -y
DOWN, TILTED = (1, 0, 0, 0), (np.sin(0.2), 0, 0, np.cos(0.2))


def words(a, X, b, Y):
    c = cm.contact(a, X, b, Y)
    found = str(cm.contact_features(c, a, X, b, Y))
    mirrored = cm.contact_features(cm.contact(b, Y, a, X), b, Y, a, X)
    assert f"{mirrored.b} of A on {mirrored.a} of B" == found
    return found


@pytest.mark.parametrize("height", [1.0, 3.0, 0.2], ids=["touching", "above", "deep"])
@pytest.mark.parametrize(
    ("shape", "quaternion", "feature"),
    [
        (cm.Cylinder(0.5, 2), UPRIGHT, "face 1"),
        (cm.Cylinder(0.5, 2), DOWN, "face 0"),
        (cm.Cylinder(0.5, 2), LYING, "surface"),
        (cm.Cylinder(0.5, 2), TILTED, "edge 1"),
        (cm.Cone(0.5, 2), UPRIGHT, "face 0"),
        (cm.Cone(0.5, 2), DOWN, "vertex 0"),
        (cm.Cone(0.5, 2), TILTED, "edge 0"),
        (cm.Capsule(0.5, 1), UPRIGHT, "vertex 0"),
        (cm.Capsule(0.5, 1), DOWN, "vertex 1"),
        (cm.Capsule(0.5, 1), LYING, "edge 0-1"),
    ],
)
def test_round_shapes_on_a_floor(shape, quaternion, feature, height):
    assert words(shape, Pose((0.3, 0.2, height), quaternion), FLOOR, Pose()) == f"{feature} of A on face 0 of B"


def test_round_shapes_on_a_box():
    table = cm.Box((4, 4, 1))
    cup = cm.Cylinder(0.4, 1)
    assert words(cup, Pose((0.1, 0, 1.1)), table, Pose()) == "face 1 of A on face 4 of B"
    assert words(cup, Pose((0.1, 0, 1.1), TILTED), table, Pose()) == "edge 1 of A on face 4 of B"
    assert words(cup, Pose((2.7, 0, 0)), table, Pose()) == "surface of A on face 0 of B"


def test_polygons_in_the_plane():
    square = cm.Polygon([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corner = cm.Polygon([(0, 0), (1, 0.5), (1, -0.5)])
    found = cm.contact_features(cm.contact(square, Pose(), corner, Pose((1.5, 0.2, 0))), square, Pose(), corner,
                                Pose((1.5, 0.2, 0)))  # fmt: skip
    assert str(found) == "edge 1-2 of A on vertex 0 of B" and found.pair is FeaturePair.VE
    assert words(square, Pose(), square, Pose((0.5, 2.1, 0))) == "edge 2-3 of A on edge 0-1 of B"
    rounded = cm.Polygon([(0, 0), (1, 0.5), (1, -0.5)], 0.1)
    assert words(square, Pose(), rounded, Pose((1.5, 0.2, 0))) == "edge 1-2 of A on vertex 0 of B"
    stadium = cm.Polygon([(-1, 0), (1, 0)], 0.25)
    assert words(square, Pose(), stadium, Pose((0, 1.5, 0))) == "edge 2-3 of A on edge 0-1 of B"


def test_a_curved_surface_is_in_none_of_the_six_pairs():
    rod, X = cm.Cylinder(0.5, 2), Pose((0, 0, 1), LYING)
    found = cm.contact_features(cm.contact(rod, X, FLOOR, Pose()), rod, X, FLOOR, Pose())
    assert found.a.type is FeatureType.SURFACE and found.pair is None
    for ball in (cm.Sphere(1), cm.Ellipsoid((1, 2, 3))):
        with pytest.raises(cm.UnsupportedError, match="has no vertices, edges and faces; supported are Box"):
            cm.contact_features(cm.contact(ball, X, FLOOR, Pose()), ball, X, FLOOR, Pose())


def test_a_diagonal_of_the_side_of_a_box_is_no_edge():
    box, needle = cm.Box((2, 2, 2)), cm.Cone(0.1, 1)
    for at in ((0.0, 0.0), (0.5, 0.5), (0.5, -0.5)):
        assert words(box, Pose(), needle, Pose((*at, 1.501), (1, 0, 0, 0))) == "face 4 of A on vertex 0 of B"
        # a normal that is a right angle to no side, as of triangles that cross
        found = feature_of(box, Pose(), np.array([*at, 1.0]), np.array([0.6, 0.0, 0.8]), 1e-9, 0.0)
        assert str(found) == "face 4"


def test_a_contact_off_the_surface_by_its_error_has_features():
    """Deep contacts of round shapes with meshes; their witness points are off by up to the error bound."""
    rng = np.random.default_rng(77001)
    off = 0
    for _ in range(200):
        hull = convex_hull(rng.normal(size=(8, 3)) * rng.uniform(0.1, 1.0, 3))
        mesh = cm.Mesh(hull.vertices, hull.faces)
        pose, other = cm.Pose(rng.normal(size=3) * 0.3, _turn(rng)), cm.Pose(rng.normal(size=3) * 0.3, _turn(rng))
        for shape in (cm.Cylinder(*rng.uniform(0.05, 1, 2)), cm.Cone(*rng.uniform(0.05, 1, 2))):
            found = cm.contact(shape, pose, mesh, other)
            off += found.error_bound > 1e-6
            assert cm.contact_features(found, shape, pose, mesh, other).b.type is not FeatureType.SURFACE
            assert "mesh surface" not in repr(found)
    assert off > 20


def _turn(rng):
    quaternion = rng.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)
