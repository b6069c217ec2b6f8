"""Any two convex shapes: GJK for the distance of the cores, EPA where they overlap, the radii on top.

Growing a convex core by a sphere moves its surface along the normal, so distance and depth of the grown shapes
are those of the cores less the radii, exactly. (van den Bergen, 2003, 4.5)
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.geometry.shape_table import CONE, CYLINDER
from collision_monitor.narrow_phase.contact_row import MAX_VERTICES, SIMPLEX, write
from collision_monitor.narrow_phase.epa import epa
from collision_monitor.narrow_phase.gjk import WEIGHTS, gjk
from collision_monitor.narrow_phase.parallel_axes import axes_are_parallel, parallel_axes_depth
from collision_monitor.narrow_phase.support import core_radius, support_difference
from collision_monitor.tolerances import EPA_CURVED, EPA_CURVED_POINTS, EPA_POLYTOPE, SAT_ROUND_OFF, TOUCHING


@device
def _place(RA: Any, RB: Any, px: float, py: float, pz: float, work: Any) -> None:
    """work[0:9] = R_AB row by row, work[9:12] = p_AB: the pose of B in A's frame."""
    for i in range(3):
        for j in range(3):
            work[3 * i + j] = RA[0, i] * RB[0, j] + RA[1, i] * RB[1, j] + RA[2, i] * RB[2, j]
        work[9 + i] = RA[0, i] * px + RA[1, i] * py + RA[2, i] * pz


@device
def core_size(table: Any, slot: int) -> float:
    """Length (m) that the round-off of a shape's core is measured by."""
    return table.radius[slot] - table.margin[slot]


@device
def convex_separation(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, limit: float, out: Any, work: Any
) -> float:
    """Certified lower bound of the distance (m), <= 0 where they overlap or touch; its direction in out[0:3].

    The search ends as soon as the bound passes `limit` (m).
    """
    _place(RA, RB, px, py, pz, work)
    ka, kb = table.kind[a], table.kind[b]
    radii = table.margin[a] + table.margin[b] + core_radius(ka, table.size[a, 0]) + core_radius(kb, table.size[b, 0])
    size = core_size(table, a) + core_size(table, b)
    _, _, lower, x, y, z = gjk(
        ka, table.size[a, 0], table.size[a, 1], table.size[a, 2], table.vertex_start[a], table.vertex_count[a],
        kb, table.size[b, 0], table.size[b, 1], table.size[b, 2], table.vertex_start[b], table.vertex_count[b],
        table.vertices, work, size, limit + radii,
    )  # fmt: skip
    out[0] = RA[0, 0] * x + RA[0, 1] * y + RA[0, 2] * z
    out[1] = RA[1, 0] * x + RA[1, 1] * y + RA[1, 2] * z
    out[2] = RA[2, 0] * x + RA[2, 1] * y + RA[2, 2] * z
    slack = SAT_ROUND_OFF * (size + abs(px) + abs(py) + abs(pz))
    return max(lower, 0.0) - radii - slack


@device
def convex_contact(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, limit: float, out: Any, work: Any
) -> bool:
    """Whole contact in out; False, and out undefined, as soon as the distance is certified to be over `limit` (m)."""
    _place(RA, RB, px, py, pz, work)
    ka, kb = table.kind[a], table.kind[b]
    ra = table.margin[a] + core_radius(ka, table.size[a, 0])
    rb = table.margin[b] + core_radius(kb, table.size[b, 0])
    size = core_size(table, a) + core_size(table, b)
    count, _, lower, x, y, z = gjk(
        ka, table.size[a, 0], table.size[a, 1], table.size[a, 2], table.vertex_start[a], table.vertex_count[a],
        kb, table.size[b, 0], table.size[b, 1], table.size[b, 2], table.vertex_start[b], table.vertex_count[b],
        table.vertices, work, size, limit + ra + rb,
    )  # fmt: skip
    if count == 0:
        return False
    curved = ka == CYLINDER or ka == CONE or kb == CYLINDER or kb == CONE
    if lower > 0.0:
        # the length of a point of B - A, a true upper bound where the simplex is too thin for `upper` to be one
        wx = wy = wz = 0.0
        qx = qy = qz = 0.0
        for k in range(count):
            at = SIMPLEX + 8 * k
            w = work[WEIGHTS + k]
            wx += w * work[at]
            wy += w * work[at + 1]
            wz += w * work[at + 2]
            qx += w * work[at + 3]
            qy += w * work[at + 4]
            qz += w * work[at + 5]
        length = sqrt(wx * wx + wy * wy + wz * wz)
        distance = max(length, lower)
        bound = distance - lower
        if curved and length > 0.0:
            # On round surfaces the direction that proves the bound is not quite that between the points. Taken as the
            # normal, it puts B's point beside its surface; the other one leaves a gap along it that is too short.
            beside = sqrt((wx - length * x) ** 2 + (wy - length * y) ** 2 + (wz - length * z) ** 2)
            nx, ny, nz = wx / length, wy / length, wz / length
            dx, dy, dz = support_difference(
                ka, table.size[a, 0], table.size[a, 1], table.size[a, 2], table.vertex_start[a], table.vertex_count[a],
                kb, table.size[b, 0], table.size[b, 1], table.size[b, 2], table.vertex_start[b], table.vertex_count[b],
                table.vertices, work, -nx, -ny, -nz, SIMPLEX + 32,
            )  # fmt: skip
            if distance - (nx * dx + ny * dy + nz * dz) < beside:
                x, y, z = nx, ny, nz
    elif axes_are_parallel(ka, kb, work):
        depth, x, y, z, qx, qy, qz = parallel_axes_depth(
            ka, table.size[a, 0], table.size[a, 1], kb, table.size[b, 0], table.size[b, 1], work, size
        )
        distance = -depth
        bound = TOUCHING * size
    else:
        upper, lower, x, y, z, qx, qy, qz = epa(
            ka, table.size[a, 0], table.size[a, 1], table.size[a, 2], table.vertex_start[a], table.vertex_count[a],
            kb, table.size[b, 0], table.size[b, 1], table.size[b, 2], table.vertex_start[b], table.vertex_count[b],
            table.vertices, work, size, count,
            EPA_CURVED if curved else EPA_POLYTOPE, EPA_CURVED_POINTS if curved else MAX_VERTICES,
        )  # fmt: skip
        distance = -upper
        bound = abs(upper - lower) + TOUCHING * size
    bound += SAT_ROUND_OFF * (size + abs(px) + abs(py) + abs(pz) + ra + rb)
    # grown by its radius, A's surface is that much farther along the normal
    qx += ra * x
    qy += ra * y
    qz += ra * z
    write(
        out,
        distance - ra - rb,
        RA[0, 0] * x + RA[0, 1] * y + RA[0, 2] * z,
        RA[1, 0] * x + RA[1, 1] * y + RA[1, 2] * z,
        RA[2, 0] * x + RA[2, 1] * y + RA[2, 2] * z,
        RA[0, 0] * qx + RA[0, 1] * qy + RA[0, 2] * qz,
        RA[1, 0] * qx + RA[1, 1] * qy + RA[1, 2] * qz,
        RA[2, 0] * qx + RA[2, 1] * qy + RA[2, 2] * qz,
        bound,
    )
    return True
