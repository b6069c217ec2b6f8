"""Where rays first meet a solid shape, in the shape's frame: clipped intervals of planes, quadratics, edges, triangles.

A ray is p + t d, with a unit vector d and t in m. A ray that starts inside meets the solid at t = 0, without a normal.
(Slides "Line intersection", "Ray test", "Edge intersection face test"; Kay and Kajiya, 1986, for the clipping)
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.coordinates import Array, Booleans
from collision_monitor.geometry.ray_crossings import edge_hits, face_hits
from collision_monitor.shapes.containment import inside
from collision_monitor.shapes.shapes import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Points,
    Polygon,
    Shape,
    Sphere,
)

AT_ONCE: Final = 1 << 20
"""Pairs of a ray and an edge or a face in one batch, which limits the temporary arrays to 200 MB."""


class RayInterval(NamedTuple):
    """Part of each ray in a convex solid: t from enter (...) to leave (...); empty if enter > leave."""

    enter: Array
    leave: Array
    normal: Array  # (..., 3) outward unit normal where it enters


def first_hits(shape: Shape, p: Array, d: Array) -> tuple[Array, Array]:
    """Least t >= 0 (n,), infinite for none, and outward unit normals (n, 3) there, zero inside and for none.

    p (n, 3) m, unit d (n, 3), in the shape's frame. Raises UnsupportedError, InputError.
    """
    if isinstance(shape, Mesh):
        return _mesh_hits(shape, p, d)
    if isinstance(shape, Polygon):
        return _polygon_hits(shape, p, d)
    if isinstance(shape, Points):
        return _cloud_hits(shape, p, d)
    parts = _solids(shape, p, d)
    best, normals = np.full(len(p), np.inf), np.zeros_like(p)
    for part in parts:
        meets = (part.enter <= part.leave) & (part.leave >= 0.0)
        t = np.where(meets, np.maximum(part.enter, 0.0), np.inf)
        nearer = t < best
        best[nearer] = t[nearer]
        normals[nearer] = np.where((part.enter >= 0.0)[:, None], part.normal, 0.0)[nearer]
    return best, normals


def _solids(shape: Shape, p: Array, d: Array) -> list[RayInterval]:
    """Intervals of convex solids that make up the shape."""
    match shape:
        case Sphere():
            return [_ball(p, d, shape.radius)]
        case Box():
            half = np.array(shape.size) / 2
            return [_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.tile(half, 2), p, d)]
        case ConvexHull():
            hull = convex_hull(shape.points)
            a, b, c = (hull.vertices[corner] for corner in hull.faces.T)
            normal = np.cross(b - a, c - a)
            length = np.linalg.norm(normal, axis=1)
            normal = normal[length > 0.0] / length[length > 0.0, None]
            return [_planes(normal, np.einsum("ni,ni->n", normal, a[length > 0.0]), p, d)]
        case Ellipsoid():
            return [_ellipsoid(p, d, np.array(shape.radii))]
        case HalfSpace():
            return [_planes(shape.normal[None], np.array([shape.offset]), p, d)]
        case Cylinder():
            return [_common(_tube(p, d, shape.radius), _caps(p, d, shape.length / 2))]
        case Capsule():
            end = np.array([0.0, 0.0, shape.length / 2])
            tube = _common(_tube(p, d, shape.radius), _caps(p, d, shape.length / 2))
            return [tube, _ball(p - end, d, shape.radius), _ball(p + end, d, shape.radius)]
        case Cone():
            return [_cone(shape, p, d)]
        case Circle():
            _check_in_plane(d)
            flat = p * [1.0, 1.0, 0.0]
            return [_ball(flat, d, shape.radius)]
    raise UnsupportedError(f"{type(shape).__name__}: rays are not offered for it")


def _check_in_plane(d: Array) -> None:
    if d[:, 2].any():
        raise InputError("direction: expected one in the x-y plane for a Circle or a Polygon, got one out of it")


def _ball(p: Array, d: Array, radius: float) -> RayInterval:
    middle = -_dot(p, d)
    across = p + middle[..., None] * d  # the ray's point nearest to the centre: its square does not cancel
    rest = radius * radius - _dot(across, across)
    half = np.sqrt(np.maximum(rest, 0.0))
    enter = np.where(rest >= 0.0, middle - half, np.inf)
    return RayInterval(enter, np.where(rest >= 0.0, middle + half, -np.inf), (across - half[..., None] * d) / radius)


def _ellipsoid(p: Array, d: Array, radii: Array) -> RayInterval:
    """In coordinates in which it is a ball, and from the ray's point nearest to its centre, which keeps digits."""
    near = -_dot(p, d)
    least = radii.min()
    w, u = (p + near[:, None] * d) * (least / radii), d * (least / radii)
    square = _dot(u, u)
    middle = -_dot(w, u) / square
    across = w + middle[:, None] * u
    rest = least * least - _dot(across, across)
    half = np.sqrt(np.maximum(rest, 0.0) / square)
    normal = (across - half[:, None] * u) * (least / radii)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    enter = np.where(rest >= 0.0, near + middle - half, np.inf)
    leave = np.where(rest >= 0.0, near + middle + half, -np.inf)
    return RayInterval(enter, leave, normal / np.where(length > 0.0, length, 1.0))


def _planes(normal: Array, offset: Array, p: Array, d: Array) -> RayInterval:
    """Intersection of half-spaces {x : n.x <= offset}."""
    height, speed = p @ normal.T - offset, d @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -height / speed
    enter = np.where(speed < 0.0, t, np.where((speed == 0.0) & (height > 0.0), np.inf, -np.inf))
    leave = np.where(speed > 0.0, t, np.inf)
    which = enter.argmax(axis=1)
    return RayInterval(enter.max(axis=1), leave.min(axis=1), normal[which])


def _tube(p: Array, d: Array, radius: float) -> RayInterval:
    """An infinite cylinder about z."""
    u, w = d * [1.0, 1.0, 0.0], p * [1.0, 1.0, 0.0]
    square = _dot(u, u)
    along = square == 0.0
    scale = np.where(along, 1.0, square)
    middle = -_dot(w, u) / scale
    across = w + middle[:, None] * u
    rest = radius * radius - _dot(across, across)
    half = np.where(along, np.inf, np.sqrt(np.maximum(rest, 0.0) / scale))
    enter, leave = np.where(rest >= 0.0, middle - half, np.inf), np.where(rest >= 0.0, middle + half, -np.inf)
    finite = np.where(np.isfinite(half), half, 0.0)
    return RayInterval(enter, leave, (across - finite[:, None] * u) / radius)


def _caps(p: Array, d: Array, half: float) -> RayInterval:
    """The slab |z| <= half."""
    axis = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    return _planes(axis, np.full(2, half), p, d)


def _common(a: RayInterval, b: RayInterval) -> RayInterval:
    later = (a.enter >= b.enter)[:, None]
    return RayInterval(np.maximum(a.enter, b.enter), np.minimum(a.leave, b.leave), np.where(later, a.normal, b.normal))


def _cone(shape: Cone, p: Array, d: Array) -> RayInterval:
    """Between base and apex, the points with f = x² + y² - (s (apex - z))² <= 0, where f is a quadratic of t."""
    slope, apex = shape.radius / shape.length, shape.length / 2
    slab = _caps(p, d, apex)
    down, fall = slope * (apex - p[:, 2]), -slope * d[:, 2]
    a = d[:, 0] ** 2 + d[:, 1] ** 2 - fall**2
    b = d[:, 0] * p[:, 0] + d[:, 1] * p[:, 1] - fall * down
    c = p[:, 0] ** 2 + p[:, 1] ** 2 - down**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    q = -(b + np.copysign(root, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack([q / a, c / q], axis=1)
    low, high = slab.enter[:, None], slab.leave[:, None]
    roots = np.where(np.isfinite(roots), roots, low)
    ends = np.sort(np.clip(np.concatenate([roots, low, high], axis=1), low, np.maximum(low, high)), axis=1)
    with np.errstate(invalid="ignore"):
        middle = 0.5 * ends[:, :-1] + 0.5 * ends[:, 1:]
        inside = (a[:, None] * middle**2 + 2 * b[:, None] * middle + c[:, None] <= 0.0) & (ends[:, :-1] < ends[:, 1:])
    some = inside.any(axis=1) & (slab.enter <= slab.leave)
    rows = np.arange(len(p))
    enter = np.where(some, ends[rows, inside.argmax(axis=1)], np.inf)
    leave = np.where(some, ends[rows, 3 - inside[:, ::-1].argmax(axis=1)], -np.inf)
    at = p + np.where(some & np.isfinite(enter), enter, 0.0)[:, None] * d
    side = at * [1.0, 1.0, 0.0]
    side[:, 2] = slope * np.hypot(at[:, 0], at[:, 1])
    length = np.linalg.norm(side, axis=1, keepdims=True)
    on_base = (enter <= slab.enter)[:, None]
    return RayInterval(enter, leave, np.where(on_base, slab.normal, side / np.where(length > 0.0, length, 1.0)))


def _polygon_hits(shape: Polygon, p: Array, d: Array) -> tuple[Array, Array]:
    """Nearest edge on the way. With a radius: edges moved by it to both sides, and discs about the corners."""
    _check_in_plane(d)
    start = np.asarray(shape.points)
    end = np.roll(start, -1, axis=0)
    across = (end - start)[:, ::-1] * [1.0, -1.0]
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across /= np.where(length > 0.0, length, 1.0)
    corners = np.pad(start, ((0, 0), (0, 1)))
    if shape.radius > 0.0:
        aside = shape.radius * across
        start, end = np.concatenate([start + aside, start - aside]), np.concatenate([end + aside, end - aside])
        across = np.concatenate([across, across])
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    step = max(AT_ONCE // len(start), 1)
    for first in range(0, len(p), step):
        o, way = p[first : first + step, None], d[first : first + step, None]
        t = edge_hits(o[..., :2], way[..., :2], start, end)
        n = np.pad(-np.sign(_dot(way[..., :2], across))[..., None] * across, ((0, 0), (0, 0), (0, 1)))
        if shape.radius > 0.0:
            disc = _ball(o * [1.0, 1.0, 0.0] - corners, way, shape.radius)
            t = np.concatenate([t, np.where(disc.enter >= 0.0, disc.enter, np.inf)], axis=1)
            n = np.concatenate([n, disc.normal], axis=1)
        rows, which = np.arange(len(t)), t.argmin(axis=1)
        best[first : first + step], normal[first : first + step] = t[rows, which], n[rows, which]
    return _from_outside(inside(shape, p, "closed form"), best, normal)


def _cloud_hits(shape: Points, p: Array, d: Array) -> tuple[Array, Array]:
    """Nearest ball on the way."""
    if shape.radius == 0.0:
        raise UnsupportedError("Points with radius 0: a ray passes between points without a size; give them a radius")
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    step = max(AT_ONCE // len(shape.points), 1)
    for first in range(0, len(p), step):
        o, way = p[first : first + step, None], d[first : first + step, None]
        ball = _ball(o - shape.points, way, shape.radius)
        t = np.where((ball.enter <= ball.leave) & (ball.leave >= 0.0), np.maximum(ball.enter, 0.0), np.inf)
        rows, which = np.arange(len(t)), t.argmin(axis=1)
        best[first : first + step], normal[first : first + step] = t[rows, which], ball.normal[rows, which]
    return _from_outside(best == 0.0, best, normal)


def _mesh_hits(shape: Mesh, p: Array, d: Array) -> tuple[Array, Array]:
    """Nearest face on the way; a closed mesh is solid, an open one a surface."""
    surface = shape.surface
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    if len(surface.faces):
        triangles = surface.vertices[surface.faces]
        step = max(AT_ONCE // len(triangles), 1)
        for first in range(0, len(p), step):
            rows = slice(first, first + step)
            best[rows], normal[rows] = face_hits(p[rows], d[rows], triangles)
    within = inside(shape, p, "closed form") if surface.closed else np.zeros(len(p), bool)
    return _from_outside(within, best, normal)


def _from_outside(within: Booleans, best: Array, normal: Array) -> tuple[Array, Array]:
    """Hits of rays, where those from within start at 0 without a normal."""
    outside = np.isfinite(best) & ~within
    return np.where(within, 0.0, best), np.where(outside[:, None], normal, 0.0)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))
