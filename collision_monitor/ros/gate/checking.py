"""The service of the gate that judges a plan without executing it."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from math import inf
from typing import Any, Final

from rclpy.node import Node

from collision_monitor.pipeline.topics import CHECK_TRAJECTORY
from collision_monitor.ros.endpoints import message_class
from collision_monitor.ros.gate.gated_plan import GatedPlan
from collision_monitor.ros.gate.gatekeeper import Gatekeeper
from collision_monitor.ros.gate.plan_conflicts import PlanConflict
from collision_monitor.ros.guard.monitor_answers import ClockReading

_CONFLICT: Final = "collision_monitor_msgs/msg/PlanConflict"

MOST_TOLD: Final = 1000
"""Conflicts of an answer."""


class CheckService:
    """Answers `~/check_trajectory`. made: what makes the plan of a message. reading: the time now."""

    def __init__(
        self, node: Node, keeper: Gatekeeper, made: Callable[[Any], Callable[[], GatedPlan]],
        reading: Callable[[], ClockReading],
    ) -> None:  # fmt: skip
        self._keeper, self._made, self._reading = keeper, made, reading
        self._service = node.create_service(_service_class(), CHECK_TRAJECTORY, self._answer)

    def _answer(self, request: Any, response: Any) -> Any:
        message = request.trajectory if len(request.trajectory.points) else request.path
        plan, judgement = self._keeper.judge(self._made(message), self._reading(), measures=True)
        response.judged = plan is not None
        response.reason = judgement.text
        response.clear = plan is not None and not judgement.text
        if plan is not None:
            response.clear_until = min((each.entry[0] for each in judgement.conflicts), default=inf)
            response.least_distance = judgement.distance
            response.conflicts = [self._told(each) for each in judgement.conflicts[:MOST_TOLD]]
        return response

    def _told(self, found: PlanConflict) -> Any:
        made = message_class(_CONFLICT)(part=found.part, other=found.other, distance=found.gap)
        made.entry_lower, made.entry_upper = found.entry
        made.exit_lower, made.exit_upper = found.exit
        made.point.x, made.point.y, made.point.z = found.point
        return made


def _service_class() -> Any:
    return import_module("collision_monitor_msgs.srv").CheckTrajectory
