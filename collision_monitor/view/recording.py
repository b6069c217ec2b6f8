"""A recorded session in memory, whose moments can be had in any order."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np

from collision_monitor.codec import (
    Removal,
    decode_alert,
    decode_contacts,
    decode_descriptions,
    decode_predictions,
    decode_states,
)
from collision_monitor.errors import MessageError, SessionError
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import Phase
from collision_monitor.session.history.growing_rows import LEAST_LEFT, available_memory
from collision_monitor.session.history.read_history import AS_RECORDED
from collision_monitor.session.reader import Recorded, Session
from collision_monitor.settings.profile import Profile
from collision_monitor.view.levels import Pair
from collision_monitor.view.moment import Moment
from collision_monitor.view.topic_content import TopicContent

APART: Final = 64
"""Steps between two kept scenes. A moment needs at most so many steps from the kept scene before it."""

_CHECKED: Final = 64 << 20
"""Bytes of messages between two looks at the memory that is left."""

ANSWERS: Final = ("ContactArray", "PredictedCollisionArray", "CollisionAlert", "MonitorStatus")


class Beginning(NamedTuple):
    """A contact that begins: index of its frame, and the pair."""

    frame: int
    pair: Pair


class RecordedSteps:
    """The steps of a session.

    times: s from the first one, never falling. begins: the contacts that begin. names: of all objects, by id.
    problems: why parts may be missing. replay_with: as of `read_history`.
    Raises SessionError for a session without states or one that does not fit into memory, and ProfileError.
    """

    def __init__(
        self, session: Session, replay_with: Profile | str | None = None, progress: Callable[[], None] = lambda: None
    ) -> None:
        self.name = session.path.name
        self.problems: list[str] = []
        self.begins: list[Beginning] = []
        self.begin_ns = 0
        self.names: dict[int, str] = {}
        self._messages: list[tuple[str, bytes]] = []
        self._frames: list[int] = []  # number of messages up to each step, its answers included
        messages = session.messages() if replay_with is None else _answered(session, replay_with)
        self.times = self._read(messages, progress)
        self.problems += session.damage
        self._kept = [TopicContent(session.frame_id, has_rules=bool(session.rules.text))]
        self._scene, self._frame = self._kept[0].copy(), -1

    def _read(self, messages: Iterator[Recorded], progress: Callable[[], None]) -> list[float]:
        """Keep the messages and return the times of the steps."""
        stamps: list[int] = []
        steps: set[int] = set()
        of_states: list[tuple[int, int]] = []  # frames of a session without answers
        checked = size = 0
        for message in messages:
            progress()
            self._messages.append((message.type, message.data))
            size += len(message.data)
            if size - checked > _CHECKED:
                checked = size
                _check_memory(self.name)
            try:
                stamp, step = self._step_of(message, len(stamps))
            except MessageError as error:
                if message.type in ANSWERS:
                    self.problems.append(f"message {message.sequence} on {message.topic}: {error}")
                self._messages.pop()
                continue
            if message.type == "ObjectStateArray":
                of_states.append((len(self._messages), stamp))
            elif step in steps:
                self._frames[-1] = len(self._messages)
            elif step is not None:
                steps.add(step)
                stamps.append(stamp)
                self._frames.append(len(self._messages))
        if not of_states:
            raise SessionError(f"{self.name}: expected object states, found none")
        if not stamps:
            self.problems.append("the session holds no answers; --replay computes them")
            self._frames, stamps = [at for at, _ in of_states], [stamp for _, stamp in of_states]
        self.begin_ns = stamps[0]
        forward = np.maximum(np.diff(np.array(stamps, np.int64)), 0)
        return [0.0, *(np.cumsum(forward) * NANOSECOND).tolist()]

    def _step_of(self, message: Recorded, frames: int) -> tuple[int, int | None]:
        """Return the stamp (ns) of a message, and the number of its step if it is an answer. Raises MessageError."""
        match message.type:
            case "ContactArray":
                contacts = decode_contacts(message.data)
                new = contacts.contacts
                new = new[(new["phase"] == Phase.BEGIN) & (new["point_index"] == 0)]
                self.begins += [Beginning(frames, (int(row["id_a"]), int(row["id_b"]))) for row in new]
                return contacts.stamp_ns, contacts.step
            case "PredictedCollisionArray":
                predictions = decode_predictions(message.data)
                return predictions.stamp_ns, predictions.step
            case "CollisionAlert":
                alert = decode_alert(message.data)
                return alert.stamp_ns, alert.step
            case "ObjectDescriptionArray":
                described = decode_descriptions(message.data).objects
                self.names |= {each.object_id: each.name for each in described if not isinstance(each, Removal)}
            case "ObjectStateArray":
                return decode_states(message.data).stamp_ns, None
        return 0, None

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.times)

    def frame_at(self, time: float) -> int:
        """Return the last step up to a time (s from the first), or the first one."""
        return max(bisect_right(self.times, time) - 1, 0)

    def moment(self, frame: int) -> Moment:
        """Return the moment of a step, from 0. Kept scenes make this fast in any order."""
        if not self._frame <= frame < self._frame + APART:
            nearest = min(frame // APART, len(self._kept) - 1)
            if not self._frame <= frame or nearest * APART - 1 > self._frame:
                self._scene, self._frame = self._kept[nearest].copy(), nearest * APART - 1
        while self._frame < frame:
            begin = self._frames[self._frame] if self._frame >= 0 else 0
            for kind, data in self._messages[begin : self._frames[self._frame + 1]]:
                self._take(kind, data)
            self._frame += 1
            if self._frame + 1 == len(self._kept) * APART:
                self._kept.append(self._scene.copy())
        return self._scene.moment()

    def _take(self, kind: str, data: bytes) -> None:
        try:
            self._scene.take(kind, data)
        except MessageError:  # the monitor refused it as well
            return


def _answered(session: Session, replay_with: Profile | str) -> Iterator[Recorded]:
    """Yield the messages of a session with the answers of this program in place of the recorded ones.

    replay_with: as of `read_history`.
    """
    profile = session.profile if replay_with == AS_RECORDED else replay_with
    kept = () if replay_with == AS_RECORDED else tuple(setting.name for setting in Profile.fields())
    pipeline = Pipeline(profile, session.frame_id, timed=False, kept=kept, rules=session.rules)
    for message in session.messages():
        if message.type in ANSWERS:
            continue
        yield message
        if message.type == "ObjectDescriptionArray":
            pipeline.on_shapes(message.data)
        elif message.type == "ObjectTrajectoryArray":
            pipeline.on_trajectories(message.data)
        elif message.type == "ParameterEvent":
            pipeline.on_settings(message.data)
        elif message.type == "ObjectStateArray":
            outputs = pipeline.on_states(message.data)
            if outputs is not None:
                yield message._replace(type="ContactArray", data=outputs.contacts)
                yield message._replace(type="PredictedCollisionArray", data=outputs.predictions)
                for alert in outputs.alerts:
                    yield message._replace(type="CollisionAlert", data=alert)


def _check_memory(name: str) -> None:
    """Raise SessionError if little memory is left."""
    available = available_memory()
    if available < LEAST_LEFT:
        raise SessionError(
            f"{name}: expected {LEAST_LEFT >> 20} MiB of memory to be left while the session is read, got "
            f"{available >> 20} MiB: view a shorter session, for example one of a recording that is split by time"
        )
