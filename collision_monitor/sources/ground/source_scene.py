"""The scene that the sources write: objects, their last states, the frames, and what was refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import Change, ObjectTrajectory, Removal
from collision_monitor.errors import InputError, reason_of
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.shape import array_bytes
from collision_monitor.sources.ground.frames import FrameMotion, FrameTree, MissingFrame
from collision_monitor.sources.ground.guard import Guard
from collision_monitor.sources.ground.source_time import SourceTime
from collision_monitor.sources.ground.unmonitored import UnmonitoredList
from collision_monitor.sources.ground.waiting_states import WaitingStates

Floats = NDArray[np.float64]
States = NDArray[np.void]

MOST_TEXTS: Final = 1000
"""Different texts of refusals that are counted by themselves, because a text may quote a message."""

LONGEST_TEXT: Final = 500
"""Characters of such a text."""

MOST_COUNTED: Final = 20_000
"""Objects whose states are counted by name. Those of further ones are counted together."""

LIKE_ONE_MORE: Final = 20_000
"""Bytes of a mesh or a cloud that take as long as one more small object: 0.3 ms until the monitor has it."""

PART: Final = 3.0
"""Small objects that take as long as one more convex part of a concave polygon."""

_OTHERS: Final = "refused for further reasons"
_FURTHER: Final = "further objects"
_LAST_ID: Final = 0xFFFFFFFF


class SourceScene:
    """What the sources know.

    frame: the monitor's. time: the owner of stamps. taken_ids: those of the file. frames: the tree of tf frames.
    waiting: the states since the last step. states: number of states of each object, by name; line_states: by the key
    in the sources file. refused: what was left out, by its reason. refused_by_name, last_refusal: the same by the key.
    points_dropped: by the key, points of scans without a place (NaN). unmonitored: what the file asks for and the
    monitor does not have. received_ns: when the message that is processed arrived. allowance: new descriptions of small
    objects that this message may still make; None: any number. is_behind: whether some wait, because it was used up.
    preparation: makes robots that take long (`RobotPreparation`); None: they are made at once. horizon: s that the
    monitor looks ahead.
    """

    def __init__(self, frame: str, max_age: float, time: SourceTime, taken_ids: Collection[int] = ()) -> None:
        self.frame = frame
        self.time = time
        self.frames = FrameTree(max_age)
        self.waiting = WaitingStates(max_age)
        self.states: Counter[str] = Counter()
        self.line_states: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.refused_by_name: Counter[str] = Counter()
        self.last_refusal: dict[str, str] = {}
        self._news: dict[str, tuple[int, str]] = {}
        self._errors: list[tuple[str, Exception]] = []
        self.points_dropped: Counter[str] = Counter()
        self.unmonitored = UnmonitoredList()
        self.received_ns = 0
        self.allowance: float | None = None
        self.is_behind = False
        self.preparation: Any = None
        self.horizon = 0.0
        self._plans: list[tuple[int, list[ObjectTrajectory]]] = []
        self._described: dict[int, ObjectDescription] = {}
        self._changes: list[Change] = []
        self._taken_ids = frozenset(taken_ids)
        self._next_id = 1 + max((each for each in taken_ids if each < 1 << 31), default=0)

    # -- what a source calls: objects

    def new_id(self) -> int:
        """Return an id that no other object has. The order of the calls decides, so the same input gives the same."""
        for _ in range(len(self._taken_ids) + len(self._described) + 1):
            found, self._next_id = self._next_id, self._next_id + 1 if self._next_id < _LAST_ID else 1
            if found not in self._taken_ids and found not in self._described:
                return found
        raise InputError("expected fewer objects than there are ids")

    @property
    def may_describe(self) -> bool:
        """Whether this message may make a further description; the others wait for the next one."""
        may = self.allowance is None or self.allowance > 0.0
        self.is_behind |= not may
        return may

    def describe(self, description: ObjectDescription) -> None:
        """Add or replace an object."""
        self._described[description.object_id] = description
        self._changes.append(description)
        if self.allowance is not None:
            size = sum(array_bytes(shape) for shape, _ in description.shapes)
            self.allowance -= 1.0 + PART * (len(description.shapes) - 1) + size / LIKE_ONE_MORE

    def remove(self, object_id: int) -> None:
        """Remove an object. An unknown one is ignored."""
        if self._described.pop(object_id, None) is not None:
            self.waiting.forget(object_id)
            self._changes.append(Removal(object_id))

    def is_described(self, object_id: int) -> bool:
        """Whether there is such an object."""
        return object_id in self._described

    def observe(
        self,
        line: str,
        states: States,
        stamp_ns: int,
        covariance: Floats | None = None,
        *,
        window: float = 0.0,
        turns: bool | NDArray[np.bool_] = False,
    ) -> None:
        """Write states (N,) of records.STATE in the monitor's frame, of described objects, each id once.

        line: the key in the sources file. covariance (N, 12): as in ObjectStateArray, or None. Where
        StateFlag.TWIST_UNKNOWN is set, the twist is estimated over the last `window` (s) of poses; 0: from the last
        two. turns: whether the twists are constant along the axes of the bodies, and so turn with them; also (N,).
        """
        self.line_states[line] += len(states)
        names = [self._name(object_id) for object_id in states["id"].tolist()]
        if len(self.states) + len(names) > MOST_COUNTED:
            names = [name if name in self.states else _FURTHER for name in names]
        self.states.update(names)
        self.waiting.put(states, stamp_ns, covariance, window, turns=turns)

    def follow(self, plans: list[ObjectTrajectory], stamp_ns: int) -> None:
        """Let described objects follow plans in the monitor's frame, whose time 0 is the stamp."""
        if plans:
            self._plans.append((stamp_ns, plans))

    def take_plans(self) -> list[tuple[int, list[ObjectTrajectory]]]:
        """Return the plans since the last call, with their stamps (ns)."""
        plans, self._plans = self._plans, []
        return plans

    def locate(self, name: str, frame: str, stamp_ns: int) -> FrameMotion | None:
        """Return pose and twist of a frame in the monitor's frame; None, after a refusal, if tf does not say.

        name: the object, for the text of the refusal.
        """
        found = self.frames.motion(self.frame, frame, stamp_ns)
        if isinstance(found, MissingFrame):
            self.refuse(name, str(found))
            return None
        return found

    def placed(self, name: str, stamp_ns: int) -> list[tuple[ObjectDescription, Pose]]:
        """Return the objects of a name, or the links of a robot, with their poses at a stamp; none if one lacks it."""
        found = []
        for it in self._described.values():
            if it.name == name or it.name.startswith(f"{name}/"):
                pose = it.pose or self.waiting.pose(it.object_id, stamp_ns)
                if pose is None:
                    return []
                found.append((it, pose))
        return found

    def _name(self, object_id: int, otherwise: str = "?") -> str:
        return self._described[object_id].name if object_id in self._described else otherwise

    # -- what a source calls: what is wrong

    def guard(self, name: str, what: str = "") -> Guard:
        """Return a `with` block that refuses what raises within it. name: the key in the sources file."""
        return Guard(self, name, what)

    def refuse(self, name: str, text: str, count: int = 1) -> None:
        """Count what was left out. name: the key in the sources file."""
        name, text = name[:LONGEST_TEXT], text[:LONGEST_TEXT]
        what = f"{name}: {text}"
        self.refused[what if what in self.refused or len(self.refused) < MOST_TEXTS else _OTHERS] += count
        key = name if name in self.last_refusal or len(self.last_refusal) < MOST_TEXTS else _OTHERS
        self.refused_by_name[key] += count
        self.last_refusal[key] = text
        self._news[key] = self._news.get(key, (0, ""))[0] + count, text

    def fail(self, name: str, what: str, error: Exception) -> None:
        """Count what was left out for an error that nobody expected; the feed keeps its message."""
        self.refuse(name, f"{what}{reason_of(error)}")
        self._errors.append((name, error))

    def refuse_old(self, object_id: int) -> None:
        """Count a state that was too old for the step that would have taken it."""
        self.refuse(self._name(object_id, str(object_id)), "its message is older than max_age at its step")

    def lacks(self, line: str, what: str, reason: str) -> None:
        """Note that an object, link or topic of a line of the file is not monitored, until `has` is called for it."""
        self.unmonitored.lacks(line, what, reason, self.received_ns)

    def has(self, line: str, what: str) -> None:
        """Note that it is monitored."""
        self.unmonitored.has(line, what)

    # -- what the feed calls

    def take_changes(self) -> list[Change]:
        """Return the descriptions and removals since the last call, in order."""
        changes, self._changes = self._changes, []
        return changes

    def take_news(self) -> dict[str, tuple[int, str]]:
        """Return the refusals since the last call: by name, how many, and the text of the last one."""
        news, self._news = self._news, {}
        return news

    def take_errors(self) -> list[tuple[str, Exception]]:
        """Return the unexpected errors since the last call, with the key in the sources file."""
        errors, self._errors = self._errors, []
        return errors

    def restart(self) -> None:
        """Forget stamps and transforms after the time has jumped. Objects stay."""
        self.frames.restart()
        self.waiting.restart()
