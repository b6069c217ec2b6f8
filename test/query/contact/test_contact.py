"""`contact` for any two shapes: compounds and meshes, containing models and their excess, refusals."""

from __future__ import annotations

import fcl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import collision_monitor as cm
from collision_monitor import Pose, contact
from collision_monitor.objects.models import containing_model

TORUS = trimesh.creation.torus(1.0, 0.25, major_sections=16, minor_sections=8)
RING = cm.Mesh(TORUS.vertices, TORUS.faces)
ROCK = cm.ConvexHull(np.random.default_rng(3).normal(size=(24, 3)) * 0.4)
CUBE = trimesh.creation.box((1, 1, 1))
L_SHAPE = [(cm.Box((2, 0.5, 0.5)), Pose()), (cm.Box((0.5, 0.5, 2)), Pose((0.75, 0, 0.75)))]
SOLIDS = [cm.Sphere(0.4), cm.Box((0.7, 0.9, 0.5)), cm.Capsule(0.3, 0.8), cm.Cylinder(0.4, 0.7), cm.Cone(0.5, 0.9), ROCK]
SOLIDS += [cm.Ellipsoid((0.3, 0.5, 0.6))]
MODELS = ["sphere", "aabb", "obb", "kdop6", "kdop14", "kdop18", "kdop26"]


def name(value):
    return type(value).__name__ if not isinstance(value, str) else value


def random_pose(rng, reach=1.5):
    q = rng.normal(size=4)
    return Pose(rng.uniform(-reach, reach, 3), q / np.linalg.norm(q))


def in_fcl(mesh, pose):
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform(pose.rotation, pose.position))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_meshes_against_the_bvh_of_fcl(seed):
    rng = np.random.default_rng(seed)
    X, Y = random_pose(rng), random_pose(rng, 2.5)
    c = contact(RING, X, RING, Y)
    theirs = (in_fcl(RING, X), in_fcl(RING, Y))
    if fcl.collide(*theirs, fcl.CollisionRequest(), fcl.CollisionResult()):
        assert c.signed_distance <= c.error_bound
    else:
        result = fcl.DistanceResult()
        distance = fcl.distance(*theirs, fcl.DistanceRequest(), result)
        assert c.signed_distance == pytest.approx(distance, abs=1e-7)  # FCL's is coarser
    s = contact(RING, Y, RING, X)
    assert s.signed_distance == pytest.approx(c.signed_distance, abs=1e-11)
    R = random_pose(rng, 100)
    moved = contact(RING, R @ X, RING, R @ Y)
    assert moved.signed_distance == pytest.approx(c.signed_distance, abs=1e-11)


def test_a_mesh_has_an_inside_where_it_is_closed():
    small = cm.Sphere(0.05)
    inside = contact(RING, Pose(), small, Pose((1, 0, 0)))
    assert inside.overlaps
    # upward out of the tube the depth is 0.3; in any direction it is at least the distance of the nearest face
    assert inside.signed_distance - inside.error_bound >= -0.3
    assert inside.signed_distance + inside.error_bound < 0.0
    assert inside.signed_distance < -0.15
    hole = contact(RING, Pose(), small, Pose())
    assert hole.signed_distance > 0.6
    swapped = contact(small, Pose((1, 0, 0)), RING, Pose())
    assert swapped.signed_distance == inside.signed_distance
    np.testing.assert_allclose(swapped.normal, -inside.normal)
    sheet = cm.Mesh(TORUS.vertices, TORUS.faces[1:])  # without one face: a surface without an inside
    assert not contact(sheet, Pose(), small, Pose((1, 0, 0))).overlaps


def test_a_hull_whose_origin_is_elsewhere_is_found_inside_a_mesh():
    far = cm.ConvexHull([(1, 0, 0), (1.1, 0, 0), (1, 0.1, 0), (1, 0, 0.1)])
    assert contact(far, Pose(), RING, Pose()).overlaps


def test_a_half_space_is_in_no_mesh():
    """Also if the origin of its frame, which is not a point of the half-space, is inside the mesh."""
    for offset in (-2.0, -0.5, -0.2, 0.0):
        c = contact(RING, Pose(), cm.HalfSpace((0, 0, 1), offset), Pose((1, 0, 0)))
        assert c.signed_distance == pytest.approx(TORUS.vertices[:, 2].min() - offset)


def test_a_convex_mesh_is_its_hull():
    c = contact(cm.Mesh(CUBE.vertices, CUBE.faces), Pose(), cm.Sphere(0.5), Pose((0.75, 0, 0)))
    assert c.signed_distance == pytest.approx(-0.25, abs=1e-12)
    assert c.error_bound < 1e-9
    inverted = cm.Mesh(CUBE.vertices, CUBE.faces[:, ::-1])
    assert contact(inverted, Pose(), cm.Sphere(0.5), Pose((0.75, 0, 0))).signed_distance == c.signed_distance


@pytest.mark.parametrize(
    "vertices",
    [[(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 0, 0)] * 3, [(0, 0, 0), (1, 0, 0), (1, 1e-13, 0)]],
    ids=["line", "point", "sliver"],
)
def test_degenerate_faces_have_a_distance(vertices):
    c = contact(cm.Mesh(vertices, [(0, 1, 2)]), Pose(), cm.Sphere(0.5), Pose((0, 0, 2)))
    assert c.signed_distance == pytest.approx(1.5, abs=1e-9)
    assert np.isfinite(c.normal).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_a_compound_is_the_union_of_its_shapes(seed):
    rng = np.random.default_rng(seed)
    X, Y = random_pose(rng), random_pose(rng)
    c = contact(L_SHAPE, X, ROCK, Y)
    each = [contact(shape, X @ pose, ROCK, Y) for shape, pose in L_SHAPE]
    assert c.signed_distance == pytest.approx(min(e.signed_distance for e in each), abs=1e-13)
    np.testing.assert_allclose(c.point_b - c.point_a, c.signed_distance * c.normal, atol=1e-13)
    if c.overlaps:
        # far enough along the normal they are apart
        out = contact(L_SHAPE, X, ROCK, Pose(Y.position + 10 * c.normal, Y.quaternion))
        assert not out.overlaps
    else:
        assert c.error_bound < 1e-9


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("shape", [*SOLIDS, RING, L_SHAPE], ids=name)
def test_a_model_contains_its_object_and_states_its_excess(shape, model):
    pairs = shape if isinstance(shape, list) else [(shape, Pose())]
    modelled = containing_model(pairs, model)
    rng = np.random.default_rng(11)
    for _ in range(12):
        X, Y = random_pose(rng), random_pose(rng, 2.0)
        exact = contact(shape, X, ROCK, Y)
        coarse = contact(modelled.pieces, X, ROCK, Y)
        assert coarse.signed_distance <= exact.signed_distance + exact.error_bound + coarse.error_bound
        asked = contact(shape, X, ROCK, Y, model=model)
        wrong = abs(asked.signed_distance - exact.signed_distance)
        assert wrong <= asked.error_bound + exact.error_bound
        assert asked.model_a.name.lower() == model


def test_excess_is_that_of_the_textbook():
    cube = [(cm.Box((2, 2, 2)), Pose())]
    assert containing_model(cube, "sphere").excess == pytest.approx(np.sqrt(3) - 1, abs=1e-8)
    assert containing_model(cube, "obb").excess == pytest.approx(0.0, abs=1e-8)
    ball = [(cm.Sphere(1.0), Pose())]
    assert containing_model(ball, "aabb").excess == pytest.approx(np.sqrt(3) - 1, abs=1e-8)
    assert containing_model(ball, "kdop6").excess == pytest.approx(np.sqrt(3) - 1, abs=1e-8)
    assert containing_model(ball, "exact").excess == 0.0
    assert containing_model(ball, "convex_hull").excess == 0.0


def test_half_spaces_with_compounds():
    ground = cm.HalfSpace((0, 0, 1), 0.0)
    assert contact(ground, Pose(), L_SHAPE, Pose((0, 0, 1))).signed_distance == pytest.approx(0.75)
    deep = contact(ground, Pose(), L_SHAPE, Pose((0, 0, 0)))
    assert deep.signed_distance == pytest.approx(-0.25)
    assert deep.error_bound < 1e-12


@pytest.mark.filterwarnings("error")
def test_two_half_spaces():
    """Facing each other they are a floor and a ceiling; else no translation separates them."""
    rng = np.random.default_rng(8)
    floor, ceiling = cm.HalfSpace((0, 0, 1), 0.25), cm.HalfSpace((0, 0, -1), 0.5)
    for gap in (2.0, 0.0, -3.0):
        for _ in range(20):
            X = random_pose(rng)
            c = contact(floor, X, ceiling, X @ Pose((1, 2, 0.75 + gap)))
            assert c.signed_distance == pytest.approx(gap, abs=c.error_bound) and c.error_bound < 1e-12
            np.testing.assert_allclose(c.normal, X.rotation[:, 2], atol=1e-15)
            for point, height in ((c.point_a, 0.25), (c.point_b, 0.25 + gap)):
                assert ((point - X.position) @ X.rotation)[2] == pytest.approx(height)
    for _ in range(50):
        a, b = (cm.HalfSpace(rng.normal(size=3), rng.normal()) for _ in "ab")
        X, Y = random_pose(rng), random_pose(rng)
        for c in (contact(a, X, b, Y), contact(b, Y, a, X), contact([(a, Pose()), (ROCK, Pose())], X, b, Y)):
            assert c.signed_distance == -np.inf and c.overlaps and c.error_bound == 0.0
            np.testing.assert_array_equal(c.point_a, c.point_b)
            for shape, pose in ((a, X), (b, Y)):
                assert (c.point_a - pose.position) @ pose.rotation @ shape.normal <= shape.offset + 1e-12
    same = contact(floor, Pose(), floor, Pose((0, 0, -1)))
    assert same.signed_distance == -np.inf and same.point_a[2] == -0.75


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (("ball", Pose(), cm.Sphere(1), Pose()), cm.ShapeError, "shape A: expected a shape or a list of"),
        ((cm.Sphere(1), "up", cm.Sphere(1), Pose()), cm.PoseError, "pose A: expected a Pose, .*, got str"),
        (
            (cm.Circle(1), Pose(), cm.Sphere(1), Pose()),
            cm.UnsupportedError,
            "supported are pairs of Circle, Polygon, or of Sphere, Box, .*; got Circle, Sphere",
        ),
        ((cm.Circle(1), Pose((0, 0, 0), (1, 0, 0, 0)), cm.Circle(1), Pose()), cm.PoseError, "a turn about z"),
        ((cm.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), Pose(), cm.Circle(1), Pose()), cm.ShapeError, "simple"),
    ],
    ids=["no shape", "no pose", "plane and space", "out of the plane", "not simple"],
)
def test_what_is_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        contact(*arguments)


def test_models_that_there_are_not_are_named():
    with pytest.raises(cm.InputError, match=r"one of auto, exact, sphere, .*convex_decomposition, got 'ellipsoid'"):
        contact(cm.Sphere(1), Pose(), cm.Sphere(1), Pose(), model="ellipsoid")
    with pytest.raises(cm.UnsupportedError, match="HalfSpace"):
        contact(cm.HalfSpace((0, 0, 1)), Pose(), cm.Sphere(1), Pose(), model="sphere")


@pytest.mark.parametrize("solid", [cm.Cylinder(0.1, 0.1), cm.Cone(0.1, 0.1)])
def test_the_text_of_a_deep_contact_with_a_round_solid(solid: cm.Shape) -> None:
    """The witness point on the mesh is 1e-6 m off its surface, which the error bound states."""
    box = trimesh.creation.box((2, 2, 2))
    c = cm.contact(cm.Mesh(box.vertices, box.faces), cm.Pose(), solid, cm.Pose((0.1, 0.05, 0.02)))
    assert repr(c).startswith("Contact(-1 m ± 1e-06, mesh ")
