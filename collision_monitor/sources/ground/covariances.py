"""Covariances of ROS messages: 6x6, row by row, of position and rotation or of linear and angular velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.sources.ground.scene_states import STEEPEST, squares

Floats = NDArray[np.float64]

PLACEHOLDER = 1e3
"""m^2, rad^2: from here on a variance says "not measured" (drivers write 1e3 to 1e9). Such an axis counts as exact."""

LEVEL = 1e-6
"""rad^2: up to here, and up to a hundredth of that of yaw, variances of roll and pitch count as none: 1 mrad."""

_NOT_NEGATIVE = -1e-9
"""Least eigenvalue, relative to the largest, of a covariance that was rounded."""

_UPPER = np.triu_indices(3)


class Blocks(NamedTuple):
    """Linear and angular blocks of N covariances."""

    linear: Floats
    """(N, 6): upper triangles."""
    stddev: Floats
    """(N,): standard deviations along the worst axis of the angular block."""
    yaw_only: NDArray[np.bool_]
    """(N,): whether the angular block has no variance but about the z axis, up to LEVEL."""
    valid: NDArray[np.bool_]
    """(N,): whether each matrix is a covariance, or says that there is none."""


def usable_blocks(matrices: Floats) -> Blocks:
    """Split covariances (N, 36).

    All zeros, or a first number below 0, means that there is none: the triangles are NaN and the deviations 0, as they
    are for a matrix that is not a covariance.
    """
    full = matrices.reshape(-1, 6, 6)
    none = (full == 0.0).all((1, 2)) | (full[:, 0, 0] == -1.0)
    if none.all():  # the usual case of many drivers
        return Blocks(np.full((len(full), 6), np.nan), np.zeros(len(full)), none, none)
    unmeasured = np.diagonal(full, axis1=1, axis2=2) >= PLACEHOLDER
    full = np.where(unmeasured[:, :, None] | unmeasured[:, None, :], 0.0, full)
    finite = (np.abs(full) < PLACEHOLDER).all((1, 2))  # no covariance exceeds both variances
    full = np.where((finite & ~none)[:, None, None], full, 0.0)
    linear, angular = full[:, :3, :3][:, *_UPPER], full[:, 3:, 3:][:, *_UPPER]
    eigenvalues = np.linalg.eigvalsh(np.stack([squares(linear), squares(angular)]))
    scale = np.abs(eigenvalues).max(2)
    valid = finite & (eigenvalues[:, :, 0] >= _NOT_NEGATIVE * scale).all(0)
    valid &= np.abs(full - np.swapaxes(full, 1, 2)).max((1, 2)) <= 1e-6 * np.abs(full).max((1, 2))
    used = valid & ~none
    stddev = np.where(used, np.sqrt(np.maximum(eigenvalues[1, :, 2], 0.0)), 0.0)
    tilt = np.abs(angular[:, :5]).max(1)
    yaw_only = ~used | (tilt <= np.minimum(LEVEL, 0.01 * angular[:, 5]))
    return Blocks(np.where(used[:, None], linear, np.nan), stddev, yaw_only, valid | none)


def yaw_alone(pose: Blocks, twist: Blocks, quaternions: Floats) -> NDArray[np.bool_]:
    """Whether errors of rotation are about the z axis of the frame alone: the twist is along the axes of the bodies.

    quaternions (N, 4) of the bodies.
    """
    upright = np.hypot(quaternions[:, 0], quaternions[:, 1]) <= 0.5 * STEEPEST
    by_yaw = pose.yaw_only & twist.yaw_only & (upright | (twist.stddev == 0.0))
    return np.asarray(by_yaw & (pose.stddev + twist.stddev > 0.0))
