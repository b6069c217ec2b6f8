"""A tree against a convex solid: contact, and a time without one.

For a cloud with any solid, and for a mesh with a cylinder, a cone, an ellipsoid or a half-space, which triangles cannot
represent. Boxes and triangles are dropped by their bounding spheres; the triangles that remain are tested by GJK and
EPA, by their deepest corner for a half-space, and points in closed form where there is one.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor._jit.vectors import LANES
from collision_monitor.geometry.vector import (
    Vector,
    along,
    cross,
    dot,
    minus,
    opposite,
    rotate,
    rotate_back,
    sum_of_sizes,
)
from collision_monitor.meshes.advance.approach import Approach, time_until
from collision_monitor.meshes.boxes import half_of
from collision_monitor.meshes.distance.contact import reach_in
from collision_monitor.meshes.distance.feature import slot_tie, triangle_feature
from collision_monitor.meshes.distance.nearest import NEAR_A, triangle_at
from collision_monitor.meshes.distance.triangle_pair import Corners
from collision_monitor.meshes.layout import CENTER, CHILD, FACE, RADIUS, WIDTH
from collision_monitor.meshes.overlap.touching_triangles import repeats
from collision_monitor.meshes.placing import Placing, inverse, place_point, relative, turn_back, turned_back
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    CONTACT_SIZE,
    DISTANCE,
    FEATURE_TYPE_A,
    NORMAL,
    POINT_A,
    POINT_B,
    write,
)
from collision_monitor.narrow_phase.convex_convex import cores_contact
from collision_monitor.narrow_phase.core import Core, CorePair, core_length, core_of, rounding
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import core_support, point_distance_range
from collision_monitor.shapes.feature_types import VERTEX
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.tolerances import SAT_ROUND_OFF

MOST_EXAMINED: Final = 5_000
"""Most triangles or points to examine exactly, 0.3 s at most. A million slivers in one line need more; the error bound
then extends to the boxes that are left."""


class SolidMemory(NamedTuple):
    """Scratch memory of one thread."""

    triangle: Any  # (3, LANES): its corners, the last one repeated
    gjk: Any  # (WORK_SIZE,)
    tree: Any  # (MEMORY,), see `nearest_triangles`


@inlined
def _middle(T: Corners) -> tuple[Vector, float]:
    """Centre of a sphere about a triangle, and its radius (m)."""
    third = 1.0 / 3.0
    c = (
        third * (T.a[0] + T.b[0] + T.c[0]),
        third * (T.a[1] + T.b[1] + T.c[1]),
        third * (T.a[2] + T.b[2] + T.c[2]),
    )
    a, b, d = minus(T.a, c), minus(T.b, c), minus(T.c, c)
    return c, sqrt(max(dot(a, a), max(dot(b, b), dot(d, d)))) * (1.0 + 1e-14)


@inlined
def push_box(work: Any, first: int, waiting: int, bound: float, place: float) -> None:
    """Push a box between those from `first` on, the one with the least bound last."""
    at = waiting
    while at > first and work[2 * (at - 1)] < bound:
        work[2 * at], work[2 * at + 1] = work[2 * (at - 1)], work[2 * (at - 1) + 1]
        at -= 1
    work[2 * at], work[2 * at + 1] = bound, place


@inlined
def center_of(blocks: Any, block: int, k: int) -> Vector:
    """Centre of a box."""
    return blocks[block, CENTER, k], blocks[block, CENTER + 1, k], blocks[block, CENTER + 2, k]


@inlined
def box_reach_along(blocks: Any, block: int, k: int, n: Vector) -> float:
    """How far a box reaches from its centre along n, of any length, in the frame of its tree (m)."""
    e, m = half_of(blocks, block, k), turned_back(blocks, block, k, n)
    return abs(m[0]) * e[0] + abs(m[1]) * e[1] + abs(m[2]) * e[2]


@inlined
def _is_point(T: Corners) -> bool:
    return (
        T.a[0] == T.b[0] and T.a[1] == T.b[1] and T.a[2] == T.b[2]
        and T.a[0] == T.c[0] and T.a[1] == T.c[1] and T.a[2] == T.c[2]
    )  # fmt: skip


@device
def _point_contact(
    table: Any, b: int, pose: PairPose, x: Vector, radius: float, limit: float, out: Any, memory: SolidMemory
) -> bool:
    """As `triangle_solid_contact`, for a point of A: in closed form where there is one, otherwise by GJK and EPA."""
    y = place_point(inverse(relative(pose.R_A, pose.R_B, pose.p)), x)
    distance, most, d = point_distance_range(table, b, y)
    x = rotate(pose.R_A, x)
    if distance == most:
        n = rotate(pose.R_B, d)
        distance -= radius + table.margin[b]
        scale = sum_of_sizes(pose.p) + sum_of_sizes(x) + radius + table.size[b, 0] + table.size[b, 1] + table.size[b, 2]
        write(out, distance, opposite(n), along(x, -radius, n), SAT_ROUND_OFF * scale)
        return distance - out[BOUND] <= limit
    p = minus(pose.p, x)
    cores = CorePair(Core(SPHERE, (0.0, 0.0, 0.0), 0, 0), core_of(table, b), table.vertices, table.vertices)
    radii, at = (radius, rounding(table, b)), PairPose(pose.R_A, pose.R_B, p)
    if not cores_contact(cores, radii, core_length(table, b), at, limit, out, memory.gjk):
        return False
    for c in range(3):
        out[POINT_A + c] += x[c]
        out[POINT_B + c] += x[c]
    return out[DISTANCE] - out[BOUND] <= limit


@device
def triangle_solid_contact(
    table: Any, b: int, pose: PairPose, T: Corners, radius: float, limit: float, out: Any, memory: SolidMemory
) -> bool:
    """Write the contact of a triangle of A, enlarged by a radius, and the solid b; False if beyond the limit."""
    if table.kind[b] == HALF_SPACE:
        n = rotate(pose.R_B, (table.size[b, 0], table.size[b, 1], table.size[b, 2]))
        d = rotate_back(pose.R_A, n)
        x = T.a if dot(T.a, d) <= min(dot(T.b, d), dot(T.c, d)) else (T.b if dot(T.b, d) <= dot(T.c, d) else T.c)
        witness = along(rotate(pose.R_A, x), -radius, n)
        scale = abs(witness[0]) + abs(witness[1]) + abs(witness[2]) + abs(pose.p[0]) + abs(pose.p[1]) + abs(pose.p[2])
        distance = dot(n, minus(witness, pose.p)) - table.size[b, 3] - table.margin[b]
        write(out, distance, opposite(n), witness, SAT_ROUND_OFF * (scale + abs(table.size[b, 3])))
        return distance - out[BOUND] <= limit
    if _is_point(T):
        return _point_contact(table, b, pose, T.a, radius, limit, out, memory)
    middle, length = _middle(T)  # about its own centre, since the error of GJK grows with the corners' distance
    for k in range(LANES):
        x = minus(T.a if k == 0 else (T.b if k == 1 else T.c), middle)
        memory.triangle[0, k], memory.triangle[1, k], memory.triangle[2, k] = x
    flat = Core(CONVEX_HULL, (0.0, 0.0, 0.0), 0, LANES)
    cores = CorePair(flat, core_of(table, b), memory.triangle, table.vertices)
    shift = rotate(pose.R_A, middle)
    radii, at = (radius, rounding(table, b)), PairPose(pose.R_A, pose.R_B, minus(pose.p, shift))
    if not cores_contact(cores, radii, core_length(table, b) + length, at, limit, out, memory.gjk):
        return False
    for c in range(3):
        out[POINT_A + c] += shift[c]
        out[POINT_B + c] += shift[c]
    out[BOUND] += SAT_ROUND_OFF * (sum_of_sizes(pose.p) + sum_of_sizes(shift))
    return out[DISTANCE] - out[BOUND] <= limit


@device
def solid_contact(
    blocks: Any,
    root: int,
    margin: float,
    table: Any,
    b: int,
    pose: PairPose,
    limit: float,
    out: Any,
    memory: SolidMemory,
) -> bool:
    """Write the contact of a tree A, enlarged by a margin (m), and a solid b; False if it is farther than the limit.

    What is not nearer by more than the error of the nearest one so far is left out: the bound of that one holds it. If
    MOST_EXAMINED are too few, a contact is written even if it is farther than the limit.
    """
    X = relative(pose.R_A, pose.R_B, pose.p)
    Y = inverse(X)
    work, row = memory.tree, memory.tree[NEAR_A : NEAR_A + CONTACT_SIZE]
    lengths = abs(table.size[b, 0]) + abs(table.size[b, 1]) + abs(table.size[b, 2]) + abs(table.size[b, 3])
    round_off = SAT_ROUND_OFF * (sum_of_sizes(pose.p) + reach_in(blocks, root) + lengths)  # of the bounds of boxes
    best, found, enough, examined = limit, False, limit + round_off, 0
    work[0], work[1] = -inf, WIDTH * root
    waiting = 1
    while waiting > 0:  # terminates: each box is opened once
        waiting -= 1
        if work[2 * waiting] > enough:
            continue
        place = int(work[2 * waiting + 1])
        child = blocks[place // WIDTH, CHILD, place % WIDTH]
        block, first = root + int(abs(child)), waiting
        for k in range(WIDTH):
            if child > 0.0:
                if blocks[block, CHILD, k] == 0.0:
                    continue
                c = center_of(blocks, block, k)
                bound, _, n = point_distance_range(table, b, place_point(Y, c))
                n = minus(place_point(X, n), (X.x, X.y, X.z))
                bound -= box_reach_along(blocks, block, k, n) + margin + table.margin[b]
                if bound <= enough:
                    push_box(work, first, waiting, bound, float(WIDTH * block + k))
                    waiting += 1
                continue
            if repeats(blocks, block, k):
                continue
            T = triangle_at(blocks, block, k)
            radius = blocks[block, RADIUS, k] + margin
            c, size = _middle(T)
            bound, _, _ = point_distance_range(table, b, place_point(Y, c))
            if bound - size - radius - table.margin[b] > enough:
                continue
            examined += 1
            within = inf if examined > MOST_EXAMINED and not found else best
            is_near = triangle_solid_contact(table, b, pose, T, radius, within, row, memory)
            if is_near and (not found or row[DISTANCE] < best):
                best, found, enough = row[DISTANCE], True, row[DISTANCE] - row[BOUND]
                for i in range(CONTACT_SIZE):
                    out[i] = row[i]
                if _is_point(T):
                    out[FEATURE_TYPE_A], out[FEATURE_TYPE_A + 1] = VERTEX, blocks[block, FACE, k]
                else:
                    n = rotate_back(pose.R_A, (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2]))
                    x = rotate_back(pose.R_A, (row[POINT_A], row[POINT_A + 1], row[POINT_A + 2]))
                    reach = slot_tie(table, b, b) * reach_in(blocks, root)
                    out[FEATURE_TYPE_A], out[FEATURE_TYPE_A + 1] = triangle_feature(
                        T, blocks[block, FACE, k], along(x, -radius, n), n, reach
                    )
        if examined > MOST_EXAMINED and found:
            for k in range(waiting + 1):  # of the boxes that are left, and of this one
                out[BOUND] = max(out[BOUND], best - work[2 * k])
            return True
    return found


@device
def solid_time(
    table: Any, b: int, X: Placing, n: Vector, gap: float, x: Vector, size: float, turn: float, move: Approach
) -> float:
    """Time until which the points of A in a ball (centre x, radius size) keep their gap along n from the solid b.

    turn: largest n x w_a . (p - x) over these points p (m/s).
    """
    k, m = cross(n, move.w_a), cross(n, move.w_b)
    speed = dot(x, k) + turn - dot(n, move.v) + move.growth
    own = 0.0
    if table.kind[b] != HALF_SPACE and move.bend_b > 0.0:
        d = turn_back(X, m)
        speed += core_support(table, b, -d[0], -d[1], -d[2])
        own = core_length(table, b)
    curvature = move.bend + move.bend_a * (sqrt(dot(x, x)) + size) + move.bend_b * own
    return time_until(gap, speed, curvature)


class MovingSolid(NamedTuple):
    """A solid b of a shape table that moves (Approach, in A's axes, `start` with both margins) relative to a tree A.

    pose: of A and b now; X: pose of b in A's frame.
    """

    table: Any
    b: Any
    pose: Any
    X: Any
    move: Any


@device
def box_time(blocks: Any, block: int, k: int, solid: MovingSolid) -> float:
    """Time until which a box of the tree stays apart from the solid."""
    c, e = center_of(blocks, block, k), half_of(blocks, block, k)
    bound, n = _distance_along(solid, c)
    gap = bound - box_reach_along(blocks, block, k, n)
    turn = box_reach_along(blocks, block, k, cross(n, solid.move.w_a))
    X, move = solid.X, solid.move
    return solid_time(solid.table, solid.b, X, n, gap - move.start, c, sqrt(dot(e, e)), turn, move)


@device
def leaf_solid_time(
    blocks: Any, block: int, solid: MovingSolid, tolerance: float, enough: float, memory: SolidMemory
) -> tuple[float, int]:
    """Time until which the triangles of a block stay apart from the solid, and how many were examined exactly.

    The time is 0 if one is within the tolerance (m) beyond the wanted gap; else the advance aims at half the
    tolerance. A triangle is examined exactly only if a time of `enough` is not certain by the sphere about it.
    """
    table, b, pose, X, move = solid
    row = memory.tree[NEAR_A : NEAR_A + CONTACT_SIZE]
    start = move.start - table.margin[b]  # the contact row includes that margin
    soon, examined = inf, 0
    for k in range(WIDTH):
        if repeats(blocks, block, k):
            continue
        T, radius = triangle_at(blocks, block, k), blocks[block, RADIUS, k]
        c, size = _middle(T)
        bound, n = _distance_along(solid, c)
        across = cross(n, move.w_a)
        turn = size * sqrt(dot(across, across))
        time = solid_time(table, b, X, n, bound - size - radius - move.start, c, size, turn, move)
        if time < min(soon, enough) and triangle_solid_contact(table, b, pose, T, radius, inf, row, memory):
            examined += 1
            gap = row[DISTANCE] - row[BOUND] - start
            if gap <= tolerance:
                return 0.0, examined
            n = rotate_back(pose.R_A, (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2]))
            across = cross(n, move.w_a)
            turn = size * sqrt(dot(across, across))
            time = max(time, solid_time(table, b, X, n, gap - 0.5 * tolerance, c, size, turn, move))
        soon = min(soon, time)
    return soon, examined


@inlined
def _distance_along(solid: MovingSolid, c: Vector) -> tuple[float, Vector]:
    """Lower bound on the distance (m) of a point of A's frame from the solid, and its direction to the solid."""
    bound, _, n = point_distance_range(solid.table, solid.b, place_point(inverse(solid.X), c))
    return bound, opposite(minus(place_point(solid.X, n), (solid.X.x, solid.X.y, solid.X.z)))
