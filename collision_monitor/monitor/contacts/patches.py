"""Contacts of several points: where faces or edges lie on each other, one row for each corner of their shared area.

The setting `contact_points` requests them. They need a second examination of the pairs that touch, so a monitor that
reports one point for each contact pays nothing.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, kernel
from collision_monitor.geometry.runs import in_runs
from collision_monitor.impact.body_contact import SHAPE_I, SHAPE_J, STATUS, TOUCHING, closing_now, relative_now
from collision_monitor.impact.mesh_pair import has_mesh
from collision_monitor.monitor.active_pairs import Active
from collision_monitor.motion.bodies import Multibody, next_pair, place_shape
from collision_monitor.motion.last_state import position_now, rotation_now
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.narrow_phase.manifold import CORNERS, manifold_batch, reduce_points
from collision_monitor.narrow_phase.work_memory import work_array
from collision_monitor.records import MOST_POINTS
from collision_monitor.shapes.shape_table import take
from collision_monitor.tolerances import FEATURE_TIE

SHAPE_PAIR = np.dtype(
    [
        ("of", np.int64),  # index of the active pair that the shapes belong to
        ("tie", np.float64),  # m: shapes within this of the contact's distance lie in its plane
        ("slot", np.int32, 2),
        ("position", np.float64, (2, 3)),  # m, about the origin of body i
        ("rotation", np.float64, (2, 3, 3)),
    ]
)


@kernel
def _shape_pairs(multibody: Multibody, active: Active, now: float, scratch: Any, found: Any) -> int:
    """Find the pairs of shapes of each settled contact whose bounding spheres are at least as near as the contact.

    Written into found (m,) SHAPE_PAIR; returns their number. If it exceeds m, the rest is only counted.
    scratch: a quaternion (1, 4) and rotations (4, 3, 3).
    """
    table, parts, bodies = multibody
    pairs, _, results, _ = active
    q, R = scratch
    n = 0
    for k in range(pairs.size):
        if pairs[k].touching == 0 or results[k, STATUS] != TOUCHING:
            continue
        i, j = pairs[k].i, pairs[k].j
        rotation_now(bodies, i, now, q, R[0])
        rotation_now(bodies, j, now, q, R[1])
        px, py, pz = relative_now(bodies, i, j, now).p
        size = 0.0
        for slot in (int(results[k, SHAPE_I]), int(results[k, SHAPE_J])):
            if isfinite(table.radius[slot]):
                size += table.radius[slot]
        near = results[k, DISTANCE] + FEATURE_TIE * size
        a, first_b = bodies.first_shape[i], bodies.first_shape[j]
        b = first_b
        oa = (0.0, 0.0, 0.0)
        while a >= 0:
            if b == first_b:
                oa = place_shape(table, parts, a, R[0], R[2])
            ob = place_shape(table, parts, b, R[1], R[3])
            x, y, z = px + ob[0], py + ob[1], pz + ob[2]
            apart = sqrt((x - oa[0]) ** 2 + (y - oa[1]) ** 2 + (z - oa[2]) ** 2)
            has_faces = not has_mesh(table, a, b)  # which has one contact point
            if has_faces and apart - table.radius[a] - table.radius[b] <= near:
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
            a, b = next_pair(parts, first_b, a, b)
    return n


class _Patches(NamedTuple):
    """The patches of m pairs of shapes, in the order of the active pairs."""

    of: Any  # int64: index of the active pair
    tie: Any  # m
    corners: Any  # (m, 4, 3): about the origin of body i
    count: Any  # int64: number of corners


class _Points(NamedTuple):
    """The points of the contacts of n active pairs."""

    count: Any  # int64
    position: Any  # (n, 4, 3): on A, in the world; only where count > 1
    closing: Any  # (n, 4): closing speeds there (m/s)


@allocating_kernel
def _join(bodies: Any, active: Active, now: float, patches: _Patches, most: int, points: _Points, work: Any) -> None:
    """Join the patches of the shapes of each active pair into its points, at most `most` of them."""
    pairs, _, results, _ = active
    of, tie = patches.of, patches.tie
    corners = np.empty((CORNERS, 3))
    out = np.empty(CONTACT_SIZE)
    begin = 0
    while begin < of.size:
        k = of[begin]
        normal = (results[k, NORMAL], results[k, NORMAL + 1], results[k, NORMAL + 2])
        m = 0
        end = begin
        while end < of.size and of[end] == k:
            if m + MOST_POINTS > CORNERS:
                m = reduce_points(corners, m, normal, tie[begin], MOST_POINTS, work)
            for c in range(patches.count[end]):
                corners[m] = patches.corners[end, c]
                m += 1
            end += 1
        if end - begin > 1 or m > most:
            m = reduce_points(corners, m, normal, tie[begin], most, work)
        begin = end
        if m < 2:
            continue
        points.count[k] = m
        i, j = pairs[k].i, pairs[k].j
        there = relative_now(bodies, i, j, now)
        at = position_now(bodies, i, there.age_i)
        out[:POINT_A] = results[k, :POINT_A]
        for c in range(m):
            for d in range(3):
                out[POINT_A + d] = corners[c, d]
                out[POINT_B + d] = corners[c, d] + out[DISTANCE] * out[NORMAL + d]
                points.position[k, c, d] = corners[c, d] + at[d]
            points.closing[k, c] = closing_now(there, out)


def with_patches(
    contacts: NDArray[np.void], multibody: Multibody, active: Active, now: float, most: int
) -> NDArray[np.void]:
    """Repeat each contact (records.CONTACT) with a patch for each of its points, at most `most` of them.

    The shapes of a compound that touch in the same plane, for example the wheels of a cart, share one patch. A contact
    that is not settled keeps one point.
    """
    pairs, results = active.pairs, active.results
    scratch = np.empty((1, 4)), np.empty((4, 3, 3))
    shapes = np.empty(2 * len(pairs), SHAPE_PAIR)
    n = _shape_pairs(multibody, active, now, scratch, shapes)
    if n > len(shapes):
        shapes = np.empty(n, SHAPE_PAIR)
        _shape_pairs(multibody, active, now, scratch, shapes)
    shapes = shapes[:n]
    of, tie = shapes["of"], shapes["tie"]
    position, rotation = shapes["position"].reshape(-1, 3), shapes["rotation"].reshape(-1, 3, 3)
    two = np.arange(2 * n, dtype=np.int32).reshape(-1, 2)
    placed = take(multibody.table, shapes["slot"].ravel())
    rows = contact_batch(placed, position, rotation, two)
    level = rows[:, DISTANCE] <= results[of, DISTANCE] + tie
    aligned = np.einsum("ij,ij->i", rows[:, NORMAL:POINT_A], results[of, NORMAL:POINT_A])
    level &= aligned >= 1.0 - FEATURE_TIE
    of, tie = of[level], tie[level]
    counts, patch = manifold_batch(placed, position, rotation, two[level], rows[level])
    patch += position[two[level, 0], None]
    patches = _Patches(of, tie, patch, counts)
    n = len(pairs)
    points = _Points(np.ones(n, np.int64), np.empty((n, MOST_POINTS, 3)), np.empty((n, MOST_POINTS)))
    _join(multibody.bodies, active, now, patches, most, points, work_array())
    reported = (pairs["touching"] == 1) | (pairs["touched"] == 1)
    return _repeated(contacts, _Points(*(column[reported] for column in points)))


def _repeated(contacts: NDArray[np.void], points: _Points) -> NDArray[np.void]:
    """Repeat each contact for each of its points, and set the points and closing speeds where there are several."""
    count = points.count
    of, index = in_runs(count)
    rows = contacts.take(of)
    rows["point_index"], rows["point_count"] = index, count[of]
    some = np.flatnonzero(count[of] > 1)
    at = of[some], index[some]
    rows["point_a"][some], rows["closing_speed"][some] = points.position[at], points.closing[at]
    rows["point_b"][some] = points.position[at] + rows["signed_distance"][some, None] * rows["normal"][some]
    return rows
