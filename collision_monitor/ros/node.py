"""The monitor as a ROS 2 node: message bytes in, the pipeline, message bytes out, and all of it on record.

    ros2 run collision_monitor monitor --ros-args -p horizon:=1.0 -p record:=run.mcap
"""

from __future__ import annotations

import gc
import math
import threading
import time
from typing import Any, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from collision_monitor import codec, warm_up
from collision_monitor.errors import CollisionMonitorError, Refusal, SessionError
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.records import Phase
from collision_monitor.ros import qos
from collision_monitor.ros.live_settings import LiveSettings
from collision_monitor.ros.markers import MarkerView
from collision_monitor.ros.parameters import read_monitor_parameters
from collision_monitor.ros.process import StopRequest
from collision_monitor.ros.step_times import StepTimes
from collision_monitor.session import Recorder, Recording
from collision_monitor.settings.profile import Profile
from collision_monitor_msgs.msg import (
    ContactArray,
    MonitorStatus,
    ObjectDescriptionArray,
    ObjectStateArray,
    PredictedCollisionArray,
)

STATUS_PERIOD: Final = 50_000_000
"""ns between two statuses while steps arrive: 20 Hz is enough for people and supervisors, 1 kHz is not."""

WATCHDOG_PERIOD: Final = 0.5
"""s: without steps the status still comes at least this often, so that silence is never read as "clear"."""

MARKER_PERIOD: Final = 100_000_000
"""ns between two pictures, and only while someone looks."""

LOG_PERIOD: Final = 5_000_000_000
"""ns between two lines for people."""

COMPILER_PATIENCE: Final = 3.0
"""s until people are told why nothing happens yet; compiled kernels are loaded well within it."""


class MonitorNode(Node):
    """Subscribes to shapes and states, publishes contacts, predictions, status and markers. Raises ProfileError."""

    def __init__(self, stop: StopRequest) -> None:
        super().__init__("object_monitor", automatically_declare_parameters_from_overrides=True)
        try:
            self.settings = read_monitor_parameters(self)
        except CollisionMonitorError:
            self.destroy_node()
            raise
        self._warm_up(stop)
        self._pipeline = Pipeline(self.settings.profile, frame_id=self.settings.frame_id)
        self._times = StepTimes(self.settings.profile.max_time_step)
        self._markers = MarkerView(self.settings.frame_id)
        self._last_status = self._last_markers = self._last_log = time.monotonic_ns()
        self._last_step: int | None = None
        self._said_silent = False
        self._no_recording: dict[str, Any] = {}
        self._recording: dict[str, Any] = {}  # as it was told last
        self._is_event_wanted = self.settings.splitting.on_event

        self._contacts_out = self.create_publisher(ContactArray, "~/contacts", qos.ANSWERS)
        self._predictions_out = self.create_publisher(PredictedCollisionArray, "~/predictions", qos.ANSWERS)
        self._status_out = self.create_publisher(MonitorStatus, "~/status", qos.STATUS)
        self._markers_out = self.create_publisher(MarkerArray, "~/markers", qos.MARKERS)
        self._shapes_topic = self.resolve_topic_name("~/objects/shapes")
        self._states_topic = self.resolve_topic_name("~/objects/states")
        self._settings_topic = self.resolve_topic_name("~/settings")  # only recorded: ROS has /parameter_events
        self._recorder = self._start_recording()
        self._live_settings = LiveSettings(self, self.settings.profile, self._on_settings)
        # Shapes first: where both wait, the executor takes them in this order.
        self.create_subscription(ObjectDescriptionArray, self._shapes_topic, self._on_shapes, qos.SHAPES, raw=True)
        self.create_subscription(ObjectStateArray, self._states_topic, self._on_states, qos.STATES, raw=True)
        self.create_timer(WATCHDOG_PERIOD, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME))
        _keep_from_collector()
        self._publish_status()
        self.get_logger().info(
            f"listening on {self._states_topic} and {self._shapes_topic}, "
            f"profile {self.settings.profile.name}, frame {self.settings.frame_id}, "
            + (f"recording to {self._recorder.path}" if self._recorder else "not recording")
        )

    def _warm_up(self, stop: StopRequest) -> None:
        """Before anything arrives: a message that waits for the compiler is a message lost."""
        text = "compiling the kernels, once for this machine and version: this takes a minute or two"
        patience = threading.Timer(COMPILER_PATIENCE, self.get_logger().info, [text])
        patience.start()
        try:
            with stop.ending():
                warm_up.warm_up_monitor()
        finally:
            patience.cancel()

    def _start_recording(self) -> Recorder | None:
        """None where no recording is wanted or it cannot start: then the status says why, and monitoring goes on."""
        path = self.settings.record
        if not path:
            return None
        types = {
            self._shapes_topic: "ObjectDescriptionArray",
            self._states_topic: "ObjectStateArray",
            self._settings_topic: "ParameterEvent",
            self._contacts_out.topic_name: "ContactArray",
            self._predictions_out.topic_name: "PredictedCollisionArray",
            self._status_out.topic_name: "MonitorStatus",
        }
        try:
            metadata = self._pipeline.metadata(node=self.get_fully_qualified_name())
            return Recorder(path, types, metadata, splitting=self.settings.splitting, snapshots=True)
        except SessionError as error:
            self.get_logger().error(f"not recording: {error}")
            self._no_recording = {
                "recording": Recording.FAILED,
                "recording_path": path,
                "recording_error": str(error),
            }
            return None

    # -- messages

    def _on_shapes(self, data: bytes) -> None:
        received = self._now()
        message = self._pipeline.on_shapes(data)
        self._record_shapes(data, received)
        if message is not None:
            self._markers.describe(message)
            _keep_from_collector()
        if time.monotonic_ns() - self._last_status >= STATUS_PERIOD:
            self._publish_status()  # so that the sender learns when its shapes are known

    def _on_settings(self, profile: Profile) -> None:
        """Between two steps, like all callbacks."""
        now = self._now()
        change = self._pipeline.change_settings(profile, now, self.get_fully_qualified_name())
        self._record(self._settings_topic, change.settings, now, now, settings=self._pipeline.settings())
        if change.shapes is not None:
            self._record_shapes(change.shapes, now)
        self._times.longest_latency = profile.max_time_step
        self.get_logger().info(f"settings changed, profile {profile.name}")

    def _on_states(self, data: bytes) -> None:
        began = time.monotonic_ns()
        received = self._now()
        with self._pipeline.monitor.clock:
            outputs = self._publish_step(data)
        ended = time.monotonic_ns()
        if outputs is None:
            self._record(self._states_topic, data, received, received)
            return
        stamp = outputs.result.stamp_ns
        self._times.add(began, ended, self._now() - stamp)
        self._last_step = ended
        if outputs.limit is not None:
            self._record(self._settings_topic, outputs.limit, received, received)
        self._record(self._states_topic, data, received, stamp)
        begins = self._is_event_wanted and bool((outputs.result.contacts["phase"] == Phase.BEGIN).any())
        self._record(self._contacts_out.topic_name, outputs.contacts, received, stamp, event=begins)
        self._record(self._predictions_out.topic_name, outputs.predictions, received, stamp)
        if ended - self._last_status >= STATUS_PERIOD:
            self._publish_status()
        self._publish_markers(data, outputs, ended)
        if self._recorder is not None and self._recorder.snapshot_due:
            self._recorder.write_snapshot(self._pipeline.snapshot())

    def _publish_step(self, states: bytes) -> Outputs | None:
        outputs = self._pipeline.on_states(states)
        if outputs is not None:
            self._predictions_out.publish(outputs.predictions)  # first: a warning is worth more the earlier it comes
            self._contacts_out.publish(outputs.contacts)
        return outputs

    def _on_watchdog(self) -> None:
        self._tell_of_recording()
        now = time.monotonic_ns()
        silent = self._is_silent(now)
        if silent and not self._said_silent:
            self.get_logger().warning(f"no states on {self._states_topic}: all moving objects are stale")
        elif self._said_silent and not silent:
            self.get_logger().info("states arrive again")
        self._said_silent = silent
        if now - self._last_status >= STATUS_PERIOD:
            self._publish_status()
        if now - self._last_log >= LOG_PERIOD and not silent and self._last_step is not None:
            self._last_log = now
            self.get_logger().info(self._line(codec.decode_status(self._publish_status())))

    def _is_silent(self, now: int) -> bool:
        """Whether states came once and come no more, by the steady clock."""
        return self._last_step is not None and now - self._last_step >= self._pipeline.monitor.profile.stale_after * 1e9

    # -- answers

    def _publish_status(self) -> bytes:
        self._last_status = time.monotonic_ns()
        live = self._times.summary(self._last_status)
        silent = self._is_silent(self._last_status)
        recording = self._no_recording if self._recorder is None else self._recorder.status()
        data = self._pipeline.status(silent=silent, **live, **recording)
        self._status_out.publish(data)
        now = self._now()
        self._record(self._status_out.topic_name, data, now, now)
        return data

    def _publish_markers(self, states: bytes, outputs: Outputs, now: int) -> None:
        if now - self._last_markers < MARKER_PERIOD or not self._markers_out.get_subscription_count():
            return
        self._last_markers = now
        self._markers_out.publish(self._markers.draw(codec.decode_states(states).states, outputs.result))

    def _record(self, topic: str, data: bytes, log_time: int, publish_time: int, **what: Any) -> None:
        if self._recorder is not None:
            self._recorder.write(topic, data, log_time, publish_time, **what)

    def _record_shapes(self, data: bytes, received: int) -> None:
        """An ObjectDescriptionArray that the pipeline has taken in, and all that is described since."""
        objects = tuple(self._pipeline.objects.values())
        self._record(self._shapes_topic, data, received, received, objects=objects)

    def _tell_of_recording(self) -> None:
        """A recording that fails or loses messages is said at once, not only where someone reads the status."""
        if self._recorder is None:
            return
        told, recording = self._recording, self._recorder.status()
        self._recording = recording
        if recording["recording"] == Recording.FAILED != told.get("recording"):
            self.get_logger().error(f"the recording failed, the monitoring goes on: {recording['recording_error']}")
        elif recording["recording_dropped"] != told.get("recording_dropped", 0):
            self.get_logger().warning(
                f"the disk is too slow for the recording: {recording['recording_dropped']} messages dropped so far"
            )

    def _line(self, status: codec.Status) -> str:
        latency = "unknown" if math.isnan(status.latency) else f"{status.latency * 1e3:.1f} ms"
        line = (
            f"{status.objects} objects at {status.rate:.0f} Hz: {status.contacts} touching, "
            f"{status.predictions} predicted, latency {latency}"
        )
        refused = sum(getattr(status, f"refused_{reason.value}") for reason in Refusal)
        if refused:
            line += f", {refused} refused (last: {status.last_refusal})"
        if status.recording == Recording.FAILED:
            line += f", recording failed: {status.recording_error}"
        return line

    def _now(self) -> int:
        nanoseconds: int = self.get_clock().now().nanoseconds
        return nanoseconds

    def close(self) -> None:
        """Publish and record the last status, and finish the session file."""
        self._publish_status()
        if self._recorder is not None:
            self._recorder.close()
            self._tell_of_recording()
        self.destroy_node()


def _keep_from_collector() -> None:
    """Let no later step wait while Python searches modules, kernels and descriptions for garbage: 0.1 s at times."""
    gc.collect()
    gc.freeze()
