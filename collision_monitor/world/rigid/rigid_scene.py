"""Base class of the scenes of rigid bodies that respond to each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world.rigid.impulse_response import PARTS
from collision_monitor.world.rigid.response_choice import ResponseOptions
from collision_monitor.world.rigid.responses import make_response
from collision_monitor.world.rigid.rigid_bodies import RigidBodies
from collision_monitor.world.scene import Array, Scene, States, state_array

GROUND: Final = 2
"""Group of the bodies that carry others. The moving ones do not look for them, as they always touch."""


def _small_world() -> RigidBodies:
    """Two boxes and a ball that touch; a step of them compiles all kernels, so that a scene does not wait later."""
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])
    shapes = (Box((1, 1, 1)), Box((1, 1, 1)), Sphere(0.5))
    return RigidBodies(shapes, places, np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), np.arange(3) == 0, np.ones(3))


class RigidScene(Scene):
    """Moving bodies with ids 1..n, followed by the static ones. `options` choose the response."""

    parts: ClassVar[int] = PARTS
    """Parts of a substep where bodies meet; few in a scene of many impacts, so that it runs in real time."""

    def _build(
        self, moving: Sequence[tuple[str, Sphere | Box]], position: Array, friction: Array,
        static: Sequence[tuple[str, Box, Pose, int]], options: ResponseOptions, speed: float,
    ) -> None:  # fmt: skip
        """Create bodies at rest: moving ones (name, shape), static ones (name, shape, pose, group).

        position (n, 3) m and friction (n,) of the moving ones; speed (m/s): the fastest that the scene expects.
        """
        count = len(moving)
        self.options, self._response = options, make_response(options, speed, self.parts)
        shapes: list[Sphere | Box] = [shape for _, shape in moving] + [shape for _, shape, _, _ in static]
        poses = [pose for _, _, pose, _ in static]
        places = np.concatenate([position, [pose.position for pose in poses]])
        turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(shapes), 1))
        turned[count:] = [pose.quaternion for pose in poses]
        still: NDArray[np.bool_] = np.arange(len(shapes)) >= count
        self.world = RigidBodies(shapes, places, turned, still, np.concatenate([friction, np.ones(len(static))]))
        make_response(options, speed).advance(_small_world(), 1e-6)
        self._ids = np.arange(1, count + 1, dtype=np.uint32)
        self.descriptions = [
            ObjectDescription(k + 1, shape, name, mask=1) for k, (name, shape) in enumerate(moving)
        ] + [
            ObjectDescription(count + k + 1, shape, name, static=True, pose=pose, group=group)
            for k, (name, shape, pose, group) in enumerate(static)
        ]

    def _advance(self, dt: float) -> None:
        before = self.world.velocity[: len(self._ids)].copy()
        self._response.advance(self.world, dt)
        change = self.world.velocity[: len(self._ids)] - before
        change[:, 2] += self.options.gravity * dt
        self._flies = np.abs(change).max(axis=1) <= 1e-9 * max(self.options.gravity * dt, 1e-300)

    @property
    def energy(self) -> float:
        """Kinetic and potential energy of the moving bodies (J)."""
        return self.world.energy(self.options.gravity)

    def states(self) -> States:
        """Return the current states; bodies that fell freely in the last step state their acceleration. See Scene."""
        states, count = state_array(self._ids), len(self._ids)
        states["position"] = self.world.position[:count]
        states["quaternion"] = self.world.quaternion[:count]
        states["linear"] = self.world.velocity[:count]
        states["angular"] = self.world.angular[:count]
        if self.options.gravity > 0.0 and self.time > 0.0:
            states["acceleration"][self._flies, 2] = -self.options.gravity
            states["flags"][self._flies] = StateFlag.ACCELERATION_VALID
        return states
