"""Tests of SAT of convex polyhedra against the Minkowski difference, and of the cached axis."""

from __future__ import annotations

import numpy as np
import pytest
from point_sets import rotation
from scipy.spatial import ConvexHull as Qhull

from collision_monitor.geometry.bounding_volumes import Hull, convex_hull
from collision_monitor.geometry.lecture.polyhedron_sat import sat_3d
from collision_monitor.geometry.polyhedra import flat_faces

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def moved(hull: Hull, turn: np.ndarray, shift: np.ndarray) -> Hull:
    return Hull(hull.vertices @ turn.T + shift, hull.faces)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_it_is_the_minkowski_difference(scale: float) -> None:
    rng = np.random.default_rng(1)
    seen = set()
    for k in range(60):
        a, b = (convex_hull(scale * (CUBE if k % 5 == 0 else rng.normal(size=(rng.integers(4, 12), 3)))) for _ in "ab")
        b = moved(b, rotation(k), scale * rng.normal(size=3) * rng.choice([0.3, 1.0, 2.5]))
        difference = (b.vertices[None] - a.vertices[:, None]).reshape(-1, 3) / scale
        planes = Qhull(difference).equations
        depth = -planes[:, 3].max()  # of the origin inside the difference; negative if it is outside
        found, mirrored = sat_3d(a, b), sat_3d(b, a)
        seen.add(found.overlaps)
        assert found.overlaps == mirrored.overlaps == (depth >= 0.0)
        onto_a, onto_b = a.vertices @ found.axis, b.vertices @ found.axis
        assert found.distance / scale == pytest.approx((onto_b.min() - onto_a.max()) / scale, abs=1e-12)
        if found.overlaps:
            assert found.distance / scale == pytest.approx(-depth, abs=1e-8)  # faces win ties over edges
    assert seen == {True, False}


def test_a_cached_axis_is_tested_alone_as_long_as_it_parts_them() -> None:
    """Two rocks pass each other; other axes than the cached one are tested only when it no longer separates them."""
    rng = np.random.default_rng(2)
    a, b = (convex_hull(rng.normal(size=(20, 3))) for _ in "ab")
    hint, alone, steps = 0, 0, 0
    for t in np.linspace(-6, 6, 121):
        here = moved(b, rotation(7), np.array([t, 4.2, 0.5]))
        found, fresh = sat_3d(a, here, hint), sat_3d(a, here)
        assert not found.overlaps and not fresh.overlaps
        alone += found.tested == 1
        hint, steps = found.number, steps + 1
    assert alone > 0.9 * steps


def test_crossed_edges_need_an_edge_axis() -> None:
    s = np.sqrt(0.5)
    a = convex_hull(CUBE @ np.array([[1, 0, 0], [0, s, -s], [0, s, s]]).T)
    b = convex_hull(CUBE @ np.array([[s, 0, -s], [0, 1, 0], [s, 0, s]]).T + [0, 0, 2 * s + 0.01])
    found = sat_3d(a, b)
    assert not found.overlaps and found.number >= 6 + 6
    assert found.distance == pytest.approx(0.01)
    np.testing.assert_allclose(found.axis, [0, 0, 1], atol=1e-12)


PYRAMID = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], float)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
PRISM = np.array([[x, y, z] for z in (0.0, 1.0) for x, y in [(np.cos(k), np.sin(k)) for k in np.arange(6) * np.pi / 3]])
DODECAHEDRON = np.array(
    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    + [np.roll([0, a / g, b * g], k) for g in [(1 + 5**0.5) / 2] for a in (-1, 1) for b in (-1, 1) for k in range(3)]
)
SOLIDS = {  # corners, faces, edges
    "box": (CUBE, 6, 12),
    "pyramid": (PYRAMID, 5, 8),
    "tetrahedron": (TETRAHEDRON, 4, 6),
    "prism": (PRISM, 8, 18),
    "dodecahedron": (DODECAHEDRON, 12, 30),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_diagonals_of_faces_are_no_edges(name: str) -> None:
    """In any pose and at any scale: Euler's formula holds for the faces and edges that are left."""
    corners, faces, edges = SOLIDS[name]
    for k in range(40):
        scale, shift = 10.0 ** (k % 13 - 6), np.random.default_rng(k).normal(size=3) * 3
        hull = moved(convex_hull(scale * corners), rotation(k), scale * shift)
        flat = flat_faces(hull.vertices, hull.faces)
        assert (len(set(flat.face.tolist())), len(flat.edges)) == (faces, edges)
        assert len(corners) - edges + faces == 2


def test_the_axes_are_those_of_the_lecture() -> None:
    """A box and a pyramid: 6 + 5 normals, 12 * 8 pairs of edges."""
    box, pyramid = convex_hull(CUBE), convex_hull(PYRAMID + np.array([0.1, 0.2, 0.3]))
    for k in range(10):
        for hint in (0, 7, 50, 106, 1000):
            assert sat_3d(box, moved(pyramid, rotation(k), np.zeros(3)), hint).tested == 6 + 5 + 12 * 8
    apart = sat_3d(box, moved(pyramid, np.eye(3), np.array([5.0, 0, 0])))
    assert not apart.overlaps and apart.tested <= 6
