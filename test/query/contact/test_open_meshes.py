"""Contact and time of impact of meshes that do not close: the bounds hold what is not known, and nothing is clear."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from processor_time import within

import collision_monitor as cm
from collision_monitor import Motion, Pose
from collision_monitor.query.body import exact_body
from collision_monitor.query.contact.open_gap import least_gap

CUBE = trimesh.creation.box((2, 2, 2))
TORUS = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=8)
CAPSULE = trimesh.creation.capsule(1.0, 0.5, count=(8, 8))
BALL = cm.Sphere(0.2)


def soup(mesh, faces=slice(None), noise=0.0):
    corners = mesh.vertices[mesh.faces[faces]].reshape(-1, 3)
    corners = corners + noise * np.random.default_rng(1).normal(size=corners.shape)
    return cm.Mesh(corners, np.arange(len(corners)).reshape(-1, 3))


def random_pose(rng, reach):
    q = rng.normal(size=4)
    return Pose(rng.uniform(-reach, reach, 3), q / np.linalg.norm(q))


def test_a_ball_in_a_soup_of_triangles_is_inside():
    at = Pose((0.3, 0, 0))
    c = cm.contact(soup(CUBE), Pose(), BALL, at)
    assert c.signed_distance == pytest.approx(-0.9, abs=1e-12) and c.error_bound < 1e-9
    i = cm.time_of_impact(soup(CUBE), Motion(Pose()), BALL, Motion(at))
    assert (i.status, i.lower, i.upper) == ("hit", 0.0, 0.0)
    ring = cm.contact(soup(TORUS), Pose(), BALL, Pose((1, 0, 0)))
    assert ring.overlaps and ring.signed_distance - ring.error_bound < -0.5


@pytest.mark.parametrize("again", [slice(None), slice(3)], ids=["all", "three"])
def test_a_mesh_in_a_box_that_lists_faces_twice_is_inside(again):
    """The box is convex, but the tree of a mesh with repeated faces does not tell what is inside."""
    box = cm.Mesh(CUBE.vertices, np.concatenate([CUBE.faces, CUBE.faces[again]]))
    ring = cm.Mesh(TORUS.vertices * 0.3, TORUS.faces)
    at = Pose((0.1, 0.05, 0.02))
    truth = cm.contact(soup(CUBE), Pose(), ring, at)
    for c in (cm.contact(box, Pose(), ring, at), cm.contact(ring, at, box, Pose())):
        assert c.signed_distance == pytest.approx(truth.signed_distance, abs=1e-12)
    assert cm.overlap(box, Pose(), ring, at) and cm.overlap(ring, at, box, Pose())


@pytest.mark.parametrize("mesh", [soup(CUBE, slice(2, None)), soup(CUBE, noise=1e-9)], ids=["no side", "cracks"])
def test_a_ball_in_an_open_box_is_not_clear(mesh):
    at = Pose((0.3, 0, 0))
    for c in (cm.contact(mesh, Pose(), BALL, at), cm.contact(BALL, at, mesh, Pose())):
        assert c.signed_distance == pytest.approx(0.5, abs=1e-6)
        assert c.signed_distance - c.error_bound <= -0.9 + 1e-6
    i = cm.time_of_impact(mesh, Motion(Pose()), BALL, Motion(at))
    assert (i.status, i.lower) == ("unresolved", 0.0)


def test_a_tiny_open_box_is_no_sheet():
    """Its areas are below the smallest number."""
    box = cm.Mesh(1e-110 * CUBE.vertices, CUBE.faces[2:])
    c = cm.contact(box, Pose(), cm.Sphere(1e-111), Pose())
    assert not box.surface.sheet and c.signed_distance - c.error_bound < 0.0


def test_a_ball_that_flies_in_and_out_through_the_holes():
    tube = cm.Mesh(CUBE.vertices, CUBE.faces[np.abs(CUBE.face_normals[:, 2]) < 0.5])
    assert "open" in repr(tube)
    i = cm.time_of_impact(tube, Motion(Pose()), BALL, Motion(Pose((0, 0, 3)), (0, 0, -1)), horizon=8.0)
    assert i.status == "unresolved" and i.lower == pytest.approx(1.8, abs=1e-5)
    aside = cm.time_of_impact(tube, Motion(Pose()), BALL, Motion(Pose((3, 0, 3)), (0, 0, -1)), horizon=8.0)
    assert aside.status == "clear"
    slanted = cm.time_of_impact(tube, Motion(Pose()), BALL, Motion(Pose((0, 0, 3)), (0.3, 0, -1)), horizon=8.0)
    assert slanted.status == "hit" and slanted.lower == pytest.approx(1.8, abs=1e-5)
    assert slanted.upper == pytest.approx(0.8 / 0.3, abs=1e-4)


def test_a_terrain_is_a_surface_without_an_inside():
    x, y = np.meshgrid(np.linspace(-3, 3, 9), np.linspace(-3, 3, 9), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.3 * np.sin(3 * x.ravel())])
    k = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([np.column_stack([k, k + 9, k + 10]), np.column_stack([k, k + 10, k + 1])])
    terrain = cm.Mesh(vertices, faces)
    c = cm.contact(terrain, Pose(), BALL, Pose((0.1, 0.2, 0.5)))
    assert c.signed_distance > 0.0 and c.error_bound < 1e-9
    drive = Motion(Pose((0.1, 0.2, 0.6)), (0.1, 0, 0))
    assert cm.time_of_impact(terrain, Motion(Pose()), BALL, drive).status == "clear"


@pytest.mark.parametrize("faces", [[(0, 1, 2), (0, 3, 2)], [(0, 1, 2), (0, 3, 2), (1, 2, 4), (4, 2, 1)]])
def test_a_plate_whose_faces_look_both_ways_has_no_inside(faces):
    """A hull, which replaces a mesh with an uncertain inside in the monitor, needs a solid."""
    corners = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (3, 1, 0)])
    corners = corners @ random_pose(np.random.default_rng(1), 1).rotation
    plate = cm.Mesh(corners, faces)
    assert plate.surface.sheet
    assert cm.contact(plate, Pose(), BALL, Pose(corners[0])).signed_distance == pytest.approx(-0.2, abs=1e-9)
    monitor = cm.Monitor()
    monitor.add(1, plate)
    monitor.add(2, BALL)
    assert len(monitor.step(0, [1, 2], [(0, 0, 0, 0, 0, 0, 1), (*corners[0], 0, 0, 0, 1)]).contacts) == 1


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_the_bound_holds_the_closed_solid(seed):
    """A closed mesh loses some faces: its true distance stays within the bound of the open mesh."""
    rng = np.random.default_rng(seed)
    solid = (CUBE, TORUS, CAPSULE)[seed % 3]
    left = np.delete(np.arange(len(solid.faces)), rng.integers(0, len(solid.faces), rng.integers(1, 6)))
    mesh = soup(solid, left)
    if mesh.surface.sheet:
        return
    other = (BALL, cm.Box((0.3, 0.2, 0.5)), soup(trimesh.creation.icosphere(subdivisions=1, radius=0.3)))[seed % 5 % 3]
    X, Y = random_pose(rng, 0.5), random_pose(rng, 1.5)
    truth = cm.contact(soup(solid), X, other, Y)
    c = cm.contact(mesh, X, other, Y)
    upper, lower = truth.signed_distance + truth.error_bound, truth.signed_distance - truth.error_bound
    assert c.signed_distance - c.error_bound <= upper + 1e-12
    assert lower - 1e-12 <= c.signed_distance + c.error_bound
    swapped = cm.contact(other, Y, mesh, X)
    assert swapped.signed_distance == pytest.approx(c.signed_distance, abs=1e-12)
    assert swapped.error_bound == pytest.approx(c.error_bound, abs=1e-11)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_no_impact_of_the_closed_solid_comes_before_the_lower_end(seed):
    rng = np.random.default_rng(seed)
    left = np.delete(np.arange(len(TORUS.faces)), rng.integers(0, len(TORUS.faces), 4))
    X, Y = random_pose(rng, 0.2), Pose(rng.normal(size=3) * 1.5)
    a, b = Motion(X, angular=rng.normal(size=3)), Motion(Y, -Y.position + rng.normal(size=3) * 0.3)
    truth = cm.time_of_impact(soup(TORUS), a, BALL, b)
    found = cm.time_of_impact(soup(TORUS, left), a, BALL, b)
    assert found.lower <= truth.upper
    if found.status == "clear":
        assert truth.status == "clear"
    if found.status == "hit":
        assert truth.lower <= found.upper + 1e-9


def test_parts_that_overlap_are_one_solid():
    """The space that two closed parts share is inside, not outside as the parity of a ray would say."""
    apart = trimesh.creation.box((2, 2, 2), trimesh.transformations.translation_matrix((1, 0.3, 0.2)))
    both = soup(trimesh.util.concatenate([CUBE, apart]))
    c = cm.contact(both, Pose(), cm.Sphere(0.1), Pose((0.5, 0, 0)))
    assert c.overlaps and c.signed_distance == pytest.approx(-0.4)


CUP = trimesh.creation.box((1, 1, 1))
CUP.update_faces(CUP.triangles_center[:, 2] < 0.4)  # the box around its hole does not contain it


def scattered(rng):
    corners = 0.4 * rng.normal(size=(40, 1, 3)) + 0.1 * rng.normal(size=(40, 3, 3))
    return cm.Mesh(corners.reshape(-1, 3), np.arange(120).reshape(-1, 3))


def gap(a, pose_a, b, pose_b):
    """How far the solids that open meshes may belong to are apart at least."""
    return least_gap(exact_body(a, "a"), pose_a, exact_body(b, "b"), pose_b)


PAIRS = [("soup", "soup"), ("soup", "cup"), ("cup", "cup"), ("cup", "solid"), ("soup", "solid")]


@pytest.mark.parametrize(("a", "b"), PAIRS)
def test_the_solids_that_open_meshes_may_be_meet_when_their_contacts_may_overlap(a, b):
    rng = np.random.default_rng(len(a) + 7 * len(b))
    make = {
        "soup": scattered,
        "cup": lambda rng: cm.Mesh(rng.choice([0.3, 1.0]) * CUP.vertices, CUP.faces),
        "solid": lambda rng: cm.Box((0.3, 0.2, 0.4)),
    }
    compared = 0
    for k in range(60):
        A, B = make[a](rng), make[b](rng)
        start = random_pose(rng, 0.1 if k % 4 == 0 else 2.0)  # one in the other, or beside it
        one = Motion(random_pose(rng, 0.0), angular=rng.normal(size=3))
        other = Motion(start, -start.position, rng.normal(size=3))
        found = cm.time_of_impact(A, one, B, other)

        def least(t):
            c = cm.contact(A, one.at(t), B, other.at(t))  # noqa: B023
            return min(c.signed_distance - c.error_bound, gap(A, one.at(t), B, other.at(t)))  # noqa: B023

        if found.lower == 0.0:
            assert least(0.0) <= 1e-9, k
            continue
        compared += 1
        last = min(found.lower, 2.0)
        assert all(least(t) > -1e-9 for t in np.linspace(0.0, last, 9)[:-1]), k
        if found.lower < np.inf:
            assert least(last) < 1e-5, k
    assert compared > 10


@pytest.mark.parametrize(("a", "b"), [("soup", "soup"), ("cup", "cup"), ("soup", "cup")])
def test_open_meshes_that_part_or_pass_each_other_are_clear(a, b):
    rng = np.random.default_rng(5)
    make = {"soup": scattered, "cup": lambda rng: cm.Mesh(CUP.vertices, CUP.faces)}
    for _ in range(10):
        A, B = make[a](rng), make[b](rng)
        aside = 5.0 * np.eye(3)[rng.integers(3)]
        motions = (
            Motion(Pose(), angular=rng.normal(size=3)),
            Motion(Pose(aside), rng.choice([1.0, -0.1]) * aside, rng.normal(size=3)),
        )
        assert cm.time_of_impact(A, motions[0], B, motions[1]).status == "clear"


@pytest.mark.parametrize("velocity", [(0, 0, -1), (0, 0, 1), (1, 0, 0)], ids=["into", "away", "along"])
def test_the_answer_of_two_sheets_that_touch_is_quick(velocity):
    """One stands on the other on the line between two rows of its faces."""
    corner = np.arange(400).reshape(20, 20)
    quads = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], -1).reshape(-1, 4)
    rows = np.linspace(-1, 1, 20)
    points = np.array([(x, y, 0) for x in rows for y in rows])
    flat = cm.Mesh(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    upright = Pose.from_euler(np.pi / 2, 0, 0, (0, 0, 1))
    assert abs(cm.distance(flat, Pose(), flat, upright)) < 1e-12
    motions = Motion(Pose()), Motion(upright, velocity)
    found = cm.time_of_impact(flat, motions[0], flat, motions[1])
    with within(0.25):
        again = cm.time_of_impact(flat, motions[0], flat, motions[1])
    assert (again.status, again.lower, again.upper) == (found.status, found.lower, found.upper)
    assert found.status == {-1: "hit", 1: "clear"}.get(velocity[2], found.status)
    assert velocity[2] >= 0 or found.upper < 1e-5
