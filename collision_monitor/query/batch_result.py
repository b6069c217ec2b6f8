"""What the results of the batches share: they are sequences of the results of single calls, and tables."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, Generic, NamedTuple, Self, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from collision_monitor.records import data_frame

One = TypeVar("One")
Several = slice | Sequence[int] | Sequence[bool] | NDArray[np.integer[Any]] | NDArray[np.bool_]


class Pairs(NamedTuple):
    """The arguments of a batch, from which the result of one pair is made."""

    shapes_a: Any  # BatchShapes
    states_a: NDArray[np.float64]  # (N, …) or (1, …)
    shapes_b: Any
    states_b: NDArray[np.float64]

    def of(self, k: int) -> tuple[Any, NDArray[np.float64], Any, NDArray[np.float64]]:
        """Shapes and states of pair k."""
        a, b = (states[min(k, len(states) - 1)] for states in (self.states_a, self.states_b))
        return self.shapes_a.of(k), a, self.shapes_b.of(k), b


class BatchResult(Generic[One]):
    """Base of a frozen dataclass whose public fields are arrays with a row for each pair.

    A number selects the result of one pair, as the single call returns it; a slice, a mask or numbers select several.
    Other fields than arrays begin with an underscore and are kept.
    """

    @abstractmethod
    def __len__(self) -> int:
        """Number of pairs."""

    @abstractmethod
    def _one(self, k: int) -> One:
        """Return the result of pair k."""

    @overload
    def __getitem__(self, which: int) -> One: ...
    @overload
    def __getitem__(self, which: Several) -> Self: ...
    def __getitem__(self, which: Any) -> Any:
        """Return the result of one pair, or the results of several. Raises IndexError."""
        numbers = np.arange(len(self))
        if isinstance(which, bool | np.bool_) or which is None or which is Ellipsis:
            raise IndexError(f"expected the number of a pair, a slice, a mask or numbers, got {which!r}")
        if isinstance(which, int | np.integer):
            if not -len(self) <= which < len(self):
                raise IndexError(f"expected the number of a pair, of {len(self)} pairs, got {which}")
            return self._one(int(numbers[which]))
        chosen = numbers[np.asarray(which, np.intp) if isinstance(which, list) and not which else which]
        if chosen.ndim != 1:
            raise IndexError(f"expected a slice, or a mask or numbers (n,), got an array {chosen.shape}")
        arrays = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        parts = {name: value[chosen] for name, value in arrays.items() if isinstance(value, np.ndarray)}
        return replace(self, **parts)  # type: ignore[type-var]

    def __iter__(self) -> Iterator[One]:
        """Return the results of the pairs one by one."""
        return (self._one(k) for k in range(len(self)))

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame with a row for each pair. Raises ImportError without pandas."""
        names = [each.name for each in fields(self) if not each.name.startswith("_")]  # type: ignore[arg-type]
        return data_frame({name: getattr(self, name) for name in names})
