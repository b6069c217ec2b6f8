"""First impacts of meshes that are not due yet: only until when their boxes stay apart (`mesh_impact_tolerance`).

The search of mesh_impact.py, ended as soon as boxes are so small and so near that their triangles
are within a gap of some cm. The lower end is as certain as that of a full search. A collision is certain if triangles
meet at one of a few later times; else the upper end is open. Pairs that are due are searched again from there, with a
gap of at least the motion in a step.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import dot
from collision_monitor.impact.body_impact import ShapePair, Tube, Window, closing_speed, tube_of
from collision_monitor.impact.impact_record import (
    BOUND_ONLY,
    CLEAR,
    CONSERVATIVE_ADVANCEMENT,
    HIT,
    UNRESOLVED,
    write_pair,
)
from collision_monitor.impact.mesh_impact import mesh_impact
from collision_monitor.impact.mesh_pair import SURFACES, has_mesh, shapes_within
from collision_monitor.impact.sphere_interval import meeting_of_spheres, relative_motion_at, sphere_interval
from collision_monitor.impact.tree_impact import SearchEnd, tree_approach_at
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.motion import (
    half_acceleration,
    pair_state,
    position_at,
    relative_velocity,
)
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.kinds.half_space import HALF_SPACE

TRIES: Final = (1.5, 4.0)
"""Times after the lower end at which triangles may meet: those in which the bodies move by so many gaps."""


@device
def _write_hit(pair: ShapePair, t: float, event: Any, out: Any) -> None:
    """Set what a certain collision at time t (s) has, from the contact of two triangles about A's origin."""
    A, B = pair.A, pair.B
    x, y, z = position_at(A, t)
    event.upper, event.status, event.method = t, HIT, CONSERVATIVE_ADVANCEMENT
    event.point_x = x + 0.5 * (out[POINT_A] + out[POINT_B])
    event.point_y = y + 0.5 * (out[POINT_A + 1] + out[POINT_B + 1])
    event.point_z = z + 0.5 * (out[POINT_A + 2] + out[POINT_B + 2])
    event.normal_x, event.normal_y, event.normal_z = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    state = pair_state(A, B, t)
    event.closing_speed = closing_speed(state.v, state.w_a, state.w_b, state.p, out)


@device
def _overlaps(table: Any, parts: Any, pair: ShapePair, t: float, allowed: float, scratch: Any) -> bool:
    """Whether shapes overlap at time t (s) by more than `allowed` (m); then scratch.out has the contact about A."""
    out = scratch.out
    p, _ = tree_approach_at(table, parts, pair, t, 0.0, 0.0, t, scratch)
    pose = PairPose(scratch.rotation[2], scratch.rotation[3], p)
    if not shapes_within(table, pair.a, pair.b, pose, -allowed, SURFACES, out, scratch):
        return False
    offset = place_shape(table, parts, pair.a, scratch.rotation[0], scratch.rotation[2])
    for c in range(3):
        out[POINT_A + c] += offset[c]
        out[POINT_B + c] += offset[c]
    return out[DISTANCE] + out[BOUND] + allowed <= 0.0


@inlined
def _together(A: Any, B: Any, window: Window, margin: float) -> tuple[float, float]:
    """First and last time (s) after the begin of a window at which the bounding spheres of two motions may overlap."""
    begin, end = window
    tube, approach = tube_of(A, B, begin), relative_motion_at(A, B, begin)
    growth = tube.growth + half_acceleration(A, B, begin, end) * (end - begin)
    return sphere_interval(approach.p, approach.v, A.radius + B.radius + margin + tube.start, growth, end - begin, 1.0)


@outlined
def coarse_impact(
    multibody: Any, i: int, j: int, window: Window, query: Any, ending: SearchEnd, scratch: Any, event: Any
) -> bool:
    """Write a bound on the first impact of two bodies with `has_bounds` into the IMPACT record `event`.

    event.status = CLEAR if there is none. Returns False if only a full search can tell, because one of the bodies is
    inside the other. ending: SearchEnd; the radius of the smaller body limits its gap too.
    """
    table, parts, bodies = multibody
    begin = window.begin
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    event.status = CLEAR
    tube, approach = tube_of(A, B, begin), relative_motion_at(A, B, begin)
    first, last = _together(A, B, window, query.margin)
    if first > last:
        return True
    pair = ShapePair(A, B, bodies.first_shape[i], bodies.first_shape[j])
    start, stop = begin + first, begin + last
    near = SearchEnd(min(ending.tolerance, A.radius, B.radius), ending.period, begin)
    there = Tube(tube.start + tube.growth * first, tube.growth)
    status, lower, _, gap = mesh_impact(table, parts, pair, Window(start, stop), there, query, near, scratch)
    if status == HIT:  # one is in the other
        return False
    if status == CLEAR:
        return True
    write_pair(bodies, i, j, event)
    event.shape_i, event.shape_j = pair.a, pair.b
    event.lower, event.upper, event.status, event.method = lower, inf, UNRESOLVED, BOUND_ONLY
    v = relative_velocity(A, B, lower)
    speed = sqrt(dot(v, v))
    for ahead in TRIES:
        t = lower + ahead * gap / speed if speed > 0.0 else inf
        allowed = tube.start + tube.growth * (t - begin) - query.margin
        if t <= stop and _overlaps(table, parts, pair, t, allowed, scratch):
            _write_hit(pair, t, event, scratch.out)
            return True
    meeting_of_spheres(A, B, approach, begin, lower - begin, event)
    return True


@inlined
def has_bounds(multibody: Any, i: int, j: int) -> bool:
    """Whether two bodies are one shape each, one of them a mesh or a cloud, none a half-space, none with a plan."""
    table, parts, bodies = multibody
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    return (
        has_mesh(table, a, b)
        and not (bodies.planned[i] or bodies.planned[j])
        and parts.next[a] < 0
        and parts.next[b] < 0
        and table.kind[a] != HALF_SPACE
        and table.kind[b] != HALF_SPACE
    )


@inlined
def may_meet(A: Any, B: Any, window: Window, margin: float) -> bool:
    """Whether the bounding spheres of two motions may overlap within a window."""
    first, last = _together(A, B, window, margin)
    return first <= last
