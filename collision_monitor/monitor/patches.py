"""Contacts of several points: where faces or edges lie on each other, a row for each corner of what they share.

Asked for by the setting `contact_points`. The pairs that touch are looked at once more, so that a monitor that tells
one point of each pays nothing.
"""

from __future__ import annotations

from math import isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel
from collision_monitor.geometry.shape_table import ShapeTable, take
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.narrow_phase.manifold import CORNERS, manifold_batch, reduce_points
from collision_monitor.narrow_phase.work_memory import work_array
from collision_monitor.prediction.body_contact import SHAPE_I, SHAPE_J, STATUS, TOUCHING
from collision_monitor.prediction.body_impact import closing_speed
from collision_monitor.prediction.motion import (
    Bodies,
    Parts,
    place_shape,
    position_now,
    relative_now,
    relative_velocity_now,
    rotation_now,
)
from collision_monitor.records import MOST_POINTS
from collision_monitor.tolerances import FEATURE_TIE

SHAPE_PAIR = np.dtype(
    [
        ("of", np.int64),  # the pair of bodies that they belong to
        ("tie", np.float64),  # m: what is deeper than the contact less this lies in its plane
        ("slot", np.int32, 2),
        ("position", np.float64, (2, 3)),  # m, about the origin of body i
        ("rotation", np.float64, (2, 3, 3)),
    ]
)


@allocating_kernel
def _shape_pairs(table, parts, bodies, pairs, results, now, found):
    """The shapes of each settled contact whose bounding spheres come as near as it: found (m,) SHAPE_PAIR; how many.

    Where that is more than there is room for, the rest is only counted.
    """
    q = np.empty((1, 4))
    R = np.empty((4, 3, 3))
    n = 0
    for k in range(pairs.size):
        if pairs[k].touching == 0 or results[k, STATUS] != TOUCHING:
            continue
        i, j = pairs[k].i, pairs[k].j
        rotation_now(bodies, i, now, q, R[0])
        rotation_now(bodies, j, now, q, R[1])
        px, py, pz, _, _ = relative_now(bodies, i, j, now)
        size = 0.0
        for slot in (int(results[k, SHAPE_I]), int(results[k, SHAPE_J])):
            if isfinite(table.radius[slot]):
                size += table.radius[slot]
        near = results[k, 0] + FEATURE_TIE * size
        a = bodies.first_shape[i]
        while a >= 0:
            oa = place_shape(table, parts, a, R[0], R[2])
            b = bodies.first_shape[j]
            while b >= 0:
                ob = place_shape(table, parts, b, R[1], R[3])
                x, y, z = px + ob[0], py + ob[1], pz + ob[2]
                apart = sqrt((x - oa[0]) ** 2 + (y - oa[1]) ** 2 + (z - oa[2]) ** 2)
                if apart - table.radius[a] - table.radius[b] <= near:
                    if n < found.size:
                        found[n].of, found[n].tie = k, FEATURE_TIE * size
                        found[n].slot[0], found[n].slot[1] = a, b
                        for c in range(3):
                            found[n].position[0, c] = oa[c]
                            for d in range(3):
                                found[n].rotation[0, c, d] = R[2, c, d]
                                found[n].rotation[1, c, d] = R[3, c, d]
                        found[n].position[1, 0], found[n].position[1, 1], found[n].position[1, 2] = x, y, z
                    n += 1
                b = parts.next[b]
            a = parts.next[a]
    return n


@allocating_kernel
def _join(bodies, pairs, results, now, of, tie, patch, counts, most, count, points, closing, work):
    """Of the patches (m, 4, 3) of the shapes of each pair, at most `most` corners: count (n,), and for those of several
    points (n, 4, 3) in the world and the closing speeds (n, 4) there."""
    corners = np.empty((CORNERS, 3))
    out = np.empty(10)
    begin = 0
    while begin < of.size:
        k = of[begin]
        normal = (results[k, 1], results[k, 2], results[k, 3])
        m = 0
        end = begin
        while end < of.size and of[end] == k:
            if m + MOST_POINTS > CORNERS:
                m = reduce_points(corners, m, normal, tie[begin], MOST_POINTS, work)
            for c in range(counts[end]):
                corners[m] = patch[end, c]
                m += 1
            end += 1
        if end - begin > 1 or m > most:
            m = reduce_points(corners, m, normal, tie[begin], most, work)
        begin = end
        if m < 2:
            continue
        count[k] = m
        i, j = pairs[k].i, pairs[k].j
        px, py, pz, age, age_j = relative_now(bodies, i, j, now)
        v = (
            relative_velocity_now(bodies, i, age, j, age_j, 0),
            relative_velocity_now(bodies, i, age, j, age_j, 1),
            relative_velocity_now(bodies, i, age, j, age_j, 2),
        )
        wa = (bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2])
        wb = (bodies.angular[j, 0], bodies.angular[j, 1], bodies.angular[j, 2])
        out[:4] = results[k, :4]
        for c in range(m):
            for d in range(3):
                out[4 + d] = corners[c, d]
                out[7 + d] = corners[c, d] + out[0] * out[1 + d]
                points[k, c, d] = corners[c, d] + position_now(bodies, i, age, d)
            closing[k, c] = closing_speed(v, wa, wb, px, py, pz, out)


def with_patches(
    contacts: NDArray[np.void],
    table: ShapeTable,
    parts: Parts,
    bodies: Bodies,
    pairs: NDArray[np.void],
    results: NDArray[np.float64],
    now: float,
    most: int,
) -> NDArray[np.void]:
    """The contacts (records.CONTACT) of the active pairs, those with a patch as at most `most` rows, one by one.

    The shapes of a compound that lie in the same plane have one patch: the wheels of a cart. A contact that is not
    settled has one point.
    """
    shapes = np.empty(2 * len(pairs), SHAPE_PAIR)
    n = _shape_pairs(table, parts, bodies, pairs, results, now, shapes)
    if n > len(shapes):
        shapes = np.empty(n, SHAPE_PAIR)
        _shape_pairs(table, parts, bodies, pairs, results, now, shapes)
    shapes = shapes[:n]
    of, tie = shapes["of"], shapes["tie"]
    position, rotation = shapes["position"].reshape(-1, 3), shapes["rotation"].reshape(-1, 3, 3)
    two = np.arange(2 * n, dtype=np.int32).reshape(-1, 2)
    placed = take(table, shapes["slot"].ravel())
    rows = contact_batch(placed, position, rotation, two)
    level = rows[:, 0] <= results[of, 0] + tie
    level &= np.einsum("ij,ij->i", rows[:, 1:4], results[of, 1:4]) >= 1.0 - FEATURE_TIE
    of, tie = of[level], tie[level]
    counts, patch = manifold_batch(placed, position, rotation, two[level], rows[level])
    patch += position[two[level, 0], None]
    count = np.ones(len(pairs), np.int64)
    points, closing = np.empty((len(pairs), MOST_POINTS, 3)), np.empty((len(pairs), MOST_POINTS))
    _join(bodies, pairs, results, now, of, tie, patch, counts, most, count, points, closing, work_array())
    told = (pairs["touching"] == 1) | (pairs["touched"] == 1)
    return _repeated(contacts, count[told], points[told], closing[told])


def _repeated(
    contacts: NDArray[np.void], count: NDArray[np.int64], points: NDArray[np.float64], closing: NDArray[np.float64]
) -> NDArray[np.void]:
    """Each contact `count` times, those of several with their points on A and closing speeds."""
    of = np.repeat(np.arange(len(contacts)), count)
    index = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    rows = contacts.take(of)
    rows["point_index"], rows["point_count"] = index, count[of]
    some = np.flatnonzero(count[of] > 1)
    at = of[some], index[some]
    rows["point_a"][some], rows["closing_speed"][some] = points[at], closing[at]
    rows["point_b"][some] = points[at] + rows["signed_distance"][some, None] * rows["normal"][some]
    return rows
