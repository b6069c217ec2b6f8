"""Solids of unit cubes that move along their grid: all their faces lie in common planes, and all times are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor import Motion, Pose

Cells = set[tuple[int, int, int]]
SPEED = 2.0
FAR = 8
ACROSS = [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
"""For each axis, the axes whose cross product it is."""


def random_cells(rng: np.random.Generator, count: int) -> Cells:
    """Cells (x, y, z) of a connected solid: each one after the first shares a face with an earlier one."""
    cells = {(0, 0, 0)}
    while len(cells) < count:
        x, y, z = sorted(cells)[rng.integers(len(cells))]
        step = rng.permutation([1, 0, 0]) * rng.choice([-1, 1])
        cells.add((int(x + step[0]), int(y + step[1]), int(z + step[2])))
    return cells


def neighbour(cell: tuple[int, int, int], axis: int, sign: int) -> tuple[int, int, int]:
    x, y, z = (c + sign * (k == axis) for k, c in enumerate(cell))
    return x, y, z


def surface(cells: Cells) -> cm.Mesh:
    """The squares between the cells and the rest, two triangles each, seen anticlockwise from outside."""
    corners: list[NDArray[np.float64]] = []
    for cell in sorted(cells):
        for axis, u, v in ACROSS:
            for sign in (-1, 1):
                if neighbour(cell, axis, sign) in cells:
                    continue
                at, e, f = np.array(cell, float), np.eye(3)[u], np.eye(3)[v]
                at[axis] += sign > 0
                square = [at, at + e, at + e + f, at + f][::sign]
                corners += [*square[:3], square[2], square[3], square[0]]
    return cm.Mesh(np.array(corners), np.arange(len(corners)).reshape(-1, 3))


def overlap_distance(a: Cells, b: Cells) -> int | None:
    """How far b moves along -x until its interior meets that of a, 0 if it does now; None for never."""
    ways = [x - u for u, v, w in a for x, y, z in b if (y, z) == (v, w)]
    return max(min((way - 1 for way in ways if way > 0), default=-1), 0) if ways and max(ways) > 0 else None


def touch_distance(a: Cells, b: Cells) -> int | None:
    """The same for a first common point of both surfaces."""
    ways = [x - u for u, v, w in a for x, y, z in b if abs(y - v) <= 1 and abs(z - w) <= 1]
    return min(ways) - 1 if ways else None


@pytest.mark.parametrize("is_turned", [False, True])
def test_times_of_solids_of_cubes(is_turned: bool) -> None:
    rng = np.random.default_rng(11)
    sure = 0
    for _ in range(150):
        a, b = random_cells(rng, int(rng.integers(3, 9))), random_cells(rng, int(rng.integers(2, 9)))
        offset = (FAR, int(rng.integers(-2, 3)), int(rng.integers(-2, 3)))
        there = {(x + offset[0], y + offset[1], z + offset[2]) for x, y, z in b}
        deep, touch = overlap_distance(a, there), touch_distance(a, there)
        turn = Rotation.random(rng=rng) if is_turned else Rotation.identity()
        place = Pose(rng.normal(size=3) if is_turned else (0, 0, 0), turn.as_quat())
        shape_a, shape_b = surface(a), surface(b)
        assert shape_a.surface.volume == pytest.approx(len(a)) and shape_a.surface.certain
        still, moving = Motion(place), Motion(place @ Pose(offset), turn.apply((-SPEED, 0, 0)))
        for pair in ((shape_a, still, shape_b, moving), (shape_b, moving, shape_a, still)):
            impact = cm.time_of_impact(*pair, horizon=2.0 * FAR / SPEED)
            if touch is None:
                assert impact.status == "clear"
                continue
            assert impact.lower <= touch / SPEED + 1e-9 or impact.status == "clear"
            if deep is None:
                assert impact.status != "hit"
                continue
            assert impact.status != "clear" and impact.upper >= deep / SPEED - 1e-9
            if deep == touch:
                assert impact.status == "hit" and impact.upper - impact.lower < 1e-4
                sure += 1
    assert sure > 30
