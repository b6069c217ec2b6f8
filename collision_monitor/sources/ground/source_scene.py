"""The scene that the sources write: objects, their last states, the frames, and what was refused."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import Change, Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import FrameMotion, FrameTree, MissingFrame
from collision_monitor.sources.ground.unmonitored import UnmonitoredList
from collision_monitor.sources.ground.waiting_states import WaitingStates

Floats = NDArray[np.float64]
States = NDArray[np.void]

MOST_TEXTS: Final = 1000
"""Different texts of refusals that are counted by themselves, because a text may quote a message."""

_OTHERS: Final = "refused for further reasons"


class SourceScene:
    """What the sources know.

    frame: the monitor's. frames: the tree of tf frames. waiting: the states since the last step. states: number of
    states of each object, by name. refused: what was left out, by its reason. refused_by_name, last_refusal: the same
    by the key in the sources file. points_dropped: by name, points of scans without a place (NaN). unmonitored: what
    the file asks for and the monitor does not have. received_ns: when the message that is processed arrived.
    """

    def __init__(self, frame: str, max_age: float, *, first_free_id: int = 1, by_header: bool = True) -> None:
        self.frame = frame
        self.frames = FrameTree(max_age)
        self.waiting = WaitingStates(max_age)
        self.states: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.refused_by_name: Counter[str] = Counter()
        self.last_refusal: dict[str, str] = {}
        self._news: dict[str, tuple[int, str]] = {}
        self.points_dropped: Counter[str] = Counter()
        self.unmonitored = UnmonitoredList()
        self.received_ns = 0
        self._described: dict[int, ObjectDescription] = {}
        self._changes: list[Change] = []
        self._next_id = first_free_id
        self._by_header = by_header

    # -- what a source calls

    def new_id(self) -> int:
        """Return an id that no other object has. The order of the calls decides, so the same input gives the same."""
        self._next_id += 1
        return self._next_id - 1

    def describe(self, description: ObjectDescription) -> None:
        """Add or replace an object."""
        self._described[description.object_id] = description
        self._changes.append(description)

    def remove(self, object_id: int) -> None:
        """Remove an object. An unknown one is ignored."""
        if self._described.pop(object_id, None) is not None:
            self.waiting.forget(object_id)
            self._changes.append(Removal(object_id))

    def observe(self, states: States, stamp_ns: int, covariance: Floats | None = None, *, window: float = 0.0) -> None:
        """Write states (N,) of records.STATE in the monitor's frame, of described objects, each id once.

        covariance (N, 12): as in ObjectStateArray, or None. Where StateFlag.TWIST_UNKNOWN is set, the twist is
        estimated over the last `window` (s) of poses; 0: from the last two.
        """
        self.states.update(self._name(object_id) for object_id in states["id"].tolist())
        self.waiting.put(states, stamp_ns, covariance, window)

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

    def stamp_of(self, header: Any, otherwise: int) -> int:
        """Return the stamp of a std_msgs/Header (ns); `otherwise` if it is zero, or if the file selects receipt."""
        stamp = int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
        return stamp if stamp and self._by_header else otherwise

    def refuse(self, name: str, text: str, count: int = 1) -> None:
        """Count what was left out. name: the key in the sources file."""
        what = f"{name}: {text}"
        self.refused[what if what in self.refused or len(self.refused) < MOST_TEXTS else _OTHERS] += count
        key = name if name in self.last_refusal or len(self.last_refusal) < MOST_TEXTS else _OTHERS
        self.refused_by_name[key] += count
        self.last_refusal[key] = text
        self._news[key] = self._news.get(key, (0, ""))[0] + count, text

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

    def restart(self) -> None:
        """Forget stamps and transforms after the time has jumped. Objects stay."""
        self.frames.restart()
        self.waiting.restart()
