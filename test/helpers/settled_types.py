"""Every call of a kernel whose types only its first call looks at: the tests look at the types of all calls."""

from __future__ import annotations

from typing import Any

import numpy as np

from collision_monitor._jit.settled import SettledFunction

LOCKED = ("readonly", "mutable")
"""A locked array has the layout of one that is not."""


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
            if expected.startswith("array") and not isinstance(given, np.ndarray):
                continue  # the compiled function refuses it itself
            assert found == expected or (expected, found) == ("float64", "int64"), (
                f"{self.name}: argument {k}: expected {expected}, got {found}"
            )
        return self.entry(*args)


def kind(value: Any) -> str:
    """numba's type of an argument, as text."""
    from numba import typeof  # here, because tests that call no kernel should not import numba

    if isinstance(value, np.ndarray) and value.ndim and value.flags.c_contiguous:
        return f"array({value.dtype}, {value.ndim}, {value.flags.aligned})"
    return str(typeof(value)).replace(*LOCKED)
