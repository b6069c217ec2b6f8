"""The codec against rclpy's own (de)serialisation, in both directions, with random content."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
msg = pytest.importorskip("collision_monitor_msgs.msg")
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import Point, Pose  # noqa: E402
from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402

from collision_monitor import codec, records  # noqa: E402
from collision_monitor.codec.descriptions import _read_description  # noqa: E402

TEXTS = ["", "a", "bc", "def", "robot_1", "Gabelstapler ü", "搬送ロボット", "a" * 300]
SEEDS = range(40)


def random_value(kind: str, generator: np.random.Generator) -> Any:
    """Return a random value for a field of the rclpy type `kind`."""
    if kind in ("boolean", "bool"):
        return bool(generator.integers(2))
    if kind in ("double", "float64"):
        return float(generator.normal() * 10.0 ** generator.integers(-3, 4))
    if kind == "octet":
        return bytes([int(generator.integers(256))])
    if kind == "string":
        return TEXTS[generator.integers(len(TEXTS))]
    if kind.startswith(("uint", "int")):
        info = np.iinfo(kind)
        return int(generator.integers(info.min, info.max, dtype=kind, endpoint=True))
    package, name = kind.split("/")
    module = __import__(f"{package}.msg", fromlist=[name])
    return random_message(getattr(module, name), generator)


def random_message(kind: type, generator: np.random.Generator) -> Any:
    """Return a message of this rclpy type with random fields, nested ones included."""
    message = kind()
    for name, field in kind.get_fields_and_field_types().items():
        if field.startswith("sequence<"):
            count = int(generator.integers(0, 4))
            value: Any = [random_value(field[9:-1], generator) for _ in range(count)]
        elif field.endswith("]"):
            element, size = field[:-1].split("[")
            value = [random_value(element, generator) for _ in range(int(size))]
        elif field == "uint32" and name == "nanosec":
            value = int(generator.integers(10**9))
        else:
            value = random_value(field, generator)
        setattr(message, name, value)
    return message


def flat(message: Any) -> list[Any]:
    """Return the numbers, bools and texts of an rclpy message in wire order."""
    if hasattr(message, "get_fields_and_field_types"):
        return [leaf for name in message.get_fields_and_field_types() for leaf in flat(getattr(message, name))]
    if hasattr(message, "__len__") and not isinstance(message, str | bytes):
        return [leaf for each in message for leaf in flat(each)]
    return [message]


def flat_record(record: Any) -> list[Any]:
    """Return the numbers of a structured record in order."""
    return [leaf for name in record.dtype.names for leaf in np.ravel(record[name]).tolist()]


def stamp(message: Any) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@pytest.mark.parametrize("seed", SEEDS)
def test_states(seed: int) -> None:
    message = random_message(msg.ObjectStateArray, np.random.default_rng(seed))
    data = serialize_message(message)
    it = codec.decode_states(data)
    assert (it.stamp_ns, it.frame_id, it.sequence) == (stamp(message), message.header.frame_id, message.sequence)
    assert [flat_record(each) for each in it.states] == [flat(each) for each in message.states]
    assert it.covariance.tolist() == list(message.covariance)
    again = codec.encode_states(it.stamp_ns, it.frame_id, it.sequence, it.states, it.covariance)
    assert deserialize_message(again, msg.ObjectStateArray) == message


@pytest.mark.parametrize("seed", SEEDS)
def test_trajectories(seed: int) -> None:
    message = random_message(msg.ObjectTrajectoryArray, np.random.default_rng(seed))
    it = codec.decode_trajectories(serialize_message(message))
    assert (it.stamp_ns, it.frame_id) == (stamp(message), message.header.frame_id)
    for each, wanted in zip(it.trajectories, message.trajectories, strict=True):
        found = each.times.tolist(), each.poses.tolist(), each.twists.tolist()
        assert found == (list(wanted.times), [flat(p) for p in wanted.poses], [flat(t) for t in wanted.twists])
        assert each.tolerance.tolist() == [wanted.across, wanted.along, wanted.angle, wanted.time]
        assert (each.object_id, each.between, each.then) == (wanted.id, wanted.between, wanted.then)
        assert each.tube == wanted.tube
        assert each.accelerations.tolist() == [flat(a) for a in wanted.accelerations]
    again = codec.encode_trajectories(it.stamp_ns, it.frame_id, it.trajectories)
    assert deserialize_message(again, msg.ObjectTrajectoryArray) == message


@pytest.mark.parametrize("seed", SEEDS)
def test_contacts(seed: int) -> None:
    message = random_message(msg.ContactArray, np.random.default_rng(seed))
    data = serialize_message(message)
    it = codec.decode_contacts(data)
    assert (it.stamp_ns, it.frame_id, it.step) == (stamp(message), message.header.frame_id, message.step)
    assert [flat_record(each) for each in it.contacts] == [flat(each) for each in message.contacts]
    assert (it.ids.tolist(), it.names) == (list(message.ids), message.names)
    again = codec.encode_contacts(it.stamp_ns, it.frame_id, it.step, it.contacts, it.ids, it.names)
    assert deserialize_message(again, msg.ContactArray) == message


@pytest.mark.parametrize("seed", SEEDS)
def test_predictions(seed: int) -> None:
    message = random_message(msg.PredictedCollisionArray, np.random.default_rng(seed))
    data = serialize_message(message)
    it = codec.decode_predictions(data)
    assert (it.stamp_ns, it.frame_id, it.step) == (stamp(message), message.header.frame_id, message.step)
    assert it.horizon == message.horizon
    assert [flat_record(each) for each in it.predictions] == [flat(each) for each in message.predictions]
    assert (it.ids.tolist(), it.names) == (list(message.ids), message.names)
    again = codec.encode_predictions(it.stamp_ns, it.frame_id, it.step, it.horizon, it.predictions, it.ids, it.names)
    assert deserialize_message(again, msg.PredictedCollisionArray) == message


@pytest.mark.parametrize("seed", SEEDS)
def test_alerts(seed: int) -> None:
    message = random_message(msg.CollisionAlertArray, np.random.default_rng(seed))
    it = codec.decode_alerts(serialize_message(message))
    assert (it.stamp_ns, it.frame_id, it.step) == (stamp(message), message.header.frame_id, message.step)
    assert (it.number, it.highest, it.monitor) == (message.number, message.highest, message.monitor)
    for ours, theirs in zip(it.alerts, message.alerts, strict=True):
        assert codec.encode_alert(ours) == codec.encode_alert(codec.decode_alert(serialize_message(theirs)))
        names = [name for name in theirs.get_fields_and_field_types() if name not in ("header", "since")]
        assert [flat(getattr(ours, name)) for name in names] == [flat(getattr(theirs, name)) for name in names]
    assert [flat_record(each) for each in it.held_back] == [flat(each) for each in message.held_back]
    assert list(it.rule_names) == message.rule_names
    for ours, theirs in zip(it.coverage, message.coverage, strict=True):
        assert flat(list(vars(ours).values())) == flat(theirs)
    for ours, theirs in zip(it.unmonitored, message.unmonitored, strict=True):
        expected = theirs.name, theirs.reason, theirs.since.sec * 10**9 + theirs.since.nanosec, theirs.is_silent
        assert (ours.name, ours.reason, ours.since_ns, ours.is_silent) == expected
        assert list(ours.coverage) == list(theirs.coverage)
    assert deserialize_message(codec.encode_alerts(it), msg.CollisionAlertArray) == message


@pytest.mark.parametrize("seed", SEEDS)
def test_status(seed: int) -> None:
    message = random_message(msg.MonitorStatus, np.random.default_rng(seed))
    data = serialize_message(message)
    it = codec.decode_status(data)
    assert [it.stamp_ns, it.frame_id, *list(vars(it).values())[2:]] == [stamp(message), *flat(message)[2:]]
    assert list(vars(it))[2:] == list(msg.MonitorStatus.get_fields_and_field_types())[1:]
    assert deserialize_message(codec.encode_status(it), msg.MonitorStatus) == message


@pytest.mark.parametrize("seed", SEEDS)
def test_descriptions_are_read_field_by_field(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random descriptions are impossible objects, so the test compares the fields before shapes are made of them."""
    raw = []

    def spy(reader: Any) -> Any:
        raw.append(_read_description(reader))
        return raw[-1]

    monkeypatch.setattr("collision_monitor.codec.descriptions._read_description", spy)
    message = random_message(msg.ObjectDescriptionArray, np.random.default_rng(seed))
    it = codec.decode_descriptions(serialize_message(message))
    assert (it.stamp_ns, it.frame_id, it.snapshot) == (stamp(message), message.header.frame_id, message.snapshot)
    assert len(it.objects) + len(it.refused) == len(message.objects)
    for ours, theirs in zip(raw, message.objects, strict=True):
        shapes = [
            leaf for kind, *arrays in ours.shapes for leaf in (kind, *(x for a in arrays for x in a.ravel().tolist()))
        ]
        assert shapes == [leaf for each in theirs.shapes for leaf in flat(each)]
        assert ours.shape_poses.ravel().tolist() == [leaf for each in theirs.shape_poses for leaf in flat(each)]
        assert ours.pose.tolist() == flat(theirs.pose)
        assert ours.allowed.tolist() == list(theirs.allowed)
        names = ["id", "operation", "name", "is_static", "group", "mask", "padding", "model"]
        names += ["max_linear_acceleration", "max_angular_acceleration"]
        attributes = {"id": "object_id", "is_static": "static"}
        assert [getattr(ours, attributes.get(n, n)) for n in names] == [getattr(theirs, n) for n in names]


def points(vertices: Any) -> list[Point]:
    return [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in vertices]


def test_descriptions_are_written_as_rclpy_writes_them() -> None:
    """Write every kind of shape behind names of every length modulo 8, so that all alignments occur."""
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    shapes = [
        msg.Shape(type=msg.Shape.SPHERE, dimensions=[0.5]),
        msg.Shape(type=msg.Shape.BOX, dimensions=[1.0, 2.0, 3.0]),
        msg.Shape(type=msg.Shape.CAPSULE, dimensions=[0.1, 2.0]),
        msg.Shape(type=msg.Shape.CYLINDER, dimensions=[0.2, 3.0]),
        msg.Shape(type=msg.Shape.CONE, dimensions=[0.3, 4.0]),
        msg.Shape(type=msg.Shape.CONVEX_HULL, vertices=points(tetrahedron)),
        msg.Shape(type=msg.Shape.MESH, vertices=points(tetrahedron), triangles=[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]),
        msg.Shape(type=msg.Shape.HALF_SPACE, dimensions=[0.0, 0.0, 1.0, -0.25]),
        msg.Shape(type=msg.Shape.CIRCLE, dimensions=[1.5]),
        msg.Shape(type=msg.Shape.POLYGON, vertices=points(square)),
    ]
    pose = Pose()
    pose.position.x, pose.orientation.z, pose.orientation.w = 1.5, 0.6, 0.8
    objects = []
    for k in range(9):
        each = msg.ObjectDescription(id=k, name="n" * (k + 1), group=1 + k, mask=0xF, allowed=list(range(k)), model=k)
        each.shapes, each.shape_poses = shapes[: k + 2], [pose] * (k + 2)
        each.is_static, each.pose, each.padding, each.max_linear_acceleration = k % 2 == 0, Pose(), 0.25 * k, 1.0 * k
        objects.append(each)
    message = msg.ObjectDescriptionArray(snapshot=True, objects=objects)
    message.header.stamp.sec, message.header.frame_id = 7, "world"
    data = serialize_message(message)
    it = codec.decode_descriptions(data)
    assert it.refused == ()
    assert len(it.objects) == 9
    again = codec.encode_descriptions(it.stamp_ns, it.frame_id, it.objects, snapshot=it.snapshot)
    assert deserialize_message(again, msg.ObjectDescriptionArray) == message


def test_removals() -> None:
    (theirs,) = deserialize_message(
        codec.encode_descriptions(0, "world", [codec.Removal(99)]), msg.ObjectDescriptionArray
    ).objects
    assert (theirs.id, theirs.operation) == (99, msg.ObjectDescription.REMOVE)
    message = msg.ObjectDescriptionArray(objects=[msg.ObjectDescription(id=99, operation=msg.ObjectDescription.REMOVE)])
    assert codec.decode_descriptions(serialize_message(message)).objects == (codec.Removal(99),)


def test_the_record_layouts_are_those_of_the_messages() -> None:
    for kind, dtype in [
        (msg.ObjectState, records.STATE),
        (msg.Contact, records.CONTACT),
        (msg.PredictedCollision, records.PREDICTION),
    ]:
        assert len(serialize_message(kind())) == 4 + dtype.itemsize


@pytest.mark.parametrize("seed", SEEDS)
def test_diagnostics(seed: int) -> None:
    message = random_message(DiagnosticArray, np.random.default_rng(seed))
    message.header.frame_id = ""
    for status in message.status:
        for k, value in enumerate(status.values):
            value.key += str(k)
    it = codec.decode_diagnostics(serialize_message(message))
    assert it.stamp_ns == stamp(message)
    for ours, theirs in zip(it.statuses, message.status, strict=True):
        assert (bytes([ours.level]), ours.name) == (theirs.level, theirs.name)
        assert (ours.message, ours.hardware_id) == (theirs.message, theirs.hardware_id)
        assert ours.values == {each.key: each.value for each in theirs.values}
    again = codec.encode_diagnostics(it.stamp_ns, it.statuses)
    assert deserialize_message(again, DiagnosticArray) == message
