"""Values of cells as bytes of a message: a byte each, compressed, since maps hold long runs of equal ones."""

from __future__ import annotations

import zlib
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError

_LEVEL: Final = 1
"""Of zlib. Higher: maps are hardly smaller and take five times as long."""


def packed(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Compress an array as bytes (n,)."""
    return np.frombuffer(zlib.compress(np.ascontiguousarray(values).data, _LEVEL), np.uint8)


def unpacked(data: NDArray[np.uint8], kind: Any, count: int, what: str) -> NDArray[Any]:
    """Return the `count` numbers of a NumPy kind that were `packed`. Raises ShapeError for other bytes."""
    size = count * np.dtype(kind).itemsize
    stream = zlib.decompressobj()
    try:
        found = stream.decompress(data.tobytes(), size + 1)
    except zlib.error as error:
        raise ShapeError(
            f"{what}, data: expected {count} values as zlib packs them, got bytes of another kind: {error}"
        ) from None
    if len(found) != size or not stream.eof:
        got = f"{len(found)} bytes" if len(found) < size else "more"
        raise ShapeError(f"{what}, data: expected {size} bytes for {count} values, got {got}")
    return np.frombuffer(found, kind)
