"""Odometry, PoseStamped and PoseWithCovarianceStamped: one object for each entry."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.sources.ground.covariances import Blocks, usable_blocks, yaw_alone
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import (
    carry_states,
    empty_states,
    squares,
    turn_twists,
    turned_triangles,
)
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.yaml_table import SHAPES

ODOMETRY: Final = "nav_msgs/msg/Odometry"
POSE: Final = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"


class PoseSource(Source):
    """The object of one entry. Odometry holds its twist along the axes of `child_frame_id`, which is the body's."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("covariance", "position_stddev", "estimate_over"), message_type)
        require_shape(entry)
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        entry = self._entry
        twist = getattr(content, "twist", None)
        pose = content.pose.pose if hasattr(content.pose, "pose") else content.pose
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            return
        states = empty_states([entry.object_id])
        put_pose(states, pose)
        states["position_stddev"] = entry.position_stddev
        covariance = np.full((1, 12), np.nan)
        of_pose = of_twist = usable_blocks(np.zeros((1, 36)))
        if entry.covariance and pose is not content.pose:
            of_pose = self._blocks(content.pose, "pose", scene)
            covariance[:, :6], states["orientation_stddev"] = of_pose.linear, of_pose.stddev
        if twist is None:
            states["flags"] = StateFlag.TWIST_UNKNOWN
        else:
            states["linear"] = twist.twist.linear.x, twist.twist.linear.y, twist.twist.linear.z
            states["angular"] = twist.twist.angular.x, twist.twist.angular.y, twist.twist.angular.z
            if entry.covariance:
                of_twist = self._blocks(twist, "twist", scene)
                covariance[:, 6:], states["angular_velocity_stddev"] = of_twist.linear, of_twist.stddev
                known = ~np.isnan(covariance)
                covariance = np.where(known.any(1, keepdims=True), np.where(known, covariance, 0.0), np.nan)
                body = turned_triangles(rotation_matrix(states["quaternion"]), covariance)
                covariance[:, 6:] = body[:, 6:]
            turn_twists(states)
        states["flags"][yaw_alone(of_pose, of_twist, states["quaternion"])] |= np.uint32(StateFlag.YAW_ONLY)
        given: Any = covariance
        if twist is None:  # the velocity is estimated, and with it its uncertainty
            worst = worst_stddev(covariance[:, :6])
            states["position_stddev"] = np.where(np.isnan(worst), states["position_stddev"], worst)
            given = None
        elif np.isnan(covariance).any():
            given = None
        if frame is not IDENTITY:
            given = carry_states(states, frame, given)
        scene.observe(entry.name, states, stamp_ns, given, window=entry.estimate_over, turns=twist is not None)

    def _blocks(self, part: Any, what: str, scene: SourceScene) -> Blocks:
        found = usable_blocks(np.asarray(part.covariance, np.float64).reshape(1, 36))
        if not found.valid[0]:
            scene.refuse(
                self._entry.name,
                f"covariance of the {what}: expected a symmetric matrix without negative eigenvalues; it was ignored",
            )
        return found


def put_pose(states: Any, pose: Any) -> None:
    """Write a geometry_msgs/Pose into states (1,)."""
    p, q = pose.position, pose.orientation
    states["position"] = p.x, p.y, p.z
    states["quaternion"] = q.x, q.y, q.z, q.w


def worst_stddev(triangles: Any) -> Any:
    """Return the standard deviations (N,) along the worst axes of covariances (N, 6); NaN where there is none."""
    none = np.isnan(triangles).any(1)
    eigenvalues = np.linalg.eigvalsh(squares(np.where(none[:, None], 0.0, triangles)))
    return np.where(none, np.nan, np.sqrt(np.maximum(eigenvalues[:, 2], 0.0)))


def require_shape(entry: ObjectEntry) -> None:
    """Check that an entry has a shape of its own. Raises InputError."""
    if not entry.shapes:
        raise InputError(
            f"{entry.name}, shape: expected one of {', '.join(SHAPES)}, got none; only markers, tracks, detections, "
            "footprints and scans bring their own"
        )
