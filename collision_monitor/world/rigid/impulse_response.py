"""Impulses: impacts at their time with restitution, resting contacts with friction held by impulses."""

from __future__ import annotations

from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.response.bonded import groups
from collision_monitor.response.contact_set import Bodies
from collision_monitor.response.resting import hold_contacts
from collision_monitor.response.simultaneous import bodies_collide_together
from collision_monitor.world.rigid.box_contacts import MOST_CORNERS
from collision_monitor.world.rigid.rigid_bodies import RigidBodies, Touching

Array = NDArray[np.float64]

LONGEST: Final = 1 / 240
"""Longest substep (s)."""

PARTS: Final = 16
"""Usual parts of the longest substep: the shortest one, by which an impact may come early."""

TOUCH: Final = 1e-6
"""Bodies nearer than this part of the smallest half extent touch."""

SINK: Final = 1e-4
"""Penetration, as part of the smallest half extent, that is left alone. Smaller: the push out makes stacks rock."""

PUSH_OUT: Final = 0.2
"""Part of a deeper penetration that a substep removes, without giving the bodies a velocity."""

PASSES: Final = 200
"""Limit of the passes over the contacts in a substep."""

ROUNDS: Final = 20
"""Limit of the reflections of simultaneous impacts; bodies that are wedged in a pile stop after them."""


class ImpulseResponse:
    """Advances bodies in substeps that end when the next two bodies meet.

    Conservative advancement of the whole scene: a substep lasts until the first pair could meet along its normal. The
    bodies that then touch get the impulses of their impacts together; gravity and friction follow, with the impulses
    of the last substep as the start, so that bodies at rest stay at rest.
    """

    def __init__(self, restitution: float, gravity: float, parts: int = PARTS) -> None:
        self._restitution, self._gravity, self._shortest = restitution, gravity, LONGEST / parts
        self._last: Touching | None = None
        self._force: Array = np.zeros((0, 3))
        self.residual = 0.0
        """Largest speed (m/s) by which a contact still closed too fast, over all substeps."""

    def advance(self, world: RigidBodies, dt: float) -> None:
        """Advance by `dt` seconds. See Response."""
        left = dt
        while left > 1e-12:
            left -= self._substep(world, left)

    def _substep(self, world: RigidBodies, left: float) -> float:
        shortest, touch = self._shortest, TOUCH * world.size
        slow = max(2.0 * self._gravity * LONGEST, 1e-9)  # m/s: the speed that gravity gives while bodies rest
        travel = 2.0 * (world.fastest() + self._gravity * LONGEST) * LONGEST
        near = world.touching(max(travel, 0.02 * world.size))
        bodies, contacts = world.bodies(), near.contacts
        closing = contacts.closing(bodies)
        hits = (closing > slow) & ((near.gap <= touch) | (near.gap <= closing * shortest))
        earlier = np.zeros(len(near.gap))
        if hits.any():
            bodies = self._impacts(world, bodies, near, hits, earlier)
            closing = contacts.closing(bodies)
        soon = (closing > slow) & (near.gap > touch)
        until = float((near.gap[soon] / closing[soon]).min(initial=np.inf))
        h = min(max(min(until, left / ceil(left / LONGEST)), shortest), left)

        weight = np.where(world.movable, -self._gravity * h, 0.0)
        bodies = bodies._replace(velocity=bodies.velocity + weight[:, None] * [0.0, 0.0, 1.0])
        friction = np.minimum(world.friction[contacts.a], world.friction[contacts.b])
        opening = -np.maximum(near.gap, 0.0) / h
        start = self._last_force(near, 0.2 * world.size) * h
        held = hold_contacts(bodies, contacts, opening, friction, start, earlier, PASSES, 1e-9 * slow + 1e-12)
        self._last, self._force = near, held.impulse / h
        self.residual = max(self.residual, held.residual)

        pushed = np.zeros(len(world.mass), bool)
        acting = (held.impulse[:, 0] > 0.0) | (earlier > 0.0)
        pushed[contacts.a[acting]] = pushed[contacts.b[acting]] = True
        shift = self._push_out(world, held.bodies, near, h)
        shift[:, 2] -= np.where(pushed, 0.0, 0.5 * h * weight)  # free flight is a parabola
        world.move(held.bodies, h, shift)
        return h

    def _impacts(
        self, world: RigidBodies, bodies: Bodies, near: Touching, hits: NDArray[np.bool_], earlier: Array
    ) -> Bodies:
        """Let the touching bodies collide that a hit reaches, also through others; normal impulses go to `earlier`."""
        a, b = near.contacts.a, near.contacts.b
        joined = (near.gap <= TOUCH * world.size) | hits
        moves = joined & world.movable[a] & world.movable[b]
        label = groups(len(world.mass), np.stack([a[moves], b[moves]], axis=1))
        of = np.where(world.movable[a], label[a], label[b])
        which = np.flatnonzero(joined & np.isin(of, of[hits]))
        after, impulse = bodies_collide_together(bodies, near.contacts.take(which), self._restitution, PASSES, ROUNDS)
        earlier[which] = impulse
        return after

    def _last_force(self, near: Touching, reach: float) -> Array:
        """Forces (M, 3) of the nearest contact points of the same pairs in the last substep, within `reach` (m)."""
        found = np.zeros((len(near.pair), 3))
        last = self._last
        if last is None or not len(last.pair):
            return found
        first = np.searchsorted(last.pair, near.pair)
        nearest = np.full(len(near.pair), reach * reach)
        for corner in range(MOST_CORNERS):
            at = np.minimum(first + corner, len(last.pair) - 1)
            away = near.contacts.arm_a - last.contacts.arm_a[at]
            distance = np.where(last.pair[at] == near.pair, np.einsum("ni,ni->n", away, away), np.inf)
            better = distance < nearest
            found[better], nearest[better] = self._force[at[better]], distance[better]
        return found

    def _push_out(self, world: RigidBodies, bodies: Bodies, near: Touching, h: float) -> Array:
        """Displacement (N, 3) in m that reduces penetrations, as the motion of bodies at rest."""
        over = near.gap + SINK * world.size
        still = bodies._replace(velocity=np.zeros_like(bodies.velocity), angular=np.zeros_like(bodies.angular))
        if not (over < 0.0).any():
            return still.velocity
        opening = -np.where(over < 0.0, PUSH_OUT * over, over) / h
        return hold_contacts(still, near.contacts, opening, iterations=PASSES, tolerance=1e-9).bodies.velocity * h
