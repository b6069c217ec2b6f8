"""Bags of other programs become sessions with the answers of a monitor that gets the same inputs directly."""

from __future__ import annotations

import json
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from fed import in_world
from foreign_bag import (
    SECOND,
    START,
    marker,
    markers,
    odometry,
    pose_stamped,
    transforms,
    write_bag,
)
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation
from session_scene import NODE, SHAPES, STATES, inputs, record

from collision_monitor import Box, Capsule, HalfSpace, Monitor, Pose, Sphere, records
from collision_monitor.cli.main import main
from collision_monitor.codec import (
    decode_contacts,
    decode_descriptions,
    decode_predictions,
    decode_states,
    decode_status,
)
from collision_monitor.errors import InputError, SessionError
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import StateFlag
from collision_monitor.session import Recorded, Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag
from collision_monitor.sources.ground.mapping import make_mapping

STEP = 20_000_000
CUBE, SPHERE, CYLINDER, LINE_STRIP = 1, 2, 3, 4

MAPPING: dict[str, Any] = {
    "frame": "map",
    "objects": {
        "floor": {"static": True, "shape": {"half_space": [0, 0, 1, -5]}},
        "cart": {"topic": "/cart/odom", "shape": {"box": [1.2, 0.8, 0.5]}},
        "person": {"topic": "/person", "shape": {"capsule": [0.3, 1.1], "at": [0, 0, 0.1]}, "padding": 0.05},
        "drone": {"topic": "/tf", "frame": "drone", "shape": {"sphere": 0.4}},
    },
}


def messages_of(path: Path, kind: str) -> list[Recorded]:
    return [m for m in Session(path).messages() if m.type == kind]


def rows_of(path: Path) -> np.ndarray:
    return np.concatenate([decode_states(m.data).states for m in messages_of(path, "ObjectStateArray")])


def scene(steps: int = 60) -> Iterator[tuple[str, int, tuple[str, Any]]]:
    """Yield messages of a cart and a person that meet, and of a drone behind a static and a moving link.

    There are only quarter turns, so that the poses are exact.
    """
    yield "/tf_static", START, transforms(START, ("/map", "hall", (1, 2, 0), (0, 0, 0, 1)))
    for k in range(steps):
        t, stamp = k * STEP / SECOND, START + k * STEP
        yield "/cart/odom", stamp + 1000, odometry("map", stamp, (2 * t, 0, 0), (0, 0, 0, 1), (2, 0, 0), (0, 0, 0.5))
        yield "/person", stamp + 2000, pose_stamped("map", stamp + 1, (3 - t, 0.125, 0))
        yield "/tf", stamp + 3000, transforms(stamp + 2, ("hall", "drone", (1 - t, -2, 1.5 - t), (0, 0, 0, 1)))


def direct(profile: str = "balanced", steps: int = 60) -> tuple[list[Any], Monitor]:
    """Feed the same scene to a monitor directly."""
    monitor = Monitor(profile)
    monitor.add(1, HalfSpace((0, 0, 1), -5), name="floor", static=True, pose=Pose())
    monitor.add(2, Box((1.2, 0.8, 0.5)), name="cart")
    monitor.add(3, [(Capsule(0.3, 1.1), Pose((0, 0, 0.1)))], name="person", padding=0.05)
    monitor.add(4, Sphere(0.4), name="drone")
    results = []
    for k in range(steps):
        t, stamp = k * STEP / SECOND, START + k * STEP
        for number, (delay, position) in {
            2: (0, (2 * t, 0, 0)),
            3: (1, (3 - t, 0.125, 0)),
            4: (2, (1 + (1 - t), 0, 1.5 - t)),
        }.items():
            row = np.zeros(1, records.STATE)
            row["id"], row["position"], row["quaternion"] = number, position, (0, 0, 0, 1)
            if number == 2:
                row["linear"], row["angular"], row["flags"] = (2, 0, 0), (0, 0, 0.5), StateFlag.BODY_TWIST
            else:
                row["flags"] = StateFlag.TWIST_UNKNOWN
            results.append(monitor.step(stamp + delay, row))
    return results, monitor


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("profile", ["balanced", "exact"])
def test_the_answers_are_those_of_a_monitor_that_is_fed_directly(
    tmp_path: Path, profile: str, storage: StoragePlugin
) -> None:
    bag = write_bag(tmp_path / "bag", scene(), storage=storage)
    done = import_bag(bag, tmp_path / "a.mcap", make_mapping(MAPPING), profile=profile)
    assert done.whole, done
    assert done.states == {"cart": 60, "person": 60, "drone": 60}
    results, monitor = direct(profile)
    contacts = [decode_contacts(m.data) for m in messages_of(tmp_path / "a.mcap", "ContactArray")]
    predictions = [decode_predictions(m.data) for m in messages_of(tmp_path / "a.mcap", "PredictedCollisionArray")]
    assert len(contacts) == len(predictions) == len(results) == done.steps == 180
    for ours, contact, prediction in zip(results, contacts, predictions, strict=True):
        assert ours.contact_rows.tobytes() == contact.contacts.tobytes()
        assert ours.predictions.tobytes() == prediction.predictions.tobytes()
    assert sum(len(r.contacts) for r in results) > 20
    assert sum(len(r.predictions) for r in results) > 50
    assert decode_status(messages_of(tmp_path / "a.mcap", "MonitorStatus")[-1].data).digest == monitor.digest
    report = replay(Session(tmp_path / "a.mcap"))
    assert (report.verdict, report.digest) == (Verdict.IDENTICAL, monitor.digest)


def test_a_bag_of_foxgloves_writer_is_read_too(tmp_path: Path) -> None:
    """It is one file, without rosbag2's metadata, with the definitions of another library."""
    from mcap_ros2.writer import Writer

    definition = "float64 x\nfloat64 y\nfloat64 z"
    text = (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
        f"{'=' * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        f"{'=' * 80}\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
        f"{'=' * 80}\nMSG: geometry_msgs/Point\n{definition}\n"
        f"{'=' * 80}\nMSG: geometry_msgs/Quaternion\n{definition}\nfloat64 w\n"
        f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    with (tmp_path / "bag.mcap").open("wb") as file, Writer(file) as writer:
        schema = writer.register_msgdef("geometry_msgs/msg/PoseStamped", text)
        for k in range(5):
            stamp = {"sec": 1_700_000_000, "nanosec": k * STEP}
            message = {
                "header": {"stamp": stamp, "frame_id": "map"},
                "pose": {"position": {"x": 0.25 * k, "y": 1, "z": 2}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}},
            }
            writer.write_message("/person", schema, message, START + k * STEP, START)
    mapping = make_mapping({"frame": "map", "objects": {"person": {"topic": "/person", "shape": {"sphere": 1}}}})
    assert import_bag(tmp_path / "bag.mcap", tmp_path / "a.mcap", mapping).states == {"person": 5}
    np.testing.assert_array_equal(rows_of(tmp_path / "a.mcap")["position"][:, 0], 0.25 * np.arange(5))


def test_poses_and_twists_come_into_the_frame_of_the_session(tmp_path: Path) -> None:
    """Compare with SciPy's rotations; the transforms are static, behind a moving one, and arrive late."""
    rng = np.random.default_rng(3)
    q_WH, q_HO, q_OB = (Rotation.random(random_state=k).as_quat() for k in (1, 2, 3))
    p_WH, p_HO, p_OB, v_B, w_B = rng.uniform(-3, 3, (5, 3))
    bag = write_bag(
        tmp_path / "bag",
        [
            ("/tf", START, transforms(START, ("hall", "odom", p_HO, q_HO))),
            ("/odom", START + 1, odometry("odom", START + 1, p_OB, q_OB, v_B, w_B)),
            ("/tf_static", START + 2, transforms(START, ("world", "hall", p_WH, q_WH))),
        ],
    )
    content = {"frame": "world", "objects": {"cart": {"topic": "/odom", "shape": {"sphere": 1}}}}
    assert import_bag(bag, tmp_path / "a.mcap", make_mapping(content)).whole
    (row,) = in_world(rows_of(tmp_path / "a.mcap"))
    R_WH, R_HO, R_OB = map(Rotation.from_quat, (q_WH, q_HO, q_OB))
    R_WB = R_WH * R_HO * R_OB
    np.testing.assert_allclose(row["position"], p_WH + R_WH.apply(p_HO + R_HO.apply(p_OB)), atol=1e-12)
    np.testing.assert_allclose(Rotation.from_quat(row["quaternion"]).as_matrix(), R_WB.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(row["linear"], R_WB.apply(v_B), atol=1e-12)
    np.testing.assert_allclose(row["angular"], R_WB.apply(w_B), atol=1e-12)
    # down the tree: the frame of the session lies below that of the message
    content["frame"] = "odom"
    bag = write_bag(tmp_path / "other", [
        ("/tf_static", START, transforms(START, ("hall", "odom", p_HO, q_HO))),
        ("/odom", START, odometry("hall", START, p_OB, q_OB, v_B, w_B)),
    ])  # fmt: skip
    import_bag(bag, tmp_path / "b.mcap", make_mapping(content))
    np.testing.assert_allclose(rows_of(tmp_path / "b.mcap")[0]["position"], R_HO.inv().apply(p_OB - p_HO), atol=1e-12)


def test_markers_bring_their_shapes_appear_change_and_go(tmp_path: Path) -> None:
    def show(stamp: int, *each: Any) -> tuple[str, int, tuple[str, Any]]:
        return "/markers", stamp, markers(*each)

    def at(k: int, **changes: Any) -> dict[str, Any]:
        return {"frame": "map", "stamp": START + k * STEP, **changes}

    crate = marker("crates", 7, CUBE, (1, 2, 3), (0.5, 0, 0), **at(0))
    ball = marker("balls", 3, SPHERE, (0.5, 0.5, 0.5), (5, 0, 0), **at(0))
    post = marker("walls", 1, CYLINDER, (0.4, 0.4, 2), (0, 5, 1), **at(0, stamp=0))
    label = marker("balls", 4, LINE_STRIP, (1, 1, 1), (0, 0, 0), **at(0))
    egg = marker("balls", 5, SPHERE, (1, 1, 2), (0, 0, 0), **at(0))
    bag = write_bag(
        tmp_path / "bag",
        [
            show(START, crate, ball, post, label, egg, marker("other", 7, CUBE, (1, 1, 1), (0, 0, 0), **at(0))),
            show(START + STEP, marker("crates", 7, CUBE, (1, 2, 4), (0.75, 0, 0), **at(1)), post),
            show(START + 2 * STEP, marker("balls", 3, 0, (0, 0, 0), (0, 0, 0), **at(2, action=2))),
            show(START + 3 * STEP, marker("", 0, 0, (0, 0, 0), (0, 0, 0), **at(3, action=3))),
        ],
    )
    content = {
        "frame": "map",
        "objects": {
            "crate": {"topic": "/markers", "marker": {"ns": "crates", "id": 7}},
            "ball": {"topic": "/markers", "marker": {"ns": "balls"}},
            "wall": {"topic": "/markers", "marker": {"ns": "walls"}, "static": True},
        },
    }
    done = import_bag(bag, tmp_path / "a.mcap", make_mapping(content))
    assert done.states == {"crate": 2, "ball_3": 1}
    assert sorted(done.skipped.values()) == [1, 1]
    assert all("a `shape` in the mapping takes its place" in reason for reason in done.skipped)
    changes = [decode_descriptions(m.data) for m in messages_of(tmp_path / "a.mcap", "ObjectDescriptionArray")]
    reported = [[(getattr(o, "name", "gone"), o.object_id) for o in each.objects] for each in changes]
    assert reported == [
        [],
        [("crate", 1), ("ball_3", 4), ("wall_1", 5)],
        [("crate", 1)],
        [("gone", 4)],
        [("gone", 1), ("gone", 5)],
    ]
    box, sphere, cylinder = (o.shapes[0][0] for o in changes[1].objects)  # type: ignore[union-attr]
    assert (tuple(box.size), sphere.radius, cylinder.radius, cylinder.length) == ((1, 2, 3), 0.25, 0.2, 2.0)
    assert changes[1].objects[2].pose.position.tolist() == [0, 5, 1]  # type: ignore[union-attr]
    assert tuple(changes[2].objects[0].shapes[0][0].size) == (1, 2, 4)  # type: ignore[union-attr]
    assert rows_of(tmp_path / "a.mcap")["position"][:, 0].tolist() == [0.5, 5.0, 0.75]


def test_what_is_wrong_is_left_out_counted_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    later = START + 4 * STEP
    bag = write_bag(
        tmp_path / "bag",
        [
            ("/a", START, pose_stamped("map", START, (0, 0, 0))),
            ("/a", START + 1, pose_stamped("map", START + 1, (0, 0, 0), (0, 0, 0, 0))),
            ("/a", START + 2, pose_stamped("map", START + 2, (np.nan, 0, 0))),
            ("/a", later, pose_stamped("map", later, (0, 0, 0))),
            ("/a", later + 1, pose_stamped("map", later - STEP, (0, 0, 0))),  # older than the last one
            ("/a", later + 2, pose_stamped("map", 0, (1, 0, 0))),  # no stamp: the time of receipt counts
            ("/a", later + 3, pose_stamped("mars", later + 3, (0, 0, 0))),
            ("/a", later + 4, ("geometry_msgs/msg/PoseStamped", b"\0\1\0\0short")),
            ("/b", later + 5, pose_stamped("mars", later + 5, (0, 0, 0))),
        ],
    )
    (tmp_path / "map.yaml").write_text(
        "frame: map\nobjects:\n  a: {topic: /a, shape: {sphere: 1}}\n  b: {topic: /b, shape: {sphere: 1}}\n"
    )
    command = ["import", str(bag), "--map", str(tmp_path / "map.yaml"), "-o", str(tmp_path / "a.mcap")]
    assert main([*command, "--json"]) == 3
    result = json.loads(capsys.readouterr().out)
    assert result["refused"] == {"quaternion": 1, "non_finite": 1, "old": 1}
    assert result["states"] == {"a": 6, "b": 0}
    assert {text.split(":")[0]: n for text, n in result["skipped"].items()} == {"a": 1, "/a": 1, "b": 1}
    assert any("no transform from 'map' to 'mars'; frames known from tf: none" in text for text in result["skipped"])
    assert main(command) == 1
    assert "expected a new file" in capsys.readouterr().err
    assert main([*command, "--force"]) == 3
    out = capsys.readouterr().out
    assert "unseen     b: the bag has no message of it" in out
    assert "written    7 messages" in out
    assert main(["replay", str(tmp_path / "a.mcap")]) == 0


OBJECT = {"topic": "/person", "shape": {"sphere": 1}}


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ([], "the file: expected a table with frame, stamps, rate, step, max_age, objects"),
        ({"objects": {"a": OBJECT}}, "frame: expected the name of the frame"),
        ({"frame": "map"}, "objects: expected a table of names, got None"),
        ({"frame": "map", "stamps": "now", "objects": {"a": OBJECT}}, "stamps: expected header or received, got 'now'"),
        ({"frame": "map", "object": {}}, "the file: 'object' is unknown: did you mean 'objects'?"),
        ({"frame": "map", "objects": {"a": {"topc": "/a"}}}, "a: 'topc' is unknown: did you mean 'topic'?"),
        ({"frame": "map", "objects": {"a": {"static": True}}}, "a, shape: expected one of sphere, box,"),
        ({"frame": "map", "objects": {"a": {"shape": {"sphere": 1}}}}, "a, topic: expected the topic of its pose"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "shape": {"ball": 1}}}}, "a, shape: 'ball' is unknown"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "shape": {"box": [1, 2]}}}}, "expected 3 dimensions (x, y, z)"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "shape": {"sphere": -1}}}}, "a, shape: Sphere"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "shape": {"sphere": "big"}}}}, "a, sphere: expected numbers"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "shape": {"sphere": 1, "at": [1]}}}}, "a, at: expected [x, y,"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "pose": [0, 0, 0]}}}, "a, pose: expected one of static objects"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "static": True}}}, "expected no topic"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "id": -1}}}, "a, id: expected a whole number from 0"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "id": 1}, "b": {**OBJECT, "id": 1}}}, "b, id: expected one that"),
        ({"frame": "map", "objects": {"a": {**OBJECT, "allowed": ["c"]}}}, "a, allowed: 'c' is unknown: there are a"),
    ],
)
def test_a_mapping_that_cannot_be_used_is_named(content: Any, text: str) -> None:
    with pytest.raises(InputError) as error:
        make_mapping(content)
    assert text in str(error.value)


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ({"topic": "/persn", "shape": {"sphere": 1}}, "a: expected topic /persn in the bag, got none; what can be"),
        ({"topic": "/person"}, "a, shape: expected one of sphere, box,"),
        ({"topic": "/clock", "shape": {"sphere": 1}}, "to be one of nav_msgs/msg/Odometry,"),
        ({"topic": "/tf", "shape": {"sphere": 1}}, "expected `frame: …`, got none"),
        ({"topic": "/person", "frame": "x", "shape": {"sphere": 1}}, "a, frame: geometry_msgs/msg/PoseStamped does"),
        ({"topic": "/person", "marker": {"ns": "x"}}, "a, marker: geometry_msgs/msg/PoseStamped does not use it"),
        ({"static": True, "frame": "mars", "shape": {"sphere": 1}}, "expected static transforms from 'map' to 'mars'"),
        ({**OBJECT, "padding": -1}, "padding: expected a number of metres from 0 to 1e+18, got -1.0"),
        ({"topic": "/person", "shape": {"half_space": [0, 0, 1, 0]}}, "a HalfSpace has no end and can only be static"),
    ],
)
def test_a_mapping_that_does_not_fit_the_bag_is_named_and_writes_nothing(
    tmp_path: Path, source: dict[str, Any], text: str
) -> None:
    clock = ("/clock", START, ("builtin_interfaces/msg/Time", b"\0\1\0\0" + bytes(8)))
    bag = write_bag(tmp_path / "bag", [clock, *scene(2)])
    with pytest.raises((InputError, SessionError)) as error:
        import_bag(bag, tmp_path / "a.mcap", make_mapping({"frame": "map", "objects": {"a": source}}))
    assert text in str(error.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag"]


def test_what_is_no_bag_is_named(tmp_path: Path) -> None:
    mapping = make_mapping(MAPPING)
    (tmp_path / "text.mcap").write_text("hello")
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "x.csv").write_text("1,2")
    for name, text in {
        "none.mcap": "expected a bag, got nothing there",
        "text.mcap": "expected a bag, cannot be read",
        "empty.mcap": "expected a bag, cannot be read",
        "folder": "without metadata.yaml",
        "x.csv": "expected a bag, cannot be read",
    }.items():
        with pytest.raises(SessionError) as error:
            import_bag(tmp_path / name, tmp_path / "a.mcap", mapping)
        assert text in str(error.value) and "salvage" not in str(error.value)
    whole = write_bag(tmp_path / "bag", scene())
    (file,) = whole.glob("*.mcap")
    data = file.read_bytes()
    for cut in (len(data) // 3, len(data) - 30):
        (tmp_path / "cut.mcap").write_bytes(data[:cut])
        with pytest.raises(SessionError, match="salvage"):
            import_bag(tmp_path / "cut.mcap", tmp_path / "a.mcap", mapping)
    with pytest.raises(SessionError, match="expected another file than those"):
        import_bag(file, file, mapping, overwrite=True)
    assert not (tmp_path / "a.mcap").exists()


def monitor_bag(path: Path, *nodes: str) -> Path:
    """Write what `ros2 bag record` records of a monitor's inputs: no metadata of ours, no sequence numbers."""
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros2", "another recorder")
        for node in nodes:
            channels = {}
            for topic, kind in ((SHAPES, "ObjectDescriptionArray"), (STATES, "ObjectStateArray")):
                schema = writer.register_schema(f"collision_monitor_msgs/msg/{kind}", "ros2msg", b"")
                channels[topic] = writer.register_channel(topic.replace(NODE, node), "cdr", schema)
            for k, (topic, data) in enumerate(inputs(30)):
                writer.add_message(channels[topic], START + k, data, START + k, 0)
        writer.finish()
    return path


def test_recorded_inputs_of_a_monitor_need_no_mapping(tmp_path: Path) -> None:
    bag = monitor_bag(tmp_path / "bag.mcap", "/hall/monitor")
    done = import_bag(bag, tmp_path / "a.mcap")
    pipeline = Pipeline("balanced")
    for topic, data in inputs(30):
        (pipeline.on_shapes if topic == SHAPES else pipeline.on_states)(data)
    assert replay(Session(tmp_path / "a.mcap")).digest == pipeline.monitor.digest != 0
    assert (done.steps, done.messages) == (30, len(list(inputs(30))))
    two = monitor_bag(tmp_path / "two.mcap", "/a", "/b")
    with pytest.raises(SessionError, match="inputs of one monitor, got /a/objects/states, /b/objects/states"):
        import_bag(two, tmp_path / "b.mcap")
    assert import_bag(two, tmp_path / "b.mcap", node="/b").steps == 30
    with pytest.raises(SessionError, match=r"for other topics give a mapping file \(--map\)"):
        import_bag(write_bag(tmp_path / "other", scene(2)), tmp_path / "c.mcap")


def test_recorded_inputs_of_a_monitor_replay_as_they_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Under any name of the node, and with nothing of ours but the topics."""
    session = Session(monitor_bag(tmp_path / "bag.mcap", "/hall/monitor"))
    assert (session.foreign, session.frame_id, session.profile.name) == (True, "world", "balanced")
    messages = list(session.messages())
    assert [m.data for m in messages] == [data for _, data in inputs(30)]
    assert [m.sequence for m in messages] == list(range(len(messages)))
    pipeline = Pipeline("balanced")
    for topic, data in inputs(30):
        (pipeline.on_shapes if topic == SHAPES else pipeline.on_states)(data)
    report = replay(session)
    assert (report.steps, report.digest) == (30, pipeline.monitor.digest)
    assert report.verdict is Verdict.NOT_COMPARABLE
    assert "replayed with the profile balanced" in report.notes[0]
    assert main(["replay", str(tmp_path / "bag.mcap")]) == 4
    assert "no answers to compare with" in capsys.readouterr().out
    with pytest.raises(SessionError, match="got /a/objects/shapes and /b/objects/shapes; take one out with"):
        list(Session(monitor_bag(tmp_path / "two.mcap", "/a", "/b")).messages())


def test_answers_that_another_recorder_took_are_compared(tmp_path: Path) -> None:
    """The bag is like that of `ros2 bag record -a` beside a monitor with the same settings."""
    recorded = tmp_path / "run.mcap"
    record(recorded)
    with (tmp_path / "bag.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros2", "another recorder")
        channels: dict[str, int] = {}
        for m in Session(recorded).messages():
            if m.topic not in channels:
                schema = writer.register_schema(f"collision_monitor_msgs/msg/{m.type}", "ros2msg", b"")
                channels[m.topic] = writer.register_channel(m.topic, "cdr", schema)
            writer.add_message(channels[m.topic], m.log_time, m.data, m.publish_time, 0)
        writer.finish()
    report = replay(Session(tmp_path / "bag.mcap"))
    assert (report.verdict, report.digest) == (Verdict.IDENTICAL, replay(Session(recorded)).digest)


def test_stamps_may_be_those_of_the_receipt(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", scene(3))
    import_bag(bag, tmp_path / "a.mcap", make_mapping({**MAPPING, "stamps": "received"}))
    messages = messages_of(tmp_path / "a.mcap", "ObjectStateArray")
    assert [decode_states(m.data).stamp_ns for m in messages] == [m.log_time for m in messages]
    assert messages[0].log_time == START + 1000


def test_a_disk_that_is_full_leaves_no_half_of_a_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """RLIMIT_FSIZE makes the kernel refuse to grow the file, as a full disk does."""
    bag = write_bag(tmp_path / "bag", scene(60))
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(MAPPING))
    command = ["import", str(bag), "--map", str(tmp_path / "map.yaml"), "-o"]
    assert main([*command, str(tmp_path / "a.mcap")]) == 0  # compiles everything
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    capsys.readouterr()
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        code = main([*command, str(tmp_path / "b.mcap")])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert code == 1
    reason = "expected to be able to write there, got: File too large"
    assert capsys.readouterr().err == f"collision-monitor: error: {tmp_path / 'b.mcap'}: {reason}\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "bag", "map.yaml"]
