"""Penetration depth of two convex cores by the expanding polytope algorithm, with bounds from both sides.

(van den Bergen, Proximity Queries and Penetration Depth Computation, 2001.) The polytope lies inside of B - A, so the
distance of its nearest face bounds the depth from below; the support distance along any direction bounds it from above.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import EDGES, FACES, MAX_FACES, SIMPLEX
from collision_monitor.narrow_phase.gjk import WEIGHTS, closest_on_triangle
from collision_monitor.narrow_phase.segment import across
from collision_monitor.narrow_phase.support import support_difference
from collision_monitor.tolerances import EPSILON, FLAT, SLIVER_SIN2

NX: Final = FACES
NY: Final = FACES + MAX_FACES
NZ: Final = FACES + 2 * MAX_FACES
D: Final = FACES + 3 * MAX_FACES
I: Final = FACES + 4 * MAX_FACES  # noqa: E741
J: Final = FACES + 5 * MAX_FACES
K: Final = FACES + 6 * MAX_FACES
FROM: Final = EDGES
TO: Final = EDGES + 3 * MAX_FACES


@device
def _normal(work: Any, i: int, j: int, k: int) -> Any:
    """Cross product of the edges ij and ik, and the product of their squared lengths."""
    a, b, c = SIMPLEX + 8 * i, SIMPLEX + 8 * j, SIMPLEX + 8 * k
    ux, uy, uz = work[b] - work[a], work[b + 1] - work[a + 1], work[b + 2] - work[a + 2]
    vx, vy, vz = work[c] - work[a], work[c + 1] - work[a + 1], work[c + 2] - work[a + 2]
    return (
        uy * vz - uz * vy,
        uz * vx - ux * vz,
        ux * vy - uy * vx,
        (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz),
    )


@device
def _set_face(work: Any, f: int, i: int, j: int, k: int) -> None:
    """Face f through the points i, j, k, counter-clockwise from outside; a sliver gets distance inf and no normal."""
    nx, ny, nz, product = _normal(work, i, j, k)
    n2 = nx * nx + ny * ny + nz * nz
    work[I + f] = i
    work[J + f] = j
    work[K + f] = k
    if n2 > SLIVER_SIN2 * product:
        inverse = 1.0 / sqrt(n2)
        nx *= inverse
        ny *= inverse
        nz *= inverse
        a = SIMPLEX + 8 * i
        work[D + f] = nx * work[a] + ny * work[a + 1] + nz * work[a + 2]
    else:
        nx = ny = nz = 0.0
        work[D + f] = inf
    work[NX + f] = nx
    work[NY + f] = ny
    work[NZ + f] = nz


@device
def _probe(work: Any, count: int, step: int) -> Any:
    """Unit direction to look in for a point off the first `count` simplex points: 6 steps, then 4, then 2."""
    s = 1.0 if step % 2 == 0 else -1.0
    if count == 1:
        return (
            s if step // 2 == 0 else 0.0,
            s if step // 2 == 1 else 0.0,
            s if step // 2 == 2 else 0.0,
        )
    if count == 2:
        x, y, z = (
            work[SIMPLEX + 8] - work[SIMPLEX],
            work[SIMPLEX + 9] - work[SIMPLEX + 1],
            work[SIMPLEX + 10] - work[SIMPLEX + 2],
        )
        ux, uy, uz = across(x, y, z, 0.0, 0.0, 0.0)
        if step >= 2:
            ux, uy, uz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    else:
        ux, uy, uz, _ = _normal(work, 0, 1, 2)
    length = s * sqrt(ux * ux + uy * uy + uz * uz)
    return ux / length, uy / length, uz / length


@device
def _off(work: Any, count: int, nx: float, ny: float, nz: float) -> float:
    """How far the spare row is off the point, line or plane of the first `count` simplex points; n is the plane's."""
    x = work[SIMPLEX + 32] - work[SIMPLEX]
    y = work[SIMPLEX + 33] - work[SIMPLEX + 1]
    z = work[SIMPLEX + 34] - work[SIMPLEX + 2]
    if count == 3:
        return abs(x * nx + y * ny + z * nz)
    if count == 2:
        ex = work[SIMPLEX + 8] - work[SIMPLEX]
        ey = work[SIMPLEX + 9] - work[SIMPLEX + 1]
        ez = work[SIMPLEX + 10] - work[SIMPLEX + 2]
        f = sqrt(ex * ex + ey * ey + ez * ez)
        x, y, z = (ey * z - ez * y) / f, (ez * x - ex * z) / f, (ex * y - ey * x) / f
    return sqrt(x * x + y * y + z * z)


@device
def _push_edge(work: Any, count: int, i: float, j: float) -> int:
    """Add a directed edge to the horizon, or cancel it against its reverse: it then lies inside of the hole."""
    for e in range(count):
        if work[FROM + e] == j and work[TO + e] == i:
            work[FROM + e] = work[FROM + count - 1]
            work[TO + e] = work[TO + count - 1]
            return count - 1
    work[FROM + count] = i
    work[TO + count] = j
    return count + 1


@device
def epa(
    ka: int,
    a0: float,
    a1: float,
    a2: float,
    sa: int,
    na: int,
    kb: int,
    b0: float,
    b1: float,
    b2: float,
    sb: int,
    nb: int,
    vertices: Any,
    work: Any,
    size: float,
    count: int,
    tolerance: float,
    most: int,
) -> Any:
    """Depth of two cores that overlap or touch, from the `count` simplex points that GJK left, in A's frame.

    Returns (upper, lower, nx, ny, nz, ax, ay, az): bounds of the depth (m), the unit direction from A to B, the
    witness on A. Ends when upper - lower <= tolerance * size (m), or with `most` (<= MAX_VERTICES) points.
    """
    flat = FLAT * size
    # The simplex grows to a tetrahedron by the farthest of a few support points: along the axes from a point,
    # across a line, to both sides of a plane. Where none is off it, B - A is flat: its thin direction is the answer.
    step = 0
    farthest = 0.0
    upper = inf
    mx = my = mz = 0.0
    spare = SIMPLEX + 32
    while count < 4:
        x, y, z = _probe(work, count, step)
        wx, wy, wz = support_difference(
            ka, a0, a1, a2, sa, na, kb, b0, b1, b2, sb, nb, vertices, work, x, y, z, spare
        )
        h = x * wx + y * wy + z * wz
        if h < upper:
            upper = h
            mx, my, mz = x, y, z
        off = _off(work, count, x, y, z)
        if off > farthest:
            farthest = off
            for m in range(8):
                work[SIMPLEX + 8 * count + m] = work[spare + m]
        step += 1
        if step == 8 - 2 * count:
            if farthest <= flat:
                ax = ay = az = 0.0
                for k in range(count):
                    ax += work[WEIGHTS + k] * work[SIMPLEX + 8 * k + 3]
                    ay += work[WEIGHTS + k] * work[SIMPLEX + 8 * k + 4]
                    az += work[WEIGHTS + k] * work[SIMPLEX + 8 * k + 5]
                return upper, min(upper, -flat), -mx, -my, -mz, ax, ay, az
            work[WEIGHTS + count] = 0.0
            count += 1
            step = 0
            farthest = 0.0
            upper = inf
    x, y, z, _ = _normal(work, 0, 1, 2)
    fourth = SIMPLEX + 24
    side = (
        x * (work[fourth] - work[SIMPLEX])
        + y * (work[fourth + 1] - work[SIMPLEX + 1])
        + z * (work[fourth + 2] - work[SIMPLEX + 2])
    )
    p, q = (1, 2) if side < 0.0 else (2, 1)
    _set_face(work, 0, 0, p, q)
    _set_face(work, 1, 0, q, 3)
    _set_face(work, 2, 0, 3, p)
    _set_face(work, 3, p, 3, q)
    faces = 4
    points = 4

    upper = inf
    lower_cap = inf
    lower = -inf
    plane = 0.0
    visible = 8.0 * EPSILON * size
    while points < most:
        near = 0
        for f in range(1, faces):
            if work[D + f] < work[D + near]:
                near = f
        d = work[D + near]
        if not d < inf:
            break
        lower = max(lower, min(d, lower_cap))
        x, y, z = work[NX + near], work[NY + near], work[NZ + near]
        at = SIMPLEX + 8 * points
        wx, wy, wz = support_difference(
            ka, a0, a1, a2, sa, na, kb, b0, b1, b2, sb, nb, vertices, work, x, y, z, at
        )
        h = x * wx + y * wy + z * wz
        if h < upper:
            upper = h
            mx, my, mz = x, y, z
            plane = d
        if upper - lower <= tolerance * size or upper <= d:
            break
        known = False
        for k in range(points):
            r = SIMPLEX + 8 * k
            if work[r] == wx and work[r + 1] == wy and work[r + 2] == wz:
                known = True
                break
        if known or h - d <= visible:
            # a face that round-off tilted: it cannot be expanded, and what it promised is kept as a bound
            lower_cap = min(lower_cap, d)
            work[D + near] = inf
            continue
        edges = 0
        f = 0
        while f < faces:
            if work[NX + f] * wx + work[NY + f] * wy + work[NZ + f] * wz - work[D + f] > visible:
                edges = _push_edge(work, edges, work[I + f], work[J + f])
                edges = _push_edge(work, edges, work[J + f], work[K + f])
                edges = _push_edge(work, edges, work[K + f], work[I + f])
                faces -= 1
                for m in range(7):
                    work[FACES + m * MAX_FACES + f] = work[FACES + m * MAX_FACES + faces]
            else:
                f += 1
        if faces + edges > MAX_FACES:
            break
        for e in range(edges):
            _set_face(work, faces, int(work[FROM + e]), int(work[TO + e]), points)
            faces += 1
        points += 1

    # the witness: where the ray along the answer's normal leaves the polytope, on whichever coplanar face that is
    best = inf
    ax = ay = az = 0.0
    reach = plane + max(upper - plane, 64.0 * EPSILON * size)
    for f in range(faces):
        if work[D + f] <= reach or best == inf:
            i, j, k = SIMPLEX + 8 * int(work[I + f]), SIMPLEX + 8 * int(work[J + f]), SIMPLEX + 8 * int(work[K + f])
            ox, oy, oz = upper * mx, upper * my, upper * mz
            wa, wb, wc = closest_on_triangle(
                work[i] - ox, work[i + 1] - oy, work[i + 2] - oz,
                work[j] - ox, work[j + 1] - oy, work[j + 2] - oz,
                work[k] - ox, work[k + 1] - oy, work[k + 2] - oz,
            )  # fmt: skip
            x = wa * work[i] + wb * work[j] + wc * work[k] - ox
            y = wa * work[i + 1] + wb * work[j + 1] + wc * work[k + 1] - oy
            z = wa * work[i + 2] + wb * work[j + 2] + wc * work[k + 2] - oz
            d2 = x * x + y * y + z * z
            if d2 < best:
                best = d2
                ax = wa * work[i + 3] + wb * work[j + 3] + wc * work[k + 3]
                ay = wa * work[i + 4] + wb * work[j + 4] + wc * work[k + 4]
                az = wa * work[i + 5] + wb * work[j + 5] + wc * work[k + 5]
    return upper, lower, -mx, -my, -mz, ax, ay, az
