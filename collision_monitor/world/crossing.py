"""A small scene with closed-form contact times, as a reference for what a monitor must report.

Each encounter has its own lane. All objects keep their twists and pass through each other, so that contacts
begin and end. After `PERIOD` seconds all objects jump back (flagged as a discontinuity) and the scene repeats.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, cos, hypot, pi, sin, sqrt

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply
from collision_monitor.shapes.registry import Box, Capsule, Shape, Sphere
from collision_monitor.world.scene import Scene, States, positive_rate, state_array

PERIOD = 8.0
"""Duration of one repetition (s)."""
LANE_SPACING = 4.0
"""Distance (m) along y between two lanes, so large that objects of different lanes never meet."""

ROD = (2.0, 0.05, 0.05)
"""Size (m) of the rods that turn."""
BALL = 0.15
"""Radius (m) of the balls beside them."""
BALL_AT = (0.8, 1.5)
"""Distance (m) and angle (rad) of the ball that a rod meets."""
BEYOND_ROD = hypot(ROD[0] / 2, ROD[1] / 2) + BALL + 0.01
"""Distance (m) of the other ball: 1 cm beyond the reach of the rod's corners."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class ExpectedContact:
    """Contact of two objects in each period; times in s from the period's start, None if they never touch."""

    id_a: int
    id_b: int
    begin: float | None
    end: float | None
    derivation: str


@dataclass(frozen=True)
class _LaneObject:
    """One of the two objects of a lane: its start and its motion, relative to the lane."""

    name: str
    shape: Shape
    start: Vector
    velocity: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    yaw_rate: float = 0.0
    static: bool = False


def _gap_over_speed(distance: float, reach: float, speed: float) -> tuple[float, float]:
    """Begin and end (s) of a head-on contact: the centres are within `reach` along the path."""
    return (distance - reach) / speed, (distance + reach) / speed


def _spheres(offset: Vector, velocity: Vector, reach: float) -> tuple[float, float] | tuple[None, None]:
    """Begin and end (s) of the contact of two spheres with radii adding up to `reach`; None if they never touch.

    They are the roots of |offset + velocity t| = reach.
    """
    a = sum(v * v for v in velocity)
    b = sum(o * v for o, v in zip(offset, velocity, strict=True))
    c = sum(o * o for o in offset) - reach * reach
    discriminant = b * b - a * c
    if discriminant < 0.0:
        return None, None
    return (-b - sqrt(discriminant)) / a, (-b + sqrt(discriminant)) / a


def _rod_and_ball(reach: float, ball: float, angle: float, turn_rate: float) -> tuple[float, float]:
    """Begin and end (s) of the contact of a rod turning about its middle with a ball `ball` m away.

    They satisfy ball * sin(angle left) = reach.
    """
    touching = asin(reach / ball)
    return (angle - touching) / turn_rate, (angle + touching) / turn_rate


def _lanes() -> list[tuple[_LaneObject, _LaneObject, tuple[float | None, float | None], str]]:
    distance, angle = BALL_AT
    return [
        (
            _LaneObject("head_on_left", Sphere(0.3), (-3.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
            _LaneObject("head_on_right", Sphere(0.2), (2.0, 0.0, 0.0), (-0.5, 0.0, 0.0)),
            _gap_over_speed(5.0, 0.5, 1.5),
            "centres 5 m apart close at 1.5 m/s and touch at 0.3 + 0.2 m",
        ),
        (
            _LaneObject("oblique_slow", Sphere(0.25), (-2.0, -0.3, 0.5), (0.5, 0.1, 0.0)),
            _LaneObject("oblique_fast", Sphere(0.35), (2.0, 0.6, 0.0), (-0.8, -0.1, 0.1)),
            _spheres((4.0, 0.9, -0.5), (-1.3, -0.2, 0.1), 0.6),
            "roots of |p + v t| = 0.25 + 0.35",
        ),
        (
            _LaneObject("box_left", Box((1.0, 0.8, 0.6)), (-2.5, 0.0, 0.0), (0.75, 0.0, 0.0)),
            _LaneObject("box_right", Box((0.6, 1.0, 0.8)), (2.5, 0.2, 0.1), (-0.25, 0.0, 0.0)),
            _gap_over_speed(5.0, 0.8, 1.0),
            "faces: 5 m less half extents 0.5 + 0.3, at 1 m/s",
        ),
        (
            _LaneObject("box_corner", Box((0.6, 0.6, 0.6)), (-3.0, 0.0, 0.0), (1.0, 0.0, 0.0), yaw=pi / 4),
            _LaneObject("box_face", Box((1.0, 2.0, 1.0)), (1.0, 0.0, 0.0)),
            _gap_over_speed(4.0, 0.3 * sqrt(2.0) + 0.5, 1.0),
            "a vertical edge ahead: 4 m less half a diagonal 0.3 sqrt(2) and half an extent 0.5, at 1 m/s",
        ),
        (
            _LaneObject("spinning_rod", Box(ROD), (0.0, 0.0, 0.0), yaw_rate=0.5),
            _LaneObject("ball", Sphere(BALL), (distance * cos(angle), distance * sin(angle), 0.0)),
            _rod_and_ball(ROD[1] / 2 + BALL, distance, angle, 0.5),
            "the rod's side sweeps into the ball: 0.8 sin(1.5 - 0.5 t) = 0.025 + 0.15",
        ),
        (
            _LaneObject("ball_at_wall", Sphere(0.25), (-2.0, 0.0, 0.0), (0.8, 0.1, 0.0)),
            _LaneObject("wall", Box((0.2, 3.0, 2.0)), (1.0, 0.0, 0.0), static=True),
            _gap_over_speed(3.0, 0.35, 0.8),
            "3 m less radius 0.25 and half the thickness 0.1, at 0.8 m/s normal to the wall",
        ),
        (
            _LaneObject("capsule_above", Capsule(0.15, 1.0), (0.0, 0.0, 3.0), (0.0, 0.0, -0.7)),
            _LaneObject("crossbeam", Box((1.5, 0.3, 0.3)), (0.1, 0.1, 0.0)),
            _gap_over_speed(3.0, 0.5 + 0.15 + 0.15, 0.7),
            "upright capsule onto a beam: 3 m less half its length 0.5 + 0.15 and half the beam 0.15, at 0.7 m/s",
        ),
        (
            _LaneObject("near_miss_low", Sphere(0.3), (-2.5, 0.0, 0.0), (1.0, 0.0, 0.0)),
            _LaneObject("near_miss_high", Sphere(0.3), (2.5, 0.0, 0.61), (-1.0, 0.0, 0.0)),
            _spheres((5.0, 0.0, 0.61), (-2.0, 0.0, 0.0), 0.6),
            "passes 1 cm clear: the lines are 0.61 m apart, the radii add up to 0.6 m",
        ),
        (
            _LaneObject("short_rod", Box(ROD), (0.0, 0.0, 0.0), yaw_rate=0.8),
            _LaneObject("ball_out_of_reach", Sphere(BALL), (0.0, BEYOND_ROD, 0.0)),
            (None, None),
            "the rod's corners pass 1 cm short of the ball",
        ),
    ]


class Crossing(Scene):
    """Scene "crossing": `expected` holds the contact times of the two objects of each lane; others never touch."""

    def __init__(self, objects: int | None, rate: float | None) -> None:
        if objects is not None:
            raise InputError(f"objects: the scene 'crossing' has a fixed set, leave it out (got {objects!r})")
        self.name = "crossing"
        self.rate = positive_rate(rate, 50.0)
        self.period = PERIOD
        self.expected: list[ExpectedContact] = []
        self.descriptions = []
        self._motions: dict[int, Motion] = {}
        self._restarted = False
        for lane, (body_a, body_b, (begin, end), derivation) in enumerate(_lanes()):
            ids = [self._add(body, lane) for body in (body_a, body_b)]
            self.expected.append(ExpectedContact(ids[0], ids[1], begin, end, derivation))
        self._ids = np.array(list(self._motions), dtype=np.uint32)
        moving = self._motions.values()
        self._position = np.array([m.pose.position for m in moving])
        self._quaternion = np.array([m.pose.quaternion for m in moving])
        self._linear = np.array([m.linear for m in moving])
        self._angular = np.array([m.angular for m in moving])

    def _add(self, body: _LaneObject, lane: int) -> int:
        object_id = len(self.descriptions) + 1
        x, y, z = body.start
        pose = Pose((x, y + lane * LANE_SPACING, z), from_rotation_vector((0.0, 0.0, body.yaw)))
        where = pose if body.static else None
        self.descriptions.append(ObjectDescription(object_id, body.shape, body.name, static=body.static, pose=where))
        if not body.static:
            self._motions[object_id] = Motion(pose, body.velocity, (0.0, 0.0, body.yaw_rate))
        return object_id

    def _advance(self, dt: float) -> None:
        self._restarted = (self.time + dt) // self.period > self.time // self.period

    def states(self) -> States:
        """Return the current states. See Scene."""
        t = self.time % self.period
        states = state_array(self._ids)
        states["position"] = self._position + self._linear * t
        states["quaternion"] = multiply(from_rotation_vector(self._angular * t), self._quaternion)
        states["linear"] = self._linear
        states["angular"] = self._angular
        states["flags"] = StateFlag.DISCONTINUITY if self._restarted else 0
        return states
