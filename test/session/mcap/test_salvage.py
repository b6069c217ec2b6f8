"""Salvage recovers every complete message of a file that was cut, zeroed or bit-flipped anywhere, and nothing else."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from processor_time import within
from rosbags.highlevel import AnyReader
from session_scene import record

from collision_monitor.cli.main import main
from collision_monitor.errors import SessionError
from collision_monitor.session import Session
from collision_monitor.session.mcap.layout import SALVAGE
from collision_monitor.session.mcap.salvage import salvage
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict

STEP = 10_000_000
"""Time between two messages (ns)."""
PROGRAM = Path(sys.executable).with_name("collision-monitor")


def write(
    path: Path, compression: CompressionType = CompressionType.ZSTD, chunked: bool = True, count: int = 12
) -> Path:
    """Write a small file of small chunks, with two topics."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=256, compression=compression, use_chunking=chunked)
        writer.start(profile="ros2", library="collision_monitor test")
        writer.add_metadata("collision_monitor", {"kept": "yes"})
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", "/b")]
        for k in range(count):
            data = bytes((k * 37 + j * j) % 251 for j in range(60))
            writer.add_message(channels[k % 2], STEP * k, data, STEP * k + 5, k)
        writer.finish()
    return path


def messages(path: Path) -> list[tuple]:
    with path.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(c.topic, m.sequence, m.log_time, m.publish_time, m.data) for _, c, m in found]


FORMATS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "plain": {"compression": CompressionType.NONE},
    "unchunked": {"chunked": False},
}


@pytest.fixture(params=FORMATS)
def whole(request, tmp_path: Path) -> Path:
    return write(tmp_path / "whole.mcap", **FORMATS[request.param])


def test_a_whole_file_is_copied(whole: Path, tmp_path: Path) -> None:
    result = salvage(whole, tmp_path / "out.mcap")
    assert result.losses == []
    assert messages(tmp_path / "out.mcap") == messages(whole)
    with (tmp_path / "out.mcap").open("rb") as stream:
        metadata = {m.name: m.metadata for m in make_reader(stream).iter_metadata()}
    assert metadata == {"collision_monitor": {"kept": "yes"}}


@pytest.mark.parametrize(("kind", "step"), [("zstd", 1), ("lz4", 7), ("plain", 7), ("unchunked", 7)])
def test_every_cut_point(kind: str, step: int, tmp_path: Path) -> None:
    """Every byte for the recorded format; the others differ only in how a chunk is unpacked."""
    whole = write(tmp_path / "whole.mcap", count=8, **FORMATS[kind])
    data, out = whole.read_bytes(), tmp_path / "out.mcap"
    all_messages = messages(whole)
    recovered = []
    for size in [*range(1, len(data) - 1, step), len(data) - 1]:
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[:size])
        try:
            result = salvage(cut, out, overwrite=True)
        except SessionError:
            recovered.append(0)
            continue
        found = messages(out)
        assert result.losses or found == all_messages, size
        assert found == all_messages[: len(found)], size
        recovered.append(len(found))
    assert recovered == sorted(recovered), "a longer file never gives fewer messages"
    assert recovered[-1] == len(all_messages)
    assert recovered[len(recovered) // 2] > 0


def test_zero_filled_ranges_cost_only_what_they_cover(whole: Path, tmp_path: Path) -> None:
    data, out = whole.read_bytes(), tmp_path / "out.mcap"
    all_messages = messages(whole)
    whole_is_checked = salvage(whole, out).unverified == 0
    for begin in range(0, len(data), 61):
        hurt = bytearray(data)
        hurt[begin : begin + 64] = bytes(len(hurt[begin : begin + 64]))
        (tmp_path / "hurt.mcap").write_bytes(hurt)
        result = salvage(tmp_path / "hurt.mcap", out, overwrite=True)
        found = messages(out)
        if whole_is_checked:
            assert set(found) <= set(all_messages)
            assert len(found) >= len(all_messages) - 6, "two chunks at most"
        else:  # no checksum shows a message unchanged, so none counts as verified; two or three are hit
            assert len(set(found) - set(all_messages)) <= 3
            assert result.unverified == len(found)
        if len(found) < len(all_messages):
            assert result.losses


@pytest.mark.parametrize("kind", [*FORMATS][:3])
def test_a_flipped_bit_costs_its_chunk_at_most(tmp_path: Path, kind: str) -> None:
    whole = write(tmp_path / "whole.mcap", count=8, **FORMATS[kind])
    data, out = whole.read_bytes(), tmp_path / "out.mcap"
    all_messages = set(messages(whole))
    for bit in range(0, len(data) * 8, 23):
        hurt = bytearray(data)
        hurt[bit // 8] ^= 1 << (bit % 8)
        (tmp_path / "hurt.mcap").write_bytes(hurt)
        result = salvage(tmp_path / "hurt.mcap", out, overwrite=True)
        found = {(*each[1:],) for each in messages(out)}  # the flip may have hit the name of a topic
        assert found <= {(*each[1:],) for each in all_messages}, bit
        assert len(found) >= len(all_messages) - 3, bit
        assert result.losses or len(found) == len(all_messages), bit


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from([*FORMATS][:3]),
    st.lists(st.tuples(st.floats(0, 1), st.integers(0, 7)), min_size=1, max_size=6),
)
def test_flipped_bits_never_make_a_message(tmp_path_factory, kind, flips) -> None:
    """In chunks with checksums. Without them, nothing can reveal a flipped bit in a message's bytes."""
    folder = tmp_path_factory.mktemp("flip")
    whole = write(folder / "whole.mcap", **FORMATS[kind])
    hurt = bytearray(whole.read_bytes())
    for place, bit in flips:
        hurt[int(place * (len(hurt) - 1))] ^= 1 << bit
    (folder / "hurt.mcap").write_bytes(hurt)
    try:
        result = salvage(folder / "hurt.mcap", folder / "out.mcap")
    except SessionError:
        return
    true = {each[1:]: each[0] for each in messages(whole)}
    found = messages(folder / "out.mcap")
    # the flips may have hit the name of a topic
    assert all(each[1:] in true for each in found)
    if len(found) < len(true):
        assert result.losses


def test_what_cannot_be_trusted_is_left_out_unless_asked_for(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap", CompressionType.NONE)
    hurt = bytearray(whole.read_bytes())
    at = hurt.index(messages(whole)[5][4])
    hurt[at + 3] ^= 1
    (tmp_path / "hurt.mcap").write_bytes(hurt)
    careful = salvage(tmp_path / "hurt.mcap", tmp_path / "out.mcap")
    assert any("cannot be trusted" in loss for loss in careful.losses)
    assert "messages 5 to 7, from 0.040 s to 0.080 s, are not there" in careful.losses
    assert "in it were, by the index behind it, 1 of /a, 2 of /b" in careful.losses
    assert any("as the summary has them" in loss for loss in careful.losses)
    bold = salvage(tmp_path / "hurt.mcap", tmp_path / "out.mcap", unverified=True, overwrite=True)
    assert bold.messages == 12 > careful.messages
    assert bold.unverified == 12 - careful.messages
    assert careful.unverified == 0
    (doubt,) = [note for note in bold.notes if "no checksum" in note]
    assert doubt.startswith("messages 5 to 7, from 0.050 s to 0.070 s")
    with (tmp_path / "out.mcap").open("rb") as stream:
        (note,) = [m for m in make_reader(stream).iter_metadata() if m.name == SALVAGE]
    assert "cannot be trusted" in note.metadata["losses"]


def test_another_program_s_file_is_copied_as_it_is(tmp_path: Path) -> None:
    """Its profile, its attachments, and sequence numbers that count by topic are no losses."""
    with (tmp_path / "whole.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="other", library="other")
        schema = writer.register_schema("x", "ros2msg", b"")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", "/b")]
        writer.add_attachment(1, 2, "map.png", "image/png", b"pixels")
        for k in range(20):
            writer.add_message(channels[k % 4 == 3], k, b"1234", k, k // 4 if k % 4 == 3 else k)
        writer.finish()
    result = salvage(tmp_path / "whole.mcap", tmp_path / "out.mcap")
    assert (result.losses, result.notes) == ([], [])
    assert messages(tmp_path / "out.mcap") == messages(tmp_path / "whole.mcap")
    with (tmp_path / "out.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "other"
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("map.png", b"pixels")]


def test_what_the_summary_names_and_is_gone_is_said(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap")
    hurt = bytearray(whole.read_bytes())
    hurt[hurt.index(b"collision_monitor", 60) - 4] ^= 0x40  # the length of the metadata's name
    (tmp_path / "hurt.mcap").write_bytes(hurt)
    result = salvage(tmp_path / "hurt.mcap", tmp_path / "out.mcap")
    assert result.messages == 12
    assert any("metadata or attachments named 'collision_monitor'" in loss for loss in result.losses)


def test_damage_that_costs_nothing_is_a_note(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap")
    hurt = bytearray(whole.read_bytes())
    hurt[0] ^= 1
    (tmp_path / "hurt.mcap").write_bytes(hurt)
    result = salvage(tmp_path / "hurt.mcap", tmp_path / "out.mcap")
    assert result.losses == []
    assert any("the file begins with" in note for note in result.notes)


GARBAGE = {
    "messages": lambda n: b"".join(b"\x05" + struct.pack("<Q", n // 2) + b"\xff" for _ in range(n // 10)),
    "chunks": lambda n: b"".join(b"\x06" + struct.pack("<Q", n // 2) for _ in range(n // 9)),
    "chunks that claim to be plain": lambda n: b"".join(
        b"\x06" + struct.pack("<QQQQIIQ", 1 << 40, 0, 1, 1 << 60, 5, 0, n // 2) for _ in range(n // 49)
    ),
    "small numbers": lambda n: b"".join(struct.pack("<Q", k % 19) for k in range(n // 8)),
}


@pytest.mark.parametrize("kind", GARBAGE)
def test_garbage_ends_in_time_that_grows_with_its_size(tmp_path: Path, kind: str) -> None:
    """Each possible start of a record claims half of the file. To examine that much each time would take minutes."""
    (tmp_path / "garbage.mcap").write_bytes(b"\x89MCAP0\r\n\xff" + GARBAGE[kind](8_000_000))
    with within(30, kind), pytest.raises(SessionError, match="found none that is whole"):
        salvage(tmp_path / "garbage.mcap", tmp_path / "out.mcap")
    assert [*tmp_path.iterdir()] == [tmp_path / "garbage.mcap"]


def test_a_killed_recording_replays_after_salvage(tmp_path: Path) -> None:
    record(tmp_path / "run.mcap")
    data = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: data.rindex(b"\x0f\x04\0\0\0\0\0\0\0") + 5])
    result = salvage(tmp_path / "cut.mcap", tmp_path / "out.mcap")
    assert result.messages > 10
    report = replay(Session(tmp_path / "out.mcap"))
    assert report.verdict is Verdict.IDENTICAL
    assert report.messages == result.messages
    with AnyReader([tmp_path / "out.mcap"]) as reader:
        assert sum(1 for _ in reader.messages()) == result.messages


def test_a_later_file_of_a_recording_begins_where_it_begins(tmp_path: Path) -> None:
    with (tmp_path / "part_1.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="collision_monitor test")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("x", "ros2msg", b""))
        for k in range(500, 510):
            writer.add_message(channel, k, b"1234", k, k)
        writer.finish()
    result = salvage(tmp_path / "part_1.mcap", tmp_path / "out.mcap")
    assert (result.messages, result.losses, result.notes) == (10, [], [])


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = write(tmp_path / "whole.mcap")

    def run(*arguments: object) -> tuple[int, str, str]:
        return main(["salvage", *map(str, arguments)]), *capsys.readouterr()

    out = tmp_path / "out.mcap"
    assert run(whole, "-o", out)[0] == 0
    code, _, error = run(whole, "-o", out)
    assert code == 1
    assert "expected a new file" in error
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:1000])
    command = [PROGRAM, "salvage", tmp_path / "cut.mcap", "-o", out, "--force"]
    lossy = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert lossy.returncode == 3
    assert "lost " in lossy.stdout and "was not closed" in lossy.stdout
    for name, content in (("empty.mcap", b""), ("text.mcap", b"hello\n" * 1000), ("zero.mcap", bytes(100_000))):
        (tmp_path / name).write_bytes(content)
        code, _, error = run(tmp_path / name, "-o", tmp_path / "none.mcap")
        assert code == 1
        assert error.count("\n") == 1
        assert not (tmp_path / "none.mcap").exists()
    assert run(whole, "-o", whole, "--force")[0] == 1
    assert len(messages(whole)) == 12


def test_the_rest_of_an_interrupted_salvage_can_be_salvaged(whole: Path, tmp_path: Path) -> None:
    """The unfinished copy beside the target must not have the name of the damaged file."""
    rest = tmp_path / "out.mcap.part"
    rest.write_bytes(whole.read_bytes())
    assert salvage(rest, tmp_path / "out.mcap").messages == 12
    assert rest.read_bytes() == whole.read_bytes()
    assert sorted(tmp_path.glob("out*")) == [tmp_path / "out.mcap", rest]
