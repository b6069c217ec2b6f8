"""How much of a commanded twist a guard lets through: by the levels of the alerts, and by the distance to stop."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, hypot, inf, isfinite, isnan, sin, sqrt
from typing import Final, NamedTuple

from collision_monitor.codec import AlertLevel, CollisionAlert

STANDS: Final = 0.05
"""m/s: an obstacle that comes nearer no faster than this stands."""


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


class Twist2(NamedTuple):
    """A commanded motion in the robot's frame: m/s along x and y, rad/s about z."""

    x: float
    y: float
    turn: float


class RobotPose(NamedTuple):
    """Position in the world (m), heading (rad) and velocity in the world (m/s)."""

    x: float
    y: float
    heading: float
    vx: float = 0.0
    vy: float = 0.0


class SpeedVerdict(NamedTuple):
    """The factor on the command, the rule that set it, and why; empty: the command passes."""

    factor: float
    rule: str = ""
    reason: str = ""


PASSES = SpeedVerdict(1.0)


def verdict(
    braking: Braking, alerts: Iterable[CollisionAlert], robot: int, pose: RobotPose, command: Twist2
) -> SpeedVerdict:
    """Return the smallest factor that any alert of the robot asks for.

    A command that moves away from the nearest point of an obstacle passes, so that a stopped robot can retreat; from
    one that approaches it has to move away as fast.
    """
    worst = PASSES
    for alert in alerts:
        if robot not in (alert.id_a, alert.id_b):
            continue
        found = _of_alert(braking, alert, alert.id_a == robot, pose, command)
        if found.factor < worst.factor:
            worst = found
    return worst


def _of_alert(braking: Braking, alert: CollisionAlert, is_a: bool, pose: RobotPose, command: Twist2) -> SpeedVerdict:
    name = AlertLevel(alert.level).name.lower()
    other = alert.name_b if is_a else alert.name_a
    at, to = (alert.point_a, alert.point_b) if is_a else (alert.point_b, alert.point_a)
    lever = hypot(at[0] - pose.x, at[1] - pose.y)
    nx, ny = to[0] - at[0], to[1] - at[1]
    length = hypot(nx, ny)
    speed = hypot(command.x, command.y) + abs(command.turn) * (0.0 if isnan(lever) else lever)
    closing, approach = speed, 0.0
    if alert.distance > 0.0 and length > 0.0:  # else the direction is not known
        nx, ny = nx / length, ny / length
        vx = command.x * cos(pose.heading) - command.y * sin(pose.heading)
        vy = command.x * sin(pose.heading) + command.y * cos(pose.heading)
        # the points of the robot that a turn moves may meet the obstacle at any place
        closing = vx * nx + vy * ny + abs(command.turn) * lever
        if isfinite(alert.closing_speed):
            approach = max(0.0, alert.closing_speed - (pose.vx * nx + pose.vy * ny))
        if closing + approach <= (STANDS if closing <= 0.0 else 0.0):
            return PASSES
    factor = braking.factor(alert.level)
    reason = f"{name}: {alert.text}"
    allowed = _allowed(braking, alert.distance, speed, closing, approach)
    if factor * speed > allowed:
        factor = allowed / speed
        reason = f"{name}: {other} at {alert.distance:.2f} m allows {allowed:.2f} m/s"
    return SpeedVerdict(0.0 if factor < 1e-3 else factor, alert.rule, reason)


def _allowed(braking: Braking, distance: float, speed: float, closing: float, approach: float) -> float:
    """Return the largest speed (m/s) of a command with which the robot stands when the obstacle is at the clearance.

    speed: of the command; closing: its part toward the obstacle; approach: of the obstacle toward the robot (m/s).
    """
    if not isfinite(distance) or speed == 0.0:
        return inf
    toward = braking.speed(distance, approach) * speed / closing if closing > 0.0 else inf
    if approach <= STANDS:
        return toward
    # the obstacle may come from the side: the robot has to stand before it arrives, whichever way it drives
    arrival = (distance - braking.clearance) / (approach + max(closing, 0.0))
    return min(toward, braking.deceleration * max(0.0, arrival - braking.reaction))
