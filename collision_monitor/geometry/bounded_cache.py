"""A cache with a size in bytes. `functools.lru_cache` counts results, so large arguments would fill the memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import update_wrapper
from threading import Lock
from typing import Any, Final, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

ENTRY_BYTES: Final = 400
"""Memory of an entry beside what `size` counts: key, tuple, place in the order, headers of objects (bytes)."""


class BoundedCache(Generic[P, R]):
    """Remembers the results of a pure function until they hold more than `limit` bytes; the least used leave first.

    size: bytes of a result and of its arguments, which stay in memory as the key. The newest result always stays, so
    the memory is at most the limit or one result. Arguments are hashable; those by name make another entry. Safe for
    threads.
    """

    def __init__(self, function: Callable[P, R], size: Callable[..., int], limit: int) -> None:
        update_wrapper(self, function)
        self.limit = limit
        self.held = 0
        """Bytes of all results."""
        self._function, self._size = function, size
        self._results: OrderedDict[Any, tuple[R, int]] = OrderedDict()
        self._lock = Lock()

    def __len__(self) -> int:
        """Number of results."""
        return len(self._results)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Return the remembered result, or compute it. Raises what the function raises, and remembers no failure."""
        key: Any = (args, *kwargs.items()) if kwargs else args
        try:
            self._results.move_to_end(key)
            return self._results[key][0]
        except KeyError:  # not there, or another thread has just removed it
            pass
        result = self._function(*args, **kwargs)
        size = self._size(result, *args, **kwargs) + ENTRY_BYTES
        with self._lock:
            if key not in self._results:
                self._results[key] = result, size
                self.held += size
            while self.held > self.limit and len(self._results) > 1:
                self.held -= self._results.popitem(last=False)[1][1]
        return result


def bounded_cache(limit: int, size: Callable[..., int]) -> Callable[[Callable[P, R]], BoundedCache[P, R]]:
    """Decorate a function with a BoundedCache. limit: bytes. size(result, *arguments): bytes."""
    return lambda function: BoundedCache(function, size, limit)
