"""A concave mesh against solids without a tree: every triangle, tested as a convex piece, is the oracle."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.query.body import kept_slots
from collision_monitor.query.contact.contact import plant_for_meshes
from collision_monitor.query.contact.contact_kernel import contact_row
from collision_monitor.shapes.convex_pieces import convex_pieces

_TORUS = trimesh.creation.torus(1.0, 0.3, major_sections=12, minor_sections=6)
RING = cm.Mesh(_TORUS.vertices, _TORUS.faces)
SOUP = cm.Mesh(np.random.default_rng(2).normal(size=(60, 3)), np.arange(60).reshape(20, 3))
SOLIDS = (
    cm.Cylinder(0.2, 0.5), cm.Cone(0.2, 0.5), cm.Ellipsoid((0.1, 0.3, 0.2)), cm.HalfSpace((0, 0.6, 0.8), -0.9),
    cm.Box((0.3, 0.6, 0.2)),
)  # fmt: skip
DEEP = cm.Mesh(_TORUS.vertices * [1, 1, 8] * 3, _TORUS.faces)
"""A ring with a wall that contains the small solids."""


def surface_row(a: cm.Shape, X: cm.Pose, b: cm.Shape, Y: cm.Pose) -> tuple[float, float]:
    """Distance of two shapes and its bound (m), of an open mesh that of its surface."""
    known = kept_slots(a), kept_slots(b)
    assert known[0] is not None and known[1] is not None
    plant_for_meshes(known[0], a, known[1], b)
    return contact_row(known[0].first, X, known[1].first, Y, SURFACES)[:2]


def _of_all_triangles(mesh: cm.Mesh, X: cm.Pose, solid: cm.Shape, Y: cm.Pose) -> tuple[float, float]:
    """Least distance of all triangles of a mesh from a solid, and its bound (m); negative if the solid is inside."""
    pieces = convex_pieces(mesh)
    Y = cm.Pose(Y.position - X.position, Y.quaternion)  # about A, without round-off of large coordinates
    X = cm.Pose(quaternion=X.quaternion)
    rows = cm.contacts([shape for shape, _ in pieces], [X @ pose for _, pose in pieces], solid, Y)
    nearest = rows.signed_distance.argmin()
    distance = float(rows.signed_distance[nearest])
    if distance > 0.0 and mesh.surface.closed and not isinstance(solid, cm.HalfSpace):
        middle = (Y.position - X.position) @ X.rotation
        distance *= -1.0 if cm.contains(mesh, cm.Pose(), middle, test="ray").any() else 1.0
    return distance, float(rows.error_bound[nearest])


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
            expected, bound = _of_all_triangles(mesh, X, solid, Y)
            for found in (surface_row(mesh, X, solid, Y), surface_row(solid, Y, mesh, X)):
                assert (found[0] > 0.0) == (expected > 0.0)
                if expected < 0.0 and isinstance(solid, cm.Box):  # by its faces, whose depths are at most the solid's
                    assert expected - found[1] - bound <= found[0] < 0.0
                    assert abs(cm.contact(mesh, X, solid, Y).signed_distance - expected) <= found[1] + bound
                else:
                    assert abs(found[0] - expected) <= found[1] + bound
                assert found[1] < 1e-5
            signs.add(bool(expected > 0.0))
    assert signs == {True, False} or isinstance(solid, cm.HalfSpace) or mesh is DEEP


@pytest.mark.parametrize("solid", SOLIDS[:3], ids=lambda solid: type(solid).__name__)
def test_a_solid_in_the_wall_of_a_ring_is_inside(solid: cm.Shape) -> None:
    found = cm.contact(DEEP, cm.Pose(), solid, cm.Pose((3.0, 0.0, 0.0)))
    assert found.signed_distance < -0.3
    swapped = cm.contact(solid, cm.Pose((3.0, 0.0, 0.0)), DEEP, cm.Pose())
    assert swapped.signed_distance == pytest.approx(found.signed_distance, abs=1e-5)
