"""Bags of ROS 1: the same messages as in their twins of ROS 2, and what is wrong with the others."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from foreign_bag import START, STORE, odometry, transforms, write_bag
from mcap.writer import Writer as McapWriter
from recorded_bags import KIND, STEP, mcap, read, rows
from rosbags.convert.converter import default_message
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from collision_monitor.errors import SessionError
from collision_monitor.sources import import_bag
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.ground.mapping import make_mapping


def noetic() -> Any:
    """The types of ROS 1, with that of its transforms."""
    store = get_typestore(Stores.EMPTY)
    text = "geometry_msgs/TransformStamped[] transforms"
    store.register(
        {**get_typestore(Stores.ROS1_NOETIC).fielddefs, **get_types_from_msg(text, "tf2_msgs/msg/TFMessage")}
    )
    return store


def ros1(path: Path, compression: Any = None, count: int = 40) -> Path:
    """A bag of ROS 1 with odometry, transforms by the name of the old package, and a topic that is not used."""
    store = noetic()
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        odom = writer.add_connection("/cart/odom", KIND, typestore=store)
        tf = writer.add_connection("/tf", "tf2_msgs/msg/TFMessage", typestore=store)
        unused = writer.add_connection("/camera", "std_msgs/msg/String", typestore=store)
        for k in range(count):
            stamp = START + k * STEP
            for connection, (kind, message) in (
                (tf, transforms(stamp, ("/map", "odom", (1, k, 0), (0, 0, 0, 1)))),
                (odom, odometry("odom", stamp, (k, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))),
            ):
                writer.write(connection, stamp, bytes(STORE.cdr_to_ros1(STORE.serialize_cdr(message, kind), kind)))
        writer.write(unused, START, bytes(4))
    return path


def twin(path: Path, count: int = 40) -> Path:
    """The same in ROS 2."""
    return write_bag(path, [
        each
        for k in range(count)
        for stamp in [START + k * STEP]
        for each in (
            ("/tf", stamp, transforms(stamp, ("/map", "odom", (1, k, 0), (0, 0, 0, 1)))),
            ("/cart/odom", stamp, odometry("odom", stamp, (k, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))),
        )
    ])  # fmt: skip


ROS1_MAPPING = make_mapping({"frame": "map", "objects": {"cart": {"topic": "/cart/odom", "shape": {"sphere": 1}}}})


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat])
def test_a_bag_of_ros_1_is_read_like_its_twin_of_ros_2(tmp_path: Path, compression: Any) -> None:
    path = ros1(tmp_path / "a.bag", compression)
    assert read(path, "/cart/odom", "/tf") == read(twin(tmp_path / "twin"), "/cart/odom", "/tf")
    done = import_bag(path, tmp_path / "a.mcap", ROS1_MAPPING)
    assert done.whole and done.states == {"cart": 40}


def test_runs_keep_their_order_where_the_clock_of_receipt_was_set_back(tmp_path: Path) -> None:
    """rosbag goes by the clock of a simulation, which is reset in the middle."""
    writer, times = Ros1Writer(tmp_path / "a.bag"), [START + k % 100 * STEP for k in range(200)]
    with writer:
        odom = writer.add_connection("/cart/odom", KIND, typestore=noetic())
        for k, time in enumerate(times):
            kind, message = odometry("odom", time, (k, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))
            writer.write(odom, time, bytes(STORE.cdr_to_ros1(STORE.serialize_cdr(message, kind), kind)))
    assert [received for _, received, _ in read(tmp_path / "a.bag", "/cart/odom")] == times


def test_the_old_type_of_transforms_and_fields_that_only_ros_2_has(tmp_path: Path) -> None:
    store = noetic()
    path = ros1(tmp_path / "a.bag", count=3)
    old, new = b"type=tf2_msgs/TFMessage", b"type=tf/tfMessage"
    padded = struct.pack("<I", len(new)) + new + struct.pack("<I", len(old) - len(new) - 4) + b"x="
    path.write_bytes(path.read_bytes().replace(struct.pack("<I", len(old)) + old, padded))  # as long as before
    assert {kind for _, kind in Bag(path).topics.items()} >= {"tf2_msgs/msg/TFMessage"}
    assert len(read(path, "/tf")) == 3
    writer = Ros1Writer(tmp_path / "marker.bag")
    with writer:
        marker = writer.add_connection("/marker", "visualization_msgs/msg/Marker", typestore=store)
        header = store.types["std_msgs/msg/Header"](7, store.types["builtin_interfaces/msg/Time"](5, 6), "map")
        content = default_message(store, "visualization_msgs/msg/Marker")
        content.header, content.ns, content.type = header, "walls", 1
        writer.write(marker, START, bytes(store.serialize_ros1(content, "visualization_msgs/msg/Marker")))
    ((topic, _, data),) = read(tmp_path / "marker.bag", "/marker")
    found = STORE.deserialize_cdr(data, "visualization_msgs/msg/Marker")
    assert (topic, found.ns, found.type, found.header.frame_id, found.header.stamp.sec) == (
        "/marker",
        "walls",
        1,
        "map",
        5,
    )
    assert found.texture_resource == ""


def test_what_is_wrong_with_a_bag_of_ros_1(tmp_path: Path) -> None:
    whole = ros1(tmp_path / "a.bag").read_bytes()
    path = tmp_path / "b.bag"
    for end in range(len(whole) - 1, len(whole) - 400, -13):
        path.write_bytes(whole[:end])
        with pytest.raises(SessionError, match=r"cut off|states|not there"):
            Bag(path)
    at = whole.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(whole[:at] + bytes(8) + whole[at + 8 :])
    with pytest.raises(SessionError, match="the recording was not closed: it has no index; `rosbag reindex`"):
        Bag(path)
    info = whole.rindex(struct.pack("<II", 0, 40))
    path.write_bytes(whole[:info] + struct.pack("<II", 0, 41) + whole[info + 8 :])
    with pytest.raises(SessionError, match="expected 41 messages of /cart/odom, as the file's summary states, got 40"):
        read(path, "/cart/odom")
    assert len(read(path, "/tf")) == 40
    size = whole.index(b"size=") + len(b"size=")
    path.write_bytes(whole[:size] + struct.pack("<I", 1 << 31) + whole[size + 4 :])
    with pytest.raises(SessionError, match=r"a chunk of .* bytes states 2147483648 unpacked bytes, more than"):
        Bag(path)


def test_messages_of_ros_1_in_an_mcap_file(tmp_path: Path) -> None:
    """`mcap convert` makes such a file of a bag of ROS 1."""
    store = noetic()
    text, _ = store.generate_msgdef(KIND, ros_version=1)

    def change(writer: McapWriter) -> None:
        schema = writer.register_schema("nav_msgs/Odometry", "ros1msg", text.encode())
        channel = writer.register_channel("/ros1", "ros1", schema)
        for _, time, data in rows():
            writer.add_message(channel, time, bytes(STORE.cdr_to_ros1(data, KIND)), time, 0)

    path = mcap(tmp_path / "bag.mcap", [], change)
    assert read(path, "/ros1") == [("/ros1", time, data) for _, time, data in rows()]
