"""The codec against itself and against wrong bytes; against rclpy: ros/test_codec_against_rclpy.py."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from collision_monitor import codec, records
from collision_monitor.codec.status import LIVE_FIELDS
from collision_monitor.errors import MessageError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Polygon,
    Sphere,
)

STAMP = 1_700_000_000_123_456_789
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
EVERY_SHAPE = [
    Sphere(0.5),
    Box((1, 2, 3)),
    Capsule(0.1, 2),
    Cylinder(0.2, 3),
    Cone(0.3, 4),
    Ellipsoid((0.3, 4, 5)),
    ConvexHull(TETRAHEDRON),
    Mesh(TETRAHEDRON, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
    HalfSpace((0, 0, 1), -0.25),
    Circle(1.5),
    Polygon([[0, 0], [2, 0], [2, 1], [0.5, 0.2], [0, 1]]),
    Polygon([[0, 0], [2, 0]], 0.5),
]
DECODERS = {
    "states": codec.decode_states,
    "descriptions": codec.decode_descriptions,
    "contacts": codec.decode_contacts,
    "predictions": codec.decode_predictions,
    "status": codec.decode_status,
}


def random_records(dtype: np.dtype, count: int, seed: int = 0) -> np.ndarray:
    """Return records with random bytes, except that no float is NaN, because they are compared."""
    rows = np.zeros(count, dtype)
    generator = np.random.default_rng(seed)
    for name in dtype.names:
        field = rows[name]
        if field.dtype.kind == "f":
            field[...] = generator.normal(size=field.shape)
        else:
            field[...] = generator.integers(0, np.iinfo(field.dtype).max, field.shape, field.dtype, endpoint=True)
    return rows


def examples() -> dict[str, bytes]:
    pose = Pose((1, 2, 3), (0, 0, 0.6, 0.8))
    descriptions = [
        ObjectDescription(7, tuple((shape, pose) for shape in EVERY_SHAPE), name="Gabelstapler ü", allowed=(1, 2)),
        ObjectDescription(8, ((Sphere(1.0), Pose()),), static=True, pose=pose, model=records.Model.OBB, padding=0.125),
        codec.Removal(9),
    ]
    return {
        "states": codec.encode_states(STAMP, "world", 42, random_records(records.STATE, 3), np.arange(36.0)),
        "descriptions": codec.encode_descriptions(STAMP, "world", descriptions, snapshot=True),
        "contacts": codec.encode_contacts(
            STAMP, "map", 5, random_records(records.CONTACT, 2), np.array([1, 2, 30], np.uint32), ["a", "", "wörld"]
        ),
        "predictions": codec.encode_predictions(
            STAMP, "map", 5, 2.5, random_records(records.PREDICTION, 2), np.array([1, 2], np.uint32), ["a", "bcd"]
        ),
        "status": codec.encode_status(
            codec.MonitorStatus(STAMP, "map", 5, 2**64 - 1, "1.0", "fast", last_refusal="why", rate=1.5)
        ),
    }


EXAMPLES = examples()


@pytest.mark.parametrize("count", [0, 1, 3, 1000])
@pytest.mark.parametrize("frame", ["", "w", "world", "a/longer/frame"])
def test_states_come_back(count: int, frame: str) -> None:
    states = random_records(records.STATE, count)
    covariance = np.arange(12.0 * count)
    back = codec.decode_states(codec.encode_states(STAMP, frame, 42, states, covariance))
    assert (back.stamp_ns, back.frame_id, back.sequence) == (STAMP, frame, 42)
    assert back.states.tobytes() == states.tobytes()
    assert back.covariance.tobytes() == covariance.tobytes()


def test_states_are_seen_and_not_copied() -> None:
    data = EXAMPLES["states"]
    states = codec.decode_states(data).states
    assert np.shares_memory(states, np.frombuffer(data, np.uint8))
    assert not states.flags.writeable
    assert not codec.decode_states(bytearray(data)).states.flags.writeable


@pytest.mark.parametrize("count", [0, 1, 5])
def test_answers_come_back(count: int) -> None:
    contacts, predictions = random_records(records.CONTACT, count), random_records(records.PREDICTION, count)
    ids, names = np.arange(count, dtype=np.uint32), ["x" * k for k in range(count)]
    c = codec.decode_contacts(codec.encode_contacts(STAMP, "world", 9, contacts, ids, names))
    p = codec.decode_predictions(codec.encode_predictions(STAMP, "world", 9, 2.5, predictions, ids, names))
    assert (c.stamp_ns, c.frame_id, c.step, c.names, c.ids.tolist()) == (STAMP, "world", 9, names, ids.tolist())
    assert (p.stamp_ns, p.frame_id, p.step, p.horizon, p.names) == (STAMP, "world", 9, 2.5, names)
    assert c.contacts.tobytes() == contacts.tobytes()
    assert p.predictions.tobytes() == predictions.tobytes()


@pytest.mark.parametrize("stamp", [0, 1, -1, -1_700_000_000, 999_999_999, STAMP, 2**31 * 10**9 - 1, -(2**31) * 10**9])
def test_stamps_come_back(stamp: int) -> None:
    assert codec.decode_states(codec.encode_states(stamp, "", 0, np.empty(0, records.STATE))).stamp_ns == stamp


def test_descriptions_come_back() -> None:
    back = codec.decode_descriptions(EXAMPLES["descriptions"])
    assert back.snapshot
    assert back.frame_id == "world"
    assert back.refused == ()
    forklift, column, gone = back.objects
    assert (forklift.object_id, forklift.name, forklift.allowed) == (7, "Gabelstapler ü", (1, 2))
    assert [type(shape) for shape, _ in forklift.shapes] == [type(shape) for shape in EVERY_SHAPE]
    for (shape, pose), original in zip(forklift.shapes, EVERY_SHAPE, strict=True):
        for name, value in vars(original).items():
            np.testing.assert_array_equal(getattr(shape, name), value)
        np.testing.assert_array_equal(pose.position, [1, 2, 3])
    assert forklift.pose is None
    assert not forklift.static
    assert column.static
    assert column.pose is not None
    assert column.model == records.Model.OBB
    assert column.padding == 0.125
    assert gone == codec.Removal(9)
    again = codec.encode_descriptions(back.stamp_ns, back.frame_id, back.objects, snapshot=True)
    assert codec.decode_descriptions(again).objects[0].name == forklift.name


def test_status_comes_back() -> None:
    fields = (*range(1, 3), "1.2.3", "balanced", *range(3, 25), "refused", *range(25, 27))
    status = codec.MonitorStatus(STAMP, "map", *fields)
    back = codec.decode_status(codec.encode_status(status))
    assert {k: v for k, v in vars(back).items() if v == v} == {k: v for k, v in vars(status).items() if v == v}
    assert LIVE_FIELDS[0] == "step_duration"
    assert LIVE_FIELDS[-1] == "recording_error"


@pytest.mark.parametrize("name", DECODERS)
def test_every_cut_is_refused(name: str) -> None:
    """Each single byte of the message is needed: no prefix passes as the whole."""
    for length in range(len(EXAMPLES[name])):
        with pytest.raises(MessageError, match="expected"):
            DECODERS[name](EXAMPLES[name][:length])


@pytest.mark.parametrize("name", DECODERS)
def test_padding_passes_and_garbage_does_not(name: str) -> None:
    for padding in range(4):
        DECODERS[name](EXAMPLES[name] + bytes(padding))
    allowed = 3 + 8 * 21 if name == "descriptions" else 3  # 21: its empty sequences, see Reader.sequence
    with pytest.raises(MessageError, match="more bytes"):
        DECODERS[name](EXAMPLES[name] + bytes(allowed + 1))


@pytest.mark.parametrize("name", DECODERS)
def test_big_endian_and_foreign_bytes_are_named(name: str) -> None:
    with pytest.raises(MessageError, match="big-endian"):
        DECODERS[name](b"\x00\x00\x00\x00" + EXAMPLES[name][4:])
    with pytest.raises(MessageError, match="0xdeadbeef"):
        DECODERS[name](b"\xde\xad\xbe\xef" + EXAMPLES[name][4:])


def test_a_huge_count_allocates_nothing() -> None:
    head = EXAMPLES["states"][: EXAMPLES["states"].index(struct.pack("<II", 42, 3)) + 4]
    tracemalloc.start()
    with pytest.raises(MessageError, match="4294967295 elements of at least 168 bytes"):
        codec.decode_states(head + b"\xff\xff\xff\xff" + bytes(64))
    with pytest.raises(MessageError, match="4294967295 elements"):
        codec.decode_descriptions(EXAMPLES["descriptions"][:21] + bytes(3) + b"\xff\xff\xff\xff" + bytes(64))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100_000


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (b"world\0", b"wor\0d\0", "only zero byte is the last"),
        (b"world\0", b"worldx", "only zero byte is the last"),
        (b"world\0", b"w\xff\xferl\0", "UTF-8"),
        (
            struct.pack("<I", 6) + b"world\0",
            struct.pack("<I", 0xFFFFFFFF) + b"world\0",
            "header.frame_id: expected 4294967295",
        ),
        (struct.pack("<I", 123_456_789), struct.pack("<I", 1_000_000_000), "nanosec: expected less than 1000000000"),
    ],
)
def test_bad_headers_are_named(old: bytes, new: bytes, text: str) -> None:
    assert EXAMPLES["states"].count(old) == 1
    with pytest.raises(MessageError, match=text):
        codec.decode_states(EXAMPLES["states"].replace(old, new))


def test_values_that_do_not_fit_are_refused_when_writing() -> None:
    empty = np.empty(0, records.STATE)
    for stamp, frame, sequence in [(2**63, "w", 0), (0, "w\0", 0), (0, "\ud800", 0), (0, "w", -1), (0, "w", 2**32)]:
        with pytest.raises(MessageError, match="expected"):
            codec.encode_states(stamp, frame, sequence, empty)
    with pytest.raises(MessageError, match="one-dimensional array"):
        codec.encode_states(0, "", 0, np.empty(3))  # type: ignore[arg-type]


def test_only_the_impossible_object_is_refused() -> None:
    """Each wrong byte below makes one object impossible; the object beside it is accepted."""
    good = ObjectDescription(1, ((Sphere(1.0), Pose()),))
    radius = 0.7071067811865476

    def with_bytes(old: bytes, new: bytes, **fields: object) -> codec.ObjectDescriptionArray:
        marked = ObjectDescription(2, ((Sphere(radius), Pose()),), **fields)  # type: ignore[arg-type]
        data = codec.encode_descriptions(0, "w", [marked, good])
        at = data.rindex(old, 0, data.index(mark) + len(mark))
        return codec.decode_descriptions(data[:at] + new + data[at + len(old) :])

    mark = struct.pack("<d", radius)
    sphere = struct.pack("<BxxxI", 1, 1)  # its type and the length of its dimensions
    cases = [
        (with_bytes(mark, struct.pack("<d", -1.0)), "positive"),
        (with_bytes(mark, struct.pack("<d", float("nan"))), "positive"),
        (with_bytes(sphere, b"\x2a" + sphere[1:]), "got 42"),
        (with_bytes(sphere, b"\x02" + sphere[1:]), "3 dimensions"),
        (with_bytes(struct.pack("<IB", 2, 0), struct.pack("<IB", 2, 9)), "operation: expected 0"),
    ]
    for message, text in cases:
        assert [each.object_id for each in message.objects] == [1], text
        ((object_id, reason),) = message.refused
        assert object_id == 2
        assert text in reason


def test_zero_group_and_mask_and_nan_acceleration_take_their_defaults() -> None:
    it = ObjectDescription(1, ((Sphere(1.0), Pose()),), group=0, mask=0, max_linear_acceleration=float("nan"))
    (back,) = codec.decode_descriptions(codec.encode_descriptions(0, "w", [it])).objects
    assert (back.group, back.mask, back.max_linear_acceleration) == (1, 0xFFFFFFFF, 0.0)


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(sorted(DECODERS)), st.binary(max_size=400), st.booleans())
def test_random_bytes_are_a_message_or_an_error(name: str, data: bytes, headed: bool) -> None:
    try:
        DECODERS[name](b"\x00\x01\x00\x00" + data if headed else data)
    except MessageError:
        return


@settings(max_examples=1500, deadline=None)
@given(st.sampled_from(sorted(DECODERS)), st.data())
def test_mutated_messages_are_a_message_or_an_error(name: str, data: st.DataObject) -> None:
    message = bytearray(EXAMPLES[name])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(message) - 1))
        replacement = data.draw(st.sampled_from([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x01", b"\xff", b"\x7f\xf0", b""]))
        message[at : at + data.draw(st.integers(0, 4))] = replacement
        if not message:
            break
    try:
        DECODERS[name](bytes(message))
    except MessageError:
        return
