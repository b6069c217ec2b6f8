"""States in a frame, brought into the frame of the monitor with their twists and covariances."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import multiply, rotation_matrix
from collision_monitor.sources.ground.frames import FrameMotion

Floats = NDArray[np.float64]

STEEPEST = 1e-3
"""rad: an axis with a smaller tilt counts as vertical."""
States = Any  # an array of records.STATE; NumPy's stubs know no assignment to its fields


def empty_states(ids: list[int]) -> States:
    """Return states of zeros, with unit quaternions, for these ids."""
    states = np.zeros(len(ids), records.STATE)
    states["quaternion"][:, 3] = 1.0
    states["id"] = ids
    return states


def turn_twists(states: States) -> None:
    """Turn twists along the axes of the bodies, as Odometry has them, to the axes of the frame of their poses."""
    R_FB = rotation_matrix(states["quaternion"])
    for field in ("linear", "angular", "acceleration"):
        states[field] = _turned(R_FB, states[field])


def carry_states(states: States, frame: FrameMotion, covariance: Floats | None) -> Floats | None:
    """Bring states of a frame into that in which the frame moves. Return their covariances (N, 12).

    v_W = v_F + w_F x (R_WF p) + R_WF v, w_W = w_F + R_WF w. An acceleration is kept if the frame does not move, because
    that of the frame is not known. Where the twist of the frame is not known, that of the states is not either.
    Source: Lynch and Park, Modern Robotics (2017), 3.3.
    """
    R_WF = rotation_matrix(frame.quaternion)
    arms = _turned(R_WF, states["position"])
    states["position"] = frame.position + arms
    states["quaternion"] = multiply(frame.quaternion, states["quaternion"])
    states["linear"] = frame.linear + np.cross(frame.angular, arms) + _turned(R_WF, states["linear"])
    states["angular"] = frame.angular + _turned(R_WF, states["angular"])
    states["acceleration"] = _turned(R_WF, states["acceleration"])
    if frame.moving:
        states["flags"] &= ~np.uint32(StateFlag.ACCELERATION_VALID)
    if np.hypot(R_WF[2, 0], R_WF[2, 1]) > STEEPEST:  # its z axis is not the world's
        states["flags"] &= ~np.uint32(StateFlag.YAW_ONLY)
    if not frame.twist_known:
        states["flags"] |= np.uint32(StateFlag.TWIST_UNKNOWN)
    return None if covariance is None else turned_triangles(R_WF, covariance)


_ROWS, _COLUMNS = np.triu_indices(3)


def squares(triangles: Floats) -> Floats:
    """Return symmetric matrices (..., 3, 3) of upper triangles (..., 6)."""
    full = np.empty((*triangles.shape[:-1], 3, 3))
    full[..., _ROWS, _COLUMNS] = full[..., _COLUMNS, _ROWS] = triangles
    return full


def turned_triangles(rotation: Floats, triangles: Floats) -> Floats:
    """Return the upper triangles (N, 12) of two covariances each, turned by one rotation (3, 3) or by (N, 3, 3)."""
    blocks = squares(triangles.reshape(-1, 2, 6))
    R = rotation if rotation.ndim == 2 else rotation[:, None]
    turned = R @ blocks @ np.swapaxes(R, -1, -2)
    return np.ascontiguousarray(turned[..., _ROWS, _COLUMNS].reshape(-1, 12))


def _turned(rotation: Floats, vectors: Floats) -> Floats:
    """Return vectors (N, 3) turned by one rotation (3, 3) or by one each (N, 3, 3)."""
    return np.asarray((rotation @ vectors[..., None])[..., 0])
