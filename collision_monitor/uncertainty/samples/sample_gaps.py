"""Gaps of many samples of a pair of shapes along a plane, side by side, with each sample's errors of orientation.

A direction separates two bodies by the gap along it, which the support values of both shapes give exactly, also of
bodies that are turned by an error. The loops over samples have no branches, so that LLVM computes several samples at a
time. They run over slices, because an index that may be negative prevents that. Each sample is rounded as if it were
alone.

What differs between samples, their errors and gaps, is in single precision: twice as many fit into a vector register.
What they share, the stated gap, is added up in double precision. Times are shares of the segment. `are_fine` says for
which errors that is exact enough.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy import float32

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.shapes.calls import core_support
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.capsule import CAPSULE
from collision_monitor.shapes.kinds.circle import CIRCLE
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.uncertainty.linear_gaps import add_reach, begin_terms, is_linear, make_terms, sum_terms
from collision_monitor.uncertainty.obstacle_planes import AT_REST, BENDS, MODE, from_plane
from collision_monitor.uncertainty.samples.error_samples import LEFT_OVER, ORIENTATION

TURNED_FARTHEST: Final = 0.7
"""Largest standard deviation of an orientation (rad) for which the series of `_turn` are exact to 0.001 rad."""

NOT_TURNED, FIRST_ORDER, SERIES = 0, 1, 2
"""How errors of the orientation of a body turn directions: there are none, to first order, or exactly."""

STATE: Final = 9
"""Rows of the samples at a node: error of the position of B relative to A (m), rotation vectors of the errors of A and
B (rad)."""

ZERO, HALF, ONE, TWO, FOUR = float32(0.0), float32(0.5), float32(1.0), float32(2.0), float32(4.0)
NEVER: Final = float32(inf)
"""Numbers in single precision. A literal would make LLVM compute in double precision."""

SINE: Final = (float32(1.0 / 6.0), float32(1.0 / 120.0), float32(1.0 / 5040.0))
COSINE: Final = (float32(1.0 / 24.0), float32(1.0 / 720.0), float32(1.0 / 40320.0))
"""Coefficients of the series of sin(x) / x and (1 - cos(x)) / x^2 after the first."""

APART: Final = 8
"""Unused numbers at the end of each row, because rows of exactly 1024 samples share the same few lines of the cache."""


class SampleRows(NamedTuple):
    """Samples at both ends and in the middle of a segment; scratch memory of one thread for S samples, in float32."""

    node: Any  # (3, STATE, S): the last one in the middle
    normal: Any  # (3, S)
    local: Any  # (3, S): directions in the axes of a shape
    gap: Any  # (4, S): gaps at both ends and in the middle (m), support values
    terms: Any  # (TERMS, COLUMNS) float64: see linear_gaps


def make_sample_rows(samples: int) -> SampleRows:
    """Make the scratch memory of one thread."""
    length = samples + APART
    return SampleRows(
        np.zeros((3, STATE, length), np.float32),
        np.zeros((3, length), np.float32),
        np.zeros((3, length), np.float32),
        np.zeros((4, length), np.float32),
        make_terms(),
    )


@inlined
def _is_zero(matrix: Any) -> bool:
    """Whether all numbers of a matrix (3, 3) are 0."""
    total = 0.0
    for r in range(3):
        for c in range(3):
            total += abs(matrix[r, c])
    return total == 0.0


@device
def set_samples(
    obstacle: Any, k: int, off: Any, points: Any, turning: Any, first: int, last: int, rows: SampleRows
) -> None:
    """Write the samples first:last at both ends and in the middle of segment k into rows.node.

    off (6, S): errors of position and velocity; points (DIMENSIONS, S): unit errors;
    turning (int, int): NOT_TURNED, FIRST_ORDER or SERIES for both bodies.

    The errors in the middle are the mean of those at the ends: within a segment, they change evenly.
    """
    for end in range(2):
        stated_node, node = obstacle.node[k + end], rows.node[end]
        t = float32(stated_node.time)
        for c in range(3):
            row, x, v = node[c, first:last], off[c, first:last], off[3 + c, first:last]
            for n in range(row.size):
                row[n] = x[n] + t * v[n]
        for body in range(2):
            if turning[body] == NOT_TURNED:
                continue
            x = points[ORIENTATION + 3 * body, first:last]
            y = points[ORIENTATION + 1 + 3 * body, first:last]
            z = points[ORIENTATION + 2 + 3 * body, first:last]
            p = points[LEFT_OVER + 3 * body, first:last]
            q = points[LEFT_OVER + 1 + 3 * body, first:last]
            r = points[LEFT_OVER + 2 + 3 * body, first:last]
            is_whole = _is_zero(stated_node.left[body])
            for c in range(3):
                m, left = stated_node.turn[body, c], stated_node.left[body, c]
                u, v, w = float32(m[0]), float32(m[1]), float32(m[2])
                a, b, d = float32(left[0]), float32(left[1]), float32(left[2])
                row = node[3 + 3 * body + c, first:last]
                if is_whole:
                    for n in range(row.size):
                        row[n] = u * x[n] + v * y[n] + w * z[n]
                else:
                    for n in range(row.size):
                        row[n] = u * x[n] + v * y[n] + w * z[n] + (a * p[n] + b * q[n] + d * r[n])
    for part in range(3):
        if part > 0 and turning[part - 1] == NOT_TURNED:
            continue
        for c in range(3 * part, 3 * part + 3):
            one, other, row = rows.node[0, c, first:last], rows.node[1, c, first:last], rows.node[2, c, first:last]
            for n in range(row.size):
                row[n] = HALF * (one[n] + other[n])


@device
def _turn(vectors: Any, by: Any, row: Any, sign: Any, order: Any, first: Any, last: Any) -> None:
    """Turn vectors (3, S) by sign (-1 or 1) times the rotation vectors in three rows of `by`, from `row` on.

    Only samples first:last. order: FIRST_ORDER, or SERIES for sine and cosine, see TURNED_FARTHEST.
    """
    sign = float32(sign)
    x, y, z = vectors[0, first:last], vectors[1, first:last], vectors[2, first:last]
    bx, by_, bz = by[row, first:last], by[row + 1, first:last], by[row + 2, first:last]
    if order == FIRST_ORDER:
        for n in range(x.size):
            u, v, w = sign * bx[n], sign * by_[n], sign * bz[n]
            px, py, pz = x[n], y[n], z[n]
            x[n], y[n], z[n] = px + (v * pz - w * py), py + (w * px - u * pz), pz + (u * py - v * px)
        return
    for n in range(x.size):
        u, v, w = sign * bx[n], sign * by_[n], sign * bz[n]
        q = u * u + v * v + w * w
        s = ONE - q * (SINE[0] - q * (SINE[1] - q * SINE[2]))
        c = HALF - q * (COSINE[0] - q * (COSINE[1] - q * COSINE[2]))
        px, py, pz = x[n], y[n], z[n]
        ax, ay, az = v * pz - w * py, w * px - u * pz, u * py - v * px
        x[n] = px + s * ax + c * (v * az - w * ay)
        y[n] = py + s * ay + c * (w * ax - u * az)
        z[n] = pz + s * az + c * (u * ay - v * ax)


@inlined
def core_reach(table: Any, s: int, R: Any, o: Any, n: Vector) -> float:
    """Support value (m) about its body's origin of the core of shape s, with rotation R and offset o (3,)."""
    if table.kind[s] == HALF_SPACE:
        return table.size[s, 3]
    x, y, z = n
    core = core_support(
        table, s,
        x * R[0, 0] + y * R[1, 0] + z * R[2, 0],
        x * R[0, 1] + y * R[1, 1] + z * R[2, 1],
        x * R[0, 2] + y * R[1, 2] + z * R[2, 2],
    )  # fmt: skip
    return x * o[0] + y * o[1] + z * o[2] + core


@inlined
def stated_gap(table: Any, pair: Any, n: Vector, node: Any, margin: float) -> float:
    """Gap (m) beyond the margin of the stated motion along the unit vector n (3,), in world axes, at a node (NODE)."""
    a, b = pair.a, pair.b
    p, R, o = node.position, node.rotation, node.offset
    reach = core_reach(table, a, R[0], o[0], n) + core_reach(table, b, R[1], o[1], (-n[0], -n[1], -n[2]))
    return n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - reach - rounding(table, a) - rounding(table, b) - margin


@inlined
def _subtract_reaches(
    table: Any, s: Any, R: Any, o: Any, sign: Any, local: Any, gap: Any, first: Any, last: Any, best: Any
) -> None:
    """Subtract `core_reach` along sign times the directions local (3, S), in world axes, from gap (last - first,).

    Only samples first:last. Overwrites local. best (last - first,): scratch.
    """
    x, y, z = local[0, first:last], local[1, first:last], local[2, first:last]
    sign, ox, oy, oz = float32(sign), float32(o[0]), float32(o[1]), float32(o[2])
    xx, xy, xz = float32(R[0, 0]), float32(R[0, 1]), float32(R[0, 2])
    yx, yy, yz = float32(R[1, 0]), float32(R[1, 1]), float32(R[1, 2])
    zx, zy, zz = float32(R[2, 0]), float32(R[2, 1]), float32(R[2, 2])
    for n in range(gap.size):
        u, v, w = sign * x[n], sign * y[n], sign * z[n]
        gap[n] -= u * ox + v * oy + w * oz
        x[n], y[n], z[n] = u * xx + v * yx + w * zx, u * xy + v * yy + w * zy, u * xz + v * yz + w * zz
    kind, size = table.kind[s], table.size
    s0, s1, s2 = float32(size[s, 0]), float32(size[s, 1]), float32(size[s, 2])
    if kind == BOX:
        for n in range(gap.size):
            gap[n] -= abs(x[n]) * s0 + abs(y[n]) * s1 + abs(z[n]) * s2
    elif kind == CAPSULE:
        for n in range(gap.size):
            gap[n] -= abs(z[n]) * s1
    elif kind == CYLINDER or kind == CIRCLE:
        height = s1 if kind == CYLINDER else ZERO
        for n in range(gap.size):
            gap[n] -= abs(z[n]) * height + s0 * sqrt(x[n] * x[n] + y[n] * y[n])
    elif kind == CONVEX_HULL or kind == POLYGON:
        for n in range(gap.size):
            best[n] = -inf
        start, vertices = table.vertex_start[s], table.vertices
        for k in range(start, start + table.vertex_count[s]):
            u, v, w = float32(vertices[0, k]), float32(vertices[1, k]), float32(vertices[2, k])
            for n in range(gap.size):
                value = x[n] * u + y[n] * v + z[n] * w
                best[n] = value if value > best[n] else best[n]
        for n in range(gap.size):
            gap[n] -= best[n]
    elif kind != SPHERE:  # the rarer kinds, in double precision
        for n in range(gap.size):
            gap[n] -= float32(core_support(table, s, float(x[n]), float(y[n]), float(z[n])))


@inlined
def _gaps_at(
    table: Any, pair: Any, plane: Any, node: Any, margin: Any, turning: Any, first: Any, last: Any, state: Any,
    rows: Any, gap: Any,
) -> None:  # fmt: skip
    """Write the gaps (last - first,) of samples along a plane at a node (NODE); state (STATE, S): the samples there."""
    a, b, mode = pair.a, pair.b, int(plane[MODE])
    R, o, p = node.rotation, node.offset, node.position
    n = from_plane(plane, R)
    nx, ny, nz = n
    reach = rounding(table, a) + rounding(table, b) + margin
    turned = mode < AT_REST and turning[mode] != NOT_TURNED
    varies_a = mode != 0 and (turning[0] != NOT_TURNED or turned)
    varies_b = mode != 1 and (turning[1] != NOT_TURNED or turned)
    if not varies_a:
        reach += core_reach(table, a, R[0], o[0], n)
    if not varies_b:
        reach += core_reach(table, b, R[1], o[1], (-nx, -ny, -nz))
    x, y, z = state[0, first:last], state[1, first:last], state[2, first:last]
    if turning[0] == NOT_TURNED and turning[1] == NOT_TURNED:
        stated = float32(nx * p[0] + ny * p[1] + nz * p[2] - reach)
        nx, ny, nz = float32(nx), float32(ny), float32(nz)
        for k in range(gap.size):
            gap[k] = stated + (nx * x[k] + ny * y[k] + nz * z[k])
        return
    if max(turning[0], turning[1]) == FIRST_ORDER and is_linear(table, a) and is_linear(table, b):
        terms = rows.terms
        count = begin_terms(n, p, reach, mode, turned, terms)
        for body in range(2):
            if varies_b if body else varies_a:
                of = (turning[body] != NOT_TURNED, mode, turned)
                count = add_reach(table, b if body else a, body, R[body], o[body], n, of, node, terms, count)
        sum_terms(n, mode, turned, terms, count, state, first, last, rows.local, gap)
        return
    u, v, w = rows.normal[0, first:last], rows.normal[1, first:last], rows.normal[2, first:last]
    reach = float32(reach)
    px, py, pz, nx, ny, nz = float32(p[0]), float32(p[1]), float32(p[2]), float32(nx), float32(ny), float32(nz)
    for k in range(gap.size):
        u[k], v[k], w[k] = nx, ny, nz
    if turned:
        _turn(rows.normal, state, 3 + 3 * mode, 1.0, turning[mode], first, last)
    for k in range(gap.size):
        gap[k] = u[k] * (px + x[k]) + v[k] * (py + y[k]) + w[k] * (pz + z[k]) - reach
    for body in range(2):
        if not (varies_b if body else varies_a):
            continue
        x, y, z = rows.local[0, first:last], rows.local[1, first:last], rows.local[2, first:last]
        for k in range(gap.size):
            x[k], y[k], z[k] = u[k], v[k], w[k]
        if turning[body] != NOT_TURNED:
            _turn(rows.local, state, 3 + 3 * body, -1.0, turning[body], first, last)
        best = rows.gap[3, first:last]
        s, sign = (b, -1.0) if body else (a, 1.0)
        _subtract_reaches(table, s, R[body], o[body], sign, rows.local, gap, first, last, best)


@device
def gaps_at_begin(
    table: Any, pair: Any, plane: Any, margin: float, turning: Any, node: Any, count: int, rows: SampleRows
) -> None:
    """Write the gaps of the first `count` samples along a plane at the begin of a segment (NODE) into rows.gap[0]."""
    _gaps_at(table, pair, plane, node, margin, turning, 0, count, rows.node[0], rows, rows.gap[0, 0:count])


@inlined
def set_bends(table: Any, pair: Any, plane: Any, nodes: Any, middle: Any, least: float) -> None:
    """Set column BENDS of a plane in a segment with these ends and this middle (NODE).

    Gaps count as straight lines if the stated one deviates from a line by at most `least` (m).
    """
    bow = stated_gap(table, pair, from_plane(plane, middle.rotation), middle, 0.0)
    for end in range(2):
        bow -= 0.5 * stated_gap(table, pair, from_plane(plane, nodes[end].rotation), nodes[end], 0.0)
    plane[BENDS] = 1.0 if abs(bow) > least else 0.0


@inlined
def _restrict(n: Any, enters: Any, leaves: Any, entry: Any, leave: Any) -> None:
    """Restrict [entry, leave] of sample n. With + ZERO, LLVM stores every lane; to leave some as they are is slower."""
    before, after = entry[n] + ZERO, leave[n] + ZERO
    entry[n] = enters if enters > before else before
    leave[n] = leaves if leaves < after else after


@inlined
def _enter_line(g: Any, h: Any, entry: Any, leave: Any) -> None:
    """Restrict [entry, leave] (n,) to the time when gaps are closed that change evenly from g to h (n,)."""
    for n in range(entry.size):
        change = h[n] - g[n] + ZERO  # -0.0 becomes 0.0
        at = -g[n] / change
        closes = change < ZERO
        enters, leaves = at if closes else -NEVER, NEVER if closes else at
        _restrict(n, enters, leaves, entry, leave)


@inlined
def _enter_parabola(g: Any, h: Any, middle: Any, entry: Any, leave: Any) -> None:
    """`_enter_line` for gaps with these values (n,) in the middle. One that is closed at both ends counts as closed.

    At a share s of the segment, a gap deviates from a straight line by bow s (1 - s). Roots without cancellation, as in
    Press et al., Numerical Recipes, section 5.6.
    """
    for n in range(entry.size):
        bow = FOUR * middle[n] - TWO * (g[n] + h[n])
        slope = h[n] - g[n] + bow
        inside = slope * slope + FOUR * bow * g[n]
        root = sqrt(max(inside, ZERO))
        half = HALF * (slope + (root if slope >= ZERO else -root))
        one, other = half / bow, -g[n] / half
        first, last = (one, other) if one < other else (other, one)
        dips, closes = bow < ZERO, inside >= ZERO
        enters = (first if closes else NEVER) if dips else last if g[n] > ZERO else -NEVER
        leaves = last if dips else first if h[n] > ZERO else NEVER
        _restrict(n, enters, leaves, entry, leave)


@device
def enter_planes(
    table: Any, pair: Any, planes: Any, margin: float, turning: Any, nodes: Any, middle: Any, first: int, last: int,
    rows: SampleRows, entry: Any, leave: Any,
) -> None:  # fmt: skip
    """Restrict the intervals [entry, leave] (S,) of samples first:last in a segment to the time behind planes.

    entry, leave: shares of the segment, from 0 at its begin to 1 at its end.
    planes (M, PLANE_SIZE); nodes (2,), middle: NODE at both ends and in the middle of the segment; rows: see
    `set_samples`; margin (m): the gap from which on a sample is behind a plane.
    """
    entry, leave = entry[first:last], leave[first:last]
    g, h, between = rows.gap[0, first:last], rows.gap[1, first:last], rows.gap[2, first:last]
    for m in range(planes.shape[0]):
        bends = planes[m, BENDS] > 0.0
        for place in range(3 if bends else 2):
            node, gap = nodes[place] if place < 2 else middle, rows.gap[place, first:last]
            _gaps_at(table, pair, planes[m], node, margin, turning, first, last, rows.node[place], rows, gap)
        if bends:
            _enter_parabola(g, h, between, entry, leave)
        else:
            _enter_line(g, h, entry, leave)
