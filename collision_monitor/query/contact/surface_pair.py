"""The contact of a mesh or a cloud with another shape, and points near a shape, by the kernels of the monitor."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.body_impact import make_scratch
from collision_monitor.impact.mesh_contact import mesh_contacts
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE
from collision_monitor.query.pair_table import pair_table
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Points, Shape

Array = NDArray[np.float64]

_HERE: Final = np.zeros((1, 3))


class _Memory(threading.local):
    def __init__(self) -> None:
        self.scratch = make_scratch()


_MEMORY: Final = _Memory()


def surface_contact(a: Shape, X_A: tuple[Array, Array], b: Shape, X_B: tuple[Array, Array]) -> Array:
    """Contact row of a mesh or a cloud and another shape, in either order, about A's origin in world axes.

    A mesh that does not close counts as its surface.

    X_A, X_B: rotation (3, 3) and position (3,) of each (m).
    """
    row, R = np.empty(CONTACT_SIZE), np.stack([X_A[0], X_B[0]])
    near, p = np.empty(1, np.bool_), X_B[1] - X_A[1]
    mesh_contacts(pair_table(a, b, False), _HERE, R, p, np.inf, near, row, _MEMORY.scratch)
    return row


def points_near(points: Array, radius: float, pose: Pose, shape: Shape, at: Pose, limit: float) -> NDArray[np.bool_]:
    """Which balls (n,) about points (n, 3), at a pose, are within a limit (m) of a shape at another pose."""
    near = np.zeros(len(points), np.bool_)
    R = np.stack([np.eye(3), pose.rotation.T @ at.rotation])
    p = pose.rotation.T @ (at.position - pose.position)
    row = np.empty(CONTACT_SIZE)
    mesh_contacts(pair_table(_at_origin(radius), shape, False), points, R, p, limit, near, row, _MEMORY.scratch)
    return near


@lru_cache(8)
def _at_origin(radius: float) -> Points:
    """A cloud of one point."""
    return Points(np.zeros((1, 3)), radius)
