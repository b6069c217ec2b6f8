"""What MoveIt means by its messages, where that is not what one would guess. Source: MoveIt's planning_scene.cpp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from planning_messages import (
    ADD,
    APPEND,
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
from played_sources import START, Played, turned
from ros_messages import message, pose

from collision_monitor import Box, Sphere
from collision_monitor.objects.description import ObjectDescription


def described(played: Played, name: str) -> list[ObjectDescription]:
    """Return the last description of each object of a name that was not removed: of the world, and attached."""
    found: dict[int, ObjectDescription] = {}
    for change in played.changes:
        found.pop(change.object_id, None)
        if isinstance(change, ObjectDescription) and change.name == name:
            found[change.object_id] = change
    return list(found.values())


def cup(*solids: Any, **fields: Any) -> Any:
    return an_object("cup", *(solids or (solid(2, 0.1),)), **fields)


@pytest.mark.parametrize("is_diff", [True, False])
def test_the_world_and_the_robot_may_have_objects_of_one_name(is_diff: bool) -> None:
    played, _ = ready()
    played.send("/scene", SCENE, a_scene(held=[attached("hand", cup(frame="hand"))]))
    held = [attached("hand", cup(frame="hand"))] if not is_diff else []
    played.send("/scene", SCENE, a_scene(cup(solid(1, 1, 1, 1), at=pose((3, 0, 0))), held=held, is_diff=is_diff))
    world, carried = sorted(described(played, "arm/cup"), key=lambda it: not it.static)
    assert world.static and not carried.static
    assert isinstance(world.shapes[0][0], Box) and isinstance(carried.shapes[0][0], Sphere)
    played.send("/scene", SCENE, a_scene(an_object("cup", operation=REMOVE)))  # of the world
    assert [it.object_id for it in described(played, "arm/cup")] == [carried.object_id]
    played.send("/scene", SCENE, a_scene(cup(solid(1, 1, 1, 1), at=pose((3, 0, 0)))))
    played.send("/scene", SCENE, a_scene(held=[attached("hand", an_object("cup", operation=REMOVE))]))
    assert [it.static for it in described(played, "arm/cup")] == [True]  # the world has one of its name already


def test_what_is_attached_leaves_the_world_and_a_removal_behind_it_removes_nothing_more() -> None:
    played, _ = ready()
    played.send("/scene", SCENE, a_scene(cup(at=pose((1.5, 2, 1)))))
    (before,) = described(played, "arm/cup")
    gone = an_object("cup", operation=REMOVE)  # as MoveIt's monitor writes the difference
    played.send("/scene", SCENE, a_scene(gone, held=[attached("hand", an_object("cup"))]))
    (after,) = described(played, "arm/cup")
    assert not after.static and after.object_id == before.object_id and not played.refusals


def test_a_full_scene_replaces_matrix_padding_and_scale_also_by_empty_ones() -> None:
    played, _ = ready()
    before = allowed_pairs(played), played.objects["arm/hand"].padding, played.objects["arm/hand"].shapes[0][0]
    padding = message("moveit_msgs/msg/LinkPadding", link_name="hand", padding=0.03)
    scale = message("moveit_msgs/msg/LinkScale", link_name="hand", scale=2.0)
    rows = np.array([[False, True], [True, False]])
    rules = {"link_padding": [padding], "link_scale": [scale]}
    table = an_object("table", solid(1, 1, 1, 1))
    played.send("/scene", SCENE, a_scene(table, allowed_collision_matrix=matrix(["hand", "table"], rows), **rules))
    assert ("hand", "table") in allowed_pairs(played) and played.objects["arm/hand"].padding == 0.03
    played.send("/scene", SCENE, a_scene(table))  # a difference says nothing about them
    assert ("hand", "table") in allowed_pairs(played) and played.objects["arm/hand"].padding == 0.03
    played.send("/scene", SCENE, a_scene(table, is_diff=False))
    hand = played.objects["arm/hand"]
    assert (allowed_pairs(played), hand.padding, hand.shapes[0][0]) == before


def test_an_object_that_is_removed_and_added_again_is_another_one_to_the_matrix() -> None:
    played, _ = ready()
    rows = np.array([[False, True], [True, False]])
    table = an_object("table", solid(1, 1, 1, 1))
    allowed = a_scene(table, allowed_collision_matrix=matrix(["hand", "table"], rows, table=True))
    played.send("/scene", SCENE, allowed)
    assert {("hand", "table"), ("forearm", "table")} & allowed_pairs(played) >= {("hand", "table")}
    played.send("/scene", SCENE, a_scene(an_object("table", operation=REMOVE)))
    played.send("/scene", SCENE, a_scene(table))
    assert not any("table" in pair for pair in allowed_pairs(played))
    played.send("/scene", SCENE, allowed)
    assert ("hand", "table") in allowed_pairs(played)


def test_an_attached_object_has_the_padding_and_the_scale_of_its_link() -> None:
    played, _ = ready()
    padding = message("moveit_msgs/msg/LinkPadding", link_name="hand", padding=0.03)
    scale = message("moveit_msgs/msg/LinkScale", link_name="hand", scale=2.0)
    square = solid(5, 1, outline=[(0, 0), (1, 0), (1, 1), (0, 1)])
    held = [attached("hand", cup(solid(2, 0.1), square, frame="hand"))]
    played.send("/scene", SCENE, a_scene(held=held, link_padding=[padding], link_scale=[scale]))
    (it,) = described(played, "arm/cup")
    ball, prism = (shape for shape, _ in it.shapes)
    assert it.padding == 0.03 and ball == Sphere(0.2) and np.ptp(prism.points, axis=0).tolist() == [2, 2, 2]


def test_append_to_an_attached_object_adds_shapes_joins_touch_links_and_keeps_its_place() -> None:
    played, joints = ready()
    first = attached("hand", cup(at=pose((1, 2, 1), turned(0, 0, 1))), "left_finger")
    played.send("/scene", SCENE, a_scene(held=[first]))
    played.joints(START + 10**6, *np.add(joints, (0.2, 0)).T)  # the arm moves on, with the cup
    before = played.states["arm/cup"]
    more = attached("hand", cup(solid(1, 1, 1, 1), at=pose(), operation=APPEND), "right_finger")
    played.send("/scene", SCENE, a_scene(held=[more]))
    (it,) = described(played, "arm/cup")
    touched = {name for name, other in played.objects.items() if other.object_id in it.allowed}
    assert {"arm/left_finger", "arm/right_finger", "arm/hand"} <= touched and len(it.shapes) == 2
    played.joints(START + 2 * 10**6, *np.add(joints, (0.2, 0)).T)
    np.testing.assert_allclose(played.states["arm/cup"]["position"], before["position"], atol=1e-9)


def test_append_to_what_is_not_there_adds_it() -> None:
    played = with_world()
    played.send("/scene", SCENE, a_scene(cup(operation=APPEND)))
    assert set(played.objects) == {"world/cup"} and not played.refusals


def test_missing_poses_and_zero_quaternions_are_the_identity() -> None:
    played = with_world()
    fields = {"primitive_poses": [pose((1, 0, 0), (0, 0, 0, 0))], "at": pose((0, 0, 5), (0, 0, 0, 0))}
    played.send("/scene", SCENE, a_scene(cup(solid(2, 1), solid(2, 2), solid(2, 3), **fields)))
    it = played.objects["world/cup"]
    assert [at.position.tolist() for _, at in it.shapes] == [[1, 0, 0], [0, 0, 0], [0, 0, 0]]
    assert it.pose is not None and it.pose.quaternion.tolist() == [0, 0, 0, 1] and not played.refusals


@pytest.mark.parametrize(
    "turn", [(0, 0, 0, 2), (0.3, 0, 0, 0.4), (1e-30, 0, 0, 1e-30), (1e200, 0, 0, 0), (0, 0, 0, -1)]
)
def test_quaternions_of_objects_have_no_length(turn: Any) -> None:
    played = with_world()
    played.send("/scene", SCENE, a_scene(cup(at=pose((1, 0, 0), turn))))
    at = played.objects["world/cup"].pose
    unit = np.divide(turn, max(map(abs, turn)))
    assert at is not None and not played.refusals
    np.testing.assert_allclose(at.quaternion, unit / np.linalg.norm(unit), atol=1e-15)


@pytest.mark.parametrize("flat", [(2, 0), (3, 0, 1), (3, 1, 0), (4, 0, 1), (1, 0, 0, 0)])
def test_solids_of_no_size_have_a_least_extent(flat: Any) -> None:
    played = with_world()
    played.send("/scene", SCENE, a_scene(cup(solid(*flat))))
    assert set(played.objects) == {"world/cup"} and not played.refusals


def test_what_cannot_be_attached_is_listed_and_the_world_keeps_its_objects() -> None:
    played, _ = ready()
    before = set(played.objects)
    bad = [attached("hand", an_object("ghost")), attached("hand", an_object("pen", solid(2, np.nan), frame="hand"))]
    played.send("/scene", SCENE, a_scene(held=[*bad, attached("hand", cup(frame="hand"))]))
    assert set(played.objects) == {*before, "arm/cup"}
    assert {row.what for row in played.feed.unmonitored} == {"arm/ghost", "arm/pen"}
    played, _ = ready()
    played.send("/scene", SCENE, a_scene(cup(at=pose((3, 0, 0)))))
    played.send("/scene", SCENE, a_scene(held=[attached("no_link", an_object("cup"))]))
    assert [it.static for it in described(played, "arm/cup")] == [True] and not played.feed.unmonitored
    played.send("/scene", SCENE, a_scene(an_object("cup", operation=REMOVE)))
    assert set(played.objects) == before


@pytest.mark.parametrize("is_diff", [True, False])
def test_a_matrix_that_cannot_be_read_allows_nothing(is_diff: bool) -> None:
    played, _ = ready()
    table, before = an_object("table", solid(1, 1, 1, 1)), allowed_pairs(played)
    rows = np.array([[False, True], [True, False]])
    played.send("/scene", SCENE, a_scene(table, allowed_collision_matrix=matrix(["hand", "table"], rows)))
    assert allowed_pairs(played) - before == {("hand", "table")}
    cut = matrix(["hand", "table"], rows[:1])
    played.send("/scene", SCENE, a_scene(table, is_diff=is_diff, allowed_collision_matrix=cut))
    assert allowed_pairs(played) == before and len(played.refusals) == 1


def test_an_object_whose_change_is_refused_stays_as_it_was() -> None:
    played = with_world()
    played.send("/scene", SCENE, a_scene(cup()))
    for bad in (cup(solid(2, -1)), an_object("cup", operation=ADD), cup(at=pose((np.nan, 0, 0)))):
        played.send("/scene", SCENE, a_scene(bad))
        assert set(played.objects) == {"world/cup"}
    assert len(played.refusals) == 3


def test_a_detached_object_of_another_link_stays_attached() -> None:
    played, _ = ready()
    played.send("/scene", SCENE, a_scene(held=[attached("hand", cup(frame="hand"))]))
    played.send("/scene", SCENE, a_scene(held=[attached("forearm", an_object("cup", operation=REMOVE))]))
    assert [it.static for it in described(played, "arm/cup")] == [False]
    assert any("expected it at the link hand, got 'forearm'" in text for text in played.refusals)


def test_objects_that_wait_for_their_frame_and_octomaps_are_listed() -> None:
    played = Played(ROBOT)
    content = a_scene(cup(frame="nowhere"), held=[attached("tail", an_object("tool", solid(2, 1), frame="tail"))])
    content.world.octomap.octomap.data = np.zeros(3, np.int8)
    played.send("/scene", SCENE, content)
    rows = {row.what: row.reason for row in played.feed.unmonitored if row.line == "arm" and "arm" in row.what}
    assert rows.keys() == {"arm/cup", "arm/tool", "arm/<octomap>"}
    assert "nowhere" in rows["arm/cup"] and "got 'tail'" in rows["arm/tool"]
    played.send("/scene", SCENE, a_scene(cup(), is_diff=False))
    rows = {row.what: row.reason for row in played.feed.unmonitored if row.line == "arm" and "arm" in row.what}
    assert not rows.keys() & {"arm/cup", "arm/<octomap>"}
