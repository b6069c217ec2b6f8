"""Tests of the BSP tree against the exact ray parity and the exact edge–face test."""

from __future__ import annotations

import numpy as np
import pytest
from solids import CONCAVE, CONVEX, SKEWS

from collision_monitor.broad_phase.bsp_tree import bsp_tree, first_hit, locate_in_bsp_tree
from collision_monitor.errors import ShapeError
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import edge_face, locate_in_polyhedron

SOLIDS = {**CONVEX, **CONCAVE}


@pytest.mark.parametrize("skew", SKEWS)
@pytest.mark.parametrize("name", SOLIDS)
def test_points_and_segments(name, skew):
    vertices, faces = SOLIDS[name]()
    vertices = vertices @ SKEWS[skew].T
    tree = bsp_tree(vertices, faces)
    rng = np.random.default_rng(1)
    low, high = vertices.min(axis=0) - 0.5, vertices.max(axis=0) + 0.5
    p, q = rng.uniform(low, high, (2, 300, 3))
    expected = locate_in_polyhedron(p, vertices, faces)
    np.testing.assert_array_equal(locate_in_bsp_tree(p, tree), expected)
    # faces, edges and corners are on the boundary, with leaves of the tree on both sides
    corners = vertices[faces]
    for points in (corners.mean(axis=1), corners[:, :2].mean(axis=1), vertices[np.unique(faces)]):
        assert (locate_in_bsp_tree(points, tree) == Location.BOUNDARY).all()
    # a segment that starts inside hits at t = 0, any other at its first crossing of a face
    crossing = edge_face(p[:, None], q[:, None], *np.moveaxis(corners, 1, 0))
    first = np.where(crossing.meets, crossing.t, np.inf).min(axis=1)
    first = np.where(expected == Location.INSIDE, 0.0, first)
    np.testing.assert_allclose(first_hit(p, q, tree), np.where(np.isfinite(first), first, np.nan), atol=1e-6)


def test_touching_counts_and_passing_by_does_not():
    vertices, faces = CONVEX["cube"]()
    tree = bsp_tree(vertices, faces)
    assert first_hit([0.5, 0.5, 2], [0.5, 0.5, 1], tree) == pytest.approx(1.0, abs=1e-8)
    assert first_hit([-1, 0.5, 1], [2, 0.5, 1], tree) == pytest.approx(1 / 3, abs=1e-8)  # along a face
    assert np.isnan(first_hit([-1, 0.5, 1.001], [2, 0.5, 1.001], tree))
    assert first_hit([0.5, 0.5, 0.5], [0.5, 0.5, 0.5], tree) == 0.0


def test_what_is_not_closed_is_refused():
    vertices, faces = CONVEX["cube"]()
    with pytest.raises(ShapeError, match="closed"):
        bsp_tree(vertices, faces[1:])
    with pytest.raises(ShapeError, match="area"):
        bsp_tree([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2], [0, 2, 1]])
