"""A half-space against any convex shape: the shape's farthest point against the plane. And two half-spaces."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import FACE, write
from collision_monitor.narrow_phase.support import core_radius, support
from collision_monitor.tolerances import OPPOSED, SAT_ROUND_OFF


@device
def half_space_contact(table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, out: Any) -> None:
    """Convex shape a, half-space b. The only way out of a half-space is along its normal, however deep a shape is."""
    n0, n1, n2, offset = table.size[b, 0], table.size[b, 1], table.size[b, 2], table.size[b, 3]
    nx = RB[0, 0] * n0 + RB[0, 1] * n1 + RB[0, 2] * n2
    ny = RB[1, 0] * n0 + RB[1, 1] * n1 + RB[1, 2] * n2
    nz = RB[2, 0] * n0 + RB[2, 1] * n1 + RB[2, 2] * n2
    dx = -(RA[0, 0] * nx + RA[1, 0] * ny + RA[2, 0] * nz)
    dy = -(RA[0, 1] * nx + RA[1, 1] * ny + RA[2, 1] * nz)
    dz = -(RA[0, 2] * nx + RA[1, 2] * ny + RA[2, 2] * nz)
    kind = table.kind[a]
    x, y, z, _ = support(
        kind, table.size[a, 0], table.size[a, 1], table.size[a, 2],
        table.vertices, table.vertex_start[a], table.vertex_count[a], dx, dy, dz,
    )  # fmt: skip
    radius = core_radius(kind, table.size[a, 0]) + table.margin[a]
    x += radius * dx
    y += radius * dy
    z += radius * dz
    wx = RA[0, 0] * x + RA[0, 1] * y + RA[0, 2] * z
    wy = RA[1, 0] * x + RA[1, 1] * y + RA[1, 2] * z
    wz = RA[2, 0] * x + RA[2, 1] * y + RA[2, 2] * z
    distance = nx * (wx - px) + ny * (wy - py) + nz * (wz - pz) - (offset + table.margin[b])
    scale = abs(px) + abs(py) + abs(pz) + abs(offset) + table.radius[a] + table.margin[b]
    write(out, distance, -nx, -ny, -nz, wx, wy, wz, SAT_ROUND_OFF * scale)
    out[13] = FACE


@device
def half_spaces_contact(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, out: Any
) -> None:
    """Two half-spaces. Where they face each other they have a distance; else no translation parts them.

    Then the distance is -inf, and both witness points are one that both have.
    """
    x, y, z, reach_a = table.size[a, 0], table.size[a, 1], table.size[a, 2], table.size[a, 3] + table.margin[a]
    ax = RA[0, 0] * x + RA[0, 1] * y + RA[0, 2] * z
    ay = RA[1, 0] * x + RA[1, 1] * y + RA[1, 2] * z
    az = RA[2, 0] * x + RA[2, 1] * y + RA[2, 2] * z
    x, y, z, reach_b = table.size[b, 0], table.size[b, 1], table.size[b, 2], table.size[b, 3] + table.margin[b]
    bx = RB[0, 0] * x + RB[0, 1] * y + RB[0, 2] * z
    by = RB[1, 0] * x + RB[1, 1] * y + RB[1, 2] * z
    bz = RB[2, 0] * x + RB[2, 1] * y + RB[2, 2] * z
    if max(abs(ax + bx), abs(ay + by), abs(az + bz)) <= OPPOSED:
        distance = ax * px + ay * py + az * pz - reach_a - reach_b
        scale = abs(px) + abs(py) + abs(pz) + abs(reach_a) + abs(reach_b)
        write(out, distance, ax, ay, az, reach_a * ax, reach_a * ay, reach_a * az, SAT_ROUND_OFF * scale)
    else:
        # from A's plane into B: along A's plane, or where both look the same way, to B's plane
        outside = bx * (reach_a * ax - px) + by * (reach_a * ay - py) + bz * (reach_a * az - pz) - reach_b
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        sin2 = cx * cx + cy * cy + cz * cz
        x, y, z = reach_a * ax, reach_a * ay, reach_a * az
        if outside > 0.0 and sin2 > 0.0:
            x += outside / sin2 * (ay * cz - az * cy)
            y += outside / sin2 * (az * cx - ax * cz)
            z += outside / sin2 * (ax * cy - ay * cx)
        elif outside > 0.0:
            x, y, z = px + reach_b * bx, py + reach_b * by, pz + reach_b * bz
        dx, dy, dz = ax - bx, ay - by, az - bz
        length = sqrt(dx * dx + dy * dy + dz * dz)
        if length > 0.0:
            ax, ay, az = dx / length, dy / length, dz / length
        write(out, 0.0, ax, ay, az, x, y, z, 0.0)
        out[0] = -inf
    out[11] = FACE
    out[13] = FACE
