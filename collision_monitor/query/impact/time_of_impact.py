"""`time_of_impact`: interval that contains the time at which two moving shapes first meet."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from collision_monitor.checks.numbers import checked_number, checked_whole
from collision_monitor.errors import TooCostlyError, UnsupportedError
from collision_monitor.impact.impact_record import HIT
from collision_monitor.meshes.trees.shape_trees import CERTAIN, kept_tree
from collision_monitor.motion.bodies import Multibody
from collision_monitor.query.arguments import Compound
from collision_monitor.query.contact.contact import Contact, contact
from collision_monitor.query.contact.fillings import fillings
from collision_monitor.query.contact.open_gap import least_gap
from collision_monitor.query.impact.impact import (
    CLEAR_IMPACT,
    Impact,
    impact_of_times,
    timed_impact,
)
from collision_monitor.query.impact.initial_contact_impact import follow
from collision_monitor.query.impact.moving_pair import (
    ITERATIONS,
    MotionQuery,
    MovingShape,
    deep_overlap_time,
    first_impacts,
    in_convex_pieces,
    lay_out_pair,
    make_moving_shape,
)
from collision_monitor.query.impact.single_kernel_impact import quick_open_impact, single_kernel_impact
from collision_monitor.records import Method
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.pose import Motion
from collision_monitor.shapes.registry import HalfSpace, Mesh
from collision_monitor.tolerances import GJK_TOUCHING


def time_of_impact(
    shape_a: Compound,
    motion_a: Motion,
    shape_b: Compound,
    motion_b: Motion,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    method: str = "conservative_advancement",
    step: float = 1 / 60,
) -> Impact:
    """First time in [0, horizon] (s) at which two shapes or compounds are within `separation` (m) of each other.

    Both move at constant angular velocity and linear acceleration. At lower they are within `tolerance` (m) of it and
    not before, by conservative advancement along separating directions (Mirtich, 1996; van den Bergen, 2003, 4.5) or,
    for spheres, in closed form. `iterations`: limit of distance queries for a pair of convex pieces.
    An overlap at the start is a hit at 0. Shapes that only touch and then part, slide, roll or rest have no impact.
    method: another way for two convex shapes without acceleration. "closed_form": spheres, or a sphere and a HalfSpace;
    "swept_sat": boxes that do not turn; both are exact. "bisection": steps of `step` (s) until the shapes overlap, then
    backs up and bisects; "end_of_step": the end of that step. Both may miss a contact within a step, so lower is that
    of the bounding spheres, and the answer without an overlap is unresolved. "swept_bounds": the bounding spheres only.
    Raises InputError, ShapeError, PoseError; UnsupportedError for a plane shape with a solid one, two HalfSpaces.

    >>> import collision_monitor as cm
    >>> still, towards = cm.Motion(cm.Pose()), cm.Motion(cm.Pose((3, 0, 0)), linear=(-1, 0, 0))
    >>> cm.time_of_impact(cm.Sphere(1), still, cm.Sphere(1), towards)
    Impact(hit in 1 to 1 s)
    """
    query = check_query(horizon, tolerance, separation, iterations)
    if method != "conservative_advancement":
        from collision_monitor.query.impact.impact_by_method import impact_by_method  # which loads the other kernels

        duration = checked_number(step, "step", least=0.0, above=True)
        return impact_by_method(shape_a, motion_a, shape_b, motion_b, query, method, duration)
    arguments = shape_a, motion_a, shape_b, motion_b
    is_open = _is_open(shape_a) or _is_open(shape_b)
    quick = (quick_open_impact if is_open else single_kernel_impact)(*arguments, query)
    if quick is not None:
        return impact_of_times(quick, arguments)
    a, b = make_moving_shape(shape_a, motion_a, "A"), make_moving_shape(shape_b, motion_b, "B")
    check_bounded(a, b)
    found = _first_impact(a, b, query)
    if all(shape.surface.certain for body in (a, b) for shape, _ in body.shapes if isinstance(shape, Mesh)):
        return found
    possible = _first_possible_impact(a, b, query) if found.lower > 0.0 else 0.0
    return found if possible >= found.lower else timed_impact(possible, found.upper, found.method, arguments)


def _is_open(shape: Compound) -> bool:
    """Whether it is a mesh with an uncertain inside."""
    return type(shape) is Mesh and kept_tree(shape).inside != CERTAIN


def _round_off(multibody: Multibody) -> float:
    """Depth (m) of two bodies up to which they only touch."""
    radii = multibody.bodies.motion["radius"]
    return GJK_TOUCHING * float(radii[np.isfinite(radii)].sum())


def _first_possible_impact(a: MovingShape, b: MovingShape, query: MotionQuery) -> float:
    """First time (s) at which the solids of open meshes may meet; infinite for never."""
    gap = least_gap(a.shapes, a.motion.pose, b.shapes, b.motion.pose)
    a, b = (make_moving_shape([*s.shapes, *fillings(s.shapes)], s.motion, "filled") for s in (a, b))
    multibody = lay_out_pair(a, b, query.horizon)
    if gap < query.separation - _round_off(multibody):
        return 0.0
    events = first_impacts(multibody, np.array([[0, 1]], np.int32), 0.0, query)
    if len(events) and events[0]["lower"] <= 0.0:
        return _first_impact(a, b, query, uncertain=True).lower
    return float(events[0]["lower"]) if len(events) else math.inf


def _may_overlap(a: MovingShape, b: MovingShape, start: Contact, separation: float, round_off: float) -> bool:
    """Whether concave solids whose surfaces touch may overlap: where faces lie in one plane, no depth shows."""
    if separation != 0.0 or start.signed_distance > round_off:
        return False
    meshes = [shape for body in (a, b) for shape, _ in body.shapes if is_concave_mesh(shape)]
    is_known = all(isinstance(shape, Mesh) and shape.surface.certain and shape.surface.closed for shape in meshes)
    return bool(meshes) and is_known and start.signed_distance - start.error_bound < -round_off


def _first_impact(a: MovingShape, b: MovingShape, query: MotionQuery, uncertain: bool = False) -> Impact:
    """First impact of the shapes, of an open mesh its surface; `uncertain`: a possible overlap at the start counts."""
    start = contact(a.shapes, a.motion.pose, b.shapes, b.motion.pose)
    multibody = lay_out_pair(a, b, query.horizon)
    round_off = _round_off(multibody)
    least = start.signed_distance - (start.error_bound if uncertain else 0.0)
    if least < query.separation - round_off:
        return Impact("hit", 0.0, 0.0, start)
    arguments = a.shapes, a.motion, b.shapes, b.motion
    if _may_overlap(a, b, start, query.separation, round_off):
        upper = deep_overlap_time(multibody, query, round_off)
        if upper <= 0.0:
            return Impact("hit", 0.0, 0.0, start)
        return timed_impact(0.0, upper, Method.CONSERVATIVE_ADVANCEMENT, arguments)
    events = first_impacts(multibody, np.array([[0, 1]], np.int32), 0.0, query)
    if not len(events):
        return CLEAR_IMPACT
    lower = float(events[0]["lower"])
    upper = float(events[0]["upper"]) if events[0]["status"] == HIT else math.inf
    if lower <= 0.0:
        near = query.separation + 2.0 * query.tolerance + 2.0 * round_off
        try:
            lower, upper = follow(in_convex_pieces(a, b, near), in_convex_pieces(b, a, near), query, round_off)
        except TooCostlyError:
            lower, upper = 0.0, math.inf
        sure = deep_overlap_time(multibody, query, round_off)
        if sure < lower:  # triangles that start in one plane go through each other, and do not meet again
            lower = 0.0
        upper = min(upper, sure)
        if lower == math.inf:
            return CLEAR_IMPACT
    upper = upper if upper <= query.horizon else math.inf
    return timed_impact(lower, upper, Method(int(events[0]["method"])), arguments)


def check_query(horizon: float, tolerance: float, separation: float, iterations: int) -> MotionQuery:
    """Check the parameters of the query. Raises InputError."""
    try:
        return _checked(horizon, tolerance, separation, iterations)
    except TypeError:  # of what has no hash
        return _checked.__wrapped__(horizon, tolerance, separation, iterations)


@lru_cache(maxsize=16, typed=True)
def _checked(horizon: Any, tolerance: Any, separation: Any, iterations: Any) -> MotionQuery:
    return MotionQuery(
        horizon=checked_number(horizon, "horizon", least=0.0),
        tolerance=checked_number(tolerance, "tolerance", least=0.0, above=True),
        separation=checked_number(separation, "separation", least=0.0),
        iterations=checked_whole(iterations, "iterations"),
    )


def check_bounded(a: MovingShape, b: MovingShape) -> None:
    """Raise UnsupportedError if both bodies are unbounded."""
    if all(any(isinstance(s, HalfSpace) for s, _ in body.shapes) for body in (a, b)):
        raise UnsupportedError("two HalfSpaces: expected one at most; every other shape meets a HalfSpace")
