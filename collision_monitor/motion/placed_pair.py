"""Two shapes of moving bodies at a time."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.motion import pair_state, rotation_at
from collision_monitor.narrow_phase.pair_pose import PairPose


class PlacedPair(NamedTuple):
    """Two shapes at a time. World axes."""

    offset_a: Any  # (3,): offsets from their bodies' origins (m)
    offset_b: Any
    pose: Any  # PairPose of the shapes
    state: Any  # PairState of the bodies


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
    state = pair_state(A, B, t)
    x, y, z = state.p
    return PlacedPair(oa, ob, PairPose(R_a, R_b, (x + ob[0] - oa[0], y + ob[1] - oa[1], z + ob[2] - oa[2])), state)
