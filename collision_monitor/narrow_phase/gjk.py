"""Distance of two convex cores by GJK, with a certified lower bound.

(Gilbert, Johnson, Keerthi, 1988; van den Bergen, 2003, chapter 4; closest points by Voronoi regions: Ericson, 5.1)
The simplex lies at work[SIMPLEX:], rows of 8 as `support_difference` writes them.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.narrow_phase.answer import SIMPLEX
from collision_monitor.narrow_phase.support import support_difference
from collision_monitor.tolerances import EPSILON, FLAT, GJK_RELATIVE, THIN_SIN2, TOUCHING

MAX_ITERATIONS: Final = 64

WEIGHTS: Final = 12
"""work[12:16]: weights of the simplex points that make up the closest point."""


@device
def _segment(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Any:
    """Weight of b in the point of segment ab that is closest to the origin."""
    ex, ey, ez = bx - ax, by - ay, bz - az
    length2 = ex * ex + ey * ey + ez * ez
    along = -(ax * ex + ay * ey + az * ez)
    if along <= 0.0 or not length2 > 0.0:
        return 0.0
    if along >= length2:
        return 1.0
    return along / length2


@device
def _triangle(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, cx: float, cy: float, cz: float
) -> Any:
    """Weights of a, b, c in the closest point to the origin; and whether it lies inside of the face."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    n2 = nx * nx + ny * ny + nz * nz
    # barycentric coordinates of the origin's projection, each as a triple product with the normal
    wa = nx * (by * cz - bz * cy) + ny * (bz * cx - bx * cz) + nz * (bx * cy - by * cx)
    wb = nx * (cy * az - cz * ay) + ny * (cz * ax - cx * az) + nz * (cx * ay - cy * ax)
    wc = nx * (ay * bz - az * by) + ny * (az * bx - ax * bz) + nz * (ax * by - ay * bx)
    if wa > 0.0 and wb > 0.0 and wc > 0.0 and n2 > 0.0:
        total = wa + wb + wc
        return wa / total, wb / total, wc / total, True
    best = inf
    ra = rb = rc = 0.0
    # on an edge or a corner: the nearest of the three edges, which holds however thin the triangle is
    t = _segment(ax, ay, az, bx, by, bz)
    x, y, z = ax + t * ux, ay + t * uy, az + t * uz
    d2 = x * x + y * y + z * z
    if d2 < best:
        best = d2
        ra, rb, rc = 1.0 - t, t, 0.0
    t = _segment(ax, ay, az, cx, cy, cz)
    x, y, z = ax + t * vx, ay + t * vy, az + t * vz
    d2 = x * x + y * y + z * z
    if d2 < best:
        best = d2
        ra, rb, rc = 1.0 - t, 0.0, t
    t = _segment(bx, by, bz, cx, cy, cz)
    x, y, z = bx + t * (cx - bx), by + t * (cy - by), bz + t * (cz - bz)
    d2 = x * x + y * y + z * z
    if d2 < best:
        ra, rb, rc = 0.0, 1.0 - t, t
    return ra, rb, rc, False


@device
def _face_vector(i: int, j: int, k: int, wj: float, wk: float, work: Any) -> Any:
    """Projection of the origin on the plane of three simplex points; of a thin triangle the weighted point.

    Near contact the plane's normal is exact in direction where the weighted sum is round-off; of a thin triangle
    the normal is.
    """
    a, b, c = SIMPLEX + 8 * i, SIMPLEX + 8 * j, SIMPLEX + 8 * k
    ax, ay, az = work[a], work[a + 1], work[a + 2]
    ux, uy, uz = work[b] - ax, work[b + 1] - ay, work[b + 2] - az
    vx, vy, vz = work[c] - ax, work[c + 1] - ay, work[c + 2] - az
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    n2 = nx * nx + ny * ny + nz * nz
    if n2 <= THIN_SIN2 * (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz):
        return ax + wj * ux + wk * vx, ay + wj * uy + wk * vy, az + wj * uz + wk * vz
    f = (nx * ax + ny * ay + nz * az) / n2
    return nx * f, ny * f, nz * f


@device
def _keep(work: Any, count: int) -> int:
    """Drop the simplex points of weight 0; returns how many are left."""
    kept = 0
    for k in range(count):
        if work[WEIGHTS + k] > 0.0:
            if kept != k:
                work[WEIGHTS + kept] = work[WEIGHTS + k]
                for m in range(8):
                    work[SIMPLEX + 8 * kept + m] = work[SIMPLEX + 8 * k + m]
            kept += 1
    return kept


@device
def _reduce(work: Any, count: int, size: float) -> Any:
    """Closest point of the simplex to the origin: the points left, whether it holds the origin, and the point."""
    ax, ay, az = work[SIMPLEX], work[SIMPLEX + 1], work[SIMPLEX + 2]
    if count == 1:
        work[WEIGHTS] = 1.0
        return 1, False, ax, ay, az
    bx, by, bz = work[SIMPLEX + 8], work[SIMPLEX + 9], work[SIMPLEX + 10]
    if count == 2:
        t = _segment(ax, ay, az, bx, by, bz)
        work[WEIGHTS] = 1.0 - t
        work[WEIGHTS + 1] = t
        return _keep(work, 2), False, ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
    if count == 3:
        cx, cy, cz = work[SIMPLEX + 16], work[SIMPLEX + 17], work[SIMPLEX + 18]
        wa, wb, wc, inside = _triangle(ax, ay, az, bx, by, bz, cx, cy, cz)
        work[WEIGHTS] = wa
        work[WEIGHTS + 1] = wb
        work[WEIGHTS + 2] = wc
        if inside:
            x, y, z = _face_vector(0, 1, 2, wb, wc, work)
            return 3, False, x, y, z
        x = wa * ax + wb * bx + wc * cx
        y = wa * ay + wb * by + wc * cy
        z = wa * az + wb * bz + wc * cz
        return _keep(work, 3), False, x, y, z
    flat2 = (FLAT * size) ** 2
    best = inf
    outside = False
    rx = ry = rz = 0.0
    r0 = r1 = r2 = r3 = 0.0
    for face in range(4):
        # face = the points but for number `face`
        i = 1 if face == 0 else 0
        j = 2 if face <= 1 else 1
        k = 3 if face <= 2 else 2
        a, b, c, d = SIMPLEX + 8 * i, SIMPLEX + 8 * j, SIMPLEX + 8 * k, SIMPLEX + 8 * face
        ax, ay, az = work[a], work[a + 1], work[a + 2]
        bx, by, bz = work[b], work[b + 1], work[b + 2]
        cx, cy, cz = work[c], work[c + 1], work[c + 2]
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - ax, cy - ay, cz - az
        nx = uy * vz - uz * vy
        ny = uz * vx - ux * vz
        nz = ux * vy - uy * vx
        origin = -(nx * ax + ny * ay + nz * az)
        fourth = nx * (work[d] - ax) + ny * (work[d + 1] - ay) + nz * (work[d + 2] - az)
        n2 = nx * nx + ny * ny + nz * nz
        # a flat tetrahedron holds nothing: its sides are noise
        if origin * fourth > 0.0 and fourth * fourth > flat2 * n2:
            continue
        outside = True
        wa, wb, wc, inside = _triangle(ax, ay, az, bx, by, bz, cx, cy, cz)
        if inside:
            x, y, z = _face_vector(i, j, k, wb, wc, work)
        else:
            x = wa * ax + wb * bx + wc * cx
            y = wa * ay + wb * by + wc * cy
            z = wa * az + wb * bz + wc * cz
        d2 = x * x + y * y + z * z
        if d2 < best:
            best = d2
            rx, ry, rz = x, y, z
            if face == 0:
                r0, r1, r2, r3 = 0.0, wa, wb, wc
            elif face == 1:
                r0, r1, r2, r3 = wa, 0.0, wb, wc
            elif face == 2:
                r0, r1, r2, r3 = wa, wb, 0.0, wc
            else:
                r0, r1, r2, r3 = wa, wb, wc, 0.0
    if not outside:
        return 4, True, 0.0, 0.0, 0.0
    work[WEIGHTS] = r0
    work[WEIGHTS + 1] = r1
    work[WEIGHTS + 2] = r2
    work[WEIGHTS + 3] = r3
    return _keep(work, 4), False, rx, ry, rz


@device
def gjk(
    ka: int,
    a0: float,
    a1: float,
    a2: float,
    sa: int,
    na: int,
    kb: int,
    b0: float,
    b1: float,
    b2: float,
    sb: int,
    nb: int,
    vertices: Any,
    work: Any,
    size: float,
    limit: float,
) -> Any:
    """Distance between two cores in A's frame.

    Returns (points in the simplex, upper bound, certified lower bound, unit direction x, y, z from A to B).
    The direction is the one that proves the lower bound. 0 points: the search ended early, because the lower
    bound passed `limit` (m). A lower bound <= 0 means that the cores overlap or touch within round-off.
    """
    x, y, z = work[9], work[10], work[11]
    if not (abs(x) + abs(y) + abs(z) > 0.0):
        z = 1.0
    x, y, z = support_difference(
        ka, a0, a1, a2, sa, na, kb, b0, b1, b2, sb, nb, vertices, work, -x, -y, -z, SIMPLEX
    )
    work[WEIGHTS] = 1.0
    count = 1
    squared = x * x + y * y + z * z
    touching = TOUCHING * size
    lower = -inf
    lx = ly = lz = 0.0
    for _ in range(MAX_ITERATIONS):
        length = sqrt(squared)
        if length <= touching:
            return count, length, 0.0, 0.0, 0.0, 1.0
        at = SIMPLEX + 8 * count
        wx, wy, wz = support_difference(
            ka, a0, a1, a2, sa, na, kb, b0, b1, b2, sb, nb, vertices, work, -x, -y, -z, at
        )
        bound = (x * wx + y * wy + z * wz) / length
        if bound > lower:
            lower = bound
            lx, ly, lz = x / length, y / length, z / length
            if lower > limit:
                return 0, length, lower, lx, ly, lz
        if length - lower <= GJK_RELATIVE * length + 4.0 * EPSILON * size:
            break
        kept, inside, nx, ny, nz = _reduce(work, count + 1, size)
        if inside:
            return 4, 0.0, 0.0, 0.0, 0.0, 1.0
        shorter = nx * nx + ny * ny + nz * nz
        stalled = not shorter < squared
        count = kept
        x, y, z = nx, ny, nz
        squared = shorter
        if stalled:
            # round-off: no more progress is possible, what is known stands with its bounds
            break
    return count, sqrt(squared), lower, lx, ly, lz
