"""nav_msgs/Path and autoware Trajectory: each message is the plan of one object, and replaces the one before."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.trajectories import ObjectTrajectory, Then
from collision_monitor.errors import InputError
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.poses import put_pose
from collision_monitor.sources.plans.headings import headings_along
from collision_monitor.sources.plans.plan_entry import PlanEntry, read_plans
from collision_monitor.sources.plans.timeless_path import SAME_PLACE, TimelessPath
from collision_monitor.tolerances import LARGEST_INPUT

PATH: Final = "nav_msgs/msg/Path"
AUTOWARE_TRAJECTORY: Final = "autoware_planning_msgs/msg/Trajectory"

MOST_PATH_POINTS: Final = 20_000
"""Poses of a message: 1 km at 5 cm."""

EARLY: Final = 0.5
"""Part of the tolerance along a path by which an object may be early or late until its plan is made anew. Larger: it
leaves its plan in the meantime. Smaller: more plans."""

AHEAD: Final = 5.0
"""Horizons of the monitor that a plan on a path without times covers. It is made anew when half of them are over.
Larger: the plans of a robot that is late on a long path are larger. Smaller: more plans."""

LEAST_AHEAD: Final = 10.0
"""s that it covers at least."""

NANOSECOND: Final = 1e-9

Floats = NDArray[np.float64]


class PlanSource(Source):
    """The plans of the object of one entry of `plans:`. A message without poses ends its plan.

    The plan on a path without times begins where the object is. It is made anew when the object is earlier or later
    than planned by more than EARLY.
    """

    speaks = False
    awaited = False

    def __init__(self, entry: PlanEntry) -> None:
        self.name, self.topics = f"{entry.name}, plan", {entry.topic: (PATH, AUTOWARE_TRAJECTORY)}
        self._entry = entry
        self._path: TimelessPath | None = None
        self._goes_on = False  # beyond the plan in force
        self._progress: tuple[int, Floats, Floats] = 0, np.zeros(1), np.zeros(1)  # time 0 (ns), times (s), ways (m)

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. Raises InputError for a path without times."""
        entry, is_path = self._entry, hasattr(content, "poses")
        given = content.poses if is_path else content.points
        if not len(given):
            self._end(stamp_ns, scene)
            return
        if not 2 <= len(given) <= MOST_PATH_POINTS:
            raise InputError(f"expected 2 to {MOST_PATH_POINTS} poses, or none to end the plan, got {len(given)}")
        rows = empty_states([entry.object_id] * len(given))
        for k, each in enumerate(given):
            put_pose(rows[k : k + 1], each.pose)
        times, kept = _path_times(given, rows, stamp_ns, entry) if is_path else _given_times(given, rows)
        rows = rows[kept]
        if len(rows) < 2:
            raise InputError("expected at least 2 poses at different places and times, got one")
        frame = scene.locate(self.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            return
        if frame is not IDENTITY:
            carry_states(rows, frame, None)
        if entry.by_path or not rows["quaternion"].any():
            rows["quaternion"] = headings_along(rows["position"])
        poses = np.concatenate([rows["position"], rows["quaternion"]], axis=1)
        self._path = None
        if times is not None:
            scene.follow([_message(entry, times[kept], poses, entry.then)], stamp_ns)
        else:
            self._path = TimelessPath(poses, entry.limits, stops=entry.then == Then.REST)
            self._follow(stamp_ns, scene, 0.0)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        begin_ns, times, ways = self._progress
        elapsed = (now_ns - begin_ns) * NANOSECOND
        is_old = self._goes_on and elapsed > 0.5 * times[-1]
        expected = float(np.interp(elapsed, times, ways))
        self._follow(now_ns, scene, expected, -1.0 if is_old else EARLY * self._entry.tolerance.along)

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._path = None

    def forget_plans(self) -> None:
        """See Source."""
        self._path = None

    def _follow(self, now_ns: int, scene: SourceScene, expected: float, allowed: float | None = None) -> None:
        """Plan from where the object is now, unless that is nearer than `allowed` (m) to the expected way (m).

        allowed: None for a new path. An object beside it gets the plan from its begin, which it leaves at once, and no
        other one later.
        """
        entry, path = self._entry, self._path
        if path is None:
            return
        state, way, speed = scene.waiting.state(entry.object_id, now_ns), expected, 0.0
        if state is not None and np.isfinite(state["position"]).all():
            nearest, off = path.nearest(state["position"], expected, entry.tolerance.across)
            if off <= entry.tolerance.across:
                way, speed = nearest, float(np.nan_to_num(np.linalg.norm(state["linear"])))
            elif allowed is not None:
                return
        if allowed is not None and abs(way - expected) <= allowed:
            return
        if way > path.length - SAME_PLACE:
            self._end(now_ns, scene)
            return
        times, poses, ways = path.plan_from(way, speed)
        count = int(np.searchsorted(times, max(AHEAD * scene.horizon, LEAST_AHEAD))) + 1
        self._goes_on = count < len(times)
        self._progress = now_ns, times[:count], ways[:count]
        then = Then.GO_ON if self._goes_on else entry.then
        scene.follow([_message(entry, times[:count], poses[:count], then)], now_ns)

    def _end(self, now_ns: int, scene: SourceScene) -> None:
        self._path = None
        scene.follow([_message(self._entry, np.zeros(0), np.zeros((0, 7)), self._entry.then)], now_ns)


def make_plans(content: Any, mapping: Mapping) -> list[Source]:
    """Return the sources of the section `plans`. Raises InputError."""
    return [PlanSource(entry) for entry in read_plans(content, mapping)]


def _message(entry: PlanEntry, times: Floats, poses: Floats, then: Then) -> ObjectTrajectory:
    tolerance = np.array(entry.tolerance, np.float64)
    return ObjectTrajectory(times, poses, np.zeros((0, 6)), tolerance, entry.object_id, then=then)


def _path_times(
    given: Any, rows: Any, stamp_ns: int, entry: PlanEntry
) -> tuple[Floats | None, NDArray[np.bool_]]:  # fmt: skip
    """Times (N,) of the poses of a Path after its stamp (s), and which of them count. None: it has no times.

    Stamps that are all equal, such as zeros, are none: most planners leave them out. Raises InputError.
    """
    stamps = np.array([each.header.stamp.sec * 1_000_000_000 + each.header.stamp.nanosec for each in given])
    if (np.diff(stamps) > 0).all():
        return (stamps - stamp_ns) * NANOSECOND, np.ones(len(stamps), np.bool_)
    if not (stamps == stamps[0]).all():
        k = int(np.flatnonzero(np.diff(stamps) <= 0)[0])
        raise InputError(
            f"stamps of the poses: expected rising ones, or equal ones, got a fall or a stop at pose {k + 1}"
        )
    if not entry.limits.speed:
        raise InputError("stamps of the poses: they are all equal, so the plan has no times; give its `speed`")
    far = np.flatnonzero(~(np.abs(rows["position"]) <= LARGEST_INPUT).all(axis=1))
    if len(far):
        raise InputError(f"position: expected finite numbers up to {LARGEST_INPUT:g}, got others at pose {far[0]}")
    steps = np.linalg.norm(np.diff(rows["position"], axis=0), axis=1)
    return None, np.append(True, steps > SAME_PLACE)


def _given_times(given: Any, rows: Any) -> tuple[Floats, NDArray[np.bool_]]:
    """Times (N,) of the points of an autoware Trajectory (s), and which of them count.

    They are those in the message if these rise, or else follow from the velocities, up to where the vehicle stands.
    """
    times = np.array([each.time_from_start.sec + 1e-9 * each.time_from_start.nanosec for each in given])
    if (np.diff(times) > 0.0).all():
        return times, np.ones(len(times), np.bool_)
    speed = np.abs([float(each.longitudinal_velocity_mps) for each in given])
    steps = np.linalg.norm(np.diff(rows["position"], axis=0), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        spans = np.where(steps > SAME_PLACE, 2.0 * steps / (speed[:-1] + speed[1:]), 0.0)
    stands = np.flatnonzero(~np.isfinite(spans))
    count = int(stands[0]) + 1 if len(stands) else len(times)
    kept = np.append(True, spans > 0.0) & (np.arange(len(times)) < count)
    return np.append(0.0, np.cumsum(np.where(np.isfinite(spans), spans, 0.0))), kept
