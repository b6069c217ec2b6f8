"""Planning scenes of MoveIt: worlds, objects that a robot holds, padding, scale, allowed pairs, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from planning_messages import (
    APPEND,
    ARM,
    MOVE,
    OBJECT,
    REMOVE,
    ROBOT,
    SCENE,
    a_scene,
    allowed_pairs,
    an_object,
    attached,
    matrix,
    ready,
    solid,
    with_world,
)
from played_sources import MILLISECOND, START, Played, base_row, check, transform, turned
from ros_messages import message, point, pose

from collision_monitor import Box, Cone, ConvexHull, Cylinder, HalfSpace, Mesh, Sphere
from collision_monitor.robots.robot import Description, Robot
from collision_monitor.shapes.pose import Pose, multiply, rotation_matrix

TF = "tf2_msgs/msg/TFMessage"


def test_solids_become_shapes() -> None:
    square, cross = [(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    triangle = message("shape_msgs/msg/MeshTriangle", vertex_indices=np.array([0, 1, 2], np.uint32))
    mesh = message("shape_msgs/msg/Mesh", triangles=[triangle], vertices=[point(*row) for row in np.eye(3)])
    plane = message("shape_msgs/msg/Plane", coef=np.array([0, 0, 2.0, -1.0]))
    played = with_world()
    solids = [solid(1, 1, 2, 3), solid(2, 1), solid(3, 2, 1), solid(4, 2, 1), solid(5, 2, outline=square)]
    content = an_object("all", *solids, solid(5, 2, outline=cross), meshes=[mesh], planes=[plane])
    played.send("/scene", OBJECT, content)
    shapes = [shape for shape, _ in played.objects["world/all"].shapes]
    assert shapes[:4] == [Box((1, 2, 3)), Sphere(1), Cylinder(1, 2), Cone(1, 2)]
    prism, *parts, faces, below = shapes[4:]
    assert isinstance(prism, ConvexHull) and sorted({*prism.points[:, 2]}) == [-1, 1]
    assert len(parts) == 2 and all(isinstance(part, ConvexHull) for part in parts)
    assert isinstance(faces, Mesh) and faces.vertices.tolist() == np.eye(3).tolist()
    assert isinstance(below, HalfSpace) and below.normal.tolist() == [0, 0, 1] and below.offset == 0.5


def test_objects_are_added_moved_appended_and_removed() -> None:
    played = with_world(padding=0.01)
    played.send("/scene", OBJECT, an_object("box", solid(1, 1, 1, 1), at=pose((1, 2, 3), turned(0, 0, 1))))
    it = played.objects["world/box"]
    assert it.static and it.pose is not None and it.pose.position.tolist() == [1, 2, 3] and it.padding == 0.01
    played.send("/scene", OBJECT, an_object("box", solid(2, 1), operation=APPEND))
    assert [type(shape) for shape, _ in played.objects["world/box"].shapes] == [Box, Sphere]
    played.send("/scene", OBJECT, an_object("box", at=pose((4, 5, 6)), operation=MOVE))
    it = played.objects["world/box"]
    assert it.pose is not None and it.pose.position.tolist() == [4, 5, 6] and len(it.shapes) == 2
    count = played.messages
    played.send("/scene", OBJECT, an_object("ball", solid(2, 1)))
    played.send("/scene", OBJECT, an_object("ball", solid(2, 1)))  # the same again
    assert played.messages == count + 1
    played.send("/scene", OBJECT, an_object("ball", operation=REMOVE))
    assert set(played.objects) == {"world/box"}
    played.send("/scene", OBJECT, an_object("ball", solid(2, 1)))
    played.send("/scene", OBJECT, an_object("", operation=REMOVE))
    assert not played.objects and not played.refusals


def test_a_scene_that_is_no_difference_replaces_the_world() -> None:
    played = with_world()
    played.send("/scene", SCENE, a_scene(an_object("a", solid(2, 1)), an_object("b", solid(2, 1))))
    played.send("/scene", SCENE, a_scene(an_object("c", solid(2, 1))))
    assert set(played.objects) == {"world/a", "world/b", "world/c"}
    ids = {name: it.object_id for name, it in played.objects.items()}
    played.send("/scene", SCENE, a_scene(an_object("b", solid(2, 2)), is_diff=False))
    assert set(played.objects) == {"world/b"} and played.objects["world/b"].object_id == ids["world/b"]


def test_an_object_waits_for_its_frame() -> None:
    played = Played(ROBOT)
    content = an_object("table", solid(1, 1, 1, 1), frame="hall", at=pose((1, 0, 0)))
    played.send("/scene", SCENE, a_scene(content))
    assert "arm/table" not in played.objects
    assert any("arm: table: no transform from 'map' to 'hall'" in text for text in played.refusals)
    played.send("/tf_static", TF, transform(START, "map", "hall", (10, 0, 0)))
    played.joints(START, np.zeros(8), np.zeros(8))
    at = played.objects["arm/table"].pose
    assert at is not None and at.position.tolist() == [11, 0, 0]


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (an_object("x"), "expected at least one shape, got none"),
        (an_object("x", solid(1, 1, -1, 1)), "x: Box size: expected 3 extents"),
        (an_object("x", solid(1, 1)), "x: SolidPrimitive of type 1: expected 3 dimensions, got 1"),
        (an_object("x", solid(9)), "x: SolidPrimitive: expected a type from 1 (BOX) to 5 (PRISM), got 9"),
        (an_object("x", solid(2, 1), at=pose((np.nan, 0, 0))), "x: position: expected finite numbers"),
        (an_object("x", solid(2, 1), at=pose((0, 0, 0), (0, 0, 0, np.inf))), "x: quaternion: expected finite"),
        (an_object("x", solid(2, 1), operation=MOVE), "x: expected an object that was added before"),
        (an_object("x", solid(2, 1), operation=9), "x: operation: expected 0 (ADD) to 3 (MOVE), got 9"),
        (an_object("x", solid(2, 1), primitive_poses=[pose()] * 2), "x: expected a pose of each of 1 shapes, got 2"),
        (an_object("x", solid(5, 1, outline=[(0, 0), (1, 0)])), "x: Polygon points: expected at least 3 points"),
    ],
)
def test_objects_that_cannot_be_used_are_counted(content: Any, text: str) -> None:
    played = with_world()
    played.send("/scene", SCENE, a_scene(content, an_object("good", solid(2, 1))))
    assert set(played.objects) == {"world/good"}
    (refusal,) = played.refusals
    assert text in refusal and refusal.startswith("world: ")


def test_an_attached_object_moves_with_its_link() -> None:
    played, joints = ready()
    offset = Pose((0.1, 0.2, 0.3), turned(0.4, 0.5, 0.6))
    content = an_object("cup", solid(3, 0.1, 0.03), frame="hand", at=pose(offset.position, offset.quaternion))
    played.send("/scene", SCENE, a_scene(held=[attached("hand", content, "left_finger", "right_finger")]))
    cup = played.objects["arm/cup"]
    touched = {name for name, it in played.objects.items() if it.object_id in cup.allowed}
    assert touched == {"arm/hand", "arm/left_finger", "arm/right_finger"} and not cup.static
    played.joints(START + MILLISECOND, *joints.T)
    state = played.states.pop("arm/cup")
    robot = Robot(Description.read(ARM))
    check(played, robot, joints, base_row((1, 2, 0.5)))
    poses, twists = robot.states(joints, base_row((1, 2, 0.5)))
    row = robot.tree.links.index("hand")
    arm_of = rotation_matrix(poses[row, 3:]) @ offset.position
    np.testing.assert_allclose(state["position"], poses[row, :3] + arm_of, rtol=0, atol=1e-12)
    np.testing.assert_allclose(state["quaternion"], multiply(poses[row, 3:], offset.quaternion), rtol=0, atol=1e-12)
    linear = twists[row, :3] + np.cross(twists[row, 3:], arm_of)
    np.testing.assert_allclose(state["linear"], linear, rtol=0, atol=1e-9)
    np.testing.assert_allclose(state["angular"], twists[row, 3:], rtol=0, atol=1e-9)


def test_an_object_of_the_world_is_picked_up_and_put_down() -> None:
    played, joints = ready()
    at = pose((1.5, 2, 1), turned(0, 0, 1))
    played.send("/scene", SCENE, a_scene(an_object("cup", solid(3, 0.1, 0.03), at=at)))
    before = played.objects["arm/cup"]
    assert before.static
    played.send("/scene", SCENE, a_scene(held=[attached("hand", an_object("cup"))]))
    held = played.objects["arm/cup"]
    assert not held.static and held.object_id == before.object_id
    played.joints(START, *joints.T)
    np.testing.assert_allclose(played.states["arm/cup"]["position"], (1.5, 2, 1), rtol=0, atol=1e-12)
    played.joints(START + MILLISECOND, *np.add(joints, (0.1, 0)).T)
    moved = played.states["arm/cup"]["position"]
    assert np.linalg.norm(moved - (1.5, 2, 1)) > 0.01
    played.send("/scene", SCENE, a_scene(held=[attached("", an_object("cup", operation=REMOVE))]))
    after = played.objects["arm/cup"]
    assert after.static and after.object_id == before.object_id and after.pose is not None
    np.testing.assert_allclose(after.pose.position, moved, rtol=0, atol=1e-9)
    played.joints(START + 2 * MILLISECOND, *joints.T)
    assert "arm/cup" not in played.states


def test_a_scene_that_is_no_difference_releases_what_it_does_not_hold() -> None:
    played, _ = ready()
    played.send("/scene", SCENE, a_scene(held=[attached("hand", an_object("cup", solid(2, 0.1), frame="hand"))]))
    assert "arm/cup" in played.objects
    played.send("/scene", SCENE, a_scene(is_diff=False))
    assert "arm/cup" not in played.objects and "arm/hand" in played.objects


def test_padding_and_scale_change_the_links() -> None:
    played, _ = ready()
    padding = message("moveit_msgs/msg/LinkPadding", link_name="hand", padding=0.03)
    scale = message("moveit_msgs/msg/LinkScale", link_name="hand", scale=2.0)
    wrong = message("moveit_msgs/msg/LinkScale", link_name="base", scale=0.0)
    played.send("/scene", SCENE, a_scene(link_padding=[padding], link_scale=[scale, wrong]))
    hand = played.objects["arm/hand"]
    assert hand.padding == 0.03 and hand.shapes[0][0] == Box((0.08, 0.4, 0.14))
    assert any("scale of base: expected a positive number, got 0.0" in text for text in played.refusals)
    count = played.messages
    played.send("/scene", SCENE, a_scene(link_padding=[padding], link_scale=[scale]))
    assert played.messages == count


def test_the_allowed_collision_matrix_adds_pairs_and_takes_those_of_the_srdf_back() -> None:
    played, _ = ready()
    before = allowed_pairs(played)
    played.send("/scene", SCENE, a_scene(an_object("table", solid(1, 1, 1, 1)), an_object("wall", solid(2, 1))))
    names = ["base", "table", "left_finger", "right_finger", "forearm"]
    rows = np.zeros((5, 5), bool)
    rows[0, 1] = rows[1, 0] = rows[0, 4] = rows[4, 0] = True
    played.send("/scene", SCENE, a_scene(allowed_collision_matrix=matrix(names, rows, wall=True)))
    added = {("base", "table"), ("base", "forearm")} | {
        (min(name, "wall"), max(name, "wall")) for name in Robot(Description.read(ARM)).links
    }
    assert allowed_pairs(played) == (before | added) - {("left_finger", "right_finger")}
    played.send("/scene", SCENE, a_scene(allowed_collision_matrix=matrix(["a", "b"], rows[:1])))
    assert any("expected 2 rows of 2 values" in text for text in played.refusals)
    played.send("/scene", SCENE, a_scene(an_object("wall", operation=REMOVE)))
    assert ("hand", "wall") not in allowed_pairs(played)


def test_octomaps_and_unknown_links_are_refused() -> None:
    played, _ = ready()
    content = a_scene(held=[attached("tail", an_object("cup", solid(2, 0.1), frame="tail"))])
    content.world.octomap.octomap.data = np.zeros(3, np.int8)
    played.send("/scene", SCENE, content)
    assert any("octomap of the planning scene is not monitored" in text for text in played.refusals)
    assert any("arm: cup: expected it at a link of arm, got 'tail'" in text for text in played.refusals)
