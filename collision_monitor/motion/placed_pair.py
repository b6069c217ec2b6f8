"""Two shapes of moving bodies at a time."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.motion import relative_position, rotation_at
from collision_monitor.narrow_phase.pair_pose import PairPose


class PlacedPair(NamedTuple):
    """Offsets of two shapes from their bodies' origins, position of B's origin relative to A's, and the shapes' poses.

    World axes, m.
    """

    offset_a: Any  # (3,)
    offset_b: Any
    p: Any
    pose: Any  # PairPose


@inlined
def place_pair(table: Any, parts: Any, pair: Any, t: float, scratch: Any) -> PlacedPair:
    """Place a pair of shapes (ShapePair) at time t (s).

    Writes the rotations of the bodies into scratch.rotation[0:2], and those of the shapes into scratch.rotation[2:4].
    """
    A, B, a, b = pair
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], scratch.rotation[2], scratch.rotation[3]
    rotation_at(A, t, R_i)
    rotation_at(B, t, R_j)
    oa, ob = place_shape(table, parts, a, R_i, R_a), place_shape(table, parts, b, R_j, R_b)
    x, y, z = relative_position(A, B, t)
    return PlacedPair(oa, ob, (x, y, z), PairPose(R_a, R_b, (x + ob[0] - oa[0], y + ob[1] - oa[1], z + ob[2] - oa[2])))
