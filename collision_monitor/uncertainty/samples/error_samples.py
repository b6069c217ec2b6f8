"""Samples of the errors of two bodies' states: their covariance, its Cholesky factor, and the motions of one sample."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import Vector, cross, dot
from collision_monitor.impact.body_impact import Scratch, make_scratch
from collision_monitor.motion.course import ARC, STRAIGHT, place_on, turned_for
from collision_monitor.motion.motion import MOTION, place_at
from collision_monitor.motion.trigonometry import sin_cos
from collision_monitor.uncertainty.samples.known_axes import AXES
from collision_monitor.uncertainty.samples.normal_samples import DIMENSIONS
from collision_monitor.uncertainty.samples.skipped_samples import SIDES
from collision_monitor.uncertainty.spread import FIFTH_ROOT, unknown_acceleration

ORIENTATION, LEFT_OVER = 6, 12
"""First coordinates of a sample that are unit errors of orientation, three for each body: see `orientation_spread`."""

NOT_TURNING: Final = (0.0, 0.0, 0.0, 0.0)
"""`orientation_spread` of a body that errors do not turn."""


class Workspace(NamedTuple):
    """Scratch memory of one thread."""

    motion: Any  # (2,) MOTION: the two bodies; time 0 is now
    quaternion: Any  # (1, 4)
    rotation: Any  # (2, 3, 3): the stated orientations now
    frame: Any  # (3, 3): rows across the path, along it, and across both
    joint: Any  # (6, 6): covariance of position at the time of closest approach and of velocity, then its root
    block: Any  # (3, 3)
    axes: Any  # (AXES, 4): directions that separated the bodies in other samples
    sides: Any  # (1,) SIDES: what foretells the outcomes of samples
    sample: Any  # (DIMENSIONS,): unit errors of one sample
    errors: Any  # (2, 12): errors of both bodies in one sample, see planned_impacts.py
    scratch: Scratch


def make_workspace() -> Workspace:
    """Make the scratch memory of one thread."""
    return Workspace(
        np.zeros(2, MOTION),
        np.zeros((1, 4)),
        np.zeros((2, 3, 3)),
        np.zeros((3, 3)),
        np.zeros((6, 6)),
        np.zeros((3, 3)),
        np.zeros((AXES, 4)),
        np.zeros(1, SIDES),
        np.zeros(DIMENSIONS),
        np.zeros((2, 12)),
        make_scratch(),
    )


@device
def set_frame(frame: Any, vx: float, vy: float, vz: float) -> None:
    """Complete the frame (3, 3) whose first row is a direction n. Second row: part of v across n; third: across both.

    The rows become unit vectors. If the first row is 0, it becomes a direction across v.
    """
    n = sqrt(frame[0, 0] ** 2 + frame[0, 1] ** 2 + frame[0, 2] ** 2)
    v = sqrt(vx * vx + vy * vy + vz * vz)
    if n > 0.0:
        nx, ny, nz = frame[0, 0] / n, frame[0, 1] / n, frame[0, 2] / n
    else:
        nx, ny, nz = _across(vx, vy, vz)
    along = vx * nx + vy * ny + vz * nz
    ux, uy, uz = vx - along * nx, vy - along * ny, vz - along * nz
    u = sqrt(ux * ux + uy * uy + uz * uz)
    if u > 1e-6 * v:
        ux, uy, uz = ux / u, uy / u, uz / u
    else:
        ux, uy, uz = _across(nx, ny, nz)
    frame[0, 0], frame[0, 1], frame[0, 2] = nx, ny, nz
    frame[1, 0], frame[1, 1], frame[1, 2] = ux, uy, uz
    frame[2, 0], frame[2, 1], frame[2, 2] = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux


@inlined
def _across(x: float, y: float, z: float) -> Vector:
    """Return a horizontal unit vector perpendicular to (x, y, z)."""
    level = sqrt(x * x + y * y)
    if level > 1e-6 * abs(z):
        return -y / level, x / level, 0.0
    return 1.0, 0.0, 0.0


@device
def add_covariance(
    spread: Any, i: int, age: float, t: float, right: float, stale_acceleration: float, planar: bool, work: Workspace
) -> None:
    """Add body i's part to work.joint (6, 6): covariance of its position t seconds from now and its velocity.

    Both are along the axes of work.frame. age: s since the body's last state. A stale object widens its spread here. An
    unknown acceleration from now on acts as a velocity error with the right displacement at the time `right` (s from
    now; 0: it is left out).
    """
    at = age + t
    s = unknown_acceleration(spread, i, age > 0.0, 0, stale_acceleration)
    ahead = 0.5 * right if unknown_acceleration(spread, i, False, 0, stale_acceleration) > 0.0 else 0.0
    velocity = s * (age + ahead)
    position = s * 0.5 * age * age + velocity * t
    C, frame, joint, block = spread.covariance, work.frame, work.joint, work.block
    for part in range(3):
        row, column = 3 * (part == 2), 3 * (part > 0)
        factor = at if part == 1 else at * at
        extra = (position * position, position * velocity, velocity * velocity)[part]
        k = 0
        for r in range(3):
            for c in range(r, 3):
                value = C[i, 6 + k] if part == 2 else factor * C[i, 6 + k] + (C[i, k] if part == 0 else 0.0)
                if r == c and not (planar and r == 2):
                    value += extra
                block[r, c] = block[c, r] = value
                k += 1
        for r in range(3):
            x = y = z = 0.0
            for k in range(3):
                x += frame[r, k] * block[k, 0]
                y += frame[r, k] * block[k, 1]
                z += frame[r, k] * block[k, 2]
            for c in range(3):
                joint[row + r, column + c] += x * frame[c, 0] + y * frame[c, 1] + z * frame[c, 2]


@inlined
def add_arc_errors(
    m: Any, spread: Any, i: int, age: float, times: tuple[float, float], yaw_only: bool, work: Workspace
) -> None:  # fmt: skip
    """Add to work.joint how errors of orientation and angular velocity move body i, if it goes along an arc m (MOTION).

    age: s since its last state. times: that of the joint covariance (s from now), and the horizon.
    """
    if m.course == ARC:
        t = times[0] if times[0] > 0.0 else times[1]  # when these errors are right
        pose, rate = spread.stddev[i, 1], spread.stddev[i, 3]
        harder = unknown_acceleration(spread, i, False, 1, 0.0) * (0.5 * age * age + t * (age + t / 6.0))
        variance = pose * pose + rate * rate * (age * age + age * t + 0.25 * t * t) + harder * harder
        _add_turned_path(m, variance, (times[0], t), yaw_only, work.frame, work.joint, work.block)


@outlined
def _add_turned_path(
    m: Any, variance: float, times: tuple[float, float], yaw_only: bool, frame: Any, joint: Any, C: Any
) -> None:  # fmt: skip
    """Add to a joint covariance (6, 6) how a body on an arc m (MOTION) is moved by errors that turn its path.

    times: that of the covariance (s from now), and t, when these errors are right. variance: of the angle by which they
    turn the chord of the path until t (rad^2). frame (3, 3): axes of the covariance; C (3, 3): scratch.

    An error of its orientation turns the chord of its path until t; one of its angular velocity, which grows, turns
    half of that. Both count as errors of the velocity that are right at t, independent of how they turn
    the body.
    """
    at, t = times
    moved = place_at(m, t).moved
    chord = (moved[0] / t, moved[1] / t, moved[2] / t)
    for r in range(3):
        for c in range(3):
            C[r, c] = -chord[r] * chord[c] * variance
        C[r, r] += dot(chord, chord) * variance
    if yaw_only:  # across the chord, in the plane
        across = (-chord[1], chord[0], 0.0)
        for r in range(3):
            for c in range(3):
                C[r, c] = across[r] * across[c] * variance
    for part in range(3):
        row, column = 3 * (part == 2), 3 * (part > 0)
        factor = (at * at, at, 1.0)[part]
        for r in range(3):
            for c in range(3):
                total = 0.0
                for k in range(3):
                    for n in range(3):
                        total += frame[r, k] * C[k, n] * frame[c, n]
                joint[row + r, column + c] += factor * total


@device
def take_root(joint: Any) -> None:
    """Replace a covariance (6, 6), given by its upper triangle, by its lower Cholesky factor, with zeros above it.

    A coordinate without variance of its own gets a zero column.
    """
    for c in range(6):
        d = joint[c, c]
        scale = d
        for k in range(c):
            d -= joint[c, k] * joint[c, k]
        root = sqrt(d) if d > 1e-12 * scale else 0.0
        for r in range(c + 1, 6):
            value = joint[c, r]
            for k in range(c):
                value -= joint[r, k] * joint[c, k]
            joint[r, c] = value / root if root > 0.0 else 0.0
        joint[c, c] = root
    for r in range(6):
        for c in range(r + 1, 6):
            joint[r, c] = 0.0


@outlined
def turn(m: Any, R: Any, w: Vector, velocity: Vector, off: Any, error: Vector, left: Vector) -> None:
    """Set rotation and angular velocity of m (MOTION) to R and w (3,), off by unit errors, see `orientation_spread`.

    velocity (3,): of a body on an arc, which turns with it. error, left (3,): of the orientation at the time of `off`,
    and of what is left.
    """
    x, y, z = error
    u, v, q = left
    m.wx = w[0] + off[1] * x + off[3] * u
    m.wy = w[1] + off[1] * y + off[3] * v
    m.wz = w[2] + off[1] * z + off[3] * q
    dx, dy, dz = off[0] * x + off[2] * u, off[0] * y + off[2] * v, off[0] * z + off[2] * q
    angle = sqrt(dx * dx + dy * dy + dz * dz)
    c = 2.0 * np.sin(0.5 * angle) ** 2
    s = np.sin(angle)
    if angle > 0.0:
        dx, dy, dz = dx / angle, dy / angle, dz / angle
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        ax, ay, az = dy * z - dz * y, dz * x - dx * z, dx * y - dy * x
        m.rotation[0, j] = x + s * ax + c * (dy * az - dz * ay)
        m.rotation[1, j] = y + s * ay + c * (dz * ax - dx * az)
        m.rotation[2, j] = z + s * az + c * (dx * ay - dy * ax)
    if m.course == ARC:  # its path turns with it
        aside = cross((dx, dy, dz), velocity)
        back = cross((dx, dy, dz), aside)
        m.vx = velocity[0] + s * aside[0] + c * back[0]
        m.vy = velocity[1] + s * aside[1] + c * back[1]
        m.vz = velocity[2] + s * aside[2] + c * back[2]


@device
def orientation_spread(
    spread: Any, i: int, radius: float, age: float, t: float, right: float
) -> tuple[float, float, float, float]:
    """Errors of body i's orientation for two unit errors: (rad now, rad/s, rad now, rad/s), the last two independent.

    The first one is that of the orientation t seconds from now, with its likeliest way there; the second is what is
    left of the errors of orientation and angular velocity, and moves nothing at t (the Cholesky factor of both at t).
    An unknown angular acceleration acts as an error of the angular velocity that is right at the time `right` (s from
    now). All are 0 if rotation moves nothing. age: s since the last state.
    """
    if radius == 0.0:
        return NOT_TURNING
    mean = 2.0 * age + right
    pose, rate = spread.stddev[i, 1] ** 2, spread.stddev[i, 3] ** 2
    turning = (0.5 * FIFTH_ROOT * spread.acceleration[i, 1]) ** 2
    now = pose + (rate + turning * age * age) * age * age
    both = (rate + turning * age * mean) * age
    rate += turning * mean * mean
    whole = sqrt(now + (2.0 * both + rate * t) * t)
    if whole == 0.0:
        return 0.0, sqrt(rate), 0.0, 0.0
    left = sqrt(max(now * rate - both * both, 0.0)) / whole
    return (now + both * t) / whole, (both + rate * t) / whole, -t * left, left


@inlined
def errors_turn(off: Any) -> bool:
    """Whether errors turn a body; off: orientation_spread."""
    return off[0] + off[1] + off[3] > 0.0


@device
def set_turn(m: Any, t: float, off: Any, yaw_only: bool, out: Any) -> None:
    """Write the matrix (3, 3) that maps a unit error to the rotation vector (rad) of motion m's error at time t.

    off: error of orientation at time 0 (rad) and of the angular velocity (rad/s), about all axes or, if yaw_only, about
    the z axis. The first turns with the body:
    exp(w t). The second adds up in turning axes: the integral of exp(w s) for s from 0 to t.
    """
    if off[0] == 0.0 and off[1] == 0.0:
        return
    rate = sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)
    angle = rate * turned_for(m.course, (m.vx, m.vy, m.vz), (m.ax, m.ay, m.az), t - m.time, m.rest - m.time)
    sine, cosine = sin_cos(angle)
    x, y, z = (m.wx / rate, m.wy / rate, m.wz / rate) if angle > 0.0 else (0.0, 0.0, 0.0)
    whole = 1.0
    mean = slow = 0.0
    if angle > 1e-4:
        whole, mean, slow = sine / angle, (1.0 - cosine) / angle, 1.0 - sine / angle
    drift = off[1] * t
    same = off[0] * cosine + drift * whole
    along = off[0] * (1.0 - cosine) + drift * slow
    across = off[0] * sine + drift * mean
    out[0, 0], out[0, 1], out[0, 2] = same + along * x * x, along * x * y - across * z, along * x * z + across * y
    out[1, 0], out[1, 1], out[1, 2] = along * x * y + across * z, same + along * y * y, along * y * z - across * x
    out[2, 0], out[2, 1], out[2, 2] = along * x * z - across * y, along * y * z + across * x, same + along * z * z
    if yaw_only:
        for c in range(3):
            out[c, 0] = out[c, 1] = 0.0


@device
def shift(work: Workspace, z: Any, t: float, stated: Any) -> None:
    """Move body j by sample z (DIMENSIONS,): its velocity is off by the error, its position at t by the other one.

    If only body i goes straight, it is moved the other way, because an error of i does not end where j stands. stated:
    position and velocity of i, and those of j and its angular velocity, with which the errors of a body on an arc turn.
    """
    A, B, L, F, y = work.motion[0], work.motion[1], work.joint, work.frame, work.block
    (p_i, v_i), (p, v, w) = stated
    for r in range(6):
        value = 0.0
        for c in range(r + 1):
            value += L[r, c] * z[c]
        y[r // 3, r % 3] = value
    dx = y[1, 0] * F[0, 0] + y[1, 1] * F[1, 0] + y[1, 2] * F[2, 0]
    dy = y[1, 0] * F[0, 1] + y[1, 1] * F[1, 1] + y[1, 2] * F[2, 1]
    dz = y[1, 0] * F[0, 2] + y[1, 1] * F[1, 2] + y[1, 2] * F[2, 2]
    off_x = y[0, 0] * F[0, 0] + y[0, 1] * F[1, 0] + y[0, 2] * F[2, 0]
    off_y = y[0, 0] * F[0, 1] + y[0, 1] * F[1, 1] + y[0, 2] * F[2, 1]
    off_z = y[0, 0] * F[0, 2] + y[0, 1] * F[1, 2] + y[0, 2] * F[2, 2]
    if A.course == STRAIGHT and B.course != STRAIGHT:
        A.vx, A.vy, A.vz = v_i[0] - dx, v_i[1] - dy, v_i[2] - dz
        A.x, A.y, A.z = p_i[0] - off_x + t * dx, p_i[1] - off_y + t * dy, p_i[2] - off_z + t * dz
        B.vx, B.vy, B.vz = v
        return
    B.vx, B.vy, B.vz = v[0] + dx, v[1] + dy, v[2] + dz
    mx, my, mz = t * dx, t * dy, t * dz
    if B.course == ARC:  # the error turns with the body
        mx, my, mz = place_on(ARC, (dx, dy, dz), w, (0.0, 0.0, 0.0), t, inf).moved
    B.x, B.y, B.z = p[0] + off_x - mx, p[1] + off_y - my, p[2] + off_z - mz
