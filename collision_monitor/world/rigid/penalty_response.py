"""Penalty method: springs, and dampers where the restitution is below 1, push overlapping bodies apart."""

from __future__ import annotations

from math import log, pi, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device, kernel
from collision_monitor.world.rigid.rigid_bodies import RigidBodies

DEPTH: Final = 0.02
"""Penetration at the fastest impact that the scene expects, as part of the smallest half extent."""

STEP: Final = 0.05
"""Step as part of the time in which a spring turns by one radian. Larger: energy grows; at 1 it explodes."""

LONGEST: Final = 1 / 400
"""Time (s) between two searches for contacts; between them, gaps follow the velocities."""

LEAST_RESTITUTION: Final = 0.01
"""Smallest restitution that dampers are made for; 0 would need an infinite damping."""


class PenaltyResponse:
    """Advances bodies with a spring at each contact point, and a damper for restitution below 1.

    All springs have the same frequency, so one step suits all masses. Friction is Coulomb's, but viscous near rest: a
    body on a slope creeps.
    """

    def __init__(self, restitution: float, gravity: float, speed: float) -> None:
        self._gravity, self._speed = gravity, speed
        decay = -log(max(restitution, LEAST_RESTITUTION))
        self._damping = 2.0 * decay / sqrt(pi * pi + decay * decay)  # c / sqrt(k m)

    def advance(self, world: RigidBodies, dt: float) -> None:
        """Advance by `dt` seconds. See Response."""
        frequency = self._speed / (DEPTH * world.size)  # rad/s
        searches = max(1, int(np.ceil(dt / LONGEST)))
        h = dt / searches
        steps = max(1, int(np.ceil(h * frequency / STEP)))
        for _ in range(searches):
            travel = 2.0 * (world.fastest() + self._gravity * h) * h
            contacts, gap, _ = world.touching(max(travel, 0.02 * world.size))
            bodies = world.bodies()
            friction = np.minimum(world.friction[contacts.a], world.friction[contacts.b])
            velocity, angular = bodies.velocity.copy(), bodies.angular.copy()
            moved, turned = np.zeros_like(velocity), np.zeros_like(angular)
            _spring_steps(
                bodies.inverse_mass, bodies.inverse_inertia, velocity, angular, *contacts, gap.copy(), friction,
                frequency, self._damping, self._gravity, h / steps, steps, moved, turned, np.zeros((len(velocity), 6)),
            )  # fmt: skip
            mean = bodies._replace(velocity=moved / h, angular=turned / h)
            world.move(mean, h, np.zeros_like(velocity))
            world.velocity, world.angular = velocity, angular


@kernel
def _spring_steps(
    inverse_mass: Any, inverse_inertia: Any, velocity: Any, angular: Any, a: Any, b: Any, normal: Any, arm_a: Any,
    arm_b: Any, gap: Any, friction: Any, frequency: float, damping: float, gravity: float, h: float, steps: int,
    moved: Any, turned: Any, change: Any,
) -> None:  # fmt: skip
    """Semi-implicit Euler: all forces of a step from its start, so that the order of the contacts does not matter."""
    for step in range(steps):
        change[:] = 0.0
        for k in range(len(a)):
            i, j = a[k], b[k]
            mass = 1.0 / (inverse_mass[i] + inverse_mass[j])
            slip = (
                _slip(velocity, angular, i, j, arm_a, arm_b, k, 0), _slip(velocity, angular, i, j, arm_a, arm_b, k, 1),
                _slip(velocity, angular, i, j, arm_a, arm_b, k, 2),
            )  # fmt: skip
            speed, square = 0.0, 0.0
            for c in range(3):
                speed += slip[c] * normal[k, c]
                square += slip[c] * slip[c]
            if step > 0:
                gap[k] += h * speed
            if gap[k] >= 0.0:
                continue
            push = max(mass * frequency * (-frequency * gap[k] - damping * speed), 0.0)
            sideways = sqrt(max(square - speed * speed, 0.0))
            drag = min(friction[k] * push, mass * frequency * sideways) / sideways if sideways > 0.0 else 0.0
            fx = h * (push * normal[k, 0] - drag * (slip[0] - speed * normal[k, 0]))
            fy = h * (push * normal[k, 1] - drag * (slip[1] - speed * normal[k, 1]))
            fz = h * (push * normal[k, 2] - drag * (slip[2] - speed * normal[k, 2]))
            _add(change, i, -1.0, fx, fy, fz, arm_a, k)
            _add(change, j, 1.0, fx, fy, fz, arm_b, k)
        for n in range(len(velocity)):
            if inverse_mass[n] == 0.0:
                continue
            velocity[n, 2] -= gravity * h
            for c in range(3):
                velocity[n, c] += inverse_mass[n] * change[n, c]
                for d in range(3):
                    angular[n, c] += inverse_inertia[n, c, d] * change[n, 3 + d]
            for c in range(3):
                moved[n, c] += h * velocity[n, c]
                turned[n, c] += h * angular[n, c]


@device
def _slip(velocity: Any, angular: Any, i: int, j: int, arm_a: Any, arm_b: Any, k: int, c: int) -> Any:
    """Velocity (m/s) along axis c of body j at contact k, relative to body i there."""
    d, e = (c + 1) % 3, (c + 2) % 3
    return (
        velocity[j, c] + angular[j, d] * arm_b[k, e] - angular[j, e] * arm_b[k, d]
        - velocity[i, c] - angular[i, d] * arm_a[k, e] + angular[i, e] * arm_a[k, d]
    )  # fmt: skip


@device
def _add(change: Any, body: int, sign: float, fx: float, fy: float, fz: float, arm: Any, k: int) -> None:
    """Add an impulse (N s) at contact k, and its torque, to the change of a body."""
    change[body, 0] += sign * fx
    change[body, 1] += sign * fy
    change[body, 2] += sign * fz
    change[body, 3] += sign * (arm[k, 1] * fz - arm[k, 2] * fy)
    change[body, 4] += sign * (arm[k, 2] * fx - arm[k, 0] * fz)
    change[body, 5] += sign * (arm[k, 0] * fy - arm[k, 1] * fx)
