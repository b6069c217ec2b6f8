"""Circles and convex polygons in the x-y plane: separating axes if they overlap, vertices against edges if not.

A circle is one vertex grown by its radius, and a capsule is two, so that one test covers every pair of the two kinds.
(Slides "Separating Axis Theorem (SAT) - in 2D"; Ericson, Real-Time Collision Detection, 5.1.2)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import write
from collision_monitor.narrow_phase.pair_pose import PairPose, swapped
from collision_monitor.shapes.kinds.circle import CIRCLE
from collision_monitor.tolerances import FEATURE_TIE, SAT_ROUND_OFF


@device
def _corner(table: Any, slot: int, R: Any, k: int) -> Any:
    """Vertex k (x, y) relative to the shape's origin, in world axes (m)."""
    if table.kind[slot] == CIRCLE:
        return 0.0, 0.0
    at = table.vertex_start[slot] + k
    x, y = table.vertices[0, at], table.vertices[1, at]
    return R[0, 0] * x + R[0, 1] * y, R[1, 0] * x + R[1, 1] * y


@device
def _corners(table: Any, slot: int) -> int:
    return 1 if table.kind[slot] == CIRCLE else int(table.size[slot, 0])


@device
def _widest_gap(table: Any, a: int, b: int, pose: PairPose, tie: float) -> Any:
    """Largest gap (m) of b along the outward normals of a's edges, with that normal and a touching point on that edge.

    The point is relative to a's origin. The gap is -inf if a has no edge.
    """
    RA, RB = pose.R_A, pose.R_B
    px, py, _ = pose.p
    best, nx, ny, x, y = -inf, 1.0, 0.0, 0.0, 0.0
    n, m = _corners(table, a), _corners(table, b)
    if n < 2:
        return best, nx, ny, x, y
    x0, y0 = _corner(table, a, RA, n - 1)
    for k in range(n):
        x1, y1 = _corner(table, a, RA, k)
        length = sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
        tx, ty = (x1 - x0) / length, (y1 - y0) / length
        gap = inf
        for j in range(m):
            cx, cy = _corner(table, b, RB, j)
            gap = min(gap, ty * (px + cx - x0) - tx * (py + cy - y0))
        if gap > best:
            # all corners of b that are equally near, two if the edges are parallel
            first, last = inf, -inf
            for j in range(m):
                cx, cy = _corner(table, b, RB, j)
                if ty * (px + cx - x0) - tx * (py + cy - y0) <= gap + tie:
                    along = tx * (px + cx - x0) + ty * (py + cy - y0)
                    first, last = min(first, along), max(last, along)
            along = 0.5 * (min(max(first, 0.0), length) + min(max(last, 0.0), length))
            best, nx, ny = gap, ty, -tx
            x, y = x0 + along * tx, y0 + along * ty
        if n == 2:
            # the end of a segment: no edge has the normal along it
            gap = inf
            for j in range(m):
                cx, cy = _corner(table, b, RB, j)
                gap = min(gap, tx * (px + cx - x1) + ty * (py + cy - y1))
            if gap > best:
                best, nx, ny, x, y = gap, tx, ty, x1, y1
        x0, y0 = x1, y1
    return best, nx, ny, x, y


@device
def _nearest(table: Any, a: int, b: int, pose: PairPose) -> Any:
    """Corner of a nearest to the boundary of b: squared distance, corner, and point on b, relative to a's origin."""
    RA, RB = pose.R_A, pose.R_B
    px, py, _ = pose.p
    best, x, y, u, v = inf, 0.0, 0.0, 0.0, 0.0
    n, m = _corners(table, a), _corners(table, b)
    for k in range(n):
        cx, cy = _corner(table, a, RA, k)
        x0, y0 = _corner(table, b, RB, m - 1)
        x0, y0 = x0 + px, y0 + py
        for j in range(m):
            x1, y1 = _corner(table, b, RB, j)
            x1, y1 = x1 + px, y1 + py
            ex, ey = x1 - x0, y1 - y0
            squared = ex * ex + ey * ey
            s = ((cx - x0) * ex + (cy - y0) * ey) / squared if squared > 0.0 else 0.0
            s = min(max(s, 0.0), 1.0)
            fx, fy = x0 + s * ex, y0 + s * ey
            distance = (fx - cx) * (fx - cx) + (fy - cy) * (fy - cy)
            if distance < best:
                best, x, y, u, v = distance, cx, cy, fx, fy
            x0, y0 = x1, y1
    return best, x, y, u, v


@device
def planar_contact(table: Any, a: int, b: int, pose: PairPose, out: Any) -> None:
    """Write the contact of two plane shapes. Only the x-y parts of the rotations and of p are read."""
    px, py, _ = pose.p
    back = swapped(pose)
    ra, rb = table.margin[a], table.margin[b]
    size = table.radius[a] + table.radius[b] - ra - rb
    if table.kind[a] == CIRCLE:
        ra += table.size[a, 0]
    if table.kind[b] == CIRCLE:
        rb += table.size[b, 0]
    tie = FEATURE_TIE * size
    round_off = SAT_ROUND_OFF * (size + abs(px) + abs(py))
    gap, nx, ny, x, y = _widest_gap(table, a, b, pose, tie)
    other, mx, my, u, v = _widest_gap(table, b, a, back, tie)
    if other > gap:
        # the edge is b's: the point on a is the gap away from the point on the edge
        gap, nx, ny = other, -mx, -my
        x, y = u + px - gap * nx, v + py - gap * ny
    distance = gap
    if not gap <= 0.0 or gap == -inf:
        squared, x0, y0, u, v = _nearest(table, a, b, pose)
        dx, dy = u - x0, v - y0
        other, u, v, x1, y1 = _nearest(table, b, a, back)
        if other < squared:
            dx, dy, x0, y0 = u - x1, v - y1, x1 + px, y1 + py
        distance = sqrt(dx * dx + dy * dy)
        # more than round-off beside the edge's normal: a corner is nearest, even if gap and distance agree to 1e-9
        if distance > 0.0 and (gap == -inf or abs(dx * ny - dy * nx) > round_off):
            nx, ny, x, y = dx / distance, dy / distance, x0, y0
        elif gap > 0.0:
            distance = gap  # the edge's normal is the direction of the distance, without its noise
        else:
            distance, x, y = 0.0, x0, y0  # the centres of two circles coincide: any direction is valid
    bound = round_off + SAT_ROUND_OFF * (ra + rb)
    write(out, distance - ra - rb, (nx, ny, 0.0), (x + ra * nx, y + ra * ny, 0.0), bound)
