"""`distance`: the signed distance of two shapes, without normal and points."""

from __future__ import annotations

from typing import Any

from collision_monitor.query.contact.contact import contact
from collision_monitor.shapes.compound import Compound


def distance(shape_a: Compound, pose_a: Any, shape_b: Compound, pose_b: Any) -> float:
    """Signed distance (m) of two shapes, or compounds given as lists of (shape, pose): negative if they overlap.

    `contact` gives the same number with its error bound, which is 1e-15 to 1e-9 of the sizes for convex shapes and can
    be large for concave ones that overlap. Poses as for `contact`. Raises as `contact` does.

    >>> import collision_monitor as cm
    >>> cm.distance(cm.Sphere(1.0), cm.Pose(), cm.Box((1, 1, 1)), (2, 0, 0))
    0.5
    """
    return contact(shape_a, pose_a, shape_b, pose_b).signed_distance
