"""Box against box by the separating axis test.

Axes 0-2 are A's face normals, 3-5 are B's, 6 + 3 i + j is the cross product of A's edge i and B's edge j.
(Gottschalk, Lin, Manocha, OBBTree, 1996; Ericson, Real-Time Collision Detection, 4.4.1)
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import EDGE, FACE, VERTEX, write
from collision_monitor.narrow_phase.segment import segment_segment
from collision_monitor.tolerances import FACE_PREFERENCE, FEATURE_TIE, PARALLEL_SIN2, SAT_ROUND_OFF


@device
def _edge(best: float, axis: int, sign: float, number: int, dot: float, radius: float, length2: float) -> Any:
    """The better of `best` and the edge axis with projected offset `dot` and radii `radius`, both times its length."""
    gap = abs(dot) - radius
    # compared as squares with the sign kept, so that only an axis that wins costs a root
    if length2 > PARALLEL_SIN2 and gap * abs(gap) > best * abs(best) * length2:
        return gap / sqrt(length2), number, copysign(1.0, dot)
    return best, axis, sign


@device
def sat(
    a0: float, a1: float, a2: float, b0: float, b1: float, b2: float, RA: Any, RB: Any, px: float, py: float, pz: float,
    limit: float,
) -> Any:
    """Largest gap of the 15 axes (m), its axis and sign; a0.. and b0.. are half extents, p = B - A in world axes.

    A negative gap is minus the least translation that parts the boxes. Where a face axis has a gap over `limit` (m),
    that is the answer: most pairs that are apart need no edge axis.
    """
    t0 = RA[0, 0] * px + RA[1, 0] * py + RA[2, 0] * pz
    t1 = RA[0, 1] * px + RA[1, 1] * py + RA[2, 1] * pz
    t2 = RA[0, 2] * px + RA[1, 2] * py + RA[2, 2] * pz
    s0 = RB[0, 0] * px + RB[1, 0] * py + RB[2, 0] * pz
    s1 = RB[0, 1] * px + RB[1, 1] * py + RB[2, 1] * pz
    s2 = RB[0, 2] * px + RB[1, 2] * py + RB[2, 2] * pz
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
    # length2 as the sum of two squares, not as 1 - c^2: that cancels where the edges are nearly parallel
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


@device
def axis_direction(axis: int, sign: float, RA: Any, RB: Any) -> Any:
    """Unit vector of a SAT axis in world axes, times its sign."""
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


@device
def box_box_separation(
    a0: float,
    a1: float,
    a2: float,
    b0: float,
    b1: float,
    b2: float,
    margin: float,
    RA: Any,
    RB: Any,
    px: float,
    py: float,
    pz: float,
    out: Any,
) -> float:
    """Largest SAT gap less the margins and the round-off (m); its direction in out[0:3]."""
    gap, axis, sign = sat(a0, a1, a2, b0, b1, b2, RA, RB, px, py, pz, inf)
    out[0], out[1], out[2] = axis_direction(axis, sign, RA, RB)
    return gap - margin - SAT_ROUND_OFF * (abs(gap) + a0 + a1 + a2 + b0 + b1 + b2)


@device
def _feature(h0: float, h1: float, h2: float, R: Any, nx: float, ny: float, nz: float, tie: float, row: Any) -> int:
    """The vertex, edge or face of a box that is extreme along n: the number of its free axes (0, 1, 2).

    row[0:3] = its centre from the box's centre, world axes; row[3:6] = 0 for a free axis, else the side (-1 or 1).
    """
    row[0] = 0.0
    row[1] = 0.0
    row[2] = 0.0
    free = 0
    for k in range(3):
        h = h0 if k == 0 else (h1 if k == 1 else h2)
        c = R[0, k] * nx + R[1, k] * ny + R[2, k] * nz
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


@device
def _common_point(
    face: Any, free: Any, Rf: Any, f: Any, Ro: Any, o: Any, dx: float, dy: float, dz: float, work: Any
) -> Any:
    """Middle of what a face (rows `face`, half extents f) and another feature (`free`) share, along the face.

    d = face's centre - the feature's centre. Returns the offset of the shared point from the face's centre;
    where round-off leaves nothing shared, the feature's middle pulled into the face.
    """
    i = 0 if face[3] == 0.0 else 1
    j = 2 if face[5] == 0.0 else 1
    hi, hj = f[i], f[j]
    # the feature's corners in the face's two coordinates
    ui = -(Rf[0, i] * dx + Rf[1, i] * dy + Rf[2, i] * dz)
    uj = -(Rf[0, j] * dx + Rf[1, j] * dy + Rf[2, j] * dz)
    start = 16
    work[start] = ui
    work[start + 1] = uj
    count = 1
    for k in range(3):
        if free[3 + k] == 0.0:
            ei = o[k] * (Rf[0, i] * Ro[0, k] + Rf[1, i] * Ro[1, k] + Rf[2, i] * Ro[2, k])
            ej = o[k] * (Rf[0, j] * Ro[0, k] + Rf[1, j] * Ro[1, k] + Rf[2, j] * Ro[2, k])
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
    count = _clip(work, start, start + 64, count, 0, hi)
    count = _clip(work, start, start + 64, count, 1, hj)
    if count == 0:
        ci = min(max(ui, -hi), hi)
        cj = min(max(uj, -hj), hj)
    elif line:
        # clipping walks a segment there and back and repeats its ends: the middle of its extent, not of its points
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
    return ci * Rf[0, i] + cj * Rf[0, j], ci * Rf[1, i] + cj * Rf[1, j], ci * Rf[2, i] + cj * Rf[2, j]


@device
def _describe(row: Any, free: int, out: Any, at: int) -> None:
    """Feature type and index: faces +x -x +y -y +z -z; vertices by their sides as bits; edges 4 axis + sides."""
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


@device
def touching_features(
    a: Any,
    b: Any,
    RA: Any,
    RB: Any,
    px: float,
    py: float,
    pz: float,
    distance: float,
    nx: float,
    ny: float,
    nz: float,
    out: Any,
    work: Any,
) -> None:
    """Witness points and features of two boxes (half extents a, b) that would touch after a move along the normal n.

    Writes the whole contact with the given signed distance.
    """
    tie = FEATURE_TIE * max(max(a[0], a[1], a[2]), max(b[0], b[1], b[2]))
    fa = work[0:6]
    fb = work[6:12]
    na = _feature(a[0], a[1], a[2], RA, nx, ny, nz, tie, fa)
    nb = _feature(b[0], b[1], b[2], RB, -nx, -ny, -nz, tie, fb)
    # B's feature, moved along the normal until it lies in the plane of A's
    bx = px + fb[0] - distance * nx
    by = py + fb[1] - distance * ny
    bz = pz + fb[2] - distance * nz
    if na == 0:
        x, y, z = fa[0], fa[1], fa[2]
    elif nb == 0:
        x, y, z = bx, by, bz
    elif na == 2:
        x, y, z = _common_point(fa, fb, RA, a, RB, b, fa[0] - bx, fa[1] - by, fa[2] - bz, work)
        x, y, z = fa[0] + x, fa[1] + y, fa[2] + z
    elif nb == 2:
        x, y, z = _common_point(fb, fa, RB, b, RA, a, bx - fa[0], by - fa[1], bz - fa[2], work)
        x, y, z = bx + x, by + y, bz + z
    else:
        i = 0 if fa[3] == 0.0 else (1 if fa[4] == 0.0 else 2)
        j = 0 if fb[3] == 0.0 else (1 if fb[4] == 0.0 else 2)
        s, _ = segment_segment(
            a[i] * RA[0, i],
            a[i] * RA[1, i],
            a[i] * RA[2, i],
            b[j] * RB[0, j],
            b[j] * RB[1, j],
            b[j] * RB[2, j],
            bx - fa[0],
            by - fa[1],
            bz - fa[2],
        )
        s *= a[i]
        x, y, z = fa[0] + s * RA[0, i], fa[1] + s * RA[1, i], fa[2] + s * RA[2, i]
    size = a[0] + a[1] + a[2] + b[0] + b[1] + b[2]
    write(out, distance, nx, ny, nz, x, y, z, SAT_ROUND_OFF * (abs(distance) + size) + FACE_PREFERENCE * size)
    _describe(fa, na, out, 11)
    _describe(fb, nb, out, 13)
