"""Samples of uncertain straight motions, side by side: their errors, and when each enters a sphere.

The loops over samples have no branches, so that LLVM computes several samples at a time. They run over slices, because
an index that may be negative prevents that. Each sample is rounded as if it were alone.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from numpy import float32

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.uncertainty.samples.normal_samples import WIDENED

ERRORS: Final = 6
"""Rows of the errors: position at time 0 (m) and velocity (m/s) of B relative to A."""


@inlined
def draw_evenly(root: Any) -> None:
    """Undo for all samples that their first coordinate is drawn wider; root (6, 6): see `set_errors`."""
    for r in range(root.shape[0]):
        root[r, 0] /= WIDENED


@device
def set_errors(root: Any, frame: Any, t: float, points: Any, first: int, last: int, off: Any) -> None:
    """Write the errors of the samples first:last into off (ERRORS, S).

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
            f0, f1, f2 = float32(f0), float32(f1), float32(f2)
            f3, f4, f5 = float32(f3), float32(f4), float32(f5)
            target = off[3 * part + c, first:last]
            z0, z1, z2 = points[0, first:last], points[1, first:last], points[2, first:last]
            z3, z4, z5 = points[3, first:last], points[4, first:last], points[5, first:last]
            for n in range(target.size):
                target[n] = f0 * z0[n] + f1 * z1[n] + f2 * z2[n] + f3 * z3[n] + f4 * z4[n] + f5 * z5[n]


@device
def enter_sphere(p: Vector, v: Vector, reach: float, end: float, off: Any, first: int, last: int, times: Any) -> None:
    """Write the times (S,) at which the samples first:last come within `reach` (m) of the origin, until `end`.

    p, v (3,): stated position and velocity of B relative to A. A time is infinite if there is none.
    """
    px, py, pz = p
    vx, vy, vz = v
    x_off, y_off, z_off = off[0, first:last], off[1, first:last], off[2, first:last]
    u_off, w_off, q_off = off[3, first:last], off[4, first:last], off[5, first:last]
    times = times[first:last]
    for n in range(times.size):
        x, y, z = px + x_off[n], py + y_off[n], pz + z_off[n]
        u, w, q = vx + u_off[n], vy + w_off[n], vz + q_off[n]
        c = x * x + y * y + z * z - reach * reach
        b = x * u + y * w + z * q
        d = b * b - (u * u + w * w + q * q) * c
        at = c / (sqrt(d if d > 0.0 else 0.0) - b)
        meets = d >= 0.0 and b < 0.0 and at <= end
        times[n] = 0.0 if c <= 0.0 else (at if meets else inf)


@device
def enter_cylinder(
    p: Vector, v: Vector, axis: Vector, radius: float, half: float, end: float, off: Any, first: int, last: int,
    times: Any,
) -> None:  # fmt: skip
    """Write the times (S,) at which the samples first:last enter a cylinder about the origin, until `end`.

    p, v (3,): stated position and velocity of B relative to A. axis (3,): unit vector; radius, half the height (m).
    A time is infinite if there is none.
    """
    px, py, pz = p
    vx, vy, vz = v
    ax, ay, az = axis
    x_off, y_off, z_off = off[0, first:last], off[1, first:last], off[2, first:last]
    u_off, w_off, q_off = off[3, first:last], off[4, first:last], off[5, first:last]
    times = times[first:last]
    for n in range(times.size):
        x, y, z = px + x_off[n], py + y_off[n], pz + z_off[n]
        u, w, q = vx + u_off[n], vy + w_off[n], vz + q_off[n]
        h, s = x * ax + y * ay + z * az, u * ax + w * ay + q * az + 0.0  # -0.0 becomes 0.0
        a = u * u + w * w + q * q - s * s
        b = x * u + y * w + z * q - h * s
        c = x * x + y * y + z * z - h * h - radius * radius
        d = b * b - a * c
        root = sqrt(d if d > 0.0 else 0.0)
        # inside of the disc from enter to leave, between the planes from low to high
        enter = 0.0 if c <= 0.0 else (c / (root - b) if d >= 0.0 and b < 0.0 else inf)
        leave = (root - b) / a if a > 0.0 else inf
        below, above = (-half - h) / s, (half - h) / s
        low, high = (below, above) if s > 0.0 else (above, below)
        low, high = (low, high) if s != 0.0 else (-inf, (inf if abs(h) <= half else -inf))
        at = low if low > enter else enter
        leave = high if high < leave else leave
        leave = end if end < leave else leave
        times[n] = at if at <= leave else inf


@device
def tilt(
    points: Any, row: int, axis: Vector, lift: Any, turning: Any, lean: Any, first: int, last: int, off: Any
) -> None:
    """Move the samples first:last with a point that moves up a body's axis, as errors of orientation tilt it.

    axis (3,): unit vector; lift (S,): way (m) of the point along it; turning: error of orientation now (rad) and its
    rate (rad/s), one standard deviation; lean: way of the point for each metre (3,), and its rate (3,) in 1/s. points
    (DIMENSIONS, S): unit errors, three rows from `row`.
    """
    ax, ay, az = axis
    x, y, z, by = points[row, first:last], points[row + 1, first:last], points[row + 2, first:last], lift[first:last]
    for part in range(2):
        off_by, (lx, ly, lz) = turning[part], lean[part]
        u, v, w = off[3 * part, first:last], off[3 * part + 1, first:last], off[3 * part + 2, first:last]
        for n in range(u.size):
            u[n] += by[n] * (lx + off_by * (y[n] * az - z[n] * ay))
        for n in range(v.size):
            v[n] += by[n] * (ly + off_by * (z[n] * ax - x[n] * az))
        for n in range(w.size):
            w[n] += by[n] * (lz + off_by * (x[n] * ay - y[n] * ax))
