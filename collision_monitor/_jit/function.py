"""A function that numba compiles, or loads from the cache, at its first call. Until then numba is not imported.

The decorators of a module thus cost nothing: a program that uses ten kernels of the package's 60 loads ten, and none
of the device functions, which exist as machine code only inside the kernels.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any


class Function:
    """A function of the kind "kernel", "device" or "outlined"; everything but the call is numba's dispatcher."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any], kind: str) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._options = options
        self.kind = kind

    def __call__(self, *args: Any) -> Any:
        """Call the function; the first call with arguments of these types loads or compiles it."""
        return self._entry(*args)

    @functools.cached_property
    def _entry(self) -> Any:
        """Dispatcher with an entry for Python. Functions that only kernels call have one only here, for the tests."""
        if self.kind == "kernel":
            return self.dispatcher
        from collision_monitor._jit.compiling import make_dispatcher

        return make_dispatcher(self.py_func, self._options, "kernel")

    @functools.cached_property
    def dispatcher(self) -> Any:
        """Dispatcher that numba meets where other kernels call this function."""
        from collision_monitor._jit.compiling import make_dispatcher

        return make_dispatcher(self.py_func, self._options, self.kind)

    def __getattr__(self, name: str) -> Any:
        """Let numba, which meets this object as a global of other kernels, and tests see the dispatcher."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str | tuple[Any, ...]:
        """Pickle by name, like a function."""
        return self.__qualname__  # type: ignore[no-any-return]
