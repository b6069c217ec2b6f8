"""Every kind of shape × every operation: a kind that lacks a branch fails here.

Oracles: the support function in NumPy of each kind, points of a dense surface, sums over small cubes, python-fcl.
"""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit
from shapes import CONVEX_SOLIDS, EXAMPLES, WITH_TREES, is_planar

import collision_monitor as cm
from collision_monitor.codec.cdr import Reader, Writer
from collision_monitor.codec.shape_fields import make_shape, read_shape, write_shape
from collision_monitor.errors import ShapeError, UnsupportedError
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.records import ShapeType
from collision_monitor.shapes import calls, registry
from collision_monitor.shapes.calls import core_support, point_distance_range, point_feature, support_point
from collision_monitor.shapes.containment import inside
from collision_monitor.shapes.feature_types import UNKNOWN
from collision_monitor.shapes.ray_casting import first_hits
from collision_monitor.shapes.registry import CURVED, KINDS, REVOLVED, Shape, kind_of
from collision_monitor.shapes.shape_table import ShapeTableBuilder

SLOTS = {n: shape for n, shape in EXAMPLES.items() if n not in WITH_TREES}
BOUNDED = {n: shape for n, shape in EXAMPLES.items() if n != ShapeType.HALF_SPACE}


def by_name(numbers: Any) -> Any:
    return pytest.mark.parametrize("number", list(numbers), ids=lambda n: ShapeType(n).name.lower())


def table_of(shape: Shape) -> Any:
    builder = ShapeTableBuilder(slots=1)
    builder.append(shape)
    return builder.table


def directions(count: int, seed: int = 3) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    axes = [v for v in product((-1.0, 0.0, 1.0), repeat=3) if any(v)]
    d = np.concatenate([axes, d])
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@njit
def support_values(table, d, out):
    for k in range(len(d)):
        out[k] = core_support(table, 0, d[k, 0], d[k, 1], d[k, 2]) + rounding(table, 0)


@njit
def support_points(table, d, out):
    size = table.size[0, 0], table.size[0, 1], table.size[0, 2]
    first, count = table.vertex_start[0], table.vertex_count[0]
    for k in range(len(d)):
        p = support_point(table.kind[0], size, table.vertices, first, count, (d[k, 0], d[k, 1], d[k, 2]))
        out[k, 0], out[k, 1], out[k, 2] = p


@njit
def ranges(table, x, out):
    for k in range(len(x)):
        lower, upper, n = point_distance_range(table, 0, (x[k, 0], x[k, 1], x[k, 2]))
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = lower, upper, n[0], n[1], n[2]


@njit
def features(table, x, n, out):
    for k in range(len(x)):
        out[k, 0], out[k, 1] = point_feature(table, 0, (x[k, 0], x[k, 1], x[k, 2]), (n[k, 0], n[k, 1], n[k, 2]), 1e-9)


def test_every_number_has_one_kind_one_file_and_one_public_class() -> None:
    assert [kind.number for kind in KINDS] == list(ShapeType)
    files = {path.stem for path in (Path(registry.__file__).parent / "kinds").glob("[a-z]*.py")}
    assert files == {re.sub(r"(?<!^)([A-Z])", r"_\1", kind.shape.__name__).lower() for kind in KINDS}
    assert {kind.shape.__name__ for kind in KINDS} == set(registry.__all__) == set(registry.__all__) & set(cm.__all__)
    assert all(getattr(cm, kind.shape.__name__) is kind.shape for kind in KINDS)


@by_name(SLOTS)
def test_kernels_have_the_support_function_of_the_kind(number: int) -> None:
    shape, d = SLOTS[number], directions(500)
    found = np.empty(len(d))
    support_values(table_of(shape), d, found)
    if number == ShapeType.HALF_SPACE:
        assert np.isinf(found).all()  # a pair test of its own answers
        return
    np.testing.assert_allclose(found, kind_of(shape).support(shape, d), rtol=1e-13, atol=1e-15)


@by_name(number for number in SLOTS if number != ShapeType.HALF_SPACE)
def test_support_points_attain_the_support_function(number: int) -> None:
    shape, d = SLOTS[number], directions(500, 5)
    table, found, values = table_of(shape), np.empty((len(d), 3)), np.empty(len(d))
    support_points(table, d, found)
    support_values(table, d, values)
    np.testing.assert_allclose((found * d).sum(axis=1), values - _rounding(table), rtol=1e-13, atol=1e-15)
    assert (np.linalg.norm(found, axis=1) <= table.radius[0]).all()


@njit
def _rounding(table):
    return rounding(table, 0)


@by_name(BOUNDED)
def test_points_of_the_surface_reach_as_far_as_the_support_function(number: int) -> None:
    """Dense points of the surface, by rays, are in every supporting half-space, and some are near each plane."""
    shape, d = BOUNDED[number], directions(100, 7)
    kind = kind_of(shape)
    if kind.planar:
        d = d * [1.0, 1.0, 0.0]
        d = d[np.linalg.norm(d, axis=1) > 0.5]
        d /= np.linalg.norm(d, axis=1, keepdims=True)
    rays = directions(30_000, 9)
    rays = rays * [1.0, 1.0, 0.0] if kind.planar else rays
    rays = rays[np.linalg.norm(rays, axis=1) > 1e-3]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    centre = np.zeros(3) if kind.middle is None else kind.middle(shape)
    if number in WITH_TREES:
        centre = kind.support(shape, np.eye(3)) / 2 - kind.support(shape, -np.eye(3)) / 2
    start = (
        centre - 10.0 * rays + np.random.default_rng(4).uniform(-1, 1, rays.shape) * (0.6, 0.6, 0.6 * (1 - kind.planar))
    )
    hit, normals = first_hits(shape, start, rays)
    met = np.isfinite(hit)
    surface = start[met] + hit[met, None] * rays[met]
    assert len(surface) > 1000
    far = kind.support(shape, d)
    heights = surface @ d.T
    assert (heights <= far + 1e-9).all()
    assert (heights.max(axis=0) >= far - 0.06).all()
    np.testing.assert_allclose(np.linalg.norm(normals[met], axis=1), 1.0, rtol=1e-9)
    assert ((normals[met] * rays[met]).sum(axis=1) <= 1e-9).all()  # a ray enters against the normal


@by_name(number for number in EXAMPLES if number not in WITH_TREES)
def test_what_is_contained_is_what_no_supporting_plane_keeps_out(number: int) -> None:
    shape, rng = EXAMPLES[number], np.random.default_rng(6)
    kind = kind_of(shape)
    p = rng.uniform(-0.8, 1.1, (2000, 3)) * (1.0, 1.0, 0.0 if kind.planar else 1.0)
    d = directions(4000, 11)
    if kind.planar:
        angle = np.linspace(0, 2 * np.pi, 4000)
        d = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    if number == ShapeType.HALF_SPACE:
        d = shape.normal[None]
    outside = (p @ d.T - kind.support(shape, d)).max(axis=1)
    found = inside(shape, p, "closed form")
    assert found[outside < -0.02].all()
    assert not found[outside > 1e-9].any()
    assert 0 < found.sum() < len(p)


@by_name(number for number in CONVEX_SOLIDS)
def test_the_distance_of_a_point_is_between_its_bounds(number: int) -> None:
    """The signed distance from a convex solid is the largest n . x - h(n), over all directions n."""
    shape, rng = CONVEX_SOLIDS[number], np.random.default_rng(12)
    kind, d = kind_of(shape), directions(20_000, 13)
    x = np.concatenate([rng.uniform(-1.0, 1.0, (300, 3)), rng.normal(0, 5, (50, 3)), [(0, 0, 0.2), (0, 0, 3.0)]])
    table, found = table_of(shape), np.empty((len(x), 5))
    ranges(table, x, found)
    margin = float(table.margin[0])
    lower, upper, n = found[:, 0] - margin, found[:, 1] - margin, found[:, 2:]
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose((n * x).sum(axis=1) - kind.support(shape, n), lower, atol=1e-12, rtol=1e-12)
    sampled = (x @ d.T - kind.support(shape, d)).max(axis=1)
    assert (upper >= sampled - 1e-12).all()
    exact = lower == upper
    assert (sampled[exact] >= lower[exact] - 0.05).all()
    if kind.exact or kind.ball or number == ShapeType.ROUNDED_BOX:
        assert exact.all()


@by_name(number for number in SLOTS if not is_planar(number))
def test_features_of_kernels_are_those_of_numpy(number: int) -> None:
    """At points of the surface, a little inside of faces, on edges and at corners."""
    shape, d = SLOTS[number], directions(300, 15)
    kind = kind_of(shape)
    table, points, found = table_of(shape), np.empty((len(d), 3)), np.empty((len(d), 2))
    if number == ShapeType.HALF_SPACE:
        points[:] = shape.offset * shape.normal
    else:
        support_points(table, d, points)
    features(table, points, d, found)
    if number == ShapeType.CONVEX_HULL:
        assert (found[:, 0] == UNKNOWN).all()  # its vertices say it
        return
    assert (found[:, 0] != UNKNOWN).all()
    if kind.feature is None or not (CURVED[number] or number == ShapeType.HALF_SPACE):
        return
    for row, x, n in zip(found, points, d, strict=True):
        expected = kind.feature(shape, x, n, 1e-6, 0.0)
        assert row[0] == expected.type
        assert row[1] == max(expected.face, *expected.vertices, 0)


@by_name(EXAMPLES)
def test_a_message_holds_it(number: int) -> None:
    shape = EXAMPLES[number]
    writer = Writer("Shape")
    write_shape(writer, shape)
    fields = read_shape(Reader(writer.finish(), "Shape"))
    assert fields[0] == number
    again = make_shape(fields)
    assert type(again) is type(shape)
    for name, value in shape.__getstate__().items():
        np.testing.assert_array_equal(value, getattr(again, name))
    kind = kind_of(shape)
    if kind.expected_dimensions:
        with pytest.raises(ShapeError, match=f"expected {kind.expected_dimensions} dimensions"):
            make_shape(fields._replace(dimensions=np.ones(kind.expected_dimensions + 1)))


@by_name(number for number, shape in EXAMPLES.items() if kind_of(shape).mass)
def test_the_mass_is_that_of_small_cubes(number: int) -> None:
    shape = EXAMPLES[number]
    found = cm.response.mass_properties(shape, 2.0)
    low, high = -kind_of(shape).support(shape, -np.eye(3)), kind_of(shape).support(shape, np.eye(3))
    n = 90
    edges = [np.linspace(low[k], high[k], n + 1) for k in range(3)]
    middle = np.stack(np.meshgrid(*[(e[1:] + e[:-1]) / 2 for e in edges], indexing="ij"), axis=-1).reshape(-1, 3)
    cells = middle[inside(shape, middle, "closed form")]
    weight = 2.0 * float(np.prod((high - low) / n))
    assert found.mass == pytest.approx(weight * len(cells), rel=0.01)
    np.testing.assert_allclose(found.centre, cells.mean(axis=0), atol=0.005)
    from_centre = cells - found.centre
    inertia = weight * ((from_centre**2).sum() * np.eye(3) - from_centre.T @ from_centre)
    np.testing.assert_allclose(found.inertia, inertia, atol=0.02 * np.trace(inertia))


@by_name(number for number, shape in EXAMPLES.items() if kind_of(shape).scaled)
def test_a_scaled_shape_reaches_further_by_the_factor(number: int) -> None:
    shape, d = EXAMPLES[number], directions(100)
    kind = kind_of(shape)
    assert kind.scaled is not None
    scaled = kind.scaled(shape, 2.5)
    centre = shape.vertices.mean(axis=0) if number == ShapeType.MESH else np.zeros(3)
    np.testing.assert_allclose(
        kind.support(scaled, d) - d @ centre, 2.5 * (kind.support(shape, d) - d @ centre), rtol=1e-12, atol=1e-12
    )


@by_name(EXAMPLES)
def test_its_picture_is_as_large_as_it_is(number: int) -> None:
    shape = EXAMPLES[number]
    triangles = kind_of(shape).triangles(shape)
    assert triangles.shape[1:] == (3, 3)
    if number in (ShapeType.HALF_SPACE, ShapeType.POLYGON):  # an infinite plane; an outline that stands upright
        return
    reach = kind_of(shape).support(shape, np.concatenate([np.eye(3), -np.eye(3)]))
    corners = triangles.reshape(-1, 3)
    drawn = np.concatenate([corners.max(axis=0), -corners.min(axis=0)])
    assert (drawn <= reach + 1e-12).all()
    assert (drawn >= 0.8 * reach - 0.05).all()


@by_name(number for number, shape in EXAMPLES.items() if kind_of(shape).farthest)
def test_it_reaches_farthest_where_it_says(number: int) -> None:
    shape = EXAMPLES[number]
    kind = kind_of(shape)
    assert kind.farthest is not None
    d = kind.farthest(shape)
    best = float(kind.support(shape, d / np.linalg.norm(d)))
    assert best >= kind.support(shape, directions(5000)).max() - 1e-9


@by_name(number for number in CONVEX_SOLIDS)
def test_a_solid_of_revolution_and_a_ball_look_the_same_turned(number: int) -> None:
    shape, d = CONVEX_SOLIDS[number], directions(200)
    kind = kind_of(shape)
    turn = cm.Pose((0, 0, 0), (0, 0, np.sin(0.6), np.cos(0.6))).rotation
    same = np.allclose(kind.support(shape, d @ turn), kind.support(shape, d), atol=1e-12)
    assert same == kind.revolved == REVOLVED[number]
    tilt = cm.Pose((0, 0, 0), (np.sin(0.6), 0, 0, np.cos(0.6))).rotation
    assert np.allclose(kind.support(shape, d @ tilt), kind.support(shape, d), atol=1e-12) == kind.ball


def test_every_chain_ends_in_a_bound_that_is_safe() -> None:
    """A kind without a branch reaches farther than any shape, so that its pairs are never apart."""
    table = table_of(cm.Box((1, 1, 1)))
    table.kind[0] = 255
    d, values, points, distance = directions(20), np.empty(46), np.empty((46, 3)), np.empty((46, 5))
    support_values_of_kind(table, d, values)
    assert (values == np.inf).all()
    support_points(table, d, points)
    assert ((points * d).sum(axis=1) >= calls.BEYOND / 2).all()
    ranges(table, 5.0 * d, distance)
    assert (distance[:, 0] == -np.inf).all()
    assert (distance[:, 1] == np.inf).all()
    kind, number = np.array([(0, 0)]), np.empty((1, 2))
    features(table, np.zeros((1, 3)), np.eye(3)[:1], number)
    assert number[0, 0] == UNKNOWN
    assert len(kind) == 1


@njit
def support_values_of_kind(table, d, out):
    for k in range(len(d)):
        out[k] = core_support(table, 0, d[k, 0], d[k, 1], d[k, 2])


@pytest.mark.parametrize("value", ["text", None, 3, cm.Pose()], ids=str)
def test_other_objects_have_no_kind(value: object) -> None:
    with pytest.raises(ShapeError, match="expected a shape"):
        kind_of(value)


def test_a_subclass_has_the_kind_of_its_base() -> None:
    class Wheel(cm.Cylinder):
        """A cylinder of a user."""

    assert kind_of(Wheel(0.3, 0.1)).number == ShapeType.CYLINDER


def test_a_shape_without_a_test_for_points_is_refused() -> None:
    with pytest.raises(UnsupportedError, match="Triangle"):
        inside(registry.Triangle(np.eye(3)), np.zeros((1, 3)), "closed form")
