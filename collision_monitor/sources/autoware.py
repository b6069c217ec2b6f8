"""autoware TrackedObjects and PredictedObjects: all tracks of a topic.

The twist is along the axes of the object. The tracks keep their ids by UUID, and vanish after `forget_after`. A track
changes its shape a little with every message; it is described again only when it has left its described shape, which is
larger than the measured one by up to `shape_tolerance`.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.geometry.pose import Pose, rotation_matrix
from collision_monitor.geometry.shapes import Box, Cylinder
from collision_monitor.records import StateFlag
from collision_monitor.sources.covariances import usable_blocks
from collision_monitor.sources.frames import IDENTITY, frame_name
from collision_monitor.sources.mapping import Mapping
from collision_monitor.sources.object_entry import ObjectEntry
from collision_monitor.sources.prisms import prism
from collision_monitor.sources.scene import Scene
from collision_monitor.sources.scene_states import carry, empty_states, turn_twists, turned_triangles
from collision_monitor.sources.track_shapes import held_by, rounded_up
from collision_monitor.sources.tracks import Track, TrackTable

TRACKED: Final = "autoware_perception_msgs/msg/TrackedObjects"
PREDICTED: Final = "autoware_perception_msgs/msg/PredictedObjects"

_BOX, _CYLINDER, _POLYGON = 0, 1, 2
_NO_ORIENTATION = 0
_LABELS: Final = (
    *("unknown", "car", "truck", "bus", "trailer", "motorcycle", "bicycle", "pedestrian", "animal", "hazard"),
    *("over_drivable", "under_drivable"),
)


class AutowareSource:
    """The tracks of one entry, with the shapes in the messages or with the entry's `each`."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("covariance", "forget_after", "min_existence", "shape_tolerance", "each"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} holds many objects; `each` is the shape of each")
        self.topics = {entry.topic: (message_type,)}
        self._entry = entry
        self._tracks = TrackTable(entry.forget_after)
        self._predicted = message_type == PREDICTED
        self._number = 0

    def begin(self, scene: Scene) -> None:
        """See Source. A track is described when it appears."""

    def take(self, topic: str, content: Any, stamp_ns: int, scene: Scene) -> None:
        """See Source."""
        entry = self._entry
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        seen: dict[bytes, Any] = {}
        for each in content.objects:
            key = each.object_id.uuid.tobytes()
            if key in seen:
                scene.refuse(entry.name, f"UUID {key.hex()}: expected it once in a message, got it twice")
            elif each.existence_probability >= entry.min_existence or math.isnan(each.existence_probability):
                seen[key] = each
        if frame is None:  # they stay, and become stale
            self._tracks.touch(seen, stamp_ns)
            return
        tracks, objects = [], []
        for key, each in seen.items():
            track = self._track(key, each, stamp_ns, scene)
            if track is not None and self._describe(track, each, scene):
                tracks.append(track)
                objects.append(each)
        if tracks:
            states, covariance = self._states(tracks, objects, scene)
            given = covariance if frame is IDENTITY else carry(states, frame, covariance)
            scene.observe(states, stamp_ns, given)

    def settle(self, now_ns: int, scene: Scene) -> None:
        """See Source."""
        self._tracks.expire(now_ns, scene)

    def _track(self, key: bytes, each: Any, stamp_ns: int, scene: Scene) -> Track | None:
        if key not in self._tracks:
            self._number += 1
        likeliest = max(each.classification, key=lambda it: it.probability, default=None)
        label = likeliest.label if likeliest is not None else 0
        word = _LABELS[label] if label < len(_LABELS) else f"label{label}"
        return self._tracks.get(key, f"{self._entry.name}_{word}_{self._number}", stamp_ns, scene)

    def _describe(self, track: Track, each: Any, scene: Scene) -> bool:
        """Describe a track that is new or has left its described shape. Return whether it is described."""
        entry, tolerance = self._entry, self._entry.shape_tolerance
        if entry.each:
            if track.shape is None:
                track.shape = ()
                scene.describe(entry.describe(track.object_id, track.name, entry.each))
            return True
        measured = _measured(each, self._predicted)
        if track.shape is not None and held_by(track.shape, measured, tolerance):
            return True
        described = rounded_up(measured, tolerance)
        try:
            shapes, padding = _shapes(described, tolerance)
            scene.describe(entry.describe(track.object_id, track.name, shapes, extra_padding=padding))
        except CollisionMonitorError as error:
            scene.refuse(entry.name, f"{track.name}: {error}")
            return track.shape is not None
        track.shape = described
        return True

    def _states(self, tracks: list[Track], objects: list[Any], scene: Scene) -> tuple[Any, Any]:
        """Return states in the frame of the message, with covariances or None."""
        entry = self._entry
        states = empty_states([track.object_id for track in tracks])
        parts = [_kinematics(each) for each in objects]
        poses = np.array([_pose_numbers(pose.pose) for pose, _, _ in parts])
        states["position"] = poses[:, :3]
        states["quaternion"] = poses[:, 3:]
        if not self._predicted:
            unknown = np.array([it.kinematics.orientation_availability == _NO_ORIENTATION for it in objects])
            states["quaternion"][unknown] = 0.0, 0.0, 0.0, 1.0
            standing = np.array([it.kinematics.is_stationary for it in objects])
        else:
            standing = np.zeros(len(objects), np.bool_)
        twists = np.array([_twist_numbers(twist.twist) for _, twist, _ in parts])
        accelerations = np.array([_vector(accel.accel.linear) for _, _, accel in parts])
        twists[standing], accelerations[standing] = 0.0, 0.0
        states["linear"], states["angular"], states["acceleration"] = twists[:, :3], twists[:, 3:], accelerations
        states["flags"][accelerations.any(1)] = StateFlag.ACCELERATION_VALID
        covariance = self._covariances(states, parts, scene) if entry.covariance else None
        turn_twists(states)
        return states, covariance

    def _covariances(self, states: Any, parts: list[Any], scene: Scene) -> NDArray[np.float64] | None:
        pose = usable_blocks(np.array([pose.covariance for pose, _, _ in parts], np.float64))
        twist = usable_blocks(np.array([twist.covariance for _, twist, _ in parts], np.float64))
        wrong = int((~(pose[2] & twist[2])).sum())
        if wrong:
            text = "covariance: expected symmetric matrices without negative eigenvalues; it was ignored"
            scene.refuse(self._entry.name, text, wrong)
        states["orientation_stddev"], states["angular_velocity_stddev"] = pose[1], twist[1]
        joined = np.concatenate([pose[0], twist[0]], axis=1)
        known = ~np.isnan(joined)
        if not known.any():
            return None
        joined = np.where(known.any(1, keepdims=True), np.where(known, joined, 0.0), 0.0)
        joined[:, 6:] = turned_triangles(rotation_matrix(states["quaternion"]), joined)[:, 6:]
        return joined


def _kinematics(each: Any) -> tuple[Any, Any, Any]:
    """Return pose, twist and acceleration, each with its covariance."""
    k = each.kinematics
    if hasattr(k, "pose_with_covariance"):
        return k.pose_with_covariance, k.twist_with_covariance, k.acceleration_with_covariance
    return k.initial_pose_with_covariance, k.initial_twist_with_covariance, k.initial_acceleration_with_covariance


def _vector(v: Any) -> tuple[float, float, float]:
    return v.x, v.y, v.z


def _pose_numbers(pose: Any) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _twist_numbers(twist: Any) -> tuple[float, ...]:
    return (*_vector(twist.linear), *_vector(twist.angular))


def _measured(each: Any, predicted: bool) -> tuple[int, NDArray[np.float64]]:
    """Return the kind and the numbers of a shape: full extents (3,), or the corners (n, 3) with the height in z.

    A box without orientation counts as the cylinder about it.
    """
    shape = each.shape
    size = np.array(_vector(shape.dimensions))
    if shape.type == _POLYGON:
        corners = [(float(p.x), float(p.y), size[2]) for p in shape.footprint.points]
        return _POLYGON, np.array(corners).reshape(-1, 3)
    if shape.type == _BOX and not predicted and each.kinematics.orientation_availability == _NO_ORIENTATION:
        around = math.hypot(size[0], size[1])
        return _CYLINDER, np.array([around, around, size[2]])
    return int(shape.type), size


def _shapes(described: tuple[int, NDArray[np.float64]], tolerance: float) -> tuple[Any, float]:
    """Return shapes and how far the object may exceed them. Raises ShapeError, InputError."""
    kind, numbers = described
    if kind == _POLYGON:
        height = float(numbers[0, 2]) if len(numbers) else 0.0
        if not height > 0.0:
            raise InputError(f"dimensions.z: expected a height above 0, got {height}")
        return prism(numbers[:, :2], -height / 2, height / 2), tolerance
    if kind == _BOX:
        return ((Box(numbers), Pose()),), 0.0
    if kind == _CYLINDER:
        return ((Cylinder(max(numbers[:2]) / 2, numbers[2]), Pose()),), 0.0
    raise InputError(f"shape.type: expected 0 (box), 1 (cylinder) or 2 (polygon), got {kind}")
