"""Contacts of meshes and clouds, for callers from Python."""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import kernel
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.prediction.mesh_pair import mesh_within


@kernel
def mesh_contact(table: Any, R: Any, p: Any, limit: float, out: Any, scratch: Any) -> bool:
    """Write the contact of the shapes in slots 0 and 1 to a row; False if they are farther apart than the limit (m).

    R (2, 3, 3): their rotations to world axes; p (3,): position of the second one's origin relative to the first's (m).
    """
    return mesh_within(table, 0, 1, PairPose(R[0], R[1], (p[0], p[1], p[2])), limit, out, scratch)


@kernel
def mark_near_points(table: Any, points: Any, R: Any, p: Any, limit: float, near: Any, out: Any, scratch: Any) -> None:
    """Set near (n,) for the points (n, 3) that are within the limit (m) of the shape in slot 1.

    Slot 0 has a cloud of one point in its origin. R (2, 3, 3): no rotation, and that of the shape in the frame of the
    points; p (3,): its position there (m).
    """
    reach = table.radius[0] + table.radius[1] + limit
    for k in range(len(points)):
        x = p[0] - points[k, 0], p[1] - points[k, 1], p[2] - points[k, 2]
        if x[0] * x[0] + x[1] * x[1] + x[2] * x[2] <= reach * reach:
            near[k] = mesh_within(table, 0, 1, PairPose(R[0], R[1], x), limit, out, scratch)
