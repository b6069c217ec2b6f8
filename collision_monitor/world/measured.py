"""A scene with measurement noise, as a localiser reports it, and with the noise declared in the states."""

from __future__ import annotations

import math

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.shapes.pose import from_rotation_vector, multiply
from collision_monitor.world.scene import Scene, States

LARGEST_NOISE = 1.0
"""Largest noise, in m, rad, m/s and rad/s."""


class Measured(Scene):
    """`scene` with normally distributed noise of standard deviation `noise` along each axis of each quantity.

    In m, rad, m/s and rad/s; independent from state to state, and declared in the states. Raises InputError.
    """

    def __init__(self, scene: Scene, noise: float, seed: int) -> None:
        if not (math.isfinite(noise) and 0.0 < noise <= LARGEST_NOISE):
            raise InputError(f"noise: expected more than 0 and at most {LARGEST_NOISE:g}, got {noise!r}")
        self._scene, self._noise, self._seed, self._steps = scene, float(noise), seed, 0
        self.name, self.rate, self.duration = scene.name, scene.rate, scene.duration
        self.descriptions = scene.descriptions

    def _advance(self, dt: float) -> None:
        self._scene.step(dt)
        self._steps += 1

    def states(self) -> States:
        """Return the current states with noise; the noise of a step is always the same. See Scene."""
        states = self._scene.states()
        random = np.random.default_rng((self._seed, self._steps))
        off = random.normal(scale=self._noise, size=(4, len(states), 3))
        for error, name in zip(off, ("position", "linear", "angular"), strict=False):
            states[name] += error
        turned = multiply(from_rotation_vector(off[3]), states["quaternion"])
        states["quaternion"] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        for name in ("position", "orientation", "velocity", "angular_velocity"):
            states[f"{name}_stddev"] = self._noise
        return states
