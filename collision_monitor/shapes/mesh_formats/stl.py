"""STL: triangles one by one, binary or as text.

The binary form has a head of 80 bytes, a count, and 50 bytes for each triangle. Nothing marks it: the size of the file
does. Source: https://www.fabbers.com/tech/STL_Format
"""

from __future__ import annotations

import re
import struct
from codecs import BOM_UTF8
from typing import Final

import numpy as np

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.raw_mesh import Array, RawMesh, check_words

_HEAD: Final = 84
_TRIANGLE: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_SOLID: Final = re.compile(rb"^[ \t]*((?:end[ \t]*)?solid)\b([^\r\n]*)", re.IGNORECASE | re.MULTILINE)
"""The lines around the triangles of a text, with a name that may hold any words."""

_BEGIN: Final = re.compile(rb"\s*solid\b", re.IGNORECASE)

_FACET: Final = (
    b"facet", b"normal", None, None, None, b"outer", b"loop",
    b"vertex", None, None, None, b"vertex", None, None, None, b"vertex", None, None, None, b"endloop", b"endfacet",
)  # fmt: skip
"""The words of a triangle; None: a number."""

_COORDINATES: Final = (8, 9, 10, 12, 13, 14, 16, 17, 18)


def read_stl(data: bytes) -> RawMesh:
    """Return the triangles of a file, each with its own corners. Raises ShapeError."""
    stated = struct.unpack_from("<I", data, _HEAD - 4)[0] if len(data) >= _HEAD else 0
    whole = _HEAD + stated * _TRIANGLE.itemsize
    if len(data) == whole:
        corners: Array = np.frombuffer(data, _TRIANGLE, offset=_HEAD)["corners"].astype(np.float64)
    elif _BEGIN.match(text := data.removeprefix(BOM_UTF8)) and re.search(rb"facet|endsolid", text, re.IGNORECASE):
        corners = _read_text(text)
    elif len(data) < _HEAD:
        raise ShapeError(f"expected the {_HEAD} bytes of a head, or a text that begins with `solid`, got {len(data)}")
    elif len(data) < whole:
        there = (len(data) - _HEAD) // _TRIANGLE.itemsize
        raise ShapeError(f"expected {stated} triangles, as its head says, got {there}: it is cut off, or no STL")
    else:
        raise ShapeError(f"expected {whole} bytes for {stated} triangles, got {len(data) - whole} bytes behind them")
    return RawMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def _read_text(data: bytes) -> Array:
    """Return the corners (n, 3, 3) of a text, whatever ends its lines."""
    data = data.replace(b"\r", b"\n")
    lines = _SOLID.findall(data)
    begins = sum(not word.lower().startswith(b"end") for word, _ in lines)
    if any(b"vertex" in name.lower() for _, name in lines):
        raise ShapeError("expected `solid` and the name alone in a line, got triangles in it")
    if 2 * begins != len(lines):
        raise ShapeError(f"expected as many endsolid as solid, got {len(lines) - begins} and {begins}: it is cut off")
    words = _SOLID.sub(b"", data).lower().split()
    for place, expected in enumerate(_FACET):
        if expected is not None and (found := set(words[place :: len(_FACET)]) - {expected}):
            raise ShapeError(f"expected the word {expected.decode()} in each triangle, got {_shown(found)}")
    if len(words) % len(_FACET):
        raise ShapeError(f"expected {len(_FACET)} words for each triangle, got {len(words)}: it is cut off")
    try:
        check_words(word for place in _COORDINATES for word in words[place :: len(_FACET)])
        columns = [np.array(words[place :: len(_FACET)], np.bytes_).astype(np.float64) for place in _COORDINATES]
    except ValueError as error:
        raise ShapeError(f"expected numbers as coordinates: {error}") from None
    return np.stack(columns, axis=1).reshape(-1, 3, 3)


def _shown(words: set[bytes]) -> str:
    return min(words)[:40].decode(errors="replace")
