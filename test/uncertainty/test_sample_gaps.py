"""Gaps of samples along planes, against support values of the turned shapes computed one by one with NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.impact.body_impact import ShapePair, Window
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.motion.last_state import carry_on
from collision_monitor.uncertainty.obstacle_planes import (
    ABOUT_ALL,
    APART,
    LOUD,
    MODE,
    NO_TURNS,
    QUIET,
    set_middles,
    set_nodes,
    split_segment,
)
from collision_monitor.uncertainty.plane_memory import make_plane_memory
from collision_monitor.uncertainty.samples.error_samples import make_workspace
from collision_monitor.uncertainty.samples.normal_samples import sample_columns
from collision_monitor.uncertainty.samples.sample_gaps import (
    FIRST_ORDER,
    NOT_TURNED,
    SERIES,
    enter_planes,
    set_bends,
    set_samples,
)

Vector = NDArray[np.float64]
SAMPLES = 64
CORNERS = np.random.default_rng(1).normal(0, 0.3, (12, 3))


def box(n: Vector) -> float:
    return float(np.abs(n) @ (0.45, 0.25, 0.35))


def capsule(n: Vector) -> float:
    return float(0.2 + 0.4 * abs(n[2]))


def cylinder(n: Vector) -> float:
    return float(0.3 * np.hypot(n[0], n[1]) + 0.4 * abs(n[2]))


def cone(n: Vector) -> float:
    return float(max(0.45 * n[2], 0.4 * np.hypot(n[0], n[1]) - 0.45 * n[2]))


def ellipsoid(n: Vector) -> float:
    return float(np.linalg.norm(n * (0.5, 0.3, 0.4)))


def hull(n: Vector) -> float:
    return float((CORNERS @ n).max())


SHAPES: dict[str, tuple[Any, Any]] = {
    "box": (cm.Box((0.9, 0.5, 0.7)), box),
    "capsule": (cm.Capsule(0.2, 0.8), capsule),
    "cylinder": (cm.Cylinder(0.3, 0.8), cylinder),
    "cone": (cm.Cone(0.4, 0.9), cone),
    "ellipsoid": (cm.Ellipsoid((0.5, 0.3, 0.4)), ellipsoid),
    "hull": (cm.ConvexHull(CORNERS), hull),
}


def moving_pair(
    names: tuple[str, str], poses: NDArray[np.float64], twists: NDArray[np.float64]
) -> tuple[Any, Any, ShapePair, Any, Any]:
    """Table and parts of two shapes with these poses (2, 7) and twists (2, 6), the pair, and memory for its samples."""
    monitor = Monitor()
    for k, name in enumerate(names):
        monitor.add(k, SHAPES[name][0])
    monitor.step(0, [0, 1], poses, twists)
    table, parts, bodies = monitor.roster.multibody
    work, memory = make_workspace(), make_plane_memory(SAMPLES)
    for k in range(2):
        carry_on(bodies, k, 0.0, work.quaternion, work.motion[k])
    pair = ShapePair(work.motion[0], work.motion[1], bodies.first_shape[0], bodies.first_shape[1])
    return table, parts, pair, work, memory


def turn(v: Vector) -> Vector:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = v / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)


@pytest.mark.parametrize("axis", [None, 0, 2], ids=["any normal", "face", "end"])
@pytest.mark.parametrize("mode", [0, 1, 2])
@pytest.mark.parametrize("order", [NOT_TURNED, FIRST_ORDER, SERIES])
def test_gaps_are_those_of_the_turned_shapes(order: int, mode: int, axis: int | None) -> None:
    """axis: along it, in the axes of a shape, errors of orientation change the corner that is farthest."""
    rng = np.random.default_rng(10 * order + mode)
    spread = {NOT_TURNED: 0.0, FIRST_ORDER: 0.003, SERIES: 0.3}[order]
    for name_a, name_b in zip(SHAPES, [*list(SHAPES)[1:], "box"], strict=True):
        q = rng.normal(size=(2, 4))
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        p = rng.normal(size=(2, 3))
        p[1, 0] += 3.0
        poses, twists = np.column_stack([p, q]), rng.normal(size=(2, 6))
        table, parts, pair, work, memory = moving_pair((name_a, name_b), poses, twists)
        obstacle, rows, points = memory.obstacle, memory.rows, sample_columns(SAMPLES).points
        turning = ((spread, 0.5 * spread, -0.1 * spread, 0.4 * spread), (0.7 * spread, 0.0, 0.0, 0.0))
        assert set_nodes(table, parts, pair, Window(0.0, 0.4), 0.4, turning, ABOUT_ALL, work.scratch, obstacle) == 1
        memory.off[:] = rng.normal(0, 0.1, memory.off.shape)
        orders = (order, order)
        set_samples(obstacle, 0, memory.off, points, orders, 0, SAMPLES, rows)
        n = rng.normal(size=3)
        if axis is not None:
            n = np.eye(3)[axis] if mode < 2 else obstacle.node[0]["rotation"][0][:, axis]
        planes = obstacle.planes[0, :1]
        planes[0, :3], planes[0, MODE] = n / np.linalg.norm(n), mode
        enter_planes(
            table,
            pair,
            planes,
            0.05,
            orders,
            obstacle.node[:2],
            obstacle.middle[0],
            0,
            SAMPLES,
            rows,
            memory.entry,
            memory.leave,
        )
        for end in range(2):
            node, state = obstacle.node[end], rows.node[end]
            if order != NOT_TURNED:
                for k in range(2):
                    own, left = points[6 + 3 * k : 9 + 3 * k], points[12 + 3 * k : 15 + 3 * k]
                    turned = node["turn"][k] @ own + node["left"][k] @ left
                    np.testing.assert_allclose(state[3 + 3 * k : 6 + 3 * k, :SAMPLES], turned, rtol=1e-5, atol=1e-7)
            for m in range(SAMPLES):
                R = [turn(state[3 + 3 * k : 6 + 3 * k, m]) @ node["rotation"][k] for k in range(2)]
                u = planes[0, :3] if mode == 2 else R[mode] @ planes[0, :3]
                reach = SHAPES[name_a][1](R[0].T @ u) + SHAPES[name_b][1](-R[1].T @ u)
                p = node["position"] + state[:3, m]
                expected = float(u @ p) - reach - 0.05
                angle = float(np.linalg.norm(state[3:6, m]) + np.linalg.norm(state[6:9, m]))
                second = angle**2 * (float(np.linalg.norm(p)) + 1.0) + 2e-6  # of a radius of at most 1 m
                allowed = {NOT_TURNED: 1e-6, FIRST_ORDER: second, SERIES: 1e-3}[order]
                assert rows.gap[end, m] == pytest.approx(expected, abs=allowed)


def test_the_halves_of_a_segment_are_those_of_a_shorter_one() -> None:
    poses = np.array([[0, 0, 0, 0.1, 0.2, 0.3, 0.9], [1.0, 0.5, 0, 0.4, 0.1, 0, 0.9]])
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    table, parts, pair, work, memory = moving_pair(("box", "hull"), poses, np.arange(12.0).reshape(2, 6) / 10)
    turning, obstacle = ((0.02, 0.01, 0.0, 0.03), (0.03, 0.0, 0.0, 0.0)), memory.obstacle
    whole, halved = ((table, parts, pair, Window(0.0, 0.6), length) for length in (0.2, 0.1))
    count = set_nodes(*halved, turning, ABOUT_ALL, work.scratch, obstacle)
    set_middles(table, parts, pair, count, turning, ABOUT_ALL, work.scratch, obstacle)
    nodes, middles = obstacle.node[: count + 1].copy(), obstacle.middle[:count].copy()
    count = set_nodes(*whole, turning, ABOUT_ALL, work.scratch, obstacle)
    set_middles(table, parts, pair, count, turning, ABOUT_ALL, work.scratch, obstacle)
    planes = np.random.default_rng(0).normal(size=obstacle.planes.shape)
    obstacle.planes[:], obstacle.count[:3], obstacle.quiet[:3] = planes, (2, 40, 3), (LOUD, QUIET, APART)
    later = obstacle.node[2:4].copy(), obstacle.middle[2].copy()
    split_segment(table, parts, pair, 1, 3, turning, ABOUT_ALL, work.scratch, obstacle)
    assert obstacle.count[:4].tolist() == [2, 0, 0, 3]  # each half of a segment with so many needs other ones
    assert obstacle.quiet[:4].tolist() == [LOUD, QUIET, QUIET, APART]
    np.testing.assert_array_equal(obstacle.planes[3, :3], planes[2, :3])
    assert (obstacle.node[3:5] == later[0]).all() and obstacle.middle[3] == later[1]
    for name in nodes.dtype.names or ():
        np.testing.assert_allclose(obstacle.node[[1, 2, 3]][name], nodes[[2, 3, 4]][name], atol=1e-12)
        np.testing.assert_allclose(obstacle.middle[[1, 2]][name], middles[[2, 3]][name], atol=1e-12)
    split_segment(table, parts, pair, 0, 4, turning, ABOUT_ALL, work.scratch, obstacle)
    assert obstacle.count[:5].tolist() == [2, 2, 0, 0, 3]
    np.testing.assert_array_equal(obstacle.planes[:2, :2], np.stack([planes[0, :2]] * 2))


def times_behind(gap: Vector, times: Vector) -> tuple[float, float]:
    """First and last time (s) at which a gap, given at these times (n,), is closed; (inf, -inf): never."""
    closed = np.flatnonzero(gap <= 0.0)
    if len(closed) == 0:
        return np.inf, -np.inf
    i, j = closed[0], closed[-1]
    first = np.interp(0.0, gap[[i, i - 1]], times[[i, i - 1]]) if i > 0 else times[0]
    last = np.interp(0.0, gap[[j, j + 1]], times[[j, j + 1]]) if j + 1 < len(gap) else times[-1]
    return float(first), float(last)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_parabolas_give_the_times_behind_a_plane_of_bodies_that_turn(mode: int) -> None:
    """Straight lines between the ends of the segment are off by more than four times as much, in the mean."""
    rng = np.random.default_rng(mode)
    off: dict[bool, list[float]] = {False: [], True: []}
    end, orders, still = 0.3, (NOT_TURNED, NOT_TURNED), NO_TURNS
    for name in ("capsule", "cylinder", "ellipsoid", "cone") * 20:
        q, p, n = rng.normal(size=(2, 4)), np.zeros((2, 3)), rng.normal(size=3)
        n /= np.linalg.norm(n)
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        twist = np.column_stack([rng.normal(size=(2, 3)), rng.normal(0, 1.5, (2, 3))])
        p[1] = 0.9 * n - 0.5 * end * (twist[1, :3] - twist[0, :3])
        table, parts, pair, work, memory = moving_pair((name, "ellipsoid"), np.column_stack([p, q]), twist)
        obstacle, rows, points = memory.obstacle, memory.rows, sample_columns(SAMPLES).points
        memory.off[:] = rng.normal(0, 0.1, memory.off.shape)
        errors, window = memory.off[:6, :SAMPLES], Window(0.0, end)
        parts_of_time = set_nodes(table, parts, pair, window, end / 40, still, ABOUT_ALL, work.scratch, obstacle)
        nodes = obstacle.node[: parts_of_time + 1].copy()
        plane, times = obstacle.planes[0, 0], nodes["time"]
        plane[:3], plane[MODE] = (nodes["rotation"][20, mode].T @ n) if mode < 2 else n, mode
        gaps = np.empty((len(nodes), SAMPLES))
        for gap, node in zip(gaps, nodes, strict=True):
            R = node["rotation"]
            u = R[mode] @ plane[:3] if mode < 2 else n
            reach = SHAPES[name][1](R[0].T @ u) + ellipsoid(-R[1].T @ u)
            gap[:] = u @ (node["position"][:, None] + errors[:3] + node["time"] * errors[3:]) - reach
        set_nodes(table, parts, pair, window, end, still, ABOUT_ALL, work.scratch, obstacle)
        set_middles(table, parts, pair, 1, still, ABOUT_ALL, work.scratch, obstacle)
        set_samples(obstacle, 0, memory.off, points, orders, 0, SAMPLES, rows)
        ends, middle, planes = obstacle.node[:2], obstacle.middle[0], obstacle.planes[0, :1]
        for bends in (False, True):
            set_bends(table, pair, plane, ends, middle, 0.0 if bends else np.inf)
            entry, leave = np.zeros(SAMPLES, np.float32), np.ones(SAMPLES, np.float32)
            enter_planes(table, pair, planes, 0.0, orders, ends, middle, 0, SAMPLES, rows, entry, leave)
            for m in range(SAMPLES):
                first, last = times_behind(gaps[:, m], times)
                enters, leaves = end * float(entry[m]), end * float(leave[m])
                if first <= last and enters <= leaves:
                    off[bends].append(abs(enters - first) + abs(leaves - last))
                elif first <= last or enters <= leaves:
                    off[bends].append(last - first if first <= last else leaves - enters)
    assert 4.0 * np.mean(off[True]) < np.mean(off[False])
