"""autoware TrackedObjects and PredictedObjects: all tracks of a topic.

The twist is along the axes of the object. The tracks keep their ids by UUID, and vanish after `forget_after`. A track
changes its shape a little with every message; it is described again only when it has left its described shape, which is
larger than the measured one by up to `shape_tolerance`.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.trajectories import ObjectTrajectory, Then
from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.robots.link_plans import radius_of
from collision_monitor.shapes.pose import Pose, rotation_matrix
from collision_monitor.shapes.registry import Box
from collision_monitor.sources.ground.covariances import usable_blocks, yaw_alone
from collision_monitor.sources.ground.frames import IDENTITY, FrameMotion, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.motion_models import ARC, PEOPLE, MotionModels
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.prisms import covering_prism, load_prisms
from collision_monitor.sources.ground.scene_states import carry_states, empty_states, turn_twists, turned_triangles
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.track_shapes import (
    Measured,
    diameter_around,
    held_by,
    rounded_up,
    still_held,
    upright_cylinder,
    with_extent,
)
from collision_monitor.sources.ground.tracks import DescribedTrack, TrackTable
from collision_monitor.sources.ground.yaml_table import known
from collision_monitor.sources.messages.autoware_bytes import POLYGON, TrackArrays
from collision_monitor.sources.plans.predicted_paths import (
    IGNORED,
    LIKELIEST,
    PATHS,
    TOLERANCE,
    PathPlan,
    plan_of_paths,
)

TRACKED: Final = "autoware_perception_msgs/msg/TrackedObjects"
PREDICTED: Final = "autoware_perception_msgs/msg/PredictedObjects"

_BOX, _CYLINDER = 0, 1
_NO_ORIENTATION = 0
_NO_CORNERS: Final = np.zeros((0, 3))
_LABELS: Final = (
    *("unknown", "car", "truck", "bus", "trailer", "motorcycle", "bicycle", "pedestrian", "animal", "hazard"),
    *("over_drivable", "under_drivable"),
)
_NO_PLAN: Final = PathPlan(np.zeros(0), np.zeros((0, 7)), 0.0)
_NO_TWISTS: Final = np.zeros((0, 6))
_VEHICLES: Final = ("car", "truck", "bus", "trailer", "motorcycle", "bicycle")


Found = tuple[DescribedTrack, int]
"""A track and its row in a message."""


class AutowareSource(Source):
    """The tracks of one entry, with the shapes in the messages or with the entry's `each`."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        keys = ["covariance", "forget_after", "min_existence", "shape_tolerance", "each", "motion", "acceleration"]
        if message_type == PREDICTED:
            keys.append("paths")
            known(entry.paths, PATHS, f"{entry.name}, paths")
        entry.allow_only(keys, message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} holds many objects; `each` is the shape of each")
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry
        self._tracks = TrackTable(entry.name, entry.forget_after)
        self._models = MotionModels(entry.name, entry.motion, PEOPLE, _LABELS, dict.fromkeys(_VEHICLES, ARC))
        self._number = 0
        self._with_plans: set[int] = set()
        self._radius = radius_of(entry.each) if entry.each else 0.0
        load_prisms()
        self._heard_ns = 0  # stamp of the last message: a tracker that is silent does not say that a track is gone

    def take(self, topic: str, content: TrackArrays, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. A track is described when it appears."""
        entry = self._entry
        self._heard_ns = max(self._heard_ns, stamp_ns)
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        # NaN and negative numbers: not known
        wanted = ~((content.existence >= 0.0) & (content.existence < entry.min_existence))
        seen: dict[bytes, int] = {}
        for row in np.flatnonzero(wanted).tolist():
            if content.uuids[row] in seen:
                text = f"UUID {content.uuids[row].hex()}: expected it once in a message, got it twice"
                scene.refuse(entry.name, text)
            else:
                seen[content.uuids[row]] = row
        if frame is None:  # they stay, and become stale
            self._tracks.touch(seen, stamp_ns)
            return
        found = [(self._track(key, content.labels[row], stamp_ns, scene), row) for key, row in seen.items()]
        kept = self._described([(track, row) for track, row in found if track is not None], content, scene)
        if kept:
            states, covariance = self._states(kept, content, scene)
            given = covariance if frame is IDENTITY else carry_states(states, frame, covariance)
            words = [_word(content.labels[row]) for _, row in kept]
            turns = self._models.apply(states, words, scene.horizon)
            scene.observe(entry.name, states, stamp_ns, given, turns=turns)
            if content.paths and entry.paths != IGNORED:
                self._follow(kept, content, frame, stamp_ns, scene)

    def _follow(
        self, kept: list[Found], content: TrackArrays, frame: FrameMotion, stamp_ns: int, scene: SourceScene
    ) -> None:
        """Let the tracks follow their predicted paths, and end the plans of those that have none."""
        plans = []
        for track, row in kept:
            radius = self._radius or float(np.linalg.norm(content.size[row])) / 2.0
            if row in content.footprints:
                radius = max(radius, float(np.linalg.norm(content.footprints[row], axis=1).max()))
            plan = None
            with scene.guard(self.name, track.name):
                plan = plan_of_paths(
                    content.paths[row], scene.horizon, radius, alone=self._entry.paths == LIKELIEST
                )
            times, poses, tube = plan or _NO_PLAN
            if plan is None and track.object_id not in self._with_plans:
                continue
            if len(times) and frame is not IDENTITY:
                rows = empty_states([track.object_id] * len(times))
                rows["position"], rows["quaternion"] = poses[:, :3], poses[:, 3:]
                carry_states(rows, frame, None)
                poses = np.concatenate([rows["position"], rows["quaternion"]], axis=1)
            (self._with_plans.discard if plan is None else self._with_plans.add)(track.object_id)
            plans.append(
                ObjectTrajectory(
                    times, poses, _NO_TWISTS, np.array(TOLERANCE), track.object_id, then=Then.GO_ON, tube=tube
                )
            )
        scene.follow(plans, stamp_ns)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.expire(self._heard_ns, scene)

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.restart(now_ns)
        self._with_plans.clear()
        self._heard_ns = now_ns

    def _track(self, key: bytes, label: int, stamp_ns: int, scene: SourceScene) -> DescribedTrack | None:
        if key not in self._tracks:
            self._number += 1
        return self._tracks.get(key, f"{self._entry.name}_{_word(label)}_{self._number}", stamp_ns, scene)

    def _described(self, found: list[Found], content: TrackArrays, scene: SourceScene) -> list[Found]:
        """Describe the tracks that are new or have left their described shapes. Return those that are described."""
        entry, tolerance = self._entry, self._entry.shape_tolerance
        kinds, sizes = _measured(content)
        before = [track.shape for track, _ in found]
        if entry.each:
            still = np.array([shape is not None for shape in before])
        else:
            rows = np.array([row for _, row in found], np.int64)
            still = still_held(before, kinds[rows], sizes[rows], tolerance)
        kept = []
        for (track, row), held in zip(found, still.tolist(), strict=True):
            corners = content.footprints.get(row, _NO_CORNERS if content.kind[row] == POLYGON else None)
            if held or self._describe(track, (int(kinds[row]), sizes[row]), corners, scene):
                kept.append((track, row))
        return kept

    def _describe(self, track: DescribedTrack, measured: Measured, corners: Any, scene: SourceScene) -> bool:
        """Describe one track. corners: of a polygon, else None. Return whether it is described."""
        entry, tolerance = self._entry, self._entry.shape_tolerance
        if measured[0] == POLYGON and not entry.each:
            measured = POLYGON, np.column_stack([corners[:, :2], np.full(len(corners), measured[1][2])])
            if track.shape is not None and held_by(track.shape, measured, tolerance):
                return True
        described = rounded_up(measured, tolerance)
        with scene.guard(entry.name, track.name):
            if not scene.may_describe:
                raise InputError("it waits, because the message has too many new objects at once")
            shapes, padding, coarse = (entry.each, 0.0, "") if entry.each else _shapes(described, tolerance)
            scene.describe(entry.describe(track.object_id, track.name, shapes, extra_padding=padding))
            track.shape = described
            if corners is _NO_CORNERS and not entry.each:
                coarse = "footprint: expected corners, got none; a disc of its dimensions is monitored"
            if coarse:
                scene.refuse(entry.name, f"{track.name}: {coarse}")
        if track.shape is None:
            scene.lacks(entry.name, track.name, scene.last_refusal[entry.name])
            return False
        scene.has(entry.name, track.name)
        return True

    def _states(self, kept: list[Found], content: TrackArrays, scene: SourceScene) -> tuple[Any, Any]:
        """Return states in the frame of the message, with covariances or None."""
        states = empty_states([track.object_id for track, _ in kept])
        rows = np.array([row for _, row in kept])
        poses, twists, acceleration = content.pose[rows], content.twist[rows], content.acceleration[rows]
        standing = content.stationary[rows]
        twists[standing], acceleration[standing] = 0.0, 0.0
        states["position"], states["quaternion"] = poses[:, :3], poses[:, 3:]
        states["quaternion"][content.orientation[rows] == _NO_ORIENTATION] = 0.0, 0.0, 0.0, 1.0
        states["linear"], states["angular"], states["acceleration"] = twists[:, :3], twists[:, 3:], acceleration
        states["flags"][acceleration.any(1)] = StateFlag.ACCELERATION_VALID
        covariance = self._covariances(states, content, rows, scene) if self._entry.covariance else None
        turn_twists(states)
        return states, covariance

    def _covariances(
        self, states: Any, content: TrackArrays, rows: NDArray[np.int64], scene: SourceScene
    ) -> NDArray[np.float64] | None:
        pose = usable_blocks(content.pose_covariance[rows])
        twist = usable_blocks(content.twist_covariance[rows])
        wrong = int((~(pose.valid & twist.valid)).sum())
        if wrong:
            text = "covariance: expected symmetric matrices without negative eigenvalues; it was ignored"
            scene.refuse(self._entry.name, text, wrong)
        states["orientation_stddev"], states["angular_velocity_stddev"] = pose.stddev, twist.stddev
        states["flags"][yaw_alone(pose, twist, states["quaternion"])] |= np.uint32(StateFlag.YAW_ONLY)
        joined: NDArray[np.float64] = np.nan_to_num(np.concatenate([pose.linear, twist.linear], axis=1))
        if not joined.any():
            return None
        joined[:, 6:] = turned_triangles(rotation_matrix(states["quaternion"]), joined)[:, 6:]
        return joined


def _word(label: int) -> str:
    """Return the class of a label."""
    return _LABELS[label] if label < len(_LABELS) else f"label{label}"


def _measured(content: TrackArrays) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Return kinds (N,) and sizes (N, 3).

    A box without orientation counts as the cylinder about it, and so does a polygon without corners.
    """
    kinds, sizes = content.kind.copy(), with_extent(content.size)
    around = (kinds == _BOX) & (content.orientation == _NO_ORIENTATION)
    around |= (kinds == POLYGON) & ~np.isin(np.arange(len(kinds)), list(content.footprints))
    kinds[around] = _CYLINDER
    sizes[around, :2] = diameter_around(sizes[around, :2])[:, None]
    return kinds, sizes


def _shapes(described: tuple[int, NDArray[np.float64]], tolerance: float) -> tuple[Any, float, str]:
    """Return shapes, how far the object may exceed them, and why they are not its own.

    Raises ShapeError, InputError.
    """
    kind, numbers = described
    if kind == POLYGON:
        height = float(numbers[0, 2]) if len(numbers) else 0.0
        if len(numbers) and not height > 0.0:
            raise InputError(f"dimensions.z: expected a height above 0, got {height}")
        shapes, coarse = covering_prism(numbers[:, :2], -height / 2, height / 2)
        return shapes, tolerance, coarse
    if kind == _BOX:
        return ((Box(numbers), Pose()),), 0.0, ""
    if kind == _CYLINDER:
        return ((upright_cylinder(numbers), Pose()),), 0.0, ""
    raise InputError(f"shape.type: expected 0 (box), 1 (cylinder) or 2 (polygon), got {kind}")
