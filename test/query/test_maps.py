"""Queries of maps against brute force over their cells: closed forms for spheres, python-fcl for boxes."""

from __future__ import annotations

from typing import Any

import fcl
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.shapes.registry import Shape

EDGE = 0.5


def grid_cells(seed: int) -> tuple[Shape, Any, Any]:
    """A map, and the lower and upper corners (n, 3) of its cells."""
    rng = np.random.default_rng(seed)
    filled = rng.random((80, 70)) < rng.choice([0.03, 0.3, 0.7])
    low = np.column_stack([np.argwhere(filled)[:, ::-1] * EDGE, np.zeros(filled.sum())])
    return cm.Grid(filled, EDGE, 1.5), low, low + np.array([EDGE, EDGE, 1.5])


def voxel_cells(seed: int) -> tuple[Shape, Any, Any]:
    rng = np.random.default_rng(seed)
    coarse = np.argwhere(rng.random((9, 8, 5)) < 0.1) * 4
    fine = np.argwhere(rng.random((36, 32, 20)) < 0.05)
    taken = {tuple(each) for each in coarse.tolist()}
    fine = np.array([each for each in fine.tolist() if tuple(4 * (k // 4) for k in each) not in taken])
    cells, edges = np.concatenate([coarse, fine]) - 7 * 4, np.repeat([4, 1], [len(coarse), len(fine)])
    order = rng.permutation(len(cells))
    low = EDGE * cells.astype(float)
    return cm.Voxels(cells[order], EDGE, edges=edges[order]), low, low + EDGE * edges[:, None]


MAPS = [(grid_cells, 0), (grid_cells, 1), (grid_cells, 5), (voxel_cells, 2), (voxel_cells, 3)]


def sphere_gaps(p: Any, low: Any, high: Any, radius: float) -> Any:
    """Distance (n,) of balls about points from the nearest cell; below 0 if they overlap."""
    nearest = np.clip(p[:, None], low, high)
    return np.linalg.norm(nearest - p[:, None], axis=2).min(axis=1) - radius


def placed(count: int, low: Any, high: Any, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    return rng.uniform(low.min(axis=0) - 1.0, high.max(axis=0) + 1.0, (count, 3)), Rotation.random(count, rng)


@pytest.mark.parametrize(("make", "seed"), MAPS)
@pytest.mark.parametrize("is_swapped", [False, True])
def test_distances_of_spheres_are_those_of_the_nearest_cell(make: Any, seed: int, is_swapped: bool) -> None:
    shape, low, high = make(seed)
    p, turns = placed(400, low, high, seed)
    at, turn = np.array([3.0, -2.0, 1.0]), turns[0]  # the map is moved rigidly
    poses = np.zeros((len(p), 7))
    poses[:, :3], poses[:, 6] = turn.apply(p) + at, 1.0
    X = cm.Pose(at, turn.as_quat())
    ball = cm.Sphere(0.3)
    found = cm.contacts(ball, poses, shape, X) if is_swapped else cm.contacts(shape, X, ball, poses)
    gap = sphere_gaps(p, low, high, 0.3)
    assert (found.overlaps == (gap <= 0.0)).all() and 0 < found.overlaps.sum() < len(p)
    apart = gap > 0.0
    np.testing.assert_allclose(found.signed_distance[apart], gap[apart], atol=1e-9)
    on_map = turn.inv().apply((found.point_b if is_swapped else found.point_a)[apart] - at)
    np.testing.assert_allclose(sphere_gaps(on_map, low, high, 0.0), 0.0, atol=1e-9)


@pytest.mark.parametrize(("make", "seed"), MAPS)
def test_boxes_overlap_and_are_apart_as_python_fcl_says_cell_by_cell(make: Any, seed: int) -> None:
    shape, low, high = make(seed)
    p, turns = placed(60, low, high, seed + 50)
    size = np.array([0.7, 0.4, 0.3])
    box, cell_pose = fcl.Box(*size), cm.Pose()
    for centre, turn in zip(p, turns, strict=True):
        reach = np.linalg.norm(size) / 2 + 1.5
        near = ((low - centre < reach) & (centre - high < reach)).all(axis=1)
        own = fcl.CollisionObject(box, fcl.Transform(turn.as_matrix(), centre))
        gap = np.inf
        for a, b in zip(low[near], high[near], strict=True):
            cell = fcl.CollisionObject(fcl.Box(*(b - a)), fcl.Transform((a + b) / 2))
            gap = min(gap, fcl.distance(own, cell))
        found = cm.contact(shape, cell_pose, cm.Box(size), cm.Pose(centre, turn.as_quat()))
        assert found.overlaps == (gap <= 0.0)
        if 0.0 < gap < 1.4:
            assert found.signed_distance == pytest.approx(gap, abs=1e-4)  # that of fcl


@pytest.mark.parametrize(("make", "seed"), MAPS)
def test_a_sphere_that_flies_meets_the_map_when_it_meets_a_cell(make: Any, seed: int) -> None:
    shape, low, high = make(seed)
    rng = np.random.default_rng(seed)
    p, _ = placed(40, low, high, seed + 9)
    for start in p:
        if sphere_gaps(start[None], low, high, 0.2)[0] < 0.05:
            continue
        speed = rng.normal(size=3) * 2
        motion = cm.Motion(cm.Pose(start), linear=speed)
        found = cm.time_of_impact(shape, cm.Motion(cm.Pose()), cm.Sphere(0.2), motion, horizon=2.0)
        times = np.linspace(0.0, 2.0, 4001)
        gap = sphere_gaps(start + times[:, None] * speed, low, high, 0.2)
        inside = np.flatnonzero(gap < -1e-3)
        if len(inside):
            assert found.status == "hit" and found.lower <= times[inside[0]]
            assert found.upper <= times[inside[0]] + 1e-6
        if found.status == "hit":
            meets = start + found.lower * speed
            assert abs(sphere_gaps(meets[None], low, high, 0.2)[0]) < 1e-5
        elif not len(inside):
            assert gap.min() > -1e-3


def test_unknown_cells_widen_the_bound_to_what_is_known() -> None:
    grid = cm.Grid([[100, 0, 0, -1, 0, 0]], 1.0, 1.0)
    found = cm.contact(grid, (0, 0, 0), cm.Sphere(0.5), (5.5, 0.5, 0.5))
    assert found.signed_distance == pytest.approx(1.0)  # from the unknown cell
    assert found.error_bound == pytest.approx(3.0, abs=1e-9)  # the known one is 4 m away
    apart = cm.contact(cm.Grid([[-1, 0]], 1.0, 1.0), (0, 0, 0), cm.Sphere(0.25), (1.75, 0.5, 0.5))
    assert apart.signed_distance == pytest.approx(0.5) and apart.error_bound == np.inf
    towards = cm.Motion(cm.Pose((5.5, 0.5, 0.5)), linear=(-1, 0, 0))
    still = cm.Motion(cm.Pose())
    impact = cm.time_of_impact(grid, still, cm.Sphere(0.5), towards, horizon=5.0)
    assert impact.lower == pytest.approx(1.0, abs=1e-4) and impact.upper == pytest.approx(4.0, abs=1e-4)
    impact = cm.time_of_impact(grid, still, cm.Sphere(0.5), towards, horizon=2.0)
    assert (impact.status, impact.upper) == ("unresolved", np.inf)
    sure = cm.Grid([[100, 0, 0, -1, 0, 0]], 1.0, 1.0, unknown="obstacle")
    assert cm.contact(sure, (0, 0, 0), cm.Sphere(0.5), (5.5, 0.5, 0.5)).error_bound < 1e-9


def test_terrain_is_as_high_as_its_triangles_and_solid_below() -> None:
    rng = np.random.default_rng(4)
    heights = rng.random((70, 66))
    field, edge = cm.HeightField(heights, 0.5, base=-2.0), 0.5
    xy = rng.uniform(0.01, (65 * edge - 0.01, 69 * edge - 0.01), (500, 2))
    column, row = (xy / edge).astype(int).T
    u, v = (xy / edge).T - (column, row)
    a, b, c, d = (heights[row + r, column + q] for r, q in ((0, 0), (0, 1), (1, 1), (1, 0)))
    z = np.where(v <= u, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d))
    for offset, overlaps in ((0.01, False), (-0.01, True), (-1.0, True)):
        poses = np.zeros((500, 7))
        poses[:, :2], poses[:, 2], poses[:, 6] = xy, z + offset, 1.0
        assert (cm.contacts(field, cm.Pose(), cm.Sphere(1e-6), poses).overlaps == overlaps).all()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: cm.Grid(np.zeros((3, 3)), 0.1), "Grid: expected a cell that is occupied or may be, got none"),
        (lambda: cm.Grid([[-1]], 0.1, unknown="free"), "Grid: expected a cell that is occupied or may be"),
        (lambda: cm.Grid([1, 2], 0.1), r"expected bools or numbers of shape \(rows, columns\)"),
        (lambda: cm.Grid(np.broadcast_to(np.int8(100), (31623, 31623)), 0.1), "expected at most 25000000 cells"),
        (lambda: cm.Grid([[True]], 0.0), "Grid resolution: expected a positive number of metres"),
        (lambda: cm.Grid([[True]], np.nan), "Grid resolution: expected a positive number of metres"),
        (lambda: cm.Grid([[True]], 0.1, unknown="maybe"), "Grid, unknown: expected one of unresolved, obstacle, free"),
        (lambda: cm.Grid([[True, True]], 0.1).updated(0, 1, [[1, 1]]), "Grid update: expected cells within 1 x 2"),
        (lambda: cm.Voxels([(0, 0, 0), (1, 1, 1)], 0.1, edges=[2, 1]), r"got \[1, 1, 1\] within the one of 2 cells"),
        (lambda: cm.Voxels([(1, 0, 0)], 0.1, edges=[2]), "expected powers of two of which the cells are multiples"),
        (lambda: cm.Voxels([(0.5, 0, 0)], 0.1), "Voxels cells: expected integers"),
        (lambda: cm.Voxels([(0, 0, 0), (1 << 17, 0, 0)], 0.1), "expected less than 131072 cells along each axis"),
        (lambda: cm.HeightField([[0, np.inf], [0, 0]], 0.1), "expected NaN or heights up to"),
        (lambda: cm.HeightField([[0, 1], [0, 0]], 0.1, base=0.5), "HeightField base: expected a height below 0 m"),
        (lambda: cm.HeightField(np.zeros((1, 5)), 0.1), "expected 2 x 2 to 250000"),
    ],
)
def test_what_is_no_map_is_refused(make: Any, text: str) -> None:
    with pytest.raises(cm.ShapeError, match=text):
        make()
