"""First impacts of pairs of moving convex solids, packed as rows of numbers."""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.direct import direct
from collision_monitor.impact.body_impact import ImpactQuery, Scratch, Window, body_impact, make_scratch
from collision_monitor.impact.impact_record import CLEAR, HIT, IMPACT
from collision_monitor.motion.bodies import BodyTable, Multibody, Parts, make_bodies, make_parts
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE, DISTANCE
from collision_monitor.query.contact.contact_rows import write_contact
from collision_monitor.query.packed import fits, load_pair
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.tolerances import GJK_TOUCHING

DECIDED: Final = 0
TOUCHING: Final = 1
TOO_SMALL: Final = 2
"""Codes of a row: its times are final; the pair touches at the start and has to be followed; more memory is needed."""


class ImpactMemory(NamedTuple):
    """Two bodies and the work memory of their search."""

    bodies: BodyTable
    parts: Parts
    scratch: Scratch
    event: Any  # (1,) IMPACT
    row: Any  # (CONTACT_SIZE,)


def impact_memory() -> ImpactMemory:
    """Make two bodies of one shape each, in slots 0 and 1 of the table."""
    bodies, parts = make_bodies(2), make_parts(2)
    bodies.id[:] = bodies.first_shape[:] = (0, 1)
    return ImpactMemory(bodies, parts, make_scratch(), np.zeros(1, IMPACT), np.zeros(CONTACT_SIZE))


@inlined
def set_motion(bodies, slot, states, n, table, horizon):
    """Write the packed motion states[n] to the body in a slot, which has one shape, in the same slot of the table."""
    motion = bodies.motion[slot]
    motion.x, motion.y, motion.z = states[n, 0], states[n, 1], states[n, 2]
    motion.vx, motion.vy, motion.vz = states[n, 7], states[n, 8], states[n, 9]
    motion.wx, motion.wy, motion.wz = states[n, 10], states[n, 11], states[n, 12]
    motion.ax, motion.ay, motion.az = states[n, 13], states[n, 14], states[n, 15]
    motion.radius, motion.cover = table.radius[slot], horizon
    quaternion_to_matrix(states[:, 3:7], n, motion.rotation)
    bodies.spin_radius[slot] = 0.0 if table.kind[slot] == SPHERE else table.radius[slot]


@direct
@kernel
def pair_impact_rows(a, at_a, states_a, b, at_b, states_b, query, own, memory, rows):
    """Write the first impacts of N pairs to rows (N, 3): lower and upper (s), infinite for none, and a code.

    a, b, at_a, at_b: as for `contact_rows`; states (N, 16) or (1, 16): packed motions. query (4,): horizon (s),
    tolerance (m), separation (m) and iterations. own: ImpactMemory.
    """
    bodies, parts, scratch, event, contact = own
    horizon, separation = query[0], query[2]
    search = ImpactQuery(separation, query[1], int(query[3]))
    first, second = np.int32(0), np.int32(1)
    for k in range(len(rows)):
        i, j = min(k, len(states_a) - 1), min(k, len(states_b) - 1)
        start_a, start_b = at_a[min(k, len(at_a) - 1)], at_b[min(k, len(at_b) - 1)]
        rows[k, 0] = rows[k, 1] = inf
        rows[k, 2] = DECIDED
        if not fits(memory, a, start_a, b, start_b):
            rows[k, 2] = TOO_SMALL
            continue
        write_contact(a, start_a, states_a, i, b, start_b, states_b, j, memory, contact)
        table, _, _ = load_pair(memory, a, start_a, b, start_b)
        round_off = GJK_TOUCHING * (table.radius[0] + table.radius[1])
        if contact[DISTANCE] < separation - round_off:
            rows[k, 0] = rows[k, 1] = 0.0
            continue
        set_motion(bodies, 0, states_a, i, table, horizon)
        set_motion(bodies, 1, states_b, j, table, horizon)
        multibody = Multibody(table, parts, bodies)
        body_impact(multibody, first, second, Window(0.0, horizon), search, scratch, event[0])
        if event[0].status == CLEAR:
            continue
        rows[k, 0] = event[0].lower
        if event[0].status == HIT and event[0].upper <= horizon:
            rows[k, 1] = event[0].upper
        if event[0].lower <= 0.0:
            rows[k, 2] = TOUCHING
