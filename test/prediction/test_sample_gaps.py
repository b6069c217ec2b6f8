"""Gaps of samples along planes, against support values of the turned shapes computed one by one with NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.prediction.body_impact import ShapePair, Window
from collision_monitor.prediction.error_samples import make_workspace
from collision_monitor.prediction.motion import carry_on
from collision_monitor.prediction.normal_samples import sample_columns
from collision_monitor.prediction.obstacle_planes import MODE, set_nodes
from collision_monitor.prediction.plane_memory import make_plane_memory
from collision_monitor.prediction.sample_gaps import FIRST_ORDER, NOT_TURNED, SERIES, enter_planes, set_samples

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
        monitor = Monitor()
        monitor.add(0, SHAPES[name_a][0])
        monitor.add(1, SHAPES[name_b][0])
        q = rng.normal(size=(2, 4))
        p = rng.normal(size=(2, 3))
        p[1, 0] += 3.0
        monitor.step(0, [0, 1], np.column_stack([p, q]), rng.normal(size=(2, 6)))
        table, parts, bodies = monitor.roster.multibody
        work, memory, points = make_workspace(), make_plane_memory(SAMPLES), sample_columns(SAMPLES).points
        for k in range(2):
            carry_on(bodies, k, 0.0, work.quaternion, work.motion[k])
        pair = ShapePair(work.motion[0], work.motion[1], bodies.first_shape[0], bodies.first_shape[1])
        obstacle, rows = memory.obstacle, memory.rows
        turning = ((spread, 0.5 * spread), (0.7 * spread, 0.0))
        assert set_nodes(table, parts, pair, Window(0.0, 0.4), 0.4, turning, False, work.scratch, obstacle) == 1
        memory.off[:] = rng.normal(0, 0.1, memory.off.shape)
        orders = (order, order)
        set_samples(obstacle, 0, memory.off, points, orders, 0, SAMPLES, rows)
        n = rng.normal(size=3)
        if axis is not None:
            n = np.eye(3)[axis] if mode < 2 else obstacle.node[0]["rotation"][0][:, axis]
        planes = obstacle.planes[0, :1]
        planes[0, :3], planes[0, MODE] = n / np.linalg.norm(n), mode
        enter_planes(
            table, pair, planes, 0.05, orders, obstacle.node[:2], 0, SAMPLES, rows, memory.entry, memory.leave
        )
        for end in range(2):
            node, state = obstacle.node[end], rows.node[end]
            for m in range(SAMPLES):
                R = [turn(state[3 + 3 * k : 6 + 3 * k, m]) @ node["rotation"][k] for k in range(2)]
                u = planes[0, :3] if mode == 2 else R[mode] @ planes[0, :3]
                reach = SHAPES[name_a][1](R[0].T @ u) + SHAPES[name_b][1](-R[1].T @ u)
                expected = float(u @ state[:3, m]) - reach - 0.05
                assert rows.gap[end, m] == pytest.approx(expected, abs=1e-3 if order == SERIES else 1e-4)
