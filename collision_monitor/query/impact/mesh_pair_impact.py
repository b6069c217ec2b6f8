"""First impact of two moving meshes, or of a mesh and another shape with a tree, in one call of a kernel."""

from __future__ import annotations

from math import inf

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.impact.body_impact import ImpactQuery, ShapePair, Tube, Window, body_impact, shape_impact
from collision_monitor.impact.impact_record import CLEAR, HIT
from collision_monitor.impact.sphere_interval import relative_motion_at, sphere_interval
from collision_monitor.meshes.distance.nearest import LEAST, PLACE_A, PLACE_B
from collision_monitor.meshes.layout import FACE, WIDTH
from collision_monitor.meshes.trees.shape_trees import NEVER, have_kernels, kept_tree
from collision_monitor.motion.bodies import Multibody
from collision_monitor.motion.motion import half_acceleration
from collision_monitor.narrow_phase.contact_row import DISTANCE
from collision_monitor.query.contact.contact_rows import write_contact
from collision_monitor.query.contact.convex_pairs import MEMORY
from collision_monitor.query.impact.pair_impact_rows import set_motion
from collision_monitor.query.packed import load_pair, packed_motion, packed_shape
from collision_monitor.query.pair_table import pair_table
from collision_monitor.shapes.pose import Motion
from collision_monitor.shapes.registry import Shape
from collision_monitor.tolerances import GJK_TOUCHING


def first_mesh_impact(
    shape_a: Shape,
    motion_a: Motion,
    shape_b: Shape,
    motion_b: Motion,
    query: tuple[float, float, float, int],
    begin: float = 0.0,
) -> tuple[float, float] | None:
    """First impact of two moving shapes: lower and upper (s), infinite for none; of an open mesh its surface.

    query: horizon (s), tolerance (m), separation (m), iterations. begin: time (s) before which there is none.
    None for a pair without trees or without a mesh, and for shapes that touch at the start, which have to be followed
    (touching.py).
    """
    found = mesh_impact_of_faces(shape_a, motion_a, shape_b, motion_b, query, (0, 0), begin)
    return found and found[:2]


def mesh_impact_of_faces(
    shape_a: Shape,
    motion_a: Motion,
    shape_b: Shape,
    motion_b: Motion,
    query: tuple[float, float, float, int],
    faces: tuple[int, int],
    begin: float = 0.0,
) -> tuple[float, float, bool] | None:
    """`first_mesh_impact`, and whether faces certainly meet that are among the first so many of each shape."""
    if not have_kernels(kept_tree(shape_a), kept_tree(shape_b), NEVER):
        return None
    try:
        states = motion_a.packed_motion, motion_b.packed_motion
    except AttributeError:
        states = packed_motion(motion_a), packed_motion(motion_b)
        if states[0] is None or states[1] is None:
            return None
    found = _mesh_impact.entry(pair_table(shape_a, shape_b, True), *states, *query, *faces, begin, MEMORY.impact)
    return found if found[0] > 0.0 else None


def impact_in_hulls(
    hull_a: Shape,
    shape_a: Shape,
    motion_a: Motion,
    hull_b: Shape,
    shape_b: Shape,
    motion_b: Motion,
    query: tuple[float, float, float, int],
) -> tuple[float, float] | None:
    """First impact of two moving shapes in convex solids that move with them: lower of the solids, upper of the shapes.

    The shapes are sought from the time on at which the solids meet. query, None: as for `first_mesh_impact`; also None
    for solids that touch at the start.
    """
    try:
        hulls = hull_a.packed_shape, hull_b.packed_shape  # type: ignore[attr-defined]
        states = motion_a.packed_motion, motion_b.packed_motion
    except AttributeError:
        hulls, states = (packed_shape(hull_a), packed_shape(hull_b)), (packed_motion(motion_a), packed_motion(motion_b))
        if any(each is None for each in (*hulls, *states)):
            return None
    table = pair_table(shape_a, shape_b, True)
    memory = MEMORY.enlarge(*hulls)
    first, lower, upper = _impact_in_hulls.entry(*hulls, table, *states, *query, MEMORY.impact, memory)
    return (min(first, lower), upper) if lower > 0.0 else None


@inlined
def _search(table, state_a, state_b, window, search, own):
    """Find the first impact of the shapes in a table into the event of the memory."""
    bodies, parts, scratch, event, _ = own
    set_motion(bodies, 0, state_a, 0, table, window.end)
    set_motion(bodies, 1, state_b, 0, table, window.end)
    body_impact(Multibody(table, parts, bodies), 0, 1, window, search, scratch, event[0])
    return event[0]


@inlined
def _times(event, horizon):
    """Lower and upper (s) of an impact, infinite for none."""
    if event.status == CLEAR:
        return inf, inf
    return event.lower, event.upper if event.status == HIT and event.upper <= horizon else inf


@settled
@kernel
def _mesh_impact(table, state_a, state_b, horizon, tolerance, separation, iterations, faces_a, faces_b, begin, own):
    """First impact: lower and upper (s), infinite for none; lower is 0 for shapes that touch at the start.

    And whether the triangles that meet are among the first faces_a and faces_b. states (1, 16): packed motions. begin:
    time at which the search begins (s). own: ImpactMemory.
    """
    answer = own[2].answer
    answer[LEAST] = -1.0
    search = ImpactQuery(separation, tolerance, iterations)
    event = _search(table, state_a, state_b, Window(begin, horizon), search, own)
    lower, upper = _times(event, horizon)
    a, b = int(answer[PLACE_A]), int(answer[PLACE_B])
    # another search, which may have found other triangles, writes LEAST
    if not (lower < inf and upper < inf and answer[LEAST] == -1.0 and a >= 0 and b >= 0):
        return lower, upper, False
    of_a, of_b = table.blocks[a // WIDTH, FACE, a % WIDTH], table.blocks[b // WIDTH, FACE, b % WIDTH]
    return lower, upper, of_a < faces_a and of_b < faces_b


@inlined
def _first_time(table, parts, bodies, window, search, scratch):
    """First time in a window (s) at which two convex solids meet, or may meet; infinite: never."""
    A, B = bodies.motion[0], bodies.motion[1]
    approach = relative_motion_at(A, B, window.begin)
    reach, bent = A.radius + B.radius + search.margin, half_acceleration(A, B) * window.end
    first, last = sphere_interval(approach.p, approach.v, reach, bent, window.end, 1.0)
    if first > last:
        return inf
    pair = ShapePair(A, B, np.int32(0), np.int32(1))
    status, t, _, _ = shape_impact(table, parts, pair, Window(first, last), Tube(0.0, 0.0), search, scratch)
    return inf if status == CLEAR else t


@settled
@kernel
def _impact_in_hulls(hull_a, hull_b, table, state_a, state_b, horizon, tolerance, separation, iterations, own, memory):
    """First time at which packed convex solids meet, and `_mesh_impact` from then on; all 0 for solids that touch.

    memory: of `pair_memory`.
    """
    bodies, parts, scratch, _, contact = own
    search = ImpactQuery(separation, tolerance, iterations)
    hulls, _, _ = load_pair(memory, hull_a, 0, hull_b, 0)
    set_motion(bodies, 0, state_a, 0, hulls, horizon)
    set_motion(bodies, 1, state_b, 0, hulls, horizon)
    first = _first_time(hulls, parts, bodies, Window(0.0, horizon), search, scratch)
    if first == inf:
        return inf, inf, inf
    if not first > 0.0:
        write_contact(hull_a, 0, state_a, 0, hull_b, 0, state_b, 0, memory, contact)
        if not contact[DISTANCE] < separation - GJK_TOUCHING * (hulls.radius[0] + hulls.radius[1]):
            return 0.0, 0.0, 0.0
    lower, upper = _times(_search(table, state_a, state_b, Window(first, horizon), search, own), horizon)
    return first, lower, upper
