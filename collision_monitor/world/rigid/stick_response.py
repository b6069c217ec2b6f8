"""Perfectly inelastic bodies: those that meet stay together, and each group moves as one rigid body."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.response.bonded import groups, move_as_one
from collision_monitor.shapes.pose import from_rotation_vector, rotation_matrix
from collision_monitor.world.rigid.rigid_bodies import RigidBodies

LONGEST: Final = 1 / 240
"""Longest substep (s)."""

PARTS: Final = 16
"""Parts of the longest substep: the shortest one, by which bodies may stick early."""

TOUCH: Final = 1e-6
"""Bodies nearer than this part of the smallest half extent touch."""


class StickResponse:
    """Advances bodies in substeps that end when the next two meet; what touches while it closes sticks for good.

    A group turns at a constant angular velocity until it meets another body; it does not tumble.
    """

    def __init__(self, gravity: float) -> None:
        self._gravity = gravity
        self.bonds = np.zeros((0, 2), np.int64)
        """Pairs (M, 2) of bodies that stick together."""

    def advance(self, world: RigidBodies, dt: float) -> None:
        """Advance by `dt` seconds. See Response."""
        left = dt
        while left > 1e-12:
            left -= self._substep(world, left)

    def _substep(self, world: RigidBodies, left: float) -> float:
        shortest = LONGEST / PARTS
        travel = 2.0 * (world.fastest() + self._gravity * LONGEST) * LONGEST
        near = world.touching(max(travel, 0.02 * world.size))
        label = groups(len(world.mass), self.bonds)
        a, b = near.contacts.a, near.contacts.b
        closing = near.contacts.closing(world.bodies())
        meet = (near.gap <= np.maximum(TOUCH * world.size, closing * shortest)) & (closing >= 0.0)
        new = meet & (label[a] != label[b])
        self.bonds = np.concatenate([self.bonds, np.stack([a[new], b[new]], axis=1)])
        bodies = move_as_one(world.bodies(), world.position, self.bonds)
        closing = near.contacts.closing(bodies)
        soon = (near.gap > TOUCH * world.size) & (closing > 0.0)
        until = float((near.gap[soon] / closing[soon]).min(initial=np.inf))
        h = min(max(min(until, LONGEST), shortest), left)

        label = groups(len(world.mass), self.bonds)
        fixed = np.zeros(len(label), bool)
        fixed[label[~world.movable]] = True
        falling = ~fixed[label]
        velocity = bodies.velocity.copy()
        velocity[falling, 2] -= self._gravity * h
        bodies = bodies._replace(velocity=velocity)
        mass = np.where(falling, world.mass, 0.0)[:, None]
        centre, whole = np.zeros_like(velocity), np.zeros((len(label), 1))
        np.add.at(whole, label, mass)
        np.add.at(centre, label, mass * np.where(falling[:, None], world.position, 0.0))
        arm = np.where(falling[:, None], world.position - (centre / np.where(whole > 0.0, whole, 1.0))[label], 0.0)
        turn = rotation_matrix(from_rotation_vector(h * bodies.angular))
        turned = (turn @ arm[:, :, None])[:, :, 0]
        exact = turned - arm - h * np.cross(bodies.angular, arm)
        exact[falling, 2] += 0.5 * self._gravity * h * h  # free flight is a parabola
        world.move(bodies, h, exact)
        world.velocity = bodies.velocity + np.cross(bodies.angular, turned - arm)
        grouped = (np.bincount(label, minlength=len(label)) > 1)[label]
        world.angular[grouped] = bodies.angular[grouped]
        return h
