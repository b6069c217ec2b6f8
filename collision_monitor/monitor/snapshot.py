"""All that the answers to come depend on, at one moment: so that a replay can begin there and give the same bytes.

The arrays are those that the kernels work on, as they are; the facts are what else there is. Encoded it is an .npz
file, which NumPy opens anywhere; nothing in it is code, and what does not fit this program is refused.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError

_FACTS: Final = "facts"


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Copies: what goes on changing is not seen in it. facts: by owner and name, what JSON can say."""

    arrays: dict[str, NDArray[Any]]
    facts: dict[str, dict[str, Any]]

    @property
    def nbytes(self) -> int:
        """Bytes of memory, about."""
        return sum(array.nbytes for array in self.arrays.values())

    def encode(self) -> bytes:
        """As the bytes of an .npz file."""
        arrays: dict[str, Any] = {_FACTS: np.frombuffer(json.dumps(self.facts).encode(), np.uint8), **self.arrays}
        file = BytesIO()
        np.savez_compressed(file, **arrays)
        return file.getvalue()

    @classmethod
    def decode(cls, data: bytes) -> Snapshot:
        """Raises InputError for bytes that are no such file."""
        try:
            with np.load(BytesIO(data), allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            facts = json.loads(arrays.pop(_FACTS).tobytes())
        except (OSError, ValueError, KeyError, EOFError, MemoryError, zipfile.BadZipFile, zlib.error) as error:
            raise InputError(f"snapshot: expected an .npz file with facts and arrays, got: {error!r}") from None
        return cls(arrays, facts)

    def array(self, name: str, like: NDArray[Any], rows: int | None = None) -> NDArray[Any]:
        """A copy of an array with the type and row shape of `like`; rows: how many. Raises InputError."""
        found = self.arrays.get(name)
        fits = found is not None and found.dtype == like.dtype and found.ndim == like.ndim
        if found is None or not fits or found.shape[1:] != like.shape[1:] or rows not in (None, len(found)):
            got = "none" if found is None else f"{found.dtype} of shape {found.shape}"
            shape = ("any" if rows is None else rows, *like.shape[1:])
            raise InputError(f"snapshot, {name}: expected {like.dtype} of shape {shape}, got {got}")
        return found.copy()


def check_range(name: str, values: NDArray[Any], low: int, high: int) -> None:
    """Raises InputError where one is not low <= value < high: a kernel would read or write beside its arrays."""
    if values.size and not (values.min() >= low and values.max() < high):
        raise InputError(
            f"snapshot, {name}: expected numbers from {low} to {high - 1}, got {values.min()} to {values.max()}"
        )
