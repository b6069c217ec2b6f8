"""How much of a commanded twist a guard lets through: by the levels of the alerts, and by the distance to stop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import cos, hypot, inf, isfinite, isnan, sin, sqrt
from typing import Final, NamedTuple

from collision_monitor.codec import AlertLevel

STANDS: Final = 0.05
"""m/s: an obstacle that comes nearer no faster than this stands."""

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Braking:
    """What the robot needs to stop. deceleration: m/s². reaction: s from a measurement to the brakes.

    clearance: m that stay free. caution, warning, critical: factor on the command at each level; 0: stop.
    """

    deceleration: float = 1.0
    reaction: float = 0.3
    clearance: float = 0.2
    caution: float = 1.0
    warning: float = 0.5
    critical: float = 0.0

    def factor(self, level: int) -> float:
        """Return the factor at a level."""
        return (1.0, self.caution, self.warning, self.critical)[level]

    def speed(self, distance: float, approach: float) -> float:
        """Return the largest speed (m/s) from which the robot stops at the clearance.

        distance: m, now. approach: m/s of the obstacle toward the robot. The solution of
        v (reaction + v / 2a) + approach (reaction + v / a) = distance - clearance.
        """
        a, t, u = self.deceleration, self.reaction, max(approach, 0.0)
        free = distance - self.clearance - u * t
        return max(0.0, sqrt((a * t + u) ** 2 + 2.0 * a * free) - (a * t + u)) if free > 0.0 else 0.0

    def speed_ahead(self, reach: float, ahead: float) -> float:
        """Return the largest speed (m/s) from which it stops before an obstacle that stands where it is first seen.

        That is at `reach` (m), or `ahead` (s) before the impact, in which v (reaction + v / 2a) = v ahead.
        """
        if not isfinite(ahead) or not isfinite(reach):
            return inf
        return max(self.speed(reach, 0.0), 2.0 * self.deceleration * (ahead - self.reaction))


class Twist2(NamedTuple):
    """A commanded motion in the robot's frame: m/s along x and y, rad/s about z."""

    x: float
    y: float
    turn: float


class PartPose(NamedTuple):
    """Where an object of the robot is in the world (m), its heading (rad), and how it moves (m/s, rad/s)."""

    position: Point
    heading: float = 0.0
    linear: Point = (0.0, 0.0, 0.0)
    angular: Point = (0.0, 0.0, 0.0)

    def velocity_at(self, point: Point) -> Point:
        """Velocity (m/s) of a point of the object."""
        x, y, z = (point[k] - self.position[k] for k in range(3))
        a, b, c = self.angular
        u, v, w = self.linear
        return u + b * z - c * y, v + c * x - a * z, w + a * y - b * x


class NearPair(NamedTuple):
    """What an answer of the monitor says about an object of the robot (`part`) and another one.

    at, to: nearest points of both (m). closing: m/s, positive if they approach. time: s before which there is no
    contact as both move. NaN: not known.
    """

    part: int
    other: str
    rule: str
    level: int
    distance: float
    closing: float
    time: float
    at: Point
    to: Point
    text: str


class SpeedVerdict(NamedTuple):
    """The factor on the command, the rule that set it, and why; empty: the command passes."""

    factor: float
    rule: str = ""
    reason: str = ""


PASSES = SpeedVerdict(1.0)


def verdict(
    braking: Braking, near: Iterable[NearPair], parts: Mapping[int, PartPose], base: PartPose, command: Twist2
) -> SpeedVerdict:
    """Return the smallest factor that any pair asks for.

    parts: the objects of the robot by id. base: the one whose frame the commands have. A command that moves away from
    the nearest point of an obstacle passes, so that a stopped robot can retreat; from one that approaches it has to
    move away as fast.
    """
    worst = PASSES
    for pair in near:
        found = _of_pair(braking, pair, parts[pair.part], base, command)
        if found.factor < worst.factor:
            worst = found
    return worst


def limited(found: SpeedVerdict, command: Twist2, fastest: float) -> SpeedVerdict:
    """Return the verdict with the speed limited to what the rules see ahead (m/s)."""
    speed = hypot(command.x, command.y)
    if found.factor * speed <= fastest:
        return found
    return SpeedVerdict(_rounded(fastest / speed), "", f"what the rules see ahead allows {fastest:.2f} m/s")


def _of_pair(braking: Braking, pair: NearPair, part: PartPose, base: PartPose, command: Twist2) -> SpeedVerdict:
    motion = _in_world(base, command)
    lever = hypot(pair.at[0] - base.position[0], pair.at[1] - base.position[1])
    lever = 0.0 if isnan(lever) else lever
    speed = _speed(motion, lever)
    way = _Way(speed, 0.0)
    if pair.distance > 0.0 and pair.to[:2] != pair.at[:2]:  # else the direction is not known
        way = _way(pair, part, motion, lever)
    leaves = way.closing + way.approach <= (STANDS if way.closing <= 0.0 else 0.0)
    factor = 1.0 if leaves else braking.factor(pair.level)
    reason = f"{AlertLevel(pair.level).name.lower()}: {pair.text}"
    allowed = _onward(braking, pair, base, motion, lever)
    if not leaves:
        allowed = min(allowed, _allowed(braking, pair.distance, speed, way))
    if factor * speed > allowed:
        factor = allowed / speed
        level = AlertLevel(pair.level).name.lower()
        reason = f"{level}: {pair.other} at {pair.distance:.2f} m allows {allowed:.2f} m/s"
    return SpeedVerdict(_rounded(factor), pair.rule, reason) if factor < 1.0 else PASSES


def _in_world(base: PartPose, command: Twist2) -> Twist2:
    c, s = cos(base.heading), sin(base.heading)
    return Twist2(command.x * c - command.y * s, command.x * s + command.y * c, command.turn)


def _speed(motion: Twist2, lever: float) -> float:
    """Bound on the speed (m/s) of a point at a distance of `lever` (m) from the origin of the base."""
    return hypot(motion.x, motion.y) + abs(motion.turn) * lever


class _Way(NamedTuple):
    """closing: part of a commanded speed toward the obstacle. approach: of the obstacle toward the robot (m/s)."""

    closing: float
    approach: float


def _way(pair: NearPair, part: PartPose, motion: Twist2, lever: float) -> _Way:
    nx, ny, nz = (to - at for to, at in zip(pair.to, pair.at, strict=True))
    # the points of the robot that a turn moves may meet the obstacle at any place
    closing = (motion.x * nx + motion.y * ny) / hypot(nx, ny) + abs(motion.turn) * lever
    if not isfinite(pair.closing):
        return _Way(closing, 0.0)
    whole = hypot(nx, ny, nz)
    own = sum(v * n / whole for v, n in zip(part.velocity_at(pair.at), (nx, ny, nz), strict=True))
    return _Way(closing, max(0.0, pair.closing - own))


def _allowed(braking: Braking, distance: float, speed: float, way: _Way) -> float:
    """Return the largest speed (m/s) of a command with which the robot stands when the obstacle is at the clearance.

    speed: of the command (m/s).
    """
    if not isfinite(distance) or speed == 0.0:
        return inf
    toward = braking.speed(distance, way.approach) * speed / way.closing if way.closing > 0.0 else inf
    if way.approach <= STANDS:
        return toward
    # the obstacle may come from the side: the robot has to stand before it arrives, whichever way it drives
    arrival = (distance - braking.clearance) / (way.approach + max(way.closing, 0.0))
    return min(toward, braking.deceleration * max(0.0, arrival - braking.reaction))


def _onward(braking: Braking, pair: NearPair, base: PartPose, motion: Twist2, lever: float) -> float:
    """Return the largest speed (m/s) with which the robot stands before an impact that is predicted as it moves now.

    The nearest point tells nothing of that: a hall as one mesh is near at the side, and meets the robot in front.
    Infinite for a command that does not go on as the robot moves.
    """
    now = Twist2(base.linear[0], base.linear[1], base.angular[2])
    goes_on = motion.x * now.x + motion.y * now.y > 0.0 or motion.turn * now.turn > 0.0
    if not isfinite(pair.time) or not goes_on:
        return inf
    return braking.speed(_speed(now, lever) * pair.time, 0.0)


def _rounded(factor: float) -> float:
    return 0.0 if factor < 1e-3 else factor
