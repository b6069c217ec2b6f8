"""The scene plan names what the described objects require, and follows their changes."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest

from collision_monitor import plan
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Box, Cone, ConvexHull, Cylinder, HalfSpace, Sphere
from collision_monitor.monitor import Monitor

TETRAHEDRON = ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def test_spheres_alone_need_neither_sat_nor_rotation() -> None:
    monitor = Monitor()
    for object_id in range(3):
        monitor.add(object_id, Sphere(0.5))
    assert monitor.plan.tests == {("sphere", "sphere"): "sphere_sphere"}
    assert monitor.plan.turning == 0
    assert {reason.split(":")[0] for reason in monitor.plan.unneeded} == {
        "SAT", "GJK and EPA", "rotation", "groups and masks",
    }  # fmt: skip


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


@pytest.mark.parametrize("pair", [(a, b) for a in plan.KIND_NAMES for b in plan.KIND_NAMES if a <= b])
def test_each_test_is_a_file_of_the_narrow_phase(pair: tuple[int, int]) -> None:
    import_module(f"collision_monitor.narrow_phase.{plan.pair_test(*pair)}")


def test_people_can_read_it() -> None:
    monitor = Monitor()
    monitor.add(1, Box((1, 1, 1)))
    monitor.add(2, Cylinder(0.5, 1.0))
    text = str(monitor.plan)
    assert "objects   2 moving, 0 static" in text
    assert "test      box – box: box_box (SAT)" in text
    assert "not used  groups and masks" in text
