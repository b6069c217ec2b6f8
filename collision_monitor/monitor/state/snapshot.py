"""Snapshot of the monitor: all state that later answers depend on, so that a replay can start there with equal bytes.

The arrays are copies of those that the kernels work on; the facts hold the rest. A snapshot is encoded as an .npz
file, which NumPy opens anywhere. It contains no code, and data that does not fit this program is refused.
"""

from __future__ import annotations

import json
import math
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from io import BytesIO
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError

_FACTS: Final = "facts"

_STAGES: Final = "monitor"
"""Key of the entry of the monitor's stages in `Snapshot.facts`."""

LARGEST: Final = 128 << 20
"""Unpacked bytes of a snapshot that is read. One of 10,000 objects has 9 MB."""

_ENTRIES: Final = 1000
"""Arrays of a snapshot that is read. The monitor writes 50."""

Facts = dict[str, Any]
"""JSON values by name."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Copies of the monitor's state, which later steps do not change. facts: JSON values by owner and name."""

    arrays: dict[str, NDArray[Any]]
    facts: dict[str, Facts]

    @property
    def nbytes(self) -> int:
        """Size of the arrays in bytes."""
        return sum(array.nbytes for array in self.arrays.values())

    def encode(self) -> bytes:
        """Encode as the bytes of an .npz file."""
        arrays: dict[str, Any] = {_FACTS: np.frombuffer(json.dumps(self.facts).encode(), np.uint8), **self.arrays}
        file = BytesIO()
        np.savez_compressed(file, **arrays)
        return file.getvalue()

    @classmethod
    def decode(cls, data: bytes) -> Snapshot:
        """Decode the bytes of `encode`. Raises InputError for other bytes."""
        try:
            _check_sizes(data)
            with np.load(BytesIO(data), allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            facts = json.loads(arrays.pop(_FACTS).tobytes())
        except Exception as error:  # the libraries raise many kinds of errors for wrong bytes
            raise InputError(f"snapshot: expected an .npz file with facts and arrays, got: {error!r}") from None
        return cls(arrays, facts)

    def array(self, name: str, like: NDArray[Any], rows: int | None = None) -> NDArray[Any]:
        """Copy an array. Raises InputError if its type or row shape differs from `like`, or its length from `rows`."""
        found = self.arrays.get(name)
        fits = found is not None and found.dtype == like.dtype and found.ndim == like.ndim
        if found is None or not fits or found.shape[1:] != like.shape[1:] or rows not in (None, len(found)):
            got = "none" if found is None else f"{found.dtype} of shape {found.shape}"
            shape = ("any" if rows is None else rows, *like.shape[1:])
            raise InputError(f"snapshot, {name}: expected {like.dtype} of shape {shape}, got {got}")
        return found.copy()

    def columns(
        self, prefix: str, like: NamedTuple, rows: int, without: Collection[str] = ()
    ) -> dict[str, NDArray[Any]]:
        """Copy the arrays `prefix.NAME` for each field NAME of the named tuple `like`. Raises InputError.

        without: fields that are not saved.
        """
        fields = like._asdict().items()
        return {name: self.array(f"{prefix}.{name}", column, rows) for name, column in fields if name not in without}

    def check_slots(self, name: str, rows: NDArray[np.void]) -> None:
        """Check the body slots `i` and `j` of rows of pairs, and clip their shape slots to the valid range.

        The shape slots of a pair that does not meet are never read and may hold any number. Raises InputError.
        """
        top, shapes = len(self.arrays["bodies.used"]), len(self.arrays["parts.next"])
        check_range(name, rows["i"], 0, top)
        check_range(name, rows["j"], 0, top)
        for shape in ("shape_i", "shape_j"):
            if shape in (rows.dtype.names or ()):
                np.clip(rows[shape], 0, max(shapes - 1, 0), out=rows[shape])


def _check_sizes(data: bytes) -> None:
    """Compare what an .npz file would unpack to with the limits, before anything is unpacked. Raises ValueError.

    `zipfile` unpacks no more of an entry than its entry in the directory states.
    """
    with zipfile.ZipFile(BytesIO(data)) as file:
        entries = file.infolist()
        if any(entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for entry in entries):
            raise ValueError("a compression that it is not written with")
        if len(entries) > _ENTRIES or sum(entry.file_size for entry in entries) > LARGEST:
            raise ValueError(f"more than {LARGEST} unpacked bytes or {_ENTRIES} arrays")
        for entry in entries:
            with file.open(entry) as stream:
                version = np.lib.format.read_magic(stream)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = read(stream)
                if math.prod(shape) * dtype.itemsize > entry.file_size or dtype.hasobject:
                    raise ValueError(f"the array {entry.filename!r:.80} is longer than its bytes")


def check_range(name: str, values: NDArray[Any], low: int, high: int) -> None:
    """Raise InputError unless low <= value < high: with other slots a kernel would access memory outside its arrays."""
    if values.size and not (values.min() >= low and values.max() < high):
        raise InputError(
            f"snapshot, {name}: expected numbers from {low} to {high - 1}, got {values.min()} to {values.max()}"
        )


def whole_fact(value: Any, name: str) -> int:
    """Return a fact that is a whole number. Raises InputError for others: a kernel may never end with a time of NaN."""
    if not isinstance(value, int) or isinstance(value, bool) or not -(2**63) <= value < 2**64:
        raise InputError(f"snapshot, {name}: expected a whole number of 64 bits, got {value!r:.80}")
    return value


class Stage(ABC):
    """A stage of the monitor's step. It keeps its state between two steps, and saves and restores it."""

    SAVED: ClassVar[tuple[str, ...]] = ()
    """Attributes that later answers depend on; `save` copies them into the snapshot."""
    CACHES: ClassVar[tuple[str, ...]] = ()
    """Attributes that only save time, or are written before they are read; a snapshot does not contain them."""

    @abstractmethod
    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """Copy the attributes in SAVED into the snapshot's arrays and `facts`, under names that no other stage uses."""

    @abstractmethod
    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """Restore what `save` wrote. Raises InputError, KeyError, TypeError, ValueError for other content."""


def save_stages(stages: Iterable[Stage]) -> Snapshot:
    """Save each stage in one snapshot."""
    snapshot = Snapshot({}, {_STAGES: {}})
    for stage in stages:
        stage.save(snapshot, snapshot.facts[_STAGES])
    return snapshot


def restore_stages(stages: Iterable[Stage], snapshot: Snapshot) -> None:
    """Restore each stage from the snapshot. Raises InputError if it is damaged, or of stages that save other state."""
    try:
        for stage in stages:
            stage.restore(snapshot, snapshot.facts[_STAGES])
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"snapshot: expected the state of a monitor of this version, got: {error!r}") from None
