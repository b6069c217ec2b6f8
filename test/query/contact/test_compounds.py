"""Objects of many pieces against every pair of their pieces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.query import body
from collision_monitor.shapes.convex_pieces import convex_pieces
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Circle, HalfSpace, Mesh, Polygon, Sphere
from collision_monitor.shapes.shape_table import ShapeTableBuilder


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


def pieces_of(shapes: list[tuple[cm.Shape, Pose]], pose: Pose) -> list[tuple[cm.Shape, Pose]]:
    return [(part, pose @ own @ at) for shape, own in shapes for part, at in convex_pieces(shape)]


def nearest_of_all(a: list[tuple[cm.Shape, Pose]], b: list[tuple[cm.Shape, Pose]]) -> float:
    """Least distance (m) of all pairs of convex pieces, each at its pose in the world."""
    builder = ShapeTableBuilder(slots=len(a) + len(b), vertices=0)
    for shape, _ in (*a, *b):
        builder.append(shape)
    position, rotation = (np.array([getattr(pose, name) for _, pose in (*a, *b)]) for name in ("position", "rotation"))
    pairs = np.stack(np.meshgrid(np.arange(len(a)), len(a) + np.arange(len(b)), indexing="ij"), -1)
    return float(contact_batch(builder.used, position, rotation, pairs.reshape(-1, 2).astype(np.int32))[:, 0].min())


@pytest.mark.parametrize("objects", ["soups", "compounds", "ground", "few"])
def test_the_nearest_pieces_are_those_of_all_pairs(objects: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(12):
        if objects == "soups":
            a, b = ([(soup(rng, count), Pose())] for count in (130, 90))
        elif objects == "few":
            a, b = kinds(rng, 3), kinds(rng, 40)
        else:
            a, b = kinds(rng, 60), kinds(rng, 70)
            if objects == "ground":
                b.append((HalfSpace((0, 0, 1)), Pose((0, 0, -rng.uniform(1.0, 4.0)))))
        place = Pose(rng.uniform(-1, 1, 3) * rng.choice([0.1, 3, 8]), Rotation.random(rng=rng).as_quat())
        expected = nearest_of_all(pieces_of(a, Pose()), pieces_of(b, place))
        one, other = cm.contact(a, Pose(), b, place), cm.contact(b, place, a, Pose())
        assert abs(one.signed_distance - expected) <= one.error_bound + 1e-12
        assert abs(other.signed_distance - expected) <= other.error_bound + 1e-12
        if expected > 0.0 and objects != "soups":  # what soups enclose is not certain
            assert one.error_bound < 1e-7


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
    assert len(convex_pieces(Polygon(star))) > 50
    c = cm.contact(Polygon(star), Pose(), Polygon(star), Pose((5.0, 0, 0)))
    assert c.signed_distance == pytest.approx(1.0)
    assert cm.contact(Polygon(star), Pose((0, 3, 0)), Circle(0.5), Pose()).signed_distance == pytest.approx(0.5)


def test_shapes_take_the_place_of_objects_that_are_gone() -> None:
    """A shape in the slot of a piece that stood elsewhere, or had others behind it, stands at its own origin, alone."""
    rng = np.random.default_rng(5)
    for _ in range(300):
        pieces = [(cm.Sphere(0.5), cm.Pose(tuple(rng.uniform(3.0, 9.0, 3)))) for _ in range(rng.integers(1, 4))]
        nearest = min(float(np.linalg.norm(pose.position)) for _, pose in pieces) - 1.0
        distance = cm.contact(pieces, cm.Pose(), cm.Sphere(0.5), cm.Pose()).signed_distance
        assert distance == pytest.approx(nearest, abs=1e-9)
        body._compound._results.clear()  # what is remembered keeps its slots
        balls = [cm.Sphere(radius) for radius in (0.1, 0.2, 0.3, 0.4)]
        for ball in balls:
            distance = cm.contact(ball, cm.Pose(), balls[0], cm.Pose((2.0, 0.0, 0.0))).signed_distance
            assert distance == pytest.approx(1.9 - ball.radius, abs=1e-12)
