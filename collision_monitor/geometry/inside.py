"""Which points are inside of a triangle mesh, certainly or possibly.

A ray from a point crosses the faces of a closed surface. If the faces are oriented, the sum of the crossings' signs is
the winding number, which counts the solids that contain the point also where several overlap, and is 0 in a cavity.
Otherwise the parity of the crossings decides, for the whole surface and for each connected part.
(Slide "A vertex is inside a concave polyhedron if a semi-infinite ray from the vertex intersects an odd number of
faces"; Jacobson, Kavan and Sorkine-Hornung, Robust inside-outside segmentation using generalized winding numbers, 2013)
"""

from __future__ import annotations

import numpy as np

from collision_monitor.geometry.coordinates import Array, Booleans, Indices, Signs
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import Crossings, ray_crossings
from collision_monitor.geometry.surface import Surface

UNKNOWN = 2
"""Result of `locate_in_surface` for a point that may be inside or outside."""


def locate_in_welded_surface(points: Array, surface: Surface) -> Signs:
    """Location (n,) of points (n, 3) in m in a surface, or UNKNOWN.

    A surface with a hole has no certain inside: a point is UNKNOWN if it is inside once the hole is closed by faces
    from its edges to their mean. This holds for all points outside of the convex hull of `surface.hole`, however the
    surface continues in that hull. A sheet has no inside.
    """
    sides = _closing_faces(surface) if len(surface.hole) else np.empty((0, 3), np.int64)
    if not (surface.closed or len(sides) or not surface.in_open_part.all()):
        return np.full(len(points), Location.OUTSIDE, np.int8)
    vertices = surface.vertices
    kept = np.ones(len(surface.faces), bool)
    if len(sides):
        vertices = np.concatenate([vertices, surface.hole.mean(axis=0)[None]])
    elif not surface.closed:
        kept = ~surface.in_open_part  # a sheet beside closed parts
    faces = np.concatenate([surface.faces[kept], sides])
    part = np.append(surface.part[kept], np.full(len(sides), -1))
    if len(sides):
        part[: kept.sum()][surface.in_open_part] = -1
    found = ray_crossings(points, vertices, faces)
    if surface.oriented and not len(sides):
        certain = possible = np.bincount(found.point, found.turn, len(points)) != 0.0
    else:
        certain = (np.bincount(found.point, minlength=len(points)) % 2 == 1) & (len(sides) == 0)
        possible = _in_any_part(found, part, len(points))
    location = np.where(certain, Location.INSIDE, np.where(possible, UNKNOWN, Location.OUTSIDE))
    return np.where(found.on_face, Location.BOUNDARY, location).astype(np.int8)


def _closing_faces(surface: Surface) -> Indices:
    """Faces (e, 3) from the open edges to one further vertex; with them, each edge has an even number of faces."""
    edges = surface.open_edges
    return np.column_stack([edges, np.full(len(edges), len(surface.vertices))])


def _in_any_part(found: Crossings, part: Indices, count: int) -> Booleans:
    """Whether each point (count,) is in one of the connected parts, by the parity of its crossings with it."""
    crossed, times = np.unique(np.column_stack([found.point, part[found.face]]), axis=0, return_counts=True)
    inside = np.zeros(count, bool)
    inside[crossed[times % 2 == 1, 0]] = True
    return inside
