"""`time_of_impact`: interval that contains the time at which two moving shapes first meet."""

from __future__ import annotations

from collision_monitor.checks.numbers import checked_number
from collision_monitor.meshes.trees.shape_trees import CERTAIN
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.motion.trajectory import Trajectory, as_motion
from collision_monitor.query.body import KeptSlots, kept_slots
from collision_monitor.query.contact.contact import check_kinds, plant_bodies, plant_for_meshes
from collision_monitor.query.impact.impact import Impact, impact_of_times, timed_impact
from collision_monitor.query.impact.impact_by_method import impact_by_method
from collision_monitor.query.impact.impact_kernel import DECIDED, first_impact
from collision_monitor.query.impact.impact_of_motions import impact_of_motions
from collision_monitor.query.impact.impact_query import ITERATIONS, check_query
from collision_monitor.query.impact.moving_body import check_bounded, moving_body
from collision_monitor.query.impact.planned_impact import planned_impact
from collision_monitor.records import Method
from collision_monitor.shapes.compound import Compound


def time_of_impact(
    shape_a: Compound,
    motion_a: Motion | Trajectory,
    shape_b: Compound,
    motion_b: Motion | Trajectory,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    method: str = "conservative_advancement",
    step: float = 1 / 60,
) -> Impact:
    """First time in [0, horizon] (s) at which two shapes or compounds are within `separation` (m) of each other.

    Both move as their Motion says: straight, along an arc, or until they stand; or along a Trajectory. At lower they
    are within `tolerance` (m) of it and not before, by conservative advancement along separating directions (Mirtich,
    1996; van den Bergen, 2003, 4.5) or, for spheres, in closed form. `iterations`: limit of distance queries for a pair
    of convex pieces, and for each piece of a trajectory.
    An overlap at the start is a hit at 0. Shapes that only touch and then part, slide, roll or rest have no impact.
    method: another way for two convex shapes that go straight without acceleration. "closed_form": spheres, or a sphere
    and a HalfSpace; "swept_sat": boxes that do not turn; both are exact. "bisection": steps of `step` (s) until the
    shapes overlap, then backs up and bisects; "end_of_step": the end of that step. Both may miss a contact within a
    step, so lower is that of the bounding spheres, and the answer without an overlap is unresolved. "swept_bounds": the
    bounding spheres only.
    Raises InputError, ShapeError, PoseError; UnsupportedError for a plane shape with a solid one, two HalfSpaces.

    >>> import collision_monitor as cm
    >>> still, towards = cm.Motion(cm.Pose()), cm.Motion(cm.Pose((3, 0, 0)), linear=(-1, 0, 0))
    >>> cm.time_of_impact(cm.Sphere(1), still, cm.Sphere(1), towards)
    Impact(hit in 1 to 1 s)
    """
    query = check_query(horizon, tolerance, separation, iterations)
    if method != "conservative_advancement":
        duration = checked_number(step, "step", least=0.0, above=True)
        return impact_by_method(shape_a, motion_a, shape_b, motion_b, query, method, duration)
    motion_a, motion_b = as_motion(motion_a, "motion A"), as_motion(motion_b, "motion B")
    if isinstance(motion_a, Trajectory) or isinstance(motion_b, Trajectory):
        lower, upper = planned_impact((shape_a, motion_a), (shape_b, motion_b), query)
        return timed_impact(lower, upper, Method.CONSERVATIVE_ADVANCEMENT, (shape_a, motion_a, shape_b, motion_b))
    kept_a, kept_b = kept_slots(shape_a), kept_slots(shape_b)
    if kept_a is not None and kept_b is not None and _is_answered(kept_a, motion_a, kept_b, motion_b):
        plant_for_meshes(kept_a, shape_a, kept_b, shape_b)
        lower, upper, code = first_impact(kept_a.first, motion_a, kept_b.first, motion_b, query)
        if code == DECIDED:
            return impact_of_times((lower, upper), (shape_a, motion_a, shape_b, motion_b))
    a, b = moving_body(shape_a, motion_a, "A"), moving_body(shape_b, motion_b, "B")
    check_bounded(a.body, b.body)
    check_kinds(a.body, a.motion.pose, b.body, b.motion.pose)
    plant_bodies(a.body, b.body)
    lower, upper, used = impact_of_motions(a, b, query)
    return timed_impact(lower, upper, used, (shape_a, motion_a, shape_b, motion_b))


def _is_answered(a: KeptSlots, motion_a: Motion, b: KeptSlots, motion_b: Motion) -> bool:
    """Whether the kernel's answer is the whole one: no open mesh, and no half-space that turns or meets another one."""
    are_bounded = a.is_bounded or (b.is_bounded and not motion_a.angular.any())
    return a.inside == b.inside == CERTAIN and are_bounded and (b.is_bounded or not motion_b.angular.any())
