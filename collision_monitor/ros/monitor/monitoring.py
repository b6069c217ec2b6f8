"""One configuration of the node: passes message bytes through the pipeline, publishes the answers, records everything.

It lasts from `configure` to `cleanup`. Inactive it does the same and publishes nothing, so that its objects and its
recording have no gap.
"""

from __future__ import annotations

import gc
import time
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Final

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleNode

from collision_monitor import codec
from collision_monitor.alerts.rules import Rules
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.pipeline.preparation import Preparation
from collision_monitor.pipeline.shape_intake import TakenShapes
from collision_monitor.pipeline.state_intake import ReceivedStates
from collision_monitor.pipeline.topics import STATUS_PERIOD, Topic
from collision_monitor.records import Phase
from collision_monitor.ros.endpoints import answer_publisher, subscription
from collision_monitor.ros.health.health import NodeFacts
from collision_monitor.ros.health.refusal_log import RefusalLog, named
from collision_monitor.ros.health.status_line import status_line
from collision_monitor.ros.health.step_peaks import StepPeaks
from collision_monitor.ros.health.step_times import StepTimes
from collision_monitor.ros.monitor.alert_outputs import AlertOutputs
from collision_monitor.ros.monitor.contact_readers import ContactReaders
from collision_monitor.ros.monitor.keeping_up import KeepingUp
from collision_monitor.ros.monitor.markers import MarkerView
from collision_monitor.ros.monitor.monitored import Monitored
from collision_monitor.ros.monitor.node_recording import NodeRecording
from collision_monitor.ros.name_conflict import NameConflict
from collision_monitor.ros.parameters import MonitorParameters
from collision_monitor.settings.profile import Profile
from collision_monitor.warm_up import warm_up_alerts

if TYPE_CHECKING:
    from collision_monitor.ros.monitor.live_sources import LiveSources
    from collision_monitor.sources import Input, Mapping, Unmonitored, UnmonitoredRecord

WATCHDOG_PERIOD: Final = 0.5
"""s: without steps the status is still published at least this often, so that silence never means "clear"."""

LATE_WATCHDOG: Final = 1_000_000_000
"""ns after which a step calls the watchdog: rclpy's events executor runs no timer while messages wait."""

MARKER_PERIOD: Final = 100_000_000
"""ns between two pictures. Without a subscriber there are none."""

LOG_PERIOD: Final = 5_000_000_000
"""ns between two status lines in the log."""


class Monitoring:
    """Subscribes to shapes and states, publishes contacts, predictions, alerts, status and markers.

    node: a managed node, which destroys what is made here. resources: gets what has to end with the configuration, also
    when it fails halfway. profile, rules: those in force. record: as the parameter; empty: no recording.
    """

    def __init__(
        self,
        node: LifecycleNode,
        resources: ExitStack,
        settings: MonitorParameters,
        profile: Profile,
        rules: Rules,
        record: str,
    ) -> None:
        self._node, self._logger = node, node.get_logger()
        self._name = node.get_fully_qualified_name()
        self._name_conflict = NameConflict(node)
        self._preparation = Preparation()
        resources.callback(self._preparation.close)
        self._pipeline = Pipeline(profile, settings.frame_id, preparation=self._preparation, rules=rules)
        self._chosen = profile  # without regard to what is read
        self._times = StepTimes(profile.max_time_step)
        self._peaks = StepPeaks()
        self._markers = MarkerView(self._pipeline.catalogue, settings.frame_id)
        self._last_status = self._last_markers = self._last_log = self._last_watchdog = time.monotonic_ns()
        self._last_step: int | None = None  # when the monitor's time last changed
        self._last_stamp: int | None = None
        self._was_silent = False
        self._is_event_wanted = settings.splitting.on_event

        self._contacts_out = answer_publisher(node, Topic.CONTACTS)
        self._predictions_out = answer_publisher(node, Topic.PREDICTIONS)
        self._status_out = answer_publisher(node, Topic.STATUS)
        self._markers_out = answer_publisher(node, Topic.MARKERS)
        self._monitored = Monitored(node, self._pipeline.catalogue, settings.frame_id)
        self._recording = NodeRecording(node, record, lambda: self._pipeline.metadata(self._name), settings.splitting)
        resources.callback(self._recording.close)
        # Shapes first: if both wait, the executor takes them in this order.
        shapes = subscription(node, Topic.SHAPES, self._on_shapes)
        plans = subscription(node, Topic.TRAJECTORIES, self._on_trajectories)
        states = subscription(node, Topic.STATES, self._on_states)
        self._shapes_in, self._plans_in, self._states_in = shapes.topic_name, plans.topic_name, states.topic_name
        self._refusals = RefusalLog(self._pipeline, self._logger.warning)
        readable = self._contacts_out, self._markers_out
        self._readers = ContactReaders(readable, self._recording, self._pipeline)
        self._keeping_up = KeepingUp(states, self._times, self._refusals, profile, enabled=settings.keep_up)
        self._unmonitored_record: UnmonitoredRecord | None = None
        self._sources = self._live_sources(settings.sources)
        self._alerts = AlertOutputs(node, self._pipeline, self._unmonitored)
        if self._sources is not None:
            resources.callback(self._sources.close)
        node.create_timer(WATCHDOG_PERIOD, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME))
        gc.unfreeze()  # what an earlier configuration kept
        _keep_from_collector()
        resources.callback(self._publish_status)  # the last one of the recording
        resources.callback(self._record_unmonitored)
        resources.callback(lambda: self._logger.info(str(self._times)))
        if self._sources is not None:
            self._sources.begin()
        self._logger.info(
            f"listening on {states.topic_name} and {shapes.topic_name}, "
            f"profile {profile.name}, frame {settings.frame_id}, {self._recording}"
        )
        self._alerts.check_rules()

    # -- activation

    @property
    def is_active(self) -> bool:
        """Whether the answers are published."""
        return bool(self._contacts_out.is_activated)

    def activate(self) -> None:
        """Publish the status at once, now that the publishers are active."""
        self._publish_status()
        self._monitored.renew()
        self._logger.info("active: answers are published")

    def deactivate(self) -> None:
        """Say that nothing is published from now on."""
        self._logger.info(f"inactive: nothing is published; the inputs are still monitored, {self._recording}")

    # -- sources of other programs

    def _live_sources(self, mapping: Mapping | None) -> LiveSources | None:
        """Return the sources of the file, if one is given; their inputs take the way of the node's own topics."""
        if mapping is None:
            return None
        from collision_monitor.ros.monitor.live_sources import LiveSources
        from collision_monitor.sources import UnmonitoredRecord

        self._unmonitored_record = UnmonitoredRecord(self._name.strip("/"))

        def take(given: Input) -> None:
            if given.topic is Topic.STATES:
                self._take_step(ReceivedStates.decode(given.data))
            elif given.topic is Topic.TRAJECTORIES:
                self._on_trajectories(given.data)
            else:
                self._on_shapes(given.data)

        def warn(name: str, text: str, count: int) -> None:
            self._refusals.note("sources", name, text, count, time.monotonic_ns())

        return LiveSources(self._node, mapping, take, warn, self._pipeline.profile.horizon)

    def _unmonitored(self) -> tuple[Unmonitored, ...]:
        """Return what the sources file asks for and is not monitored."""
        return () if self._sources is None else self._sources.unmonitored

    def _record_unmonitored(self) -> None:
        """Record what is not monitored, if that has changed."""
        if self._unmonitored_record is None or not self._recording.is_on:
            return
        now = self._now()
        if (data := self._unmonitored_record.changed(self._unmonitored(), now)) is not None:
            self._recording.write(Topic.SOURCES, data, now, now)

    # -- states: one step

    def _on_states(self, data: bytes) -> None:
        """Take a step for each message that waits, without those that are outdated."""
        for each in self._keeping_up.choose(ReceivedStates.decode(data)):
            self._take_step(each)

    def _take_step(self, states: ReceivedStates) -> None:
        """Publish the answers, then record them. Publish status and markers and record a snapshot if they are due."""
        began, received = time.monotonic_ns(), self._now()
        if self._readers.look():
            self._use(self._chosen)
        due = received + self._keeping_up.mean_step
        outputs = self._pipeline.take_states(states, due, partial(self._publish_answers, states))
        ended = time.monotonic_ns()
        self._refusals.report(self._states_in, ended)
        if outputs is None:
            self._recording.write(Topic.STATES, states.data, received, received)
            return
        if outputs.result.stamp_ns != self._last_stamp:  # a stamp that stands still is no news, however often it comes
            self._last_step, self._last_stamp = ended, outputs.result.stamp_ns
        self._times.add(began, ended, self._now() - outputs.result.stamp_ns)
        self._keeping_up.end_step(began, ended)
        if self._sources is not None:
            self._sources.set_pace(self._keeping_up.pace)
        self._peaks.add(outputs.result.status)
        self._record_step(states.data, outputs, received)
        self._publish_status_if_due(ended)
        self._publish_markers_if_due(states, outputs, ended)
        self._recording.write_snapshot_if_due(self._pipeline.snapshot)
        if ended - self._last_watchdog >= LATE_WATCHDOG:
            self._on_watchdog()

    def _publish_answers(self, states: ReceivedStates, outputs: Outputs) -> None:
        """Publish the answers of a step, within its budget."""
        self._predictions_out.publish(outputs.predictions)  # first: a warning is worth more if it is early
        if self._readers.found or not self._readers.are_there:  # no first message without details
            self._contacts_out.publish(outputs.contacts)
        self._monitored.move(states.data)  # before the alerts, which a guard compares with them
        self._alerts.publish_step(outputs.alerts)

    def _record_step(self, states: bytes, outputs: Outputs, received: int) -> None:
        """Record a step in the order that a replay needs: how far the step came, the inputs, the answers."""
        stamp = outputs.result.stamp_ns
        begins = self._is_event_wanted and bool((outputs.result.contacts["phase"] == Phase.BEGIN).any())
        if outputs.settings is not None:
            self._recording.write(Topic.SETTINGS, outputs.settings, received, received)
        self._recording.write(Topic.STATES, states, received, stamp)
        self._recording.write(Topic.CONTACTS, outputs.contacts, received, stamp, event=begins)
        self._recording.write(Topic.PREDICTIONS, outputs.predictions, received, stamp)
        for each in outputs.alerts:
            self._recording.write(Topic.ALERTS, each, received, stamp)

    def _publish_markers_if_due(self, states: ReceivedStates, outputs: Outputs, now: int) -> None:
        assert states.message is not None, "it was answered"
        if now - self._last_markers < MARKER_PERIOD or not self.is_active:
            return
        if not self._markers_out.get_subscription_count():
            return
        self._last_markers = now
        self._markers_out.publish(self._markers.draw(states.message.states, outputs.result))

    # -- plans, shapes and settings

    def _on_trajectories(self, data: bytes) -> None:
        received = self._now()
        self._pipeline.on_trajectories(data)
        self._monitored.follow(data)
        self._recording.write(Topic.TRAJECTORIES, data, received, received)
        self._refusals.report(self._plans_in, time.monotonic_ns())

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
            self._monitored.describe(taken.changes)
            _keep_from_collector()

    def _take_prepared(self) -> None:
        """Describe the objects again whose models were made beside the monitoring. Log why others stay coarse."""
        taken, texts = self._pipeline.take_prepared()
        for each in taken:
            self._note_shapes(each, self._now())
        for text in texts:
            self._logger.warning(text)

    def change_settings(self, profile: Profile) -> None:
        """Change the settings. Like all callbacks, this runs between two steps."""
        self._use(self._keeping_up.reduced(profile))
        self._times.longest_latency = profile.max_time_step
        self._logger.info(f"settings changed, profile {profile.name}")
        self._alerts.check_rules()

    def _use(self, profile: Profile) -> None:
        """Take the next steps with this profile, with the details of contacts only if anything reads them."""
        now, self._chosen = self._now(), profile
        change = self._pipeline.change_settings(self._readers.used(profile), now, self._name)
        if self._sources is not None:
            self._sources.look_ahead(profile.horizon)
        self._recording.write(Topic.SETTINGS, change.settings, now, now, settings=self._pipeline.settings())
        if change.shapes is not None:
            self._record_shapes(change.shapes, now)

    def change_rules(self, rules: Rules) -> None:
        """Change the rules of the alerts from the next step on."""
        if rules.rules:
            warm_up_alerts()
        now = self._now()
        event = self._pipeline.change_rules(rules, now, self._name)
        self._recording.write(Topic.SETTINGS, event, now, now, settings=self._pipeline.settings())
        self._logger.info(f"rules of the alerts changed: {', '.join(each.name for each in rules.rules) or 'none'}")
        self._alerts.check_rules()
        self._alerts.publish()

    def _record_shapes(self, data: bytes, received: int) -> None:
        """Record an ObjectDescriptionArray that the pipeline has processed, with all objects described since then."""
        objects = tuple(self._pipeline.catalogue.descriptions.values())
        self._recording.write(Topic.SHAPES, data, received, received, objects=objects)

    # -- status

    def _on_watchdog(self) -> None:
        self._last_watchdog = time.monotonic_ns()
        for each in (self._contacts_out, self._predictions_out, self._status_out):
            each.assert_liveliness()
        self._recording.log_problems()
        self._name_conflict.look()
        self._take_prepared()
        now = time.monotonic_ns()
        silent = self._is_silent(now)
        if silent != self._was_silent:
            self._log_silence(silent)
        if not silent:
            self._refusals.report_stale(self._states_in, now)
        self._refusals.report_unseen(self._states_in, now)
        self._refusals.catch_up(now)
        if (profile := self._keeping_up.look(now)) is not None:
            self._use(profile)
        self._publish_status_if_due(now)
        self._record_unmonitored()
        self._alerts.publish()
        if now - self._last_log >= LOG_PERIOD and not silent and self._last_step is not None:
            self._last_log = now
            self._alerts.warn_of_empty_classes()
            line = status_line(codec.decode_status(self._publish_status()))
            self._logger.info(line if self.is_active else f"inactive, nothing is published: {line}")

    def _is_silent(self, now: int) -> bool:
        """Return whether newer states once arrived and no longer arrive, by the steady clock."""
        return self._last_step is not None and now - self._last_step >= self._pipeline.profile.stale_after * 1e9

    def _log_silence(self, silent: bool) -> None:
        self._was_silent = silent
        if silent:
            self._logger.warning(f"no newer states on {self._states_in}: all moving objects are stale")
        else:
            self._logger.info("newer states arrive again")

    def _publish_status_if_due(self, now: int) -> None:
        if now - self._last_status >= STATUS_PERIOD:
            self._publish_status()

    def _status(self, now: int) -> bytes:
        live = self._times.summary(now)
        return self._pipeline.status(silent=self._is_silent(now), **live, **self._recording.status())

    def _publish_status(self) -> bytes:
        self._last_status = time.monotonic_ns()
        data = self._status(self._last_status)
        self._status_out.publish(data)
        now = self._now()
        self._recording.write(Topic.STATUS, data, now, now)
        return data

    def facts(self) -> NodeFacts:
        """Return what the diagnostics report on. The peaks are those since the last call."""
        now, pipeline = time.monotonic_ns(), self._pipeline
        deferred, unresolved = self._peaks.take()
        return NodeFacts(
            status=codec.decode_status(self._status(now)),
            topic=self._states_in,
            silence=None if self._last_step is None else (now - self._last_step) * 1e-9,
            stale_after=pipeline.profile.stale_after,
            stale=named(pipeline.stale()),
            unseen=named(pipeline.unseen()),
            deferred=deferred,
            unresolved=unresolved,
            outdated=self._keeping_up.outdated,
            is_reduced=self._keeping_up.is_reduced,
            other_nodes=self._name_conflict.others,
            longest=self._times.longest,
            longest_step=self._times.longest_step,
            sources=None if self._sources is None else tuple(self._sources.lines()),
            unmonitored=tuple(row.text for row in self._unmonitored()),
            rules=self._alerts.report(),
        )

    def _now(self) -> int:
        nanoseconds: int = self._node.get_clock().now().nanoseconds
        return nanoseconds

    def save(self) -> None:
        """Finish the session file, from another thread: this one is stuck and the process is about to end."""
        self._recording.finish()


def _keep_from_collector() -> None:
    """Keep modules, kernels and descriptions out of later garbage collections, which delay a step by up to 0.1 s."""
    gc.collect()
    gc.freeze()
