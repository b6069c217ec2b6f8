"""Flat sides of shapes: whether a shape touches a plane with a side or an edge, so that the plane turns with it.

A plane at rest loses touch with a face or an edge as soon as it turns: a corner sticks out. Beside a corner or a ball
no plane is better than one at rest.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.geometry.vector import Vector
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.capsule import CAPSULE
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.sphere import SPHERE

LEVEL: Final = 0.1
"""Cosine of the angle between a plane's normal and an axis of the shape below which the plane is along the axis."""


@device
def has_side(table: Any, s: int, R: Any, n: Vector) -> bool:
    """Whether shape s, with rotation R, may touch the plane with the normal n (3,) along an edge or a face.

    True for all shapes but balls, boxes, capsules and cylinders.
    """
    kind = table.kind[s]
    if kind == SPHERE:
        return False
    if kind == BOX:
        is_along = False
        for k in range(3):
            is_along |= abs(n[0] * R[0, k] + n[1] * R[1, k] + n[2] * R[2, k]) < LEVEL
        return is_along
    if kind == CAPSULE or kind == CYLINDER:
        along = abs(n[0] * R[0, 2] + n[1] * R[1, 2] + n[2] * R[2, 2])
        return along < LEVEL or (kind == CYLINDER and along > sqrt(1.0 - LEVEL * LEVEL))
    return True
