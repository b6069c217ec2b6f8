"""Limits on the processor time of a piece of a test."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def within(seconds: float, what: str = "") -> Iterator[None]:
    """Assert that the block takes at most `seconds` of processor time in this thread. what: name for the failure.

    Threads that earlier tests left do not count, and the collector of garbage does not examine the objects that exist
    already: a worker that ran thousands of tests holds millions of them, and to examine them takes seconds. Nor does it
    examine them before the block: what is frozen costs nothing, garbage or not.
    """
    gc.freeze()
    begin = time.thread_time()
    try:
        yield
        took = time.thread_time() - begin
    finally:
        gc.unfreeze()
    assert took < seconds, f"{what} took {took:.2f} s, limit {seconds:g} s"
