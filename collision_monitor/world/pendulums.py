"""Pendulums: rows of balls on rods (Newton's cradles). Some balls of each row are pulled aside."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.response.bonded import groups
from collision_monitor.response.contact_set import Bodies, Contacts
from collision_monitor.response.simultaneous import bodies_collide_together
from collision_monitor.shapes.registry import Sphere
from collision_monitor.world.rigid.response_choice import AS_USUAL, ResponseChoice
from collision_monitor.world.scene import Array, Scene, States, object_count, positive_rate, state_array

RADIUS: Final = 0.05
"""Radius of a ball (m)."""
ROD: Final = 0.5
"""Length of a rod from its pivot to the ball's centre (m)."""
ROW: Final = 5
"""Balls in a row; the last row may have fewer."""
DISTANCE: Final = 0.3
"""Distance between rows (m)."""
ANGLES: Final = (0.3, 0.8)
"""Range of the angle to which balls are pulled aside (rad)."""
MASS: Final = 1.0
"""Mass of a ball (kg); the rods have none."""
STEP: Final = 1e-3
"""Longest step (s) of the swing. Its energy oscillates by about (2 pi STEP / period)² / 8 of itself."""
SHORTEST: Final = 1e-5
"""Shortest step (s), with which a ball stops at the next one."""
TOUCH: Final = 1e-6
"""Gap (m) of balls that touch."""
SLOW: Final = 1e-3
"""Speed (m/s) below which two balls do not shorten a step: they close less than TOUCH in it."""
REST: Final = 1e-7
"""Speed (m/s) below which balls that touch count as resting on each other."""
DEPTH: Final = 0.1
"""Depth of a spring at the fastest swing, as part of the radius (responses penalty and damped)."""


class Pendulums(Scene):
    """Scene "pendulums": ids 1..n; the seed pulls one to three balls of each row. Rows swing along x."""

    def __init__(self, objects: int | None, seed: int, rate: float | None, choice: ResponseChoice = AS_USUAL) -> None:
        self.name = "pendulums"
        self.rate = positive_rate(rate, 100.0)
        count = object_count(objects, 15, 1, 500, self.name)
        random = np.random.default_rng(seed)
        self.options = choice.options(1.0)
        k = np.arange(count)
        self._ids = (k + 1).astype(np.uint32)
        self._pivot = np.stack([2 * RADIUS * (k % ROW), DISTANCE * (k // ROW), np.full(count, ROD + RADIUS)], axis=1)
        rows = -(-count // ROW)
        pulled, angle = random.integers(1, 4, rows), random.uniform(*ANGLES, rows)
        self.angle: Array = np.where(k % ROW < pulled[k // ROW], -angle[k // ROW], 0.0)
        """Angles (n,) of the rods from straight down, positive towards +x (rad)."""
        self.rate_of_turn: Array = np.zeros(count)
        """Angular velocities (n,) in rad/s."""
        first = k[:-1][(k[:-1] % ROW) < ROW - 1]
        self._pairs = np.stack([first, first + 1], axis=1)
        self._stuck = np.zeros(len(first), bool)
        bodies_collide_together(self._bodies(), self._contacts()[0])  # compiles the kernel before the time begins
        self.descriptions = [ObjectDescription(int(i), Sphere(RADIUS), f"ball_{i}") for i in self._ids]

    def _offset(self) -> Array:
        """Centres of the balls relative to their pivots (n, 3) in m."""
        still = np.zeros(len(self.angle))
        return ROD * np.stack([np.sin(self.angle), still, -np.cos(self.angle)], axis=1)

    def _advance(self, dt: float) -> None:
        left = dt
        while left > 1e-12:
            left -= self._springs(left) if self.options.response in ("penalty", "damped") else self._impacts(left)

    def _contacts(self) -> tuple[Contacts, Array]:
        """Contacts of neighbours, with arms from the pivots, and their gaps (m)."""
        a, b = self._pairs.T
        arm = self._offset()
        between = self._pivot[b] + arm[b] - self._pivot[a] - arm[a]
        distance = np.linalg.norm(between, axis=1)
        normal = between / distance[:, None]
        return Contacts(a, b, normal, arm[a] + RADIUS * normal, arm[b] - RADIUS * normal), distance - 2 * RADIUS

    def _bodies(self) -> Bodies:
        """The balls as bodies that turn about their pivots, which do not move; +x is a turn about -y."""
        count = len(self.angle)
        inverse, angular = np.zeros((count, 3, 3)), np.zeros((count, 3))
        inverse[:, 1, 1] = 1.0 / (MASS * ROD**2)
        angular[:, 1] = -self.rate_of_turn
        return Bodies(np.zeros(count), inverse, np.zeros((count, 3)), angular)

    def _impacts(self, left: float) -> float:
        """Let the balls that touch collide, then swing until the next two meet; return the time (s)."""
        contacts, gap = self._contacts()
        bodies = self._bodies()
        closing = contacts.closing(bodies)
        near = gap <= np.maximum(TOUCH, closing * SHORTEST)
        if self.options.response == "stick":
            while (new := near & (closing > SLOW) & ~self._stuck).any():  # each round sticks another pair
                self._stuck |= new
                self._stick()
                closing = contacts.closing(self._bodies())
        elif (near & (closing > REST)).any():
            after, _ = bodies_collide_together(bodies, contacts.take(near), self.options.restitution)
            self.rate_of_turn = -after.angular[:, 1]
            closing = contacts.closing(self._bodies())
        soon = (closing > SLOW) & ~near & ~self._stuck
        until = float((gap[soon] / closing[soon]).min(initial=np.inf))
        h = min(max(min(until, STEP), SHORTEST), left)
        self._swing(h, np.zeros(len(self.angle)))
        return h

    def _stick(self) -> None:
        """Give balls that stick together the mean of their angular velocities, which keeps their momentum."""
        label = groups(len(self.angle), self._pairs[self._stuck])
        count = np.bincount(label, minlength=len(label))
        self.rate_of_turn = (np.bincount(label, self.rate_of_turn, len(label)) / np.maximum(count, 1))[label]

    def _springs(self, left: float) -> float:
        """Swing for one step of the springs between the balls; return the time (s)."""
        fastest = np.sqrt(2 * max(self.options.gravity, 1.0) * ROD * (1 - np.cos(ANGLES[1])))
        frequency = float(fastest) / (DEPTH * RADIUS)
        h = min(0.05 / frequency, left)
        contacts, gap = self._contacts()
        damping = 0.0
        if self.options.response == "damped":
            decay = -np.log(max(self.options.restitution, 0.01))
            damping = 2.0 * decay / np.sqrt(np.pi**2 + decay**2)
        reduced = 0.5 * MASS * frequency
        push = np.where(gap < 0.0, reduced * (damping * contacts.closing(self._bodies()) - frequency * gap), 0.0)
        force = np.maximum(push, 0.0)[:, None] * contacts.normal
        torque = np.zeros(len(self.angle))
        np.add.at(torque, contacts.a, np.cross(contacts.arm_a, force)[:, 1])
        np.add.at(torque, contacts.b, -np.cross(contacts.arm_b, force)[:, 1])
        self._swing(h, torque / (MASS * ROD**2))
        return h

    def _swing(self, h: float, extra: Array) -> None:
        """One step of velocity Verlet; extra (n,): angular acceleration of the springs (rad/s²)."""
        pull = self.options.gravity / ROD
        middle = self.rate_of_turn + h * extra - 0.5 * h * pull * np.sin(self.angle)
        self.angle = self.angle + h * middle
        self.rate_of_turn = middle - 0.5 * h * pull * np.sin(self.angle)
        if self._stuck.any():
            self._stick()

    @property
    def energy(self) -> float:
        """Kinetic energy and potential energy over the lowest points (J)."""
        swing = 0.5 * (ROD * self.rate_of_turn) ** 2 + self.options.gravity * ROD * (1.0 - np.cos(self.angle))
        return float(MASS * swing.sum())

    @property
    def penetration(self) -> float:
        """Depth (m) of the deepest overlap of two neighbours."""
        return max(-float(self._contacts()[1].min(initial=0.0)), 0.0)

    def states(self) -> States:
        """Return the current states, with the accelerations of the swing. See Scene."""
        states, still = state_array(self._ids), np.zeros(len(self.angle))
        arm = self._offset()
        along = np.stack([np.cos(self.angle), still, np.sin(self.angle)], axis=1)
        states["position"] = self._pivot + arm
        states["linear"] = (ROD * self.rate_of_turn)[:, None] * along
        states["angular"][:, 1] = -self.rate_of_turn
        turned = -0.5 * self.angle
        states["quaternion"] = np.stack([still, np.sin(turned), still, np.cos(turned)], axis=1)
        swing = -self.options.gravity * np.sin(self.angle)
        states["acceleration"] = swing[:, None] * along - (self.rate_of_turn**2)[:, None] * arm
        states["flags"] = StateFlag.ACCELERATION_VALID
        return states
