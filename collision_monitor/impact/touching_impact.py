"""First impact of two shapes that touch at the start: they part, slide, roll or rest, or they go into each other.

Touching is no impact as long as one direction keeps the shapes from being deeper in each other than round-off. Along
it, the gap is that of their support functions, and the advance is that of every impact (advance.py). So a box that
slides on a floor is followed to the horizon in one step.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import Vector, cross, dot, minus, opposite, rotate_back
from collision_monitor.impact.advance import Placed, advance_along_axis, in_motion
from collision_monitor.impact.body_impact import AT_REST
from collision_monitor.motion.motion import PairChange, smooth_until
from collision_monitor.motion.placed_pair import place_pair
from collision_monitor.narrow_phase.contact_row import NORMAL
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.narrow_phase.dispatch import pair_contact
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.calls import core_support
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.registry import BALL, REVOLVED

RESTS, PARTS, DEEPENS = range(3)
"""What shapes do that touch: they are never deep within the window; they are apart at a time; they may go into each
other from a time on, as far as one direction tells."""

HALVINGS: Final = 60
"""Times tried for the parting, each half of the one before: down to 1e-18 of the window."""

STEPS: Final = 200
"""Most directions along which a pair is followed. More: a rocking body may change its edge more often."""

ALIGNED: Final = 1e-12
"""Sine of an angle that counts as zero. It changes a support value by this part of the size, less than GJK_TOUCHING.
Larger: the change comes near GJK_TOUCHING. Smaller: a wheel whose axis is rounded no longer rolls."""


@inlined
def _reach(table: Any, s: int, R: Any, n: Vector) -> float:
    """How far (m) a shape with the rotation R reaches along n; infinite: a half-space not along its normal."""
    d = rotate_back(R, n)
    if table.kind[s] == HALF_SPACE:
        off = minus(d, (table.size[s, 0], table.size[s, 1], table.size[s, 2]))
        return table.size[s, 3] if dot(off, off) <= ALIGNED else inf
    return core_support(table, s, d[0], d[1], d[2]) + rounding(table, s)


@inlined
def _gap_along(table: Any, a: int, b: int, pose: PairPose, n: Vector) -> float:
    """Gap (m) of two shapes along n, from their support functions; negative if they overlap along it."""
    R_a, R_b, between = pose
    return dot(n, between) - _reach(table, a, R_a, n) - _reach(table, b, R_b, opposite(n))


@inlined
def _is_about(w: Vector, n: Vector) -> bool:
    """Whether an angular velocity is about n, or zero."""
    across = cross(w, n)
    return dot(across, across) <= ALIGNED * ALIGNED * dot(w, w)


@inlined
def _turning(table: Any, s: int, R: Any, o: Vector, w: Vector, n: Vector) -> Vector:
    """Angular velocity of a shape, without a rotation that leaves its reach along n as it is.

    That is one about n, of a ball, or of a wheel on its axle.
    """
    if _is_about(w, n):
        return AT_REST
    if o[0] == 0.0 and o[1] == 0.0 and o[2] == 0.0:
        if BALL[table.kind[s]]:
            return AT_REST
        if REVOLVED[table.kind[s]]:
            off = cross(w, (R[0, 2], R[1, 2], R[2, 2]))
            if dot(off, off) <= ALIGNED * ALIGNED * dot(w, w):
                return AT_REST
    return w


@inlined
def _rolling(table: Any, at: Placed, n: Vector) -> Placed:
    """The shapes without rotations that leave their reach along n as it is, see `_turning`.

    On an arc about n, an origin has a constant acceleration along n.
    """
    w_a = _turning(table, at.a, at.R_a, at.o_a, at.w_a, n)
    w_b = _turning(table, at.b, at.R_b, at.o_b, at.w_b, n)
    acceleration, jerk, harder_a, harder_b = at.change
    jerk = 0.0 if _is_about(at.w_a, n) and _is_about(at.w_b, n) else jerk
    harder_a = harder_a if dot(w_a, w_a) > 0.0 else AT_REST
    harder_b = harder_b if dot(w_b, w_b) > 0.0 else AT_REST
    change = PairChange(acceleration, jerk, harder_a, harder_b)
    return Placed(at.a, at.b, at.R_a, at.R_b, at.o_a, at.o_b, at.p, at.v, w_a, w_b, change)


@outlined
def touching_impact(
    table: Any, parts: Any, pair: Any, window: Any, skin: float, apart: float, separation: float, scratch: Any
) -> tuple[int, float]:
    """What a pair of convex shapes (ShapePair) does that touches at the begin of the window, and when (s).

    Gaps count beyond the separation (m). skin (m): depth from which on it is an impact. apart (m): gap from which on
    the shapes have parted.
    """
    A, B, a, b = pair
    begin, end = window
    out = scratch.out
    t = before = begin
    n, is_new = AT_REST, True
    for _ in range(STEPS):
        placed = place_pair(table, parts, pair, t, scratch)
        gap = 0.0 if is_new else _gap_along(table, a, b, placed.pose, n) - separation
        if is_new or gap < -0.5 * skin:
            pair_contact(table, a, b, placed.pose, out, scratch.work)
            n = (out[NORMAL], out[NORMAL + 1], out[NORMAL + 2])
            gap, is_new = _gap_along(table, a, b, placed.pose, n) - separation, False
            if gap < -0.5 * skin:
                return DEEPENS, before
        if gap > apart:
            return PARTS, t
        border = min(end, smooth_until(A, B, t))
        at = _rolling(table, in_motion(pair, placed, t, border - t), n)
        d = advance_along_axis(table, at, n, AT_REST, 0.0, gap + skin, border - t)
        share = 1.0
        for _halving in range(HALVINGS):  # the latest time of these at which they are apart along the direction
            later = t + share * d
            if later <= t:
                break
            then = place_pair(table, parts, pair, later, scratch)
            if _gap_along(table, a, b, then.pose, n) - separation > apart:
                return PARTS, later
            share *= 0.5
        if d >= border - t:
            if border == end:
                return RESTS, end
            before, t = t, border
            continue
        if t + d <= t:
            return DEEPENS, before
        before = t
        t += d
    return DEEPENS, before
