"""Bombs in bags of other programs: the import refuses them in one line, in little time and memory."""

from __future__ import annotations

import io
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import session_mutations as mutations
import yaml
import zstandard
from foreign_bag import SECOND, START, odometry, write_bag
from mcap.opcode import Opcode
from mcap.writer import Writer
from processor_time import within
from rosbags.rosbag2 import StoragePlugin
from session_child import reset, resident

from collision_monitor.errors import InputError, SessionError
from collision_monitor.monitor.state import snapshot
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.session.mcap.layout import HEAD, MAGIC
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.decoding import Decoder

MIB = 1 << 20
TOPIC = "/odom"


def bag(path: Path, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """A folder with a bag of 20 messages; returns its data file."""
    still = ((0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0))
    messages = [(TOPIC, START + k * SECOND, odometry("map", START + k * SECOND, *still)) for k in range(20)]
    write_bag(path, messages, storage=storage)
    return next(path.glob("*.mcap" if storage is StoragePlugin.MCAP else "*.db3"))


def insert_chunk(file: Path, chunk: mutations.Record) -> None:
    """Put a chunk behind the header, without an index, so that it is read like a bag that was not indexed."""
    records = mutations.parse(file.read_bytes(), len(MAGIC))
    kept = [each for each in records if each.opcode in (Opcode.HEADER, Opcode.CHUNK, Opcode.DATA_END)]
    footer = mutations.Record(Opcode.FOOTER, bytes(20))
    file.write_bytes(mutations.make_file([kept[0], chunk, *kept[1:], footer]))


def zeros(folder: Path) -> None:
    insert_chunk(bag(folder), mutations.make_chunk(bytes(900 * MIB)))


def empty_records(folder: Path) -> None:
    insert_chunk(bag(folder), mutations.make_chunk(HEAD.pack(0x80, 0) * 6_000_000))


def repeated_index(folder: Path) -> None:
    """An index that names one chunk thousands of times."""
    file = bag(folder)
    data = file.read_bytes()
    records = mutations.parse(data, len(MAGIC))
    summary = 0
    at = len(MAGIC)
    for each in records:
        at += len(each.packed())
        if each.opcode == Opcode.DATA_END:
            summary = at
    index = next(each for each in records if each.opcode == Opcode.CHUNK_INDEX)
    end = next(k for k, each in enumerate(records) if each.opcode == Opcode.CHUNK_INDEX)
    records[end:end] = [index] * 5000
    records = [each for each in records if each.opcode != Opcode.SUMMARY_OFFSET]
    records[-1].content = struct.pack("<QQI", summary, 0, 0)
    file.write_bytes(mutations.make_file(records))


def quality(folder: Path) -> None:
    """A quality of service that expands to 10^9 values."""
    with (folder / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="bomb")
        schema = writer.register_schema("nav_msgs/msg/Odometry", "ros2msg", b"")
        text = "a: &a [1,1,1,1,1,1,1,1,1]\n" + "".join(
            f"{name}: &{name} [{','.join([f'*{last}'] * 9)}]\n"
            for last, name in zip("abcdefgh", "bcdefghi", strict=True)
        )
        channel = writer.register_channel(TOPIC, "cdr", schema, {"offered_qos_profiles": text})
        writer.add_message(channel, 1, b"\0\1\0\0", 1, 0)
        writer.finish()


def view(folder: Path) -> None:
    """A table of messages that has no end."""
    connection = sqlite3.connect(bag(folder, StoragePlugin.SQLITE3))
    connection.executescript(
        "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(id) "
        "AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
        "SELECT id, 1 AS topic_id, id AS timestamp, zeroblob(1000000) AS data FROM n;"
    )
    connection.commit()
    connection.close()


def packed_file(folder: Path) -> None:
    """A file of zeros, packed whole: 3 GiB."""
    file = bag(folder)
    file.unlink()
    packed = zstandard.ZstdCompressor().compress(bytes(64 * MIB)) * 48
    file.with_suffix(".mcap.zstd").write_bytes(packed)
    change_metadata(folder, "file", f"{file.name}.zstd")


def change_metadata(folder: Path, mode: str, name: str) -> None:
    path = folder / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    table = content["rosbag2_bagfile_information"]
    table |= {"compression_mode": mode, "compression_format": "zstd", "relative_file_paths": [name]}
    path.write_text(yaml.safe_dump(content))


BOMBS: dict[str, Callable[[Path], None]] = {
    "zeros": zeros,
    "empty records": empty_records,
    "a view in SQLite": view,
    "a packed file": packed_file,
}


HARMLESS: dict[str, tuple[Callable[[Path], None], int]] = {
    "an index that repeats a chunk": (repeated_index, 20),
    "quality of service": (quality, 1),
}
"""Bombs in what is not read, with the number of messages beside them."""


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_in_a_bag_is_refused(name: str, tmp_path: Path) -> None:
    BOMBS[name](tmp_path / "bag")
    reset()
    before = resident()
    with within(5, name), pytest.raises(SessionError, match="bag"), Bag(tmp_path / "bag") as opened:
        for _ in opened.messages([TOPIC]):
            pass
    assert resident() - before < 256


@pytest.mark.parametrize("name", HARMLESS)
def test_a_bomb_in_what_is_not_read_does_not_decide(name: str, tmp_path: Path) -> None:
    make, count = HARMLESS[name]
    folder = tmp_path / "bag"
    if make is quality:
        folder.mkdir()
    make(folder)
    reset()
    before = resident()
    with within(5, name), Bag(folder / "bag.mcap" if make is quality else folder) as opened:
        assert len(list(opened.messages([TOPIC]))) == count
    assert resident() - before < 256


def test_a_packed_message_that_is_a_bomb(tmp_path: Path) -> None:
    """rosbag2's compression of single messages: the whole ones are read, the bomb is refused."""
    file = bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    connection = sqlite3.connect(file)
    rows = connection.execute("SELECT id, data FROM messages ORDER BY id").fetchall()
    for number, data in rows:
        packed = zstandard.compress(data if number < rows[-1][0] else bytes(900 * MIB))
        connection.execute("UPDATE messages SET data = ? WHERE id = ?", (packed, number))
    connection.commit()
    connection.close()
    change_metadata(tmp_path / "bag", "message", file.name)
    found = []
    with Bag(tmp_path / "bag") as opened, pytest.raises(SessionError, match=f"{TOPIC}: expected a message of at most"):
        found += [message.data for message in opened.messages([TOPIC])]
    with Bag(tmp_path / "bag") as opened:
        first = next(iter(opened.messages([TOPIC])))
        assert Decoder(opened.definitions([TOPIC]))(first.type, first.data).header.frame_id == "map"


@pytest.mark.parametrize("kind", ["zeros", "many", "claims", "lzma", "deep facts"])
def test_a_snapshot_that_is_a_bomb(kind: str) -> None:
    out = io.BytesIO()
    facts = np.frombuffer(b"{}", np.uint8)
    if kind == "zeros":
        np.savez_compressed(out, facts=facts, a=np.zeros(snapshot.LARGEST + 1, np.uint8))
    elif kind == "many":
        np.savez_compressed(out, facts=facts, **{f"a{k}": np.zeros(1) for k in range(2000)})
    elif kind == "deep facts":
        np.savez_compressed(out, facts=np.frombuffer(b"[" * 1_000_000, np.uint8))
    else:
        with zipfile.ZipFile(out, "w", zipfile.ZIP_LZMA if kind == "lzma" else zipfile.ZIP_DEFLATED) as file:
            array = io.BytesIO()
            np.lib.format.write_array_header_1_0(
                array, {"descr": "<f8", "fortran_order": False, "shape": (1 << (4 if kind == "lzma" else 36),)}
            )
            file.writestr("facts.npy", array.getvalue() + bytes(8 << 4))
    reset()
    before = resident()
    with within(2, kind), pytest.raises(InputError, match="snapshot"):
        Snapshot.decode(out.getvalue())
    assert resident() - before < 64
