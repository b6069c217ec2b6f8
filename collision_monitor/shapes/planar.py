"""Scenes in the x-y plane: components out of the plane are dropped before any computation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import PoseError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose, rotation_matrix
from collision_monitor.shapes.registry import Shape, kind_of

PLANAR_VECTORS = {
    "position": slice(2, 3),
    "linear": slice(2, 3),
    "angular": slice(0, 2),
    "acceleration": slice(2, 3),
}
"""Fields of records.STATE, and their components that the plane ignores."""


def flat_quaternions(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nearest rotations about z (n, 4) of orientations (n, 4); all 0, which is no orientation, if z points down."""
    x, y, z, w = quaternions.T
    with np.errstate(over="ignore", invalid="ignore"):  # such an orientation is refused later
        squared = z * z + w * w
        upright = squared > x * x + y * y
        scale = np.where(upright, np.sqrt((squared + x * x + y * y) / np.where(upright, squared, 1.0)), 0.0)
        flat = np.zeros_like(quaternions)
        flat[:, 2], flat[:, 3] = z * scale, w * scale
    return flat


def flat_states(states: NDArray[np.void]) -> NDArray[np.void]:
    """Copy of records.STATE (n,) without height, tilt and the motion out of the plane."""
    flat = states.copy()
    own = (states["flags"] & StateFlag.BODY_TWIST) != 0  # these twists are along axes that are tilted before
    flat["quaternion"] = flat_quaternions(states["quaternion"])
    turned = own & flat["quaternion"].any(axis=1)
    before, after = (rotation_matrix(each["quaternion"][turned]) for each in (states, flat))
    for field, dropped in PLANAR_VECTORS.items():
        is_vector = field != "position"
        if is_vector:
            flat[field][turned] = (before @ flat[field][turned][..., None])[..., 0]
        flat[field][:, dropped] = 0.0
        if is_vector:
            flat[field][turned] = (np.swapaxes(after, -1, -2) @ flat[field][turned][..., None])[..., 0]
    return flat


def flat_pose(pose: Pose) -> Pose:
    """The pose without height and tilt. Raises PoseError if z points down."""
    quaternion = flat_quaternions(pose.quaternion[None])[0]
    if not quaternion.any():
        raise PoseError(f"expected z to point up for a shape of the plane, got quaternion {pose.quaternion.tolist()}")
    return Pose((*pose.position[:2], 0.0), quaternion)


def is_planar(shape: Shape) -> bool:
    """Whether a shape lies in the x-y plane."""
    return kind_of(shape).planar
