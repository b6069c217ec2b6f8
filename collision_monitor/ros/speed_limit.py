"""How much of a commanded twist a guard lets through: by the levels of the alerts, and by the distance to stop."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, hypot, isfinite, isnan, sin, sqrt
from typing import NamedTuple

from collision_monitor.codec import AlertLevel, CollisionAlert


@dataclass(frozen=True)
class Braking:
    """What the robot needs to stop. deceleration: m/s². reaction: s from a measurement to the brakes.

    clearance: m that stay free. caution, warning, critical: factor on the command at each level; 0: stop.
    """

    deceleration: float = 1.0
    reaction: float = 0.2
    clearance: float = 0.1
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


class Verdict(NamedTuple):
    """The factor on the command, the rule that set it, and why; empty: the command passes."""

    factor: float
    rule: str = ""
    reason: str = ""


PASSES = Verdict(1.0)


def verdict(
    braking: Braking, alerts: Iterable[CollisionAlert], robot: int, pose: RobotPose, command: Twist2
) -> Verdict:
    """Return the smallest factor that any alert of the robot asks for.

    A command that moves away from the nearest point of the obstacle passes, so that a stopped robot can retreat.
    """
    worst = PASSES
    for alert in alerts:
        if robot not in (alert.id_a, alert.id_b):
            continue
        found = _of_alert(braking, alert, alert.id_a == robot, pose, command)
        if found.factor < worst.factor:
            worst = found
    return worst


def _of_alert(braking: Braking, alert: CollisionAlert, is_a: bool, pose: RobotPose, command: Twist2) -> Verdict:
    name = AlertLevel(alert.level).name.lower()
    other = alert.name_b if is_a else alert.name_a
    at, to = (alert.point_a, alert.point_b) if is_a else (alert.point_b, alert.point_a)
    lever = hypot(at[0] - pose.x, at[1] - pose.y)
    nx, ny = to[0] - at[0], to[1] - at[1]
    length = hypot(nx, ny)
    speed = hypot(command.x, command.y) + abs(command.turn) * (0.0 if isnan(lever) else lever)
    closing = speed
    if alert.distance > 0.0 and length > 0.0:  # else the direction is not known
        vx = command.x * cos(pose.heading) - command.y * sin(pose.heading)
        vy = command.x * sin(pose.heading) + command.y * cos(pose.heading)
        # the points of the robot that a turn moves may meet the obstacle at any place
        closing = (vx * nx + vy * ny) / length + abs(command.turn) * lever
        if closing <= 0.0:
            return PASSES
    factor = braking.factor(alert.level)
    reason = f"{name}: {alert.text}"
    if isfinite(alert.distance) and closing > 0.0:
        toward = (pose.vx * nx + pose.vy * ny) / length if length > 0.0 else 0.0
        approach = alert.closing_speed - toward if isfinite(alert.closing_speed) else 0.0
        allowed = braking.speed(alert.distance, approach)
        if factor * closing > allowed:
            factor = allowed / closing
            reason = f"{name}: {other} at {alert.distance:.2f} m allows {allowed:.2f} m/s"
    return Verdict(0.0 if factor < 1e-3 else factor, alert.rule, reason)


