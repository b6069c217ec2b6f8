"""Contacts that persist, carried over to the next step while their pair has hardly moved (`distance_tolerance`).

A signed distance of convex shapes grows by at most the distance that the origins move relative to each other, plus
the angle that each body turns times its radius, because every point of the surfaces moves by no more than that. It is
at least the gap along the old normal, which changes by the motion along it, minus the same angles times the radii. An
answer is carried over, to the middle of this range, while half of the range is within the tolerance and the pair
certainly touches; half of the range is added to the error of the answer. Its witness points move with the bodies.
Contacts of meshes, compounds and other concave shapes are answered anew in every step, because their distance has no
such bounds.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined, kernel
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.prediction.body_contact import RESULT, STATUS, TOUCHING, closing_now, relative_now, widening
from collision_monitor.prediction.body_impact import CLOSING
from collision_monitor.prediction.mesh_pair import has_mesh
from collision_monitor.prediction.motion import age_of, chord_angle, position_now, turn_quaternion

RELATIVE: Final = RESULT
TURN_I: Final = RESULT + 3
TURN_J: Final = RESULT + 7
CARRIED: Final = RESULT + 11
"""Numbers of a carried row: a result row, whose points are about the bodies' origins and whose bound lacks the widening
of stale states; the position of j's origin from i's (m); and both quaternions, all at the time of the answer."""

NORMAL_ERROR: Final = 1e-6
"""Largest error of a normal (rad); those of round surfaces are off by up to 1e-7."""


class Carried(NamedTuple):
    """Answers of the pairs that touched in the last step."""

    keys: Any  # (m,) uint64, sorted
    rows: Any  # (m, CARRIED)


def no_answers() -> Carried:
    """Return an empty record."""
    return Carried(np.zeros(0, np.uint64), np.zeros((0, CARRIED)))


def without(carried: Carried, object_id: int) -> Carried:
    """Return the answers without those of an object, whose shapes have changed."""
    high, low = carried.keys >> np.uint64(32), carried.keys & np.uint64(0xFFFFFFFF)
    kept = (high != object_id) & (low != object_id)
    return Carried(carried.keys[kept], carried.rows[kept])


def carry_over(
    step: StepContext, carried: Carried, pairs: NDArray[np.void], results: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Answer the active pairs (n,) that the carried answers still hold for.

    Returns the indices of the others, and for each pair (n,) the place of its carried answer, or -1.
    """
    source, left = np.empty(len(pairs), np.int32), np.empty(len(pairs), np.intp)
    query, tolerance = step.settings.contact, step.profile.distance_tolerance
    count = carry(step.roster.bodies, pairs, carried, step.now, query, tolerance, results, source, left, np.empty(4))
    return left[:count], source


def remember(
    step: StepContext,
    carried: Carried,
    pairs: NDArray[np.void],
    results: NDArray[np.float64],
    source: NDArray[np.int32],
) -> Carried:
    """Return the answers of the pairs (n,) that touch now: those that were carried, and the new ones."""
    new = Carried(np.empty(len(pairs), np.uint64), np.empty((len(pairs), CARRIED)))
    query = step.settings.contact
    count = keep_answers(step.roster.multibody, pairs, results, source, carried, step.now, query, new, np.empty(4))
    return Carried(new.keys[:count], new.rows[:count])


@inlined
def _turn_now(bodies, i, now, q):
    wx, wy, wz = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    turn_quaternion(bodies.quaternion, i, wx, wy, wz, age_of(bodies, i, now), q)


@inlined
def _turned(row, at, q, radius):
    """Distance (m) that a surface within `radius` of the origin has turned since the answer."""
    angle = chord_angle(row[at], row[at + 1], row[at + 2], row[at + 3], q[0], q[1], q[2], q[3])
    return angle * radius if angle > 0.0 else 0.0


@kernel
def carry(bodies, pairs, carried, now, query, tolerance, results, source, left, q):
    """See `carry_over`; returns the number of pairs left. q (4,): scratch."""
    keys, rows = carried
    n = at = 0
    for k in range(pairs.size):
        source[k] = -1
        left[n] = k
        n += 1
        while at < keys.size and keys[at] < pairs[k].key:
            at += 1
        if pairs[k].touched == 0 or at >= keys.size or keys[at] != pairs[k].key:
            continue
        i, j = pairs[k].i, pairs[k].j
        row = rows[at]
        result = results[k]
        relative = relative_now(bodies, i, j, now)
        x, y, z = relative.p[0] - row[RELATIVE], relative.p[1] - row[RELATIVE + 1], relative.p[2] - row[RELATIVE + 2]
        moved = sqrt(x * x + y * y + z * z)
        along = x * row[NORMAL] + y * row[NORMAL + 1] + z * row[NORMAL + 2] - NORMAL_ERROR * moved
        half = 0.5 * (moved - along)
        if not half <= tolerance:
            continue
        turned = 0.0
        for body, start in ((i, TURN_I), (j, TURN_J)):
            if bodies.spin_radius[body] > 0.0:
                _turn_now(bodies, body, now, q)
                turned += _turned(row, start, q, bodies.spin_radius[body])
        half += turned
        excess = bodies.excess[i] + bodies.excess[j]
        if not (half <= tolerance and row[DISTANCE] + excess + moved + turned <= query.margin):
            continue
        for c in range(RESULT):
            result[c] = row[c]
        result[DISTANCE] += 0.5 * (moved + along)
        for c in range(3):
            result[POINT_B + c] += relative.p[c]  # `closing_now` takes both points about body i
        result[CLOSING] = closing_now(bodies, i, j, relative, result)
        result[BOUND] += half + widening(relative, query.stale_acceleration)
        for c in range(3):
            result[POINT_A + c] = row[POINT_A + c] + position_now(bodies, i, relative.age_i, c)
            result[POINT_B + c] = row[POINT_B + c] + position_now(bodies, j, relative.age_j, c)
        pairs[k].touching, pairs[k].leaving = 1, 0
        source[k] = at
        n -= 1
    return n


@inlined
def _is_convex(multibody, i):
    """Whether all shapes of body i are convex, and are the object itself."""
    table, parts, bodies = multibody
    convex = not bodies.concave[i]
    s = bodies.first_shape[i]
    while s >= 0:
        convex = convex and not has_mesh(table, s, s)
        s = parts.next[s]
    return convex


@kernel
def keep_answers(multibody, pairs, results, source, carried, now, query, new, q):
    """See `remember`; returns the number of answers. q (4,): scratch."""
    bodies = multibody.bodies
    n = 0
    for k in range(pairs.size):
        i, j = pairs[k].i, pairs[k].j
        result, row = results[k], new.rows[n]
        if pairs[k].touching == 0 or result[STATUS] != TOUCHING:
            continue
        if source[k] < 0 and not (_is_convex(multibody, i) and _is_convex(multibody, j)):
            continue
        new.keys[n] = pairs[k].key
        n += 1
        if source[k] >= 0:
            for c in range(CARRIED):
                row[c] = carried.rows[source[k], c]
            continue
        relative = relative_now(bodies, i, j, now)
        for c in range(RESULT):
            row[c] = result[c]
        row[BOUND] -= widening(relative, query.stale_acceleration)
        for c in range(3):
            row[POINT_A + c] -= position_now(bodies, i, relative.age_i, c)
            row[POINT_B + c] -= position_now(bodies, j, relative.age_j, c)
            row[RELATIVE + c] = relative.p[c]
        for body, at in ((i, TURN_I), (j, TURN_J)):
            _turn_now(bodies, body, now, q)
            for c in range(4):
                row[at + c] = q[c]
    return n
