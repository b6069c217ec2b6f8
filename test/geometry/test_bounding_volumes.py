"""Tests that axis-aligned boxes, k-DOPs and hulls contain their points exactly and are tight."""

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from point_sets import SETS, rotation
from rational import volume6

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS, aabb, convex_hull, inside_kdop, kdop_of_points
from collision_monitor.geometry.orientation import orient3d

SOLIDS = [name for name in SETS if name not in ("flat", "line", "one point", "one point, often", "two points")]


@pytest.mark.parametrize("name", SETS)
def test_aabb(name):
    points = SETS[name]
    box = aabb(points)
    assert (box.lower <= points).all() and (points <= box.upper).all()
    assert all(box.lower[k] in points[:, k] and box.upper[k] in points[:, k] for k in range(3))
    assert aabb(points[:, :2]).upper.tolist() == box.upper[:2].tolist()


def test_aabb_volume():
    assert aabb([[0, 0, 0], [1, 2, 3]]).volume == 6
    assert aabb([[0, 0], [1, 2]]).volume == 2


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("k", KDOP_DIRECTIONS)
def test_kdop_holds_its_points_in_rational_numbers(name, k):
    points = SETS[name][:20]
    slabs = kdop_of_points(points, k)
    assert slabs.directions.shape == (k // 2, 3)
    for n, low, high in zip(slabs.directions, slabs.lower, slabs.upper, strict=True):
        dots = [sum(Fraction(float(x)) * Fraction(float(y)) for x, y in zip(n, p, strict=True)) for p in points]
        assert low <= min(dots) and max(dots) <= high
        assert float(max(dots)) >= high - 1e-15 * 8 * np.abs(points).max()
    assert inside_kdop(points, slabs).all()


def test_a_6_dop_is_the_aabb_and_more_directions_are_tighter():
    points = SETS["cloud"]
    box, slabs = aabb(points), kdop_of_points(points, 6)
    assert (slabs.lower == box.lower).all() and (slabs.upper == box.upper).all()
    probes = np.random.default_rng(0).uniform(box.lower, box.upper, (5000, 3))
    kept = {k: inside_kdop(probes, kdop_of_points(points, k)) for k in KDOP_DIRECTIONS}
    assert (kept[26] <= kept[14]).all() and (kept[26] <= kept[18]).all() and (kept[14] <= kept[6]).all()
    assert kept[26].sum() < kept[14].sum() < kept[6].sum()


def test_directions_of_the_users_choice():
    turn = rotation(1)
    slabs = kdop_of_points(SETS["turned box"], 5 * turn.T)
    assert np.allclose(slabs.upper, [3, 2, 0.5], rtol=1e-14) and np.allclose(slabs.lower, [-3, -2, -0.5], rtol=1e-14)
    assert not inside_kdop(turn @ [3.1, 0, 0], slabs)
    with pytest.raises(InputError, match="zero vector"):
        kdop_of_points(SETS["cube"], [[0, 0, 0]])
    with pytest.raises(InputError, match=r"\[6, 14, 18, 26\]"):
        kdop_of_points(SETS["cube"], 8)


@pytest.mark.parametrize("name", SOLIDS)
def test_convex_hull_is_closed_convex_and_holds_its_points(name):
    points = SETS[name]
    hull = convex_hull(points)
    size = np.ptp(points, axis=0).max()
    mesh = trimesh.Trimesh(hull.vertices, hull.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    middle = points.mean(axis=0)
    centred = trimesh.Trimesh(hull.vertices - middle, hull.faces, process=False)
    assert abs(centred.volume - hull.volume) <= 1e-12 * size**3
    a, b, c = hull.vertices[hull.faces.T]
    n = np.cross(b - a, c - a)
    length = np.linalg.norm(n, axis=1)
    big = length > 1e-9 * length.max()
    heights = orient3d(a, b, c, points[:, None])[:, big] / length[big]  # exact, because slivers have noisy normals
    assert heights.max() <= 1e-12 * size
    assert {tuple(v) for v in hull.vertices} <= {tuple(p) for p in points}


def test_hull_volumes():
    assert abs(convex_hull(SETS["cube"]).volume - 8) < 1e-14
    assert abs(convex_hull(SETS["far from the origin"]).volume - 8) < 1e-14
    tetrahedron = SETS["tetrahedron"]
    assert abs(convex_hull(tetrahedron).volume - abs(float(volume6(*tetrahedron))) / 6) < 1e-14


@pytest.mark.parametrize("name", ["flat", "line", "one point", "one point, often", "two points"])
def test_what_spans_no_solid_has_no_hull(name):
    with pytest.raises(ShapeError, match="expected"):
        convex_hull(SETS[name])


@pytest.mark.parametrize("make", [aabb, kdop_of_points, convex_hull])
@pytest.mark.parametrize(
    "bad", [[], np.zeros((0, 3)), [[0, 0, np.nan]], [[0, 0, np.inf]], [0, 0, 0], [[1, 2, 3, 4]], None]
)
def test_bad_points_are_refused(make, bad):
    with pytest.raises(InputError, match="expected"):
        make(bad)
