"""Contacts that persist, carried over to the next step while their pair has hardly moved (`distance_tolerance`).

A signed distance of convex shapes grows by at most the distance that the origins move relative to each other, plus
the angle that each body turns times its radius, because every point of the surfaces moves by no more than that. It is
at least the gap along the old normal, which changes by the motion along it, minus the same angles times the radii. An
answer is carried over, to the middle of this range, while half of the range is within the tolerance and the pair
certainly touches; half of the range is added to the error of the answer. Its witness points move with the bodies.
An answer that the motion of the pair would end before the next step is not kept.
Contacts of two meshes are carried over by their triangles (carried_triangles.py). Those of compounds and of other
concave shapes are answered anew in every step.
"""

from __future__ import annotations

from math import nan, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.impact.body_contact import RESULT, STATUS, TOUCHING, closing_now, relative_now, widening
from collision_monitor.impact.body_impact import CLOSING
from collision_monitor.impact.mesh_pair import has_mesh
from collision_monitor.monitor.contacts.carried_triangles import (
    NO_MESH,
    NONE,
    PLACE_I,
    PLACE_J,
    carry_triangles,
    lasts,
    meets_by_trees,
    turning,
)
from collision_monitor.motion.last_state import age_of, position_now, quaternion_now
from collision_monitor.motion.motion import chord_angle
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B

RELATIVE: Final = RESULT
TURN_I: Final = RESULT + 3
TURN_J: Final = RESULT + 7
CARRIED: Final = PLACE_J + 1
"""Numbers of a carried row: a result row, whose points are about the bodies' origins and whose bound lacks the widening
of stale states; the position of j's origin from i's (m); both quaternions, all at the time of the answer; and what
carried_triangles.py keeps. Its distance is NaN if there is no answer to carry."""

NORMAL_ERROR: Final = 1e-6
"""Largest error of a normal (rad); those of round surfaces are off by up to 1e-7."""


class Carrying(NamedTuple):
    """For how long contacts are carried over."""

    tolerance: Any  # m: largest error that this may add; 0: every contact is computed in every step
    period: Any  # s since the step before, which the next step is expected to take as well


def no_answers() -> NDArray[np.float64]:
    """Return no rows."""
    return np.empty((0, CARRIED))


def saved(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Copy the rows (n, CARRIED); those without an answer become NaN, because their other numbers are arbitrary."""
    copy = rows.copy()
    copy[np.isnan(rows[:, DISTANCE])] = nan
    return copy


@inlined
def has_answer(row: Any) -> bool:
    """Whether there is an answer to carry in a carried row."""
    return row[DISTANCE] == row[DISTANCE]


@inlined
def _turned(bodies: Any, i: int, now: float, row: Any, at: int, q: Any) -> float:
    """Distance (m) that the surface of body i has turned since the answer. q (4,): scratch."""
    radius = bodies.spin_radius[i]
    if radius == 0.0:
        return 0.0
    quaternion_now(bodies, i, age_of(bodies, i, now), q)
    angle = chord_angle(row[at], row[at + 1], row[at + 2], row[at + 3], q[0], q[1], q[2], q[3])
    return angle * radius if angle > 0.0 else 0.0


@inlined
def carry_contact(
    multibody: Any, i: int, j: int, now: float, query: Any, tolerance: float, scratch: Any, row: Any, result: Any
) -> bool:
    """Write the contact of bodies i and j into a result row, from their carried row, if that still holds.

    query: ContactQuery. tolerance: largest error (m) that this may add. Returns whether it holds.
    """
    if not has_answer(row):
        return False
    bodies, q = multibody.bodies, scratch.quaternion[0]
    relative = relative_now(bodies, i, j, now)
    x, y, z = relative.p[0] - row[RELATIVE], relative.p[1] - row[RELATIVE + 1], relative.p[2] - row[RELATIVE + 2]
    moved = sqrt(x * x + y * y + z * z)
    if row[PLACE_I] != NO_MESH:
        moved += _turned(bodies, i, now, row, TURN_I, q) + _turned(bodies, j, now, row, TURN_J, q)
        return carry_triangles(multibody, i, j, now, relative, moved, query, tolerance, scratch, row, result)
    along = x * row[NORMAL] + y * row[NORMAL + 1] + z * row[NORMAL + 2] - NORMAL_ERROR * moved
    half = 0.5 * (moved - along)
    if not half <= tolerance:
        return False
    turned = _turned(bodies, i, now, row, TURN_I, q) + _turned(bodies, j, now, row, TURN_J, q)
    half += turned
    excess = bodies.excess[i] + bodies.excess[j]
    if not (half <= tolerance and row[DISTANCE] + excess + moved + turned <= query.margin):
        return False
    for c in range(RESULT):
        result[c] = row[c]
    result[DISTANCE] += 0.5 * (moved + along)
    for c in range(3):
        result[POINT_B + c] += relative.p[c]  # `closing_now` takes both points about body i
    result[CLOSING] = closing_now(relative, result)
    result[BOUND] += half + widening(relative, query.stale_acceleration)
    at_i, at_j = position_now(bodies, i, relative.age_i), position_now(bodies, j, relative.age_j)
    for c in range(3):
        result[POINT_A + c] = row[POINT_A + c] + at_i[c]
        result[POINT_B + c] = row[POINT_B + c] + at_j[c]
    return True


@inlined
def _is_convex(multibody: Any, i: int) -> bool:
    """Whether all shapes of body i are convex, and are the object itself."""
    table, parts, bodies = multibody
    convex = not bodies.concave[i]
    s = bodies.first_shape[i]
    while s >= 0:
        convex = convex and not has_mesh(table, s, s)
        s = parts.next[s]
    return convex


@inlined
def _outlasts(bodies: Any, i: int, j: int, v: Vector, n: Any, carrying: Carrying) -> bool:
    """Whether an answer with normal n of bodies with relative velocity v (m/s) will hold after one more period."""
    along = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    half = 0.5 * (sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) - along)
    return (half + turning(bodies, i) + turning(bodies, j)) * carrying.period <= carrying.tolerance


@inlined
def keep(
    multibody: Any, i: int, j: int, touching: bool, now: float, query: Any, carrying: Carrying, scratch: Any,
    result: Any, row: Any, spread: float,
) -> None:  # fmt: skip
    """Write the carried row of bodies i and j from their result row, if that may be carried.

    spread: by how much the distance of the deepest triangles may differ (m), of two meshes.
    """
    row[DISTANCE] = nan
    if not (touching and result[STATUS] == TOUCHING):
        return
    bodies, q = multibody.bodies, scratch.quaternion[0]
    relative = relative_now(bodies, i, j, now)
    are_plain = bodies.plain[i] != 0 and bodies.plain[j] != 0
    by_trees = not are_plain and result[DISTANCE] <= 0.0 and meets_by_trees(multibody, i, j)
    if by_trees:
        if not lasts(bodies, i, j, relative.v, carrying):
            return
    else:
        if not _outlasts(bodies, i, j, relative.v, result[NORMAL : NORMAL + 3], carrying):
            return
        if not (are_plain or (_is_convex(multibody, i) and _is_convex(multibody, j))):
            return
    for c in range(RESULT):
        row[c] = result[c]
    row[PLACE_I] = row[PLACE_J] = NONE if by_trees else NO_MESH
    row[BOUND] = spread if by_trees else row[BOUND] - widening(relative, query.stale_acceleration)
    at_i, at_j = position_now(bodies, i, relative.age_i), position_now(bodies, j, relative.age_j)
    for c in range(3):
        row[POINT_A + c] -= at_i[c]
        row[POINT_B + c] -= at_j[c]
        row[RELATIVE + c] = relative.p[c]
    for body, at in ((i, TURN_I), (j, TURN_J)):
        quaternion_now(bodies, body, age_of(bodies, body, now), q)
        for c in range(4):
            row[at + c] = q[c]
