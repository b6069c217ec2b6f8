"""Samples of uncertain straight motions, side by side: their errors, and when each enters planes or a sphere.

The loops over samples have no branches, so that LLVM computes several samples at a time. They run over slices, because
an index that may be negative prevents that. Each sample is rounded as if it were alone.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Final

from collision_monitor._jit import device
from collision_monitor.prediction.obstacle_planes import GAP, RATE

ERRORS: Final = 6
"""Rows of the errors: position at time 0 (m) and velocity (m/s) of B relative to A."""

@device
def set_errors(root, frame, t, points, off):
    """Write the errors of the samples into off (ERRORS, S).

    root (6, 6): lower Cholesky factor of the covariance of position at time t and velocity along the rows of frame
    (3, 3); points (DIMENSIONS, S): standard normal coordinates.
    """
    for c in range(3):
        x, y, z = frame[0, c], frame[1, c], frame[2, c]
        for part in range(2):
            row, back = 3 * part, 0.0 if part else t
            f0 = x * (root[row, 0] - back * root[3, 0]) + y * (root[row + 1, 0] - back * root[4, 0])
            f1 = x * (root[row, 1] - back * root[3, 1]) + y * (root[row + 1, 1] - back * root[4, 1])
            f2 = x * (root[row, 2] - back * root[3, 2]) + y * (root[row + 1, 2] - back * root[4, 2])
            f3 = x * (root[row, 3] - back * root[3, 3]) + y * (root[row + 1, 3] - back * root[4, 3])
            f4 = x * (root[row, 4] - back * root[3, 4]) + y * (root[row + 1, 4] - back * root[4, 4])
            f5 = x * (root[row, 5] - back * root[3, 5]) + y * (root[row + 1, 5] - back * root[4, 5])
            f0 += z * (root[row + 2, 0] - back * root[5, 0])
            f1 += z * (root[row + 2, 1] - back * root[5, 1])
            f2 += z * (root[row + 2, 2] - back * root[5, 2])
            f3 += z * (root[row + 2, 3] - back * root[5, 3])
            f4 += z * (root[row + 2, 4] - back * root[5, 4])
            f5 += z * (root[row + 2, 5] - back * root[5, 5])
            target = off[3 * part + c]
            z0, z1, z2, z3, z4, z5 = points[0], points[1], points[2], points[3], points[4], points[5]
            for n in range(target.size):
                target[n] = f0 * z0[n] + f1 * z1[n] + f2 * z2[n] + f3 * z3[n] + f4 * z4[n] + f5 * z5[n]


@device
def enter_plane(plane, off, first, last, entry, leave):
    """Restrict the intervals [entry, leave] (S,) of samples first:last to the time behind a plane (PLANE_SIZE,)."""
    x, y, z = off[0, first:last], off[1, first:last], off[2, first:last]
    vx, vy, vz = off[3, first:last], off[4, first:last], off[5, first:last]
    entry, leave = entry[first:last], leave[first:last]
    nx, ny, nz, g, r = plane[0], plane[1], plane[2], plane[GAP], plane[RATE]
    for n in range(entry.size):
        gap = g + nx * x[n] + ny * y[n] + nz * z[n]
        rate = r + nx * vx[n] + ny * vy[n] + nz * vz[n] + 0.0  # -0.0 becomes 0.0
        at = -gap / rate
        closes = rate < 0.0
        entry[n] = at if closes and at > entry[n] else entry[n]
        leave[n] = at if not closes and at < leave[n] else leave[n]


@device
def enter_sphere(p, v, reach, end, off, times):
    """Lower the times (S,) of the samples to where they come within `reach` (m) of the origin, until `end`.

    p, v (3,): stated position and velocity of B relative to A.
    """
    px, py, pz = p
    vx, vy, vz = v
    for n in range(times.size):
        x, y, z = px + off[0, n], py + off[1, n], pz + off[2, n]
        u, w, q = vx + off[3, n], vy + off[4, n], vz + off[5, n]
        c = x * x + y * y + z * z - reach * reach
        b = x * u + y * w + z * q
        d = b * b - (u * u + w * w + q * q) * c
        at = c / (sqrt(d if d > 0.0 else 0.0) - b)
        meets = d >= 0.0 and b < 0.0 and at <= end
        at = 0.0 if c <= 0.0 else (at if meets else inf)
        times[n] = at if at < times[n] else times[n]
