"""The reader: whole, cut and damaged sessions, and files that are no session."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from session_scene import CONTACTS, NODE, SHAPES, STATES, STATUS, TYPES, inputs, record

from collision_monitor.errors import SessionError
from collision_monitor.session import Session
from collision_monitor.session.mcap.layout import HEAD, MAGIC


def test_a_finished_session_reads_as_it_was_written(recorded: Path) -> None:
    session = Session(recorded)
    messages = list(session.messages())
    assert session.damage == []
    assert (session.frame_id, session.profile.name, session.metadata["node"]) == ("world", "balanced", NODE)
    assert [m.sequence for m in messages] == list(range(len(messages)))
    given_inputs = list(inputs(50))
    assert [(m.topic, m.data) for m in messages if m.topic in (SHAPES, STATES)] == given_inputs
    assert messages[0].topic == STATUS
    assert session.position == session.size == recorded.stat().st_size
    with recorded.open("rb") as file:
        theirs = [(c.topic, m.data) for _, c, m in make_reader(file).iter_messages(log_time_order=False)]
    assert theirs == [(m.topic, m.data) for m in messages]


def test_a_folder_with_one_file_is_read(tmp_path: Path, recorded: Path) -> None:
    with pytest.raises(SessionError, match=r"expected a folder with .mcap files, got none in it"):
        Session(tmp_path)
    shutil.copy(recorded, tmp_path / "x_0.mcap")
    assert len(list(Session(tmp_path).messages())) == len(list(Session(recorded).messages()))


def chunked(path: Path, messages: int = 60, per_chunk: int = 10) -> list[int]:
    """Write a session with several chunks. Return the end of each in the file."""
    from collision_monitor.session.mcap.layout import METADATA

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        writer.add_metadata(METADATA, {"profile": "{}", "frame_id": "world"})
        schema = writer.register_schema("collision_monitor_msgs/msg/ObjectStateArray", "ros2msg", b"")
        channel = writer.register_channel("/s", "cdr", schema)
        ends = []
        for k in range(messages):
            writer.add_message(channel, k, k.to_bytes(4, "little") * 50, k, k)
            if k % per_chunk == per_chunk - 1:
                writer.flush()
                ends.append(file.tell())
        writer.finish()
    return ends


def test_every_cut_gives_every_complete_chunk(tmp_path: Path) -> None:
    path, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    ends = chunked(path)
    data = path.read_bytes()
    opened = 0
    for length in range(8, len(data), 3):
        cut.write_bytes(data[:length])
        try:
            session = Session(cut)
        except SessionError:
            assert not opened, "once the metadata is there, it opens"
            continue
        opened += 1
        messages = list(session.messages())
        assert [m.sequence for m in messages] == list(range(len(messages)))
        assert len(messages) // 10 >= sum(end <= length for end in ends)
        if length <= ends[-1]:
            assert session.damage
    assert opened > len(data) // 6


def test_a_flipped_bit_costs_its_chunk_and_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    ends = chunked(path)
    data = bytearray(path.read_bytes())
    data[ends[1] + 100] ^= 4  # in the third chunk's data
    path.write_bytes(data)
    session = Session(path)
    sequences = [m.sequence for m in session.messages()]
    assert sequences == [*range(20), *range(30, 60)]
    (damage,) = session.damage
    assert "the chunk of" in damage
    assert "its checksum is wrong" in damage


@given(st.data())
def test_no_bytes_make_the_reader_raise_anything_else(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed.mcap"
    chunked(path, 20, 5)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=9))
        if not content:
            break
    path.write_bytes(content)
    try:
        list(Session(path).messages())
    except SessionError:
        return


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "the file is empty"),
        (b"hello world, this is text", "it begins with b'hello wo'"),
        (b"\x89MCAP0\r\n", "without its"),
    ],
)
def test_what_is_no_session_is_named(tmp_path: Path, content: bytes, text: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(SessionError, match="expected") as error:
        Session(path)
    assert text in str(error.value)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="expected a session file, got nothing there"):
        Session(tmp_path / "none.mcap")


def write(path: Path, *, metadata: dict[str, str] | None, schema: str, encoding: str = "cdr") -> None:
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start("ros2", "test")
        if metadata is not None:
            writer.add_metadata("collision_monitor", metadata)
        number = writer.register_schema(schema, "ros2msg", b"") if schema else 0
        channel = writer.register_channel("/camera/image", encoding, number)
        writer.add_message(channel, 1, b"\0\1\0\0", 1, 0)
        writer.finish()


def test_a_foreign_recording_is_recognized_by_its_topics(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", metadata=None, schema="sensor_msgs/msg/Image")
    with pytest.raises(SessionError, match="topics /camera/image; record one with"):
        Session(tmp_path / "a.mcap")


def test_topics_without_a_schema_are_reported(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", metadata=None, schema="")
    with pytest.raises(SessionError, match="/camera/image, 1 of them without the schema that says what type"):
        Session(tmp_path / "a.mcap")


def test_a_foreign_encoding_is_named(tmp_path: Path) -> None:
    write(
        tmp_path / "a.mcap",
        metadata={"profile": "{}"},
        schema="collision_monitor_msgs/msg/ContactArray",
        encoding="json",
    )
    with pytest.raises(SessionError, match="/camera/image encoded as cdr, got 'json'"):
        list(Session(tmp_path / "a.mcap").messages())


@pytest.mark.parametrize("profile", [None, "{", "[]", '{"horizon": -1}', '{"unheard_of": 1}', '{"horizon": "x"}'])
def test_a_profile_that_cannot_be_used_is_named(tmp_path: Path, profile: str | None) -> None:
    write(tmp_path / "a.mcap", metadata={} if profile is None else {"profile": profile}, schema="")
    with pytest.raises(SessionError, match="profile"):
        Session(tmp_path / "a.mcap")


def test_a_session_of_a_process_that_died_reads_as_far_as_it_goes(tmp_path: Path) -> None:
    recorder = record(tmp_path / "a.mcap", 20, close=False)
    import time

    time.sleep(0.6)
    session = Session(tmp_path / "a.mcap")
    messages = list(session.messages())
    assert len(messages) == recorder.status()["recorded_messages"] > 20
    assert session.damage == ["the recording was not closed: it ends without a summary"]
    assert CONTACTS in {m.topic for m in messages}
    assert {m.topic for m in messages} <= set(TYPES)
    recorder.close()


def test_a_chunk_that_was_taken_out_is_noticed_by_the_summary(tmp_path: Path) -> None:
    """Nothing else shows it in a file whose messages have no numbers of ours."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1)
        writer.start("ros2", "another recorder")
        schema = writer.register_schema("collision_monitor_msgs/msg/ObjectStateArray", "ros2msg", b"")
        channel = writer.register_channel("/m/objects/states", "cdr", schema)
        for k, (topic, data) in enumerate(inputs(10)):
            if topic == STATES:
                writer.add_message(channel, k, data, k, 0)
        writer.finish()
    whole = path.read_bytes()
    session = Session(path)
    count = len(list(session.messages()))
    assert session.damage == []
    begin, end = chunk_spans(whole)[3]
    summary = int.from_bytes(whole[-28:-20], "little") - (end - begin)
    path.write_bytes(whole[:begin] + whole[end:-28] + summary.to_bytes(8, "little") + whole[-20:])
    session = Session(path)
    assert len(list(session.messages())) == count - 1
    assert session.damage == [f"its summary states {count} messages, there are {count - 1}"]


def chunk_spans(data: bytes) -> list[tuple[int, int]]:
    """Begin and end of each chunk of a file."""
    found = []
    at = len(MAGIC)
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        if opcode == Opcode.CHUNK:
            found.append((at, at + HEAD.size + length))
        at += HEAD.size + length
        if opcode == Opcode.FOOTER:
            return found
    return found
