"""Damaged and hostile copies of sessions: each reader answers, or refuses with a text, within limits."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import session_mutations as mutations
from fuzz_sessions import Child, make_bases, run
from mcap.opcode import Opcode
from session_mutations import MAGIC, MIB, Record, make_chunk, make_file, mutate, parse

from collision_monitor.session import Session
from collision_monitor.session.mcap.layout import HEAD, MESSAGE
from collision_monitor.session.mcap.salvage import salvage

FILES = 100


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("attacks")


@pytest.fixture(scope="module")
def bases(folder: Path) -> list[bytes]:
    return make_bases(folder)


def test_mutated_sessions(folder: Path, bases: list[bytes]) -> None:
    found = run(range(FILES), bases, folder, child_files=FILES)
    assert found.problems == {}
    assert found.files == FILES
    # the mutations reach every way in which a replay can end
    for way in ("IDENTICAL", "DIVERGED", "NOT_COMPARABLE", "SessionError"):
        assert found.outcomes[f"replayed: {way}"] > FILES // 50, found.outcomes


def test_a_seed_always_gives_the_same_file(bases: list[bytes]) -> None:
    assert [mutate(bases, seed) for seed in range(9)] == [mutate(bases, seed) for seed in range(9)]
    names = {name for seed in range(300) for name in mutate([bases[0][:20000]], seed)[1].split("+")}
    assert {"flip_bits", "cut", "splice", "shuffle", "length", "in_chunk", "in_snapshot", "in_metadata"} <= names


def _messages(count: int) -> bytes:
    return Record(Opcode.MESSAGE, MESSAGE.pack(1, 0, 0, 0)).packed() * count


def _long_message(size: int, count: int = 1) -> bytes:
    return Record(Opcode.MESSAGE, MESSAGE.pack(1, 0, 0, 0) + bytes(size)).packed() * count


def _schema(number: int, size: int) -> bytes:
    text = b"x" * size
    fields = b"".join(len(each).to_bytes(4, "little") + each for each in (b"name", b"ros2msg", text))
    return Record(Opcode.SCHEMA, number.to_bytes(2, "little") + fields).packed()


BOMBS = {
    "zeros": lambda: [make_chunk(bytes(900 * MIB))],  # 29 KB that were walked as 10^8 empty records
    "zeros, lz4": lambda: [make_chunk(bytes(300 * MIB), "lz4")],
    "many chunks of zeros": lambda: [make_chunk(bytes(60 * MIB))] * 30,
    "empty records": lambda: [make_chunk(HEAD.pack(0x80, 0) * 7_000_000)] * 3,
    "empty records, lz4": lambda: [make_chunk(HEAD.pack(0x80, 0) * 7_000_000, "lz4")],
    "unknown records": lambda: [make_chunk((HEAD.pack(0x90, 1000) + bytes(1000)) * 60_000)] * 5,
    "tiny messages": lambda: [make_chunk(_messages(2_000_000))] * 3,
    "a message of 800 MiB": lambda: [
        make_chunk(Record(Opcode.MESSAGE, MESSAGE.pack(1, 0, 0, 0) + bytes(800 * MIB)).packed())
    ],
    "messages of 10 MiB": lambda: [make_chunk(_long_message(10 * MIB, 50))],
    "long schemas": lambda: [make_chunk(b"".join(_schema(k + 9 * n, 1_000_000) for k in range(9))) for n in range(30)],
    "schemas without end": lambda: [make_chunk(b"".join(_schema(k % 65536, 0) for k in range(200_000)))],
    "a stated size of 2^63": lambda: [make_chunk(bytes(100), size=1 << 63)],
    "a window of 2 GiB": lambda: [mutations.window(None)],
    "a chunk in a chunk": lambda: [make_chunk(make_chunk(bytes(8 * MIB)).packed() * 2000, "")],
    "long metadata": lambda: [Record(Opcode.METADATA, b"\xff\xff\xff\x7f" + bytes(20))],
    "a length of 2^62": lambda: [Record(Opcode.ATTACHMENT, bytes(50), claimed=1 << 62)],
    "zeros between records": lambda: [Record(0, b"")] * 100_000,
    "empty records outside of chunks": lambda: [Record(0x80, b"")] * 100_000,
    "candidates of records": lambda: [Record(0x55, b"\x05\x17\0\0\0\0\0\0\0" * 100_000, claimed=1 << 50)],
}


@pytest.fixture(scope="module")
def child(folder: Path, bases: list[bytes]):
    child = Child(folder / "base.mcap")
    yield child
    child.close()


@pytest.mark.parametrize("name", BOMBS)
def test_bomb(name: str, bases: list[bytes], folder: Path, child: Child) -> None:
    """Each reader takes 5 s and 256 MiB at most, and keeps what the session says besides."""
    records = parse(bases[0], len(MAGIC))
    path = folder / "bomb.mcap"
    path.write_bytes(make_file([*records[:3], *BOMBS[name](), *records[3:]]))
    answer = child.read(path)
    assert answer is not None, child.close()
    assert answer["problem"] == "", json.dumps(answer)


@pytest.mark.parametrize("name", ["zeros", "empty records, lz4", "tiny messages", "a message of 800 MiB"])
def test_the_rest_of_the_session_is_kept(name: str, bases: list[bytes], tmp_path: Path) -> None:
    records = parse(bases[0], len(MAGIC))
    (tmp_path / "whole.mcap").write_bytes(bases[0])
    (tmp_path / "bomb.mcap").write_bytes(make_file([*records[:3], *BOMBS[name](), *records[3:]]))
    session = Session(tmp_path / "bomb.mcap")
    assert list(session.messages()) == list(Session(tmp_path / "whole.mcap").messages())
    assert session.damage and "the chunk of" in session.damage[0]
    result = salvage(tmp_path / "bomb.mcap", tmp_path / "out.mcap")
    assert result.losses and "the chunk of" in result.losses[0]
    assert list(Session(tmp_path / "out.mcap").messages()) == list(Session(tmp_path / "whole.mcap").messages())
