"""Distance of two convex cores by GJK, with a certified lower bound.

(Gilbert, Johnson, Keerthi, 1988; van den Bergen, 2003, chapter 4; closest points by Voronoi regions: Ericson, 5.1)
The simplex lies at work[SIMPLEX:], rows of 8 as `support_difference` writes them.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import SIMPLEX
from collision_monitor.narrow_phase.sphere_sphere import direction
from collision_monitor.narrow_phase.support import support_difference
from collision_monitor.tolerances import EPSILON, FLAT, GJK_RELATIVE, THIN_SIN2, TOUCHING

MAX_ITERATIONS: Final = 64

WEIGHTS: Final = 12
"""work[12:16]: weights of the simplex points that make up the closest point."""

NEW_WEIGHTS: Final = 16
"""work[16:20]: the same of the next simplex, until it proves to be nearer."""


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
    """Weights of a, b and the newest point c in the point closest to the origin; whether it lies inside the face."""
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
    # on an edge or a corner, which holds however thin the triangle is; edge ab is out, as it was not the nearest before
    t = _segment(ax, ay, az, cx, cy, cz)
    x, y, z = ax + t * vx, ay + t * vy, az + t * vz
    s = _segment(bx, by, bz, cx, cy, cz)
    u, v, w = bx + s * (cx - bx), by + s * (cy - by), bz + s * (cz - bz)
    if x * x + y * y + z * z <= u * u + v * v + w * w:
        return 1.0 - t, 0.0, t, False
    return 0.0, 1.0 - s, s, False


@device
def closest_on_triangle(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, cx: float, cy: float, cz: float
) -> Any:
    """Weights of a, b, c in the point of a triangle that is closest to the origin, whatever is known before."""
    wa, wb, wc, inside = _triangle(ax, ay, az, bx, by, bz, cx, cy, cz)
    if inside:
        return wa, wb, wc
    x, y, z = wa * ax + wb * bx + wc * cx, wa * ay + wb * by + wc * cy, wa * az + wb * bz + wc * cz
    t = _segment(ax, ay, az, bx, by, bz)
    u, v, w = ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
    if u * u + v * v + w * w < x * x + y * y + z * z:
        return 1.0 - t, t, 0.0
    return wa, wb, wc


@device
def _face_vector(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, cx: float, cy: float, cz: float,
    wb: float, wc: float,
) -> Any:
    """Projection of the origin on the plane of a triangle; of a thin one, the weighted point.

    Near contact the plane's normal is exact in direction where the weighted sum is round-off; of a thin triangle
    the normal is.
    """
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    n2 = nx * nx + ny * ny + nz * nz
    if n2 <= THIN_SIN2 * (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz):
        return ax + wb * ux + wc * vx, ay + wb * uy + wc * vy, az + wb * uz + wc * vz
    f = (nx * ax + ny * ay + nz * az) / n2
    return nx * f, ny * f, nz * f


@device
def _keep(work: Any, count: int) -> int:
    """Take over the new weights and drop the simplex points of weight 0; returns how many are left."""
    kept = 0
    for k in range(count):
        if work[NEW_WEIGHTS + k] > 0.0:
            work[WEIGHTS + kept] = work[NEW_WEIGHTS + k]
            if kept != k:
                for m in range(8):
                    work[SIMPLEX + 8 * kept + m] = work[SIMPLEX + 8 * k + m]
            kept += 1
    return kept


@device
def _reduce(work: Any, count: int, size: float) -> Any:
    """Closest point of the simplex to the origin: whether it holds the origin, and the point; its weights as new ones.

    The last point is the newest; without it the origin was known to be nearest to the inside of the others.
    """
    ax, ay, az = work[SIMPLEX], work[SIMPLEX + 1], work[SIMPLEX + 2]
    bx, by, bz = work[SIMPLEX + 8], work[SIMPLEX + 9], work[SIMPLEX + 10]
    if count == 2:
        t = _segment(ax, ay, az, bx, by, bz)
        work[NEW_WEIGHTS] = 1.0 - t
        work[NEW_WEIGHTS + 1] = t
        return False, ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
    cx, cy, cz = work[SIMPLEX + 16], work[SIMPLEX + 17], work[SIMPLEX + 18]
    if count == 3:
        wa, wb, wc, inside = _triangle(ax, ay, az, bx, by, bz, cx, cy, cz)
        work[NEW_WEIGHTS] = wa
        work[NEW_WEIGHTS + 1] = wb
        work[NEW_WEIGHTS + 2] = wc
        if inside:
            x, y, z = _face_vector(ax, ay, az, bx, by, bz, cx, cy, cz, wb, wc)
            return False, x, y, z
        return False, wa * ax + wb * bx + wc * cx, wa * ay + wb * by + wc * cy, wa * az + wb * bz + wc * cz
    flat2 = (FLAT * size) ** 2
    best = inf
    rx = ry = rz = 0.0
    dx, dy, dz = work[SIMPLEX + 24], work[SIMPLEX + 25], work[SIMPLEX + 26]
    for face in range(3):
        # a, b and the newest point d; c is the one across
        if face > 0:
            ax, ay, az, bx, by, bz, cx, cy, cz = bx, by, bz, cx, cy, cz, ax, ay, az
        ux, uy, uz = ax - dx, ay - dy, az - dz
        vx, vy, vz = bx - dx, by - dy, bz - dz
        nx = uy * vz - uz * vy
        ny = uz * vx - ux * vz
        nz = ux * vy - uy * vx
        origin = -(nx * dx + ny * dy + nz * dz)
        across = nx * (cx - dx) + ny * (cy - dy) + nz * (cz - dz)
        # a flat tetrahedron holds nothing: its sides are noise
        if origin * across > 0.0 and across * across > flat2 * (nx * nx + ny * ny + nz * nz):
            continue
        wa, wb, wd, inside = _triangle(ax, ay, az, bx, by, bz, dx, dy, dz)
        if inside:
            x, y, z = _face_vector(ax, ay, az, bx, by, bz, dx, dy, dz, wb, wd)
        else:
            x = wa * ax + wb * bx + wd * dx
            y = wa * ay + wb * by + wd * dy
            z = wa * az + wb * bz + wd * dz
        d2 = x * x + y * y + z * z
        if d2 < best:
            best = d2
            rx, ry, rz = x, y, z
            work[NEW_WEIGHTS + face] = wa
            work[NEW_WEIGHTS + (face + 1) % 3] = wb
            work[NEW_WEIGHTS + (face + 2) % 3] = 0.0
            work[NEW_WEIGHTS + 3] = wd
    return best == inf, rx, ry, rz


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
    _, x, y, z = direction(work[9], work[10], work[11])
    length = 1.0
    squared = inf
    count = 0
    lower = -inf
    lx = ly = lz = 0.0
    for _ in range(MAX_ITERATIONS):
        wx, wy, wz = support_difference(
            ka, a0, a1, a2, sa, na, kb, b0, b1, b2, sb, nb, vertices, work, -x, -y, -z, SIMPLEX + 8 * count
        )
        bound = (x * wx + y * wy + z * wz) / length
        if bound > lower:
            lower = bound
            lx, ly, lz = x / length, y / length, z / length
            if lower > limit:
                return 0, length, lower, lx, ly, lz
        if count > 0 and length - lower <= GJK_RELATIVE * length + 4.0 * EPSILON * size:
            break
        if count == 0:
            inside, nx, ny, nz = False, wx, wy, wz
            work[NEW_WEIGHTS] = 1.0
        else:
            inside, nx, ny, nz = _reduce(work, count + 1, size)
        if inside and lower <= 0.0:
            return 4, 0.0, 0.0, 0.0, 0.0, 1.0
        shorter = nx * nx + ny * ny + nz * nz
        if inside or not shorter < squared:
            # round-off: no more progress is possible, what is known stands with its bounds
            break
        count = _keep(work, count + 1)
        x, y, z = nx, ny, nz
        squared = shorter
        length = sqrt(squared)
        if length <= TOUCHING * size:
            return count, length, 0.0, 0.0, 0.0, 1.0
    return count, length, lower, lx, ly, lz
