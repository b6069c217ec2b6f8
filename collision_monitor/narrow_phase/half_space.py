"""A half-space against any convex shape: the shape's farthest point against the plane."""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import device
from collision_monitor.narrow_phase.answer import FACE, write
from collision_monitor.narrow_phase.support import core_radius, support
from collision_monitor.tolerances import SAT_ROUND_OFF


@device
def half_space_contact(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, out: Any
) -> None:
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
