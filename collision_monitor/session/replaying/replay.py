"""Feeds the recorded inputs to the same pipeline and compares its answers with the recorded ones, byte by byte."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any

from collision_monitor.errors import InputError, SessionError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.provenance import provenance
from collision_monitor.session.mcap.layout import SEQUENCE_HALF, SEQUENCE_MASK
from collision_monitor.session.mcap.rosbag2 import INPUT_TYPES
from collision_monitor.session.reader import Recorded, RecordedSnapshot, Session, SnapshotLocation
from collision_monitor.session.replaying.comparison import Comparison
from collision_monitor.session.replaying.replay_report import ReplayReport


def replay(
    session: Session,
    *,
    threads: int | None = None,
    tolerance: float | None = None,
    start: float = 0.0,
    progress: Callable[[ReplayReport], None] | None = None,
) -> ReplayReport:
    """Replay a session. threads: replaces the recorded number. progress: called after every message.

    tolerance (m, s): compare the answers of another version by their distances and times, and no status messages and no
    alerts.
    start (s after the first message): begin with the last snapshot before it.

    Raises SessionError if the session holds no inputs or cannot be read, InputError if `start` lies outside of it.
    """
    run = _Replay(session, {} if threads is None else {"threads": threads}, tolerance)
    report = run.report
    report.foreign = session.metadata.get("determinism_key") != provenance()["determinism_key"]
    if session.foreign:
        report.notes.append(f"the recording has no settings in it: replayed with the profile {session.profile.name}")
    elif report.foreign:
        report.notes.append(f"recorded by another program: {_provenance_differences(session)}")
    location = run.find_start(start) if start else None

    topics: set[str] = set()
    inputs = 0
    begin: int | None = None
    latest = earlier = 0
    started = time.perf_counter()
    for each in session.entries(location):
        if isinstance(each, RecordedSnapshot):
            run.meet(each)
            continue
        topics.add(each.topic)
        inputs += each.type in INPUT_TYPES
        if not run.take(each):
            continue
        begin = each.log_time if begin is None else begin
        earlier += each.log_time < latest
        latest = max(latest, each.log_time)
        report.messages += 1
        report.recorded_duration = (latest - begin) * 1e-9
        report.replay_duration = time.perf_counter() - started
        if progress is not None:
            progress(report)
    if not inputs and not report.hole:
        found = ", ".join(sorted(topics)) or "no messages at all"
        raise SessionError(f"{session.path}: expected object states and shapes, found {found}")
    if earlier:
        report.notes.append(f"{earlier} messages are older than one before them: taken in the order of the file")
    report.notes += session.damage
    if not (report.hole or report.late or session.damage):
        run.comparison.expect_nothing_more()
    if not report.compared and not report.late:
        report.first_difference, report.differing = None, 0
        report.notes.append("the session holds no answers to compare with")
    return report


class _Mode(Enum):
    """How much of the recorded monitor's state is known."""

    EXACT = 0  # all of it
    ANEW = 1  # its inputs from some time on
    STOPPED = 2  # not its last inputs


class _Replay:
    """Feeds a pipeline with the recorded inputs while the state of the recorded monitor is known."""

    def __init__(self, session: Session, settings: Mapping[str, Any], tolerance: float | None) -> None:
        self._session = session
        self._settings = settings
        profile = session.profile.replace(**settings)
        self._pipeline = Pipeline(profile, session.frame_id, timed=False, kept=settings, rules=session.rules)
        self.report = ReplayReport(digest=self._pipeline.monitor.digest, tolerance=tolerance)
        self.comparison = Comparison(self.report)
        self._mode = _Mode.EXACT
        self._next = 0  # sequence number of the next message
        self._snapshot: int | None = None  # sequence number of the snapshot that the pipeline continues from

    # -- snapshots and gaps

    def find_start(self, start: float) -> SnapshotLocation | None:
        """Return the last snapshot before `start` (s); None for the start of the session. Raises InputError."""
        timeline = self._session.timeline()
        length = (timeline.end - timeline.begin) * 1e-9
        if not 0 <= start <= length:
            raise InputError(
                f"{self._session.path}: expected a time from 0 to {length:.3f} s to replay from, got {start:g}"
            )
        before = [each for each in timeline.snapshots if each.log_time <= timeline.begin + start * 1e9]
        if not before:
            self.report.notes.append(f"there is no snapshot in the first {start:g} s: replayed from the start")
            return None
        self.report.begin = (before[-1].log_time - timeline.begin) * 1e-9
        self._mode = _Mode.STOPPED
        return before[-1]

    def meet(self, recorded: RecordedSnapshot) -> None:
        """Process a snapshot. It is not needed if the state is known already."""
        missing = (recorded.sequence - self._next) & SEQUENCE_MASK
        if self._mode is _Mode.EXACT and not 0 < missing < SEQUENCE_HALF:
            return
        try:
            snapshot = Snapshot.decode(recorded.data)
            self._pipeline = Pipeline.restored(snapshot, self._session.frame_id, self._settings)
        except InputError as error:
            if self.report.begin and not self.report.messages:
                raise SessionError(f"replay it from the start, for the {error}") from None
            self.report.notes.append(f"the snapshot before message {recorded.sequence} cannot be used: {error}")
            return
        step = self._pipeline.monitor.last.step if self._pipeline.monitor.last else 0
        if self._mode is _Mode.EXACT and self.report.messages:
            self._note_gap(missing, f"goes on with the snapshot behind them, in step {step}")
        elif self._mode is _Mode.EXACT:
            text = f"it begins {recorded.sequence} messages after its recording, with a snapshot in step {step}"
            self.report.notes.append(text)
        else:
            self.report.notes.append(f"compared from the snapshot in step {step} on")
        self.report.digest = self._pipeline.monitor.digest
        self._mode, self._next = _Mode.EXACT, recorded.sequence
        self._snapshot = recorded.sequence
        self.comparison.drop()

    def take(self, message: Recorded) -> bool:
        """Process one recorded message. Return False if it is a repetition, or the state before it is unknown."""
        if message.repeated:
            if not self.report.messages and self._mode is _Mode.EXACT:
                self._pipeline.on_shapes(message.data)
            return False
        missing = (message.sequence - self._next) & SEQUENCE_MASK
        if missing and self._mode is _Mode.EXACT and not self.report.messages:
            self._mode, self.report.late = _Mode.ANEW, True
            self.report.notes.append(
                f"it begins {missing} messages after its recording: what the monitor knew then is not in it, "
                "so its answers are given anew and not compared"
            )
        elif missing and self._mode is not _Mode.STOPPED:
            done = "replayed and compared" if self._mode is _Mode.EXACT else "replayed"
            if missing < SEQUENCE_HALF:
                self._note_gap(missing, f"{done} up to there")
            else:
                self.report.notes.append(
                    f"the messages are not in the order of their recording: message {message.sequence} follows message "
                    f"{self._next - 1}, after step {self.report.steps}: {done} up to there"
                )
            self._mode, self.report.hole = _Mode.STOPPED, True
        self._next = (message.sequence + 1) & SEQUENCE_MASK
        self.comparison.sequence = message.sequence
        if self._mode is not _Mode.STOPPED:
            try:
                self._feed(message, compare=self._mode is _Mode.EXACT)
            except Exception as error:
                if self._snapshot is None:
                    raise
                # it fits the monitor's arrays, but no monitor can have been in this state
                text = f"the snapshot before message {self._snapshot} cannot be used: message {message.sequence} fails"
                self.report.notes.append(f"{text} with it: {error!r:.200}")
                self._mode, self.report.hole = _Mode.STOPPED, True
        return self._mode is not _Mode.STOPPED

    def _note_gap(self, missing: int, what: str) -> None:
        self.report.notes.append(f"{missing} messages are missing after step {self.report.steps}: {what}")

    # -- messages

    def _feed(self, message: Recorded, *, compare: bool) -> None:
        """Process an input, or compare an answer."""
        if not compare:
            self.comparison.drop()
        if message.type in INPUT_TYPES or message.type == "ParameterEvent":
            self.comparison.expect_nothing_more()
        match message.type:
            case "ObjectDescriptionArray":
                self._pipeline.on_shapes(message.data)
            case "ObjectTrajectoryArray":
                self._pipeline.on_trajectories(message.data)
            case "ParameterEvent":
                self._pipeline.on_settings(message.data)
            case "ObjectStateArray":
                outputs = self._pipeline.on_states(message.data)
                if outputs is not None:
                    self.report.steps, self.report.digest = outputs.result.step, outputs.digest
                self.comparison.expect(message.data, outputs)
            case "ContactArray" | "PredictedCollisionArray" if compare:
                self.comparison.compare(message)
            case "CollisionAlert" if compare and self.report.tolerance is None:
                self.comparison.compare(message)
            case "MonitorStatus" if compare and self.report.tolerance is None:
                self.comparison.compare_status(message, self._pipeline.status())


def _provenance_differences(session: Session) -> str:
    """Return the differences from this program, in words."""
    theirs, ours = session.metadata, provenance()
    differences = [
        f"{name} {theirs.get(name, 'unknown')} (here {ours[name]})"
        for name in ours
        if name != "determinism_key" and theirs.get(name) != ours[name]
    ]
    return ", ".join(differences) or "the same versions with other source files"
