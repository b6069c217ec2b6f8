"""Rigid bodies of a simulation: spheres and boxes as a structure of arrays, their contacts and their motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.box_pairs import box_pairs
from collision_monitor.narrow_phase.contact_row import DISTANCE, NORMAL, POINT_A
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.response.contact_set import Bodies, Contacts
from collision_monitor.response.mass import mass_properties
from collision_monitor.shapes.pose import from_rotation_vector, multiply, rotation_matrix
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.shapes.shape_table import ShapeTableBuilder
from collision_monitor.world.rigid.box_contacts import MOST_CORNERS, face_contacts

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Touching(NamedTuple):
    """M contact points of bodies within a margin."""

    contacts: Contacts
    gap: Array  # (M,) m, negative for penetration
    pair: Indices  # (M,) number of the pair of bodies, ascending


class RigidBodies:
    """N spheres and boxes in the world frame, of constant density; static ones have an infinite mass.

    position (N, 3) m, quaternion (N, 4) x, y, z, w, velocity (N, 3) m/s, angular (N, 3) rad/s, friction (N,).
    """

    def __init__(
        self, shapes: Sequence[Sphere | Box], position: Array, quaternion: Array, static: NDArray[np.bool_],
        friction: Array, density: float = 1000.0,
    ) -> None:  # fmt: skip
        count = len(shapes)
        builder = ShapeTableBuilder(slots=count)
        for shape in shapes:
            builder.append(shape)
        self._table = builder.table
        properties = [mass_properties(shape, density) for shape in shapes]
        self.mass: Array = np.where(static, np.inf, [each.mass for each in properties])
        moments = np.array([np.diag(each.inertia) for each in properties])
        self._inverse_moments: Array = np.where(static[:, None], 0.0, 1.0 / moments)
        self.box = np.array([isinstance(shape, Box) for shape in shapes])
        extents = [(2 * shape.radius,) * 3 if isinstance(shape, Sphere) else shape.size for shape in shapes]
        self.half: Array = np.array(extents) / 2
        self.size = float(self.half[~static].min())
        """Smallest half extent of a movable body (m)."""
        self.movable: NDArray[np.bool_] = ~static
        self.friction = friction
        self.position: Array = np.array(position, dtype=np.float64)
        self.quaternion: Array = np.array(quaternion, dtype=np.float64)
        self.velocity: Array = np.zeros((count, 3))
        self.angular: Array = np.zeros((count, 3))
        self._reach = np.linalg.norm(self.half, axis=1) * self.box + self.half[:, 0] * ~self.box

    def bodies(self) -> Bodies:
        """Inverse masses and velocities in the world frame, for the response functions."""
        rotation = rotation_matrix(self.quaternion)
        inverse = np.einsum("nij,nj,nkj->nik", rotation, self._inverse_moments, rotation)
        return Bodies(1.0 / self.mass, inverse, self.velocity, self.angular)

    def fastest(self) -> float:
        """Upper bound (m/s) of the speed of any point of a body."""
        return float((np.linalg.norm(self.velocity, axis=1) + np.linalg.norm(self.angular, axis=1) * self._reach).max())

    def energy(self, gravity: float) -> float:
        """Kinetic and potential energy (J) of the movable bodies, with gravity (m/s²) along -z."""
        turning = rotation_matrix(self.quaternion).swapaxes(1, 2) @ self.angular[:, :, None]
        spin = (turning[:, :, 0][self.movable] ** 2 / self._inverse_moments[self.movable]).sum()
        m, v, height = self.mass[self.movable], self.velocity[self.movable], self.position[self.movable, 2]
        return float((m * (0.5 * (v**2).sum(axis=1) + gravity * height)).sum() + 0.5 * spin)

    def touching(self, margin: float) -> Touching:
        """Contact points of all pairs with a movable body whose gap is at most `margin` (m), sorted by pair."""
        rotation = rotation_matrix(self.quaternion)
        extent = np.where(self.box[:, None], (np.abs(rotation) @ self.half[:, :, None])[:, :, 0], self.half)
        pairs = box_pairs(self.position, extent + 0.5 * margin, self.movable)
        rows = contact_batch(self._table, self.position, rotation, pairs)
        near = rows[:, DISTANCE] <= margin
        pairs, rows = np.ascontiguousarray(pairs[near]), rows[near]
        normal = rows[:, NORMAL : NORMAL + 3].copy()
        m = len(pairs)
        point, gap = np.zeros((m, MOST_CORNERS, 3)), np.zeros((m, MOST_CORNERS))
        count = np.zeros(m, np.int64)
        faces = np.flatnonzero(self.box[pairs].all(axis=1))
        if len(faces):
            at = normal[faces], point[faces], gap[faces], count[faces]
            face_contacts(
                self.half, self.position, rotation, pairs[faces], at[0], margin, at[1], at[2], at[3],
                np.zeros((2, MOST_CORNERS, 3)),
            )  # fmt: skip
            normal[faces], point[faces], gap[faces], count[faces] = at
        single = count == 0
        count[single] = 1
        normal[single] = rows[single, NORMAL : NORMAL + 3]
        gap[single, 0] = rows[single, DISTANCE]
        middle = rows[single, POINT_A : POINT_A + 3] + 0.5 * rows[single, DISTANCE, None] * normal[single]
        point[single, 0] = self.position[pairs[single, 0]] + middle
        used = np.arange(MOST_CORNERS) < count[:, None]
        which = np.nonzero(used)[0]
        a, b = pairs[which].astype(np.int64).T
        where = point[used]
        contacts = Contacts(a, b, normal[which], where - self.position[a], where - self.position[b])
        return Touching(contacts, gap[used], a * len(self.mass) + b)

    def move(self, bodies: Bodies, dt: float, shift: Array) -> None:
        """Take over the velocities of `bodies` and move with them for `dt` seconds and by `shift` (N, 3) m.

        A body that turns freely keeps its angular momentum, not its angular velocity.
        """
        self.velocity, self.angular = bodies.velocity, bodies.angular
        self.position = self.position + dt * self.velocity + shift
        turned = multiply(from_rotation_vector(dt * self.angular), self.quaternion)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        free = self.box & self.movable
        before, after = rotation_matrix(self.quaternion[free]), rotation_matrix(turned[free])
        moments = self._inverse_moments[free]
        momentum = before @ (np.einsum("nij,ni->nj", before, self.angular[free]) / moments)[:, :, None]
        self.angular = self.angular.copy()
        self.angular[free] = (after @ (moments[:, :, None] * (after.swapaxes(1, 2) @ momentum)))[:, :, 0]
        self.quaternion = turned
