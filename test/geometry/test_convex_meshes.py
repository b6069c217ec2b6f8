"""Tests that large meshes and hulls are judged as the comparison of every plane with every point judges them."""

from __future__ import annotations

from time import process_time

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull as Qhull

from collision_monitor import Mesh
from collision_monitor.geometry import qhull
from collision_monitor.geometry.point_tree import PointTree
from collision_monitor.shapes import convex_pieces
from collision_monitor.shapes.convex_pieces import is_convex_mesh
from collision_monitor.tolerances import HULL_DROP


def judged_slowly(mesh: Mesh) -> bool:
    """`is_convex_mesh`: each face against each vertex."""
    faces = mesh.surface.faces
    if not (mesh.surface.closed and len(faces)):
        return False
    used, flat = mesh.vertices[np.unique(faces)], HULL_DROP * 16 * float(np.ptp(mesh.vertices, axis=0).max())
    sides = set()
    for a, b, c in mesh.vertices[faces]:
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if not length > 0.0:
            return False
        height = used @ (normal / length) - a @ (normal / length)
        if height.max() <= flat and height.min() < -flat:
            sides.add("below")
        elif height.min() >= -flat and height.max() > flat:
            sides.add("above")
        else:
            return False
    return len(sides) == 1


def vertices_slowly(points):
    """`hull_vertices`: each dropped point against each face."""
    _, first = np.unique(points, axis=0, return_index=True)
    first = np.sort(first)
    centred = points[first] - points[first].mean(axis=0)
    centred = centred / np.abs(centred).max()
    hull = Qhull(centred)
    keep = (centred @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1) > HULL_DROP
    keep[hull.vertices] = True
    return first[keep]


def turned(rng, solid, scale=(1.0, 1.0, 1.0)):
    """Vertices of a solid, scaled, turned and moved at random, and its faces."""
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    faces = solid.faces if np.linalg.det(q) > 0.0 else solid.faces[:, ::-1]
    return solid.vertices * scale @ q.T + rng.normal(size=3), np.array(faces)


def solids(rng):
    """Meshes that are convex, dented by little or much, inside out, doubly covered, or flat in large parts."""
    icosphere, box = trimesh.creation.icosphere(2), trimesh.creation.box((1.0, 2.0, 0.5))
    divided = trimesh.creation.box((1.0, 1.0, 1.0))
    for _ in range(2):
        divided = divided.subdivide()
    hull = trimesh.convex.convex_hull(rng.normal(size=(60, 3)))
    for solid in (icosphere, box, divided, trimesh.creation.cylinder(1.0, 0.3, sections=40), hull):
        v, f = turned(rng, solid, rng.uniform(0.1, 2.0, 3))
        yield v, f
        yield v, f[:, ::-1]
        yield v, np.concatenate([f[:1, ::-1], f[1:]])  # one face looks the other way
        yield np.concatenate([v, v + 9.0]), np.concatenate([f, f + len(v)])  # two solids
        yield v * [1.0, 1.0, 0.0], f  # pressed flat
        size = float(np.ptp(v, axis=0).max())
        for depth in (1e-14, 3e-13, 1e-12, 1e-9, 1e-3, 0.3):
            for sign in (-1.0, 1.0):
                dented = v.copy()
                k = int(rng.integers(len(v)))
                dented[k] += sign * depth * size * (dented[k] - v.mean(axis=0))
                yield dented, f
    # a surface that is convex at every edge but winds around its axis twice
    twice, steps = trimesh.creation.cylinder(1.0, 1.0, sections=12), np.arange(12)
    star = np.column_stack([np.cos(steps * np.pi / 3), np.sin(steps * np.pi / 3), 0.1 * (steps >= 6)])
    after = np.roll(steps, -1)
    v = np.concatenate([star, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    yield (
        v,
        np.concatenate(
            [np.column_stack([steps, after, 0 * steps + 12]), np.column_stack([after, steps, 0 * steps + 13])]
        ),
    )
    yield np.array(twice.vertices), np.concatenate([twice.faces, twice.faces])


@pytest.mark.parametrize("seed", range(6))
def test_the_tree_judges_as_all_vertices_do(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(convex_pieces, "HEIGHTS_AT_ONCE", 0)  # as if every mesh were large
    judged = []
    for v, f in solids(np.random.default_rng(seed)):
        mesh = Mesh(v, f)
        judged.append(is_convex_mesh(mesh))
        assert judged[-1] == judged_slowly(mesh), f"solid {len(judged) - 1}"
    assert 20 < sum(judged) < len(judged) - 20


@pytest.mark.parametrize("seed", range(4))
def test_a_hull_keeps_the_same_vertices(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(seed)
    monkeypatch.setattr(qhull, "HEIGHTS_AT_ONCE", 100)
    sphere = rng.normal(size=(400, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    torus, divided = trimesh.creation.torus(1.0, 0.3, 24, 12), trimesh.creation.box((1.0, 1.0, 1.0))
    for _ in range(3):
        divided = divided.subdivide()
    clouds = [rng.normal(size=(500, 3)), np.concatenate([sphere, sphere * (1.0 - 1e-13), sphere * 0.5])]
    clouds += [turned(rng, torus)[0], turned(rng, divided)[0], turned(rng, torus, (1.0, 1.0, 1e-10))[0]]
    clouds += [np.concatenate([torus.vertices] * 2), rng.normal(size=(300, 3)) * [1.0, 1e-3, 1e-6]]
    for points in clouds:
        assert np.array_equal(qhull.hull_vertices(points), vertices_slowly(points))


def test_points_beyond_a_hull() -> None:
    rng = np.random.default_rng(3)
    for scale in ((1.0, 1.0, 1.0), (1.0, 1.0, 1e-4), (1.0, 1.0, 1e-11)):
        points = rng.normal(size=(400, 3)) * scale + [1.0, -2.0, 3.0]
        found, plain = qhull.QhullResult(points), Qhull(points)
        probes = rng.normal(size=(500, 3)) * np.multiply(scale, 2.0) + [1.0, -2.0, 3.0]
        for limit in (0.0, 1e-3, 0.3):
            heights = (probes @ plain.equations[:, :3].T + plain.equations[:, 3]).max(axis=1)
            clear = np.abs(heights - limit) > 1e-9 if scale[2] > 1e-9 else np.abs(heights - limit) > 1e-3
            assert np.array_equal(found.beyond(probes, limit)[clear], heights[clear] > limit)


def test_a_point_tree_finds_what_all_rows_have() -> None:
    rng = np.random.default_rng(7)
    for n in (1, 2, 8, 9, 50, 1000):
        points, directions = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)) * rng.integers(0, 2, (n, 1))
        d, limit = rng.normal(size=(200, 3)), rng.normal(size=200) * 2.0
        found = PointTree(points, directions).exceeds(d, limit, np.column_stack([points, np.zeros(n)]), limit)
        assert np.array_equal(found, (d @ points.T).max(axis=1) > limit)


def test_the_time_grows_hardly_faster_than_the_mesh() -> None:
    """It took 3 s for 20,480 faces and 66 s for 81,920."""
    solid = trimesh.creation.icosphere(5)
    is_convex_mesh(Mesh(*turned(np.random.default_rng(1), trimesh.creation.icosphere(4))))
    mesh = Mesh(solid.vertices, solid.faces)
    began = process_time()
    assert is_convex_mesh(mesh)
    assert process_time() - began < 1.0
