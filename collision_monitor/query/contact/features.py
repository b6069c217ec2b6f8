"""Features of two shapes in contact: "vertex 3 of A on face 7 of B"."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.contact_features import Feature, FeatureContact, FeatureType, mesh_feature_at
from collision_monitor.geometry.round_features import (
    ROUND_TIE,
    feature_of_cone,
    feature_of_cylinder,
    feature_of_outline,
)
from collision_monitor.query.arguments import checked_pose
from collision_monitor.query.contact.contact import Contact
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.shapes import (
    Box,
    Capsule,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Points,
    Polygon,
    Shape,
)
from collision_monitor.tolerances import FEATURE_TIE

Array = NDArray[np.float64]

# Corners of a unit box, numbered by their sides as bits (x, y, z); its faces +x -x +y -y +z -z, two triangles each.
_SIDES: Final = np.array([[(k >> axis & 1) - 0.5 for axis in range(3)] for k in range(8)])
_QUADS: Final = np.array([[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]])
_TRIANGLES: Final = _QUADS[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
_DIAGONALS: Final = [(int(min(q[0], q[2])), int(max(q[0], q[2]))) for q in _QUADS]
"""The edge between the two triangles of each face, which is no edge of the box."""


def _side(face: int) -> Feature:
    """Face of a box."""
    return Feature(FeatureType.FACE, tuple(_QUADS[face].tolist()), face)


def contact_features(contact: Contact, shape_a: Shape, pose_a: Pose, shape_b: Shape, pose_b: Pose) -> FeatureContact:
    """Features of A and of B at the witness points of their contact, for shapes with vertices, edges or faces.

    A mesh keeps its own numbers of vertices and faces. A hull has the vertex numbers of its points and the face numbers
    of `convex_hull`. A box numbers its corners by their sides (bit 0: +x, 1: +y, 2: +z) and its faces in the order
    +x -x +y -y +z -z. A cylinder has faces and rims 0 (+z) and 1 (-z), a cone vertex 0, rim 0 and face 0, and both a
    curved surface. A polygon has the corners of its points, a capsule corner 0 (-z) and 1 (+z) and the edge between
    them. A cloud has its points as vertices. A half-space is face 0. Raises UnsupportedError for Sphere, Ellipsoid and
    Circle, which are one surface.

    >>> import collision_monitor as cm
    >>> box, pose, above = cm.Box((1, 1, 1)), cm.Pose(), cm.Pose((0, 0, 1.5))
    >>> cm.contact_features(cm.contact(box, pose, box, above), box, pose, box, above).a.type.name
    'FACE'
    """
    checked_pose(pose_a, "pose_a")
    checked_pose(pose_b, "pose_b")
    if not isinstance(contact, Contact):
        raise InputError(f"contact: expected the result of `contact` of the two shapes, got {contact!r:.100}")
    tie = shape_tie(shape_a, shape_b)
    return FeatureContact(
        feature_of(shape_a, pose_a, contact.point_a, contact.normal, tie, contact.error_bound),
        feature_of(shape_b, pose_b, contact.point_b, -contact.normal, tie, contact.error_bound),
    )


def shape_tie(shape_a: object, shape_b: object) -> float:
    """Largest difference of equal heights, relative, for the witness points of two shapes."""
    curved = any(isinstance(shape, Cylinder | Cone | Ellipsoid) for shape in (shape_a, shape_b))
    return ROUND_TIE if curved else FEATURE_TIE


def feature_of(shape: Shape, pose: Pose, point: Array, normal: Array, tie: float, off: float) -> Feature:
    """Feature of a shape at a point (3,) in m with an outward normal (3,), both in the world frame.

    Numbered as in `contact_features`, with the same errors. tie: largest difference of equal heights, relative.
    off: error of the point (m).
    """
    at, towards = (point - pose.position) @ pose.rotation, normal @ pose.rotation
    match shape:
        case Mesh():
            return mesh_feature_at(at, towards, shape.vertices, shape.faces, tie, off)
        case ConvexHull():
            hull = convex_hull(shape.points)
            found = mesh_feature_at(at, towards, hull.vertices, hull.faces, tie, off)
            same = (shape.points == hull.vertices[list(found.vertices), None]).all(axis=-1)
            return found._replace(vertices=tuple(same.argmax(axis=1).tolist()))
        case Box():
            found = mesh_feature_at(at, towards, _SIDES * shape.size, _TRIANGLES, tie, off)
            if found.type is FeatureType.FACE:
                return _side(found.face // 2)
            if found.type is FeatureType.EDGE and found.vertices in _DIAGONALS:
                return _side(_DIAGONALS.index(found.vertices))
            return found
        case Cylinder():
            return feature_of_cylinder(at, towards, shape.radius, shape.length)
        case Cone():
            return feature_of_cone(at, towards, shape.radius, shape.length)
        case Capsule():
            ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * shape.length
            return feature_of_outline(at - shape.radius * towards, towards, ends)
        case Polygon():
            core = at[:2] - shape.radius * towards[:2]
            return feature_of_outline(core, towards[:2], shape.points)
        case Points():
            nearest = int(((shape.points - (at - shape.radius * towards)) ** 2).sum(axis=1).argmin())
            return Feature(FeatureType.VERTEX, (nearest,), -1)
        case HalfSpace():
            return Feature(FeatureType.FACE, (), 0)
    kind = type(shape).__name__
    raise UnsupportedError(
        f"{kind} has no vertices, edges and faces; supported are Box, ConvexHull, Mesh, Cylinder, Cone, Capsule, "
        "Polygon, Points, HalfSpace"
    )
