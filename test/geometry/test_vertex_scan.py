"""The farthest vertex of a hull, against NumPy, also in a part of a table, whose rows do not follow one another."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor._jit.vectors import LANES
from collision_monitor.geometry.vertex_scan import farthest_vertex


@kernel
def _farthest(vertices: NDArray[np.float64], start: int, count: int, d: NDArray[np.float64]) -> int:
    return farthest_vertex(vertices, start, count, d[0], d[1], d[2])


@pytest.mark.parametrize("is_part", [False, True], ids=["whole", "part"])
def test_it_is_the_first_of_the_farthest_vertices(is_part: bool) -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        count, start = LANES * int(rng.integers(1, 6)), LANES * int(rng.integers(0, 3))
        table = rng.integers(-3, 4, (3, start + count + LANES * int(rng.integers(1, 5)))).astype(float)
        vertices = table[:, : start + count] if is_part else table
        d = rng.integers(-2, 3, 3).astype(float)
        expected = start + int((d @ vertices[:, start : start + count]).argmax())
        assert _farthest(vertices, start, count, d) in (expected, expected - start)
