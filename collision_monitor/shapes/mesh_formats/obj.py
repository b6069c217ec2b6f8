"""OBJ: lines of vertices and of polygons. A polygon's number n > 0 is the n-th vertex of the file, and a number n < 0
the |n|-th vertex before its line. Source: Wavefront, Advanced Visualizer Manual, appendix B1.
"""

from __future__ import annotations

from array import array
from codecs import BOM_UTF8
from collections.abc import Iterator, Sequence
from typing import Final, TypeVar

import numpy as np

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.faces import triangles_of
from collision_monitor.shapes.mesh_formats.raw_mesh import Indices, RawMesh, check_words

Number = TypeVar("Number", int, float)

_VERTEX: Final = b"v"
_FACES: Final = (b"f", b"fo")

_WITHOUT_SURFACE: Final = frozenset(
    b"vt vn vp vc g o s mg l p usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj ctech "
    b"stech cstype deg bmat step curv curv2 parm trim hole scrv sp end con".split()
)
"""Words of lines that hold no surface. Those of a free-form surface (surf) and of other files (call) are not read."""


def read_obj(data: bytes) -> RawMesh:
    """Return the polygons of a file as triangles. Raises ShapeError with the line."""
    places, corners = _Numbers("three coordinates of a vertex"), _Numbers("numbers of vertices as corners of a face")
    before = array("q")  # vertices before each face
    for line, text in _lines(data.removeprefix(BOM_UTF8)):
        words = text.partition(b"#")[0].split()
        if not words:
            continue
        word = words[0]
        if word == _VERTEX:
            if len(words) < 4:
                raise ShapeError(f"line {line}: expected three coordinates of a vertex, got {len(words) - 1}")
            places.add(line, words[1:4])
        elif word in _FACES:
            if len(words) < 4:
                raise ShapeError(f"line {line}: expected a face of at least 3 corners, got {len(words) - 1}")
            before.append(len(places.lines))
            corners.add(line, [each.partition(b"/")[0] for each in words[1:]])
        elif word not in _WITHOUT_SURFACE:
            shown = word[:40].decode(errors="replace")
            raise ShapeError(f"line {line}: expected vertices (v) and faces (f), got {shown!r}, which is not read")
    vertices = np.array(places.parsed(float), np.float64).reshape(-1, 3)
    return RawMesh(vertices, triangles_of(vertices, *_rings(corners, before, len(vertices))))


class _Numbers:
    """The numbers of all lines of one kind, still as words."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._words: list[bytes] = []
        self.lines = array("q")
        self.counts = array("q")

    def add(self, line: int, words: list[bytes]) -> None:
        self._words += words
        self.lines.append(line)
        self.counts.append(len(words))

    def parsed(self, kind: type[Number]) -> list[Number]:
        """Return the numbers. Raises ShapeError with the line of the first word that is none."""
        try:
            check_words(self._words)
            return list(map(kind, self._words))
        except ValueError:
            for k, word in enumerate(self._words):
                try:
                    check_words((word,))
                    kind(word)
                except ValueError:
                    shown = word[:40].decode(errors="replace")
                    raise ShapeError(f"line {self.line_of(k)}: expected {self._what}, got {shown!r}") from None
            raise

    def line_of(self, k: int) -> int:
        """Return the line of the k-th number."""
        return self.lines[int(np.searchsorted(np.cumsum(self.counts), k, side="right"))]


def _lines(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the number and the text of each line; a line whose last character is a backslash goes on in the next."""
    begun: list[bytes] = []
    for line, text in enumerate(data.splitlines(), start=1):
        if text.endswith(b"\\"):
            begun.append(text[:-1])
        elif begun:
            yield line, b" ".join([*begun, text])
            begun = []
        else:
            yield line, text
    if begun:
        yield line, b" ".join(begun)


def _rings(corners: _Numbers, before: Sequence[int], total: int) -> tuple[Indices, Indices]:
    """Return the number of corners of each face, and the indices of the vertices of all corners."""
    counts = np.array(corners.counts, np.int64)
    try:
        numbers = np.array(corners.parsed(int), np.int64)
    except OverflowError:
        raise ShapeError(f"expected the number of one of {total} vertices, got one of more than 64 bits") from None
    earlier = np.repeat(np.array(before, np.int64), counts)
    found = np.where(numbers > 0, numbers - 1, earlier + numbers)
    wrong = np.flatnonzero((numbers == 0) | (found < 0) | (found >= total))
    if len(wrong):
        k = int(wrong[0])
        raise ShapeError(
            f"line {corners.line_of(k)}: expected the number of one of {total} vertices, {earlier[k]} of them before "
            f"the line, got {numbers[k]}"
        )
    return counts, found
