"""What a guard says of itself: in the log, on `~/state` and on `/diagnostics`."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.monitor_answers import Fault
from collision_monitor.ros.guard.speed_limit import SpeedVerdict
from collision_monitor.ros.health.health import Report
from collision_monitor.ros.health.line_report import DiagnosticLevel

AGAIN: Final = 10.0
"""s after which a fault that lasts, or a message that cannot be read, is logged again."""

NAMED: Final = 20
"""Objects of the robot that a text names; it counts the others."""


_NUMBER: Final = re.compile(r"[0-9][0-9.]*")


class GuardAction(IntEnum):
    """Actions of nav2_msgs/CollisionMonitorState."""

    NOTHING = 0
    STOP = 1
    SLOWDOWN = 2


VERBS: Final = {
    GuardAction.NOTHING: "passes",
    GuardAction.SLOWDOWN: "slows down",
    GuardAction.STOP: "stops",
}


@dataclass(frozen=True)
class Decision:
    """What a guard does with the last command. fault: why it cannot guard. is_over: the command is too old.

    doubts: what is worth a warning. refused: the command itself must not pass.
    """

    verdict: SpeedVerdict
    fault: Fault | None = None
    is_over: bool = False
    doubts: tuple[str, ...] = ()
    refused: bool = False

    @property
    def action(self) -> GuardAction:
        """The action in nav2's words."""
        factor = self.verdict.factor
        return GuardAction.NOTHING if factor == 1.0 else GuardAction.STOP if factor == 0.0 else GuardAction.SLOWDOWN

    @property
    def key(self) -> tuple[Any, ...]:
        """The same while only numbers change."""
        why = self.fault.kind if self.fault else self.verdict.rule or _NUMBER.sub("", self.verdict.reason)
        return self.action, why, self.doubts


class GuardReport:
    """Notices what changes, logs it, and reports on `/diagnostics`. text: of the last decision that was news.

    task: name of the report.
    """

    def __init__(self, logger: Any, robot: GuardedObjects, task: str = "guard") -> None:
        self._logger, self._robot, self._task = logger, robot, task
        self._last: Decision | None = None
        self._key: tuple[Any, ...] = ()
        self._logged: dict[str, float] = {}
        self.text = ""

    def take(self, decision: Decision) -> bool:
        """Log a decision that is news, or whose fault lasts. Return whether it is news."""
        key = (*decision.key, tuple(self._robot.names.values()))
        is_news, self._last = key != self._key, decision
        if is_news:
            self._key, self.text = key, self._text(decision)
            self._logged.clear()
        if decision.fault is not None or decision.refused:
            self._warn("fault", self.text if is_news else self._text(decision))
        elif is_news and decision.action is GuardAction.STOP:
            self._logger.warning(self.text)  # rclpy wants one line of code for each severity
        elif is_news:
            self._logger.info(self.text)
        for doubt in decision.doubts:
            self._warn("doubt", doubt)
        return is_news

    def note_message(self, text: str) -> None:
        """Log a message that cannot be read: another version of the monitor publishes it."""
        self._warn("message", f"left out a message: {text}")

    def _warn(self, kind: str, text: str) -> None:
        now = time.monotonic()
        if now - self._logged.get(kind, -AGAIN) >= AGAIN:
            self._logged[kind] = now
            self._logger.warning(text)

    def _text(self, decision: Decision) -> str:
        reason = decision.verdict.reason
        return f"{VERBS[decision.action]}{f': {reason}' if reason else ''}; guards {self._objects()}"

    def _objects(self) -> str:
        names = list(self._robot.names.values())
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        return (", ".join(names[:NAMED]) or "no object") + more

    def reports(self) -> list[Report]:
        """Return the report of the guard: an ERROR while it cannot guard."""
        decision = self._last
        if decision is None:
            return [Report(self._task, DiagnosticLevel.ERROR, "no look at the monitor yet", {})]
        level = DiagnosticLevel.OK
        if decision.fault is not None:
            level = DiagnosticLevel.ERROR
        elif decision.refused or decision.doubts:
            level = DiagnosticLevel.WARN
        text = "; ".join((self._text(decision), *decision.doubts))
        values = {
            "action": VERBS[decision.action],
            "factor": f"{decision.verdict.factor:.3f}",
            "rule": decision.verdict.rule,
            "objects": self._objects(),
        }
        return [Report(self._task, level, text, values)]
