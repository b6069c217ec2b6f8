"""The monitor as a ROS 2 node: passes message bytes through the pipeline, publishes the answers and records everything.

    ros2 run collision_monitor monitor --ros-args -p horizon:=1.0 -p record:=run.mcap
"""

from __future__ import annotations

import gc
import threading
import time
from typing import TYPE_CHECKING, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from collision_monitor import codec, warm_up
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.pipeline.pipeline import Outputs, Pipeline, TakenShapes
from collision_monitor.pipeline.preparation import Preparation
from collision_monitor.pipeline.topics import NODE, STATUS_PERIOD, Topic
from collision_monitor.records import Phase
from collision_monitor.ros.endpoints import publisher, subscription
from collision_monitor.ros.live_settings import LiveSettings
from collision_monitor.ros.markers import MarkerView
from collision_monitor.ros.name_conflict import NameConflict
from collision_monitor.ros.node_recording import NodeRecording
from collision_monitor.ros.parameters import read_monitor_parameters
from collision_monitor.ros.process import StopRequest
from collision_monitor.ros.refusal_log import RefusalLog
from collision_monitor.ros.status_line import status_line
from collision_monitor.ros.step_times import StepTimes
from collision_monitor.settings.profile import Profile

if TYPE_CHECKING:
    from collision_monitor.ros.live_sources import LiveSources
    from collision_monitor.sources import Input

WATCHDOG_PERIOD: Final = 0.5
"""s: without steps the status is still published at least this often, so that silence never means "clear"."""

MARKER_PERIOD: Final = 100_000_000
"""ns between two pictures. Without a subscriber there are none."""

LOG_PERIOD: Final = 5_000_000_000
"""ns between two status lines in the log."""

COMPILER_PATIENCE: Final = 3.0
"""s until the log explains the wait. Loading compiled kernels takes much less."""


class MonitorNode(Node):
    """Subscribes to shapes and states, publishes contacts, predictions, status and markers.

    Raises InputError or ProfileError for impossible parameters.
    """

    def __init__(self, stop: StopRequest) -> None:
        super().__init__(NODE, automatically_declare_parameters_from_overrides=True)
        try:
            self.settings = settings = read_monitor_parameters(self)
        except CollisionMonitorError:
            self.destroy_node()
            raise
        self._warm_up(stop)
        self._name = self.get_fully_qualified_name()
        self._name_conflict = NameConflict(self)
        self._preparation = Preparation()
        self._pipeline = Pipeline(settings.profile, frame_id=settings.frame_id, preparation=self._preparation)
        self._times = StepTimes(settings.profile.max_time_step)
        self._markers = MarkerView(self._pipeline.catalogue, settings.frame_id)
        self._last_status = self._last_markers = self._last_log = time.monotonic_ns()
        self._last_step: int | None = None  # when the monitor's time last changed
        self._last_stamp: int | None = None
        self._was_silent = False
        self._is_event_wanted = settings.splitting.on_event

        self._contacts_out = publisher(self, Topic.CONTACTS)
        self._predictions_out = publisher(self, Topic.PREDICTIONS)
        self._status_out = publisher(self, Topic.STATUS)
        self._markers_out = publisher(self, Topic.MARKERS)
        self._recording = NodeRecording(
            self, settings.record, lambda: self._pipeline.metadata(self._name), settings.splitting
        )
        self._live_settings = LiveSettings(self, settings.profile, self._on_settings)
        # Shapes first: if both wait, the executor takes them in this order.
        shapes = subscription(self, Topic.SHAPES, self._on_shapes)
        states = subscription(self, Topic.STATES, self._on_states)
        self._shapes_in, self._states_in = shapes.topic_name, states.topic_name
        self._refusals = RefusalLog(self._pipeline.monitor, self.get_logger().warning)
        self._sources = self._live_sources()
        self.create_timer(WATCHDOG_PERIOD, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME))
        _keep_from_collector()
        self._publish_status()
        if self._sources is not None:
            self._sources.begin()
        self.get_logger().info(
            f"listening on {states.topic_name} and {shapes.topic_name}, "
            f"profile {settings.profile.name}, frame {settings.frame_id}, {self._recording}"
        )

    def _warm_up(self, stop: StopRequest) -> None:
        """Load or compile the kernels before messages arrive, because messages that wait for the compiler are lost."""
        text = "compiling the kernels, once for this machine and version: this takes a minute or two"
        patience = threading.Timer(COMPILER_PATIENCE, self.get_logger().info, [text])
        patience.start()
        try:
            with stop.ending():
                warm_up.warm_up_monitor()
        finally:
            patience.cancel()

    # -- sources of other programs

    def _live_sources(self) -> LiveSources | None:
        """Return the sources of the file, if one is given; their inputs take the way of the node's own topics."""
        if self.settings.sources is None:
            return None
        from collision_monitor.ros.live_sources import LiveSources

        def take(given: Input) -> None:
            (self._on_states if given.topic is Topic.STATES else self._on_shapes)(given.data)

        def warn(name: str, text: str, count: int) -> None:
            self._refusals.note("sources", name, text, count, time.monotonic_ns())

        return LiveSources(self, self.settings.sources, take, warn)

    # -- states: one step

    def _on_states(self, data: bytes) -> None:
        """Publish the answers, then record them. Publish status and markers and record a snapshot if they are due."""
        began, received = time.monotonic_ns(), self._now()
        outputs = self._answer(data)
        ended = time.monotonic_ns()
        self._refusals.report(self._states_in, ended)
        if outputs is None:
            self._recording.write(Topic.STATES, data, received, received)
            return
        if outputs.result.stamp_ns != self._last_stamp:  # a stamp that stands still is no news, however often it comes
            self._last_step, self._last_stamp = ended, outputs.result.stamp_ns
        self._times.add(began, ended, self._now() - outputs.result.stamp_ns)
        self._record_step(data, outputs, received)
        self._publish_status_if_due(ended)
        self._publish_markers_if_due(data, outputs, ended)
        self._recording.write_snapshot_if_due(self._pipeline.snapshot)

    def _answer(self, states: bytes) -> Outputs | None:
        """Take one step and publish its answers, all within the step's budget."""
        with self._pipeline.monitor.clock:
            outputs = self._pipeline.on_states(states)
            if outputs is not None:
                self._predictions_out.publish(outputs.predictions)  # first: a warning is worth more if it is early
                self._contacts_out.publish(outputs.contacts)
            return outputs

    def _record_step(self, states: bytes, outputs: Outputs, received: int) -> None:
        """Record a step in the order that a replay needs: how far the step came, the inputs, the answers."""
        stamp = outputs.result.stamp_ns
        begins = self._is_event_wanted and bool((outputs.result.contacts["phase"] == Phase.BEGIN).any())
        if outputs.limit is not None:
            self._recording.write(Topic.SETTINGS, outputs.limit, received, received)
        self._recording.write(Topic.STATES, states, received, stamp)
        self._recording.write(Topic.CONTACTS, outputs.contacts, received, stamp, event=begins)
        self._recording.write(Topic.PREDICTIONS, outputs.predictions, received, stamp)

    def _publish_markers_if_due(self, states: bytes, outputs: Outputs, now: int) -> None:
        if now - self._last_markers < MARKER_PERIOD or not self._markers_out.get_subscription_count():
            return
        self._last_markers = now
        self._markers_out.publish(self._markers.draw(codec.decode_states(states).states, outputs.result))

    # -- shapes and settings

    def _on_shapes(self, data: bytes) -> None:
        received = self._now()
        self._note_shapes(self._pipeline.take_shapes(data), received)
        self._refusals.report(self._shapes_in, time.monotonic_ns())
        self._publish_status_if_due(time.monotonic_ns())  # so that the sender learns when its shapes are known

    def _note_shapes(self, taken: TakenShapes, received: int) -> None:
        """Record descriptions and show them."""
        self._record_shapes(taken.data, received)
        if taken.changes:
            self._markers.update(taken.changes)
            _keep_from_collector()

    def _take_prepared(self) -> None:
        """Describe the objects again whose models were made beside the monitoring. Log why others stay coarse."""
        taken, texts = self._pipeline.take_prepared()
        for each in taken:
            self._note_shapes(each, self._now())
        for text in texts:
            self.get_logger().warning(text)

    def _on_settings(self, profile: Profile) -> None:
        """Change the settings. Like all callbacks, this runs between two steps."""
        now = self._now()
        change = self._pipeline.change_settings(profile, now, self._name)
        self._recording.write(Topic.SETTINGS, change.settings, now, now, settings=self._pipeline.settings())
        if change.shapes is not None:
            self._record_shapes(change.shapes, now)
        self._times.longest_latency = profile.max_time_step
        self.get_logger().info(f"settings changed, profile {profile.name}")

    def _record_shapes(self, data: bytes, received: int) -> None:
        """Record an ObjectDescriptionArray that the pipeline has processed, with all objects described since then."""
        objects = tuple(self._pipeline.catalogue.descriptions.values())
        self._recording.write(Topic.SHAPES, data, received, received, objects=objects)

    # -- status

    def _on_watchdog(self) -> None:
        self._recording.log_problems()
        self._name_conflict.look()
        self._take_prepared()
        now = time.monotonic_ns()
        silent = self._is_silent(now)
        if silent != self._was_silent:
            self._log_silence(silent)
        if not silent:
            self._refusals.report_stale(self._states_in, now)
        self._refusals.catch_up(now)
        self._publish_status_if_due(now)
        if now - self._last_log >= LOG_PERIOD and not silent and self._last_step is not None:
            self._last_log = now
            self.get_logger().info(status_line(codec.decode_status(self._publish_status())))

    def _is_silent(self, now: int) -> bool:
        """Return whether newer states once arrived and no longer arrive, by the steady clock."""
        return self._last_step is not None and now - self._last_step >= self._pipeline.monitor.profile.stale_after * 1e9

    def _log_silence(self, silent: bool) -> None:
        self._was_silent = silent
        if silent:
            self.get_logger().warning(f"no newer states on {self._states_in}: all moving objects are stale")
        else:
            self.get_logger().info("newer states arrive again")

    def _publish_status_if_due(self, now: int) -> None:
        if now - self._last_status >= STATUS_PERIOD:
            self._publish_status()

    def _publish_status(self) -> bytes:
        self._last_status = time.monotonic_ns()
        live = self._times.summary(self._last_status)
        data = self._pipeline.status(silent=self._is_silent(self._last_status), **live, **self._recording.status())
        self._status_out.publish(data)
        now = self._now()
        self._recording.write(Topic.STATUS, data, now, now)
        return data

    def _now(self) -> int:
        nanoseconds: int = self.get_clock().now().nanoseconds
        return nanoseconds

    def save(self) -> None:
        """Finish the session file, from another thread: this one is stuck and the process is about to end."""
        self._recording.finish()

    def close(self) -> None:
        """Publish and record the last status, and finish the session file."""
        self._preparation.close()
        self._publish_status()
        self._recording.close()
        self.destroy_node()


def _keep_from_collector() -> None:
    """Keep modules, kernels and descriptions out of later garbage collections, which delay a step by up to 0.1 s."""
    gc.collect()
    gc.freeze()
