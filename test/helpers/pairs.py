"""Contact of one pair of shapes by the batch kernels, as a record with named fields."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from kernels import separation_batch

from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes import registry as shapes
from collision_monitor.shapes.shape_table import ShapeTableBuilder

AB = np.array([[0, 1]], np.int32)
BA = np.array([[1, 0]], np.int32)
EYE = np.eye(3)


@dataclass
class Contact:
    distance: float
    normal: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray
    bound: float
    features: tuple[int, ...]
    gap: float
    gap_direction: np.ndarray


def contact(a, b, p=(0, 0, 0), R_A=EYE, R_B=EYE, margins=(0.0, 0.0), swap=False, origin=(0, 0, 0)) -> Contact:
    """Contact and separation of a at `origin` and b at origin + p; checks the invariants of every answer."""
    builder = ShapeTableBuilder(slots=2)
    builder.append(a, margin=margins[0])
    builder.append(b, margin=margins[1])
    origin = np.asarray(origin, float)
    position = np.stack([origin, origin + p])
    rotation = np.stack([R_A, R_B]).astype(float)
    row = contact_batch(builder.table, position, rotation, BA if swap else AB)[0]
    gap = separation_batch(builder.table, position, rotation, BA if swap else AB)[0]
    assert np.isfinite(row).all()
    assert np.isfinite(gap).all()
    scale = np.abs(p).max() + sum(size(s) for s in (a, b))
    assert abs(np.linalg.norm(row[1:4]) - 1) < 1e-12
    assert abs(np.linalg.norm(gap[:3]) - 1) < 1e-12
    np.testing.assert_allclose(row[7:10], row[4:7] + row[0] * row[1:4], rtol=0, atol=1e-14 * scale)
    assert gap[3] <= max(row[0], 0.0), "the separation is a lower bound of the distance"
    return Contact(row[0], row[1:4], row[4:7], row[7:10], row[10], tuple(int(x) for x in row[11:]), gap[3], gap[:3])


def size(shape) -> float:
    """Characteristic length of the shape (m), for relative tolerances."""
    match shape:
        case shapes.Sphere():
            return shape.radius
        case shapes.Box() | shapes.RoundedBox():
            return max(shape.size)
        case shapes.TruncatedCone():
            return max(shape.bottom_radius, shape.top_radius) + shape.length
        case shapes.HalfSpace():
            return abs(shape.offset)
        case shapes.ConvexHull():
            return float(np.abs(shape.points).max())
        case shapes.Ellipsoid():
            return max(shape.radii)
    return shape.radius + shape.length


def support(shape, R, n) -> float:
    """Support value max n.x over the shape turned by R, by definition and independently of the kernels."""
    d = R.T @ n
    rim = np.hypot(d[0], d[1])
    match shape:
        case shapes.Sphere():
            return shape.radius
        case shapes.Box():
            return float(np.abs(d) @ np.array(shape.size) / 2)
        case shapes.Capsule():
            return abs(d[2]) * shape.length / 2 + shape.radius
        case shapes.Cylinder():
            return abs(d[2]) * shape.length / 2 + shape.radius * rim
        case shapes.Cone():
            return max(d[2] * shape.length / 2, shape.radius * rim - d[2] * shape.length / 2)
        case shapes.ConvexHull():
            return float((shape.points @ d).max())
        case shapes.Ellipsoid():
            return float(np.linalg.norm(d * shape.radii))
    raise AssertionError


def projected_gap(a, b, p, R_A, R_B, n) -> float:
    """Gap of the projections on n: a lower bound on the signed distance."""
    return float(np.dot(p, n)) - support(b, R_B, -n) - support(a, R_A, n)


def points_of(shape, sides: int = 0) -> np.ndarray:
    """Vertices of a polytope, or of a prism or pyramid with `sides` sides inscribed in a cylinder or cone."""
    match shape:
        case shapes.Box():
            return np.array(list(product(*[(-s / 2, s / 2) for s in shape.size])))
        case shapes.ConvexHull():
            return shape.points
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle), 0 * angle - shape.length / 2], 1)
    is_cylinder = isinstance(shape, shapes.Cylinder)
    top = np.add(ring, (0, 0, shape.length)) if is_cylinder else np.array([[0, 0, shape.length / 2]])
    return np.concatenate([ring, top])
