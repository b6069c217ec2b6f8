"""The deepest contact of two bodies now, from their last states."""

from __future__ import annotations

from math import inf
from typing import Final

from collision_monitor._jit import device
from collision_monitor.narrow_phase.dispatch import contact_within
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.prediction.body_impact import closing_speed
from collision_monitor.prediction.motion import (
    place_shape,
    position_now,
    relative_position_now,
    relative_velocity_now,
    rotation_now,
)
from collision_monitor.records import ContactStatus

RESULT: Final = 20
"""Numbers for each pair: what narrow_phase.dispatch.pair_contact gives relative to body i, then by name below."""


CLOSING: Final = 15


BOUND: Final = 10


SHAPE_I: Final = 16


SHAPE_J: Final = 17


STATUS: Final = 18


TOUCHING: Final = int(ContactStatus.TOUCHING)


UNRESOLVED: Final = int(ContactStatus.UNRESOLVED)


@device
def body_contact(table, parts, bodies, i, j, now, margin, stale_acceleration, scratch, result):
    """Do bodies i and j touch at `now`, from their last states? The deepest contact of their shapes into result.

    Not heard of for a time, a body may be off by what it could have accelerated, and a coarse model by its excess: the
    bound says so, and a pair that may touch within it counts as touching, UNRESOLVED.
    Returns (touching, narrow-phase tests made).
    """
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], scratch.rotation[2], scratch.rotation[3]
    out = scratch.out
    age_i = rotation_now(bodies, i, now, scratch.quaternion, R_i)
    age_j = rotation_now(bodies, j, now, scratch.quaternion, R_j)
    px = relative_position_now(bodies, i, age_i, j, age_j, 0)
    py = relative_position_now(bodies, i, age_i, j, age_j, 1)
    pz = relative_position_now(bodies, i, age_i, j, age_j, 2)
    widen = 0.5 * stale_acceleration * (age_i * age_i + age_j * age_j)
    wanted = margin + widen
    best = inf
    tests = 0
    reach = bodies.motion[i].radius + bodies.motion[j].radius + wanted
    if px * px + py * py + pz * pz > reach * reach * (1.0 + 1e-14):
        return False, 0
    a = bodies.first_shape[i]
    while a >= 0:
        oa = place_shape(table, parts, a, R_i, R_a)
        b = bodies.first_shape[j]
        while b >= 0:
            ob = place_shape(table, parts, b, R_j, R_b)
            pose = PairPose(R_a, R_b, (px + ob[0] - oa[0], py + ob[1] - oa[1], pz + ob[2] - oa[2]))
            tests += 1
            limit = min(wanted, best)
            if contact_within(table, a, b, pose, limit, out, scratch.work) and out[0] < best:
                best = out[0]
                for c in range(3):
                    out[4 + c] += oa[c]
                    out[7 + c] += oa[c]
                for c in range(15):
                    result[c] = out[c]
                result[SHAPE_I], result[SHAPE_J] = a, b
            b = parts.next[b]
        a = parts.next[a]
    if best == inf:
        return False, tests
    v = (
        relative_velocity_now(bodies, i, age_i, j, age_j, 0),
        relative_velocity_now(bodies, i, age_i, j, age_j, 1),
        relative_velocity_now(bodies, i, age_i, j, age_j, 2),
    )
    wa = (bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2])
    wb = (bodies.angular[j, 0], bodies.angular[j, 1], bodies.angular[j, 2])
    result[CLOSING] = closing_speed(v, wa, wb, px, py, pz, result)
    excess = bodies.excess[i] + bodies.excess[j]
    result[BOUND] += widen + excess
    certain = best + excess <= margin
    if excess > 0.0 and best <= 0.0 and (bodies.concave[i] or bodies.concave[j]):
        result[BOUND] -= best
        certain = excess <= margin
    result[STATUS] = TOUCHING if certain else UNRESOLVED
    for c in range(3):
        at = position_now(bodies, i, age_i, c)
        result[4 + c] += at
        result[7 + c] += at
    return True, tests
