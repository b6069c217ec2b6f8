"""How far two objects are apart at least if open meshes may belong to solids, see `fillings`."""

from __future__ import annotations

from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.inside import UNKNOWN as UNKNOWN
from collision_monitor.geometry.inside import locate_in_welded_surface
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.meshes.distance.contact import in_root_box
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.query.body import PosedShapes, QueryBody, laid_out
from collision_monitor.query.contact.contact_kernel import contact_row
from collision_monitor.query.contact.fillings import fillings
from collision_monitor.records import Model
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Mesh, Points, kind_of
from collision_monitor.tolerances import ROUNDED_UP

INSIDE: Final = Location.INSIDE

MOST_TESTS: Final = 300_000_000
"""Most pairs of a point and a face to locate points in a mesh without a tree of its solid, 0.3 s."""


def inner_points(shapes: PosedShapes) -> NDArray[np.float64]:
    """Points (n, 3) of an object in its frame (m), at least one of each connected part."""
    found = []
    for shape, pose in shapes:
        if isinstance(shape, Points):
            own = np.asarray(shape.points)
        elif isinstance(shape, Mesh):
            own = _first_corners(shape)
        else:
            middle = kind_of(shape).middle
            own = np.zeros((1, 3)) if middle is None else middle(shape)[None]
        found.append(own @ pose.rotation.T + pose.position)
    return np.concatenate(found)


def _first_corners(mesh: Mesh) -> NDArray[np.float64]:
    """A corner of each connected part of a mesh (n, 3), kept with the mesh as its tree is."""
    known: NDArray[np.float64] | None = mesh.__dict__.get("first_corners")
    if known is None:
        faces, part = mesh.surface.faces, mesh.surface.part
        first = faces[np.unique(part, return_index=True)[1], 0] if len(faces) else mesh.faces[:1, 0]
        known = mesh.__dict__["first_corners"] = mesh.vertices[first]
    return known


def location_of(a: QueryBody, pose_a: Pose, b: QueryBody, pose_b: Pose) -> tuple[int, int]:
    """Location of A in the meshes of B, and of B in those of A: OUTSIDE, INSIDE or UNKNOWN; no surfaces meet.

    It is UNKNOWN where more than MOST_TESTS are needed, as for two soups of 100,000 triangles.
    """
    return _located(a, pose_a, b, pose_b), _located(b, pose_b, a, pose_a)


def _located(inner: QueryBody, pose: Pose, outer: QueryBody, outer_pose: Pose) -> int:
    found: int = Location.OUTSIDE
    if outer.model is not Model.EXACT:
        return found
    if np.linalg.norm(pose.position - outer_pose.position) > (inner.radius + outer.radius) * (1.0 + ROUNDED_UP):
        return found
    points = inner_points(inner.shapes) @ pose.rotation.T + (pose.position - outer_pose.position)
    for shape, at in outer.shapes:
        if not isinstance(shape, Mesh):
            continue
        own = (points - outer_pose.rotation @ at.position) @ (outer_pose.rotation @ at.rotation)
        tree = shape_tree(shape)
        own = own if tree is None else own[in_root_box(tree, own)]
        if len(own):
            some = own[: max(MOST_TESTS // len(shape.faces), 1)]
            location = locate_in_welded_surface(some, shape.surface)
            if ((location == Location.INSIDE) | (location == Location.BOUNDARY)).any():
                return Location.INSIDE
            if len(some) < len(own) or (location == UNKNOWN).any():
                found = UNKNOWN
    return found


def least_gap(a: QueryBody, pose_a: Pose, b: QueryBody, pose_b: Pose) -> float:
    """Lower bound (m) of the distances of the fillings of A and B from each other and from the other object.

    Infinite if neither has any; below 0 if they may overlap.
    """
    of_a, of_b = (fillings(side.shapes) if side.model is Model.EXACT else [] for side in (a, b))
    return min(
        _gap(of_a, pose_a, [*b.pieces, *of_b], pose_b),
        _gap(of_b, pose_b, a.pieces, pose_a),
    )


def _gap(shapes_a: PosedShapes, pose_a: Pose, shapes_b: PosedShapes, pose_b: Pose) -> float:
    if not len(shapes_a) or not len(shapes_b):
        return inf
    a, b = laid_out(shapes_a), laid_out(shapes_b)
    distance, bound, _ = contact_row(a.first, pose_a, b.first, pose_b, SURFACES)
    return distance - bound
