"""Box against box by the separating axis test.

Axes 0-2 are A's face normals, 3-5 are B's, 6 + 3 i + j is the cross product of A's edge i and B's edge j.
(Gottschalk, Lin, Manocha, OBBTree, 1996; Ericson, Real-Time Collision Detection, 4.4.1)
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import (
    Vector,
    along,
    column,
    cross,
    dot,
    minus,
    opposite,
    plus,
    rotate_back,
    scaled,
)
from collision_monitor.narrow_phase.contact_row import (
    DISTANCE,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
    write,
)
from collision_monitor.narrow_phase.convex_convex import convex_contact
from collision_monitor.narrow_phase.core import half_extents
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.segment import segment_segment
from collision_monitor.shapes.feature_types import EDGE, FACE, VERTEX
from collision_monitor.tolerances import FACE_PREFERENCE, FEATURE_TIE, PARALLEL_SIN2, SAT_ROUND_OFF

# Sections of the scratch memory: the features, and two polygons of rows (u, v).
_FEATURE_A, _FEATURE_B, _POLYGON, _CLIPPED = 0, 6, 16, 80


class BoxFeature(NamedTuple):
    """A vertex, edge or face of a box."""

    half: Any  # (3,): half extents of the box
    R: Any  # (3, 3): rotation of the box to world axes
    row: Any  # (6,): its centre relative to the box's, world axes (m); the side (-1, 1) of each axis, 0 for a free axis


@device
def _edge(best: float, axis: int, sign: float, number: int, dot: float, radius: float, length2: float) -> Any:
    """Better of the best axis and an edge axis; its projected offset `dot` and radii `radius` are times its length."""
    gap = abs(dot) - radius
    # compare signed squares, so that only an axis that wins costs a root
    if length2 > PARALLEL_SIN2 and gap * abs(gap) > best * abs(best) * length2:
        return gap / sqrt(length2), number, copysign(1.0, dot)
    return best, axis, sign


@inlined
def sat(a: Vector, b: Vector, pose: PairPose, limit: float) -> Any:
    """Largest gap of the 15 axes (m), its axis and sign; a and b are half extents (3,) in m.

    A negative gap is minus the shortest translation that parts the boxes. If the largest gap of the face axes exceeds
    `limit` (m), it is returned with the sign 1, because most pairs that are apart need no edge axis.
    """
    RA, RB = pose.R_A, pose.R_B
    a0, a1, a2 = a
    b0, b1, b2 = b
    t0, t1, t2 = rotate_back(RA, pose.p)
    s0, s1, s2 = rotate_back(RB, pose.p)
    c00 = RA[0, 0] * RB[0, 0] + RA[1, 0] * RB[1, 0] + RA[2, 0] * RB[2, 0]
    c01 = RA[0, 0] * RB[0, 1] + RA[1, 0] * RB[1, 1] + RA[2, 0] * RB[2, 1]
    c02 = RA[0, 0] * RB[0, 2] + RA[1, 0] * RB[1, 2] + RA[2, 0] * RB[2, 2]
    c10 = RA[0, 1] * RB[0, 0] + RA[1, 1] * RB[1, 0] + RA[2, 1] * RB[2, 0]
    c11 = RA[0, 1] * RB[0, 1] + RA[1, 1] * RB[1, 1] + RA[2, 1] * RB[2, 1]
    c12 = RA[0, 1] * RB[0, 2] + RA[1, 1] * RB[1, 2] + RA[2, 1] * RB[2, 2]
    c20 = RA[0, 2] * RB[0, 0] + RA[1, 2] * RB[1, 0] + RA[2, 2] * RB[2, 0]
    c21 = RA[0, 2] * RB[0, 1] + RA[1, 2] * RB[1, 1] + RA[2, 2] * RB[2, 1]
    c22 = RA[0, 2] * RB[0, 2] + RA[1, 2] * RB[1, 2] + RA[2, 2] * RB[2, 2]
    q00, q01, q02 = abs(c00), abs(c01), abs(c02)
    q10, q11, q12 = abs(c10), abs(c11), abs(c12)
    q20, q21, q22 = abs(c20), abs(c21), abs(c22)

    best = abs(t0) - (a0 + q00 * b0 + q01 * b1 + q02 * b2)
    axis = 0
    gap = abs(t1) - (a1 + q10 * b0 + q11 * b1 + q12 * b2)
    if gap > best:
        best, axis = gap, 1
    gap = abs(t2) - (a2 + q20 * b0 + q21 * b1 + q22 * b2)
    if gap > best:
        best, axis = gap, 2
    gap = abs(s0) - (b0 + q00 * a0 + q10 * a1 + q20 * a2)
    if gap > best:
        best, axis = gap, 3
    gap = abs(s1) - (b1 + q01 * a0 + q11 * a1 + q21 * a2)
    if gap > best:
        best, axis = gap, 4
    gap = abs(s2) - (b2 + q02 * a0 + q12 * a1 + q22 * a2)
    if gap > best:
        best, axis = gap, 5
    if best > limit:
        return best, axis, 1.0

    face, face_axis = best, axis
    best = face + FACE_PREFERENCE * max(max(a0, a1, a2), max(b0, b1, b2))
    sign = 1.0
    e00, e01, e02 = c00 * c00, c01 * c01, c02 * c02
    e10, e11, e12 = c10 * c10, c11 * c11, c12 * c12
    e20, e21, e22 = c20 * c20, c21 * c21, c22 * c22
    # length2 is a sum of two squares, because 1 - c^2 cancels for nearly parallel edges
    best, axis, sign = _edge(
        best, axis, sign, 6, t2 * c10 - t1 * c20, a1 * q20 + a2 * q10 + b1 * q02 + b2 * q01, e10 + e20
    )
    best, axis, sign = _edge(
        best, axis, sign, 7, t2 * c11 - t1 * c21, a1 * q21 + a2 * q11 + b0 * q02 + b2 * q00, e11 + e21
    )
    best, axis, sign = _edge(
        best, axis, sign, 8, t2 * c12 - t1 * c22, a1 * q22 + a2 * q12 + b0 * q01 + b1 * q00, e12 + e22
    )
    best, axis, sign = _edge(
        best, axis, sign, 9, t0 * c20 - t2 * c00, a0 * q20 + a2 * q00 + b1 * q12 + b2 * q11, e20 + e00
    )
    best, axis, sign = _edge(
        best, axis, sign, 10, t0 * c21 - t2 * c01, a0 * q21 + a2 * q01 + b0 * q12 + b2 * q10, e21 + e01
    )
    best, axis, sign = _edge(
        best, axis, sign, 11, t0 * c22 - t2 * c02, a0 * q22 + a2 * q02 + b0 * q11 + b1 * q10, e22 + e02
    )
    best, axis, sign = _edge(
        best, axis, sign, 12, t1 * c00 - t0 * c10, a0 * q10 + a1 * q00 + b1 * q22 + b2 * q21, e00 + e10
    )
    best, axis, sign = _edge(
        best, axis, sign, 13, t1 * c01 - t0 * c11, a0 * q11 + a1 * q01 + b0 * q22 + b2 * q20, e01 + e11
    )
    best, axis, sign = _edge(
        best, axis, sign, 14, t1 * c02 - t0 * c12, a0 * q12 + a1 * q02 + b0 * q21 + b1 * q20, e02 + e12
    )
    if axis < 6:
        if face_axis == 0:
            dot = t0
        elif face_axis == 1:
            dot = t1
        elif face_axis == 2:
            dot = t2
        elif face_axis == 3:
            dot = s0
        elif face_axis == 4:
            dot = s1
        else:
            dot = s2
        return face, face_axis, copysign(1.0, dot)
    return best, axis, sign


@inlined
def axis_direction(axis: int, sign: float, pose: PairPose) -> Vector:
    """Unit vector of a SAT axis in world axes, times the sign."""
    RA, RB = pose.R_A, pose.R_B
    if axis < 3:
        return sign * RA[0, axis], sign * RA[1, axis], sign * RA[2, axis]
    if axis < 6:
        return sign * RB[0, axis - 3], sign * RB[1, axis - 3], sign * RB[2, axis - 3]
    i = (axis - 6) // 3
    j = (axis - 6) % 3
    x = RA[1, i] * RB[2, j] - RA[2, i] * RB[1, j]
    y = RA[2, i] * RB[0, j] - RA[0, i] * RB[2, j]
    z = RA[0, i] * RB[1, j] - RA[1, i] * RB[0, j]
    scale = sign / sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@inlined
def box_box_separation(a: Vector, b: Vector, margin: float, pose: PairPose, out: Any) -> float:
    """Largest SAT gap minus the margins and the round-off (m), with its unit direction in out[0:3]."""
    gap, axis, sign = sat(a, b, pose, inf)
    out[0], out[1], out[2] = axis_direction(axis, sign, pose)
    return gap - margin - SAT_ROUND_OFF * (abs(gap) + a[0] + a[1] + a[2] + b[0] + b[1] + b[2])


@inlined
def _find(feature: BoxFeature, n: Vector, tie: float) -> int:
    """Fill the row of the feature that is extreme along n; return its number of free axes: 0 vertex, 1 edge, 2 face."""
    row, R = feature.row, feature.R
    row[0] = 0.0
    row[1] = 0.0
    row[2] = 0.0
    free = 0
    for k in range(3):
        h = feature.half[k]
        c = dot(column(R, k), n)
        if abs(c) * h <= tie and h > 0.0 and free < 2:
            row[3 + k] = 0.0
            free += 1
        else:
            row[3 + k] = copysign(1.0, c)
            row[0] += row[3 + k] * h * R[0, k]
            row[1] += row[3 + k] * h * R[1, k]
            row[2] += row[3 + k] * h * R[2, k]
    return free


@device
def _clip(work: Any, source: int, target: int, count: int, column: int, limit: float) -> int:
    """Cut a polygon in the plane (rows of 2 at `source`) to |coordinate `column`| <= limit (Sutherland-Hodgman)."""
    for side in range(2):
        s = 1.0 if side == 0 else -1.0
        kept = 0
        for k in range(count):
            here = source + 2 * k
            there = source + 2 * ((k + 1) % count)
            d0 = limit - s * work[here + column]
            d1 = limit - s * work[there + column]
            if d0 >= 0.0:
                work[target + 2 * kept] = work[here]
                work[target + 2 * kept + 1] = work[here + 1]
                kept += 1
            if (d0 > 0.0 and d1 < 0.0) or (d0 < 0.0 and d1 > 0.0):
                f = d0 / (d0 - d1)
                work[target + 2 * kept] = work[here] + f * (work[there] - work[here])
                work[target + 2 * kept + 1] = work[here + 1] + f * (work[there + 1] - work[here + 1])
                work[target + 2 * kept + column] = s * limit
                kept += 1
        count = kept
        source, target = target, source
    return count


@inlined
def _common_point(face: BoxFeature, other: BoxFeature, d: Vector, work: Any) -> Vector:
    """Middle of the common part of a face and another feature, as an offset (m) from the face's centre in its plane.

    d = face's centre - feature's centre (m). If round-off leaves no common part, the feature's middle is clamped to
    the face.
    """
    i = 0 if face.row[3] == 0.0 else 1
    j = 2 if face.row[5] == 0.0 else 1
    side_i, side_j = column(face.R, i), column(face.R, j)
    hi, hj = face.half[i], face.half[j]
    # the feature's corners in the face's two coordinates
    ui = -dot(side_i, d)
    uj = -dot(side_j, d)
    start = _POLYGON
    work[start] = ui
    work[start + 1] = uj
    count = 1
    for k in range(3):
        if other.row[3 + k] == 0.0:
            edge = column(other.R, k)
            ei = other.half[k] * dot(side_i, edge)
            ej = other.half[k] * dot(side_j, edge)
            # a point becomes a segment, a segment a parallelogram
            for m in range(count):
                far = start + 2 * (2 * count - 1 - m)
                near = start + 2 * m
                work[far] = work[near] + ei
                work[far + 1] = work[near + 1] + ej
                work[near] -= ei
                work[near + 1] -= ej
            count *= 2
    line = count == 2
    count = _clip(work, start, _CLIPPED, count, 0, hi)
    count = _clip(work, start, _CLIPPED, count, 1, hj)
    if count == 0:
        ci = min(max(ui, -hi), hi)
        cj = min(max(uj, -hj), hj)
    elif line:
        # clipping traverses a segment there and back and repeats its ends, so take the middle of its extent
        low_i = high_i = work[start]
        low_j = high_j = work[start + 1]
        for m in range(1, count):
            low_i, high_i = min(low_i, work[start + 2 * m]), max(high_i, work[start + 2 * m])
            low_j, high_j = min(low_j, work[start + 2 * m + 1]), max(high_j, work[start + 2 * m + 1])
        ci = 0.5 * (low_i + high_i)
        cj = 0.5 * (low_j + high_j)
    else:
        ci = 0.0
        cj = 0.0
        for m in range(count):
            ci += work[start + 2 * m]
            cj += work[start + 2 * m + 1]
        ci /= count
        cj /= count
    return along(scaled(side_i, ci), cj, side_j)


@inlined
def _describe(row: Any, free: int, out: Any, at: int) -> None:
    """Write feature type and index: faces +x -x +y -y +z -z; vertices by their sides as bits; edges 4 axis + sides."""
    if free == 0:
        out[at] = VERTEX
        out[at + 1] = (1.0 if row[3] > 0.0 else 0.0) + (2.0 if row[4] > 0.0 else 0.0) + (4.0 if row[5] > 0.0 else 0.0)
    elif free == 1:
        out[at] = EDGE
        for k in range(3):
            if row[3 + k] == 0.0:
                first = 1.0 if row[3 + (k + 1) % 3] > 0.0 else 0.0
                second = 2.0 if row[3 + (k + 2) % 3] > 0.0 else 0.0
                out[at + 1] = 4.0 * k + first + second
    else:
        out[at] = FACE
        for k in range(3):
            if row[3 + k] != 0.0:
                out[at + 1] = 2.0 * k + (0.0 if row[3 + k] > 0.0 else 1.0)


@inlined
def touching_features(a: Any, b: Any, pose: PairPose, distance: float, n: Vector, out: Any, work: Any) -> None:
    """Write the contact of two boxes (half extents a, b) with the given signed distance (m) and normal n.

    Its features are those that touch after a translation by the distance along n.
    """
    tie = FEATURE_TIE * max(max(a[0], a[1], a[2]), max(b[0], b[1], b[2]))
    A = BoxFeature(a, pose.R_A, work[_FEATURE_A : _FEATURE_A + 6])
    B = BoxFeature(b, pose.R_B, work[_FEATURE_B : _FEATURE_B + 6])
    free_a = _find(A, n, tie)
    free_b = _find(B, opposite(n), tie)
    center_a = (A.row[0], A.row[1], A.row[2])
    # B's feature, moved along the normal until it lies in the plane of A's
    px, py, pz = pose.p
    center_b = (
        px + B.row[0] - distance * n[0],
        py + B.row[1] - distance * n[1],
        pz + B.row[2] - distance * n[2],
    )
    if free_a == 0:
        point = center_a
    elif free_b == 0:
        point = center_b
    elif free_a == 2:
        point = plus(center_a, _common_point(A, B, minus(center_a, center_b), work))
    elif free_b == 2:
        point = plus(center_b, _common_point(B, A, minus(center_b, center_a), work))
    else:
        i = 0 if A.row[3] == 0.0 else (1 if A.row[4] == 0.0 else 2)
        j = 0 if B.row[3] == 0.0 else (1 if B.row[4] == 0.0 else 2)
        edge_a, edge_b = column(pose.R_A, i), column(pose.R_B, j)
        s, _ = segment_segment(scaled(edge_a, a[i]), scaled(edge_b, b[j]), minus(center_b, center_a))
        s *= a[i]
        point = along(center_a, s, edge_a)
    size = a[0] + a[1] + a[2] + b[0] + b[1] + b[2]
    write(out, distance, n, point, SAT_ROUND_OFF * (abs(distance) + size) + FACE_PREFERENCE * size)
    _describe(A.row, free_a, out, FEATURE_TYPE_A)
    _describe(B.row, free_b, out, FEATURE_TYPE_B)


@inlined
def box_box_contact(table: Any, a: int, b: int, pose: PairPose, limit: float, out: Any, work: Any) -> bool:
    """Write the contact, computed by SAT, or by GJK if no SAT axis is the direction of the distance.

    Return False, with out undefined, if the distance is certified to exceed `limit` (m).
    """
    ha, hb = table.size[a], table.size[b]
    ma, mb = table.margin[a], table.margin[b]
    reach = limit + ma + mb
    gap, axis, sign = sat(half_extents(table, a), half_extents(table, b), pose, reach)
    if gap > reach:
        return False
    size = max(max(ha[0], ha[1], ha[2]), max(hb[0], hb[1], hb[2]))
    if gap > 0.0:
        if not convex_contact(table, a, b, pose, limit, out, work):
            return False
        if out[DISTANCE] + ma + mb - gap > FACE_PREFERENCE * size:
            return True
    n = axis_direction(axis, sign, pose)
    if gap > 0.0:
        # if corners are nearest, gap and distance can agree to 1e-9 although the corners are beside the axis by 1e-5
        beside = cross((out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]), n)
        if gap * sqrt(dot(beside, beside)) > FEATURE_TIE * size:
            return True
        # the SAT axis is also the direction of the distance, and has no noise however near the boxes are
    touching_features(ha, hb, pose, gap, n, out, work)
    if ma > 0.0 or mb > 0.0:
        out[DISTANCE] -= ma + mb
        for i in range(3):
            out[POINT_A + i] += ma * out[NORMAL + i]
            out[POINT_B + i] -= mb * out[NORMAL + i]
    return True
