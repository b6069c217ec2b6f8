"""Gift wrapping against rational arithmetic, Qhull and Euler's formula, in the plane, in space and for flat sets."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_sets import rotation
from scipy.spatial import ConvexHull as Qhull

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.lecture import gift_wrapping as module
from collision_monitor.geometry.lecture.gift_wrapping import MOST_POINTS, gift_wrapping

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


def determinant(rows) -> Fraction:
    """Of a small matrix of rational numbers, by its definition."""
    n = len(rows)
    total = Fraction(0)
    for order in permutations(range(n)):
        sign = (-1) ** sum(order[i] > order[j] for i, j in combinations(range(n), 2))
        product = Fraction(sign)
        for i in range(n):
            product *= rows[i][order[i]]
        total += product
    return total


def rational(points: np.ndarray) -> list[list[Fraction]]:
    return [[Fraction(x) for x in point] for point in points.tolist()]


def height(a, b, c, p) -> Fraction:
    """Six times the volume of a tetrahedron: positive if p is on the side from which a, b, c are counter-clockwise."""
    return -determinant([[x - y for x, y in zip(row, p, strict=True)] for row in (a, b, c)])


def check_solid(points: np.ndarray) -> None:
    """All points are on the inner side of every face, and the faces close: this is the hull and no other body."""
    hull = gift_wrapping(points)
    assert hull.dimension == 3
    exact = rational(points)
    edges = []
    for face in hull.faces:
        a, b, c = (exact[k] for k in face[:3])
        for p in exact:
            assert height(a, b, c, p) <= 0
        for corner in face:
            assert height(a, b, c, exact[corner]) == 0
        edges += list(zip(face.tolist(), np.roll(face, -1).tolist(), strict=True))
    assert len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)
    assert len(hull.corners) - len(edges) // 2 + len(hull.faces) == 2
    assert sorted({int(k) for face in hull.faces for k in face}) == hull.corners.tolist()


def test_a_cube_has_six_squares_wherever_its_other_points_are() -> None:
    inner = np.random.default_rng(0).integers(0, 5, (60, 3)) / 4  # inside, on faces, on edges, on corners
    for shift in (0.0, 1e6, -0.1):
        points = np.concatenate([inner, CUBE]) + shift
        hull = gift_wrapping(points)
        check_solid(points)
        assert sorted(map(len, hull.faces)) == [4] * 6 and len(hull.corners) == 8


@settings(max_examples=60)
@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=4, max_size=14), st.integers(-40, 40))
def test_sets_with_many_points_in_one_plane(rows, exponent) -> None:
    points = np.array(rows, float) * 2.0**exponent
    hull = gift_wrapping(points)
    rank = np.linalg.matrix_rank(points - points[0])
    assert hull.dimension == rank
    if rank == 3:
        check_solid(points)
    elif rank == 2:
        check_flat(points, hull)
    elif rank == 1:
        order = np.lexsort(points.T[::-1])
        np.testing.assert_array_equal(points[hull.corners], points[np.sort(hull.corners)])
        assert {tuple(points[k]) for k in hull.corners} == {tuple(points[order[0]]), tuple(points[order[-1]])}
        assert hull.faces == ()
    else:
        assert len(hull.corners) == 1 and hull.faces == ()


def check_flat(points: np.ndarray, hull: module.WrappedHull) -> None:
    """The polygon turns one way, and has all points on its inner side; no corner is between its neighbours."""
    ring = points[hull.corners]
    assert len(hull.faces) == 1 and hull.faces[0].tolist() == hull.corners.tolist()
    normal = np.cross(ring[1] - ring[0], ring[2] - ring[0])
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        side = np.cross(b - a, points - a) @ normal
        assert (side >= 0.0).all()
        on = points[side == 0.0]
        span = (on - a) @ (b - a) / ((b - a) @ (b - a))
        assert (span >= 0.0).all() and (span <= 1.0).all()


@pytest.mark.parametrize("n", [4, 10, 100, 400])
def test_random_points_have_the_hull_of_qhull(n: int) -> None:
    for seed in range(4):
        points = np.random.default_rng(seed).normal(size=(n, 3)) * 10.0 ** (3 * seed - 4)
        hull, other = gift_wrapping(points), Qhull(points)
        assert hull.corners.tolist() == sorted(other.vertices.tolist())
        assert {frozenset(face.tolist()) for face in hull.faces} == {
            frozenset(each) for each in other.simplices.tolist()
        }
        check = points[np.concatenate(hull.faces).reshape(-1, 3)] if n > 3 else points
        assert np.linalg.det(check).sum() / 6 == pytest.approx(other.volume, rel=1e-9)  # counter-clockwise from outside


def test_turned_cubes_are_wrapped_as_they_are_rounded() -> None:
    """Their corners are not quite in one plane any more, and the hull is exact for the corners as given."""
    for k in range(10):
        check_solid(CUBE @ rotation(k).T)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=1, max_size=20))
def test_in_the_plane(rows) -> None:
    points = np.array(rows, float)
    hull = gift_wrapping(points)
    rank = np.linalg.matrix_rank(points - points[0])
    assert hull.dimension == rank and hull.faces == ()
    if rank == 2:
        ring = points[hull.corners]
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            side = (b - a)[0] * (points - a)[:, 1] - (b - a)[1] * (points - a)[:, 0]
            assert (side >= 0.0).all()
        assert len(np.unique(ring, axis=0)) == len(ring) == len(Qhull(points).vertices)
    else:
        assert len(hull.corners) == rank + 1


def test_flat_sets_in_any_plane() -> None:
    """By exact coordinates in planes that are not along the axes."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        u, v = rng.integers(-9, 10, (2, 3))
        if not np.cross(u, v).any():
            continue
        points = rng.integers(-5, 6, (30, 2)) @ np.stack([u, v]) + rng.integers(-99, 99, 3).astype(float)
        hull = gift_wrapping(points)
        assert hull.dimension == 2
        check_flat(points, hull)


def test_limits() -> None:
    with pytest.raises(ShapeError, match=f"at most {MOST_POINTS} points"):
        gift_wrapping(np.zeros((MOST_POINTS + 1, 3)))
    for wrong in (np.zeros((0, 3)), np.zeros((3, 4)), np.full((3, 3), np.nan), np.zeros(3)):
        with pytest.raises(InputError):
            gift_wrapping(wrong)
    assert gift_wrapping([[1, 2, 3]] * 5).corners.tolist() == [0]
