"""A robot arm that moves over a table with bottles; every object is a mesh, and concave.

Each link turns about the end of the link before. The meshes are surfaces of revolution, generated here.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply, rotation_matrix
from collision_monitor.shapes.registry import Mesh
from collision_monitor.world.scene import Array, Scene, States, positive_rate, state_array

CIRCLE_SEGMENTS: Final = 32
"""Segments of each circle; a link then has 700 triangles."""

LENGTHS: Final = (0.35, 0.55, 0.5, 0.25)
"""Lengths (m) of the links from the base to the hand."""

JOINT_AXES: Final = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0]], float)
"""Axis of each joint, in the frame of the link before."""

MIDDLE: Final = np.array([0.0, 0.85, 1.35, 0.6])
SWING: Final = np.array([2.2, 0.25, 0.35, 0.5])
FREQUENCY: Final = np.array([0.11, 0.17, 0.23, 0.31])
"""Middles and swings in rad, frequencies in Hz: joint k is at MIDDLE + SWING sin(2 pi FREQUENCY t)."""

BOTTLES: Final = 7
ROUND_THE_BASE: Final = 0.85
"""Distance of the bottles from the base (m)."""


def lathe(profile: list[tuple[float, float]], segments: int = CIRCLE_SEGMENTS) -> Mesh:
    """Closed surface of revolution about z of a line of (radius, z) in m that begins and ends on the axis."""
    angle = 2 * np.pi * np.arange(segments) / segments
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(segments)], axis=1)
    rings = [radius * ring + (0.0, 0.0, z) for radius, z in profile[1:-1]]
    vertices = np.concatenate([[(0.0, 0.0, profile[0][1])], *rings, [(0.0, 0.0, profile[-1][1])]])
    a, faces = np.arange(segments), []
    b = np.roll(a, -1)
    last = len(vertices) - 1
    faces.append(np.stack([np.zeros(segments, int), 1 + b, 1 + a], axis=1))
    for k in range(len(rings) - 1):
        low, high = 1 + k * segments, 1 + (k + 1) * segments
        faces.append(np.stack([low + a, low + b, high + b], axis=1))
        faces.append(np.stack([low + a, high + b, high + a], axis=1))
    top = 1 + (len(rings) - 1) * segments
    faces.append(np.stack([top + a, top + b, np.full(segments, last)], axis=1))
    return Mesh(vertices, np.concatenate(faces))


def link(length: float, radius: float) -> Mesh:
    """Mesh of a link about its middle: two round joints and a waist between them."""
    half, waist = length / 2, 0.85 * radius
    end = [(radius * np.cos(a), half + radius * np.sin(a)) for a in np.linspace(0.0, np.pi / 2, 6)[:-1]]
    outline = [(radius, half - 0.5 * radius), (waist, 0.5 * half), (waist, 0.0)]
    upper = [*outline[::-1], *end, (0.0, half + radius)]
    lower = [(r, -z) for r, z in upper[:0:-1]]
    return lathe([(float(r), float(z)) for r, z in (*lower, *upper)])


def _bottle() -> Mesh:
    return lathe([(0, 0), (0.04, 0), (0.04, 0.16), (0.036, 0.18), (0.02, 0.2), (0.018, 0.26), (0, 0.26)])


class Arm(Scene):
    """Scene "arm": ids 1..4 are the links from the base on, followed by the static table and bottles."""

    def __init__(self, objects: int | None, rate: float | None) -> None:
        if objects is not None:
            raise InputError(f"objects: the scene 'arm' has a fixed set, leave it out (got {objects!r})")
        self.name = "arm"
        self.rate = positive_rate(rate, 50.0)
        self._ids = np.arange(1, len(LENGTHS) + 1, dtype=np.uint32)
        radii = np.linspace(0.08, 0.05, len(LENGTHS))
        self.descriptions = [
            ObjectDescription(
                int(i), link(length, float(radius)), f"link_{i}", allowed=tuple({max(1, i - 1), min(4, i + 1)} - {i})
            )
            for i, length, radius in zip(self._ids.tolist(), LENGTHS, radii, strict=True)
        ]
        table = lathe([(0, -0.04), (1.1, -0.04), (1.1, 0), (0, 0)])
        self._add(table, "table", (0.0, 0.0, -0.09), allowed=(1,))
        for k in range(BOTTLES):
            angle = 2 * np.pi * k / BOTTLES
            at = (ROUND_THE_BASE * float(np.cos(angle)), ROUND_THE_BASE * float(np.sin(angle)), -0.09)
            self._add(_bottle(), f"bottle_{k + 1}", at)

    def _add(self, mesh: Mesh, name: str, position: tuple[float, float, float], allowed: tuple[int, ...] = ()) -> None:
        object_id = len(self.descriptions) + 1
        self.descriptions.append(
            ObjectDescription(object_id, mesh, name, static=True, pose=Pose(position), allowed=allowed)
        )

    def _advance(self, dt: float) -> None:
        """Do nothing, because the joints are functions of the time."""

    def states(self) -> States:
        """Compute the states by forward kinematics, joint by joint, with the current twists. See Scene."""
        states = state_array(self._ids)
        phase = 2 * np.pi * FREQUENCY * self.time
        angles, rates = MIDDLE + SWING * np.sin(phase), 2 * np.pi * FREQUENCY * SWING * np.cos(phase)
        q: Array = np.array([0.0, 0.0, 0.0, 1.0])
        joint, velocity, omega = np.zeros(3), np.zeros(3), np.zeros(3)
        for k, length in enumerate(LENGTHS):
            omega = omega + rotation_matrix(q) @ JOINT_AXES[k] * rates[k]
            q = multiply(q, from_rotation_vector(JOINT_AXES[k] * angles[k]))
            along = rotation_matrix(q)[:, 2] * length
            states["position"][k], states["quaternion"][k] = joint + along / 2, q / np.linalg.norm(q)
            states["linear"][k], states["angular"][k] = velocity + np.cross(omega, along / 2), omega
            joint, velocity = joint + along, velocity + np.cross(omega, along)
        return states
