"""Sphere trees contain their body at every level; bodies that gain nothing have none."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.impact.sphere_trees import LEVELS, body_tree
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.shapes.pose import Pose, from_rotation_vector
from collision_monitor.shapes.registry import Box, ConvexHull, Cylinder, Shape, Sphere

TURNED = Pose((0.3, -2.0, 5.0), tuple(from_rotation_vector(np.array([0.4, 1.1, -0.7]))))


def tree_of(*shapes: tuple[Shape, Pose], padding: float = 0.0):
    monitor = Monitor()
    monitor.add(1, shapes, padding=padding)
    table, parts, bodies = monitor._roster.multibody
    return body_tree(table, parts.next, int(bodies.first_shape[0]))


@pytest.mark.parametrize("padding", [0.0, 0.05])
def test_every_level_contains_the_body(padding: float) -> None:
    random = np.random.default_rng(1)
    corners = random.normal(size=(60, 3)) * (2.0, 0.2, 0.15)
    for points, shape in ((corners, ConvexHull(corners)), (_corners((0.2, 0.3, 3.0)), Box((0.2, 0.3, 3.0)))):
        tree = tree_of((shape, TURNED), padding=padding)
        assert tree is not None
        center, radius = tree
        inside = random.dirichlet(np.full(len(points), 0.1), 3000) @ points
        inside = np.concatenate([inside, points]) @ TURNED.rotation.T + TURNED.position
        for level in range(LEVELS + 1):
            those = slice(2**level - 1, 2 ** (level + 1) - 1)
            off = np.linalg.norm(inside[:, None] - center[those], axis=2) - radius[those]
            assert off.min(axis=1).max() <= -padding + 1e-12
        assert radius[-1] < 0.5 * radius[0]


def _corners(size: tuple[float, float, float]) -> np.ndarray:
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2


def test_two_boxes_in_a_row_are_one_long_body() -> None:
    ends = [(Box((0.2, 0.2, 0.2)), Pose((x, 0.0, 0.0))) for x in (-1.0, 1.0)]
    tree = tree_of(*ends)
    assert tree is not None and tree[1][0] == pytest.approx(np.sqrt(1.1**2 + 2 * 0.1**2))


@pytest.mark.parametrize(
    "shape",
    [Sphere(1.0), Cylinder(0.1, 3.0), Box((1, 1, 1)), Box((1, 1, 0.01))],
    ids=["sphere", "no corners", "cube", "plate"],
)
def test_where_spheres_tell_no_more_there_is_none(shape: Shape) -> None:
    assert tree_of((shape, Pose())) is None
