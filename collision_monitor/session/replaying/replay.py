"""Feeds the recorded inputs to the same pipeline and compares its answers with the recorded ones, byte by byte."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any, Final

import numpy as np

from collision_monitor.codec import decode_states
from collision_monitor.errors import InputError, MessageError, SessionError
from collision_monitor.monitor.snapshot import Snapshot
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.provenance import provenance
from collision_monitor.session.reader import Recorded, RecordedSnapshot, Session, SnapshotLocation
from collision_monitor.session.replaying.difference import Difference, compare_answers, compare_status, compare_within
from collision_monitor.settings.profile import Profile

_HALF: Final = 1 << 31
"""Of the sequence numbers: what is farther ahead than this lies behind."""


class Verdict(IntEnum):
    """What a replay came to; the values are the exit codes of `collision-monitor replay`."""

    IDENTICAL = 0
    DIVERGED = 3
    NOT_COMPARABLE = 4


@dataclass
class Report:
    """What a replay did and found. Durations in s; digest: of all answers that the replay gave.

    begin: s after the session's first message. foreign: another program recorded it. hole: messages are missing, and
    behind them nothing could be compared up to the next snapshot. late: the session begins after its monitor, whose
    state then is not in it, so up to the first snapshot the answers are given anew and not compared. within: answers
    whose bytes differ by no more than the tolerance. inputs: of the first difference's step, its objects' states in
    words; first_message: the sequence number of the message with it.
    """

    begin: float = 0.0
    steps: int = 0
    messages: int = 0
    compared: int = 0
    differing: int = 0
    digest: int = 0
    recorded_duration: float = 0.0
    replay_duration: float = 0.0
    within: int = 0
    tolerance: float | None = None
    first_difference: Difference | None = None
    first_message: int | None = None
    inputs: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    foreign: bool = False
    hole: bool = False
    late: bool = False

    @property
    def verdict(self) -> Verdict:
        """Equal bytes are equal wherever they come from; unequal ones say something only of the same program."""
        if self.first_difference is not None:
            return Verdict.NOT_COMPARABLE if self.foreign and self.tolerance is None else Verdict.DIVERGED
        return Verdict.NOT_COMPARABLE if self.hole or self.late or not self.compared else Verdict.IDENTICAL

    @property
    def speed(self) -> float:
        """Times real time."""
        return self.recorded_duration / self.replay_duration if self.replay_duration > 0 else 0.0


def replay(
    session: Session,
    *,
    threads: int | None = None,
    tolerance: float | None = None,
    start: float = 0.0,
    progress: Callable[[Report], None] | None = None,
) -> Report:
    """Replay a session; threads: instead of the recorded number. progress: called after every message.

    tolerance (m, s): answers of another version are compared by their distances and times, and status messages not.
    start (s after the first message): begin with the last snapshot before it.

    Raises SessionError where the session holds no inputs or cannot be read, InputError where it has no such time.
    """
    run = _Replay(session.profile, session.frame_id, {} if threads is None else {"threads": threads})
    report = run.report
    report.tolerance = tolerance
    report.foreign = session.metadata.get("determinism_key") != provenance()["determinism_key"]
    if session.foreign:
        report.notes.append(f"the recording has no settings in it: replayed with the profile {session.profile.name}")
    elif report.foreign:
        report.notes.append(f"recorded by another program: {_provenance_differences(session)}")
    place = run.find_start(session, start) if start else None

    topics: set[str] = set()
    inputs = 0
    begin: int | None = None
    latest = earlier = 0
    started = time.perf_counter()
    for each in session.entries(place):
        if isinstance(each, RecordedSnapshot):
            run.meet(each)
            continue
        topics.add(each.topic)
        inputs += each.type in ("ObjectStateArray", "ObjectDescriptionArray")
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
        run.expect_nothing_more()
    if not report.compared and not report.late:
        report.first_difference, report.differing = None, 0
        report.notes.append("the session holds no answers to compare with")
    return report


class _Mode(Enum):
    """What is known of the recorded monitor's state."""

    EXACT = 0  # all of it
    ANEW = 1  # what it was given from some time on
    STOPPED = 2  # not what it was given last


class _Replay:
    """The pipeline, and the answers that it gave and the session has not shown yet."""

    def __init__(self, profile: Profile, frame_id: str, settings: Mapping[str, Any]) -> None:
        self._frame_id = frame_id
        self._settings = settings
        self.pipeline = Pipeline(profile.replace(**settings), frame_id, timed=False, kept=settings)
        self.report = Report(digest=self.pipeline.monitor.digest)
        self._mode = _Mode.EXACT
        self._next = 0  # sequence number of the message that comes next
        self._open: dict[str, bytes] = {}
        self._differed_in = -1
        self._states = b""

    # -- where it begins and goes on

    def find_start(self, session: Session, start: float) -> SnapshotLocation | None:
        """The last snapshot before it (s); None: the start of the session. Raises InputError."""
        timeline = session.timeline()
        length = (timeline.end - timeline.begin) * 1e-9
        if not 0 <= start <= length:
            raise InputError(f"{session.path}: expected a time from 0 to {length:.3f} s to replay from, got {start:g}")
        before = [each for each in timeline.snapshots if each.log_time <= timeline.begin + start * 1e9]
        if not before:
            self.report.notes.append(f"there is no snapshot in the first {start:g} s: replayed from the start")
            return None
        self.report.begin = (before[-1].log_time - timeline.begin) * 1e-9
        self._mode = _Mode.STOPPED
        return before[-1]

    def meet(self, recorded: RecordedSnapshot) -> None:
        """A snapshot: of no use where the state is known already."""
        missing = (recorded.sequence - self._next) & 0xFFFFFFFF
        if self._mode is _Mode.EXACT and not 0 < missing < _HALF:
            return
        try:
            snapshot = Snapshot.decode(recorded.data)
            self.pipeline = Pipeline.restored(snapshot, self._frame_id, self._settings)
        except InputError as error:
            if self.report.begin and not self.report.messages:
                raise SessionError(f"replay it from the start, for the {error}") from None
            self.report.notes.append(f"the snapshot before message {recorded.sequence} cannot be used: {error}")
            return
        step = self.pipeline.monitor.last.step if self.pipeline.monitor.last else 0
        if self._mode is _Mode.EXACT and self.report.messages:
            self._note_gap(missing, f"goes on with the snapshot behind them, in step {step}")
        elif self._mode is _Mode.EXACT:
            text = f"it begins {recorded.sequence} messages after its recording, with a snapshot in step {step}"
            self.report.notes.append(text)
        else:
            self.report.notes.append(f"compared from the snapshot in step {step} on")
        self.report.digest = self.pipeline.monitor.digest
        self._mode, self._next, self._open = _Mode.EXACT, recorded.sequence, {}

    def take(self, message: Recorded) -> bool:
        """One recorded message; False: it was passed over, because what came before it is not known."""
        if message.repeated:
            if not self.report.messages and self._mode is _Mode.EXACT:
                self.pipeline.on_shapes(message.data)
            return False
        missing = (message.sequence - self._next) & 0xFFFFFFFF
        if missing and self._mode is _Mode.EXACT and not self.report.messages:
            self._mode, self.report.late = _Mode.ANEW, True
            self.report.notes.append(
                f"it begins {missing} messages after its recording: what the monitor knew then is not in it, "
                "so its answers are given anew and not compared"
            )
        elif missing and self._mode is not _Mode.STOPPED:
            done = "replayed and compared" if self._mode is _Mode.EXACT else "replayed"
            if missing < _HALF:
                self._note_gap(missing, f"{done} up to there")
            else:
                self.report.notes.append(
                    f"the messages are not in the order of their recording: message {message.sequence} follows message "
                    f"{self._next - 1}, after step {self.report.steps}: {done} up to there"
                )
            self._mode, self.report.hole = _Mode.STOPPED, True
        self._next = (message.sequence + 1) & 0xFFFFFFFF
        if self._mode is not _Mode.STOPPED:
            self._feed(message, compare=self._mode is _Mode.EXACT)
        return self._mode is not _Mode.STOPPED

    def _note_gap(self, missing: int, what: str) -> None:
        self.report.notes.append(f"{missing} messages are missing after step {self.report.steps}: {what}")

    # -- messages

    def _feed(self, message: Recorded, *, compare: bool) -> None:
        """An input is processed, an answer is compared."""
        if not compare:
            self._open = {}
        match message.type:
            case "ObjectDescriptionArray":
                self.expect_nothing_more()
                self.pipeline.on_shapes(message.data)
            case "ParameterEvent":
                self.expect_nothing_more()
                self.pipeline.on_settings(message.data)
            case "ObjectStateArray":
                self.expect_nothing_more()
                self._states = message.data
                outputs = self.pipeline.on_states(message.data)
                if outputs is not None:
                    self._open = {"ContactArray": outputs.contacts, "PredictedCollisionArray": outputs.predictions}
                    self.report.steps = outputs.result.step
                    self.report.digest = outputs.digest
            case "ContactArray" | "PredictedCollisionArray" if compare:
                self._compare(message)
            case "MonitorStatus" if compare and self.report.tolerance is None:
                self.report.compared += 1
                step = self.report.steps
                self._note(compare_status(message.topic, step, message.data, self.pipeline.status()))

    def expect_nothing_more(self) -> None:
        """All answers of the last step must have been in the session."""
        for kind, data in self._open.items():
            nothing = f"a {kind} of {len(data)} bytes"
            self._note(Difference(self.report.steps, kind, "the message", "presence", "nothing", nothing))
        self._open = {}

    def _compare(self, message: Recorded) -> None:
        self.report.compared += 1
        step = self.report.steps
        replayed = self._open.pop(message.type, None)
        if replayed is None:
            recorded = f"a {message.type} of {len(message.data)} bytes"
            self._note(Difference(step, message.topic, "the message", "presence", recorded, "nothing"))
            return
        difference = compare_answers(message.type, message.topic, step, message.data, replayed)
        tolerance = self.report.tolerance
        if difference is not None and tolerance is not None:
            difference = compare_within(message.type, message.topic, step, message.data, replayed, tolerance)
            self.report.within += difference is None
        self._note(difference)

    def _note(self, difference: Difference | None) -> None:
        if difference is None:
            return
        if self.report.first_difference is None:
            self.report.first_difference = difference
            self.report.first_message = (self._next - 1) & 0xFFFFFFFF
            self.report.inputs = _states_in_words(self._states, difference.pair)
        if self._differed_in != difference.step:
            self._differed_in = difference.step
            self.report.differing += 1


def _states_in_words(data: bytes, pair: tuple[int, int] | None) -> list[str]:
    """The states of the two objects in an ObjectStateArray; what is not there is left out."""
    if pair is None or not data:
        return []
    try:
        message = decode_states(data)
    except MessageError:
        return []
    lines = []
    for row in message.states[np.isin(message.states["id"], pair)]:
        names = ("position", "quaternion", "linear", "angular")
        lines.append(
            f"object {row['id']} at {message.stamp_ns} ns: " + ", ".join(f"{n} {row[n].tolist()}" for n in names)
        )
    return lines


def _provenance_differences(session: Session) -> str:
    """What is not the same as here, in words."""
    theirs, ours = session.metadata, provenance()
    differences = [
        f"{name} {theirs.get(name, 'unknown')} (here {ours[name]})"
        for name in ours
        if name != "determinism_key" and theirs.get(name) != ours[name]
    ]
    return ", ".join(differences) or "the same versions with other source files"
