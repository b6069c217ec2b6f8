"""The first impact of two bodies of any kind, each in one motion: those that touch at the start, and open meshes."""

from __future__ import annotations

from math import inf
from typing import Final

import numpy as np

from collision_monitor.errors import TooCostlyError
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.meshes.trees.shape_trees import CERTAIN
from collision_monitor.query.body import PosedShapes, QueryBody, laid_out
from collision_monitor.query.contact.contact import contact
from collision_monitor.query.contact.contact_kernel import contact_row
from collision_monitor.query.contact.fillings import fillings
from collision_monitor.query.contact.open_gap import least_gap, location_of
from collision_monitor.query.impact.impact_kernel import (
    TOUCHES,
    first_certain_overlap,
    first_impact,
    first_impact_of_touching,
)
from collision_monitor.query.impact.impact_query import MotionQuery
from collision_monitor.query.impact.moving_body import MovingBody, touching_pieces
from collision_monitor.records import Method
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.registry import Mesh
from collision_monitor.tolerances import GJK_TOUCHING

FILLED: Final = 1.75
"""Bound on the radius of the fillings of an open mesh, in radii of the mesh: a box about points in a ball has corners
that are the root of 3 times as far away."""

DEEPENING_TIMES: Final = 40
"""Times tried for a certain overlap of shapes that touch at the start, each half of the one before: down to 1e-12 of
the horizon."""


def impact_of_motions(a: MovingBody, b: MovingBody, query: MotionQuery) -> tuple[float, float, Method]:
    """Lower, upper (s), infinite for none, and method of the first impact of any two bodies that are checked.

    Of an open mesh, lower is that of the solids which it may belong to.
    """
    lower, upper, method = _impact_of_surfaces(a, b, query)
    if lower > 0.0 and not a.body.inside == b.body.inside == CERTAIN:
        lower = min(lower, _first_possible_impact(a, b, query))
    if not (a.body.certain is a.body and b.body.certain is b.body):
        upper = _certain_impact(a, b, query)
    return lower, upper if upper <= query.horizon else inf, method


def _certain_impact(a: MovingBody, b: MovingBody, query: MotionQuery) -> float:
    """Latest time (s) of an impact of what is certainly there of two objects; infinite for none."""
    if a.body.certain is None or b.body.certain is None:
        return inf
    sure = a._replace(body=a.body.certain), b._replace(body=b.body.certain)
    return impact_of_motions(*sure, query)[1]


def _impact_of_surfaces(a: MovingBody, b: MovingBody, query: MotionQuery) -> tuple[float, float, Method]:
    """Lower, upper (s), infinite for none, and method of an impact of the surfaces of open meshes, else of solids."""
    first_a, first_b = a.body.slots.first, b.body.slots.first
    start = _certain_start(a, b, query)
    if start is not None:
        return start
    lower, upper, code = first_impact(first_a, a.motion, first_b, b.motion, query)
    if code == TOUCHES:
        lower, upper = _followed(a, b, query)
        sure = first_certain_overlap((first_a, first_b), (a.motion, b.motion), query)
        if sure < lower:  # triangles that start in one plane go through each other, and do not meet again
            lower = 0.0
        upper = min(upper, sure)
    return lower, upper, Method.CONSERVATIVE_ADVANCEMENT


def round_off_of(a: QueryBody, b: QueryBody) -> float:
    """Depth (m) of two objects up to which they only touch, as the kernels have it."""
    return GJK_TOUCHING * sum(radius for radius in (a.radius, b.radius) if radius < inf)


def _are_apart(a: MovingBody, b: MovingBody, query: MotionQuery, larger: float = 1.0) -> bool:
    """Whether spheres about both origins, larger by a factor, are farther apart than the separation at the start."""
    between = b.motion.pose.position - a.motion.pose.position
    reach = larger * (a.body.radius + b.body.radius)
    return bool(np.linalg.norm(between) > reach + query.separation)


def _certain_start(a: MovingBody, b: MovingBody, query: MotionQuery) -> tuple[float, float, Method] | None:
    """The impact of objects of which one is inside the other at the start, or that may be: no depth shows that."""
    method = Method.CONSERVATIVE_ADVANCEMENT
    if not (a.body.has_mesh or b.body.has_mesh) or _are_apart(a, b, query):
        return None
    found = contact(a.body.shapes, a.motion.pose, b.body.shapes, b.motion.pose)
    round_off = round_off_of(a.body, b.body)
    if found.signed_distance < query.separation - round_off:
        return 0.0, 0.0, method
    concave = [shape for side in (a, b) for shape, _ in side.body.shapes if is_concave_mesh(shape)]
    is_known = all(isinstance(each, Mesh) and each.surface.certain and each.surface.closed for each in concave)
    touch = query.separation == 0.0 and found.signed_distance <= round_off
    if concave and is_known and touch and found.signed_distance - found.error_bound < -round_off:
        # faces of concave solids in one plane: they may overlap, although no depth shows
        sure = first_certain_overlap((a.body.slots.first, b.body.slots.first), (a.motion, b.motion), query)
        return 0.0, 0.0 if sure <= 0.0 else sure, method
    return None


def _followed(a: MovingBody, b: MovingBody, query: MotionQuery) -> tuple[float, float]:
    """Lower and upper (s) of objects that touch at the start, piece by piece."""
    near = query.separation + 2.0 * query.tolerance + 2.0 * round_off_of(a.body, b.body)
    try:
        pieces = laid_out(touching_pieces(a, b, near)), laid_out(touching_pieces(b, a, near))
        chains, motions = (a.body.slots.first, b.body.slots.first), (a.motion, b.motion)
        lower, upper = first_impact_of_touching(chains, motions, pieces, query)
    except TooCostlyError:
        lower, upper = 0.0, inf
    if lower < inf == upper:
        upper = _sampled_overlap(a, b, query)
    return lower, upper


def _sampled_overlap(a: MovingBody, b: MovingBody, query: MotionQuery) -> float:
    """An early one of some times (s) at which the objects are certainly deeper than round-off, or infinity."""
    wanted, found = query.separation - 2.0 * round_off_of(a.body, b.body), inf
    for t in query.horizon * 0.5 ** np.arange(DEEPENING_TIMES):
        poses = a.motion.at(t), b.motion.at(t)
        distance, _, _ = contact_row(a.body.slots.first, poses[0], b.body.slots.first, poses[1], SURFACES, wanted)
        if distance < wanted:
            found = float(t)
        elif found < inf:
            break
    return found


def _first_possible_impact(a: MovingBody, b: MovingBody, query: MotionQuery) -> float:
    """First time (s) at which the solids of open meshes may meet; infinite for never."""
    poses = a.motion.pose, b.motion.pose
    if not _are_apart(a, b, query, FILLED):
        places = location_of(a.body, poses[0], b.body, poses[1])
        if any(place != Location.OUTSIDE for place in places):
            return 0.0
        if least_gap(a.body, poses[0], b.body, poses[1]) < query.separation - round_off_of(a.body, b.body):
            return 0.0
    of_a, of_b = fillings(a.body.shapes), fillings(b.body.shapes)
    pairs: list[tuple[PosedShapes, PosedShapes]] = [(of_a, [*b.body.pieces, *of_b]), (a.body.pieces, of_b)]
    first = inf
    for pieces_a, pieces_b in pairs:
        if len(pieces_a) and len(pieces_b):
            slots = laid_out(pieces_a), laid_out(pieces_b)
            lower, _, _ = first_impact(slots[0].first, a.motion, slots[1].first, b.motion, query)
            first = min(first, lower)
    return first
