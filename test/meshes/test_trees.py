"""Trees against the definition: every triangle once and in its boxes; distances of all pairs of triangles."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import trimesh
from kernels import tree_distance, trees_touch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.geometry.polyhedra import edge_face, locate_in_polyhedron
from collision_monitor.meshes.distance.nearest import MEMORY, PAIRS, PLACE_A, PLACE_B, answer_row
from collision_monitor.meshes.extent import tree_extents
from collision_monitor.meshes.layout import AXES, CENTER, CHILD, FACE, HALF, WIDTH
from collision_monitor.meshes.trees import tree
from collision_monitor.meshes.trees.tree import tree_of
from collision_monitor.meshes.trees.tree_surface import surface_of
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.shape_table import take, triangle_table

Array = NDArray[np.float64]

RING = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=8)
WORK = np.zeros(MEMORY)


def soup(count: int, seed: int, size: float = 0.3) -> Array:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 1, 3)) + size * rng.normal(size=(count, 3, 3))


def slivers(count: int, seed: int) -> Array:
    corners = soup(count, seed)
    corners[:, 2] = corners[:, 0] + 1e-9 * corners[:, 2]
    return corners


SURFACES = {
    "ring": RING.vertices[RING.faces],
    "soup": soup(90, 1),
    "slivers": slivers(60, 2),
    "one": soup(1, 3),
    "duplicates": np.repeat(soup(12, 4), 9, axis=0),
    "point": np.zeros((70, 3, 3)),
    "points": np.repeat(soup(100, 5)[:, :1], 3, axis=1),
}
PAIRS_OF_SURFACES = [*product(("ring", "soup", "slivers", "one", "points"), ("ring", "soup", "points"))]


def distance(a: Array, X: tuple[Array, Array], b: Array, Y: tuple[Array, Array], limit: float = np.inf) -> float:
    return float(tree_distance(a, *X, b, *Y, limit, answer_row(), WORK))


def all_pairs(a: Array, X: tuple[Array, Array], b: Array, Y: tuple[Array, Array]) -> tuple[float, float]:
    """Least distance of all pairs of triangles by GJK, and the largest error bound of the nearest (m)."""
    table = triangle_table(np.concatenate([a @ X[0].T + (X[1] - X[1]), b @ Y[0].T + (Y[1] - X[1])]))
    i, j = np.repeat(np.arange(len(a)), len(b)), len(a) + np.tile(np.arange(len(b)), len(a))
    n = len(a) + len(b)
    pairs = np.stack([i, j], axis=1).astype(np.int32)
    rows = contact_batch(take(table, np.arange(n)), np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), pairs)
    best = int(rows[:, 0].argmin())
    return max(float(rows[best, 0]), 0.0), float(rows[best, 10])


def test_an_edge_through_the_diagonal_of_a_face_does_not_hide_that_triangles_meet() -> None:
    """The edges are 1e-15 m apart, and the direction between them is round-off, which separates nothing."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        box = trimesh.creation.box(rng.uniform(0.5, 2.0, 3))
        size = 10 ** rng.uniform(0.5, 4.0)
        wedge = tree_of(np.array([[[size, size, size], [size, 0.0, 0.0], [0.0, 0.0, 0.0]]]))
        pose = Rotation.random(rng=rng).as_matrix(), np.zeros(3)
        solid = tree_of(box.vertices[box.faces], closed=True)
        assert distance(wedge, pose, solid, pose) == distance(solid, pose, wedge, pose) == 0.0


def random_pose(rng: np.random.Generator, far: float) -> tuple[Array, Array]:
    return Rotation.random(rng=rng).as_matrix(), far * rng.normal(size=3)


@pytest.mark.parametrize("corners", SURFACES.values(), ids=SURFACES)
def test_each_triangle_is_in_the_tree_once_and_in_all_boxes_above_it(corners):
    tree = tree_of(corners, 0.01)
    found = []
    waiting = [(0, 0, [])]
    while waiting:
        block, member, above = waiting.pop()
        box = tree[block, :, member]
        above = [*above, box]
        child = int(box[CHILD])
        if child > 0:
            waiting += [(child, k, above) for k in range(WIDTH) if tree[child, CHILD, k] != 0.0]
            continue
        for face in np.unique(tree[-child, FACE]).astype(int):
            found.append(face)
            for each in above:
                axes = each[AXES : AXES + 9].reshape(3, 3)
                inside = np.abs((corners[face] - each[CENTER : CENTER + 3]) @ axes) + 0.01
                assert (inside <= each[HALF : HALF + 3] * (1 + 1e-12)).all()
    assert sorted(found) == list(range(len(corners)))
    surface = surface_of(np.concatenate([tree, tree]), len(tree))
    assert np.array_equal(surface.corners, corners)


@pytest.mark.parametrize(("a", "b"), PAIRS_OF_SURFACES)
def test_the_distance_is_that_of_all_pairs_of_triangles(a, b):
    rng = np.random.default_rng(len(a) + 7 * len(b))
    A, B = SURFACES[a], SURFACES[b]
    tree_a, tree_b = tree_of(A), tree_of(B)
    for far in (0.3, 1.5, 3.0, 30.0):
        X, Y = random_pose(rng, 1.0), random_pose(rng, far)
        expected, bound = all_pairs(A, X, B, Y)
        answer = answer_row()
        got = tree_distance(tree_a, *X, tree_b, *Y, np.inf, answer, WORK)
        assert got == pytest.approx(expected, abs=1e-12 * (6 + far) + bound)
        # the same with A and B swapped, moved, with the answer as a hint, and with a limit
        assert distance(tree_b, Y, tree_a, X) == pytest.approx(got, abs=1e-13 * (6 + far))
        Z = random_pose(rng, 10.0)
        moved = [(Z[0] @ R, Z[0] @ p + Z[1]) for R, p in (X, Y)]
        assert distance(tree_a, moved[0], tree_b, moved[1]) == pytest.approx(got, abs=1e-13 * (20 + far))
        assert tree_distance(tree_a, *X, tree_b, *Y, np.inf, answer.copy(), WORK) == got
        assert distance(tree_a, X, tree_b, Y, got * (1.0 - 1e-13)) == np.inf
        stale = answer.copy()
        stale[[PLACE_A, PLACE_B]] = WIDTH * np.array([-tree_a[0, CHILD, 0] if tree_a[0, CHILD, 0] < 0 else 2.0, 0.0])
        if got > 0.0:
            on_a, on_b = answer[1:4], answer[4:7]
            assert np.linalg.norm(on_b - on_a) == pytest.approx(got, rel=1e-12)


def test_spheres_about_points_and_edges_shorten_the_distance():
    rng = np.random.default_rng(3)
    cloud, ring = tree_of(SURFACES["points"], 0.05), tree_of(SURFACES["ring"])
    bare = tree_of(SURFACES["points"])
    for far in (1.0, 4.0):
        X, Y = random_pose(rng, 0.0), random_pose(rng, far)
        expected = max(distance(bare, X, ring, Y) - 0.05, 0.0)
        assert distance(cloud, X, ring, Y) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(("a", "b"), [("ring", "ring"), ("soup", "ring"), ("soup", "soup")])
def test_the_touching_triangles_are_those_whose_edges_pass_through_each_other(a, b):
    rng = np.random.default_rng(11)
    A, B = SURFACES[a], SURFACES[b]
    tree_a, tree_b = tree_of(A), tree_of(B)
    eye = np.eye(3), np.zeros(3)
    for _ in range(4):
        R, p = random_pose(rng, 0.6)
        placed = B @ R.T + p
        expected = set()
        for one, other, order in ((A, placed, 1), (placed, A, -1)):
            for k in range(3):
                start, end = one[:, None, k], one[:, None, (k + 1) % 3]
                meets = edge_face(start, end, other[None, :, 0], other[None, :, 1], other[None, :, 2]).meets
                expected |= {pair[::order] for pair in zip(*np.nonzero(meets), strict=True)}
        count, complete = trees_touch(tree_a, *eye, tree_b, R, p, 4096, WORK)
        places = WORK[PAIRS : PAIRS + 2 * count].astype(int).reshape(-1, 2)
        found = [
            (int(tree_a[i // WIDTH, FACE, i % WIDTH]), int(tree_b[j // WIDTH, FACE, j % WIDTH])) for i, j in places
        ]
        assert complete and len(found) == len(set(found)) and set(found) == expected
        one, _ = trees_touch(tree_a, *eye, tree_b, R, p, 1, WORK)
        assert bool(one) == bool(expected)


def test_hostile_meshes_stay_bounded():
    point = tree_of(np.zeros((3_000, 3, 3)))
    eye = np.eye(3), np.zeros(3)
    count, complete = trees_touch(point, *eye, point, *eye, 4096, WORK)
    assert (count, complete) != (3_000**2, True)
    assert distance(point, eye, point, eye) == 0.0
    ring = tree_of(SURFACES["ring"])
    assert distance(ring, eye, ring, eye) == 0.0
    bead = tree_of(np.zeros((1, 3, 3)), 0.1)
    assert distance(ring, eye, bead, eye) == pytest.approx(distance(ring, eye, tree_of(np.zeros((1, 3, 3))), eye) - 0.1)


def test_the_reach_of_a_tree_is_that_of_its_corners():
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for corners in SURFACES.values():
        expected = (corners.reshape(-1, 3) @ directions.T).max(axis=0) + 0.2
        assert tree_extents(tree_of(corners, 0.2), directions) == pytest.approx(expected, abs=1e-14)


def test_a_point_is_inside_a_closed_surface_where_the_exact_test_says_so():
    rng = np.random.default_rng(9)
    ring = cm.Mesh(RING.vertices, RING.faces)
    points = rng.uniform(-1.5, 1.5, (300, 3)) * (1, 1, 0.4)
    expected = locate_in_polyhedron(points, RING.vertices, RING.faces) >= 0
    got = [cm.overlap(ring, cm.Pose(), cm.Points([point]), cm.Pose()) for point in points]
    assert got == expected.tolist()
    assert expected.any() and not expected.all()


def test_a_tree_does_not_depend_on_the_threads_that_build_it(monkeypatch):
    corners = np.random.default_rng(5).normal(size=(5000, 3, 3))
    alone = tree_of(corners)
    monkeypatch.setattr(tree, "PARALLEL", 100)
    for cores in (1, 2, 3, 8):
        monkeypatch.setattr(tree.os, "cpu_count", lambda cores=cores: cores)
        assert tree_of(corners).tobytes() == alone.tobytes()
