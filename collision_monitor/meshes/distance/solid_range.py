"""How deep a tree and a convex solid overlap, between two bounds: the search ends as soon as these are close enough.

As depth_range.py for two trees. Points of a triangle bound its depth from below, and the planes along their directions
from above; GJK and EPA are only asked where these bounds are too far apart.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import Vector, along, dot, minus, opposite, rotate, sum_of_sizes
from collision_monitor.meshes.distance.nearest import NEAR_A, triangle_at
from collision_monitor.meshes.distance.solid import (
    SolidMemory,
    box_reach_along,
    center_of,
    push_box,
    triangle_solid_contact,
)
from collision_monitor.meshes.layout import CHILD, RADIUS, WIDTH
from collision_monitor.meshes.overlap.touching_triangles import repeats
from collision_monitor.meshes.placing import inverse, place_point, relative
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, write
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import point_distance_range
from collision_monitor.tolerances import SAT_ROUND_OFF

MOST_EXAMINED: Final = 300
"""Most triangles to examine by GJK and EPA, about 1 ms; hostile meshes need more, and get the full answer."""


@outlined
def solid_range(
    blocks: Any,
    root: int,
    margin: float,
    table: Any,
    b: int,
    pose: PairPose,
    wanted: float,
    out: Any,
    memory: SolidMemory,
) -> tuple[float, float]:
    """Bounds (m) on the signed distance of a tree A, enlarged by a margin (m), and a solid b, at most `wanted` apart.

    (inf, inf) if they do not overlap, (-inf, inf) if the search ended early. out: gets a contact with the upper bound.
    """
    X = relative(pose.R_A, pose.R_B, pose.p)
    Y = inverse(X)
    work, row = memory.tree, memory.tree[NEAR_A : NEAR_A + CONTACT_SIZE]
    least, most, examined = inf, inf, 0
    work[0], work[1] = -inf, WIDTH * root
    waiting = 1
    while waiting > 0:  # terminates: each box is opened once
        waiting -= 1
        if most <= 0.0 and work[2 * waiting] >= most - wanted:
            least = min(least, work[2 * waiting])
            continue
        place = int(work[2 * waiting + 1])
        child = blocks[place // WIDTH, CHILD, place % WIDTH]
        block, first = root + int(abs(child)), waiting
        if child < 0.0:  # one corner is enough if it is as deep as the box can be
            x, radius = triangle_at(blocks, block, 0).a, blocks[block, RADIUS, 0] + margin
            _, upper, n = point_distance_range(table, b, place_point(Y, x))
            upper -= radius + table.margin[b]
            if upper <= 0.0 and work[2 * waiting] >= min(upper, most) - wanted:
                if upper < most:
                    _write_point(x, radius, n, upper, table, b, pose, out)
                least, most = min(least, work[2 * waiting]), min(upper, most)
                continue
        for k in range(WIDTH):
            if child > 0.0:
                if blocks[block, CHILD, k] == 0.0:
                    continue
                lower, _, n = point_distance_range(table, b, place_point(Y, center_of(blocks, block, k)))
                n = minus(place_point(X, n), (X.x, X.y, X.z))
                lower -= box_reach_along(blocks, block, k, n) + margin + table.margin[b]
                if lower <= 0.0:
                    push_box(work, first, waiting, lower, float(WIDTH * block + k))
                    waiting += 1
                continue
            if repeats(blocks, block, k):
                continue
            T = triangle_at(blocks, block, k)
            radius = blocks[block, RADIUS, k] + margin
            lower, upper, x, n = _range_of(table, b, place_point(Y, T.a), place_point(Y, T.b), place_point(Y, T.c))
            lower, upper = lower - radius - table.margin[b], upper - radius - table.margin[b]
            if lower > 0.0:
                continue
            if most <= 0.0 and lower >= most - wanted:
                least = min(least, lower)
                continue
            if upper > 0.0 or upper - lower > wanted:
                examined += 1
                if examined > MOST_EXAMINED:
                    return -inf, inf
                if not triangle_solid_contact(table, b, pose, T, radius, 0.0, row, memory):
                    continue
                lower, upper = row[DISTANCE] - row[BOUND], row[DISTANCE]
                if upper < most:
                    for c in range(CONTACT_SIZE):
                        out[c] = row[c]
            elif upper < most:
                _write_point(place_point(X, x), radius, n, upper, table, b, pose, out)
            least, most = min(least, lower), min(most, upper)
    return min(least, most), most


@inlined
def _write_point(
    x: Vector, radius: float, n: Vector, distance: float, table: Any, b: int, pose: PairPose, out: Any
) -> None:
    """Write the contact of a point x of A, in A's frame, whose distance is along the direction n in that of b."""
    n, x = opposite(rotate(pose.R_B, n)), rotate(pose.R_A, x)
    size = table.size[b, 0] + table.size[b, 1] + table.size[b, 2]
    scale = sum_of_sizes(pose.p) + sum_of_sizes(x) + radius + size
    write(out, distance, n, along(x, radius, n), SAT_ROUND_OFF * scale)


@outlined
def _range_of(table: Any, b: int, p: Any, q: Any, r: Any) -> Any:
    """Bounds on the signed distance of a triangle, its point with the upper one, and the direction of that, by points.

    p, q, r: the corners, in the frame of the solid.
    """
    third = 1.0 / 3.0
    c = third * (p[0] + q[0] + r[0]), third * (p[1] + q[1] + r[1]), third * (p[2] + q[2] + r[2])
    lower, upper, best, normal = -inf, inf, c, (1.0, 0.0, 0.0)
    for k in range(4):
        x = c if k == 0 else (p if k == 1 else (q if k == 2 else r))
        bound, at_most, n = point_distance_range(table, b, x)
        lower = max(lower, bound + min(0.0, dot(n, minus(p, x)), dot(n, minus(q, x)), dot(n, minus(r, x))))
        if at_most < upper or k == 0:
            upper, best, normal = at_most, x, n
    return lower, upper, best, normal
