"""Contact manifolds of polytopes and polygons: at most four points where a face or an edge lies on the other shape.

The touching features are the corners within FEATURE_TIE of the supporting planes across the contact's normal. Seen
along the normal they are two convex polygons. The patch is their intersection, and four of its corners represent it.
(Sutherland and Hodgman, 1974, for the clipping; Andrew, 1979, for the outline)
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor.geometry.vector import Vector, cross, dot, minus, opposite, rotate, scaled
from collision_monitor.narrow_phase.contact_row import DISTANCE, NORMAL, POINT_A
from collision_monitor.narrow_phase.pair_pose import PairPose, pair_pose
from collision_monitor.narrow_phase.work_memory import work_array
from collision_monitor.records import MOST_POINTS
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.tolerances import EPSILON, FEATURE_TIE, GJK_TOUCHING, SAT_ROUND_OFF

CORNERS: Final = 512
"""Largest number of corners of one feature; of a face with more, only the first ones are examined."""

# Sections of the scratch memory for polygons, rows of (x, y): A's, B's and two temporary ones. Clipping adds corners.
_ROOM: Final = 8 * CORNERS + 16
_A, _B, _C, _D = 0, _ROOM, 2 * _ROOM, 3 * _ROOM


class Projection(NamedTuple):
    """View along a direction, with two unit vectors perpendicular to it and to each other."""

    along: Any
    u: Any
    v: Any
    origin: Any  # (u, v) of the shape's origin (m)


class Line(NamedTuple):
    """Line in the plane through the point (x, y), along the direction (ux, uy) of any length."""

    x: Any
    y: Any
    ux: Any
    uy: Any


@device
def _basis(n: Vector) -> tuple[Vector, Vector]:
    """Two unit vectors perpendicular to n and to each other, the same for n and -n."""
    nx, ny, nz = n
    if abs(nx) >= abs(ny) and abs(nx) >= abs(nz):
        sign = copysign(1.0, nx)
        ux, uy, uz = -sign * ny, sign * nx, 0.0
    elif abs(ny) >= abs(nz):
        sign = copysign(1.0, ny)
        ux, uy, uz = 0.0, -sign * nz, sign * ny
    else:
        sign = copysign(1.0, nz)
        ux, uy, uz = sign * nz, 0.0, -sign * nx
    length = sqrt(ux * ux + uy * uy + uz * uz)
    u = (ux / length, uy / length, uz / length)
    return u, scaled(cross(n, u), sign)


@device
def _corner(table: Any, slot: int, k: int) -> Any:
    """Corner k of a box, a hull or a polygon in the shape's own frame (m)."""
    if table.kind[slot] == BOX:
        return (
            copysign(table.size[slot, 0], (k & 1) - 0.5),
            copysign(table.size[slot, 1], (k & 2) - 1.0),
            copysign(table.size[slot, 2], (k & 4) - 2.0),
        )
    at = table.vertex_start[slot] + k
    return table.vertices[0, at], table.vertices[1, at], table.vertices[2, at]


@device
def _outline(work: Any, at: int, count: int, tie: float) -> int:
    """Replace points (count rows of 2 at `at`) by their convex outline, counter-clockwise, and return its size.

    Corners that protrude by at most `tie` (m) are dropped. Andrew's monotone chain, with insertion sort.
    """
    for k in range(1, count):
        x, y = work[at + 2 * k], work[at + 2 * k + 1]
        j = k - 1
        while j >= 0 and (work[at + 2 * j] > x or (work[at + 2 * j] == x and work[at + 2 * j + 1] > y)):
            work[at + 2 * j + 2], work[at + 2 * j + 3] = work[at + 2 * j], work[at + 2 * j + 1]
            j -= 1
        work[at + 2 * j + 2], work[at + 2 * j + 3] = x, y
    kept = 0
    for turn in range(2):  # along the lower side, and back along the upper one
        first = kept
        for step in range(count):
            k = step if turn == 0 else count - 1 - step
            x, y = work[at + 2 * k], work[at + 2 * k + 1]
            while kept - first >= 2:
                p, q = _C + 2 * (kept - 2), _C + 2 * (kept - 1)
                ux, uy = x - work[p], y - work[p + 1]
                if (work[q] - work[p]) * uy - (work[q + 1] - work[p + 1]) * ux > tie * sqrt(ux * ux + uy * uy):
                    break
                kept -= 1
            work[_C + 2 * kept], work[_C + 2 * kept + 1] = x, y
            kept += 1
        kept -= 1  # the last point is the first of the other side
    kept = max(kept, 1)
    if kept == 2 and max(abs(work[_C] - work[_C + 2]), abs(work[_C + 1] - work[_C + 3])) <= tie:
        kept = 1
    for k in range(2 * kept):
        work[at + k] = work[_C + k]
    return kept


@device
def _touching(table: Any, slot: int, R: Any, view: Projection, tie: float, work: Any, at: int) -> int:
    """Write the corners within `tie` (m) of the farthest along the view to `at`, as seen; return their number."""
    count = 8 if table.kind[slot] == BOX else int(table.vertex_count[slot])
    farthest = -inf
    kept = 0
    x, y = view.origin
    (ux, uy, uz), (vx, vy, vz) = view.u, view.v
    for scan in range(2):
        for k in range(count):
            corner = rotate(R, _corner(table, slot, k))
            height = dot(view.along, corner)
            if scan == 0:
                farthest = max(farthest, height)
            elif height >= farthest - tie and kept < CORNERS:
                wx, wy, wz = corner
                work[at + 2 * kept] = x + ux * wx + uy * wy + uz * wz
                work[at + 2 * kept + 1] = y + vx * wx + vy * wy + vz * wz
                kept += 1
    return kept


@device
def _clip_to_edge(work: Any, source: int, target: int, count: int, line: Line, round_off: float) -> int:
    """Clip a polygon to the left side of a line, the line included; return its size."""
    x, y, ux, uy = line
    kept = 0
    slack = round_off * sqrt(ux * ux + uy * uy)
    for k in range(count):
        here, there = source + 2 * k, source + 2 * ((k + 1) % count)
        d0 = ux * (work[here + 1] - y) - uy * (work[here] - x) + slack
        d1 = ux * (work[there + 1] - y) - uy * (work[there] - x) + slack
        if d0 >= 0.0:
            work[target + 2 * kept], work[target + 2 * kept + 1] = work[here], work[here + 1]
            kept += 1
        if (d0 > 0.0 and d1 < 0.0) or (d0 < 0.0 and d1 > 0.0):
            f = d0 / (d0 - d1)
            work[target + 2 * kept] = work[here] + f * (work[there] - work[here])
            work[target + 2 * kept + 1] = work[here + 1] + f * (work[there + 1] - work[here + 1])
            kept += 1
    return kept


@device
def _shared(work: Any, a: int, na: int, b: int, nb: int, round_off: float) -> int:
    """Intersect the polygon at a (na >= 3 corners) and the polygon or segment at b; write it to b, return its size."""
    source, target = b, _D
    for k in range(na):
        x, y = work[a + 2 * k], work[a + 2 * k + 1]
        after = a + 2 * ((k + 1) % na)
        edge = Line(x, y, work[after] - x, work[after + 1] - y)
        nb = _clip_to_edge(work, source, target, nb, edge, round_off)
        source, target = target, source
        if nb == 0:
            return 0
    for k in range(2 * nb):
        work[b + k] = work[source + k]
    return nb


@device
def _shared_line(work: Any, a: int, b: int, tie: float) -> int:
    """Write the intersection of two segments on one line to b; return 2, or 0 if they are apart or not on one line."""
    ux, uy = work[a + 2] - work[a], work[a + 3] - work[a + 1]
    length = sqrt(ux * ux + uy * uy)
    ux, uy = ux / length, uy / length
    first, last = inf, -inf
    for k in range(2):
        x, y = work[b + 2 * k] - work[a], work[b + 2 * k + 1] - work[a + 1]
        if abs(ux * y - uy * x) > tie:
            return 0
        first, last = min(first, ux * x + uy * y), max(last, ux * x + uy * y)
    first, last = max(first, 0.0), min(last, length)
    if first > last + tie:
        return 0
    work[b], work[b + 1] = work[a] + first * ux, work[a + 1] + first * uy
    work[b + 2], work[b + 3] = work[a] + last * ux, work[a + 1] + last * uy
    return 2


@device
def _chosen(work: Any, at: int, count: int, tie: float, most: int) -> int:
    """Move the corners that represent a polygon to the front, in its order, and return their number.

    At most `most`, 2 to 4, are kept: the two farthest from each other, searched from the middle, and those farthest
    from their line on either side. Of equal corners the first is taken.
    """
    if count <= most:
        return count
    mx = my = 0.0
    for k in range(count):
        mx += work[at + 2 * k] / count
        my += work[at + 2 * k + 1] / count
    i = _farthest(work, at, count, Line(mx, my, 0.0, 0.0), tie)
    ix, iy = work[at + 2 * i], work[at + 2 * i + 1]
    j = _farthest(work, at, count, Line(ix, iy, 0.0, 0.0), tie)
    ux, uy = work[at + 2 * j] - ix, work[at + 2 * j + 1] - iy
    left = _farthest(work, at, count, Line(ix, iy, ux, uy), tie)
    right = _farthest(work, at, count, Line(ix, iy, -ux, -uy), tie)
    if most == 2:
        left = right = i
    elif most == 3:
        x = work[at + 2 * left] + work[at + 2 * right] - 2.0 * ix  # drop the nearer one
        y = work[at + 2 * left + 1] + work[at + 2 * right + 1] - 2.0 * iy
        if ux * y - uy * x >= -tie * sqrt(ux * ux + uy * uy):
            right = i
        else:
            left = i
    kept = 0
    for k in range(count):
        if k == i or k == j or k == left or k == right:
            work[at + 2 * kept], work[at + 2 * kept + 1] = work[at + 2 * k], work[at + 2 * k + 1]
            kept += 1
    return kept


@device
def _farthest(work: Any, at: int, count: int, line: Line, tie: float) -> int:
    """Index of the corner farthest to the left of a line or, if the line has no direction, farthest from its point."""
    x, y, ux, uy = line
    best, chosen = -inf, 0
    length = sqrt(ux * ux + uy * uy)
    for k in range(count):
        dx, dy = work[at + 2 * k] - x, work[at + 2 * k + 1] - y
        far = (ux * dy - uy * dx) / length if length > 0.0 else sqrt(dx * dx + dy * dy)
        if far > best + tie:
            best, chosen = far, k
    return chosen


@device
def manifold(table: Any, a: int, b: int, pose: PairPose, row: Any, out: Any, work: Any) -> int:
    """Write the points on A (4, 3) of a contact (`row`, see contact_row.py), relative to A's origin in world axes.

    Return their number. It is 1, the witness point, if no face or edge touches as a whole, if a shape is curved, or if
    both are half-spaces.
    """
    for i in range(3):
        out[0, i] = row[POINT_A + i]
    ka, kb = table.kind[a], table.kind[b]
    flat_a = ka == BOX or ka == CONVEX_HULL or ka == POLYGON
    flat_b = kb == BOX or kb == CONVEX_HULL or kb == POLYGON
    if not ((flat_a or ka == HALF_SPACE) and (flat_b or kb == HALF_SPACE) and (flat_a or flat_b)):
        return 1
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    size = 0.0
    if flat_a:
        size += table.radius[a]
    if flat_b:
        size += table.radius[b]
    tie = FEATURE_TIE * size
    height_tie = tie
    core = row[DISTANCE] + table.margin[a] + table.margin[b]
    if core > GJK_TOUCHING * size:
        # the error of GJK's normal of two hulls is their round-off divided by their distance
        height_tie += 8.0 * EPSILON * size * size / core
    u, v = _basis(n)
    na = nb = 0
    if flat_a:
        na = _touching(table, a, pose.R_A, Projection(n, u, v, (0.0, 0.0)), height_tie, work, _A)
        na = _outline(work, _A, na, tie)
    if flat_b:
        seen = Projection(opposite(n), u, v, (dot(u, pose.p), dot(v, pose.p)))
        nb = _touching(table, b, pose.R_B, seen, height_tie, work, _B)
        nb = _outline(work, _B, nb, tie)
    at = _B
    if na == 0:
        count = nb
    elif nb == 0:
        at, count = _A, na
    elif na == 1 or nb == 1:
        return 1
    elif na >= 3:
        count = _shared(work, _A, na, _B, nb, SAT_ROUND_OFF * size)
    elif nb >= 3:
        at, count = _A, _shared(work, _B, nb, _A, na, SAT_ROUND_OFF * size)
    else:
        count = _shared_line(work, _A, _B, tie)
    if count < 2:
        return 1
    count = _chosen(work, at, _outline(work, at, count, tie), tie, MOST_POINTS)
    height = dot(n, (row[POINT_A], row[POINT_A + 1], row[POINT_A + 2]))
    for k in range(count):
        x, y = work[at + 2 * k], work[at + 2 * k + 1]
        for i in range(3):
            out[k, i] = x * u[i] + y * v[i] + height * n[i]
    return count


@kernel
def _manifolds(
    table: Any, position: Any, rotation: Any, pairs: Any, contacts: Any, count: Any, out: Any, work: Any
) -> None:
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        pose = pair_pose(position, rotation, a, b)
        count[k] = manifold(table, a, b, pose, contacts[k], out[k], work)


@device
def reduce_points(points: Any, count: int, n: Vector, tie: float, most: int, work: Any) -> int:
    """Move the points that represent the outline of the first `count` points (m, 3) to the front; return their number.

    The points lie in one plane across n. At most `most`, 2 to 4, are kept.
    """
    u, v = _basis(n)
    base = (points[0, 0], points[0, 1], points[0, 2])
    for k in range(count):
        point = minus((points[k, 0], points[k, 1], points[k, 2]), base)
        work[_A + 2 * k] = dot(u, point)
        work[_A + 2 * k + 1] = dot(v, point)
    count = _chosen(work, _A, _outline(work, _A, count, tie), tie, most)
    for k in range(count):
        x, y = work[_A + 2 * k], work[_A + 2 * k + 1]
        for i in range(3):
            points[k, i] = base[i] + x * u[i] + y * v[i]
    return count


@kernel
def _reduce(points: Any, normal: Any, tie: float, work: Any) -> int:
    return reduce_points(points, len(points), (normal[0], normal[1], normal[2]), tie, MOST_POINTS, work)


def manifold_batch(
    table: Any,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    pairs: NDArray[np.int32],
    contacts: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Number of points (M,) and points on A (M, 4, 3) of the contacts (M, 15) that `contact_batch` gives for pairs.

    The points are relative to A's origin, in world axes (m). The points on B are these plus the signed distance along
    the normal. Unused points are zero.
    """
    count = np.zeros(len(pairs), np.int32)
    out = np.zeros((len(pairs), MOST_POINTS, 3))
    _manifolds(table, position, rotation, pairs, contacts, count, out, work_array())
    return count, out


def outline(points: NDArray[np.float64], normal: NDArray[np.float64], tie: float) -> NDArray[np.float64]:
    """At most four points (k, 3) that represent the points (m, 3) of joined patches in one plane across the normal."""
    while len(points) > CORNERS:
        parts = np.array_split(points, len(points) // CORNERS + 1)
        points = np.concatenate([outline(part, normal, tie) for part in parts])
    points = np.array(points)
    return points[: _reduce(points, np.array(normal), tie, work_array())]
