"""Capsules and spheres against each other: closest points of their core segments. (Ericson, 4.5.1)"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import SURFACE, write
from collision_monitor.narrow_phase.segment import across, segment_segment
from collision_monitor.narrow_phase.sphere_sphere import direction
from collision_monitor.tolerances import SAT_ROUND_OFF, SEGMENT_PARALLEL_SIN2, TOUCHING


@device
def capsule_capsule_contact(
    ra: float, la: float, rb: float, lb: float, RA: Any, RB: Any, px: float, py: float, pz: float, out: Any
) -> None:
    """Radius with margin and half core length (m) of each; half length 0 is a sphere.

    Where the cores cross they part across both, and a core within the other's line parts at a right angle to it.
    """
    ux, uy, uz = la * RA[0, 2], la * RA[1, 2], la * RA[2, 2]
    vx, vy, vz = lb * RB[0, 2], lb * RB[1, 2], lb * RB[2, 2]
    s, t = segment_segment(ux, uy, uz, vx, vy, vz, px, py, pz)
    wx = px + t * vx - s * ux
    wy = py + t * vy - s * uy
    wz = pz + t * vz - s * uz
    distance, nx, ny, nz = direction(wx, wy, wz)
    bound = SAT_ROUND_OFF * (distance + ra + rb + la + lb + abs(px) + abs(py) + abs(pz))
    if (abs(s) < 1.0 and abs(t) < 1.0) or distance <= TOUCHING * (la + lb):
        cx = uy * vz - uz * vy
        cy = uz * vx - ux * vz
        cz = ux * vy - uy * vx
        length2 = cx * cx + cy * cy + cz * cz
        if la > 0.0 and lb > 0.0 and length2 > SEGMENT_PARALLEL_SIN2 * (la * la) * (lb * lb):
            # between the segments' insides the closest points lie across both: exact where the difference is noise
            length = sqrt(length2)
            side = copysign(1.0, cx * wx + cy * wy + cz * wz)
            nx, ny, nz = side * cx / length, side * cy / length, side * cz / length
            distance = nx * wx + ny * wy + nz * wz
        elif distance <= TOUCHING * (la + lb):
            ax, ay, az = (RA[0, 2], RA[1, 2], RA[2, 2]) if la >= lb else (RB[0, 2], RB[1, 2], RB[2, 2])
            nx, ny, nz = across(ax, ay, az, wx, wy, wz)
            distance = nx * wx + ny * wy + nz * wz
        if length2 <= SEGMENT_PARALLEL_SIN2 * (la * la) * (lb * lb) and length2 > 0.0:
            # taken for parallel, they were compared in the middle: towards an end they may be this much nearer
            bound += 2.0 * sqrt(length2) / max(la, lb)
    write(
        out,
        distance - (ra + rb),
        nx,
        ny,
        nz,
        s * ux + ra * nx,
        s * uy + ra * ny,
        s * uz + ra * nz,
        bound,
    )
    out[11] = SURFACE
    out[13] = SURFACE
