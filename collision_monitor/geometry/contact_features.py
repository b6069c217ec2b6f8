"""Features of two polyhedra that touch: the lecture's six pairs of types, for "vertex 3 of A on face 7 of B".

(Slide "Collision detection for rigid bodies": Vertex - Face, Vertex - Edge, Vertex - Vertex, Edge - Edge, Edge - Face,
Face - Face)
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Indices, coordinates, triangles
from collision_monitor.geometry.point_triangle import closest_point_on_triangle
from collision_monitor.geometry.points import closest_point_on_segment, point_distance
from collision_monitor.tolerances import FEATURE_TIE


class FeatureType(IntEnum):
    """Type of a solid's feature; the values of Contact.msg. SURFACE: a curved surface."""

    VERTEX = 1
    EDGE = 2
    FACE = 3
    SURFACE = 4


class FeaturePair(Enum):
    """The six pairs of feature types, regardless of the order of the bodies."""

    VV = "vertex-vertex"
    VE = "vertex-edge"
    VF = "vertex-face"
    EE = "edge-edge"
    EF = "edge-face"
    FF = "face-face"


class Feature(NamedTuple):
    """type; vertices: index of the vertex, the edge's two or the face's three; face: index of the face, or -1.

    The rim of a cylinder or a cone is an edge with one number in place of two vertices; their faces have no vertices.
    """

    type: FeatureType
    vertices: tuple[int, ...]
    face: int

    def __str__(self) -> str:
        if self.type is FeatureType.SURFACE:
            return "surface"
        number = self.face if self.type is FeatureType.FACE else "-".join(map(str, self.vertices))
        return f"{self.type.name.lower()} {number}"


class FeatureContact(NamedTuple):
    """The touching features of A and B."""

    a: Feature
    b: Feature

    @property
    def pair(self) -> FeaturePair | None:
        """The pair of feature types; None if one is a curved surface."""
        if FeatureType.SURFACE in (self.a.type, self.b.type):
            return None
        return FeaturePair["".join(t.name[0] for t in sorted((self.a.type, self.b.type)))]

    def __str__(self) -> str:
        return f"{self.a} of A on {self.b} of B"


def mesh_feature_at(
    point: ArrayLike,
    normal: ArrayLike,
    vertices: ArrayLike,
    faces: ArrayLike,
    tolerance: float = FEATURE_TIE,
    off: float = 0.0,
) -> Feature:
    """Largest feature of a mesh that touches as a whole at a surface point (3,), for a contact normal (3,).

    A face at the point touches as a whole if it is perpendicular to the normal and faces along it, an edge if it is
    perpendicular to the normal. Otherwise the result is the vertex at the point, else the edge or the face that
    contains the point. The lowest index wins. `tolerance`: part of the mesh's size. `off`: error of the point (m); one
    that is off the surface by no more stands for the nearest point of the surface. Raises InputError if it is further.
    """
    vertices, faces = triangles(vertices, faces)
    at, normal = coordinates(point, "point", 3), coordinates(normal, "normal", 3)
    reach = tolerance * float(np.ptp(vertices, axis=0).max())
    normal = normal / np.linalg.norm(normal)
    corner = vertices[faces]
    foot, away = closest_point_on_triangle(at, *np.moveaxis(corner, 1, 0))
    nearest = int(away.argmin())
    if away[nearest] > max(reach, off):
        raise InputError(f"contact: expected a point on the mesh's surface, got {at.tolist()}")
    if away[nearest] > reach:
        at = foot[nearest]
        away = closest_point_on_triangle(at, *np.moveaxis(corner, 1, 0))[1]
    near = np.flatnonzero(away <= reach)
    height = (vertices - at) @ normal
    touching = np.abs(height) <= reach
    upward = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) @ normal > 0.0
    whole = near[touching[faces[near]].all(axis=1) & upward[near]]
    if len(whole):
        return _face(faces, int(whole[0]))
    edges = np.unique(np.sort(faces[near][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    on_edge = point_distance(at, closest_point_on_segment(at, *np.moveaxis(vertices[edges], 1, 0))[0]) <= reach
    across = edges[on_edge & touching[edges].all(axis=1)]
    if len(across):
        return Feature(FeatureType.EDGE, (int(across[0, 0]), int(across[0, 1])), -1)
    corners = np.unique(faces[near])
    at_corner = corners[point_distance(at, vertices[corners]) <= reach]
    if len(at_corner):
        return Feature(FeatureType.VERTEX, (int(at_corner[0]),), -1)
    if on_edge.any():
        edge = edges[np.flatnonzero(on_edge)[0]]
        return Feature(FeatureType.EDGE, (int(edge[0]), int(edge[1])), -1)
    return _face(faces, int(near[0]))


def _face(faces: Indices, index: int) -> Feature:
    i, j, k = (int(vertex) for vertex in faces[index])
    return Feature(FeatureType.FACE, (i, j, k), index)
