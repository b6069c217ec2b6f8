"""Objects with a schedule: each step holds where they are, and each round has its plan."""

from __future__ import annotations

from math import ceil
from typing import Final

import numpy as np

from collision_monitor.codec.trajectories import Between, ObjectTrajectory
from collision_monitor.sources.ground.frames import IDENTITY
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.schedule import Schedule
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene

MOST_PLANNED: Final = 20_000
"""Points of a plan of several rounds. With more, a plan ends before the horizon."""

SECOND: Final = 1_000_000_000
"""ns."""


class ScheduleSource(Source):
    """The object of one entry with a schedule. Without a topic its states are those of the schedule too."""

    speaks = False
    awaited = False

    def __init__(self, entry: ObjectEntry, schedule: Schedule) -> None:
        self.name, self.topics = entry.name, {}
        self._entry, self._schedule = entry, schedule
        self._begin: int | None = None if schedule.begin is None else round(schedule.begin * SECOND)
        self._round: int | None = None  # whose plan is in force
        self._waits = False

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        schedule = self._schedule
        if self._begin is None:
            self._begin = now_ns
        period = round(schedule.repeat * SECOND)
        number = (now_ns - self._begin) // period if period else 0
        start_ns = self._begin + number * period
        if not self._entry.topic:
            row = schedule.cycle.rows(np.array([(now_ns - start_ns) / SECOND]))
            states = empty_states([self._entry.object_id])
            states["position"], states["quaternion"] = row[:, :3], row[:, 3:7]
            states["linear"], states["angular"] = row[:, 7:10], row[:, 10:13]
            if not self._carried(states, now_ns, scene):
                return
            scene.has(self.name, self.name)
            scene.observe(self.name, states, now_ns, turns=True)
        if self._waits:
            self._waits = False
        elif number != self._round and (plan := self._plan(now_ns, scene)) is not None:
            self._round = number
            scene.follow([plan], start_ns)

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source. The monitor forgets plans with the next step."""
        self._round, self._waits = None, True
        if self._schedule.begin is None:
            self._begin = None

    def forget_plans(self) -> None:
        """See Source."""
        self._round, self._waits = None, True

    def _plan(self, now_ns: int, scene: SourceScene) -> ObjectTrajectory | None:
        """Return the plan of a round and of as many further ones as the monitor looks ahead; None without its frame."""
        cycle, repeat = self._schedule.cycle, self._schedule.repeat
        times, poses = cycle.times, cycle.poses
        if repeat and self._schedule.closed:
            rounds = min(1 + ceil(scene.horizon / repeat), max(MOST_PLANNED // len(times), 1))
            later = (np.arange(1, rounds) * repeat)[:, None]
            times = np.append(times, (later + times[1:]).ravel())
            poses = np.concatenate([poses, np.tile(poses[1:], (rounds - 1, 1))])
        rows = empty_states([self._entry.object_id] * len(times))
        rows["position"], rows["quaternion"] = poses[:, :3], poses[:, 3:]
        if not self._carried(rows, now_ns, scene):
            return None
        poses = np.concatenate([rows["position"], rows["quaternion"]], axis=1)
        none = np.zeros((0, 6))
        return ObjectTrajectory(times, poses, none, np.zeros(4), self._entry.object_id, Between.ARC)

    def _carried(self, rows: object, now_ns: int, scene: SourceScene) -> bool:
        """Bring states into the monitor's frame. Return whether their frame is known."""
        frame = scene.locate(self.name, self._schedule.frame or scene.frame, now_ns)
        if frame is None:
            scene.lacks(self.name, self.name, scene.last_refusal[self.name])
        elif frame is not IDENTITY:
            carry_states(rows, frame, None)
        return frame is not None
