"""Kernels that Python code calls in every step with many arrays, without numba's look at the type of each of them.

To find the compiled function, numba writes the types of all arguments of a call into a text, which takes 4 µs for the
35 arrays of the bodies and their shapes. Here a named tuple is looked at once and known again by its identity; of the
other arguments, whatever numba's types depend on is compared. An array in a named tuple must not be locked later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import count
from typing import Any, Final, TypeVar, cast

import numpy as np

from collision_monitor._jit.function import Function

F = TypeVar("F", bound=Callable[..., Any])

MANY: Final = 3
"""Number of members of a named tuple from which on it is known again by its identity."""

_known: dict[type, tuple[Any, ...]] = {}
"""The last two such tuples of each class, each with its kind: an open mesh is sought with and without its filling by
turns. They are kept, because a new one could take their place in memory."""

_numbers: dict[Any, int] = {}
"""Short names of the kinds of such tuples."""

_names: Final = count()
"""Numbers that no two threads get twice."""


def forget() -> None:
    """Release the tuples that were kept, and with them their arrays."""
    _known.clear()


def kinds(values: Iterable[Any]) -> tuple[Any, ...]:
    """Return a hashable description: values of equal kinds have equal types for numba."""
    return tuple(
        [
            (each.dtype, each.ndim, each.flags.num)
            if type(each) is np.ndarray
            else _of_tuple(each)
            if isinstance(each, tuple)
            else type(each)
            for each in values
        ]
    )


def _of_tuple(value: tuple[Any, ...]) -> Any:
    own = type(value)
    known = _known.get(own)
    if known is not None:
        if known[0] is value:
            return known[1]
        if known[2] is value:
            return known[3]
    found = own, kinds(value)
    if own is tuple or len(value) < MANY:
        return found
    number = _numbers.setdefault(found, next(_names))
    _known[own] = value, number, *(known[:2] if known else (None, 0))
    return number


class DirectFunction(Function):
    """A kernel whose compiled function is found by the kinds of its arguments."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, options, "kernel")
        self._found: dict[Any, Callable[..., Any]] = {}

    def __call__(self, *args: Any) -> Any:
        """Call the function. numba finds it for arguments of new kinds."""
        found = self._found.get(kinds(args))
        return found(*args) if found is not None else self._first(args)

    def _first(self, args: tuple[Any, ...]) -> Any:
        dispatcher = self._entry
        key = kinds(args)
        result = dispatcher(*args)
        overloads = getattr(dispatcher, "overloads", {})  # without a compiler, the dispatcher is the plain function
        if overloads:
            types = tuple(dispatcher.typeof_pyval(each) for each in args)
            if types in overloads:
                self._found[key] = overloads[types].entry_point
        return result


def direct(function: F) -> F:
    """Let Python code call a kernel without numba's look at each array."""
    given = cast(Function, function)
    return cast(F, DirectFunction(given.py_func, given._options))
