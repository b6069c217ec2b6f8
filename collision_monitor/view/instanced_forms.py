"""Forms: the few meshes from which the page draws all shapes. A shape is one or more placed and scaled forms.

Thousands of spheres, boxes and cylinders are copies of one mesh each, which the browser draws in one call. A hull, a
mesh or a polygon has a form of its own, shared by all objects with the same points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import blake2b
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.triangulation import triangulate
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import (
    Box,
    Capsule,
    Circle,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Points,
    Polygon,
    Shape,
    Sphere,
    kind_of,
)
from collision_monitor.shapes.surface_parts import UNIT_CORNERS, box_triangles

Floats = NDArray[np.float64]
Scale = tuple[float, float, float]

SIDES: Final = 16
"""Number of sides of a round form."""

PLANE: Final = "plane"
"""Form of a half-space: a square whose size the picture chooses, because a half-space has none."""


@dataclass(frozen=True, eq=False)
class Form:
    """A mesh: vertices (v, 3), in m or in units of a piece's scale; faces (f, 3), counter-clockwise from outside.

    name: equal forms have equal names. flat: facets are shown, not smoothed. closed: seen only from outside. own: it
    belongs to one shape, and is not one of the unit forms. diameter: of the points of a cloud (m); a cloud has no
    faces.
    """

    name: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    flat: bool
    closed: bool
    own: bool = False
    diameter: float = 0.0

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Centre (3,) and half extents (3,) of the bounding box."""
        low, high = self.vertices.min(axis=0).astype(np.float64), self.vertices.max(axis=0).astype(np.float64)
        return 0.5 * (low + high), 0.5 * (high - low)


class Piece(NamedTuple):
    """A form, its pose in the object's frame, and its scale along its own axes (m; 1 for a form in m)."""

    form: Form
    pose: Pose
    scale: Scale

    def boxed(self) -> Piece:
        """Return the bounding box of the piece."""
        centre, half = self.form.bounds
        x, y, z = (float(size) for size in 2.0 * half * self.scale)
        return Piece(unit_forms()["box"], self.pose @ Pose(centre * self.scale), (x, y, z))


def pieces_of(shape: Shape, pose: Pose) -> Iterator[Piece]:
    """Yield the pieces of a shape at a pose in its object's frame."""
    unit = unit_forms()
    match shape:
        case Sphere(radius=r):
            yield Piece(unit["sphere"], pose, (r, r, r))
        case Ellipsoid(radii=radii):
            yield Piece(unit["sphere"], pose, radii)
        case Box(size=size):
            yield Piece(unit["box"], pose, size)
        case Cylinder(radius=r, length=length):
            yield Piece(unit["cylinder"], pose, (r, r, length))
        case Circle(radius=r):
            yield Piece(unit["disc"], pose, (r, r, 1.0))
        case Capsule(radius=r, length=length):
            yield Piece(unit["tube"], pose, (r, r, length))
            for end in (-0.5, 0.5):
                yield Piece(unit["sphere"], pose @ Pose((0.0, 0.0, end * length)), (r, r, r))
        case HalfSpace():
            yield Piece(unit[PLANE], pose @ _plane_pose(shape), (1.0, 1.0, 1.0))
        case Polygon():
            yield Piece(_own_form("polygon", _filled(shape), closed=False), pose, (1.0, 1.0, 1.0))
        case ConvexHull():
            hull = _outward(kind_of(shape).triangles(shape))
            yield Piece(_own_form("hull", hull, closed=True), pose, (1.0, 1.0, 1.0))
        case Points():
            yield Piece(_cloud(shape), pose, (1.0, 1.0, 1.0))
        case _:
            kind, closed = kind_of(shape), not isinstance(shape, Mesh)
            own = _own_form(kind.name.replace(" ", "_"), kind.triangles(shape), closed=closed)
            yield Piece(own, pose, (1.0, 1.0, 1.0))


@cache
def unit_forms() -> dict[str, Form]:
    """Return the forms of unit size: radius 1, height or extent 1."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    sphere = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    side = np.array([(1.0, -0.5), (1.0, 0.5)])
    floor, roof = np.array([(0.0, -0.5), (1.0, -0.5)]), np.array([(1.0, 0.5), (0.0, 0.5)])
    corner = np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])
    forms = (
        _revolved("sphere", sphere),
        _revolved("cylinder", floor, side, roof),
        _revolved("tube", side),
        _revolved("disc", np.array([(1.0, 0.0), (0.0, 0.0)]), closed=False),
        _welded("box", box_triangles(UNIT_CORNERS), closed=True),
        _welded(PLANE, corner[[[0, 1, 2], [0, 2, 3]]], closed=False),
    )
    return {form.name: form for form in forms}


def _revolved(name: str, *profiles: Floats, closed: bool = True) -> Form:
    """Rotate profiles (n, 2) of radius and height about z. Edges between two profiles stay sharp."""
    turn = np.linspace(0.0, 2 * np.pi, SIDES, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), np.ones(SIDES)], axis=1)
    vertices, faces, count = [], [], 0
    for profile in profiles:
        vertices.append((profile[:, None, [0, 0, 1]] * ring).reshape(-1, 3))
        low = count + np.arange(len(profile) - 1)[:, None] * SIDES + np.arange(SIDES)
        right = np.roll(low, -1, axis=1)
        faces.append(np.stack([low, right, right + SIDES, low, right + SIDES, low + SIDES], axis=-1).reshape(-1, 3))
        count += len(profile) * SIDES
    return Form(
        name, np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.uint32), False, closed
    )


def _welded(name: str, triangles: Floats, *, closed: bool, own: bool = False) -> Form:
    """Return the form of triangles (n, 3, 3), with each vertex once."""
    vertices, faces = np.unique(triangles.reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
    return Form(name, vertices, faces.reshape(-1, 3).astype(np.uint32), True, closed, own)


def _own_form(kind: str, triangles: Floats, *, closed: bool) -> Form:
    digest = blake2b(np.ascontiguousarray(triangles).tobytes(), digest_size=8).hexdigest()
    return _welded(f"{kind}_{digest}", triangles, closed=closed, own=True)


def _cloud(shape: Points) -> Form:
    points = np.asarray(shape.points, np.float32)
    digest = blake2b(points.tobytes(), digest_size=8).hexdigest()
    none = np.zeros((0, 3), np.uint32)
    return Form(f"cloud_{digest}", points, none, flat=True, closed=False, diameter=2.0 * shape.radius)


def _outward(triangles: Floats) -> Floats:
    """Return the triangles (n, 3, 3) of a convex surface counter-clockwise from outside. Qhull does not order them."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    inward = np.einsum("ni,ni->n", np.cross(b - a, c - a), a - triangles.mean(axis=(0, 1))) < 0.0
    return np.where(inward[:, None, None], triangles[:, ::-1], triangles)


def _filled(polygon: Polygon) -> Floats:
    """Return triangles (n, 3, 3) of a polygon; only its outline if it is grown by a radius or cannot be filled."""
    if not polygon.radius:
        try:
            filled: Floats = np.pad(polygon.points, ((0, 0), (0, 1)))[triangulate(polygon.points)]
            return filled
        except ShapeError:
            pass
    return kind_of(polygon).triangles(polygon)


def _plane_pose(shape: HalfSpace) -> Pose:
    """Pose of the plane n.x = offset: its z axis is the normal."""
    z = np.asarray(shape.normal)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    turned = Pose.from_matrix(np.stack([x, np.cross(z, x), z], axis=1))
    return Pose(z * shape.offset, turned.quaternion)
