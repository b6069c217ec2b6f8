"""The bound on how far a box reaches, against the corners of all triangles in it, and against the box itself."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from collision_monitor.meshes.layout import AXES, CENTER, CHILD, CORNERS, HALF, RADIUS, WIDTH
from collision_monitor.meshes.supports import content_reach_along, support_bounds
from collision_monitor.meshes.trees.cloud_tree import cloud_tree
from collision_monitor.meshes.trees.tree import tree_of

Array = NDArray[np.float64]

RNG = np.random.default_rng(7)
RING = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=8)
TREES = {
    "ring": tree_of(RING.vertices[RING.faces] + [30.0, 0.0, 0.0]),
    "soup": tree_of(RNG.normal(size=(700, 1, 3)) + 0.3 * RNG.normal(size=(700, 3, 3)), RNG.uniform(0.0, 0.2, 700)),
    "point": tree_of(np.zeros((1, 3, 3)), 0.5),
    "cloud": cloud_tree(RNG.normal(size=(700, 3))),
}
DIRECTIONS = np.concatenate([np.eye(3), -np.eye(3), RNG.normal(size=(12, 3))])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


def content(tree: Array, block: int, member: int) -> Array:
    """How far the triangles in a box reach along the DIRECTIONS (m)."""
    child = int(tree[block, CHILD, member])
    if child > 0:
        return np.max([content(tree, child, k) for k in range(WIDTH) if tree[child, CHILD, k] != 0.0], axis=0)
    leaf = tree[-child]
    along = leaf[CORNERS : CORNERS + 9].T.reshape(WIDTH, 3, 3) @ DIRECTIONS.T
    return np.asarray((along.max(axis=1) + leaf[RADIUS][:, None]).max(axis=0))


@pytest.mark.parametrize("tree", TREES.values(), ids=TREES)
def test_the_supports_hold_the_content_of_a_box_and_are_within_the_box(tree):
    waiting, scratch = [(0, 0)], np.empty(WIDTH)
    wider = 0.0
    while waiting:
        block, member = waiting.pop()
        least = content(tree, block, member)
        axes = tree[block, AXES : AXES + 9, member].reshape(3, 3)
        most = tree[block, CENTER : CENTER + 3, member] @ DIRECTIONS.T
        most = most + tree[block, HALF : HALF + 3, member] @ np.abs(axes.T @ DIRECTIONS.T)
        for k, d in enumerate(DIRECTIONS):
            reach = content_reach_along(tree, block, member, tuple(d))
            assert least[k] <= reach <= most[k] + 1e-12
            wider = max(wider, most[k] - reach)
            support_bounds(tuple(d), tuple(-d), (100.0, 0.0), tree, block, scratch, 0)  # of the whole block at once
            assert 100.0 - np.sqrt(scratch[member]) == pytest.approx(reach, abs=1e-12)
        child = int(tree[block, CHILD, member])
        if child > 0:
            waiting += [(child, k) for k in range(WIDTH) if tree[child, CHILD, k] != 0.0]
    assert wider > 0.1  # the supports are less than those of the box
