"""Every call of a kernel whose types only its first call looks at: the tests look at the types of all calls."""

from __future__ import annotations

from typing import Any

import numpy as np

from collision_monitor._jit.settled import SettledFunction

_last: dict[type, tuple[Any, Any]] = {}
"""Of each class of tuples, what the last one was made of, by identity, and its kind. It keeps no array alive."""


def look_at_types() -> None:
    """Let each such kernel refuse arguments of other types than those of its first call, from now on."""
    unchecked = SettledFunction._first

    def first(self: Any, *args: Any) -> Any:
        result = unchecked(self, *args)
        entry = self.__dict__.get("entry")
        if entry is not None:
            self.__dict__["entry"] = Checked(self.__name__, entry, args)
        return result

    SettledFunction._first = first  # type: ignore[method-assign]


class Checked:
    """A compiled function that refuses arguments of other types than those of `args`."""

    def __init__(self, name: str, entry: Any, args: tuple[Any, ...]) -> None:
        self.name, self.entry, self.kinds = name, entry, [kind(each) for each in args]

    def __call__(self, *args: Any) -> Any:
        """Call the function. Raises AssertionError for arguments of other types."""
        for k, (expected, given) in enumerate(zip(self.kinds, args, strict=False)):
            found = kind(given)
            if found == expected or (expected, found) == (float, int):
                continue
            if isinstance(expected, list) and not isinstance(given, np.ndarray):
                continue  # the compiled function refuses it itself
            raise AssertionError(f"{self.name}: argument {k}: expected {expected}, got {found}")
        return self.entry(*args)


def kind(value: Any) -> Any:
    """Whatever numba's type of an argument depends on: a list for an array. A locked array has the layout of others."""
    if isinstance(value, np.ndarray):
        layout = "C" if value.flags.c_contiguous else "F" if value.flags.f_contiguous else "A"
        return [value.dtype, value.ndim, layout, value.flags.aligned]
    if isinstance(value, tuple):
        key = tuple(map(id, value))  # a tuple of the same arrays, as most are, has the same kind
        known = _last.get(type(value))
        if known is None or known[0] != key:  # another thread may replace it meanwhile
            known = _last[type(value)] = key, (type(value), tuple(kind(each) for each in value))
        return known[1]
    if isinstance(value, float):  # also float64 of NumPy
        return float
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return int
    return bool if isinstance(value, np.bool_) else type(value)
