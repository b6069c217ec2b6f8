"""Numba's dispatchers with our cache, and with intermediate code only for device functions."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import numba
from numba.core import event
from numba.core.types.misc import unliteral

from collision_monitor._jit.compilation import Announcement
from collision_monitor._jit.kernel_cache import KernelCache
from collision_monitor._jit.libraries import DeviceCompiler, KernelCompiler, OutlinedCompiler

_COMPILERS = {"device": DeviceCompiler, "outlined": OutlinedCompiler}


class _LessCollection(event.Listener):  # type: ignore[misc]
    """Collects old garbage less often during a compilation: a seventh of the time for a tenth of the memory."""

    def __init__(self) -> None:
        self._depth = 0
        self._before = gc.get_threshold()

    def on_start(self, event: object) -> None:
        if not self._depth:
            self._before = gc.get_threshold()
            gc.set_threshold(*self._before[:2], 10 * self._before[2])
        self._depth += 1

    def on_end(self, event: object) -> None:
        self._depth -= 1
        if not self._depth:
            gc.set_threshold(*self._before)


event.register("numba:compile", _LessCollection())
event.register("numba:compile", Announcement())


def make_dispatcher(function: Callable[..., Any], options: dict[str, Any], kind: str) -> Any:
    """Return numba's dispatcher of a function, with the cache of this package."""
    options = {**options, "no_cfunc_wrapper": True}
    if kind in _COMPILERS:
        options |= {"no_cpython_wrapper": True, "pipeline_class": _COMPILERS[kind]}
    elif not options.get("parallel"):
        options |= {"pipeline_class": KernelCompiler}
    dispatcher = numba.njit(**options)(function)
    if kind in _COMPILERS:
        # numba would compile f(0) and f(1) apart; LLVM inserts the numbers where it inlines
        template = dispatcher.get_call_template
        dispatcher.get_call_template = lambda args, kws: template(tuple(map(unliteral, args)), kws)
    if not numba.config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function, kind)
        # It looks for extensions of numba in all installed packages (20 ms). A compilation looks for them by itself.
        dispatcher._compilation_chain_init_hook = lambda: None
    return dispatcher
