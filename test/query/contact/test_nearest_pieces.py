"""The nearest two pieces of two objects against every pair of pieces, and the number of pairs examined."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.query.contact.nearest_pieces import ALL_PAIRS, NearestPieces
from collision_monitor.query.piece_table import PieceTable, exact_piece_table, piece_table
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Circle, HalfSpace, Mesh, Polygon, Sphere
from collision_monitor.shapes.shape_table import join


def torus(major: int, minor: int) -> Mesh:
    ring = trimesh.creation.torus(1.0, 0.3, major_sections=major, minor_sections=minor)
    return Mesh(ring.vertices, ring.faces)


def soup(rng: np.random.Generator, count: int) -> Mesh:
    """Random triangles of very different sizes, including needles."""
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(
        -3, 0, (count, 1, 1)
    )
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def kinds(rng: np.random.Generator, count: int) -> list[tuple[cm.Shape, Pose]]:
    shapes = [Box((0.3, 0.2, 0.1)), Sphere(0.1), Capsule(0.05, 0.4)]
    quaternions = Rotation.random(count, rng=rng).as_quat()
    return [(shapes[k % 3], Pose(rng.uniform(-2, 2, 3), quaternions[k])) for k in range(count)]


def nearest_of_all(a: PieceTable, b: PieceTable, R: np.ndarray, p: np.ndarray) -> float:
    table = join([a.table, b.table])
    position = np.concatenate([a.position, b.position @ R.T + p])
    rotation = np.concatenate([a.rotation, R @ b.rotation])
    pairs = np.stack(np.meshgrid(np.arange(len(a)), len(a) + np.arange(len(b)), indexing="ij"), -1)
    return float(contact_batch(table, position, rotation, pairs.reshape(-1, 2).astype(np.int32))[:, 0].min())


@pytest.mark.parametrize("objects", ["soups", "compounds", "ground", "few"])
def test_it_finds_what_looking_at_all_pairs_finds(objects: str) -> None:
    rng = np.random.default_rng(5)
    identity = np.eye(3), np.zeros(3)
    for _ in range(12):
        if objects == "soups":
            a, b = (exact_piece_table(((soup(rng, count), Pose()),)) for count in (130, 90))
        elif objects == "few":
            a, b = piece_table(kinds(rng, 3)), piece_table(kinds(rng, 40))
        else:
            a, b = piece_table(kinds(rng, 60)), piece_table(kinds(rng, 70))
            if objects == "ground":
                b = exact_piece_table([*kinds(rng, 70), (HalfSpace((0, 0, 1)), Pose((0, 0, -rng.uniform(1.0, 4.0))))])
        assert (len(a) * len(b) > ALL_PAIRS) == (objects != "few")
        R, p = Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3) * rng.choice([0.1, 3, 8])
        found = NearestPieces(a, identity, b, (R, p))
        assert found.best[0] == nearest_of_all(a, b, R, p)


def test_few_pairs_of_triangles_are_looked_at() -> None:
    ring = exact_piece_table(((torus(64, 16), Pose()),))
    rng = np.random.default_rng(2)
    for far in (0.3, 1.5, 3.0, 10.0):
        place = Rotation.random(rng=rng).as_matrix(), far * np.array([0.6, 0.0, 0.8])
        found = NearestPieces(ring, (np.eye(3), np.zeros(3)), ring, place)
        tested = sum(len(pairs) for pairs, _ in found.looked_at)
        assert tested < 0.01 * len(ring) ** 2


def test_meshes_of_many_triangles() -> None:
    """Meshes of 16,000 triangles beside each other, linked, and one in the other; all pairs would take 2 GB."""
    ring = torus(256, 32)
    assert len(ring.faces) == 2 * 256 * 32
    upright = np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)
    c = cm.contact(ring, Pose(), ring, Pose((3.0, 0, 0), upright))
    assert c.signed_distance == pytest.approx(3.0 - 2.6, abs=1e-12)  # from corner to corner
    linked = cm.contact(ring, Pose(), ring, Pose((1.1, 0, 0), upright))
    assert linked.signed_distance == pytest.approx(0.3, abs=1e-4)  # from edge to corner
    bead = cm.contact(ring, Pose(), Sphere(0.1), Pose((1.0, 0, 0)))
    assert bead.overlaps and bead.signed_distance == pytest.approx(-0.2, abs=1e-2)
    small = Mesh(0.05 * ring.vertices, ring.faces)
    assert cm.contact(ring, Pose(), small, Pose((1.0, 0.1, 0.05), upright)).overlaps
    assert not cm.contact(ring, Pose(), small, Pose((0.5, 0.1, 0.0))).overlaps


def test_concave_polygons_of_many_parts() -> None:
    angle = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    star = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.where(np.arange(160) % 2, 1.0, 2.0)[:, None]
    a = exact_piece_table(((Polygon(star), Pose()),))
    assert len(a) ** 2 > ALL_PAIRS
    c = cm.contact(Polygon(star), Pose(), Polygon(star), Pose((5.0, 0, 0)))
    assert c.signed_distance == pytest.approx(1.0)
    assert cm.contact(Polygon(star), Pose((0, 3, 0)), Circle(0.5), Pose()).signed_distance == pytest.approx(0.5)
