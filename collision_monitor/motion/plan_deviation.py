"""Whether states are within the tolerance of a plan. The monitor does the same in a kernel (`monitor/plans.py`)."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.motion.stated_motion import ANGULAR, LINEAR
from collision_monitor.motion.trajectory import Tolerance, Trajectory

STANDS: Final = 1e-3
"""m/s: slowest planned velocity that has a direction."""


def is_off_plan(path: Trajectory, tolerance: Tolerance, times: NDArray[np.float64], states: Any) -> NDArray[np.bool_]:
    """Return which states (N,) of records.STATE, at times (N,) of the plan (s), are outside of its tolerance."""
    planned = path.rows(times)
    off, velocity = states["position"] - planned[:, :3], planned[:, LINEAR:ANGULAR]
    apart, speed = np.linalg.norm(off, axis=1), np.linalg.norm(velocity, axis=1)
    moves = speed > STANDS
    along = np.where(moves, (off * velocity).sum(axis=1) / np.where(moves, speed, 1.0), 0.0)
    across = np.sqrt(np.maximum(apart**2 - along**2, 0.0))
    most = np.where(moves, tolerance.across, max(tolerance.across, tolerance.along))
    cosine = np.abs((states["quaternion"] * planned[:, 3:LINEAR]).sum(axis=1))
    turned = 2.0 * np.arctan2(np.sqrt(np.maximum(1.0 - cosine**2, 0.0)), cosine)
    late = np.abs(along) > tolerance.along + speed * tolerance.time
    return np.asarray((across > most) | late | (turned > tolerance.angle))
