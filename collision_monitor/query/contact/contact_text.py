"""The text of a contact: its distance, its error, and the features of both shapes that are nearest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from collision_monitor.errors import InputError
from collision_monitor.geometry.contact_features import FeatureType
from collision_monitor.query.contact.features import feature_of, shape_tie
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Points, Shape

if TYPE_CHECKING:
    from collision_monitor.geometry.coordinates import Array
    from collision_monitor.query.arguments import Compound
    from collision_monitor.query.contact.contact import Contact


def contact_text(contact: Contact) -> str:
    """Text such as `Contact(0.0123 m ± 1e-12, box face 3 – capsule surface)`."""
    shape_a, pose_a, shape_b, pose_b = contact.arguments
    tie, off = shape_tie(shape_a, shape_b), contact.error_bound
    a = _feature(shape_a, pose_a, contact.point_a, contact.normal, tie, off)
    b = _feature(shape_b, pose_b, contact.point_b, -contact.normal, tie, off)
    return f"Contact({contact.signed_distance:.4g} m ± {contact.error_bound:.1g}, {a} – {b})"


def _feature(shape: Compound, pose: Pose, point: Array, normal: Array, tie: float, off: float) -> str:
    if not isinstance(shape, Shape):
        return "compound"
    kind = type(shape).__name__.lower()
    if not isinstance(shape, Box | ConvexHull | Mesh | Points):
        return f"{kind} surface"
    try:
        found = feature_of(shape, pose, point, normal, tie, off)
    except InputError:  # the witness point is off the surface by more than the error bound
        return f"{kind} surface"
    number = found.face if found.type is FeatureType.FACE else "-".join(map(str, found.vertices))
    return f"{kind} {found.type.name.lower()} {number}"
