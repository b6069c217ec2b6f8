"""PLY: a head that describes elements and their properties, then their values as text or as binary numbers.

Source: Greg Turk, The PLY Polygon File Format (1994).
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.faces import triangles_of
from collision_monitor.shapes.mesh_formats.raw_mesh import Array, Indices, RawMesh, check_words

_TYPES: Final = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip

_ORDERS: Final = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

_LONGEST_HEAD: Final = 1 << 16
"""Bytes of the head. That of a scan with 20 properties has 1,000."""

_RINGS: Final = ("vertex_indices", "vertex_index")
"""Names of the property that holds the corners of a face."""


@dataclass
class _Element:
    """An element such as `vertex`. properties: name -> type of its value, and of its length if it is a list."""

    name: str
    count: int
    properties: dict[str, tuple[str, str]] = field(default_factory=dict)


@dataclass
class _Values:
    """The values of an element: a column for each property; for a list the lengths, and all values one by one."""

    columns: dict[str, NDArray[Any]] = field(default_factory=dict)
    lengths: dict[str, Indices] = field(default_factory=dict)


def read_ply(data: bytes) -> RawMesh:
    """Return the polygons and strips of triangles of a file. Raises ShapeError."""
    order, elements, begin = _head(data)
    body: _Text | _Binary = _Text(data[begin:]) if not order else _Binary(data, begin, order)
    values = {element.name: body.read(element) for element in elements}
    if body.left:
        raise ShapeError(f"expected the elements of its head, got {body.left} {body.unit} behind them")
    vertex = values.get("vertex", _Values())
    if missing := [axis for axis in "xyz" if axis not in vertex.columns or axis in vertex.lengths]:
        raise ShapeError(f"expected vertices with x, y and z, got none with {', '.join(missing)}")
    vertices: Array = np.stack([vertex.columns[axis].astype(np.float64) for axis in "xyz"], axis=1)
    rings = _rings(values.get("face"), len(vertices), 0)
    strips = _rings(values.get("tristrips"), len(vertices), -1)
    return RawMesh(vertices, np.concatenate([triangles_of(vertices, *rings), _of_strips(*strips)]))


def _head(data: bytes) -> tuple[str, list[_Element], int]:
    """Return the order of bytes (empty: text), the elements, and where they begin."""
    end = re.search(rb"(?m)^end_header[ \t]*(\r\n|\n|\r)", data[:_LONGEST_HEAD])
    lines = [line.split() for line in data[: end.start() if end else 0].decode("latin-1").splitlines()]
    if not end or not lines or lines[0] != ["ply"]:
        raise ShapeError("expected a head from `ply` to `end_header`, got none")
    order, elements = None, list[_Element]()
    for number, words in enumerate(lines[1:], start=2):
        match words:
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", name, "1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(_Element(name, int(count)))
            case ["property", "list", length, kind, name] if elements and {length, kind} <= _TYPES.keys():
                if _TYPES[length].startswith("f"):
                    raise ShapeError(f"line {number}: expected a whole number as length of a list, got {length}")
                elements[-1].properties[name] = _TYPES[kind], _TYPES[length]
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1].properties[name] = _TYPES[kind], ""
            case _:
                raise ShapeError(f"line {number}: expected format, element or property, got {' '.join(words)!r:.80}")
    if order is None:
        raise ShapeError(f"expected a line `format`, one of {', '.join(_ORDERS)}, got none")
    return order, elements, end.end()


class _Binary:
    """Reads the elements of a binary body."""

    unit = "bytes"

    def __init__(self, data: bytes, begin: int, order: str) -> None:
        self._data, self._at, self._order = data, begin, order

    @property
    def left(self) -> int:
        return len(self._data) - self._at

    def read(self, element: _Element) -> _Values:
        """Return the values of the next element."""
        if not element.count or not element.properties:
            return _Values()
        row = self._row_like_the_first(element)
        there = 0 if row is None else self.left // row.itemsize
        if there < element.count and not _lists(element):
            raise _cut(element, there)
        if row is None or there < element.count:
            return self._one_by_one(element)
        table = np.frombuffer(self._data, row, element.count, self._at)
        if any((table[f"{name} length"] != table[name].shape[1]).any() for name, (_, n) in _lists(element)):
            return self._one_by_one(element)  # the lists have different lengths
        self._at += element.count * row.itemsize
        values = _Values()
        for name, (_, length) in element.properties.items():
            values.columns[name] = table[name].reshape(-1)
            if length:
                values.lengths[name] = table[f"{name} length"].astype(np.int64)
        return values

    def _row_like_the_first(self, element: _Element) -> np.dtype[Any] | None:
        """Return the type of all rows, if all have lists of the same lengths as the first; None if that is cut off."""
        fields: list[Any] = []
        at = self._at
        for name, (kind, length) in element.properties.items():
            count = 1
            if length:
                size = np.dtype(length).itemsize
                if at + size > len(self._data):
                    return None
                count = int(np.frombuffer(self._data, self._order + length, 1, at)[0])
                if not 0 <= count <= len(self._data):
                    return None
                fields.append((f"{name} length", self._order + length))
                at += size
            fields.append((name, self._order + kind, (count,)))
            at += count * np.dtype(kind).itemsize
        return np.dtype(fields)

    def _one_by_one(self, element: _Element) -> _Values:
        """Read rows with lists of different lengths."""
        properties = [
            (name, np.dtype(self._order + kind), struct.Struct((self._order + _code(length)) if length else "0s"))
            for name, (kind, length) in element.properties.items()
        ]
        pieces: dict[str, list[bytes]] = {name: [] for name in element.properties}
        lengths: dict[str, list[int]] = {name: [] for name, _ in _lists(element)}
        data, at = self._data, self._at
        for row in range(element.count):
            for name, kind, length in properties:
                count = 1
                if name in lengths:
                    if at + length.size > len(data):
                        raise _cut(element, row)
                    (count,) = length.unpack_from(data, at)
                    at += length.size
                    lengths[name].append(count)
                end = at + count * kind.itemsize
                if count < 0 or end > len(data):
                    raise _cut(element, row)
                pieces[name].append(data[at:end])
                at = end
        self._at = at
        columns = {name: np.frombuffer(b"".join(pieces[name]), kind) for name, kind, _ in properties}
        return _Values(columns, {name: np.array(found, np.int64) for name, found in lengths.items()})


class _Text:
    """Reads the elements of a body of text."""

    unit = "words"

    def __init__(self, body: bytes) -> None:
        self._words = body.split()
        self._at = 0

    @property
    def left(self) -> int:
        return len(self._words) - self._at

    def read(self, element: _Element) -> _Values:
        """Return the values of the next element."""
        if not element.count or not element.properties:
            return _Values()
        words: dict[str, list[bytes]] = {name: [] for name in element.properties}
        lengths: dict[str, list[int]] = {name: [] for name, _ in _lists(element)}
        if not lengths:
            width = len(words)
            if self.left < width * element.count:
                raise _cut(element, self.left // width)
            end = self._at + width * element.count
            words = {name: self._words[self._at + k : end : width] for k, name in enumerate(words)}
            self._at = end
        else:
            self._rows(element, words, lengths)
        try:
            check_words(word for found in words.values() for word in found)
            columns = {name: np.array(found, np.bytes_).astype(np.float64) for name, found in words.items()}
        except ValueError as error:
            raise ShapeError(f"expected numbers as the values of {element.name}: {error!s:.100}") from None
        return _Values(columns, {name: np.array(found, np.int64) for name, found in lengths.items()})

    def _rows(self, element: _Element, words: dict[str, list[bytes]], lengths: dict[str, list[int]]) -> None:
        """Read rows with lists."""
        source, at = self._words, self._at
        for row in range(element.count):
            for name, found in words.items():
                count = 1
                if name in lengths:
                    word = source[at] if at < len(source) else b"0"
                    if not word.isdigit() or len(word) > 9:
                        raise ShapeError(f"{element.name} {row}: expected the length of a list, got {word[:40]!r}")
                    count = int(word)
                    lengths[name].append(count)
                    at += 1
                if at + count > len(source):
                    raise _cut(element, row)
                found += source[at : at + count]
                at += count
        self._at = at


def _lists(element: _Element) -> list[tuple[str, tuple[str, str]]]:
    return [(name, kinds) for name, kinds in element.properties.items() if kinds[1]]


def _code(kind: str) -> str:
    return {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}[kind]


def _cut(element: _Element, there: int) -> ShapeError:
    return ShapeError(f"expected {element.count} of the element {element.name}, got {there}: the file is cut off")


def _rings(values: _Values | None, total: int, least: int) -> tuple[Indices, Indices]:
    """Return the lengths and the corners of an element's lists of vertices. least: number that a corner may have."""
    name = next((each for each in _RINGS if values is not None and each in values.lengths), None)
    if values is None or name is None:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    numbers = values.columns[name]
    corners = numbers.astype(np.int64)
    if (corners != numbers).any() or (len(corners) and not (corners.min() >= least and corners.max() < total)):
        raise ShapeError(f"expected corners from 0 to {total - 1}, got {numbers.min()} to {numbers.max()}")
    return values.lengths[name], corners


def _of_strips(counts: Indices, corners: Indices) -> Indices:
    """Return the triangles of strips, in which -1 begins the next one. Each second triangle is turned."""
    begins = np.concatenate([np.flatnonzero(corners < 0) + 1, np.cumsum(counts)])
    start = np.zeros(len(corners) + 1, np.int64)  # where the strip of each corner begins
    start[begins] = begins
    start = np.maximum.accumulate(start)
    first = np.arange(max(len(corners) - 2, 0))
    triangles = np.stack([corners[first], corners[first + 1], corners[first + 2]], axis=1)
    odd = (first - start[first]) % 2 == 1
    triangles[odd] = triangles[odd][:, ::-1]
    return triangles[(start[first + 2] <= first) & (triangles >= 0).all(axis=1)]
