"""The triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from collision_monitor.checks.numbers import hides_some
from collision_monitor.errors import ShapeError, UnsupportedError
from collision_monitor.geometry.contact_features import Feature, mesh_feature_at
from collision_monitor.geometry.inside import locate_in_welded_surface
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import is_closed
from collision_monitor.geometry.ray_crossings import face_hits
from collision_monitor.geometry.surface import Surface
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Fields, Kind
from collision_monitor.shapes.mass import MassProperties, polyhedron_mass
from collision_monitor.shapes.rays import RAYS_AT_ONCE, from_outside
from collision_monitor.shapes.shape import Array, Shape, point_rows

MESH: Final = int(ShapeType.MESH)


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Shape):
    """Triangle surface, convex or not: vertices (n, 3) in m, faces (m, 3) of vertex indices, or a trimesh object alone.

    Faces are counter-clockwise seen from outside. Vertices with equal coordinates are one point. Where the surface is
    not closed, the bounds of answers include what its unknown inside may change (see `surface`).

    >>> Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]).faces.shape
    (1, 3)
    """

    vertices: Any
    faces: Any = None

    def __post_init__(self) -> None:
        if self.faces is None and hasattr(self.vertices, "faces"):
            self.__dict__.update(vertices=self.vertices.vertices, faces=self.vertices.faces)
        vertices = point_rows(self.vertices, "Mesh vertices", 3, 3)
        try:
            if hides_some(self.faces):
                raise TypeError
            faces = np.array(self.faces)
        except (TypeError, ValueError, OverflowError):
            got = type(self.faces).__name__
            raise ShapeError(f"Mesh faces: expected an array of shape (m, 3), got {got}") from None
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0 or faces.dtype.kind not in "iu":
            raise ShapeError(f"Mesh faces: expected integers of shape (m, 3), m >= 1, got {faces.dtype} {faces.shape}")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ShapeError(
                f"Mesh faces: expected indices from 0 to {len(vertices) - 1}, got {faces.min()} to {faces.max()}"
            )
        faces = faces.astype(np.int32)
        faces.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @cached_property
    def surface(self) -> Surface:
        """Welded faces, and whether they close and are oriented. Computed on first access."""
        return Surface(self.vertices, self.faces)

    def __repr__(self) -> str:
        welded = f", {self.surface.welded} of them welded" if self.surface.welded else ""
        return f"Mesh({len(self.vertices)} vertices{welded}, {len(self.faces)} faces: {self.surface})"


def _contains(shape: Mesh, p: Array) -> Booleans:
    if not shape.surface.closed:
        raise UnsupportedError(f"Mesh: expected a closed surface, which has an inside, got one that is {shape.surface}")
    return np.asarray(locate_in_welded_surface(p, shape.surface)) != Location.OUTSIDE


def _first_hits(shape: Mesh, p: Array, d: Array) -> tuple[Array, Array]:
    """Nearest face on the way; a closed mesh is solid, an open one a surface."""
    surface = shape.surface
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    if len(surface.faces):
        triangles = surface.vertices[surface.faces]
        step = max(RAYS_AT_ONCE // len(triangles), 1)
        for first in range(0, len(p), step):
            rows = slice(first, first + step)
            best[rows], normal[rows] = face_hits(p[rows], d[rows], triangles)
    within = _contains(shape, p) if surface.closed else np.zeros(len(p), bool)
    return from_outside(within, best, normal)


def _make(fields: Fields) -> Mesh:
    if len(fields.triangles) % 3:
        raise ShapeError(f"Mesh triangles: expected three indices for each face, got {len(fields.triangles)} indices")
    return Mesh(fields.vertices, fields.triangles.astype(np.int64).reshape(-1, 3))


def _mass(shape: Mesh, density: float) -> MassProperties | None:
    if not is_closed(shape.faces):
        return None
    return polyhedron_mass(shape.vertices, shape.faces.astype(np.int64), density)


def _used(shape: Mesh) -> Array:
    return np.asarray(shape.vertices[np.unique(shape.faces)])


def _scaled(shape: Mesh, factor: float) -> Mesh:
    """About the mean of its vertices."""
    centre = shape.vertices.mean(axis=0)
    return Mesh(centre + factor * (shape.vertices - centre), shape.faces)


def _feature(shape: Mesh, point: Array, normal: Array, tie: float, off: float) -> Feature:
    return mesh_feature_at(point, normal, shape.vertices, shape.faces, tie, off)


KIND: Final = Kind(
    number=ShapeType.MESH,
    name="mesh",
    shape=Mesh,
    fields=lambda shape: Fields((), shape.vertices, shape.faces),
    make=_make,
    row=lambda shape, _: None,
    support=lambda shape, d: np.asarray((d @ _used(shape).T).max(axis=-1)),
    contains=_contains,
    first_hits=_first_hits,
    triangles=lambda shape: np.asarray(shape.vertices)[np.asarray(shape.faces)],
    mass=_mass,
    feature=_feature,
    scaled=_scaled,
    corners=_used,
    simple=False,
)
