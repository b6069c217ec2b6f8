"""Of every type of message, a bad element is refused, counted and named, and the good ones beside it are taken."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, STORE, T, marker, markers, odometry, pose_stamped, transforms
from foreign_messages import (
    CYLINDER,
    POLYGON,
    detection,
    detections,
    footprint,
    laser_scan,
    point_cloud,
    predicted_objects,
    track,
    tracked_objects,
)
from played_sources import JOINTS, MILLISECOND, Played
from ros_messages import header, message, point, pose

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Box, Cylinder
from collision_monitor.sources import RawMessage
from collision_monitor.sources.failures import MOST_FAILURE_FILES, FailureFiles, read_failure
from collision_monitor.sources.messages.poses import PoseSource

SPHERE = {"sphere": 1.0}
NAN = math.nan
STEP = 50_000_000
ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"
LONG = "n" * 1_000_000
OBJECT, SCENE = "moveit_msgs/msg/CollisionObject", "moveit_msgs/msg/PlanningScene"


def cube(namespace: str, number: int, **fields: Any) -> Any:
    made = marker(namespace, number, 1, (1, 1, 1), (number, 0, 0), frame="map", stamp=START)
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def solid_object(name: str, **fields: Any) -> Any:
    solid = message("shape_msgs/msg/SolidPrimitive", type=2, dimensions=np.array([0.5]))
    values = {"header": header("map", START), "id": name, "primitives": [solid], "pose": pose((1, 0, 0)), **fields}
    return message(OBJECT, **values)


def scene(*objects: Any) -> tuple[str, Any]:
    world = message("moveit_msgs/msg/PlanningSceneWorld", collision_objects=list(objects))
    return SCENE, message(SCENE, is_diff=True, world=world)


def no_field(cloud: tuple[str, Any], axis: int, **fields: int) -> tuple[str, Any]:
    for name, value in fields.items():
        setattr(cloud[1].fields[axis], name, value)
    return cloud


ELEMENTS: dict[str, tuple[dict[str, Any], tuple[str, Any], int, str]] = {
    "transforms": (
        {"topic": "/t", "frame": "base", "shape": SPHERE},
        transforms(START, ("map", "other", (NAN, 0, 0), (0, 0, 0, 1)), ("map", "base", (1, 0, 0), (0, 0, 0, 1))),
        1,
        "expected finite numbers and a unit quaternion",
    ),
    "a frame in itself": (
        {"topic": "/t", "frame": "base", "shape": SPHERE},
        transforms(START, ("a", "a", (0, 0, 0), (0, 0, 0, 1)), ("map", "base", (1, 0, 0), (0, 0, 0, 1))),
        1,
        "transform from 'a' to itself",
    ),
    "a frame with a long name": (
        {"topic": "/t", "frame": "base", "shape": SPHERE},
        transforms(START, ("map", LONG, (0, 0, 0), (0, 0, 0, 1)), ("map", "base", (1, 0, 0), (0, 0, 0, 1))),
        1,
        "expected names of at most 256 characters",
    ),
    "markers of a kind without a shape": (
        {"topic": "/t", "marker": {"ns": "a"}},
        markers(cube("a", 1, type=10), cube("a", 2)),
        1,
        "it_1: expected a marker CUBE (1), SPHERE (2) or CYLINDER (3)",
    ),
    "markers of another time": (
        {"topic": "/t", "marker": {"ns": "a"}},
        markers(cube("a", 2), cube("a", 1, header=header("map", START + 3600 * SECOND))),
        1,
        "stamp: expected one within 10 s of the others",
    ),
    "markers of an unknown action": (
        {"topic": "/t", "marker": {"ns": "a"}},
        markers(cube("a", 1, action=7), cube("a", 2)),
        1,
        "action: expected 0 (ADD), 2 (DELETE) or 3 (DELETEALL), got 7",
    ),
    "tracks without a size": (
        {"topic": "/t"},
        tracked_objects("map", START, track(1, (0, 0, 0), size=(1, NAN, 1)), track(2, (1, 0, 0))),
        1,
        "it_car_1: Box",
    ),
    "tracks of an unknown shape": (
        {"topic": "/t"},
        predicted_objects("map", START, *(track(k, (0, 0, 0), kind=9 * (k == 1), predicted=True) for k in (1, 2))),
        1,
        "shape.type: expected 0 (box), 1 (cylinder) or 2 (polygon), got 9",
    ),
    "detections without a size": (
        {"topic": "/t"},
        detections("map", START, detection((0, 0, 0), (1, -1, 1), name="1"), detection((1, 0, 0), name="2")),
        1,
        "it_person_1: Box",
    ),
    "detections without a place": (
        {"topic": "/t"},
        detections("map", START, detection((NAN, 0, 0)), detection((1, 0, 0))),
        1,
        "position: expected finite numbers",
    ),
    "detections with a long id": (
        {"topic": "/t"},
        detections("map", START, detection((0, 0, 0), name=LONG), detection((1, 0, 0))),
        1,
        "expected an id and a class of at most 256 characters",
    ),
    "objects of a world": (
        {"topic": "/t"},
        scene(solid_object("bad", pose=pose((NAN, 0, 0))), solid_object("good")),
        0,
        "bad: position: expected finite numbers",
    ),
    "objects of a world with a long id": (
        {"topic": "/t"},
        scene(solid_object(LONG), solid_object("good")),
        0,
        "id: expected at most 256 characters",
    ),
}


@pytest.mark.parametrize("kind", ELEMENTS)
def test_a_bad_element_is_named_and_the_good_one_beside_it_is_taken(kind: str) -> None:
    entry, (name, content), states, text = ELEMENTS[kind]
    fed = Fed({"it": {"topic": "/t", **entry}}, begin=START)
    fed.give("/t", START, (name, content))
    assert sum(len(step.states) for step in fed.steps) == states
    assert sum(isinstance(change, ObjectDescription) for change in fed.changes) == 1
    assert any(text in refusal for refusal in fed.refused), fed.refused
    assert sum(fed.refused.values()) == 1 and not fed.feed.take_failures()
    assert max(map(len, fed.refused)) < 1100  # a text may quote the message, but not all of it


def test_a_bad_joint_and_a_bad_link_leave_the_others(tmp_path: Path) -> None:
    played = Played({"urdf": str(ARM), "joint_states": "/joint_states", "base": {"pose": [0, 0, 0]}})
    played.joints(START, [*np.zeros(7), NAN], (), JOINTS)
    assert "arm/hand" in played.states and "arm/left_finger" not in played.states
    assert any("expected finite positions, got others for finger_joint" in text for text in played.refusals)
    assert [row.what for row in played.feed.unmonitored if "finger_joint" in row.reason] == ["arm: joints"]
    played.joints(START + MILLISECOND, np.zeros(8), (), JOINTS)
    assert not played.feed.unmonitored
    (tmp_path / "locked").mkdir(mode=0)
    for address in ("n" * 300 + ".stl", "\0.stl", "/proc/self/mem", "locked/part.stl", "..", "http://x/y.stl"):
        name = address.replace(chr(0), "&#1;")
        text = ARM.read_text().replace("<cylinder", f'<mesh filename="{name}"/><a', 1)
        fed = Played({"urdf_topic": "/u", "joint_states": "/joint_states", "base": {"pose": [0, 0, 0]}})
        fed.send("/u", "std_msgs/msg/String", message("std_msgs/msg/String", data=text))
        assert len(fed.objects) >= 10 or "&#1;" in text, address
        assert fed.refusals and not fed.feed.take_failures()


WHOLE: dict[str, tuple[dict[str, Any], tuple[str, Any], tuple[str, Any]]] = {
    "odometry": (
        {"shape": SPHERE},
        odometry("nowhere", START, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)),
        odometry("map", START + 1, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)),
    ),
    "pose": ({"shape": SPHERE}, pose_stamped("nowhere", START, (0, 0, 0)), pose_stamped("map", START + 1, (0, 0, 0))),
    "footprint": (
        {"height": 1.0},
        footprint("map", START, [(NAN, 0), (0, NAN), (NAN, NAN)]),
        footprint("map", START + 1, [(0, 0), (1, 0), (0, 1)]),
    ),
    "scan": ({}, laser_scan("map", START, [NAN, NAN]), laser_scan("map", START + 1, [1, 2])),
    "cloud": ({}, point_cloud("map", START, [(NAN, 0, 0)]), point_cloud("map", START + 1, [(1, 2, 3)])),
    "an offset beyond the point": (
        {},
        no_field(point_cloud("map", START, [(1, 2, 3)]), 1, offset=2**31 - 4),
        point_cloud("map", START + 1, [(1, 2, 3)]),
    ),
    "an offset near the end": (
        {},
        no_field(point_cloud("map", START, [(1, 2, 3)]), 2, offset=13),
        point_cloud("map", START + 1, [(1, 2, 3)]),
    ),
    "an offset of a double": (
        {},
        no_field(point_cloud("map", START, [(1, 2, 3)]), 0, offset=2**31 - 5, datatype=8),
        point_cloud("map", START + 1, [(1, 2, 3)]),
    ),
}


@pytest.mark.parametrize("kind", WHOLE)
def test_a_bad_message_is_listed_until_the_next_one_and_changes_nothing(kind: str) -> None:
    entry, bad, good = WHOLE[kind]
    fed = Fed({"it": {"topic": "/t", **entry}}, begin=START)
    fed.give("/t", START, bad)
    assert sum(fed.refused.values()) == 1 and not fed.feed.take_failures()
    (row,) = fed.feed.unmonitored
    assert (row.line, row.what) == ("it", "/t") and row.reason in next(iter(fed.refused))
    fed.give("/t", START + 1, good)
    assert not fed.feed.unmonitored and sum(fed.refused.values()) == 1
    assert fed.names == ["it"]
    fed.give("/t", START + 2, (bad[0], copy.deepcopy(bad[1])))
    assert fed.names == ["it"]  # what was there stays


@pytest.mark.parametrize("value", [0, 1, 3, 13, 2**31 - 4, 2**31 - 1, 2**32 - 1])
@pytest.mark.parametrize("name", ["offset", "datatype", "count"])
@pytest.mark.parametrize("axis", [0, 2])
def test_no_integer_of_a_cloud_leads_outside_of_its_data(axis: int, name: str, value: int) -> None:
    cloud = point_cloud("map", START, [(1, 2, 3), (4, 5, 6)])
    if name == "datatype" and value > 255:
        value = 255
    fed = Fed({"it": {"topic": "/t"}})
    fed.give("/t", START, no_field(cloud, axis, **{name: value}))
    for field in ("height", "width", "point_step", "row_step"):
        changed = copy.deepcopy(cloud)
        setattr(changed[1], field, min(value, 2**32 - 1))
        fed.give("/t", START, changed)
    assert not fed.feed.take_failures()


# -- errors that nobody expects


def test_an_error_of_one_source_is_kept_with_its_message_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = PoseSource.take

    def failing(self: PoseSource, topic: str, content: Any, stamp_ns: int, scene: Any) -> None:
        if self.name == "bad":
            raise TypeError("expected something else")
        take(self, topic, content, stamp_ns, scene)

    monkeypatch.setattr(PoseSource, "take", failing)
    fed = Fed({name: {"topic": "/p", "shape": SPHERE} for name in ("first", "bad", "last")}, begin=START)
    files = FailureFiles(tmp_path / "kept")
    for k in range(3):
        kind, content = pose_stamped("map", START + k, (k, 0, 0))
        data = bytes(STORE.serialize_cdr(content, kind))
        fed.give("/p", START + k, (kind, data))
        (failure,) = fed.feed.take_failures()
        assert failure.line == "bad" and "TypeError: expected something else" in failure.text
        path, is_new = files.keep(failure)
        assert path is not None and is_new == (k == 0)
        assert read_failure(path) == RawMessage("/p", kind, read_failure(path).data, START)
    assert fed.rows["id"].tolist() == [1, 3] * 3
    (text,) = fed.refused
    assert text.startswith("bad: it cannot be monitored, for an unexpected TypeError: expected something else; please")
    assert [row.line for row in fed.feed.unmonitored] == ["bad"]
    assert len(list((tmp_path / "kept").iterdir())) == 1


def test_an_error_while_a_step_is_made_loses_no_other_object(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: Any) -> None:
        raise MemoryError

    monkeypatch.setattr("collision_monitor.sources.messages.autoware.AutowareSource.settle", failing)
    fed = Fed({"cars": {"topic": "/t"}, "post": {"topic": "/p", "shape": SPHERE}})
    fed.give("/t", START, tracked_objects("map", START, track(1, (0, 0, 0))))
    fed.give("/p", START, pose_stamped("map", START, (0, 0, 0)))
    assert len(fed.rows) == 2 and len(fed.feed.take_failures()) == 2


def test_files_of_failures_are_few_and_a_full_disk_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    fed = Fed({"it": {"topic": "/p", "shape": SPHERE}})
    for k in range(MOST_FAILURE_FILES + 5):
        fed.feed.scene.fail("it", "", ValueError(k))
        fed.give("/p", START + k, pose_stamped("map", START + k, (0, 0, 0)))
    failures = fed.feed.take_failures()
    assert FailureFiles(tmp_path / "file").keep(failures[0]) == (None, True)
    files = FailureFiles(tmp_path / "kept")
    for failure in failures:
        files.keep(failure)
    assert len(list((tmp_path / "kept").iterdir())) <= MOST_FAILURE_FILES


# -- shapes that are none: what contains them is monitored, and that is said


RINGS: dict[str, Any] = {
    "a spike": [(0, 0), (1, 0), (3, 0), (1, 0), (1, 1), (0, 1)],
    "a keyhole": [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)],
    "crossing edges": [(0, 0), (1, 1), (1, 0), (0, 1)],
    "a line": [(0, 0), (1, 1), (2, 2)],
    "two points": [(0, 0), (1, 2)],
    "one point": [(3, 3)],
    "no size": [(1, 1)] * 4,
    "a corner that is none": [(0, 0), (1, 0), (1, 1), (NAN, 0)],
    "a thousand corners": [(math.cos(a), math.sin(a) * (1 + 0.5 * math.cos(40 * a))) for a in np.arange(1000) / 159.2],
}


@pytest.mark.parametrize("height", [0.0, 1.0])
@pytest.mark.parametrize("ring", RINGS)
def test_a_ring_that_is_no_polygon_is_monitored_by_what_contains_it(ring: str, height: float) -> None:
    corners = np.array(RINGS[ring], float)
    fed = Fed({"it": {"topic": "/t", "height": height}}, begin=START)
    fed.give("/t", START, footprint("map", START, corners))
    finite = corners[np.isfinite(corners).all(1)]
    assert len(fed.rows) == 1 and contains(fed, finite, height)
    assert len(fed.refused) == 1 and next(iter(fed.refused)).endswith("is monitored"), fed.refused
    assert not fed.feed.unmonitored
    tracks = Fed({"it": {"topic": "/t"}})
    polygon = [(*corner, 0.0) for corner in corners]
    tracks.give("/t", START, tracked_objects("map", START, track(1, (0, 0, 0), kind=POLYGON, footprint=polygon)))
    assert len(tracks.rows) == 1 and contains(tracks, finite, 1.5)


@pytest.mark.parametrize("heights", [(0, 0, 1, 1), (0, 0.5, 0.5, 0), (0, 5, -5, 0)])
def test_corners_of_different_heights_are_monitored_by_a_prism_over_all_of_them(heights: Any) -> None:
    flat, high = [(0, 0), (1, 0), (1, 1), (0, 1)], 0.5
    fed = Fed({"it": {"topic": "/t", "height": high}}, begin=START)
    kind, content = footprint("map", START, flat)
    for corner, z in zip(content.polygon.points, heights, strict=True):
        corner.z = float(z)
    for k in range(3):
        content.header.stamp.nanosec = k
        fed.give("/t", START + k, (kind, content))
    (description,) = fed.changes  # once, and not with every message
    assert isinstance(description, ObjectDescription)
    z = np.concatenate([shape.points[:, 2] for shape, _ in description.shapes]) + fed.rows["position"][0, 2]
    np.testing.assert_allclose([z.min(), z.max()], [min(heights), max(heights) + high], atol=1e-6)
    (text,) = fed.refused
    assert "expected corners of one height" in text and text.endswith("a prism over all of them is monitored")
    fed.give("/t", START + 3, footprint("map", START + 3, flat))
    last = fed.changes[-1]
    assert len(fed.changes) == 2 and isinstance(last, ObjectDescription)
    assert np.ptp(last.shapes[0][0].points[:, 2]) == high  # type: ignore[union-attr]


@pytest.mark.parametrize("size", [(NAN, 1, 1), (1, NAN, 1), (-1, 1, 1), (1, -1, 1)])
def test_a_diameter_that_is_none_is_refused_in_any_order(size: Any) -> None:
    fed = Fed({"it": {"topic": "/t"}})
    bad = track(1, (0, 0, 0), kind=CYLINDER, size=size)
    fed.give("/t", START, tracked_objects("map", START, bad, track(2, (5, 0, 0), kind=CYLINDER)))
    assert fed.names == ["it_car_2"] and [row.what for row in fed.feed.unmonitored] == ["it_car_1"]
    turned = track(1, (0, 0, 0), size=size, orientation=0)  # a box that is turned in a way that is not known
    fed = Fed({"it": {"topic": "/t"}})
    fed.give("/t", START, tracked_objects("map", START, turned, track(2, (5, 0, 0))))
    assert fed.names == ["it_car_2"]
    lying = detection((0, 0, 0), size, name="a")
    lying.bbox.center.orientation.w = 0.0  # turned in a way that is not known
    fed = Fed({"it": {"topic": "/t"}})
    fed.give("/t", START, detections("map", START, lying, detection((5, 0, 0), name="b")))
    assert fed.names == ["it_person_b"] and [row.what for row in fed.feed.unmonitored] == ["it_person_a"]


def contains(fed: Fed, corners: Any, height: float) -> bool:
    """Whether the described shapes hold the corners, in the plane, with the padding."""
    description, row = fed.changes[0], fed.rows[0]
    assert isinstance(description, ObjectDescription)
    local = corners - row["position"][:2]
    spans = []
    for shape, at in description.shapes:
        outline = np.asarray(shape.points)[:, :2] if hasattr(shape, "points") else None
        if outline is None:
            spans.append(np.linalg.norm(local - at.position[:2], axis=1) <= shape.radius + 1e-5)
        else:
            d = np.stack([np.cos(np.linspace(0, 6.28, 64)), np.sin(np.linspace(0, 6.28, 64))], 1)
            spans.append(((local @ d.T) <= (outline @ d.T).max(0) + 1e-5).all(1))
    assert height == 0.0 or all(not hasattr(shape, "length") or shape.length > 0 for shape, _ in description.shapes)
    return bool(np.any(spans, axis=0).all())


def test_a_ring_that_its_first_corner_closes_is_a_polygon() -> None:
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (1e-12, -1e-12)])
    fed = Fed({"it": {"topic": "/t", "height": 1.0}})
    fed.give("/t", START, footprint("map", START, square))
    assert not fed.refused and len(fed.changes[0].shapes[0][0].points) == 8  # type: ignore[union-attr]


def test_flat_things_have_a_least_extent() -> None:
    fed = Fed({"cars": {"topic": "/t"}, "people": {"topic": "/d"}, "m": {"topic": "/m", "marker": {"ns": "a"}}})
    fed.give("/t", START, tracked_objects("map", START, track(1, (0, 0, 0), size=(1, 0, 1)), track(2, (5, 0, 0), kind=POLYGON, size=(2, 2, 0))))  # fmt: skip  # noqa: E501
    fed.give("/d", START, detections("map", START, detection((0, 0, 0), (0, 0, 0))))
    flat = marker("a", 1, 1, (2, 3, 0), (0, 0, 0), frame="map", stamp=START)
    fed.give("/m", START, markers(flat))
    shapes = [change.shapes[0][0] for change in fed.changes]  # type: ignore[union-attr]
    assert len(fed.rows) == 4 and [type(shape) for shape in shapes] == [Box, Cylinder, Box, Box]
    assert all(min(shape.size) > 0 for shape in shapes if isinstance(shape, Box))
    assert any("expected corners, got none; a disc of its dimensions is monitored" in text for text in fed.refused)


# -- scores


@pytest.mark.parametrize("scores", [[NAN, 0.9], [0.9, NAN], [-1.0, 0.9], [0.9, -1.0], [NAN], [-1.0], [], [NAN, -1.0]])
def test_scores_that_are_not_known_drop_no_detection_in_any_order(scores: list[float]) -> None:
    each = detection((0, 0, 0))
    (result,) = each.results
    each.results = []
    for k, score in enumerate(scores):
        hypothesis = T["vision_msgs/msg/ObjectHypothesis"]("person" if score == 0.9 else f"other_{k}", score)
        each.results.append(T["vision_msgs/msg/ObjectHypothesisWithPose"](hypothesis, result.pose))
    fed = Fed({"people": {"topic": "/d", "min_existence": 0.5}})
    fed.give("/d", START, detections("map", START, each))
    assert len(fed.rows) == 1
    if 0.9 in scores:
        assert fed.names == ["people_person_1"]


@pytest.mark.parametrize(("existence", "kept"), [(NAN, 1), (-1.0, 1), (0.6, 1), (0.4, 0)])
def test_an_existence_that_is_not_known_drops_no_track(existence: float, kept: int) -> None:
    fed = Fed({"cars": {"topic": "/t", "min_existence": 0.5}})
    fed.give("/t", START, tracked_objects("map", START, track(1, (0, 0, 0), existence=existence)))
    assert len(fed.changes) == kept


def test_a_mesh_of_a_scene_has_its_own_shape() -> None:
    triangle = message("shape_msgs/msg/MeshTriangle", vertex_indices=np.array([0, 1, 2], np.uint32))
    mesh = message("shape_msgs/msg/Mesh", triangles=[triangle], vertices=[point(*row) for row in np.eye(3)])
    far = message("shape_msgs/msg/MeshTriangle", vertex_indices=np.array([0, 1, 2**32 - 1], np.uint32))
    bad = message("shape_msgs/msg/Mesh", triangles=[far], vertices=[point(*row) for row in np.eye(3)])
    fed = Fed({"it": {"topic": "/t"}})
    fed.give("/t", START, scene(solid_object("bad", meshes=[bad]), solid_object("good", meshes=[mesh])))
    assert fed.names == ["it/good"] and [row.what for row in fed.feed.unmonitored] == ["it/bad"]
