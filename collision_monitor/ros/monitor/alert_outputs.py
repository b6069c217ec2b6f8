"""The alerts of a node on their topics, with what guards need, and the rules in force for people."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile

from collision_monitor.alerts.missing_objects import MissingObject
from collision_monitor.alerts.rules_in_force import RuleInForce, rules_in_force
from collision_monitor.codec import CollisionAlertArray, encode_alerts
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import RULES_IN_FORCE, Topic
from collision_monitor.ros.endpoints import answer_publisher
from collision_monitor.ros.health.line_report import DiagnosticLevel
from collision_monitor.sources import Unmonitored

PERIOD: Final = 1_000_000_000
"""ns between two messages about the rules in force that say the same."""


class AlertOutputs:
    """Publishes alerts, all that are raised, and the rules in force. missing: what is asked for and not monitored."""

    def __init__(self, node: LifecycleNode, pipeline: Pipeline, missing: Callable[[], Sequence[Unmonitored]]) -> None:
        self._node, self._logger, self._pipeline, self._missing = node, node.get_logger(), pipeline, missing
        self._number = int.from_bytes(os.urandom(8))  # tells guards two monitors apart, and a restarted one
        self._alerts = answer_publisher(node, Topic.ALERTS)
        self._raised = answer_publisher(node, Topic.RAISED_ALERTS)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._rules = node.create_lifecycle_publisher(DiagnosticArray, RULES_IN_FORCE, latched)
        self._told: list[RuleInForce] | None = None
        self._told_at = 0
        self._empty: list[str] = []  # classes, at the last look

    def publish_step(self, alerts: Sequence[bytes]) -> None:
        """Publish the alerts that a step has changed, and all that are raised if anything reads them."""
        for each in alerts:
            self._alerts.publish(each)
        if alerts or self._raised.get_subscription_count():
            self._publish_raised()

    def publish(self) -> None:
        """Publish all that are raised, and the rules in force if they changed or are due."""
        self._publish_rules(self._publish_raised())

    def _publish_raised(self) -> CollisionAlertArray:
        array = self._pipeline.raised_alert_array([_missing(row) for row in self._missing()], self._number)
        self._raised.publish(encode_alerts(array))
        return array

    def _publish_rules(self, array: CollisionAlertArray) -> None:
        found = rules_in_force(self._pipeline.rules, array, self._pipeline.catalogue.name)
        now = time.monotonic_ns()
        if found == self._told and now - self._told_at < PERIOD:
            return
        if self._rules.is_activated:
            self._told, self._told_at = found, now
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.status = [self._status(each) for each in found] or [self._none()]
        self._rules.publish(message)

    def _status(self, each: RuleInForce) -> DiagnosticStatus:
        level = DiagnosticLevel.OK if each.is_whole else DiagnosticLevel.WARN
        name = f"{self._node.get_name()}: {each.name}"
        values = [KeyValue(key=key, value=value) for key, value in each.values.items()]
        return DiagnosticStatus(
            level=bytes([level]), name=name, message=each.summary, hardware_id="none", values=values
        )

    def _none(self) -> DiagnosticStatus:
        name = f"{self._node.get_name()}: no rules"
        text = "no rules are in force: nothing raises an alert"
        return DiagnosticStatus(level=bytes([DiagnosticLevel.WARN]), name=name, message=text, hardware_id="none")

    # -- warnings

    def report(self) -> tuple[RuleInForce, ...]:
        """Return the rules in force as they were last published."""
        return tuple(self._told or ())

    def check_rules(self) -> None:
        """Warn if a rule asks for more than the predictions tell."""
        profile, longest = self._pipeline.profile, self._pipeline.rules.longest_time
        if longest > profile.horizon:
            self._logger.warning(
                f"a rule has a threshold of {longest:g} s, and collisions are predicted only {profile.horizon:g} s "
                "ahead: raise the parameter horizon"
            )
        if longest and (profile.ignore_separating or profile.min_closing_speed > 0.0):
            self._logger.warning(
                "rules: predictions that ignore_separating and min_closing_speed leave out raise no alert"
            )

    def warn_of_empty_classes(self) -> None:
        """Warn if no object belongs to a class, when that changes."""
        empty = self._pipeline.empty_classes
        if empty and empty != self._empty:
            self._logger.warning(f"rules: no object belongs to the class {', '.join(empty)}")
        self._empty = empty


def _missing(row: Unmonitored) -> MissingObject:
    """Return a row of the sources with the name of its object, or with which those of its group begin."""
    is_object = row.what == row.line or row.what.startswith(f"{row.line}/")
    return MissingObject(row.what if is_object else row.line, row.text, row.since_ns)
