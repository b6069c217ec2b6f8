"""Time of impact by a selectable classical method, with an interval that states what the method certifies."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import numpy as np

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.query.contact.contact import contact
from collision_monitor.query.impact.impact import Impact
from collision_monitor.query.impact.impact_methods import METHODS, bisection, end_of_step, swept_bounds
from collision_monitor.query.impact.impact_query import MotionQuery
from collision_monitor.query.impact.moving_body import moving_body
from collision_monitor.records import Method
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Shape
from collision_monitor.tolerances import GJK_TOUCHING

MOST_STEPS: Final = 1_000_000
"""Most steps of a sampling method, which take about a second."""

NUMBERS: Final = {
    "closed_form": Method.CLOSED_FORM,
    "swept_bounds": Method.BOUND,
    "swept_sat": Method.SWEPT_SAT,
    "bisection": Method.BISECTION,
    "end_of_step": Method.SAMPLING,
}


def impact_by_method(
    shape_a: Compound,
    motion_a: Motion | Trajectory,
    shape_b: Compound,
    motion_b: Motion | Trajectory,
    query: MotionQuery,
    method: str,
    step: float,
) -> Impact:
    """See `time_of_impact`. Raises InputError, UnsupportedError."""
    if not isinstance(method, str) or method not in NUMBERS:
        raise InputError(f"method: expected one of conservative_advancement, {', '.join(NUMBERS)}, got {method!r}")
    if query.horizon / step > MOST_STEPS:
        least = query.horizon / MOST_STEPS
        raise InputError(f"step: expected at least {least:g} s, the horizon / {MOST_STEPS}, got {step:g}")
    sides = moving_body(shape_a, motion_a, "A"), moving_body(shape_b, motion_b, "B")
    motion_a, motion_b = sides[0].motion, sides[1].motion
    if any(len(side.body.shapes) > 1 or side.body.shapes[0][1].numbers != Pose().numbers for side in sides):
        raise UnsupportedError(f"method {method}: compounds are not offered; use conservative_advancement")
    motions = motion_a, motion_b
    if query.separation > 0.0 or any(each.acceleration.any() or not each.is_straight for each in motions):
        raise UnsupportedError(
            f"method {method}: no separation, no acceleration and no arc; use conservative_advancement"
        )
    if method == "swept_sat" and (motion_a.angular.any() or motion_b.angular.any()):
        raise UnsupportedError("method swept_sat: expected boxes that do not turn; use conservative_advancement")
    a, b = sides[0].body.shapes[0][0], sides[1].body.shapes[0][0]
    states = [
        np.concatenate([m.pose.position, m.pose.quaternion, m.linear, m.angular])[None] for m in (motion_a, motion_b)
    ]
    call = METHODS[method]
    if method in ("bisection", "end_of_step"):
        call = partial(bisection if method == "bisection" else end_of_step, step=step)
    if isinstance(a, HalfSpace):  # the closed form takes the sphere first
        found = float(call(b, states[1], a, states[0], query.horizon)[0])
    else:
        found = float(call(a, states[0], b, states[1], query.horizon)[0])
    number = NUMBERS[method]
    if method in ("closed_form", "swept_sat"):  # exact but for round-off
        if found == math.inf:
            return Impact("clear", math.inf, math.inf, None, number)
        slack = _time_of_round_off(a, motion_a, b, motion_b) if found > 0.0 else 0.0
        meeting = contact(a, motion_a.at(found), b, motion_b.at(found))
        return Impact("hit", max(found - slack, 0.0), found + slack, meeting, number)
    # the bounding spheres do not meet before; a sampling method alone would not know what it missed
    unbounded = isinstance(a, HalfSpace) or isinstance(b, HalfSpace)
    safe = 0.0 if unbounded else float(swept_bounds(a, states[0], b, states[1], query.horizon)[0])
    if method == "swept_bounds":
        found = math.inf
    if safe == math.inf:
        return Impact("clear", math.inf, math.inf, None, number)
    at = safe if found == math.inf else found
    meeting = contact(a, motion_a.at(at), b, motion_b.at(at))
    return Impact("unresolved" if found == math.inf else "hit", min(safe, found), found, meeting, number)


def _time_of_round_off(shape_a: Shape, a: Motion, shape_b: Shape, b: Motion) -> float:
    """Time (s) in which the shapes move by the round-off of their distance."""
    sizes = [float(np.linalg.norm(reach([(shape, Pose())], np.eye(3)))) for shape in (shape_a, shape_b)]
    speed = float(np.linalg.norm(a.linear - b.linear))
    far = float(np.linalg.norm(a.pose.position - b.pose.position)) + sum(size for size in sizes if size < math.inf)
    return GJK_TOUCHING * far / speed if speed > 0.0 else 0.0
