"""Kernels that numba looks at once: later calls answer the same, and what is no array is refused."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor._jit import kernel
from collision_monitor._jit.settled import settled


@settled
@kernel
def weighted(a, b, factor):
    """Sum of the products of two arrays (n, 2), times a factor."""
    s = 0.0
    for k in range(len(a)):
        s += a[k, 0] * b[k, 0] + a[k, 1] * b[k, 1]
    return s * factor


def test_later_calls_answer_as_the_first_one() -> None:
    a = np.arange(6.0).reshape(3, 2)
    locked = a.copy()
    locked.flags.writeable = False  # as in a mesh that another process has sent
    assert weighted(a, a, 1.0) == float((a * a).sum())
    for b in (a, a + 1.0, locked):
        for call in (weighted, weighted.entry):
            assert call(a, b, 2.0) == call(a, b, 2) == 2.0 * float((a * b).sum())
    assert len(weighted.overloads) == 1


def test_arguments_that_are_no_arrays_are_refused() -> None:
    a = np.ones((3, 2))
    assert weighted(a, a, 1.0) == 6.0
    for wrong in (None, 1.0, [[1.0, 2.0]]):
        with pytest.raises(TypeError):
            weighted(a, wrong, 1.0)
    with pytest.raises(TypeError):
        weighted(a, a)
