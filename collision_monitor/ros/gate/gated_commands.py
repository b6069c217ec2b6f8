"""Velocity commands of what follows a plan, scaled as the gate lets the plan go on."""

from __future__ import annotations

from math import hypot
from typing import Any

from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.monitor_answers import ClockReading
from collision_monitor.ros.guard.velocity_commands import in_plane, scaled_command, stopped, why_refused


class GatedCommands:
    """Publishes the last command, times `factor`, and no faster than `speed` (m/s); a stop for one that is too old."""

    def __init__(self, out: Any, ages: GuardLimits, speed: float) -> None:
        self.out, self.factor = out, 0.0
        self._ages, self._speed = ages, speed
        self._command: Any = None
        self._arrived = 0.0

    def take(self, command: Any, arrived: float) -> None:
        """Take a command that arrived (steady s)."""
        self._command, self._arrived = command, arrived

    def publish(self, now: ClockReading, stamp: Any) -> None:
        """Publish the last command, if there is one. stamp: of a stop."""
        command = self._command
        if command is None:
            return
        is_over = now.steady - self._arrived > self._ages.command
        if is_over or self.factor <= 0.0 or why_refused(command, now.stamp_ns, self._ages.command, self._ages.ahead):
            self.stop(stamp)
        else:
            speed = hypot(*in_plane(command)[:2])
            limit = self._speed / speed if speed > self._speed else 1.0
            self.out.publish(scaled_command(command, self.factor * limit))
        if is_over:
            self._command = None

    def stop(self, stamp: Any) -> None:
        """Publish a command to stand in place of the last one, if there is one."""
        if self._command is not None:
            self.out.publish(stopped(self._command, stamp))
