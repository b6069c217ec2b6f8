"""Joints at constant rates, each until it meets its limit: spans of time within which no rate changes."""

from __future__ import annotations

from math import inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.robots.joint_motion import JointMotion
from collision_monitor.robots.kinematic_tree import KinematicTree

Floats = NDArray[np.float64]

APART: Final = 1e-9
"""s between two changes of rates. Nearer ones are one."""


def constant_rates(tree: KinematicTree, joints: Floats, horizon: float) -> JointMotion:
    """Move joints (J, 2), positions and rates, at these rates for `horizon` (s).

    A joint stops at its limit. One that is at its limit already, or beyond it, and moves outwards shows that this
    limit does not hold, and goes on.
    """
    q, rate = joints[:, 0], joints[:, 1]
    lower, upper = tree.limits[:, 0], tree.limits[:, 1]
    limit = np.where(rate > 0.0, upper, lower)
    ends = ((rate > 0.0) & (q < upper)) | ((rate < 0.0) & (q > lower))
    with np.errstate(all="ignore"):
        stops = np.where(ends, (limit - q) / np.where(rate != 0.0, rate, 1.0), inf)
    within = np.sort(stops[(stops > APART) & (stops < horizon - APART)])
    edges = np.array([0.0, *within[np.diff(within, prepend=0.0) > APART].tolist(), horizon])
    begins = edges[:-1, None]
    moves = stops > begins + APART
    position = np.where(moves, q + rate * begins, np.where(ends, limit, q))
    return JointMotion(edges, np.stack([position, np.where(moves, rate, 0.0)], axis=2))
