"""The bounds on the depth of two trees hold the depth of their deepest triangles, and are as near as they should be."""

from __future__ import annotations

import numpy as np
import pytest
from kernels import trees_touch
from scipy.spatial.transform import Rotation

from collision_monitor._jit import kernel
from collision_monitor.meshes.distance.contact import tree_contact
from collision_monitor.meshes.distance.depth_range import depth_range
from collision_monitor.meshes.distance.nearest import MEMORY, answer_row
from collision_monitor.meshes.placing import relative
from collision_monitor.meshes.trees.shape_trees import made_tree
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE, DISTANCE
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Shape, Sphere
from collision_monitor.world.arm import link

RNG = np.random.default_rng(3)
SHAPES: dict[str, Shape] = {
    "link": link(0.8, 0.15),
    "soup": Mesh((RNG.normal(size=(40, 1, 3)) + 0.4 * RNG.normal(size=(40, 3, 3))).reshape(-1, 3) * 0.3,
                 np.arange(120).reshape(-1, 3)),
    "box": Box((0.5, 0.3, 0.2)),
    "hull": ConvexHull(RNG.normal(size=(20, 3)) * 0.3),
    "sphere": Sphere(0.3),
}  # fmt: skip


@kernel
def ranges(blocks, root_b, R_a, R_b, p, wanted, answer, work, found):
    X = relative(R_a, R_b, (p[0], p[1], p[2]))
    found[0], found[1] = depth_range(blocks, 0, root_b, X, wanted, answer, work)


@kernel
def contact(blocks, root_b, R_a, R_b, p, out, answer, work):
    tree_contact(blocks, 0, blocks, root_b, PairPose(R_a, R_b, (p[0], p[1], p[2])), 0.0, out, answer, work)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("other", list(SHAPES))
def test_the_range_holds_the_depth_of_the_deepest_triangles(other: str, scale: float) -> None:
    rng = np.random.default_rng(7)
    tree_a, tree_b = made_tree(_scaled(SHAPES["link"], scale)), made_tree(_scaled(SHAPES[other], scale))
    assert tree_a is not None and tree_b is not None
    blocks, work, found, out = np.concatenate([tree_a, tree_b]), np.zeros(MEMORY), np.zeros(2), np.zeros(CONTACT_SIZE)
    meeting = 0
    for _ in range(60):
        R_a, R_b = Rotation.random(2, rng=rng).as_matrix()
        p, origin = rng.normal(size=3) * 0.3 * scale, np.zeros(3)
        count, _ = trees_touch(tree_a, R_a, origin, tree_b, R_b, p, 1, work)
        contact(blocks, len(tree_a), R_a, R_b, p, out, answer_row(), work)
        for wanted in (0.0, 0.01 * scale, 0.1 * scale, np.inf):
            ranges(blocks, len(tree_a), R_a, R_b, p, wanted, answer_row(), work, found)
            least, most = found
            assert (least >= 0.0) == (count > 0)
            if count:
                assert least - 1e-12 * scale <= -out[DISTANCE] <= most + 1e-12 * scale
                assert most - least <= wanted
        meeting += count
    assert meeting > 5


def _scaled(shape: Shape, scale: float) -> Shape:
    match shape:
        case Mesh():
            return Mesh(shape.vertices * scale, shape.faces)
        case Box():
            return Box(np.asarray(shape.size) * scale)
        case ConvexHull():
            return ConvexHull(shape.points * scale)
    assert isinstance(shape, Sphere)
    return Sphere(shape.radius * scale)
