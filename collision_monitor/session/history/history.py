"""What happened in a session, gathered: who touched whom and when, what was predicted before, how long it took.

The one view of a session that checks, reports and comparisons are made from.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.codec import (
    MonitorStatus,
    Removal,
    decode_contacts,
    decode_descriptions,
    decode_parameter_event,
    decode_predictions,
    decode_states,
    decode_status,
)
from collision_monitor.errors import InputError, MessageError, SessionError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.pipeline.settings_event import LIMIT
from collision_monitor.records import ContactStatus, Phase
from collision_monitor.session.reader import Recorded, Session
from collision_monitor.settings.profile import Profile

Floats = NDArray[np.float64]
Records = NDArray[np.void]
Pair = tuple[int, int]

NANOSECOND: Final = 1e-9

STEPS_MISSING: Final = 5.0
"""Steps of the usual length without one that are a gap, where that is longer than the profile's stale_after."""

BLOCK: Final = 1 << 16
"""Rows that are made room for at a time."""

ANY: Final = "any"
"""In place of names: every pair."""

AS_RECORDED: Final = ""
"""In place of a profile's name: the one that was recorded, and as it was changed."""


@dataclass(frozen=True)
class Collision:
    """Two objects in contact without a break. Times in s from the session's first step; step: index of the begin.

    end: None where it went on to the end of the session or to a gap; last: the last step in contact. deepest: least
    signed distance (m). certain: they were known to touch at some time, not only not known to be apart. warned: how
    long before the begin (s) the predictions of it began that were not interrupted any more; 0 where there was none,
    NaN where the session begins with the contact.
    """

    pair: Pair
    begin: float
    end: float | None
    last: float
    step: int
    deepest: float
    certain: bool
    warned: float


@dataclass
class History:
    """A session, from its first step to its last.

    times (n,): s of each step from the first, never falling: where the clock was set back (restarts: how often) they
    go on from where they were. contacts, predictions: of all steps, records.CONTACT (of several points the first) and
    records.PREDICTION, and the step (index) of each row. states: of all messages, records.STATE, and the time (s).
    objects: as they were described last; names: all that they had, and the ids of each. profile: of the start;
    settings: what changed of it, and the time (s) of the first step that went by it. durations: s that steps took, as
    far as they were reported or measured. status: the last one, or the replay's. problems: why some of it may be
    unknown.
    """

    name: str
    profile: Profile
    metadata: dict[str, str]
    replayed: bool
    begin_ns: int = 0
    restarts: int = 0
    times: Floats = field(default_factory=lambda: np.zeros(0))
    contacts: Records = field(default_factory=lambda: np.zeros(0, records.CONTACT))
    contact_step: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    predictions: Records = field(default_factory=lambda: np.zeros(0, records.PREDICTION))
    prediction_step: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    states: Records = field(default_factory=lambda: np.zeros(0, records.STATE))
    state_time: Floats = field(default_factory=lambda: np.zeros(0))
    durations: Floats = field(default_factory=lambda: np.zeros(0))
    objects: dict[int, ObjectDescription] = field(default_factory=dict)
    names: dict[str, set[int]] = field(default_factory=dict)
    settings: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    status: MonitorStatus | None = None
    problems: list[str] = field(default_factory=list)
    collisions: list[Collision] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """s from the first step to the last."""
        return float(self.times[-1]) if len(self.times) else 0.0

    @property
    def period(self) -> float:
        """s from one step to the next, the median; 0 where there are less than two."""
        apart = np.diff(self.times)
        return float(np.median(apart[apart > 0.0])) if (apart > 0.0).any() else 0.0

    @property
    def longest_step(self) -> float:
        """s: what is longer from one step to the next is a gap of which nothing is known."""
        return max(self.profile.stale_after, STEPS_MISSING * self.period)

    def name_of(self, object_id: int) -> str:
        """The name of an object, or what stands for one that was never described."""
        return self.objects[object_id].name if object_id in self.objects else f"object_{object_id}"

    def ids_of(self, name: str | int) -> set[int]:
        """The objects that have, or had, that name, with wildcards: `person_*`; or that id. Raises InputError."""
        if isinstance(name, int):
            found = {name} & set(self.objects)
        else:
            found = set().union(*(ids for each, ids in self.names.items() if fnmatchcase(each, name)))
        if not found:
            known = ", ".join(sorted(self.names)) or "none"
            raise InputError(f"expected the name or id of an object of the session, one of {known}; got {name!r}")
        return found

    def pairs_of(self, names: str | Iterable[str | int]) -> Callable[[Pair], bool]:
        """Whether a pair is one of those named: ANY, or two names, with wildcards. Raises InputError."""
        if names == ANY:
            return lambda pair: True
        a, b = (self.ids_of(name) for name in names)
        return lambda pair: (pair[0] in a and pair[1] in b) or (pair[0] in b and pair[1] in a)

    def collisions_of(self, names: str | Iterable[str | int] = ANY) -> list[Collision]:
        """The collisions of the named pairs, by their begin. Raises InputError."""
        wanted = self.pairs_of(names)
        return [each for each in self.collisions if wanted(each.pair)]


def read_history(
    session: Session, replay_with: Profile | str | None = None, progress: Callable[[], None] = lambda: None
) -> History:
    """Read a session whole; with a profile: not what was answered then, but what this program answers to the inputs.

    replay_with: a profile or its name, from the first step to the last; AS_RECORDED: the recorded one, and where it was
    changed. progress: called after every message. Raises SessionError for a session without inputs, ProfileError.
    """
    gathered = _Gathered(session, replay_with)
    for message in session.messages():
        gathered.take(message)
        progress()
    return gathered.history()


class _Gathered:
    """Lists that grow with the messages."""

    def __init__(self, session: Session, replay_with: Profile | str | None) -> None:
        self._changes = replay_with is None or replay_with == AS_RECORDED
        profile = session.profile if self._changes else replay_with
        assert profile is not None
        profile = Profile.named(profile) if isinstance(profile, str) else profile
        self._session = session
        self._history = History(session.path.name, profile, session.metadata, replay_with is not None)
        self._pipeline = None if replay_with is None else Pipeline(profile, frame_id=session.frame_id, timed=False)
        self._settings: list[tuple[int, dict[str, Any]]] = []  # changed before the step of this index
        self._count = 0
        self._steps: list[int] = []  # stamps in ns
        self._step_of: dict[int, int] = {}
        self._contacts = _Rows(records.CONTACT)  # of a contact with several points the first row: they share the rest
        self._predictions = _Rows(records.PREDICTION)
        self._states = _Rows(records.STATE)
        self._next_step: list[int] = []  # of each message of states, the index of the step that comes after it
        self._durations: list[float] = []

    def take(self, message: Recorded) -> None:
        missing = (message.sequence - self._count) & 0xFFFFFFFF
        if missing:
            self._history.problems.append(f"{missing} messages are missing before message {message.sequence}")
            self._count = message.sequence
        self._count += 1
        try:
            self._read(message)
        except MessageError as error:
            if message.type not in ("ObjectStateArray", "ObjectDescriptionArray"):  # those are the monitor's to refuse
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
            case "ParameterEvent" if self._changes:
                if self._pipeline is not None:
                    self._pipeline.on_settings(message.data)
                changed = decode_parameter_event(message.data).changed
                if changed.keys() != {LIMIT}:  # that is how far a step came, and no one's choice
                    self._settings.append((len(self._steps), changed))
            case "ObjectStateArray":
                if self._pipeline is not None:
                    begin = time.perf_counter()
                    outputs = self._pipeline.on_states(message.data)
                    if outputs is not None:
                        self._durations.append(time.perf_counter() - begin)
                        self._answer(outputs)
                states = decode_states(message.data)
                if states.frame_id in ("", self._session.frame_id):
                    self._states.append(states.stamp_ns, states.states)
                    self._next_step.append(len(self._steps))
            case "ContactArray" if answers:
                contacts = decode_contacts(message.data)
                self._take_contacts(self._step(contacts.stamp_ns, contacts.step), contacts.contacts)
            case "PredictedCollisionArray" if answers:
                predictions = decode_predictions(message.data)
                step = self._step(predictions.stamp_ns, predictions.step)
                self._predictions.append(step, predictions.predictions)
            case "MonitorStatus":
                status = self._history.status = decode_status(message.data)
                if answers and np.isfinite(status.step_duration):
                    self._durations.append(status.step_duration)

    def _answer(self, outputs: Outputs) -> None:
        result = outputs.result
        step = self._step(result.stamp_ns, result.step)
        self._take_contacts(step, result.contacts)
        self._predictions.append(step, result.predictions)

    def _take_contacts(self, step: int, rows: Records) -> None:
        self._contacts.append(step, rows.compress(rows["point_index"] == 0))

    def _step(self, stamp_ns: int, number: int) -> int:
        """Index of the step with this number; contacts and predictions of one step share it."""
        if number not in self._step_of:
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
        forward = np.concatenate([[0], -np.cumsum(back)])  # ns, by which each step's clock is behind the session's
        h.times = np.asarray((stamps + forward[: len(stamps)] - h.begin_ns) * NANOSECOND, np.float64)
        h.contacts, h.contact_step = self._contacts.joined()
        h.predictions, h.prediction_step = self._predictions.joined()
        next_step = np.minimum(self._next_step, len(back))
        self._states.keys = (np.array(self._states.keys, np.int64) + forward[next_step]).tolist()
        h.states, stamps_of = self._states.joined()
        h.state_time = np.asarray((stamps_of - h.begin_ns) * NANOSECOND, np.float64)
        h.durations = np.array(self._durations)
        h.settings = [(float(h.times[k]), changed) for k, changed in self._settings if k < len(stamps)]
        if self._pipeline is not None:
            h.status = self._status_of_replay(self._pipeline)
        if not len(stamps):
            h.problems.append("the session holds no answers")
        h.collisions = _collisions(h)
        return h

    def _status_of_replay(self, pipeline: Pipeline) -> MonitorStatus:
        """What was refused and lost, by the replay; what the recorder dropped is missing here too."""
        status, recorded = decode_status(pipeline.status()), self._history.status
        if recorded is None:
            return status
        dropped, error = recorded.recording_dropped, recorded.recording_error
        return replace(status, recording_dropped=dropped, recording_error=error)


class _Rows:
    """Rows that grow message by message, each with the key of its message; a message is not kept."""

    def __init__(self, dtype: np.dtype[np.void]) -> None:
        self.keys: list[int] = []
        self._dtype = dtype
        self._counts: list[int] = []
        self._blocks: list[Records] = []
        self._room = 0

    def append(self, key: int, rows: Records) -> None:
        """A copy of the rows."""
        self.keys.append(key)
        self._counts.append(len(rows))
        if len(rows) > self._room:
            self._close()
            self._room = max(BLOCK, len(rows))
            self._blocks.append(np.empty(self._room, self._dtype))
        block = self._blocks[-1] if self._blocks else np.empty(0, self._dtype)
        begin = len(block) - self._room
        block[begin : begin + len(rows)] = rows
        self._room -= len(rows)

    def joined(self) -> tuple[Records, NDArray[np.int64]]:
        """All rows and their keys. Blocks are let go as they are copied: a long session is not there twice."""
        self._close()
        keys = np.repeat(np.array(self.keys, np.int64), self._counts)
        joined = np.empty(len(keys), self._dtype)
        end = len(joined)
        while self._blocks:
            block = self._blocks.pop()
            joined[end - len(block) : end] = block
            end -= len(block)
        return joined, keys

    def _close(self) -> None:
        if self._blocks and self._room:
            self._blocks[-1] = self._blocks[-1][: -self._room]
        self._room = 0


def _keys(rows: Records) -> NDArray[np.uint64]:
    """One number for the pair of each row."""
    return (rows["id_a"].astype(np.uint64) << np.uint64(32)) | rows["id_b"].astype(np.uint64)


def _collisions(h: History) -> list[Collision]:
    """Unbroken runs of contacts, by begin and pair."""
    touching = h.contacts["phase"] != Phase.END
    rows, steps = h.contacts[touching], h.contact_step[touching]
    keys = _keys(rows)
    order = np.lexsort((steps, keys))
    predicted = _steps_by_pair(_keys(h.predictions), h.prediction_step)
    found = []
    time, longest = h.times[steps[order]], h.longest_step
    begins = rows["phase"][order] == Phase.BEGIN  # also where one ends in the step in which the next begins
    begins[1:] |= time[1:] - rows["duration"][order][1:] > time[:-1] + NANOSECOND  # unseen, while steps are missing
    breaks = np.flatnonzero((np.diff(keys[order]) != 0) | (np.diff(steps[order]) != 1) | begins[1:]) + 1
    for run in np.split(order, breaks) if len(order) else ():
        first, last = int(steps[run[0]]), int(steps[run[-1]])
        pair = (int(rows["id_a"][run[0]]), int(rows["id_b"][run[0]]))
        ended = last + 1 < len(h.times) and h.times[last + 1] - h.times[last] <= longest
        found.append(
            Collision(
                pair=pair,
                begin=float(h.times[first]),
                end=float(h.times[last + 1]) if ended else None,
                last=float(h.times[last]),
                step=first,
                deepest=float(rows["signed_distance"][run].min()),
                certain=bool((rows["status"][run] == ContactStatus.TOUCHING).any()),
                warned=_warned(h.times, first, predicted.get(int(keys[run[0]]), np.zeros(0, np.int64)), longest),
            )
        )
    return sorted(found, key=lambda c: (c.begin, c.pair))


def _steps_by_pair(keys: NDArray[np.uint64], steps: NDArray[np.int64]) -> dict[int, NDArray[np.int64]]:
    """The steps of each pair, ascending."""
    order = np.lexsort((steps, keys))
    breaks = np.flatnonzero(np.diff(keys[order]) != 0) + 1
    return {int(keys[run[0]]): steps[run] for run in np.split(order, breaks) if len(run)}


def _warned(times: Floats, begin: int, steps: NDArray[np.int64], longest: float) -> float:
    """s by which the unbroken run of predictions right before step `begin` came before it; longest: step, s."""
    if begin == 0:
        return float("nan")
    first = begin
    for step in steps[steps < begin][::-1]:
        if step != first - 1 or times[first] - times[step] > longest:
            break
        first = int(step)
    return float(times[begin] - times[first])
