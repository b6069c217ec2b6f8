"""Which points of a cloud are near an object of the library."""

from __future__ import annotations

from functools import lru_cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.impact.body_contact import RESULT
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.motion.bodies import chain_radius
from collision_monitor.query.body import QueryBody, kept_slots
from collision_monitor.query.contact.contact_kernel import MEMORY, placed_contact
from collision_monitor.query.library import LIBRARY
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Points


def near_points(cloud: Points, pose: Pose, body: QueryBody, body_pose: Pose, limit: float) -> NDArray[np.bool_]:
    """Which points (n,) of a cloud, with its radius, are within a limit (m) of an object; each pose in one frame."""
    if body.has_mesh:
        body.plant()
    point = _at_origin(cloud.radius)
    kept, near = kept_slots(point), np.zeros(len(cloud.points), np.bool_)
    assert kept is not None
    R = np.stack([np.eye(3), pose.rotation.T @ body_pose.rotation])
    p = pose.rotation.T @ (body_pose.position - pose.position)
    chains = np.int32(kept.first), np.int32(body.slots.first)
    _near_points(*LIBRARY.tuples, MEMORY.scratch, chains, cloud.points, R, p, limit, near, np.empty(RESULT))
    return near


@lru_cache(8)
def _at_origin(radius: float) -> Points:
    """A cloud of one point."""
    return Points(np.zeros((1, 3)), radius)


@kernel
def _near_points(
    table: Any, parts: Any, scratch: Any, chains: Any, points: Any, R: Any, p: Any, limit: float, near: Any, row: Any
) -> None:
    """Set near (n,) for the points (n, 3) at which the first chain is within the limit (m) of the second one.

    R (2, 3, 3), p (3,): rotations of both, and position of the second one, in the frame of the points.
    """
    reach = chain_radius(table, parts, chains[0]) + chain_radius(table, parts, chains[1]) + limit
    for side in range(2):
        for r in range(3):
            for c in range(3):
                scratch.rotation[side, r, c] = R[side, r, c]
    for k in range(len(points)):
        x = p[0] - points[k, 0], p[1] - points[k, 1], p[2] - points[k, 2]
        if x[0] * x[0] + x[1] * x[1] + x[2] * x[2] <= reach * reach:
            found, _ = placed_contact(table, parts, chains, (0.0, 0.0, 0.0), x, limit, SURFACES, scratch, row)
            near[k] = found < inf
