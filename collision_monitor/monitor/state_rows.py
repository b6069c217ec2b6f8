"""The states of a step, from ids, poses and twists as a Python program has them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.checks.numbers import as_numbers
from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.matrix_to_pose import matrices_to_poses
from collision_monitor.shapes.pose import Pose, as_pose


def _rows_of(poses: Any) -> NDArray[np.float64]:
    """Poses as an array, (N, 7) if they are a list of Pose or matrices (N, 4, 4). What is no pose is NaN.

    Raises InputError for what is no array of numbers.
    """
    if isinstance(poses, list | tuple) and any(isinstance(each, Pose) for each in poses):
        return np.array([as_pose(each, f"poses, {k}").numbers for k, each in enumerate(poses)])
    found = as_numbers(poses, "poses and twists", "arrays of numbers")
    if found.ndim != 3 or found.shape[1:] != (4, 4):
        return found
    matrices, rows = np.array(found, order="C"), np.full((len(found), 7), np.nan)
    at = 0
    while at < len(rows):
        wrong = matrices_to_poses(matrices[at:], rows[at:])  # the row of what is no pose stays NaN
        at = len(rows) if wrong < 0 else at + wrong + 1
    return rows


def states_of(ids: NDArray[Any], poses: Any, twists: Any) -> NDArray[np.void]:
    """Build states from ids (N,), poses (N, 7) and twists (N, 6). Raises InputError."""
    if ids.ndim != 1 or not np.issubdtype(ids.dtype, np.integer):
        raise InputError(f"ids: expected one dimension of integers, got {ids.dtype} of shape {ids.shape}")
    n = len(ids)
    pose = _rows_of(poses)
    twist = np.zeros((n, 6)) if twists is None else as_numbers(twists, "poses and twists", "arrays of numbers")
    if pose.shape != (n, 7) or twist.shape != (n, 6):
        raise InputError(
            "expected ids (N,), poses (N, 7), x y z qx qy qz qw, or (N, 4, 4), and twists (N, 6), linear, angular; "
            f"got shapes {ids.shape}, {pose.shape} and {twist.shape}"
        )
    if ids.min() < 0 or ids.max() >= 2**32:
        raise InputError(f"ids: expected integers from 0 to 4294967295, got {ids.min()} to {ids.max()}")
    states = np.zeros(n, records.STATE)
    states["id"] = ids
    states["position"], states["quaternion"] = pose[:, :3], pose[:, 3:]
    states["linear"], states["angular"] = twist[:, :3], twist[:, 3:]
    if twists is None:
        states["flags"] = int(StateFlag.TWIST_UNKNOWN)
    return states
