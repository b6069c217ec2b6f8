"""nav_msgs/Path and autoware Trajectory: each message is the plan of one object, and replaces the one before."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.trajectories import ObjectTrajectory
from collision_monitor.errors import InputError
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.poses import put_pose
from collision_monitor.sources.plans.plan_entry import PlanEntry, read_plans

PATH: Final = "nav_msgs/msg/Path"
AUTOWARE_TRAJECTORY: Final = "autoware_planning_msgs/msg/Trajectory"

MOST_PATH_POINTS: Final = 20_000
"""Poses of a message: 1 km at 5 cm."""

SAME_PLACE: Final = 1e-6
"""m: nearer points of a path without times are one. Smaller: a step of round-off gets a speed of its own."""

Floats = NDArray[np.float64]


class PlanSource(Source):
    """The plans of the object of one entry of `plans:`. A message without poses ends its plan."""

    speaks = False
    awaited = False

    def __init__(self, entry: PlanEntry) -> None:
        self.name, self.topics = f"{entry.name}, plan", {entry.topic: (PATH, AUTOWARE_TRAJECTORY)}
        self._entry = entry

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. Raises InputError for a path without times."""
        entry, is_path = self._entry, hasattr(content, "poses")
        given = content.poses if is_path else content.points
        if not len(given):
            scene.follow([_message(entry, np.zeros(0), np.zeros((0, 7)))], stamp_ns)
            return
        if not 2 <= len(given) <= MOST_PATH_POINTS:
            raise InputError(f"expected 2 to {MOST_PATH_POINTS} poses, or none to end the plan, got {len(given)}")
        rows = empty_states([entry.object_id] * len(given))
        for k, each in enumerate(given):
            put_pose(rows[k : k + 1], each.pose)
        times, kept = (
            _path_times(given, rows["position"], stamp_ns, entry.speed) if is_path else _given_times(given, rows)
        )
        rows = rows[kept]
        if len(rows) < 2:
            raise InputError("expected at least 2 poses at different places and times, got one")
        frame = scene.locate(self.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            return
        if frame is not IDENTITY:
            carry_states(rows, frame, None)
        if entry.by_path:
            rows["quaternion"] = _along(rows["position"])
        poses = np.concatenate([rows["position"], rows["quaternion"]], axis=1)
        scene.follow([_message(entry, times[kept], poses)], stamp_ns)


def make_plans(content: Any, mapping: Mapping) -> list[Source]:
    """Return the sources of the section `plans`. Raises InputError."""
    return [PlanSource(entry) for entry in read_plans(content, mapping)]


def _message(entry: PlanEntry, times: Floats, poses: Floats) -> ObjectTrajectory:
    tolerance = np.array(entry.tolerance, np.float64)
    return ObjectTrajectory(times, poses, np.zeros((0, 6)), tolerance, entry.object_id, then=entry.then)


def _path_times(given: Any, position: Floats, stamp_ns: int, speed: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Times (N,) of the poses of a Path after its stamp (s), and which of them count: by their stamps, or the speed.

    Stamps that are all equal, such as zeros, are none: most planners leave them out. Raises InputError.
    """
    stamps = np.array([each.header.stamp.sec * 1_000_000_000 + each.header.stamp.nanosec for each in given])
    if (np.diff(stamps) > 0).all():
        return (stamps - stamp_ns) * 1e-9, np.ones(len(stamps), np.bool_)
    if not (stamps == stamps[0]).all():
        k = int(np.flatnonzero(np.diff(stamps) <= 0)[0])
        raise InputError(
            f"stamps of the poses: expected rising ones, or equal ones, got a fall or a stop at pose {k + 1}"
        )
    if not speed:
        raise InputError("stamps of the poses: they are all equal, so the plan has no times; give its `speed`")
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    way = np.append(0.0, np.cumsum(np.where(np.isfinite(steps), steps, 0.0)))
    return way / speed, np.append(True, steps > SAME_PLACE)


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


def _along(position: Floats) -> Floats:
    """Quaternions (N, 4) with x along the way in the plane; the last as the one before, and so where it only climbs."""
    steps = np.diff(position[:, :2], axis=0)
    steps = np.concatenate([steps, steps[-1:]])
    moves = np.linalg.norm(steps, axis=1) > 0.0
    last = np.maximum.accumulate(np.where(moves, np.arange(len(steps)), 0))
    half = 0.5 * np.arctan2(steps[last, 1], steps[last, 0])
    return np.column_stack([np.zeros((len(half), 2)), np.sin(half), np.cos(half)])
