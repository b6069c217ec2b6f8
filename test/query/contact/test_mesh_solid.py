"""A concave mesh against solids without a tree: every triangle, tested as a convex piece, is the oracle."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE
from collision_monitor.query.contact.nearest_or_deepest import by_pieces, by_trees
from collision_monitor.query.posed import Posed

_TORUS = trimesh.creation.torus(1.0, 0.3, major_sections=12, minor_sections=6)
RING = cm.Mesh(_TORUS.vertices, _TORUS.faces)
SOUP = cm.Mesh(np.random.default_rng(2).normal(size=(60, 3)), np.arange(60).reshape(20, 3))
SOLIDS = (
    cm.Cylinder(0.2, 0.5), cm.Cone(0.2, 0.5), cm.Ellipsoid((0.1, 0.3, 0.2)), cm.HalfSpace((0, 0.6, 0.8), -0.9),
    cm.Box((0.3, 0.6, 0.2)),
)  # fmt: skip
DEEP = cm.Mesh(_TORUS.vertices * [1, 1, 8] * 3, _TORUS.faces)
"""A ring with a wall that contains the small solids."""


def _posed(shape: cm.Shape, pose: cm.Pose) -> Posed:
    return Posed([(shape, cm.Pose())], pose, [(shape, cm.Pose())])


@pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: type(solid).__name__)
@pytest.mark.parametrize("mesh", [RING, SOUP, DEEP], ids=["ring", "soup", "deep"])
def test_distances_are_those_of_all_triangles(mesh: cm.Mesh, solid: cm.Shape) -> None:
    rng = np.random.default_rng(7)
    signs = set()
    for scale in (1e-3, 1.0, 1e3):
        for _ in range(12):
            q = Rotation.random(2, rng=rng).as_quat()
            X = cm.Pose(rng.normal(size=3) * scale, q[0])
            Y = cm.Pose(np.asarray(X.position) + rng.normal(size=3) * 1.2, q[1])
            a, b = _posed(mesh, X), _posed(solid, Y)
            offset = Y.position - X.position
            expected = by_pieces(a, b, offset)
            for found in (by_trees(a, b, offset), by_trees(b, a, -offset)):
                assert found is not None
                assert (found.row[DISTANCE] > 0.0) == (expected.row[DISTANCE] > 0.0)
                apart = abs(float(found.row[DISTANCE] - expected.row[DISTANCE]))
                assert apart <= found.row[BOUND] + expected.row[BOUND]
                assert found.row[BOUND] < 1e-5
            signs.add(bool(expected.row[DISTANCE] > 0.0))
    assert signs == {True, False} or isinstance(solid, cm.HalfSpace) or mesh is DEEP


@pytest.mark.parametrize("solid", SOLIDS[:3], ids=lambda solid: type(solid).__name__)
def test_a_solid_in_the_wall_of_a_ring_is_inside(solid: cm.Shape) -> None:
    found = cm.contact(DEEP, cm.Pose(), solid, cm.Pose((3.0, 0.0, 0.0)))
    assert found.signed_distance < -0.3
    swapped = cm.contact(solid, cm.Pose((3.0, 0.0, 0.0)), DEEP, cm.Pose())
    assert swapped.signed_distance == pytest.approx(found.signed_distance, abs=1e-5)
