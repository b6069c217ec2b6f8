"""Reads a session into its history, each recorded message once and in order."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from collision_monitor import records
from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import (
    CollisionAlert,
    MonitorStatus,
    Removal,
    decode_alert,
    decode_contacts,
    decode_descriptions,
    decode_diagnostics,
    decode_parameter_event,
    decode_predictions,
    decode_states,
    decode_status,
    decode_trajectories,
)
from collision_monitor.errors import MessageError, SessionError
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.pipeline.settings_event import LIMIT, NOW, RULES
from collision_monitor.pipeline.topics import Topic
from collision_monitor.session.history.collisions import find_collisions
from collision_monitor.session.history.growing_rows import GrowingRows
from collision_monitor.session.history.history import History, Records
from collision_monitor.session.history.plan_rows import PlanRows
from collision_monitor.session.history.unmonitored_rows import UnmonitoredRows
from collision_monitor.session.mcap.layout import SEQUENCE_MASK
from collision_monitor.session.mcap.rosbag2 import INPUT_TYPES
from collision_monitor.session.reader import Recorded, Session
from collision_monitor.settings.profile import Profile

AS_RECORDED: Final = ""
"""In place of a profile's name: the recorded profile with its recorded changes."""


def read_history(
    session: Session,
    replay_with: Profile | str | None = None,
    progress: Callable[[], None] = lambda: None,
    rules: Rules | None = None,
) -> History:
    """Read a whole session. With `replay_with`, replace the recorded answers by those of this program.

    replay_with: a profile or its name, for all steps; AS_RECORDED: the recorded profile with its recorded changes.
    progress: called after every message. rules: replace those of the session, whose inputs are replayed for them.
    Raises SessionError for a session without inputs, ProfileError.
    """
    gathered = _Gathered(session, AS_RECORDED if replay_with is None and rules is not None else replay_with, rules)
    for message in session.messages():
        gathered.take(message)
        progress()
    return gathered.history()


class _Gathered:
    """Collects the content of a session, message by message."""

    def __init__(self, session: Session, replay_with: Profile | str | None, rules: Rules | None) -> None:
        self._changes = replay_with is None or replay_with == AS_RECORDED
        profile = session.profile if self._changes else replay_with
        assert profile is not None
        profile = Profile.named(profile) if isinstance(profile, str) else profile
        self._session = session
        self._history = History(session.path.name, profile, session.metadata, replay_with is not None)
        self._history.rules = session.rules if rules is None else rules
        self._pipeline = None
        if replay_with is not None:
            kept = () if rules is None else (RULES,)
            used = self._history.rules
            self._pipeline = Pipeline(profile, frame_id=session.frame_id, timed=False, kept=kept, rules=used)
        self._settings: list[tuple[int, dict[str, Any]]] = []  # changed before the step of this index
        self._count = 0
        self._steps: list[int] = []  # stamps in ns
        self._step_of: dict[int, int] = {}
        self._contacts = GrowingRows(records.CONTACT)  # only the first point of each: all share the other fields
        self._predictions = GrowingRows(records.PREDICTION)
        self._states = GrowingRows(records.STATE)
        self._next_step: list[int] = []  # index of the step after each message of states
        self._durations: list[float] = []
        self._alerts: list[tuple[int, CollisionAlert]] = []  # index of the step
        self._unmonitored = UnmonitoredRows()
        self._plans = PlanRows()

    def take(self, message: Recorded) -> None:
        missing = (message.sequence - self._count) & SEQUENCE_MASK
        if missing:
            self._history.problems.append(f"{missing} messages are missing before message {message.sequence}")
            self._count = message.sequence
        self._count += 1
        try:
            self._read(message)
        except MessageError as error:
            if message.type not in INPUT_TYPES:  # the monitor refused these
                self._history.problems.append(f"message {message.sequence} on {message.topic}: {error}")

    def _read(self, message: Recorded) -> None:
        answers = self._pipeline is None
        match message.type:
            case "ObjectDescriptionArray":
                if self._pipeline is not None:
                    self._pipeline.on_shapes(message.data)
                for each in decode_descriptions(message.data).objects:
                    if not isinstance(each, Removal):
                        self._history.objects[each.object_id] = each
                        self._history.names.setdefault(each.name, set()).add(each.object_id)
            case "ObjectTrajectoryArray":
                if self._pipeline is not None:
                    self._pipeline.on_trajectories(message.data)
                plans = decode_trajectories(message.data)
                if plans.frame_id in ("", self._session.frame_id):
                    self._plans.take(plans)
            case "ParameterEvent" if self._changes:
                if self._pipeline is not None:
                    self._pipeline.on_settings(message.data)
                changed = decode_parameter_event(message.data).changed
                if not changed.keys() <= {LIMIT, NOW}:  # these only record what the clock made of a step
                    self._settings.append((len(self._steps), changed))
            case "ObjectStateArray":
                step = len(self._steps)
                if self._pipeline is not None:
                    begin = time.perf_counter()
                    outputs = self._pipeline.on_states(message.data)
                    if outputs is not None:
                        self._durations.append(time.perf_counter() - begin)
                        self._answer(outputs)
                states = decode_states(message.data)
                if states.frame_id in ("", self._session.frame_id):
                    self._states.append(states.stamp_ns, states.states)
                    self._plans.move(states.stamp_ns, states.states, step)
                    self._next_step.append(len(self._steps))
            case "ContactArray" if answers:
                contacts = decode_contacts(message.data)
                self._take_contacts(self._step(contacts.stamp_ns, contacts.step), contacts.contacts)
            case "PredictedCollisionArray" if answers:
                predictions = decode_predictions(message.data)
                self._predictions.append(self._step(predictions.stamp_ns, predictions.step), predictions.predictions)
            case "CollisionAlert" if answers:
                self._take_alert(decode_alert(message.data))
            case "DiagnosticArray" if message.topic.endswith(f"/{Topic.SOURCES.path}"):
                self._unmonitored.take(decode_diagnostics(message.data))
            case "MonitorStatus":
                status = self._history.status = decode_status(message.data)
                if answers and np.isfinite(status.step_duration):
                    self._durations.append(status.step_duration)

    def _answer(self, outputs: Outputs) -> None:
        result = outputs.result
        step = self._step(result.stamp_ns, result.step)
        self._take_contacts(step, result.contact_rows)
        self._predictions.append(step, result.predictions)
        for alert in map(decode_alert, outputs.alerts):
            self._take_alert(alert)

    def _take_alert(self, alert: CollisionAlert) -> None:
        self._alerts.append((self._step(alert.stamp_ns, alert.step), alert))

    def _take_contacts(self, step: int, rows: Records) -> None:
        self._contacts.append(step, rows.compress(rows["point_index"] == 0))

    def _step(self, stamp_ns: int, number: int) -> int:
        """Return the index of the step with this number. Contacts and predictions of one step share it."""
        if number not in self._step_of:
            if self._steps and stamp_ns < self._steps[-1]:
                self._plans.restart()
            self._step_of[number] = len(self._steps)
            self._steps.append(stamp_ns)
        return self._step_of[number]

    def history(self) -> History:
        h = self._history
        h.problems += self._session.damage
        if not self._states.keys:
            raise SessionError(f"{self._session.path}: expected object states, found none")
        stamps = np.array(self._steps, np.int64)
        h.begin_ns = int(stamps[0]) if len(stamps) else self._states.keys[0]
        back = np.minimum(np.diff(stamps), 0)
        h.restarts = int(np.count_nonzero(back))
        forward = np.concatenate([[0], -np.cumsum(back)])  # ns by which each step's clock lags behind the session's
        h.times = np.asarray((stamps + forward[: len(stamps)] - h.begin_ns) * NANOSECOND, np.float64)
        h.contacts, h.contact_step = self._contacts.joined()
        h.predictions, h.prediction_step = self._predictions.joined()
        next_step = np.minimum(self._next_step, len(back))
        self._states.keys = (np.array(self._states.keys, np.int64) + forward[next_step]).tolist()
        h.states, stamps_of = self._states.joined()
        h.state_time = np.asarray((stamps_of - h.begin_ns) * NANOSECOND, np.float64)
        h.durations = np.array(self._durations)
        h.alerts = [(float(h.times[step]), alert) for step, alert in self._alerts]
        h.plans = self._plans.uses(h.times)
        h.unmonitored = self._unmonitored.spans(h.begin_ns)
        h.settings = [(float(h.times[k]), changed) for k, changed in self._settings if k < len(stamps)]
        if self._pipeline is not None:
            h.status = self._status_of_replay(self._pipeline)
        if not len(stamps):
            h.problems.append("the session holds no answers")
        h.collisions = find_collisions(h)
        return h

    def _status_of_replay(self, pipeline: Pipeline) -> MonitorStatus:
        """Return the replay's status, with the messages that the recorder dropped, which the replay lacks too."""
        status, recorded = decode_status(pipeline.status()), self._history.status
        if recorded is None:
            return status
        dropped, error = recorded.recording_dropped, recorded.recording_error
        return replace(status, recording_dropped=dropped, recording_error=error)
