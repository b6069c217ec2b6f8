"""Damaged and hostile copies of session files: each from a seed alone, with a name of what was done to it."""

from __future__ import annotations

import io
import json
import random
import re
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode

from collision_monitor.session.mcap.layout import CHUNK_HEAD, HEAD, MAGIC, MESSAGE

NUMBERS = (0, 1, 2, 7, 22, 255, 1 << 15, (1 << 16) - 1, 1 << 31, (1 << 32) - 1, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)
"""Lengths, ids and times at which programs fail."""

MIB = 1 << 20


@dataclass
class Record:
    """A record: its content as it is, and the length that its head claims if that is another one."""

    opcode: int
    content: bytes
    claimed: int | None = None

    def packed(self) -> bytes:
        length = len(self.content) if self.claimed is None else self.claimed
        return HEAD.pack(self.opcode, length & ((1 << 64) - 1)) + self.content


Records = list[Record]


def parse(data: bytes, at: int = 0) -> Records:
    """Records of whole bytes, from an offset to the end or to the first bytes that are none."""
    found = []
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        if length > len(data) - at - HEAD.size:
            break
        found.append(Record(opcode, data[at + HEAD.size : at + HEAD.size + length]))
        at += HEAD.size + length
    return found


def join(records: Sequence[Record]) -> bytes:
    return b"".join(each.packed() for each in records)


def make_file(records: Sequence[Record]) -> bytes:
    return MAGIC + join(records) + MAGIC


def make_chunk(
    inner: bytes, compression: str = "zstd", *, checksum: int | None = None, size: int | None = None
) -> Record:
    """Chunk of packed records. checksum, size: of the head, if not the right ones."""
    pack = {"zstd": zstandard.ZstdCompressor(level=1).compress, "lz4": lz4.frame.compress, "": bytes}[compression]
    data = pack(inner)
    head = CHUNK_HEAD.pack(
        0, 0, len(inner) if size is None else size, zlib.crc32(inner) if checksum is None else checksum
    )
    name = compression.encode()
    return Record(Opcode.CHUNK, head + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(data)) + data)


def unpack_chunk(chunk: Record) -> bytes:
    (name,) = struct.unpack_from("<I", chunk.content, CHUNK_HEAD.size)
    begin = CHUNK_HEAD.size + 4 + name
    packed = chunk.content[begin + 8 :]
    if packed.startswith(b"\x28\xb5\x2f\xfd"):
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=64 * MIB)
    return bytes(lz4.frame.decompress(packed)) if packed.startswith(b"\x04\x22\x4d\x18") else packed


def repacked(data: bytes, compression: str) -> bytes:
    """The same session with its chunks packed otherwise; "none": its messages outside of chunks."""
    out: Records = []
    for each in parse(data, len(MAGIC)):
        if each.opcode in (Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.SUMMARY_OFFSET):
            continue
        if each.opcode != Opcode.CHUNK:
            out.append(each)
        elif compression == "none":
            out += parse(unpack_chunk(each))
        else:
            out.append(make_chunk(unpack_chunk(each), compression))
    return make_file([each for each in out if each.opcode != Opcode.FOOTER] + [Record(Opcode.FOOTER, bytes(20))])


def steady(data: bytes) -> bytes:
    """The same session without what differs from run to run: the ends of its chunks and the id of the recording."""
    out: Records = []
    inner: Records = []

    def close() -> None:
        for k in range(0, len(inner), 16):
            out.append(make_chunk(join(inner[k : k + 16])))
        inner.clear()

    for each in parse(data, len(MAGIC)):
        if each.opcode == Opcode.CHUNK:
            inner += parse(unpack_chunk(each))
        elif each.opcode in (Opcode.HEADER, Opcode.ATTACHMENT, Opcode.METADATA):
            close()
            out.append(Record(each.opcode, _RECORDING.sub(lambda found: found[1] + b"0" * len(found[2]), each.content)))
        elif each.opcode == Opcode.DATA_END:
            break
    close()
    return make_file([*out, Record(Opcode.DATA_END, bytes(4)), Record(Opcode.FOOTER, bytes(20))])


_RECORDING = re.compile(rb"(\x09\x00\x00\x00recording.\x00\x00\x00)([0-9a-f-]+)", re.DOTALL)


# -- bytes


def flip_bits(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def _span(data: bytes, rng: random.Random, longest: int = 5000) -> tuple[int, int]:
    begin = rng.randrange(len(data) + 1)
    return begin, min(len(data), begin + rng.randint(1, longest))


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def overwrite(data: bytes, rng: random.Random) -> bytes:
    begin, end = _span(data, rng)
    fill = rng.choice((b"\0", b"\xff", b"\x05", None))
    return data[:begin] + (rng.randbytes(end - begin) if fill is None else fill * (end - begin)) + data[end:]


def remove(data: bytes, rng: random.Random) -> bytes:
    begin, end = _span(data, rng)
    return data[:begin] + data[end:]


def insert(data: bytes, rng: random.Random) -> bytes:
    at, (begin, end) = rng.randrange(len(data) + 1), _span(data, rng)
    return data[:at] + rng.choice((rng.randbytes(end - begin), bytes(end - begin), data[begin:end])) + data[at:]


def numbers(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    size = rng.choice((2, 4, 8))
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(max(len(out) - size, 1))
        out[at : at + size] = (rng.choice(NUMBERS) & ((1 << 8 * size) - 1)).to_bytes(size, "little")
    return bytes(out)


BYTES: tuple[Callable[[bytes, random.Random], bytes], ...] = (flip_bits, cut, overwrite, remove, insert, numbers)


# -- records


def shuffle(records: Records, rng: random.Random) -> None:
    rng.shuffle(records)


def swap(records: Records, rng: random.Random) -> None:
    i, j = rng.randrange(len(records)), rng.randrange(len(records))
    records[i], records[j] = records[j], records[i]


def repeat(records: Records, rng: random.Random) -> None:
    each = rng.choice(records)
    records[(at := rng.randrange(len(records))) : at] = [each] * rng.choice((1, 3, 100))


def drop(records: Records, rng: random.Random) -> None:
    at = rng.randrange(len(records))
    del records[at : at + rng.choice((1, 1, 5))]


def length(records: Records, rng: random.Random) -> None:
    each = rng.choice(records)
    each.claimed = rng.choice((*NUMBERS, len(each.content) + rng.randint(-9, 9)))


def opcode(records: Records, rng: random.Random) -> None:
    rng.choice(records).opcode = rng.choice((*range(17), 0x80, 0xFF))


def content(records: Records, rng: random.Random) -> None:
    each = rng.choice(records)
    if each.content:
        each.content = rng.choice(BYTES)(each.content, rng)


def strange(records: Records, rng: random.Random) -> None:
    records.insert(rng.randrange(len(records)), Record(rng.randrange(256), rng.randbytes(rng.choice((0, 1, 30, 3000)))))


RECORDS: tuple[Callable[[Records, random.Random], None], ...] = (
    shuffle, swap, repeat, drop, length, opcode, content, strange,
)  # fmt: skip


# -- what a chunk holds, packed again with a right checksum


def in_chunk(records: Records, rng: random.Random) -> None:
    chunks = [each for each in records if each.opcode == Opcode.CHUNK]
    if not chunks:
        return in_message(records, rng)
    chunk = rng.choice(chunks)
    inner = parse(unpack_chunk(chunk))
    if not inner:
        return None
    for _ in range(rng.choice((1, 1, 3))):
        rng.choice((*RECORDS, in_message, in_message, in_message))(inner, rng)
        if not inner:
            break
    packed = join(inner)
    if rng.random() < 0.1:
        packed = rng.choice(BYTES)(packed or b"\0", rng)
    checksum = rng.choice((None, None, None, None, 0, 12345))
    chunk.content = make_chunk(packed, rng.choice(("zstd", "zstd", "lz4", "")), checksum=checksum).content
    return None


def in_message(records: Records, rng: random.Random) -> None:
    """Changes the fields or the data of a message, which the reader then accepts."""
    messages = [each for each in records if each.opcode == Opcode.MESSAGE and len(each.content) >= MESSAGE.size]
    if not messages:
        return
    each = rng.choice(messages)
    fields = list(MESSAGE.unpack_from(each.content))
    data = each.content[MESSAGE.size :]
    if rng.random() < 0.3:
        k = rng.randrange(4)
        limit = (1 << 16, 1 << 32, 1 << 64, 1 << 64)[k]
        fields[k] = rng.choice((*NUMBERS, fields[k] + rng.randint(-3, 3))) % limit
    elif data:
        data = rng.choice((*BYTES, numbers, numbers, doubles, doubles))(data, rng)
    each.content = MESSAGE.pack(*fields) + data


DOUBLES = (np.nan, np.inf, -np.inf, 5e-324, 1.7e308, -1.7e308, 1e300, 1e-300, 0.0, -0.0, 1e9, -1.0)


def doubles(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randint(1, 3)):
        at = 4 + 8 * rng.randrange(max((len(out) - 4) // 8, 1))
        out[at : at + 8] = struct.pack("<d", rng.choice(DOUBLES))
    return bytes(out)


# -- snapshots and metadata


def in_snapshot(records: Records, rng: random.Random) -> None:
    """Changes a snapshot, and removes messages before it so that a replay needs it."""
    places = [k for k, each in enumerate(records) if each.opcode == Opcode.ATTACHMENT]
    if not places:
        return
    at = rng.choice(places)
    head, data = _attached(records[at].content)
    records[at].content = _attachment(head, damaged_snapshot(data, rng))
    if rng.random() < 0.8:
        before = [k for k in range(at) if records[k].opcode in (Opcode.CHUNK, Opcode.MESSAGE)]
        for k in reversed(before[1:] if rng.random() < 0.8 else before):
            del records[k]


def _attached(content: bytes) -> tuple[bytes, bytes]:
    at = 16
    for _ in range(2):
        at += 4 + int.from_bytes(content[at : at + 4], "little")
    return content[:at], content[at + 8 : -4]


def _attachment(head: bytes, data: bytes) -> bytes:
    whole = head + struct.pack("<Q", len(data)) + data
    return whole + struct.pack("<I", zlib.crc32(whole))


def damaged_snapshot(data: bytes, rng: random.Random) -> bytes:
    if rng.random() < 0.3:
        return rng.choice(BYTES)(data, rng)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays: dict[str, Any] = {name: file[name] for name in file.files}
        facts = json.loads(arrays["facts"].tobytes())
    except Exception:  # damaged by a mutation before this one
        return data[: len(data) // 2]
    for _ in range(rng.choice((1, 1, 2, 5))):
        if rng.random() < 0.4:
            facts = _changed(facts, rng)
        else:
            name = rng.choice(list(arrays))
            if name != "facts":
                arrays[name] = _array(arrays[name], rng)
    arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    if rng.random() < 0.05:
        arrays["facts"] = np.frombuffer(b"[" * 100_000, np.uint8)
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def _array(array: Any, rng: random.Random) -> Any:
    array = np.array(array)
    kind = rng.randrange(6)
    if kind == 0:
        return array[: rng.randrange(len(array) + 1)] if array.ndim else array
    if kind == 1:
        return np.concatenate([array, array]) if array.ndim else array
    if kind == 2:
        return np.zeros(
            rng.choice(((), (0,), (1, 2, 3), (1 << 20,))), rng.choice((np.float64, np.int8, "U3", array.dtype))
        )
    raw = bytearray(array.tobytes())
    if raw:
        for _ in range(rng.choice((1, 4, 50))):
            size = rng.choice((1, 4, 8))
            at = rng.randrange(max(len(raw) // size, 1)) * size
            value = (
                struct.pack("<d", rng.choice(DOUBLES))
                if rng.random() < 0.5
                else rng.choice(NUMBERS).to_bytes(8, "little")
            )
            raw[at : at + size] = value[:size]
        array = np.frombuffer(bytes(raw[: array.nbytes]), array.dtype).reshape(array.shape)
    return array


VALUES = (
    None, True, -1, 0, 1, 1 << 31, 1 << 63, 1 << 70, 1e308, float("nan"), float("inf"), "", "x",
    "\0" * 300, [], {}, [1],
)  # fmt: skip


def _changed(value: Any, rng: random.Random) -> Any:
    """The same JSON value with one part replaced, removed or repeated."""
    if isinstance(value, dict) and value and rng.random() < 0.95:
        key = rng.choice(list(value))
        if rng.random() < 0.1:
            return {name: each for name, each in value.items() if name != key}
        return {**value, key: _changed(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        k = rng.randrange(len(value))
        return [*value[:k], _changed(value[k], rng), *value[k + 1 :]] if rng.random() < 0.8 else value * 2
    return rng.choice(VALUES)


def in_metadata(records: Records, rng: random.Random) -> None:
    places = [each for each in records if each.opcode == Opcode.METADATA]
    if not places:
        return
    each = rng.choice(places)
    at = 4 + int.from_bytes(each.content[:4], "little")
    name, raw = each.content[:at], each.content[at + 4 :]
    parts, at = [], 0
    while at + 4 <= len(raw):
        size = int.from_bytes(raw[at : at + 4], "little")
        parts.append(raw[at + 4 : at + 4 + size])
        at += 4 + size
    if not parts:
        return
    k = rng.randrange(len(parts))
    try:
        parts[k] = json.dumps(_changed(json.loads(parts[k]), rng)).encode()
    except (ValueError, RecursionError):
        parts[k] = rng.choice((b"", b"\xff", b"[" * 100_000, b"9" * 5000, b"-1", b"x" * 100_000, b"{}", b"null"))
    raw = b"".join(struct.pack("<I", len(part)) + part for part in parts)
    each.content = name + struct.pack("<I", len(raw)) + raw


# -- bombs


def zeros(rng: random.Random) -> Record:
    return make_chunk(bytes(rng.choice((16, 63, 65, 400)) * MIB), rng.choice(("zstd", "lz4")))


def empty_records(rng: random.Random) -> Record:
    return make_chunk(HEAD.pack(rng.choice((0x80, 0x07, 0xFF)), 0) * rng.choice((100_000, 6_000_000)))


def tiny_messages(rng: random.Random) -> Record:
    number = rng.choice((0, 1, 77))
    return make_chunk(Record(Opcode.MESSAGE, MESSAGE.pack(number, 0, 0, 0)).packed() * rng.choice((50_000, 1_500_000)))


def large_message(rng: random.Random) -> Record:
    size = rng.choice((60, 200, 400)) * MIB
    return make_chunk(Record(Opcode.MESSAGE, MESSAGE.pack(rng.randrange(4), 0, 0, 0) + bytes(size)).packed())


def definitions(rng: random.Random) -> Record:
    kind = rng.choice((Opcode.SCHEMA, Opcode.CHANNEL))
    text = struct.pack("<I", size := rng.choice((10, 1000, 900_000))) + b"x" * size
    count = rng.choice((60, 3_000_000 // size)) if size < 900_000 else 60
    heads = (struct.pack("<H", k & 0xFFFF) + (b"\0\0" if kind == Opcode.CHANNEL else b"") for k in range(count))
    return make_chunk(join([Record(kind, head + text + text + struct.pack("<I", 0)) for head in heads]))


def stated(rng: random.Random) -> Record:
    """A chunk that states a size that it has not."""
    return make_chunk(bytes(1000), size=rng.choice(NUMBERS), checksum=rng.choice((None, 0)))


def window(rng: random.Random) -> Record:
    """A zstd frame that demands a window of 2 GiB and has no stated size."""
    chunk = make_chunk(b"")
    frame = b"\x28\xb5\x2f\xfd\x00" + bytes([(31 - 10) << 3]) + b"\x01\x00\x00"
    head = chunk.content[: CHUNK_HEAD.size + 8]
    return Record(Opcode.CHUNK, head + struct.pack("<Q", len(frame)) + frame)


def many_zeros(rng: random.Random) -> Record:
    return make_chunk(make_chunk(bytes(8 * MIB)).packed() * 1000, "")


BOMBS = (zeros, empty_records, tiny_messages, large_message, definitions, stated, window, many_zeros)


def bomb(records: Records, rng: random.Random) -> None:
    each = rng.choice(BOMBS)(rng)
    at = rng.choice((1, 2, rng.randrange(len(records) + 1)))
    records[at:at] = [each] * rng.choice((1, 1, 1, 1, 30))


def snapshot_bomb(records: Records, rng: random.Random) -> None:
    """A snapshot whose arrays are long and empty."""
    places = [k for k, each in enumerate(records) if each.opcode == Opcode.ATTACHMENT]
    if not places:
        return
    at = rng.choice(places)
    head, _ = _attached(records[at].content)
    out = io.BytesIO()
    np.savez_compressed(out, facts=np.zeros(2, np.uint8), many=np.zeros(rng.choice((1, 10, 300)) * MIB, np.uint8))
    records[at].content = _attachment(head, out.getvalue())
    for k in reversed([k for k in range(at) if records[k].opcode in (Opcode.CHUNK, Opcode.MESSAGE)][1:]):
        del records[k]


# -- one file


def mutate(bases: Sequence[bytes], seed: int) -> tuple[bytes, str]:
    """File of a seed, and what was done."""
    rng = random.Random(seed)
    data = rng.choice(bases)
    done = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        kind = rng.random()
        if kind < 0.25 and data:
            change = rng.choice(BYTES)
            data = change(data, rng)
            done.append(change.__name__)
            continue
        if kind < 0.28:
            other = rng.choice(bases)
            data = data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other)) :]
            done.append("splice")
            continue
        records = parse(data, len(MAGIC))
        if not records:
            continue
        act: Callable[[Records, random.Random], Any]
        if kind < 0.45:
            act = rng.choice(RECORDS)
        elif kind < 0.72:
            act = in_chunk
        elif kind < 0.90:
            act = in_snapshot
        elif kind < 0.98:
            act = in_metadata
        elif kind < 0.99:
            act = bomb
        else:
            act = snapshot_bomb
        try:
            act(records, rng)
        except (struct.error, ValueError, zstandard.ZstdError, RuntimeError):
            continue  # a change before this one left nothing to change
        done.append(act.__name__)
        data = make_file(records)
    return data, "+".join(done) or "nothing"
