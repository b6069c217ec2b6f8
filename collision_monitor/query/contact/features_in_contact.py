"""Features of two shapes in contact: "vertex 3 of A on face 7 of B"."""

from __future__ import annotations

from typing import Any

from collision_monitor.errors import InputError
from collision_monitor.geometry.contact_features import FeatureContact
from collision_monitor.query.contact.contact import Contact
from collision_monitor.query.contact.features import feature_of, shape_tie
from collision_monitor.shapes.pose import as_pose
from collision_monitor.shapes.registry import Shape


def contact_features(contact: Contact, shape_a: Shape, pose_a: Any, shape_b: Shape, pose_b: Any) -> FeatureContact:
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
    pose_a, pose_b = as_pose(pose_a, "pose A"), as_pose(pose_b, "pose B")
    if not isinstance(contact, Contact):
        raise InputError(f"contact: expected the result of `contact` of the two shapes, got {contact!r:.100}")
    tie = shape_tie(shape_a, shape_b)
    return FeatureContact(
        feature_of(shape_a, pose_a, contact.point_a, contact.normal, tie, contact.error_bound),
        feature_of(shape_b, pose_b, contact.point_b, -contact.normal, tie, contact.error_bound),
    )
