"""The bound along an axis that turns, against the gap along it at many times."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor._jit import kernel
from collision_monitor.impact.advance import Placed, advance_along_axis
from collision_monitor.motion.motion import PairChange
from collision_monitor.shapes.pose import from_rotation_vector, rotation_matrix
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.shape_table import ShapeTable, ShapeTableBuilder

Array = NDArray[np.float64]
UNTIL = 2.0

SHAPES: dict[str, Any] = {
    "sphere": cm.Sphere(0.4),
    "box": cm.Box((1.0, 0.3, 0.6)),
    "capsule": cm.Capsule(0.1, 1.2),
    "cylinder": cm.Cylinder(0.3, 0.8),
    "cone": cm.Cone(0.3, 0.8),
    "ellipsoid": cm.Ellipsoid((0.2, 0.4, 0.6)),
    "hull": cm.ConvexHull(np.random.default_rng(1).normal(0, 0.3, (12, 3))),
}


@kernel
def _advances(table: Any, rotation: Any, rows: Any, gap: float, until: float, found: Any) -> None:
    """rows (N, 12, 3): n, m, offsets of A and B from their bodies, p, v, w of A and B, how these change, a, jerk."""
    for k in range(len(rows)):
        r = rows[k]
        at = Placed(
            0, 1, rotation[0, k], rotation[1, k], (r[2, 0], r[2, 1], r[2, 2]), (r[3, 0], r[3, 1], r[3, 2]),
            (r[4, 0], r[4, 1], r[4, 2]), (r[5, 0], r[5, 1], r[5, 2]), (r[6, 0], r[6, 1], r[6, 2]),
            (r[7, 0], r[7, 1], r[7, 2]), PairChange(
                (r[10, 0], r[10, 1], r[10, 2]), np.sqrt(r[11, 0] ** 2 + r[11, 1] ** 2 + r[11, 2] ** 2),
                (r[8, 0], r[8, 1], r[8, 2]), (r[9, 0], r[9, 1], r[9, 2]),
            ),
        )  # fmt: skip
        found[k] = advance_along_axis(
            table, at, (r[0, 0], r[0, 1], r[0, 2]), (r[1, 0], r[1, 1], r[1, 2]), 0.0, gap, until
        )


def _table(a: Any, b: Any) -> ShapeTable:
    builder = ShapeTableBuilder()
    builder.append(a)
    builder.append(b)
    return builder.table


def _along(shapes: tuple[Any, Any], rotations: Array, row: Array, times: Array) -> Array:
    """True gaps along the axis at the times (T,): supports of the shapes in their poses at each time."""
    n, m, *offsets, p, v, w_a, w_b, turning_a, turning_b, acceleration, jerk = row
    t = times[:, None]
    axis = rotation_matrix(from_rotation_vector(t * np.cross(n, m))) @ n
    gap = np.einsum("ti,ti->t", axis, p + t * v + t**2 / 2 * acceleration + t**3 / 6 * jerk)
    angles = t * w_a + t**2 / 2 * turning_a, t * w_b + t**2 / 2 * turning_b  # about an axis at rest
    for shape, R, angle, offset, sign in zip(shapes, rotations, angles, offsets, (1.0, -1.0), strict=True):
        turned = rotation_matrix(from_rotation_vector(angle))
        own = np.einsum("ij,tki,tk->tj", R, turned, sign * axis)  # R^T turned^T axis
        gap -= np.asarray(reach([(shape, cm.Pose())], own)) + sign * np.einsum("ti,ti->t", axis, turned @ offset)
    return gap


@pytest.mark.parametrize(
    ("a", "b"), [("box", "box"), ("box", "capsule"), ("sphere", "box"), ("cylinder", "box"), ("cone", "hull")]
)
def test_the_gap_stays_open_along_every_axis(a: str, b: str) -> None:
    """Until the time that the bound returns; for slow turning this is nearly the true time."""
    rng = np.random.default_rng(7)
    shapes, count = (SHAPES[a], SHAPES[b]), 60
    q = rng.normal(size=(2, count, 4))
    rotation = rotation_matrix(q / np.linalg.norm(q, axis=-1, keepdims=True))
    rows = rng.normal(size=(count, 12, 3))
    n = rows[:, 0]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    rows[:, 1] -= np.einsum("ki,ki->k", rows[:, 1], n)[:, None] * n
    rows[: count // 4, 1] = 0.0  # axes at rest
    rows[:, 8:10] = rows[:, 6:8] * rng.choice([0.0, -0.5, 0.7], (count, 2, 1))  # they turn faster and slower
    rows[::3, 10:] = 0.0  # no acceleration
    rows[1::3, 11] = 0.0  # a constant one
    rows[:, 2:4] *= rng.choice([0.0, 0.3], (count, 2, 1))
    gaps = np.array([_along(shapes, rotation[:, k], rows[k], np.zeros(1))[0] for k in range(count)])
    gap = 0.5
    rows[:, 4] += (gap - gaps)[:, None] * n  # makes the gap half a metre along each axis
    found = np.empty(count)
    _advances(_table(*shapes), rotation, rows, gap, UNTIL, found)
    assert (found > 0.0).all()
    for k in range(count):
        times = np.linspace(0.0, found[k], 200)
        assert _along(shapes, rotation[:, k], rows[k], times).min() > -1e-12


@pytest.mark.parametrize(("a", "b"), [("box", "box"), ("cylinder", "box")])
def test_with_an_axis_that_turns_with_a_face_little_is_left(a: str, b: str) -> None:
    """A ball moves onto a turning face: the face's turning normal gives nearly the true time, an axis at rest less."""
    shapes = (SHAPES[a], cm.Sphere(0.2))
    n, w = np.array([0.0, 0.0, 1.0]), np.array([0.4, -0.3, 0.0])
    rows = np.zeros((2, 12, 3))
    rows[:, 0], rows[:, 4], rows[:, 5], rows[:, 6] = n, (0.0, 0.0, 0.31 + 0.2 + 0.3), (0.0, 0.0, -1.0), w
    rows[1, 1] = np.cross(w, n)
    rotation = np.tile(np.eye(3), (2, 2, 1, 1))
    gap = float(_along(shapes, rotation[:, 0], rows[0], np.zeros(1))[0])
    found = np.empty(2)
    _advances(_table(*shapes), rotation, rows, gap, UNTIL, found)
    times = np.linspace(0.0, 1.0, 100001)
    true = times[np.argmax(_along(shapes, rotation[:, 0], rows[1], times) < 0.0)]
    assert found[0] < 0.9 * true
    assert 0.97 * true < found[1] <= true
