"""Bags of every kind: all messages of the topics that are used, or an error; what is not used does not decide."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import session_mutations as mutations
import yaml
import zstandard
from foreign_bag import SECOND, START, STORE, odometry, write_bag
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from no_files import POINTER
from processor_time import within
from recorded_bags import ODOM, STEP, STILL, Row, mcap, read, rows
from rosbags.rosbag2 import StoragePlugin

from collision_monitor.cli.main import main
from collision_monitor.codec import decode_contacts
from collision_monitor.errors import SessionError
from collision_monitor.pipeline.topics import Topic
from collision_monitor.session import Session
from collision_monitor.session.mcap.layout import MAGIC
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.ground.mapping import make_mapping

MAPPING = make_mapping({"frame": "map", "objects": {"cart": {"topic": ODOM, "shape": {"sphere": 1}}}})


# -- MCAP


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE, IndexType.CHUNK, IndexType.MESSAGE])
@pytest.mark.parametrize(
    "more", [{}, {"use_chunking": False}, {"use_statistics": False}, {"use_summary_offsets": False}]
)
def test_no_index_is_needed(
    tmp_path: Path, index: IndexType, compression: CompressionType, more: dict[str, bool]
) -> None:
    path = mcap(tmp_path / "bag.mcap", rows(), chunk_size=2000, compression=compression, index_types=index, **more)
    assert read(path) == rows()


def test_chunks_with_and_without_an_index(tmp_path: Path) -> None:
    """A reader that trusts the index finds 20 of the 40 messages, and says nothing."""
    records = mutations.parse(mcap(tmp_path / "bag.mcap", rows(), chunk_size=2000).read_bytes(), len(MAGIC))
    indexes = [k for k, each in enumerate(records) if each.opcode == Opcode.MESSAGE_INDEX]
    dropped = set(indexes[len(indexes) // 2 :])
    kept = [each for k, each in enumerate(records) if k not in dropped]
    path = tmp_path / "half.mcap"
    path.write_bytes(with_summary(kept))
    assert read(path) == rows()
    assert import_bag(path, tmp_path / "a.mcap", MAPPING).states == {"cart": 40}


def with_summary(records: list[mutations.Record]) -> bytes:
    """The file of records whose footer names where their summary begins now."""
    records = [each for each in records if each.opcode != Opcode.SUMMARY_OFFSET]
    at = len(MAGIC)
    for each in records:
        at += len(each.packed())
        if each.opcode == Opcode.DATA_END:
            records[-1].content = struct.pack("<QQI", at, 0, 0)
    return mutations.make_file(records)


def without(records: list[mutations.Record], number: int) -> list[mutations.Record]:
    """The records without the chunk of that number."""
    chunk = [k for k, each in enumerate(records) if each.opcode == Opcode.CHUNK][number]
    return records[:chunk] + records[chunk + 1 :]


def test_a_chunk_that_is_missing_is_an_error_with_both_numbers(tmp_path: Path) -> None:
    path = mcap(tmp_path / "bag.mcap", [*rows(), *rows(40, "/other")], chunk_size=20_000)
    records = mutations.parse(path.read_bytes(), len(MAGIC))
    assert sum(each.opcode == Opcode.CHUNK for each in records) == 3
    path.write_bytes(with_summary(without(records, 2)))
    assert len(read(path)) == 40  # the chunk had messages of the other topic
    with pytest.raises(SessionError, match=r"expected 40 messages of /other, as the file's summary states, got \d\d?;"):
        read(path, "/other")
    target = tmp_path / "a.mcap"
    other = make_mapping({"frame": "map", "objects": {"cart": {"topic": "/other", "shape": {"sphere": 1}}}})
    with pytest.raises(SessionError, match="collision-monitor salvage"):
        import_bag(path, target, other)
    assert not target.exists()


@pytest.mark.parametrize("number", [1, 12])
def test_a_file_without_statistics_is_compared_with_the_indexes_of_its_chunks(tmp_path: Path, number: int) -> None:
    path = tmp_path / "bag.mcap"
    whole = mutations.parse(mcap(path, rows(), chunk_size=2000, use_statistics=False).read_bytes(), len(MAGIC))
    chunk = [k for k, each in enumerate(whole) if each.opcode == Opcode.CHUNK][number]
    inner = mutations.parse(mutations.unpack_chunk(whole[chunk]))
    kept = [each for each in inner if each.opcode != Opcode.MESSAGE] + [inner[-1]]
    smaller = [*whole[:chunk], mutations.make_chunk(mutations.join(kept)), *whole[chunk + 1 :]]
    lost = len(inner) - len(kept)
    path.write_bytes(with_summary(smaller))
    with pytest.raises(
        SessionError, match=f"expected 40 messages of /odom, as the file's index states, got {40 - lost};"
    ):
        read(path)
    gone = [*whole[:chunk], *whole[chunk + 2 :]]  # with the index behind it; the summary's is there
    path.write_bytes(with_summary(gone))
    with pytest.raises(SessionError, match="its summary states 14 chunks, there are 13"):
        read(path)
    half = whole[:chunk] + whole[chunk + 1 :]  # no index in the summary, but that of its messages is there
    path.write_bytes(with_summary([each for each in half if each.opcode != Opcode.CHUNK_INDEX]))
    with pytest.raises(SessionError, match="expected 40 messages of /odom, as the file's index states, got 37;"):
        read(path)
    without_any = [each for each in whole if each.opcode not in (Opcode.CHUNK_INDEX, Opcode.MESSAGE_INDEX)]
    path.write_bytes(with_summary(without_any))
    assert read(path) == rows()


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE, IndexType.CHUNK, IndexType.MESSAGE])
@pytest.mark.parametrize("gap", [0, 5])
def test_a_chunk_that_is_there_twice_is_an_error(tmp_path: Path, index: IndexType, gap: int) -> None:
    """Its messages would be taken twice: without statistics, nothing counts them."""
    path = mcap(tmp_path / "bag.mcap", rows(), chunk_size=2000, use_statistics=False, index_types=index)
    whole = mutations.parse(path.read_bytes(), len(MAGIC))
    begin = next(k for k, each in enumerate(whole) if each.opcode == Opcode.CHUNK)
    end = next(k for k, each in enumerate(whole) if k > begin and each.opcode != Opcode.MESSAGE_INDEX)
    copy = whole[begin:end]  # with the index of its messages
    path.write_bytes(with_summary([*whole[: end + gap], *copy, *whole[end + gap :]]))
    with pytest.raises(SessionError, match=r"its chunk at byte \d+ is the one at byte \d+ once more"):
        read(path)


@pytest.mark.parametrize("gap", [0, 5])
@pytest.mark.parametrize("at", [0, 20])
def test_a_message_outside_of_chunks_that_is_there_twice_is_an_error(tmp_path: Path, gap: int, at: int) -> None:
    path = mcap(tmp_path / "bag.mcap", rows(), use_chunking=False, use_statistics=False)
    assert read(path) == rows()
    whole = mutations.parse(path.read_bytes(), len(MAGIC))
    place = [k for k, each in enumerate(whole) if each.opcode == Opcode.MESSAGE][at]
    path.write_bytes(with_summary([*whole[: place + gap + 1], whole[place], *whole[place + gap + 1 :]]))
    with pytest.raises(SessionError, match=r"its message at byte \d+ is the one at byte \d+ once more"):
        read(path)


def test_statistics_of_a_channel_that_is_lost_with_its_messages(tmp_path: Path) -> None:
    """Two channels of one topic: of the second one, only the number of its messages is left."""
    path = tmp_path / "bag.mcap"
    with path.open("wb") as stream:
        writer = McapWriter(stream, repeat_channels=False)
        writer.start("ros2", "another program")
        schema = writer.register_schema("nav_msgs/msg/Odometry", "ros2msg", b"")
        for half, known in ((rows()[:20], {}), (rows()[20:], {"of": "another publisher"})):
            channel = writer.register_channel(ODOM, "cdr", schema, known)
            for _, time, data in half:
                writer.add_message(channel, time, data, time, 0)
        writer.finish()
    assert len(read(path)) == 40
    records = mutations.parse(path.read_bytes(), len(MAGIC))
    (chunk,) = (each for each in records if each.opcode == Opcode.CHUNK)
    second = (2).to_bytes(2, "little")
    inner = [
        each
        for each in mutations.parse(mutations.unpack_chunk(chunk))
        if not (each.opcode in (Opcode.CHANNEL, Opcode.MESSAGE) and each.content[:2] == second)
    ]
    chunk.content = mutations.make_chunk(mutations.join(inner)).content
    path.write_bytes(with_summary(records))
    with pytest.raises(SessionError, match="its summary states 20 messages of channels that are not there"):
        read(path)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("offset", ["kept", "none"])
def test_the_summary_counts_wherever_the_end_says_that_it_is(tmp_path: Path, chunked: bool, offset: str) -> None:
    """Records were cut out or put behind the end of the data, and the offsets in the file are those of before."""
    whole = mcap(tmp_path / "bag.mcap", rows(), chunk_size=2000, use_chunking=chunked).read_bytes()
    records = mutations.parse(whole, len(MAGIC))
    if offset == "none":
        records[-1].content = bytes(20)
    (end,) = (k for k, each in enumerate(records) if each.opcode == Opcode.DATA_END)
    path = tmp_path / "damaged.mcap"
    for k, each in enumerate(records):
        if each.opcode not in (Opcode.CHUNK, Opcode.MESSAGE):
            continue
        others = records[:k] + records[k + 1 :]
        behind = [*others[:end], each, *others[end:]]
        for changed in (others, behind, [*records[:k], each, *records[k:]]):
            path.write_bytes(mutations.make_file(changed))
            with pytest.raises(SessionError, match=r"expected 40 messages|behind the end of its data|does not define"):
                read(path)


@pytest.mark.parametrize("stated", [20, 41])
def test_a_total_that_differs_is_an_error_with_both_numbers(tmp_path: Path, stated: int) -> None:
    path = mcap(tmp_path / "bag.mcap", rows())
    records = mutations.parse(path.read_bytes(), len(MAGIC))
    statistics = next(each for each in records if each.opcode == Opcode.STATISTICS)
    statistics.content = struct.pack("<Q", stated) + statistics.content[8:-14] + bytes(4)  # no map of channels
    path.write_bytes(with_summary(records))
    with pytest.raises(SessionError, match=f"its summary states {stated} messages, there are 40"):
        Bag(path)


def test_messages_come_in_order_of_time_whatever_their_order_in_the_file(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    given = [
        (topic, START + int(time), data)
        for (topic, _, data), time in zip(rows(200), rng.integers(0, 50, 200), strict=True)
    ]
    expected = sorted(given, key=lambda row: row[1])  # equal times keep their order
    assert read(mcap(tmp_path / "a.mcap", given, chunk_size=3000)) == expected
    assert read(mcap(tmp_path / "b.mcap", given, use_chunking=False)) == expected


def reset(count: int, back: int, topic: str = ODOM) -> list[Row]:
    """What a recorder writes that goes by the clock of a simulation: it goes back by so many steps in the middle."""
    half = rows(count, topic)
    again = [(topic, time - (back - count) * STEP, data[:-8] + b"a second") for topic, time, data in half]
    return [*half, *again]


@pytest.mark.parametrize("options", [{"chunk_size": 2000}, {"chunk_size": 200_000}, {"use_chunking": False}])
@pytest.mark.parametrize("back", [3, 10, 45, 60, 100, 140])
def test_runs_keep_their_order_where_the_clock_of_receipt_was_set_back(
    tmp_path: Path, back: int, options: dict[str, Any]
) -> None:
    """In order of time alone, two runs of a simulation would be mixed."""
    given = [row for two in zip(reset(100, back), reset(100, back, "/other"), strict=True) for row in two]
    path = mcap(tmp_path / "a.mcap", given, **options)
    assert read(path, ODOM, "/other") == given
    assert read(path, "/other") == [row for row in given if row[0] == "/other"]


@pytest.mark.parametrize("late", [1, 3, 40])
def test_one_late_message_of_a_channel_is_sorted_by_its_time(tmp_path: Path, late: int) -> None:
    """Only a second one that is late as well tells that the clock was set back."""
    given = rows(200)
    given.insert(100 + late, given.pop(100))
    for options in ({"chunk_size": 2000}, {"use_chunking": False}):
        assert read(mcap(tmp_path / "a.mcap", given, **options)) == rows(200)


def test_a_file_in_no_order_is_read_soon(tmp_path: Path) -> None:
    """The newest message first, each in a run of its own: a chunk is not unpacked for each of its messages."""
    given = [(topic, time + (3000 - k) * 2 * SECOND, data) for k, (topic, time, data) in enumerate(rows(3000))]
    path = mcap(tmp_path / "a.mcap", given, chunk_size=1 << 30)
    with within(3.0):
        assert read(path) == given[::-1]


def test_a_clock_that_is_set_back_again_and_again_in_one_chunk(tmp_path: Path) -> None:
    """As many runs as there may be, of a few messages each."""
    given = [row for _ in range(1000) for row in rows(5)]
    path = mcap(tmp_path / "a.mcap", given, chunk_size=1 << 30, compression=CompressionType.NONE)
    with within(3.0):
        assert read(path) == given


@pytest.mark.parametrize("back", [3, 80])
def test_runs_in_a_table(tmp_path: Path, back: int) -> None:
    given = reset(100, back)
    messages = [(topic, time, ("nav_msgs/msg/Odometry", data)) for topic, time, data in given]
    assert read(write_bag(tmp_path / "bag", messages, storage=StoragePlugin.SQLITE3)) == given


def test_parts_that_time_separates_come_in_order_of_time(tmp_path: Path) -> None:
    """Two files, the second one first; and one topic behind another."""
    given = rows(300)
    assert read(mcap(tmp_path / "a.mcap", given[150:] + given[:150], chunk_size=3000)) == given
    both = given + rows(300, "/other")
    found = read(mcap(tmp_path / "b.mcap", both, chunk_size=3000), ODOM, "/other")
    assert found == sorted(both, key=lambda row: row[1])


def test_a_simulation_that_was_reset_is_imported_run_by_run(tmp_path: Path) -> None:
    """Both runs find the contact, and a replay gives the same bytes although the times of its records go back."""
    wall = {"static": True, "pose": [9, 0, 0], "shape": {"sphere": 1}}
    objects = {"cart": {"topic": ODOM, "shape": {"sphere": 1}}, "wall": wall}
    given = [
        (ODOM, START + k * STEP, odometry("map", START + k * STEP, (k * 0.1, y, 0), *STILL))
        for y in (0.0, 0.5)
        for k in range(100)
    ]
    target = tmp_path / "a.mcap"
    mapping = make_mapping({"frame": "map", "rate": 50, "objects": objects})
    import_bag(write_bag(tmp_path / "bag", given), target, mapping)
    session = Session(target)
    answers = [decode_contacts(each.data) for each in session.messages() if each.type == Topic.CONTACTS.message]
    touching = [each.stamp_ns for each in answers if len(each.contacts)]
    assert sum(after < before for before, after in pairwise(touching)) == 1
    assert replay(session).verdict is Verdict.IDENTICAL


def test_damage_is_an_error_and_no_smaller_bag(tmp_path: Path) -> None:
    whole = mcap(tmp_path / "bag.mcap", rows(), chunk_size=2000).read_bytes()
    path = tmp_path / "damaged.mcap"
    rng = np.random.default_rng(1)
    for _ in range(60):
        data = bytearray(whole)
        data[rng.integers(len(MAGIC), len(data) // 2)] ^= 1 << rng.integers(8)
        path.write_bytes(data)
        try:
            assert read(path) == rows()
        except SessionError:
            continue
    for end in range(len(whole) - 1, len(whole) - 600, -7):
        path.write_bytes(whole[:end])
        with pytest.raises(SessionError, match="salvage"):
            Bag(path)


# -- what is not used


def json_channel(writer: McapWriter) -> None:
    schema = writer.register_schema("viewer", "jsonschema", b"{}")
    channel = writer.register_channel("/json", "json", schema)
    writer.add_message(channel, START, b"{}", START, 0)
    writer.register_channel("/nothing", "json", 0)


def second_type(writer: McapWriter) -> None:
    for kind in ("std_msgs/msg/String", "std_msgs/msg/Header"):
        channel = writer.register_channel("/two", "cdr", writer.register_schema(kind, "ros2msg", b""))
        writer.add_message(channel, START, b"\0\1\0\0\1\0\0\0\0", START, 0)


def odd_names(writer: McapWriter) -> None:
    schema = writer.register_schema("\ud800 no type".encode("utf-8", "replace").decode(), "cuneiform", b"\xff")
    writer.add_message(writer.register_channel("not a topic", "cdr", schema), 1 << 63, b"", 0, 0)
    writer.register_channel(ODOM.upper(), "cdr", schema, {"offered_qos_profiles": "- [no yaml"})


@pytest.mark.parametrize("change", [json_channel, second_type, odd_names])
def test_channels_that_are_not_used_do_not_decide(tmp_path: Path, change: Callable[[McapWriter], None]) -> None:
    path = mcap(tmp_path / "bag.mcap", rows(), change)
    assert read(path) == rows()
    assert import_bag(path, tmp_path / "a.mcap", MAPPING).whole


def test_channels_that_are_used_are_named_with_what_is_wrong(tmp_path: Path) -> None:
    path = mcap(tmp_path / "bag.mcap", rows(), lambda writer: all_of(writer, json_channel, second_type, odd_names))
    for topic, text in {
        "/json": "topic /json cannot be read: its messages are encoded as 'json', and not as cdr",
        "/two": "topic /two has messages of std_msgs/msg/Header and std_msgs/msg/String",
        "not a topic": "expected 1 messages of not a topic, as there are, got 0 that can be read",
    }.items():
        with pytest.raises(SessionError) as caught:
            read(path, topic)
        assert text in str(caught.value)


def all_of(writer: McapWriter, *changes: Callable[[McapWriter], None]) -> None:
    for change in changes:
        change(writer)


def change_yaml(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    path = folder / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    change(content["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(content))


def messages(count: int = 40) -> list[tuple[str, int, tuple[str, Any]]]:
    return [(ODOM, START + k * STEP, odometry("map", START + k * STEP, (k, 0, 0), *STILL)) for k in range(count)]


UNUSED_METADATA: dict[str, Callable[[dict[str, Any]], None]] = {
    "storage_identifier": lambda table: table.update(storage_identifier=""),
    "another version": lambda table: table.update(version=99),
    "quality": lambda table: table["topics_with_message_count"][0]["topic_metadata"].update(offered_qos_profiles="- 1"),
    "type": lambda table: table["topics_with_message_count"][0]["topic_metadata"].update(type="x"),
    "no times": lambda table: [table.pop(key) for key in ("starting_time", "duration", "files")] and None,
    "compression": lambda table: table.update(compression_mode="FILE", compression_format="gzip"),
    "no topics": lambda table: table.update(topics_with_message_count=None),
}


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("kind", UNUSED_METADATA)
def test_metadata_that_are_not_used_do_not_decide(tmp_path: Path, kind: str, storage: StoragePlugin) -> None:
    folder = write_bag(tmp_path / "bag", messages(), storage=storage)
    change_yaml(folder, UNUSED_METADATA[kind])
    assert len(read(folder)) == 40


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_the_metadata_count_what_was_recorded(tmp_path: Path, storage: StoragePlugin) -> None:
    folder = write_bag(tmp_path / "bag", messages(), storage=storage)
    change_yaml(folder, lambda table: table["topics_with_message_count"][0].update(message_count=43))
    with pytest.raises(SessionError, match=r"expected 43 messages of /odom, as metadata\.yaml states, got 40"):
        read(folder)
    change_yaml(folder, lambda table: table.update(relative_file_paths=[*table["relative_file_paths"], "bag_1.mcap"]))
    with pytest.raises(
        SessionError, match=r"expected a file of the bag, as its metadata\.yaml says, got nothing there"
    ):
        read(folder)


@pytest.mark.parametrize(
    "topics", [None, "x", ["x"], [None], [[]], [{}], [{"topic_metadata": "x"}], [{"topic_metadata": {"name": []}}]]
)
def test_metadata_of_other_types_state_nothing(tmp_path: Path, topics: Any) -> None:
    folder = write_bag(tmp_path / "bag", messages())
    change_yaml(folder, lambda table: table.update(topics_with_message_count=topics))
    assert len(read(folder)) == 40


@pytest.mark.parametrize("names", [[None], [""], [".."], ["."], ["a\0b"], ["x" * 5000], [{}], [["a"]], "ab", 7, ["/"]])
def test_names_that_no_file_of_the_bag_has_are_refused(tmp_path: Path, names: Any) -> None:
    folder = write_bag(tmp_path / "bag", messages())
    change_yaml(folder, lambda table: table.update(relative_file_paths=names))
    with pytest.raises(SessionError, match=r"expected (a file of the bag|the relative_file_paths of a bag)"):
        read(folder)


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_an_empty_topic_beside_static_objects(tmp_path: Path, storage: StoragePlugin) -> None:
    """The error names what is missing, and not the static object."""
    bag = write_bag(tmp_path / "bag", [("/other", START, odometry("map", START, (0, 0, 0), *STILL))], storage=storage)
    floor = {"static": True, "shape": {"half_space": [0, 0, 1, 0]}}
    cart = {"topic": ODOM, "shape": {"sphere": 1}}
    file = next(bag.glob("*.mcap" if storage is StoragePlugin.MCAP else "*.db3"))
    if storage is StoragePlugin.MCAP:
        mcap(file, rows(1, "/other"), lambda writer: writer.register_channel(ODOM, "cdr", 1))
    else:
        with sqlite3.connect(file) as base:
            base.execute(f"INSERT INTO topics SELECT 7, '{ODOM}', type, 'cdr', '', '' FROM topics")
        base.close()
    with pytest.raises(SessionError, match="expected messages of the mapped topics in the bag, got none"):
        import_bag(bag, tmp_path / "a.mcap", make_mapping({"frame": "map", "objects": {"floor": floor, "cart": cart}}))
    done = import_bag(bag, tmp_path / "a.mcap", make_mapping(
        {"frame": "map", "objects": {"floor": floor, "cart": cart, "other": {**cart, "topic": "/other"}}}
    ))  # fmt: skip
    assert done.unseen == ["cart"] and done.states["other"] == 1


# -- SQLite


def db3(folder: Path, change: str = "", *parameters: Any) -> Path:
    file = next(write_bag(folder, messages(), storage=StoragePlugin.SQLITE3).glob("*.db3"))
    if change:
        with sqlite3.connect(file) as base:
            base.execute("INSERT INTO topics SELECT 9, '/unused', type, 'cdr', '', '' FROM topics")
            base.execute(change, parameters)
        base.close()
    return file


ODD_ROWS = {
    "a time that is no number": ("INSERT INTO messages VALUES (99, {}, 1e300, x'00')", ()),
    "a time that is a text": ("INSERT INTO messages VALUES (99, {}, 'now', x'00')", ()),
    "a time before 1970": ("INSERT INTO messages VALUES (99, {}, -1, x'00')", ()),
    "bytes that are none": ("INSERT INTO messages VALUES (99, {}, 1, 'text')", ()),
}


@pytest.mark.parametrize("kind", ODD_ROWS)
def test_rows_that_cannot_be_read_count_for_their_topic(tmp_path: Path, kind: str) -> None:
    change, parameters = ODD_ROWS[kind]
    unused = db3(tmp_path / "unused", change.format(9), *parameters)
    assert len(read(unused)) == 40
    used = db3(tmp_path / "used", change.format(1), *parameters)
    with pytest.raises(SessionError, match="expected 41 messages of /odom, as there are, got 40 that can be read"):
        read(used)
    with pytest.raises(SessionError, match="1 messages are of topics that it does not define"):
        read(db3(tmp_path / "unknown", change.format(55), *parameters))


def test_messages_that_were_packed_one_by_one(tmp_path: Path) -> None:
    """By a program that knows their size, or by one that packs a stream and does not."""
    file = db3(tmp_path / "bag")
    whole = read(file)
    base = sqlite3.connect(file)
    for number, data in base.execute("SELECT id, data FROM messages").fetchall():
        packer = zstandard.ZstdCompressor(write_content_size=bool(number % 2))
        stream = packer.compressobj()
        packed = packer.compress(data) if number % 3 else stream.compress(data) + stream.flush()
        base.execute("UPDATE messages SET data = ? WHERE id = ?", (packed, number))
    base.commit()
    assert read(file) == whole
    base.execute("UPDATE messages SET data = substr(data, 1, 30) WHERE id = 3")
    base.commit()
    base.close()
    with pytest.raises(SessionError, match="/odom: expected a message packed by zstd, got one that is cut off"):
        read(file)


def test_rows_that_wait_in_the_log_of_the_base_are_read(tmp_path: Path) -> None:
    """A recorder that was killed leaves the newest messages in a file beside the base."""
    file = db3(tmp_path / "bag")
    base = sqlite3.connect(file)
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA wal_autocheckpoint = 0")
    base.execute("INSERT INTO messages SELECT id + 100, topic_id, timestamp + 1, data FROM messages")
    base.commit()
    copy = tmp_path / "copy.db3"
    copy.write_bytes(file.read_bytes())
    Path(f"{copy}-wal").write_bytes(Path(f"{file}-wal").read_bytes())
    base.close()
    assert len(read(copy)) == 80


# -- packed files, pointers


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_a_file_that_is_packed_as_a_whole(tmp_path: Path, storage: StoragePlugin) -> None:
    folder = write_bag(tmp_path / "bag", messages(), storage=storage)
    (file,) = [each for each in folder.iterdir() if each.name != "metadata.yaml"]
    whole = read(folder)
    packed = file.with_name(f"{file.name}.zstd")
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    change_yaml(folder, lambda table: table.update(relative_file_paths=[packed.name], compression_mode="FILE"))
    assert read(folder) == read(packed) == whole
    packed.write_bytes(zstandard.compress(b"nothing"))
    with pytest.raises(SessionError, match=rf"{packed.name}: expected a bag, cannot be read: expected MCAP, SQLite or"):
        read(folder)


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3", "folder"])
def test_a_pointer_of_git_lfs_is_called_by_its_name(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    if name == "folder":
        path = write_bag(tmp_path / "bag", messages(2))
        next(path.glob("*.mcap")).write_text(POINTER)
    else:
        path.write_text(POINTER)
    assert main(["import", str(path), "-o", str(tmp_path / "out.mcap")]) == 1
    error = capsys.readouterr().err
    assert "a Git LFS pointer" in error and "git lfs pull" in error and error.count("\n") == 1


# -- definitions


def test_definitions_of_topics_that_are_not_used_do_not_decide(tmp_path: Path) -> None:
    """Another topic brings a header of its own, with other fields."""
    header = "std_msgs/Header header\n" + "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\nstring frame_id\n"

    def change(writer: McapWriter) -> None:
        schema = writer.register_schema("odd_msgs/msg/Thing", "ros2msg", header.encode())
        writer.add_message(writer.register_channel("/odd", "cdr", schema), START, b"\0\1\0\0", START, 0)

    path = mcap(tmp_path / "bag.mcap", rows(), change)
    assert import_bag(path, tmp_path / "a.mcap", MAPPING).states == {"cart": 40}
    own = writer_definition()
    both = mcap(tmp_path / "both.mcap", rows(), lambda writer: all_of(writer, change, lambda each: define(each, own)))
    with Bag(both) as bag, pytest.raises(SessionError, match="expected one definition of std_msgs/msg/Header, got two"):
        bag.definitions(["/odd", "/own"])


def define(writer: McapWriter, text: str) -> None:
    schema = writer.register_schema("geometry_msgs/msg/PoseStamped", "ros2msg", text.encode())
    writer.add_message(writer.register_channel("/own", "cdr", schema), START, b"\0\1\0\0", START, 0)


def writer_definition() -> str:
    text, _ = STORE.generate_msgdef("geometry_msgs/msg/PoseStamped", ros_version=2)
    return str(text)
