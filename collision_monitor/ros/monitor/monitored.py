"""What the node monitors, for viewers: the objects, states and plans of its own topics and of its sources."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.event_handler import PublisherEventCallbacks, QoSPublisherMatchedInfo
from rclpy.lifecycle import LifecycleNode

from collision_monitor.codec import (
    Change,
    ObjectTrajectory,
    decode_trajectories,
    encode_descriptions,
    encode_trajectories,
)
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.catalogue import Catalogue
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import answer_publisher


class Monitored:
    """Publishes descriptions, states and plans while anything subscribes to them.

    A new subscriber gets a snapshot of all objects with their last plans, and then the changes. catalogue: the objects
    that were accepted.
    """

    def __init__(self, node: LifecycleNode, catalogue: Catalogue, frame_id: str) -> None:
        self._node, self._catalogue, self._frame_id = node, catalogue, frame_id
        self._is_due = False  # whether a subscriber needs a snapshot
        events = PublisherEventCallbacks(matched=self._on_matched)
        self._shapes = answer_publisher(node, Topic.MONITORED_SHAPES, events)
        self._states = answer_publisher(node, Topic.MONITORED_STATES)
        followers = PublisherEventCallbacks(matched=self._on_follower)
        self._plans_out = answer_publisher(node, Topic.MONITORED_PLANS, followers)
        self._plans: dict[int, tuple[int, ObjectTrajectory]] = {}  # the last ones, of described objects

    def _on_matched(self, info: QoSPublisherMatchedInfo) -> None:
        if info.current_count_change > 0:
            self.renew()

    def _on_follower(self, info: QoSPublisherMatchedInfo) -> None:
        if info.current_count_change > 0:
            self._publish_plans()

    def renew(self) -> None:
        """Publish a snapshot of all objects now, or at the latest by the next call while the node is active."""
        self._is_due = True
        self._publish_if_due()
        self._publish_plans()

    def describe(self, changes: Sequence[Change]) -> None:
        """Publish the changes that were made to the catalogue."""
        if not self._publish_if_due() and changes and self._shapes.get_subscription_count():
            self._publish(changes, snapshot=False)

    def move(self, states: bytes) -> None:
        """Publish an ObjectStateArray that was accepted, after the objects that it moves."""
        self._publish_if_due()
        if self._states.get_subscription_count():
            self._states.publish(states)

    def follow(self, data: bytes) -> None:
        """Publish an ObjectTrajectoryArray, after the objects that follow its plans."""
        try:
            message = decode_trajectories(data)
        except MessageError:  # the monitor refuses it
            return
        if message.frame_id not in ("", self._frame_id):
            return
        for plan in message.trajectories:
            if plan.object_id in self._catalogue.descriptions:
                self._plans[plan.object_id] = message.stamp_ns, plan
        if self._plans_out.get_subscription_count():
            self._plans_out.publish(data)

    def _publish_plans(self) -> None:
        """Publish the last plans of the objects that are there."""
        known = self._catalogue.descriptions
        self._plans = {each: plan for each, plan in self._plans.items() if each in known}
        if self._plans_out.is_activated and self._plans_out.get_subscription_count():
            for stamp_ns, plan in self._plans.values():
                self._plans_out.publish(encode_trajectories(stamp_ns, self._frame_id, [plan]))

    def _publish_if_due(self) -> bool:
        """Publish the snapshot that is due, and return whether there was one."""
        if not (self._is_due and self._shapes.is_activated):
            return False
        self._is_due = False
        if self._shapes.get_subscription_count():
            self._publish(list(self._catalogue.descriptions.values()), snapshot=True)
        return True

    def _publish(self, changes: Sequence[Change], *, snapshot: bool) -> None:
        now = self._node.get_clock().now().nanoseconds
        self._shapes.publish(encode_descriptions(now, self._frame_id, changes, snapshot=snapshot))
