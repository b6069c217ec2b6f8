"""Polygons become triangles that cover the same area on the same side."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_files import area
from scipy.spatial.transform import Rotation

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.faces import LONGEST_RING, triangles_of


def normal(points: np.ndarray) -> np.ndarray:
    """Newell's normal of a polygon (k, 3); its length is twice the area."""
    return np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)


def star(corners: int, seed: int) -> np.ndarray:
    """A simple polygon with reflex corners, in a plane of space. One of four corners is a dart."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 1, corners) + np.arange(corners)) * (2 * np.pi / (corners + 1))
    radius = np.where(np.arange(corners) % 2, 0.3, 1.0) * rng.uniform(0.8, 1.2, corners)
    flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(corners)], axis=1)
    return Rotation.random(random_state=seed).apply(np.roll(flat, rng.integers(corners), axis=0)) + rng.normal(size=3)


@pytest.mark.parametrize("corners", [4, 5, 6, 9, 20, 100])
@pytest.mark.parametrize("turned", [False, True])
def test_concave_polygons_keep_area_and_side(corners: int, turned: bool) -> None:
    for seed in range(20):
        points = star(corners, seed)[:: -1 if turned else 1]
        faces = triangles_of(points, np.array([corners]), np.arange(corners))
        assert faces.shape == (corners - 2, 3)
        expected = normal(points)
        sides = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
        assert (sides @ expected > -1e-12).all()
        assert area(points, faces) == pytest.approx(np.linalg.norm(expected) / 2)


def test_polygons_of_all_sizes_stay_in_their_order() -> None:
    points = np.array([[np.cos(a), np.sin(a), 0.1 * a] for a in np.linspace(0, 6, 30)])
    counts = np.array([3, 5, 4, 3, 8, 4])
    corners = np.concatenate([np.arange(count) for count in counts])
    faces = triangles_of(points, counts, corners)
    assert len(faces) == (counts - 2).sum()
    begin = 0
    for count in counts.tolist():
        assert set(faces[begin : begin + count - 2].reshape(-1).tolist()) == set(range(count))
        begin += count - 2


def test_a_polygon_that_crosses_itself_still_closes_the_surface() -> None:
    """The edges that its triangles do not share with each other are those of the polygon."""
    points = np.array([[0, 0, 0], [2, 2, 0], [2, 0, 0], [0, 2, 0], [1, 3, 0]], float)
    faces = triangles_of(points, np.array([5]), np.arange(5))
    edges = {tuple(edge) for face in faces.tolist() for edge in zip(face, face[1:] + face[:1], strict=True)}
    assert {edge for edge in edges if edge[::-1] not in edges} == {(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)}


def test_limits() -> None:
    with pytest.raises(ShapeError, match="at least 3 corners, got one of 2"):
        triangles_of(np.eye(3), np.array([2]), np.array([0, 1]))
    with pytest.raises(ShapeError, match="from 1 to 3 of the vertices, got the numbers 1 to 8"):
        triangles_of(np.eye(3), np.array([3]), np.array([0, 1, 7]))
    many = star(2 * LONGEST_RING, 0)
    with pytest.raises(ShapeError, match=f"at most {LONGEST_RING} corners of a concave face"):
        triangles_of(many, np.array([len(many)]), np.arange(len(many)))
    rings = np.tile(np.arange(100), 200)
    with pytest.raises(ShapeError, match="and 10000 of all, got 100, and 20000"):
        triangles_of(star(100, 0), np.full(200, 100), rings)
    assert triangles_of(np.eye(3), np.zeros(0, int), np.zeros(0, int)).shape == (0, 3)
