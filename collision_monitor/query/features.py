"""Features of two polytopes in contact: "vertex 3 of A on face 7 of B"."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.contact_features import Feature, FeatureContact, FeatureType, feature_at
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Box, ConvexHull, Mesh, Shape
from collision_monitor.query.contact import Contact

Array = NDArray[np.float64]

# Corners of a unit box, numbered by their sides as bits (x, y, z); its faces +x -x +y -y +z -z, two triangles each.
_SIDES: Final = np.array([[(k >> axis & 1) - 0.5 for axis in range(3)] for k in range(8)])
_QUADS: Final = np.array([[1, 3, 7, 5], [0, 4, 6, 2], [2, 6, 7, 3], [0, 1, 5, 4], [4, 5, 7, 6], [0, 2, 3, 1]])
_TRIANGLES: Final = _QUADS[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)


def contact_features(contact: Contact, shape_a: Shape, pose_a: Pose, shape_b: Shape, pose_b: Pose) -> FeatureContact:
    """Features of A and of B at the witness points of their contact, for Box, ConvexHull and Mesh.

    A mesh keeps its own numbers of vertices and faces. A hull has the vertex numbers of its points and the face numbers
    of `convex_hull`. A box numbers its corners by their sides (bit 0: +x, 1: +y, 2: +z) and its faces in the order
    +x -x +y -y +z -z. Raises UnsupportedError for other shapes.

    >>> import collision_monitor as cm
    >>> box, pose, above = cm.Box((1, 1, 1)), cm.Pose(), cm.Pose((0, 0, 1.5))
    >>> cm.contact_features(cm.contact(box, pose, box, above), box, pose, box, above).a.type.name
    'FACE'
    """
    return FeatureContact(
        feature_of(shape_a, pose_a, contact.point_a, contact.normal),
        feature_of(shape_b, pose_b, contact.point_b, -contact.normal),
    )


def feature_of(shape: Shape, pose: Pose, point: Array, normal: Array) -> Feature:
    """Feature of a Box, ConvexHull or Mesh at a point (3,) in m with an outward normal (3,), both in the world frame.

    Numbered as in `contact_features`. Raises UnsupportedError for other shapes.
    """
    at, towards = (point - pose.position) @ pose.rotation, normal @ pose.rotation
    match shape:
        case Mesh():
            return feature_at(at, towards, shape.vertices, shape.faces)
        case ConvexHull():
            hull = convex_hull(shape.points)
            found = feature_at(at, towards, hull.vertices, hull.faces)
            same = (shape.points == hull.vertices[list(found.vertices), None]).all(axis=-1)
            return found._replace(vertices=tuple(same.argmax(axis=1).tolist()))
        case Box():
            found = feature_at(at, towards, _SIDES * shape.size, _TRIANGLES)
            if found.type is FeatureType.FACE:
                return Feature(FeatureType.FACE, tuple(_QUADS[found.face // 2].tolist()), found.face // 2)
            return found
    kind = type(shape).__name__
    raise UnsupportedError(f"{kind} has no vertices, edges and faces; supported are Box, ConvexHull, Mesh")
