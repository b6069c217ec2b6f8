"""The text of a contact: its distance, its error, and the features of both shapes that are nearest."""

from __future__ import annotations

from collision_monitor.errors import InputError
from collision_monitor.geometry.contact_features import FeatureType
from collision_monitor.geometry.coordinates import Array
from collision_monitor.query.contact.features import feature_of, shape_tie
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Points, Shape


def contact_text(
    arguments: tuple[Compound, Pose, Compound, Pose],
    points: tuple[Array, Array],
    normal: Array,
    distance: float,
    error: float,
) -> str:
    """Text such as `Contact(0.0123 m ± 1e-12, box face 3 – capsule surface)`. The arguments are those of `Contact`."""
    shape_a, pose_a, shape_b, pose_b = arguments
    tie = shape_tie(shape_a, shape_b)
    a = _feature(shape_a, pose_a, points[0], normal, tie, error)
    b = _feature(shape_b, pose_b, points[1], -normal, tie, error)
    return f"Contact({distance:.4g} m ± {error:.1g}, {a} – {b})"


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
