"""Contacts of a mesh or a cloud with another shape, for callers from Python."""

from __future__ import annotations

from typing import Any

import numpy as np

from collision_monitor._jit import kernel
from collision_monitor.impact.mesh_pair import SURFACES, mesh_within
from collision_monitor.narrow_phase.pair_pose import PairPose


@kernel
def mesh_contacts(table: Any, places: Any, R: Any, p: Any, limit: float, near: Any, out: Any, scratch: Any) -> None:
    """Set near (n,) for the places at which the shape in slot 0 is within the limit (m) of that in slot 1.

    places (n, 3): positions of the first shape (m); p (3,): that of the second one, in the same frame. R (2, 3, 3):
    their rotations to the axes of that frame. out: contact row about the first one's origin, at the last near place.
    """
    reach = table.radius[0] + table.radius[1] + limit
    for k in range(len(places)):
        x = p[0] - places[k, 0], p[1] - places[k, 1], p[2] - places[k, 2]
        if x[0] * x[0] + x[1] * x[1] + x[2] * x[2] <= reach * reach:
            pose = PairPose(R[0], R[1], x)
            near[k] = mesh_within(table, np.int32(0), np.int32(1), pose, limit, SURFACES, out, scratch)
