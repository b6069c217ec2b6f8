"""Tests of models in the monitor: coarse models hide no collision, scenes in the plane ignore the height."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull as Qhull

import collision_monitor as cm
from collision_monitor import Monitor, Pose, records
from collision_monitor.records import ContactStatus, Model, PredictionStatus

SECOND = 1_000_000_000
TORUS = trimesh.creation.torus(0.5, 0.15, major_sections=12, minor_sections=6)
COARSE = [Model.SPHERE, Model.AABB, Model.OBB, Model.KDOP14, Model.KDOP26, Model.CONVEX_HULL]


def crowd(rng, count, flat=False):
    """Poses (n, 7) and twists (n, 6) of objects in random motion."""
    quaternions = rng.normal(size=(count, 4))
    poses = np.column_stack([rng.uniform(-2, 2, (count, 3)), quaternions])
    twists = np.column_stack([rng.normal(size=(count, 3)), rng.normal(size=(count, 3))])
    if flat:
        poses[:, 2:5] = 0.0
        twists[:, 2:5] = 0.0
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return poses, twists


def pairs(rows):
    return {(int(r["id_a"]), int(r["id_b"])): r for r in rows}


@pytest.mark.parametrize("model", COARSE, ids=lambda m: m.name.lower())
def test_a_coarse_model_hides_nothing_and_states_its_error(model):
    rng = np.random.default_rng(5)
    shapes = [cm.Box((0.8, 0.4, 0.2)), cm.Capsule(0.2, 0.6), cm.ConvexHull(rng.normal(size=(12, 3)) * 0.4)] * 4
    exact, coarse = Monitor("exact"), Monitor("exact")
    for k, shape in enumerate(shapes):
        exact.add(k, shape)
        coarse.add(k, shape, model=model)
    ids = np.arange(len(shapes))
    wider = 0
    for step in range(30):
        poses, twists = crowd(rng, len(shapes))
        reported, true = (m.step(step * SECOND // 10, ids, poses, twists) for m in (coarse, exact))
        contacts, events = pairs(reported.contacts), pairs(reported.predictions)
        for pair, contact in pairs(true.contacts).items():
            if contact["phase"] != records.Phase.END:
                row = contacts[pair]
                wrong = abs(row["signed_distance"] - contact["signed_distance"])
                assert wrong <= row["error_bound"] + contact["error_bound"]
        for pair, event in pairs(true.predictions).items():
            assert pair in contacts or events[pair]["lower"] <= event["upper"]
        assert (reported.predictions["model_a"] == model).all()
        for row in reported.contacts[reported.contacts["phase"] != records.Phase.END]:
            assert row["model_a"] == row["model_b"] == model
            if row["status"] == ContactStatus.TOUCHING:
                assert (row["id_a"], row["id_b"]) in pairs(true.contacts)
            wider += row["status"] == ContactStatus.UNRESOLVED
        sure = reported.predictions["status"] == PredictionStatus.HIT
        if model is not Model.CONVEX_HULL:
            assert not sure.any()
            assert np.isinf(reported.predictions["upper"]).all()
    assert wider > 0 or model is Model.CONVEX_HULL  # the hull is exact for these shapes


def test_a_concave_mesh_is_exact_and_its_hull_is_a_coarser_model_that_says_so():
    monitor = Monitor()
    monitor.add(1, cm.Mesh(TORUS.vertices, TORUS.faces))
    monitor.add(2, cm.Sphere(0.1))
    poses = [(0, 0, 0, 0, 0, 0, 1)] * 2
    assert not len(monitor.step(SECOND, [1, 2], poses).contacts)  # in the hole of the ring
    monitor.add(1, cm.Mesh(TORUS.vertices, TORUS.faces), model=Model.CONVEX_HULL, replace=True)
    (row,) = monitor.step(2 * SECOND, [1, 2], poses).contacts
    assert row["status"] == ContactStatus.UNRESOLVED  # the hull fills the hole
    assert (row["model_a"], row["model_b"]) == (Model.CONVEX_HULL, Model.EXACT)
    assert row["signed_distance"] + row["error_bound"] >= 0.25


def test_a_convex_mesh_is_exact():
    cube = trimesh.creation.box((1, 1, 1))
    monitor = Monitor()
    monitor.add(1, cm.Mesh(cube.vertices, cube.faces), model=Model.EXACT)
    monitor.add(2, cm.Sphere(0.5))
    (row,) = monitor.step(SECOND, [1, 2], [(0, 0, 0, 0, 0, 0, 1), (0.9, 0, 0, 0, 0, 0, 1)]).contacts
    assert row["signed_distance"] == pytest.approx(-0.1)
    assert row["model_a"] == Model.EXACT


def test_the_plane_answers_as_tall_prisms_in_space_do():
    rng = np.random.default_rng(9)
    outlines = [rng.normal(size=(n, 2)) * 0.5 for n in (5, 6, 8)] * 3
    plane, space = Monitor("exact"), Monitor("exact")
    for k, points in enumerate(outlines):
        hull = points[Qhull(points).vertices]
        plane.add(k, cm.Polygon(hull))
        space.add(k, cm.ConvexHull(np.concatenate([np.c_[hull, np.full(len(hull), z)] for z in (-9.0, 9.0)])))
    for k in range(3):
        plane.add(20 + k, cm.Circle(0.2))
        space.add(20 + k, cm.Sphere(0.2))
    ids = np.array(plane.ids)
    seen = 0
    for step in range(20):
        poses, twists = crowd(rng, len(ids), flat=True)
        # heights, a small tilt and motion out of the plane change nothing
        tilted = poses.copy()
        tilted[:, 2] = rng.uniform(-50, 50, len(ids))
        dizzy = twists.copy()
        dizzy[:, 2:5] = rng.normal(size=(len(ids), 3))
        mine = plane.step(step * SECOND // 10, ids, tilted, dizzy)
        theirs = space.step(step * SECOND // 10, ids, poses, twists)
        a, b = pairs(mine.contacts), pairs(theirs.contacts)
        assert a.keys() == b.keys()
        for pair, row in a.items():
            if row["phase"] != records.Phase.END:
                assert row["signed_distance"] == pytest.approx(b[pair]["signed_distance"], abs=1e-9)
        a, b = pairs(mine.predictions), pairs(theirs.predictions)
        assert a.keys() == b.keys()
        for pair, row in a.items():
            seen += max(row["upper"], b[pair]["upper"]) < np.inf  # else one of the two comparisons says nothing
            assert row["lower"] <= b[pair]["upper"] and b[pair]["lower"] <= row["upper"]
    assert seen > 50


def test_concave_polygons_and_walls_of_the_plane():
    monitor = Monitor()
    monitor.add(1, cm.Polygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]), static=True, pose=Pose((0, 0, 3)))
    monitor.add(2, cm.Circle(0.3))
    result = monitor.step(SECOND, [2], [(1.5, 2.0, 0, 0, 0, 0, 1)], [(0, -1, 0, 0, 0, 0)])
    (row,) = result.predictions
    assert row["lower"] <= 0.7 <= row["upper"]
    assert row["shape_a"] == 0
    assert "polygon_polygon" in set(monitor.plan.tests.values())
    down = monitor.step(SECOND + 1, [2], [(1.5, 2.0, 0, 1, 0, 0, 0)])
    assert monitor.refused[cm.Refusal.QUATERNION] == 1 and down.status.predictions == 1
    with pytest.raises(cm.PoseError, match="z to point up"):
        monitor.add(3, cm.Circle(1), static=True, pose=Pose((0, 0, 0), (1, 0, 0, 0)))
    monitor.remove(1)
    monitor.remove(2)
    monitor.add(1, cm.Sphere(1))  # an empty monitor accepts a scene of either kind


def test_a_kdop_of_own_directions_contains_the_object_and_states_its_excess() -> None:
    rng = np.random.default_rng(1)
    away = cm.Pose((9, 1, 2))
    for shape in (cm.ConvexHull(rng.normal(size=(20, 3))), cm.Cylinder(0.4, 2), cm.Cone(0.5, 1)):
        exact = cm.contact(shape, cm.Pose(), cm.Sphere(0.1), away)
        for directions in (np.eye(3), rng.normal(size=(4, 3)), rng.normal(size=(30, 3))):
            coarse = cm.contact(shape, cm.Pose(), cm.Sphere(0.1), away, model=directions)
            assert coarse.signed_distance <= exact.signed_distance + 1e-7
            assert coarse.signed_distance + coarse.error_bound >= exact.signed_distance - 1e-7
    box = cm.Box((1, 2, 3))
    tight = cm.contact(box, cm.Pose(), cm.Sphere(0.1), away, model=[(1, 0, 0), (0, 5, 0), (0, 0, 1)])
    aabb = cm.contact(box, cm.Pose(), cm.Sphere(0.1), away, model="aabb")
    assert tight.signed_distance == pytest.approx(aabb.signed_distance, abs=0.2)


@pytest.mark.parametrize(
    ("directions", "text"),
    [
        ([(1, 0, 0), (0, 1, 0), (1, 1, 0)], "not in one plane"),
        ([(1, 0, 0), (0, 1, 0), (0, 0, 0)], "zero vector"),
        (np.ones((500, 3)), "at most 200"),
        ([(1, 0)], "shape"),
        ([(1, 0, float("nan"))], "finite"),
    ],
)
def test_impossible_directions_are_refused(directions: object, text: str) -> None:
    with pytest.raises(cm.InputError, match=text):
        cm.contact(cm.Box((1, 1, 1)), cm.Pose(), cm.Sphere(1), cm.Pose((3, 0, 0)), model=directions)
