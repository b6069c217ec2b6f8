"""The path of plans from message bytes into the monitor: each alone is followed, ended or refused."""

from __future__ import annotations

from typing import Any, Final

from collision_monitor.codec.trajectories import Between, ObjectTrajectory, Then, decode_trajectories
from collision_monitor.errors import InputError, Refusal, reason_of
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.motion.trajectory import Tolerance, Trajectory
from collision_monitor.pipeline.state_intake import is_in_frame

_BETWEEN: Final[dict[int, Any]] = {Between.STRAIGHT: "straight", Between.ARC: "arc", Between.CURVE: "curve"}
_THEN: Final[dict[int, Any]] = {Then.REST: "rest", Then.GO_ON: "go on"}


def take_plans(monitor: Monitor, frame_id: str, data: bytes) -> None:
    """Process an ObjectTrajectoryArray. An impossible plan alone is refused. frame_id: that of the monitor."""
    try:
        message = decode_trajectories(data)
    except Exception as error:  # see `reason_of`
        monitor.refuse(Refusal.MALFORMED, reason_of(error))
        return
    if not is_in_frame(monitor, frame_id, message.frame_id, "ObjectTrajectoryArray"):
        return
    for each in message.trajectories:
        try:
            _follow(monitor, each, message.stamp_ns)
        except Exception as error:  # see `reason_of`
            unknown = each.object_id not in monitor
            reason = Refusal.UNKNOWN_ID if unknown else Refusal.MALFORMED
            text = reason_of(error)
            named = "" if text.startswith(f"object {each.object_id}") else f"object {each.object_id}: "
            monitor.refuse(reason, f"ObjectTrajectoryArray, {named}{text}")


def _follow(monitor: Monitor, given: ObjectTrajectory, stamp_ns: int) -> None:
    """Let an object follow its plan. Raises InputError, PoseError."""
    if not len(given.times):
        monitor.follow(given.object_id, None)
        return
    monitor.follow(given.object_id, trajectory_of(given), stamp_ns=stamp_ns, tolerance=tolerance_of(given))


def tolerance_of(given: ObjectTrajectory) -> Tolerance:
    """The tolerance in a message; four zeros: the default."""
    return Tolerance(*given.tolerance.tolist()) if given.tolerance.any() else Tolerance()


def trajectory_of(given: ObjectTrajectory) -> Trajectory:
    """The trajectory in a message. Raises InputError, PoseError."""
    if given.between not in _BETWEEN or given.then not in _THEN:
        raise InputError(
            f"between and then: expected {list(_BETWEEN)} and {list(_THEN)}, got {given.between} and {given.then}"
        )
    twists = given.twists if len(given.twists) else None
    accelerations = given.accelerations[:, :3] if len(given.accelerations) else None
    kind, then = _BETWEEN[given.between], _THEN[given.then]
    return Trajectory(
        given.times, given.poses, twists, accelerations=accelerations, between=kind, then=then, tube=given.tube
    )
