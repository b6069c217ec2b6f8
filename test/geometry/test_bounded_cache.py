"""The cache with a size in bytes: what it returns, what it holds, and what leaves it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from collision_monitor.geometry.bounded_cache import ENTRY_BYTES, BoundedCache

ROOM = 10 * (ENTRY_BYTES + 100)
"""Room for ten results of 100 bytes."""


def cache_of(calls: list[int], limit: int = ROOM) -> BoundedCache[[int], bytes]:
    def text(n: int) -> bytes:
        calls.append(n)
        return bytes(n)

    return BoundedCache(text, lambda result, n: len(result), limit)


def test_a_result_is_computed_once() -> None:
    calls: list[int] = []
    cache = cache_of(calls)
    assert cache(7) is cache(7)
    assert (calls, len(cache), cache.held) == ([7], 1, ENTRY_BYTES + 7)


def test_it_holds_no_more_than_its_limit_and_the_least_used_leave_first() -> None:
    calls: list[int] = []
    cache = cache_of(calls)
    for n in range(91, 101):
        cache(n)
    assert len(cache) == 10
    cache(91)
    cache(50)
    assert (len(cache), cache.held <= ROOM) == (10, True)
    calls.clear()
    cache(91)
    cache(92)
    assert calls == [92], "91 was used again, 92 was not"


def test_many_results_never_fill_the_memory() -> None:
    cache = cache_of([])
    for n in range(20_000):
        cache(n % 997)
        assert cache.held <= ROOM
    assert cache.held == sum(size for _, size in cache._results.values())


def test_a_result_larger_than_the_limit_stays_alone_until_the_next() -> None:
    calls: list[int] = []
    cache = cache_of(calls)
    cache(1)
    assert cache(10 * ROOM) is cache(10 * ROOM)
    assert (calls, len(cache)) == ([1, 10 * ROOM], 1)
    cache(2)
    assert (len(cache), cache.held) == (1, ENTRY_BYTES + 2)


def test_arguments_by_name_count() -> None:
    cache: BoundedCache[[int, int], int] = BoundedCache(lambda n, k=1: n * k, lambda result, n, k=1: 8, ROOM)
    assert [cache(3), cache(3, k=2), cache(3, k=5), cache(n=7), cache(3)] == [3, 6, 15, 7, 3]
    assert len(cache) == 4


def test_an_error_is_raised_and_not_remembered() -> None:
    cache: BoundedCache[[int], float] = BoundedCache(lambda n: 1 / n, lambda result, n: 8, ROOM)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            cache(0)
    assert (len(cache), cache.held) == (0, 0)


def test_threads_share_it() -> None:
    cache = cache_of([])

    def use(seed: int) -> bool:
        return all(len(cache((seed * 31 + k * k) % 40)) == (seed * 31 + k * k) % 40 for k in range(3000))

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(use, range(4)))
    assert cache.held == sum(size for _, size in cache._results.values()) <= ROOM
