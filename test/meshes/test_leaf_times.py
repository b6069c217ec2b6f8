"""Times until which two leaves of triangles stay apart, against the distances of all pairs on the way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from collision_monitor._jit import kernel
from collision_monitor.meshes.advance.approach import Approach
from collision_monitor.meshes.advance.leaf_times import leaf_time
from collision_monitor.meshes.distance.nearest import MEMORY
from collision_monitor.meshes.distance.triangle_pair import Corners, closest_triangle_points
from collision_monitor.meshes.layout import CHILD, WIDTH
from collision_monitor.meshes.placing import Placing
from collision_monitor.meshes.trees.tree import tree_of

Array = NDArray[np.float64]

MOMENTS = 200


@kernel
def times(blocks_a, blocks_b, X, move, tolerance, enough, pair, work):
    """`leaf_time` of two trees that are one leaf each."""
    return leaf_time(
        blocks_a, 0, -int(blocks_a[0, CHILD, 0]), blocks_b, 0, -int(blocks_b[0, CHILD, 0]), X, move, tolerance, enough,
        pair, work,
    )  # fmt: skip


@kernel
def least_distances(a, b, out):
    """Write the least distance of any two triangles at each moment, (m, n, 3, 3) of both, to out (m,)."""
    for s in range(len(out)):
        best = np.inf
        for i in range(a.shape[1]):
            x = a[s, i]
            first = Corners((x[0, 0], x[0, 1], x[0, 2]), (x[1, 0], x[1, 1], x[1, 2]), (x[2, 0], x[2, 1], x[2, 2]))
            for j in range(b.shape[1]):
                y = b[s, j]
                second = Corners((y[0, 0], y[0, 1], y[0, 2]), (y[1, 0], y[1, 1], y[1, 2]), (y[2, 0], y[2, 1], y[2, 2]))
                best = min(best, closest_triangle_points(first, second).squared)
        out[s] = np.sqrt(best)


def distances(a: Array, w_a: Array, b: Array, turn: Rotation, w_b: Array, p: Array, v: Array, at: Array) -> Array:
    """Least distances of the triangles of two bodies that turn about their origins, at the times `at` (m,)."""
    R_a = Rotation.from_rotvec(at[:, None] * w_a).as_matrix()
    R_b = (Rotation.from_rotvec(at[:, None] * w_b) * turn).as_matrix()
    on_a, on_b = np.einsum("srk,nik->snir", R_a, a), np.einsum("srk,nik->snir", R_b, b)
    out = np.empty(len(at))
    least_distances(on_a, on_b + (p + at[:, None] * v)[:, None, None], out)
    return out


def vector(v: Array) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])


def approach(v: Array, w_a: Array, w_b: Array, start: float, growth: float, until: float) -> Approach:
    """Two bodies about their origins, without acceleration of these."""
    rate_a, rate_b, none = np.linalg.norm(w_a), np.linalg.norm(w_b), (0.0, 0.0, 0.0)
    return Approach(
        vector(v), none, vector(w_a), vector(w_b), rate_a**2, rate_b**2, 0.0, rate_a**3, rate_b**3, 0.0,
        start, growth, until,
    )  # fmt: skip


@pytest.mark.parametrize("count", [1, 3, WIDTH])
@pytest.mark.parametrize("spin", [0.0, 1.0])
def test_no_triangles_come_near_before_the_time(count: int, spin: float) -> None:
    # many of these triangles overlap along the line of the nearest two now, and part along it later
    rng = np.random.default_rng(100 * count + int(spin))
    work, reached = np.zeros(MEMORY), 0
    for _ in range(300):
        a, b = (rng.normal(size=(count, 1, 3)) + 0.5 * rng.normal(size=(count, 3, 3)) for _ in range(2))
        trees = tree_of(a), tree_of(b)
        turn, p, v = Rotation.random(random_state=rng), 1.5 * rng.normal(size=3), rng.normal(size=3)
        w_a, w_b = spin * rng.normal(size=(2, 3))
        X = Placing(*map(float, turn.as_matrix().ravel()), *vector(p))
        start, growth, until = 0.01, 0.02, 2.0
        move, tolerance = approach(v, w_a, w_b, start, growth, until), 1e-3
        near = int(rng.integers(count)) * WIDTH + int(rng.integers(count)) if rng.random() < 0.5 else -1
        soon, _ = times(*trees, X, move, tolerance, float(rng.exponential()), near, work)
        at = np.linspace(0.0, min(soon, until), MOMENTS)
        least = distances(a, w_a, b, turn, w_b, p, v, at)
        if soon == 0.0:
            assert least[0] <= start + tolerance + 1e-9
        else:
            assert np.all(least >= start + growth * at - 1e-9)
        reached += soon > 0.1
    assert reached > 60  # else the times say little
