"""Direct calls of kernels: arguments of other types are never read as those of an earlier call."""

from __future__ import annotations

import gc
import weakref
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import typeof

from collision_monitor import Monitor, Sphere
from collision_monitor._jit import kernel
from collision_monitor._jit.direct import direct, kinds


class Many(NamedTuple):
    """A named tuple of arrays, as the bodies are."""

    a: Any
    b: Any
    c: Any


class Few(NamedTuple):
    """A named tuple of numbers, as the settings are."""

    a: Any
    b: Any
    c: Any


@direct
@kernel
def total(many, scale):
    """Sum of all elements times `scale`."""
    s = 0.0
    for k in range(many.a.size):
        s += many.a[k] + many.b[k] + many.c[k]
    return s * scale


def arrays() -> list[np.ndarray]:
    """Arrays of the types that numba distinguishes."""
    record = np.dtype([("x", np.float64), ("y", np.int32)])
    plain = np.arange(12.0)
    locked = plain.copy()
    locked.flags.writeable = False
    shifted = np.zeros(97, np.uint8)[1:].view(np.float64)
    grid = plain.reshape(3, 4)
    others = [plain[::2], plain.astype(np.float32), plain.astype(np.int64), locked, shifted, np.zeros(12, record)]
    return [plain, *others, grid, grid.T, grid[:, 1:]]


def test_arguments_of_equal_kinds_have_equal_types() -> None:
    values = [*arrays(), 1.0, 1, True, np.float64(1.0), None]
    values += [(each, 1.0) for each in values] + [Many(each, each, each) for each in arrays()]
    values += [Few(1.0, 2.0, each) for each in (3.0, 3, True, arrays()[0])]
    for a in values:
        for b in values:
            if kinds([a]) == kinds([b]):
                assert typeof(a) == typeof(b)


def test_each_type_has_its_own_function() -> None:
    for dtype in (np.float64, np.float32, np.int32, np.float64):
        for step in (1, 2, 1):
            a = np.arange(20, dtype=dtype)[::step]
            for _ in range(3):  # the first call asks numba, the others do not
                assert total(Many(a, a, a), 2.0) == 6.0 * a.sum()
    assert len(total.overloads) == 6


def test_a_tuple_that_takes_the_place_of_another_is_looked_at() -> None:
    first = np.arange(10.0)
    for _ in range(200):  # a new tuple often has the address of the last one, and has the same first array here
        for other in (first, np.arange(10, dtype=np.float32)):
            assert kinds([Many(first, other, other)]) == kinds([Many(first, other.copy(), other)])
            assert total(Many(first, first, first), 1.0) == 3.0 * first.sum()


def test_a_monitor_leaves_no_array_behind() -> None:
    monitor = Monitor()
    monitor.add(1, Sphere(1.0))
    monitor.step(0, [1], [(0, 0, 0, 0, 0, 0, 1)])
    kept = [weakref.ref(each) for each in monitor.roster.bodies]
    del monitor
    gc.collect()
    assert not any(each() is not None for each in kept)


def test_wrong_arguments_raise_as_they_do_without() -> None:
    a = np.arange(3.0)
    with pytest.raises(TypeError):
        total(Many(a, a, a))
    with pytest.raises(Exception, match=r"(?i)typ"):
        total(Many(a, a, a), "text")
    assert total(Many(a, a, a), 1.0) == 9.0
