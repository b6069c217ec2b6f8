"""The scene plan names the work that the described objects need, and follows their changes."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.narrow_phase.dispatch import pair_test
from collision_monitor.records import Phase, PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import KIND_NAMES, Box, Circle, Cone, ConvexHull, Cylinder, HalfSpace, Sphere

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import scene_plan

TETRAHEDRON = ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def test_spheres_alone_need_neither_sat_nor_rotation() -> None:
    monitor = Monitor()
    for object_id in range(3):
        monitor.add(object_id, Sphere(0.5))
    assert monitor.plan.tests == {("sphere", "sphere"): "sphere_sphere"}
    assert monitor.plan.turning == 0
    assert {reason.split(":")[0] for reason in monitor.plan.unneeded} == {
        "SAT", "GJK and EPA", "rotation", "models", "uncertainty", "groups and masks",
    }  # fmt: skip


def test_separated_boxes_need_gjk() -> None:
    monitor = Monitor()
    for object_id in range(2):
        monitor.add(object_id, Box((1, 1, 1)))
    assert "EPA: no pair needs it; separated boxes use GJK" in monitor.plan.unneeded
    assert not any(reason.startswith("GJK") for reason in monitor.plan.unneeded)


def test_it_follows_what_is_added_and_removed() -> None:
    monitor = Monitor()
    monitor.add(1, Sphere(0.5))
    before = monitor.plan
    assert before.tests == {}, "one object meets nobody"
    monitor.add(2, [(Box((1, 1, 1)), Pose()), (Cone(0.5, 1.0), Pose((0, 0, 1)))], group=2)
    monitor.add(3, HalfSpace((0, 0, 1), 0.0), static=True, pose=Pose())
    monitor.add(4, TETRAHEDRON, static=True, pose=Pose((9, 0, 0)))
    p = monitor.plan
    assert p.shapes == {"sphere": 1, "box": 1, "cone": 1, "convex hull": 1, "half-space": 1}
    assert (p.moving, p.static, p.turning, p.groups) == (2, 2, 1, 2)
    assert p.tests["sphere", "box"] == "sphere_box"
    assert p.tests["sphere", "half-space"] == "half_space"
    assert p.tests["box", "convex hull"] == "convex_convex"
    assert ("convex hull", "half-space") not in p.tests, "both are static"
    for object_id in (2, 3, 4):
        monitor.remove(object_id)
    assert str(monitor.plan) == str(before)


def test_cells_follow_size_and_speed() -> None:
    widest = []
    for speed in (0.0, 100.0):
        monitor = Monitor()
        monitor.add(1, Sphere(0.5))
        monitor.step(0, [1], np.array([[0, 0, 0, 0, 0, 0, 1.0]]), np.array([[speed, 0, 0, 0, 0, 0.0]]))
        assert sum(monitor.plan.cells.values()) == 1
        widest.append(max(monitor.plan.cells))
    assert widest[0] < 10 < 100 < widest[1]


@pytest.mark.parametrize("pair", [(a, b) for a in KIND_NAMES for b in KIND_NAMES if a <= b])
def test_each_test_is_a_file_of_the_narrow_phase(pair: tuple[int, int]) -> None:
    import_module(f"collision_monitor.narrow_phase.{pair_test(*pair)}")


def test_it_counts_what_is_left_out() -> None:
    monitor = Monitor(Profile(region_min=(-1, -1, -1), region_max=(50, 50, 50)))
    for object_id in range(6):
        monitor.add(object_id, Circle(0.5), group=1 + object_id % 2, mask=1 + object_id % 2)
    for object_id in range(6, 9):
        fixed = Pose((0, 0, 0))
        monitor.add(object_id, Circle(0.5), static=True, pose=fixed, group=1 + object_id % 2, mask=1 + object_id % 2)
    poses = np.zeros((6, 7))
    poses[:, 6] = 1.0
    poses[4:, 0] = 100.0
    monitor.step(0, np.arange(6), poses)
    p = monitor.plan
    assert (p.planar, p.modelled, p.uncertain, p.outside) == (True, 0, False, 2)
    ids = range(9)
    apart = [(a, b) for a in ids for b in ids if a < b and a < 6 and a % 2 != b % 2]
    assert p.never_meet == len(apart)
    monitor.profile = "exact"
    text = " ".join(monitor.plan.unneeded)
    assert "2 objects outside of the region" in text and f"{len(apart)} pairs of groups that never meet" in text


@pytest.mark.parametrize("name", scene_plan.ITEMS)
def test_leaving_it_out_changes_no_answer(name: str) -> None:
    """Compare with the same scene with the item forced on, at every step."""
    item = scene_plan.ITEMS[name](80)
    reported = 0
    for _, (stamp, states) in zip(range(40), item.states, strict=False):
        off, on = item.off.step(stamp, states), item.on.step(stamp, item.states_on(states))
        contacts = [r.contacts[r.contacts["phase"] != Phase.END] for r in (off, on)]
        contacts[1] = contacts[1][item.asked_for(contacts[1], states)]
        for field in ("id_a", "id_b", "status"):
            assert np.array_equal(contacts[0][field], contacts[1][field])
        assert np.allclose(contacts[0]["signed_distance"], contacts[1]["signed_distance"], atol=1e-9)
        certain = [r.predictions[r.predictions["status"] == PredictionStatus.HIT] for r in (off, on)]
        certain[1] = certain[1][item.asked_for(certain[1], states)]
        mine, forced = ({(int(p["id_a"]), int(p["id_b"])): p for p in each} for each in certain)
        stated = [{(int(p["id_a"]), int(p["id_b"])) for p in r.predictions} for r in (off, on)]
        for pair in mine.keys() | forced.keys():
            first = mine.get(pair, forced.get(pair))
            if first["lower"] < 1.9:  # close to the horizon one monitor may see it first
                assert pair in stated[0] and pair in stated[1]
            if pair in mine and pair in forced:
                assert mine[pair]["lower"] <= forced[pair]["upper"] + 1e-9
                assert forced[pair]["lower"] <= mine[pair]["upper"] + 1e-9
        reported += len(contacts[0]) + len(mine)
    assert reported > 40


def test_people_can_read_it() -> None:
    monitor = Monitor()
    monitor.add(1, Box((1, 1, 1)))
    monitor.add(2, Cylinder(0.5, 1.0))
    text = str(monitor.plan)
    assert "objects   2 moving, 0 static" in text
    assert "test      box – box: box_box (SAT)" in text
    assert "not used  models: every object is tested as it is; " in text
