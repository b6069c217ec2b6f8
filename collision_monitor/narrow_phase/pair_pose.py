"""Poses of two shapes, an argument of every pair test."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import opposite


class PairPose(NamedTuple):
    """Rotations (3, 3) of A and B to world axes, and p: B's origin relative to A's in world axes (m)."""

    R_A: Any
    R_B: Any
    p: Any


@inlined
def swapped(pose: PairPose) -> PairPose:
    """Pose of the pair with A and B swapped."""
    return PairPose(pose.R_B, pose.R_A, opposite(pose.p))


@inlined
def pair_pose(position: Any, rotation: Any, a: int, b: int) -> PairPose:
    """Pose of the pair of rows a and b of the positions (K, 3) and rotations (K, 3, 3)."""
    p = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]
    return PairPose(rotation[a], rotation[b], p)
