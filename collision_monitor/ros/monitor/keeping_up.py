"""What the node does when steps take longer than the period of the states: newest states, more threads, less effort."""

from __future__ import annotations

from functools import partial
from time import monotonic_ns
from typing import Final

from rclpy.subscription import Subscription

from collision_monitor.pipeline.state_intake import ReceivedStates
from collision_monitor.ros.endpoints import take_waiting
from collision_monitor.ros.health.refusal_log import RefusalLog
from collision_monitor.ros.health.step_times import StepTimes
from collision_monitor.ros.monitor.backlog import Backlog
from collision_monitor.ros.monitor.effort import Effort
from collision_monitor.settings.profile import Profile

LOOK_PERIOD: Final = 1_000_000_000
"""ns between two looks at the load."""

LATE: Final = 0.5
"""Part of the horizon: answers that come later after the stamps of their states are a warning in the log."""

ROOM: Final = 1.25
"""Least period of steps from a sources file, in mean durations of a step."""


class KeepingUp:
    """Follows the load of the node. profile: as it was chosen. enabled: whether to do more than to warn."""

    def __init__(
        self, states: Subscription, times: StepTimes, log: RefusalLog, profile: Profile, *, enabled: bool
    ) -> None:
        self._topic = states.topic_name
        self._times, self._log = times, log
        self._profile = self._in_force = profile
        self._enabled = enabled
        self._backlog = Backlog(partial(take_waiting, states), states.qos_profile.depth)
        self._effort = Effort()
        self._last_look = monotonic_ns()
        self._outdated = 0  # at that time

    @property
    def outdated(self) -> int:
        """Number of messages that were left out."""
        return self._backlog.outdated

    @property
    def is_reduced(self) -> bool:
        """Whether the profile in force answers less than the chosen one."""
        return bool(self._profile.differences(self._in_force).keys() - {"name", "threads"})

    @property
    def mean_step(self) -> int:
        """Duration of a step (ns)."""
        return round(1e9 * self._backlog.mean)

    @property
    def pace(self) -> float:
        """Least period (s) of the steps that the node can keep."""
        return ROOM * self._backlog.mean if self._enabled else 0.0

    def choose(self, first: ReceivedStates) -> list[ReceivedStates]:
        """Return the messages to process now: `first`, which has arrived, and others that wait."""
        if not self._enabled:
            return [first]
        before = self._backlog.outdated
        chosen = self._backlog.choose(first)
        if count := self._backlog.outdated - before:
            text = "steps take longer than the period of the states: outdated ones are left out"
            self._log.note(self._topic, "outdated", text, count, monotonic_ns())
        return chosen

    def end_step(self, began: int, ended: int) -> None:
        """Note when a step began and ended (ns, steady clock)."""
        self._backlog.end_step(began, ended)

    def reduced(self, profile: Profile) -> Profile:
        """Return what to use of a profile that is chosen now."""
        self._profile = profile
        self._in_force = self._effort.reduced(profile)
        return self._in_force

    def look(self, now: int) -> Profile | None:
        """Look at the load, if it is time; call this regularly. Returns the profile to use if it changes now."""
        if now - self._last_look < LOOK_PERIOD:
            return None
        self._last_look = now
        horizon, latency = self._profile.horizon, self._times.latency
        if latency > LATE * horizon:
            text = f"the answers are {latency:.2f} s behind the stamps of the states, with a horizon of {horizon:g} s"
            self._log.note(self._topic, "late", text, 1, now)
        is_behind, self._outdated = self.outdated > self._outdated, self.outdated
        if not (self._enabled and self._effort.look(self._times.load(now), self._backlog.mean, is_behind=is_behind)):
            return None
        before = self._in_force
        if self.reduced(self._profile) == before:
            return None
        text = f"steps take longer than the period of the states: now with the profile {self._in_force.name}"
        if not self._effort.level:
            text = f"the steps are fast enough again for the profile {self._in_force.name}"
        self._log.note(self._topic, f"effort {self._effort.level}", text, 1, now)
        return self._in_force
