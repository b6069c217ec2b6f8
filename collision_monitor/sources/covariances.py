"""Covariances of ROS messages: 6x6, row by row, of position and rotation or of linear and angular velocity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.sources.scene_states import squares

Floats = NDArray[np.float64]

PLACEHOLDER = 1e3
"""m^2, rad^2: from here on a variance says "not measured" (drivers write 1e3 to 1e9). Such an axis counts as exact."""

_NOT_NEGATIVE = -1e-9
"""Least eigenvalue, relative to the largest, of a covariance that was rounded."""

_UPPER = np.triu_indices(3)


def usable_blocks(matrices: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Split covariances (N, 36).

    Returns upper triangles (N, 6) of the linear block, standard deviations (N,) along the worst axis of the angular
    block, and whether each matrix is a covariance. All zeros, or a first number below 0, means that there is none: the
    triangles are NaN and the deviations 0, as they are for a matrix that is not a covariance.
    """
    full = matrices.reshape(-1, 6, 6)
    none = (full == 0.0).all((1, 2)) | (full[:, 0, 0] == -1.0)
    if none.all():  # the usual case of many drivers
        return np.full((len(full), 6), np.nan), np.zeros(len(full)), none
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
    return np.where(used[:, None], linear, np.nan), stddev, valid | none
