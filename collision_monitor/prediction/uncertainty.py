"""When and how likely two bodies meet whose states are uncertain: earliest, most likely, latest time, probability.

The relative motion is a straight line whose start and velocity are normally distributed (spread.py). Evenly spread
samples of it, each followed exactly as the stated motion is, give the distribution of the time of impact
(docs/uncertainty.md). The samples are laid along what matters: the error of the position at the time of closest
approach decides whether they meet, its part across the path first; what is left of the velocity's error comes after.
"""

from __future__ import annotations

from math import inf, nan, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor.prediction.bodies import next_pair
from collision_monitor.prediction.body_impact import (
    ImpactQuery,
    Scratch,
    ShapePair,
    Tube,
    Window,
    contact_at,
    make_scratch,
    shape_impact,
)
from collision_monitor.prediction.impact_record import CLEAR
from collision_monitor.prediction.known_axes import AXES, parted_until, remember
from collision_monitor.prediction.motion import (
    MOTION,
    half_acceleration,
    position_now,
    quaternion_to_matrix,
    turn_quaternion,
)
from collision_monitor.prediction.normal_samples import PILOT
from collision_monitor.prediction.sphere_interval import sphere_interval
from collision_monitor.prediction.spread import FIFTH_ROOT, is_uncertain, surface_spread, unknown_acceleration

EARLIEST: Final = 0
MOST_LIKELY: Final = 1
LATEST: Final = 2
PROBABILITY: Final = 3

NODES: Final = 9
"""Times between now and the horizon at which the gap is compared with its uncertainty."""

SAMPLE_TOLERANCE: Final = 0.05
"""Within how many standard deviations of the gap a sample's impact is settled: its probability is off by 0.004."""

PILOT_PART: Final = 0.2
"""A pair that is stated to pass, and met with less than this part of the probability that is told in the coarse lattice
of samples, is left out; and again after each further one."""

OUTWARD: Final = 2.0
"""Standard errors of a quantile by which the earliest time is earlier and the latest later than the samples' own."""


class Room(NamedTuple):
    """Room for one thread's intermediate results."""

    motion: Any  # (2,) MOTION: the two bodies, from now on
    quaternion: Any  # (1, 4)
    rotation: Any  # (2, 3, 3): the stated orientations now
    frame: Any  # (3, 3): rows across the path, along it, and across both
    joint: Any  # (6, 6): covariance of position at the time of closest approach and of velocity, then its root
    block: Any  # (3, 3)
    axes: Any  # (AXES, 4): directions that parted the bodies in other samples
    scratch: Scratch


def make_room() -> Room:
    """Room for one thread."""
    return Room(
        np.zeros(2, MOTION),
        np.zeros((1, 4)),
        np.zeros((2, 3, 3)),
        np.zeros((3, 3)),
        np.zeros((6, 6)),
        np.zeros((3, 3)),
        np.zeros((AXES, 4)),
        make_scratch(),
    )


@device
def carry_on(bodies, i, now, q, m):
    """Body i's last state carried on to `now` as the motion m (MOTION), whose time 0 is now; returns its age (s)."""
    age = 0.0 if bodies.static[i] else now - bodies.time[i]
    m.ax, m.ay, m.az = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
    m.x, m.y, m.z = (
        position_now(bodies, i, age, 0), position_now(bodies, i, age, 1), position_now(bodies, i, age, 2)
    )  # fmt: skip
    m.vx = bodies.linear[i, 0] + m.ax * age
    m.vy = bodies.linear[i, 1] + m.ay * age
    m.vz = bodies.linear[i, 2] + m.az * age
    m.wx, m.wy, m.wz = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    turn_quaternion(bodies.quaternion, i, m.wx, m.wy, m.wz, age, q[0])
    quaternion_to_matrix(q, 0, m.rotation)
    m.time = 0.0
    m.radius = bodies.motion[i].radius
    return age


@device
def _first_contact(multibody, i, j, window, tube, query, room):
    """First time in the window at which bodies i and j are within query.margin and the tube; infinite: never.

    They move as in room.motion, whose time 0 is now; so is the tube's.
    """
    table, parts, bodies = multibody
    A, B = room.motion[0], room.motion[1]
    begin, end = window
    first, last = begin, end
    reach = A.radius + B.radius + query.margin + tube.start
    if reach < inf:
        p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
        bent = half_acceleration(A, B) * end
        first, last = sphere_interval(p, v, reach, tube.growth + bent, end, 1.0)
        if bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0 and bent == 0.0:  # single spheres
            return first
        first = max(first, begin)
        if first > last:
            return inf
    best = inf
    there = Tube(tube.start + tube.growth * first, tube.growth)
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        pair = ShapePair(A, B, a, b)
        status, t, _, _ = shape_impact(table, parts, pair, Window(first, last), there, query, room.scratch)
        if status != CLEAR:
            best = last = t
        a, b = next_pair(parts, first_b, a, b)
    return best


@device
def _gap_at(multibody, i, j, t, room):
    """Signed distance (m) of the shapes of bodies i and j at t; its direction into room.block[0]."""
    table, parts, bodies = multibody
    A, B, out, normal = room.motion[0], room.motion[1], room.scratch.out, room.block[0]
    best = inf
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        gap = contact_at(table, parts, ShapePair(A, B, a, b), t, room.scratch)
        if gap < best:
            best = gap
            normal[0], normal[1], normal[2] = out[1], out[2], out[3]
        a, b = next_pair(parts, first_b, a, b)
    return best


@device
def _set_frame(frame, vx, vy, vz):
    """Complete the frame whose first row is a direction n: the second the part of v across n, the third across both.

    Where the first row is 0 it becomes some direction across v.
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
def _across(x, y, z):
    """A unit vector across (x, y, z); level where that is possible."""
    level = sqrt(x * x + y * y)
    if level > 1e-6 * abs(z):
        return -y / level, x / level, 0.0
    return 1.0, 0.0, 0.0


@device
def _add_covariance(spread, i, age, t, stale_acceleration, planar, room):
    """Add body i's part to room.joint, the covariance of (position t seconds from now, velocity) along the frame.

    The acceleration nobody told acts as an error of the velocity that is right at t.
    """
    at = age + t
    s = unknown_acceleration(spread, i, age > 0.0, 0, stale_acceleration)
    ahead = 0.5 * t if unknown_acceleration(spread, i, False, 0, stale_acceleration) > 0.0 else 0.0
    velocity = s * (age + ahead)
    position = s * 0.5 * age * age + velocity * t
    C, frame, joint, block = spread.covariance, room.frame, room.joint, room.block
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


@device
def _take_root(joint):
    """The lower Cholesky factor of a covariance (6, 6), of which the upper triangle is read, in its place.

    A coordinate without variance of its own gets an empty column.
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


@inlined
def _turn(m, R, w, off, error):
    """Let the motion m (MOTION), which is R and turns at w (3,), be off by error (3,) times `off` (rad now, rad/s)."""
    x, y, z = error
    m.wx, m.wy, m.wz = w[0] + off[1] * x, w[1] + off[1] * y, w[2] + off[1] * z
    dx, dy, dz = off[0] * x, off[0] * y, off[0] * z
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


@device
def _orientation_spread(spread, i, radius, age, t):
    """How an error of the orientation goes on that is one standard deviation t seconds from now: (rad now, rad/s).

    That of a rate which is not known is on average in proportion to how much of the whole it makes; 0, 0 where turning
    moves nothing. age: s since the last state.
    """
    if radius == 0.0:
        return 0.0, 0.0
    at = age + t
    pose, rate = spread.stddev[i, 1] ** 2, spread.stddev[i, 3] ** 2
    turning = (0.5 * FIFTH_ROOT * spread.acceleration[i, 1]) ** 2
    whole = sqrt(pose + (rate + turning * at * at) * at * at)
    if whole == 0.0:
        return 0.0, 0.0
    return (pose + (rate + turning * age * at) * age * at) / whole, (rate + turning * at * (at + age)) * at / whole


@device
def _summarise(times, weights, order, confidence, safe, answer):
    """Quantiles of the samples' times of impact into answer (4,); safe: a time before which hardly any impact is.

    earliest: of the impacts at most 1 - confidence are before; `safe` where there are too few samples to tell.
    Both quantiles are moved outward by what they may be off for so few samples.
    """
    n = 0
    total = squares = all_squares = 0.0
    for k in range(order.size):
        w = weights[order[k]]
        all_squares += w * w
        if times[order[k]] < inf:
            total += w
            squares += w * w
            n += 1
    answer[PROBABILITY] = min(total, 1.0)
    answer[EARLIEST] = answer[MOST_LIKELY] = answer[LATEST] = inf
    if n == 0:
        return
    doubt = 1.0 - confidence
    variance = doubt * confidence
    few = total * (doubt - OUTWARD * sqrt(variance * squares) / total)
    answer[EARLIEST] = min(safe, times[order[0]])
    below = 0.0
    for k in range(n):
        below += weights[order[k]]
        if below > few:
            break
        answer[EARLIEST] = times[order[k]]
    most = confidence + OUTWARD * sqrt(variance * all_squares)
    below = 0.0
    for k in range(n):
        below += weights[order[k]]
        if below >= most:
            answer[LATEST] = times[order[k]]
            break
    # the shortest time in which half of the impacts are
    low = 0
    inside = 0.0
    shortest = inf
    for high in range(n):
        inside += weights[order[high]]
        while inside - weights[order[low]] >= 0.5 * total:
            inside -= weights[order[low]]
            low += 1
        length = times[order[high]] - times[order[low]]
        if inside >= 0.5 * total and length < shortest:
            shortest = length
            answer[MOST_LIKELY] = 0.5 * (times[order[high]] + times[order[low]])


@inlined
def _is_straight(parts, bodies, i, j, A, B):
    """Whether the bodies are a shape each that moves straight and does not turn, and not two spheres."""
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    turns = A.wx != 0.0 or A.wy != 0.0 or A.wz != 0.0 or B.wx != 0.0 or B.wy != 0.0 or B.wz != 0.0
    round = bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0
    turns = turns or half_acceleration(A, B) > 0.0
    return not turns and not round and parts.next[a] < 0 and parts.next[b] < 0


@device
def _lay_along(multibody, i, j, tube, sampling, room):
    """The time that matters most, returned, and the frame to lay the samples along, into room.frame.

    Stated to meet, or two spheres: the closest approach of the centres, and the miss across the path. Else, and where
    a body has no end: where the gap is smallest in standard deviations, the design point of reliability theory.
    """
    bodies, horizon = multibody.bodies, sampling.horizon
    A, B, frame, normal = room.motion[0], room.motion[1], room.frame, room.block[0]
    vx, vy, vz = B.vx - A.vx, B.vy - A.vy, B.vz - A.vz
    px, py, pz = B.x - A.x, B.y - A.y, B.z - A.z
    round = bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0
    t = 0.0
    if (sampling.stated or round) and A.radius + B.radius < inf:
        vv = vx * vx + vy * vy + vz * vz
        if vv > 0.0:
            t = min(max(-(px * vx + py * vy + pz * vz) / vv, 0.0), horizon)
        frame[0, 0], frame[0, 1], frame[0, 2] = px + t * vx, py + t * vy, pz + t * vz
    else:
        least = inf
        for node in range(NODES):
            at = horizon * node / (NODES - 1)
            gap = _gap_at(multibody, i, j, at, room)
            beta = (gap - sampling.query.margin) / max(tube.start + at * tube.growth, 1e-300)
            if beta < least:
                t, least = at, beta
                frame[0, 0], frame[0, 1], frame[0, 2] = normal[0], normal[1], normal[2]
    _set_frame(frame, vx, vy, vz)
    return t


@device
def _shift(room, z, t, p, v):
    """Put body j where sample z (12,) of the errors has it: position p + what is off at t, velocity v + what is off."""
    B, L, F, y = room.motion[1], room.joint, room.frame, room.block
    for r in range(6):
        value = 0.0
        for c in range(r + 1):
            value += L[r, c] * z[c]
        y[r // 3, r % 3] = value
    dx = y[1, 0] * F[0, 0] + y[1, 1] * F[1, 0] + y[1, 2] * F[2, 0]
    dy = y[1, 0] * F[0, 1] + y[1, 1] * F[1, 1] + y[1, 2] * F[2, 1]
    dz = y[1, 0] * F[0, 2] + y[1, 1] * F[1, 2] + y[1, 2] * F[2, 2]
    B.vx, B.vy, B.vz = v[0] + dx, v[1] + dy, v[2] + dz
    B.x = p[0] + y[0, 0] * F[0, 0] + y[0, 1] * F[1, 0] + y[0, 2] * F[2, 0] - t * dx
    B.y = p[1] + y[0, 0] * F[0, 1] + y[0, 1] * F[1, 1] + y[0, 2] * F[2, 1] - t * dy
    B.z = p[2] + y[0, 0] * F[0, 2] + y[0, 1] * F[1, 2] + y[0, 2] * F[2, 2] - t * dz


class Sampling(NamedTuple):
    """How pairs are judged."""

    query: Any  # ImpactQuery
    horizon: float  # s
    stale_acceleration: float  # m/s^2
    stated: bool  # the pairs meet as they are stated to move
    sigmas: float  # standard deviations within which a pair that is not stated to meet has to come near
    safe_sigmas: float  # standard deviations by which larger bodies meet before hardly any impact
    min_probability: float
    confidence: float
    planar: bool
    points: Any  # (S, 12): normal_samples
    weights: Any  # (S,)


@allocating_kernel
def impact_probabilities(multibody, spread, pairs, now, sampling, room, answers):
    """Times and probabilities of impact of pairs (P, 2) of body slots from `now` on into answers (P, 4).

    Left out are pairs that are not stated to meet and do not within `sigmas` standard deviations, or with much less
    than the least probability. NaN: left out, or neither body has declared any uncertainty.
    """
    table, parts, bodies = multibody
    query, horizon, stated = sampling.query, sampling.horizon, sampling.stated
    points, weights, stale_acceleration = sampling.points, sampling.weights, sampling.stale_acceleration
    times = np.empty(weights.size)
    A, B = room.motion[0], room.motion[1]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        answers[k, :] = nan
        if not (is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        age_i = carry_on(bodies, i, now, room.quaternion, A)
        age_j = carry_on(bodies, j, now, room.quaternion, B)
        r_i, r_j = bodies.spin_radius[i], bodies.spin_radius[j]
        now_i, growth_i = surface_spread(spread, i, r_i, age_i, horizon, stale_acceleration)
        now_j, growth_j = surface_spread(spread, j, r_j, age_j, horizon, stale_acceleration)
        tube = Tube(now_i + now_j, growth_i + growth_j)
        coarse = max(query.tolerance, SAMPLE_TOLERANCE * tube.start)
        roughly, whole = ImpactQuery(query.margin, coarse, query.iterations), Window(0.0, horizon)
        if not stated:
            wide = Tube(sampling.sigmas * tube.start, sampling.sigmas * tube.growth)
            if _first_contact(multibody, i, j, whole, wide, roughly, room) == inf:
                continue
        wide = Tube(sampling.safe_sigmas * tube.start, sampling.safe_sigmas * tube.growth)
        safe = _first_contact(multibody, i, j, whole, wide, roughly, room)
        t = _lay_along(multibody, i, j, tube, sampling, room)
        room.joint[:] = 0.0
        if not bodies.static[i]:
            _add_covariance(spread, i, age_i, t, stale_acceleration, sampling.planar, room)
        if not bodies.static[j]:
            _add_covariance(spread, j, age_j, t, stale_acceleration, sampling.planar, room)
        _take_root(room.joint)
        turn_i, turn_j = _orientation_spread(spread, i, r_i, age_i, t), _orientation_spread(spread, j, r_j, age_j, t)
        for r in range(3):
            for c in range(3):
                room.rotation[0, r, c] = A.rotation[r, c]
                room.rotation[1, r, c] = B.rotation[r, c]
        level = 0.0 if sampling.planar else 1.0
        coarse = max(query.tolerance, SAMPLE_TOLERANCE * room.joint[0, 0])
        roughly = ImpactQuery(query.margin, coarse, query.iterations)
        begin = safe if safe < inf else 0.0
        bias = 0.0 if r_i == 0.0 and r_j == 0.0 else -0.75 * coarse
        p, v = (B.x, B.y, B.z), (B.vx, B.vy, B.vz)
        w_i, w_j = (A.wx, A.wy, A.wz), (B.wx, B.wy, B.wz)
        straight = (
            _is_straight(parts, bodies, i, j, A, B)
            and turn_i[0] + turn_i[1] + turn_j[0] + turn_j[1] == 0.0
        )
        room.axes[:, 3] = inf  # none is known
        stride = max(1, weights.size // PILOT)
        seen = 0.0
        likely = True
        for first in range(stride):
            likely = stated or first == 0 or seen * stride >= PILOT_PART * sampling.min_probability * first
            if not likely:
                break
            for n in range(first, weights.size, stride):
                z = points[n]
                _shift(room, z, t, p, v)
                if turn_i[0] + turn_i[1] > 0.0:
                    _turn(A, room.rotation[0], w_i, turn_i, (level * z[6], level * z[7], z[8]))
                if turn_j[0] + turn_j[1] > 0.0:
                    _turn(B, room.rotation[1], w_j, turn_j, (level * z[9], level * z[10], z[11]))
                parted = 0.0
                if straight:
                    parted = parted_until(room.axes, A, B, horizon, query.margin + bias + 0.5 * coarse)
                    if parted == inf:
                        times[n] = inf
                        continue
                window = Window(max(begin, parted), horizon)
                times[n] = _first_contact(multibody, i, j, window, Tube(bias, 0.0), roughly, room)
                if straight:
                    pair = ShapePair(A, B, bodies.first_shape[i], bodies.first_shape[j])
                    remember(table, parts, pair, times[n] == inf, n, room.scratch, room.axes)
                seen += weights[n] if times[n] < inf else 0.0
        if likely:
            _summarise(times, weights, np.argsort(times), sampling.confidence, safe, answers[k])
