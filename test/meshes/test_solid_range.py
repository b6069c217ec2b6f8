"""The bounds on the depth of a tree in a solid hold that of its deepest triangle, and those of a point its distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from collision_monitor._jit import kernel
from collision_monitor.impact.body_impact import make_scratch
from collision_monitor.meshes.distance.solid import SolidMemory, solid_contact
from collision_monitor.meshes.distance.solid_range import solid_range
from collision_monitor.meshes.trees.shape_trees import made_tree
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import point_distance_range
from collision_monitor.shapes.registry import Box, Cone, Cylinder, Ellipsoid, HalfSpace, Mesh, Points, Shape
from collision_monitor.shapes.shape_table import ShapeTable, ShapeTableBuilder
from collision_monitor.world.arm import link

RNG = np.random.default_rng(3)
TREES: dict[str, Shape] = {
    "link": link(0.8, 0.15),
    "soup": Mesh((RNG.normal(size=(40, 1, 3)) + 0.4 * RNG.normal(size=(40, 3, 3))).reshape(-1, 3) * 0.3,
                 np.arange(120).reshape(-1, 3)),
    "cloud": Points(RNG.normal(size=(60, 3)) * 0.3, 0.02),
}  # fmt: skip
SOLIDS: dict[str, Shape] = {
    "cylinder": Cylinder(0.2, 0.7),
    "cone": Cone(0.3, 0.6),
    "flat cone": Cone(0.5, 0.05),
    "ellipsoid": Ellipsoid((0.1, 0.3, 0.5)),
    "half-space": HalfSpace((0.6, 0.0, 0.8), 0.1),
    "box": Box((0.5, 0.3, 0.2)),
}


@kernel
def ranges(tree, margin, table, R_a, R_b, p, wanted, out, triangle, gjk, tree_work, found):
    pose = PairPose(R_a, R_b, (p[0], p[1], p[2]))
    memory = SolidMemory(triangle, gjk, tree_work)
    found[0], found[1] = solid_range(tree, 0, margin, table, 0, pose, wanted, out, memory)


@kernel
def contact(tree, margin, table, R_a, R_b, p, limit, out, triangle, gjk, tree_work):
    pose, memory = PairPose(R_a, R_b, (p[0], p[1], p[2])), SolidMemory(triangle, gjk, tree_work)
    return solid_contact(tree, 0, margin, table, 0, pose, limit, out, memory)


@kernel
def point_ranges(table, points, lower, upper, normal):
    for k in range(len(points)):
        lower[k], upper[k], n = point_distance_range(table, 0, (points[k, 0], points[k, 1], points[k, 2]))
        normal[k, 0], normal[k, 1], normal[k, 2] = n


def table_of(shape: Shape, padding: float = 0.0) -> ShapeTable:
    builder = ShapeTableBuilder()
    builder.append(shape, margin=padding)
    return builder.table


@pytest.mark.parametrize("other", list(SOLIDS))
@pytest.mark.parametrize("name", list(TREES))
def test_the_range_holds_the_depth_of_the_deepest_triangle(name: str, other: str) -> None:
    rng = np.random.default_rng(7)
    tree, table, s = made_tree(TREES[name]), table_of(SOLIDS[other], padding=0.03), make_scratch()
    assert tree is not None
    found, out, row = np.zeros(2), np.zeros(CONTACT_SIZE), np.zeros(CONTACT_SIZE)
    meeting = apart = 0
    for _ in range(60):
        R_a, R_b = Rotation.random(2, rng=rng).as_matrix()
        p, margin = rng.normal(size=3) * 0.3, rng.choice([0.0, 0.05])
        touches = contact(tree, margin, table, R_a, R_b, p, 0.0, out, s.triangle, s.work, s.tree)
        for wanted in (1e-3, 0.02, 0.1, np.inf):
            ranges(tree, margin, table, R_a, R_b, p, wanted, row, s.triangle, s.work, s.tree, found)
            least, most = found
            if abs(out[DISTANCE]) > 1e-6 or not touches:
                assert np.isfinite(least) == touches
            if np.isfinite(least):
                round_off = out[BOUND] + row[BOUND]
                assert least - round_off <= out[DISTANCE] <= most + round_off
                assert most - least <= wanted + row[BOUND]
                assert row[DISTANCE] == most
                assert np.isclose(np.linalg.norm(row[NORMAL : NORMAL + 3]), 1.0)
                on_b = row[POINT_A : POINT_A + 3] + most * row[NORMAL : NORMAL + 3]
                np.testing.assert_allclose(row[POINT_B : POINT_B + 3], on_b, atol=1e-12)
        meeting, apart = meeting + touches, apart + (not touches)
    assert meeting > 5
    assert apart > 0


@pytest.mark.parametrize("name", list(SOLIDS))
def test_the_range_of_a_point_holds_its_distance(name: str) -> None:
    """The signed distance is the largest n . x - h(n); found by a search over the directions."""
    rng = np.random.default_rng(2)
    table = table_of(SOLIDS[name])
    points = rng.normal(size=(40, 3)) * rng.choice([0.05, 0.3, 1.0], (40, 1))
    points[0], points[1] = 0.0, (0.0, 0.0, 0.1)
    lower, upper, normal = np.zeros(40), np.zeros(40), np.zeros((40, 3))
    point_ranges(table, points, lower, upper, normal)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)
    h = SUPPORTS.get(name)
    if h is None:
        return
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for x, low, high, n in zip(points, lower, upper, normal, strict=True):

        def apart(d: np.ndarray, x: np.ndarray = x) -> float:
            unit = d / np.linalg.norm(d)
            return float(h(unit) - unit @ x)

        assert np.isclose(-apart(n), low, atol=1e-12)
        start = directions[np.argmax(directions @ x - h(directions))]
        options = {"xatol": 1e-10, "fatol": 1e-12}
        found = -min(float(minimize(apart, at, method="Nelder-Mead", options=options).fun) for at in (start, n))
        assert low <= found + 1e-9
        assert found <= high + 1e-7
        if name != "ellipsoid":
            assert np.isclose(low, high)
            assert np.isclose(found, high, atol=1e-6)


def _across(d: np.ndarray) -> np.ndarray:
    return np.hypot(d[..., 0], d[..., 1])


SUPPORTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "cylinder": lambda d: 0.2 * _across(d) + 0.35 * np.abs(d[..., 2]),
    "cone": lambda d: np.maximum(0.3 * d[..., 2], 0.3 * _across(d) - 0.3 * d[..., 2]),
    "flat cone": lambda d: np.maximum(0.025 * d[..., 2], 0.5 * _across(d) - 0.025 * d[..., 2]),
    "ellipsoid": lambda d: np.linalg.norm(d * (0.1, 0.3, 0.5), axis=-1),
    "box": lambda d: np.abs(d) @ (0.25, 0.15, 0.1),
}
"""Support functions of SOLIDS."""
