"""Tests of the shape table: growth, reuse, shared hulls, and tight bounds against sampled or enumerated points."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from collision_monitor._jit.vectors import LANES
from collision_monitor.errors import InputError, ShapeError, UnsupportedError
from collision_monitor.geometry.qhull import hull_vertices
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.shapes import registry as shapes
from collision_monitor.shapes.calls import core_support
from collision_monitor.shapes.pose import Pose, rotation_matrix
from collision_monitor.shapes.shape_table import ShapeTableBuilder


@njit
def _bounds(table, slot, R, out):
    """Bounds along the axes of the world, from the support values that all kernels use."""
    for i in range(3):
        x, y, z = R[i, 0], R[i, 1], R[i, 2]
        out[i] = -core_support(table, slot, -x, -y, -z) - rounding(table, slot)
        out[3 + i] = core_support(table, slot, x, y, z) + rounding(table, slot)


def _rotation(rng):
    q = rng.normal(size=4)
    return rotation_matrix(q / np.linalg.norm(q))


CUBE = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1, 1) for z in (-1, 1)])


def _surface(shape, rng):
    """Many points of the shape's surface, including those that can be extreme."""
    angle = np.linspace(0, 2 * np.pi, 20001)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    match shape:
        case shapes.Box():
            return CUBE * np.array(shape.size) / 2
        case shapes.Cylinder():
            half = np.array([0, 0, shape.length / 2])
            return np.concatenate([ring * shape.radius + half, ring * shape.radius - half])
        case shapes.Cone():
            half = np.array([0, 0, shape.length / 2])
            return np.concatenate([ring * shape.radius - half, half[None]])
        case shapes.ConvexHull():
            return shape.points
        case shapes.Ellipsoid():
            points = rng.normal(size=(400_000, 3))
            return points / np.linalg.norm(points, axis=1, keepdims=True) * shape.radii
    raise AssertionError


SHAPES = [
    shapes.Box((1, 2, 3)),
    shapes.Box((1, 2, 0)),
    shapes.Cylinder(0.4, 2),
    shapes.Cone(0.7, 1.5),
    shapes.Cone(0.2, 3),
    shapes.Ellipsoid((0.3, 1.0, 0.7)),
    shapes.ConvexHull(np.random.default_rng(1).normal(size=(40, 3)) + 2),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: type(s).__name__)
def test_bounds_are_tight(shape):
    rng = np.random.default_rng(2)
    builder = ShapeTableBuilder()
    slot = builder.append(shape, margin=0.25)
    points = _surface(shape, rng)
    out = np.empty(6)
    for _ in range(20):
        R = _rotation(rng)
        _bounds(builder.table, slot, R, out)
        world = points @ R.T
        atol = 1e-4 if isinstance(shape, shapes.Ellipsoid) else 1e-7  # its extreme points are between the sampled ones
        np.testing.assert_allclose(out[:3], world.min(axis=0) - 0.25, atol=atol)
        np.testing.assert_allclose(out[3:], world.max(axis=0) + 0.25, atol=atol)
        assert np.linalg.norm(points, axis=1).max() + 0.25 <= builder.table.radius[slot]


def test_bounds_of_round_shapes():
    builder = ShapeTableBuilder()
    sphere = builder.append(shapes.Sphere(2.0))
    capsule = builder.append(shapes.Capsule(0.5, 4.0))
    plane = builder.append(shapes.HalfSpace((0, 0, 2), 3))
    R = _rotation(np.random.default_rng(3))
    out = np.empty(6)
    _bounds(builder.table, sphere, R, out)
    assert out.tolist() == [-2, -2, -2, 2, 2, 2]
    _bounds(builder.table, capsule, R, out)
    np.testing.assert_allclose(out[3:], np.abs(R[:, 2]) * 2 + 0.5)
    np.testing.assert_allclose(out[:3], -out[3:])
    _bounds(builder.table, plane, R, out)
    assert np.all(out[:3] == -np.inf) and np.all(out[3:] == np.inf)
    assert builder.table.radius[plane] == np.inf
    np.testing.assert_allclose(builder.table.size[plane], [0, 0, 1, 1.5])


def test_growth_keeps_content_and_never_recompiles():
    builder = ShapeTableBuilder(slots=1, vertices=LANES)
    rng = np.random.default_rng(4)
    out = np.empty(6)
    _bounds(builder.table, builder.append(shapes.Sphere(1.0)), np.eye(3), out)
    compiled = len(_bounds.signatures)
    hulls = [shapes.ConvexHull(rng.normal(size=(12, 3))) for _ in range(40)]
    slots = [builder.append(hull) for hull in hulls]
    for slot, hull in zip(slots, hulls, strict=True):
        _bounds(builder.table, slot, np.eye(3), out)
        np.testing.assert_array_equal(out, np.concatenate([hull.points.min(axis=0), hull.points.max(axis=0)]))
    assert len(_bounds.signatures) == compiled
    for array in builder.table:
        assert array.flags.c_contiguous


def test_interior_points_and_duplicates_are_dropped():
    rng = np.random.default_rng(5)
    points = np.concatenate([rng.uniform(-0.9, 0.9, (50, 3)), CUBE, CUBE])
    np.testing.assert_array_equal(hull_vertices(points), np.arange(50, 58))
    builder = ShapeTableBuilder()
    slot = builder.append(shapes.ConvexHull(points))
    start, count = builder.table.vertex_start[slot], builder.table.vertex_count[slot]
    assert count == 8
    np.testing.assert_array_equal(builder.table.vertices[:, start : start + count].T, CUBE)
    np.testing.assert_array_equal(builder.table.vertex_index[start : start + count], np.arange(50, 58))


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_flat_and_tiny_hulls_lose_nothing(scale):
    points = CUBE * np.array([1, 1, 1e-7]) * scale + 5 * scale
    assert len(hull_vertices(points)) == 8


def test_identical_hulls_share_vertices_until_the_last_is_removed():
    builder = ShapeTableBuilder()
    first, second = (builder.append(shapes.ConvexHull(CUBE)) for _ in range(2))
    assert builder.table.vertex_start[first] == builder.table.vertex_start[second]
    builder.remove(first)
    third = builder.append(shapes.ConvexHull(2 * CUBE))
    assert third == first, "a free slot is used again"
    assert builder.table.vertex_start[third] != builder.table.vertex_start[second]
    block = builder.table.vertex_start[second]
    builder.remove(second)
    fourth = builder.append(shapes.ConvexHull(3 * CUBE))
    assert builder.table.vertex_start[fourth] == block, "a free block is used again"
    assert len(builder) == 2


def test_gaps_between_hulls_are_closed_and_every_shape_keeps_its_corners():
    rng = np.random.default_rng(0)
    builder = ShapeTableBuilder(slots=4, vertices=64)
    kept: dict[int, np.ndarray] = {}
    live = 0
    for k in range(400):
        points = rng.normal(size=(8 + 8 * (k % 40), 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)  # all of them are corners
        slot = builder.append(shapes.ConvexHull(points))
        assert builder.append(shapes.ConvexHull(points)) != slot  # shares the block
        kept[slot] = points
        if len(kept) > 3:
            gone = list(kept)[int(rng.integers(3))]
            del kept[gone]
            builder.remove(gone)  # the slot that shares its block still holds it
            shared = [s for s in range(len(builder.used.kind)) if builder.used.kind[s] and s not in kept]
            for s in shared[: max(0, len(shared) - 3)]:
                builder.remove(s)
        live = max(live, sum(int(c) for c in builder.used.vertex_count))
        table = builder.used
        for s, corners in kept.items():
            block = slice(table.vertex_start[s], table.vertex_start[s] + table.vertex_count[s])
            assert np.array_equal(np.unique(table.vertices[:, block].T, axis=0), np.unique(corners, axis=0))
            assert np.array_equal(corners[table.vertex_index[block]], table.vertices[:, block].T)
    assert len(builder.table.vertex_index) <= 4 * live
    back = ShapeTableBuilder.restored(table, *builder.free)
    assert back._blocks == builder._blocks
    assert back._users == builder._users


def test_local_pose_is_kept():
    builder = ShapeTableBuilder()
    pose = Pose((1, 2, 3), (0, 0, np.sin(0.5), np.cos(0.5)))
    slot = builder.append(shapes.Box((1, 1, 1)), pose)
    np.testing.assert_array_equal(builder.table.local_position[slot], pose.position)
    np.testing.assert_array_equal(builder.table.local_rotation[slot], pose.rotation)


def test_what_cannot_be_done_is_said():
    builder = ShapeTableBuilder()
    with pytest.raises(ShapeError, match="expected a convex polygon"):
        builder.append(shapes.Polygon([(0, 0), (2, 0), (0.5, 0.5), (0, 2)]))
    with pytest.raises(UnsupportedError, match="Mesh has no narrow phase; supported are Sphere, Box"):
        builder.append(shapes.Mesh(CUBE, [[0, 1, 2]]))
    with pytest.raises(ShapeError, match="margin"):
        builder.append(shapes.Sphere(1.0), margin=-1.0)
    with pytest.raises(InputError, match="slot"):
        builder.remove(0)
    slot = builder.append(shapes.Sphere(1.0))
    builder.remove(slot)
    with pytest.raises(InputError, match="slot"):
        builder.remove(slot)
    assert len(builder) == 0


def test_removed_slots_point_into_the_table_after_its_gaps_were_closed():
    """A snapshot holds the free slots too, and is refused if they point behind the last vertex."""
    builder = ShapeTableBuilder()
    rng = np.random.default_rng(5)

    def ball(corners: int) -> shapes.ConvexHull:
        points = rng.normal(size=(corners, 3))
        return shapes.ConvexHull(points / np.linalg.norm(points, axis=1, keepdims=True))

    slots = [builder.append(ball(40 + k)) for k in range(16)]
    before = len(builder.used.vertex_index)
    for slot in slots[1:]:
        builder.remove(slot)
    slots.append(builder.append(ball(len(builder.table.vertex_index) - before + 1)))
    table = builder.used
    assert len(table.vertex_index) < before, "the gaps were closed"
    assert (table.vertex_start + table.vertex_count <= len(table.vertex_index)).all()
