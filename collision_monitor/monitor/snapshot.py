"""All that the answers to come depend on, at one moment: so that a replay can begin there and give the same bytes.

The arrays are those that the kernels work on, as they are; the facts are what else there is. Encoded it is an .npz
file, which NumPy opens anywhere; nothing in it is code, and what does not fit this program is refused.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from io import BytesIO
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError

_FACTS: Final = "facts"

Facts = dict[str, Any]
"""What JSON can hold, by name."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Copies: what goes on changing is not seen in it. facts: by owner and name, what JSON can say."""

    arrays: dict[str, NDArray[Any]]
    facts: dict[str, Facts]

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

    def columns(self, prefix: str, like: NamedTuple, rows: int) -> dict[str, NDArray[Any]]:
        """Copies of the arrays `prefix.NAME` for each field NAME of a named tuple of arrays. Raises InputError."""
        return {name: self.array(f"{prefix}.{name}", column, rows) for name, column in like._asdict().items()}

    def check_slots(self, name: str, rows: NDArray[np.void]) -> None:
        """Check the body slots `i` and `j` of rows of pairs, and bring their shape slots into range.

        Shapes are never read where the pair does not meet, and may then be anything. Raises InputError.
        """
        top, shapes = len(self.arrays["bodies.used"]), len(self.arrays["parts.next"])
        check_range(name, rows["i"], 0, top)
        check_range(name, rows["j"], 0, top)
        for shape in ("shape_i", "shape_j"):
            if shape in (rows.dtype.names or ()):
                np.clip(rows[shape], 0, max(shapes - 1, 0), out=rows[shape])


def check_range(name: str, values: NDArray[Any], low: int, high: int) -> None:
    """Raises InputError where one is not low <= value < high: a kernel would read or write beside its arrays."""
    if values.size and not (values.min() >= low and values.max() < high):
        raise InputError(
            f"snapshot, {name}: expected numbers from {low} to {high - 1}, got {values.min()} to {values.max()}"
        )


class Stage(ABC):
    """A stage of the monitor's step that keeps state between two steps, and saves and restores it by itself."""

    SAVED: ClassVar[tuple[str, ...]] = ()
    """Attributes that later answers depend on: `save` puts them into the snapshot."""
    CACHES: ClassVar[tuple[str, ...]] = ()
    """Attributes that only save time, or are written anew before they are read: no snapshot has them."""

    @abstractmethod
    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """Copy the saved attributes into the snapshot's arrays and into `facts`, under names of their own."""

    @abstractmethod
    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """Take over what `save` wrote. Raises InputError, KeyError, TypeError, ValueError for what cannot be that."""
