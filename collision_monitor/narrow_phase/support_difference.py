"""Support points of the difference of two cores, for GJK and EPA.

(van den Bergen, Collision Detection in Interactive 3D Environments, 4.3.4)
"""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, minus, opposite
from collision_monitor.narrow_phase.core import CorePair
from collision_monitor.narrow_phase.work_memory import ON_A, P_AB, R_AB
from collision_monitor.shapes.calls import support_point


@inlined
def support_difference(cores: CorePair, work: Any, d: Vector, at: int) -> Vector:
    """Farthest point of B - A along d in A's frame; the scratch memory holds the pose of B in that frame.

    Writes a row of the simplex at work[at]: the difference and the point on A; returns the difference.
    """
    dx, dy, dz = d
    A, B = cores.A, cores.B
    a = support_point(A.kind, A.size, cores.vertices_a, A.first, A.count, opposite(d))
    lx, ly, lz = support_point(
        B.kind,
        B.size,
        cores.vertices_b,
        B.first,
        B.count,
        (
            work[R_AB] * dx + work[R_AB + 3] * dy + work[R_AB + 6] * dz,
            work[R_AB + 1] * dx + work[R_AB + 4] * dy + work[R_AB + 7] * dz,
            work[R_AB + 2] * dx + work[R_AB + 5] * dy + work[R_AB + 8] * dz,
        ),
    )
    b = (
        work[R_AB] * lx + work[R_AB + 1] * ly + work[R_AB + 2] * lz + work[P_AB],
        work[R_AB + 3] * lx + work[R_AB + 4] * ly + work[R_AB + 5] * lz + work[P_AB + 1],
        work[R_AB + 6] * lx + work[R_AB + 7] * ly + work[R_AB + 8] * lz + work[P_AB + 2],
    )
    difference = minus(b, a)
    work[at] = difference[0]
    work[at + 1] = difference[1]
    work[at + 2] = difference[2]
    work[at + ON_A] = a[0]
    work[at + ON_A + 1] = a[1]
    work[at + ON_A + 2] = a[2]
    return difference
