"""A Path as a plan of a gate: a base that follows it, with what it carries and tows."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.ros.gate.gated_plan import GatedPlan
from collision_monitor.ros.gate.gated_world import GatedWorld
from collision_monitor.shapes.pose import multiply, rotation_matrix
from collision_monitor.sources.ground.scene_states import empty_states
from collision_monitor.sources.messages.poses import put_pose
from collision_monitor.sources.plans.path_source import MOST_PATH_POINTS

Floats = NDArray[np.float64]

SAME_PLACE: Final = 1e-4
"""m: nearer poses of a path are one."""

UNIT: Final = 1e-2
"""By which the length of a quaternion may differ from 1."""


def base_plan(message: Any, world: GatedWorld, base: int, now_ns: int, speed: float, tolerance: float) -> GatedPlan:
    """Return the plan of a nav_msgs/Path for the object `base` and those that move with it.

    speed (m/s): of the base along the path, and at its outermost point where the path turns on the spot. The stamps of
    the poses are not read, as a controller has its own speed. tolerance (m): by which the base may be off the path now;
    the plan begins at the base, and goes on from the pose of the path that is nearest. The other objects keep their
    places on the base. Raises InputError.
    """
    poses = _poses(message)
    motion = world.motion(base, now_ns)
    if motion is None:
        raise InputError(f"expected a state of {world.described[base].name!r}, got none so far")
    here = np.array(motion.pose.numbers)
    off = np.linalg.norm(poses[:, :3] - here[:3], axis=1)
    k = int(off.argmin())
    if off[k] > tolerance:
        raise InputError(f"it starts elsewhere: the base is {off[k]:.3f} m off the path")
    poses = np.concatenate([here[None], poses[k + 1 :]]) if off[k] > SAME_PLACE else poses[k:]
    own = {each: world.motion(each, now_ns) for each in world.own}
    reaches = {each: world.reaches[each] for each in own}
    widest = reaches[base]
    steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    half = np.abs((poses[1:, 3:] * poses[:-1, 3:]).sum(axis=1)).clip(0.0, 1.0)
    way = np.maximum(steps, 2.0 * np.arccos(half) * widest)
    kept = np.append(True, way > SAME_PLACE)
    poses, way = poses[kept], way[kept[1:]]
    if len(poses) < 2:
        raise InputError("poses: expected a path that goes on from the base, got its end")
    times = np.append(0.0, np.cumsum(way / speed))
    bodies = {}
    for each, its in own.items():
        if its is None:
            raise InputError(f"expected a state of {world.described[each].name!r}, got none so far")
        bodies[each] = Trajectory(times, _carried(poses, motion.pose.inverse() @ its.pose), between="arc")
    return GatedPlan(bodies, float(times[-1]), reaches, message)


def _poses(message: Any) -> Floats:
    """Poses (N, 7) of a Path."""
    if not 2 <= len(message.poses) <= MOST_PATH_POINTS:
        raise InputError(f"poses: expected 2 to {MOST_PATH_POINTS}, got {len(message.poses)}")
    rows = empty_states([0] * len(message.poses))
    for k, each in enumerate(message.poses):
        put_pose(rows[k : k + 1], each.pose)
    found = np.concatenate([rows["position"], rows["quaternion"]], axis=1)
    if not np.isfinite(found).all():
        k = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
        raise InputError(f"poses: expected finite numbers, got others at pose {k}")
    size = np.linalg.norm(found[:, 3:], axis=1)
    bad = np.flatnonzero(np.abs(size - 1.0) > UNIT)
    if len(bad):
        raise InputError(f"poses: expected unit quaternions, got one of length {size[bad[0]]:g} at pose {bad[0]}")
    found[:, 3:] /= size[:, None]
    return found


def _carried(poses: Floats, offset: Any) -> Floats:
    """Poses (N, 7) of what stands at a pose on a body with poses (N, 7)."""
    position = poses[:, :3] + rotation_matrix(poses[:, 3:]) @ offset.position
    return np.concatenate([position, multiply(poses[:, 3:], np.tile(offset.quaternion, (len(poses), 1)))], axis=1)
