"""Bodies with many contacts at once: the arrays, and the kernel that finds the impulses of all contacts together."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor._jit import device, kernel
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, Indices, coordinates
from collision_monitor.response.checks import masses, unit


class Bodies(NamedTuple):
    """N bodies in the world frame. An inverse mass of 0 with an inverse inertia of 0 is an immovable body."""

    inverse_mass: Array  # (N,) 1/kg
    inverse_inertia: Array  # (N, 3, 3) 1/(kg m²), about the centre of mass
    velocity: Array  # (N, 3) m/s
    angular: Array  # (N, 3) rad/s

    @classmethod
    def without_rotation(cls, mass: ArrayLike, velocity: ArrayLike) -> Bodies:
        """Bodies of masses (N,) in kg that do not turn, with velocities (N, 2 or 3). Raises InputError."""
        v = coordinates(velocity, "velocity")
        m = masses(mass)[..., 0]
        if v.ndim != 2 or m.shape not in ((), (len(v),)):
            raise InputError(f"expected velocities (N, 2 or 3) and masses (N,), got {v.shape} and {m.shape}")
        space = np.zeros((len(v), 3))
        space[:, : v.shape[1]] = v
        inverse = np.broadcast_to(1.0 / m, len(v)).copy()
        return cls(inverse, np.zeros((len(v), 3, 3)), space, np.zeros((len(v), 3)))


class Contacts(NamedTuple):
    """M contacts of bodies A and B, by their indices; arms from their centres of mass to the contact point."""

    a: Indices  # (M,)
    b: Indices  # (M,)
    normal: Array  # (M, 3) unit, from A to B
    arm_a: Array  # (M, 3) m
    arm_b: Array  # (M, 3) m

    @classmethod
    def between(
        cls, pairs: ArrayLike, normal: ArrayLike, arm_a: ArrayLike | None = None, arm_b: ArrayLike | None = None
    ) -> Contacts:
        """Contacts of pairs (M, 2) with normals and arms (M, 2 or 3) of any length; no arms: no torque.

        Raises InputError.
        """
        index = np.asarray(pairs)
        if index.ndim != 2 or index.shape[1] != 2 or index.dtype.kind not in "iu":
            raise InputError(f"pairs: expected whole numbers of shape (M, 2), got {index.dtype} {index.shape}")
        if (index[:, 0] == index[:, 1]).any():
            raise InputError("pairs: expected two different bodies, got a body in contact with itself")
        vectors = [np.zeros((len(index), 3)) for _ in range(3)]
        given = (unit(normal), arm_a, arm_b) if len(index) else (None, None, None)
        for target, value, name in zip(vectors, given, ("normal", "arm A", "arm B"), strict=True):
            if value is not None:
                array = coordinates(value, name)
                if array.shape[:-1] not in ((), (len(index),)):
                    raise InputError(f"{name}: expected one vector for each of {len(index)} pairs, got {array.shape}")
                target[:, : array.shape[-1]] = array
        a, b = index.astype(np.int64).T.copy()
        return cls(a, b, *vectors)

    def check(self, bodies: int) -> None:
        """Raise InputError for an index beyond the number of bodies."""
        if len(self.a) and not (min(self.a.min(), self.b.min()) >= 0 and max(self.a.max(), self.b.max()) < bodies):
            raise InputError(f"pairs: expected indices from 0 to {bodies - 1}, got others")

    def closing(self, bodies: Bodies) -> Array:
        """Speed (M,) in m/s at which each contact closes; negative if it opens."""
        return np.asarray(-np.einsum("ni,ni->n", self.slip(bodies), self.normal))

    def slip(self, bodies: Bodies) -> Array:
        """Velocity (M, 3) of B's contact point relative to A's, in m/s."""
        a, b = self.a, self.b
        of_a = bodies.velocity[a] + np.cross(bodies.angular[a], self.arm_a)
        return np.asarray(bodies.velocity[b] + np.cross(bodies.angular[b], self.arm_b) - of_a)

    def fastest(self, bodies: Bodies) -> float:
        """Largest speed component (m/s) of a contact point of either body."""
        sides = ((self.a, self.arm_a), (self.b, self.arm_b))
        speeds = [np.abs(bodies.velocity[k] + np.cross(bodies.angular[k], arm)).max(initial=0.0) for k, arm in sides]
        return float(max(speeds))

    def take(self, which: Any) -> Contacts:
        """The contacts that a mask (M,) or indices select."""
        return Contacts(*(column[which] for column in self))


def solve(
    bodies: Bodies,
    contacts: Contacts,
    target: Array,
    friction: Array,
    budget: Array,
    impulse: Array,
    iterations: int,
    tolerance: float,
) -> tuple[Bodies, int]:
    """Bodies after the least impulses with which each contact opens at `target` (M,) m/s or more; the iterations.

    friction (M,) and budget (M,): Coulomb's bound on the sideways impulse is friction * (normal impulse + budget), in
    N s. impulse (M, 3): normal and two sideways impulses, with which the search starts and which it overwrites.
    Projected Gauss-Seidel: one contact after the other, until no velocity changes by more than `tolerance` (m/s).
    (Catto, 2005; Erleben, 2013)
    """
    velocity, angular = bodies.velocity.copy(), bodies.angular.copy()
    row = np.zeros((len(contacts.a), 12))
    used = _solve(
        bodies.inverse_mass, bodies.inverse_inertia, velocity, angular, *contacts,
        target, friction, budget, impulse, row, iterations, tolerance,
    )  # fmt: skip
    return bodies._replace(velocity=velocity, angular=angular), int(used)


@kernel
def _solve(
    inverse_mass: Any, inverse_inertia: Any, velocity: Any, angular: Any, a: Any, b: Any, normal: Any, arm_a: Any,
    arm_b: Any, target: Any, friction: Any, budget: Any, impulse: Any, row: Any, iterations: int, tolerance: float,
) -> int:  # fmt: skip
    """Row (M, 12): three directions (normal and two sideways), and for each the inverse of its response to a push."""
    for k in range(len(a)):
        _lay_row(inverse_mass, inverse_inertia, a, b, normal, arm_a, arm_b, row, k)
        for axis in range(3):
            if impulse[k, axis] != 0.0:
                size = impulse[k, axis]
                _push(inverse_mass, inverse_inertia, velocity, angular, a, b, arm_a, arm_b, row, k, axis, size)
    used = 0
    for _ in range(iterations):
        used += 1
        change = 0.0
        for m in range(len(a)):
            k = m if used % 2 == 1 else len(a) - 1 - m  # to and fro: a stack needs few passes
            axes = 3 if friction[k] > 0.0 else 1
            if axes == 3:
                step_u = -row[k, 10] * _speed(velocity, angular, a, b, arm_a, arm_b, row, k, 1)
                step_v = -row[k, 11] * _speed(velocity, angular, a, b, arm_a, arm_b, row, k, 2)
                u, v = impulse[k, 1] + step_u, impulse[k, 2] + step_v
                most, length = friction[k] * (impulse[k, 0] + budget[k]), (u * u + v * v) ** 0.5
                if length > most:
                    u, v = u * (most / length), v * (most / length)
                for axis in range(1, 3):
                    wanted = u if axis == 1 else v
                    step = wanted - impulse[k, axis]
                    impulse[k, axis] = wanted
                    if step != 0.0:
                        _push(inverse_mass, inverse_inertia, velocity, angular, a, b, arm_a, arm_b, row, k, axis, step)
                        change = max(change, abs(step) / row[k, 9 + axis])
            speed = _speed(velocity, angular, a, b, arm_a, arm_b, row, k, 0)
            wanted = max(impulse[k, 0] + row[k, 9] * (target[k] - speed), 0.0)
            step = wanted - impulse[k, 0]
            impulse[k, 0] = wanted
            if step != 0.0:
                _push(inverse_mass, inverse_inertia, velocity, angular, a, b, arm_a, arm_b, row, k, 0, step)
                change = max(change, abs(step) / row[k, 9])
        if change <= tolerance:
            break
    return used


@device
def _lay_row(
    inverse_mass: Any, inverse_inertia: Any, a: Any, b: Any, normal: Any, arm_a: Any, arm_b: Any, row: Any, k: int
) -> None:
    """Write the row of contact k, see `_solve`."""
    x, y, z = normal[k, 0], normal[k, 1], normal[k, 2]
    # sideways directions: the axis least along the normal, made perpendicular
    ux, uy, uz = (1.0, 0.0, 0.0) if abs(x) <= abs(y) and abs(x) <= abs(z) else (
        (0.0, 1.0, 0.0) if abs(y) <= abs(z) else (0.0, 0.0, 1.0)
    )  # fmt: skip
    tx, ty, tz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    length = (tx * tx + ty * ty + tz * tz) ** 0.5
    tx, ty, tz = tx / length, ty / length, tz / length
    row[k, 0], row[k, 1], row[k, 2] = x, y, z
    row[k, 3], row[k, 4], row[k, 5] = tx, ty, tz
    row[k, 6], row[k, 7], row[k, 8] = y * tz - z * ty, z * tx - x * tz, x * ty - y * tx
    for axis in range(3):
        response = 0.0
        for body, arm in ((a[k], arm_a), (b[k], arm_b)):
            response += inverse_mass[body]
            dx, dy, dz = row[k, 3 * axis], row[k, 3 * axis + 1], row[k, 3 * axis + 2]
            rx, ry, rz = arm[k, 0], arm[k, 1], arm[k, 2]
            cx, cy, cz = ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx
            for i in range(3):
                c = cx if i == 0 else (cy if i == 1 else cz)
                response += c * (
                    inverse_inertia[body, i, 0] * cx
                    + inverse_inertia[body, i, 1] * cy
                    + inverse_inertia[body, i, 2] * cz
                )
        row[k, 9 + axis] = 1.0 / response if response > 0.0 else 0.0


@device
def _speed(velocity: Any, angular: Any, a: Any, b: Any, arm_a: Any, arm_b: Any, row: Any, k: int, axis: int) -> float:
    """Speed (m/s) of B's contact point relative to A's along a direction of contact k."""
    i, j = a[k], b[k]
    total = 0.0
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        total += row[k, 3 * axis + c] * (
            velocity[j, c] + angular[j, d] * arm_b[k, e] - angular[j, e] * arm_b[k, d]
            - velocity[i, c] - angular[i, d] * arm_a[k, e] + angular[i, e] * arm_a[k, d]
        )  # fmt: skip
    return total


@device
def _push(
    inverse_mass: Any, inverse_inertia: Any, velocity: Any, angular: Any, a: Any, b: Any, arm_a: Any, arm_b: Any,
    row: Any, k: int, axis: int, size: float,
) -> None:  # fmt: skip
    """Apply an impulse (N s) along a direction of contact k to B, and its reaction to A."""
    dx, dy, dz = row[k, 3 * axis], row[k, 3 * axis + 1], row[k, 3 * axis + 2]
    for body, arm, signed in ((a[k], arm_a, -size), (b[k], arm_b, size)):
        rx, ry, rz = arm[k, 0], arm[k, 1], arm[k, 2]
        cx, cy, cz = ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx
        velocity[body, 0] += inverse_mass[body] * dx * signed
        velocity[body, 1] += inverse_mass[body] * dy * signed
        velocity[body, 2] += inverse_mass[body] * dz * signed
        for c in range(3):
            angular[body, c] += signed * (
                inverse_inertia[body, c, 0] * cx + inverse_inertia[body, c, 1] * cy + inverse_inertia[body, c, 2] * cz
            )
