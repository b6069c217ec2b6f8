"""Converts odometry, poses, transforms and markers to inputs of the monitor.

Each message of the bag becomes one message of states for each stamp in it, so the monitor takes the same steps as the
bag. The monitor itself refuses and counts a wrong state (quaternion, numbers, stamp). Only Odometry holds a twist; for
all other messages the monitor estimates it from successive poses (`ObjectState.TWIST_UNKNOWN`). Covariances are not
read, because in bags they are more often placeholders than measurements.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np

from collision_monitor import records
from collision_monitor.codec import Change, Removal, encode_descriptions, encode_states
from collision_monitor.errors import CollisionMonitorError, InputError, SessionError
from collision_monitor.geometry.pose import Pose, rotation_matrix
from collision_monitor.geometry.shapes import Shape
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import StateFlag
from collision_monitor.sources.mapping import HEADER, Mapping, Source
from collision_monitor.sources.marker_objects import DELETE, DELETE_ALL, MarkerTable, marker_shape, source_of
from collision_monitor.sources.transforms import IDENTITY, Placement, TransformTree, frame_name, placement


class SourceType(StrEnum):
    """The message types that can be mapped."""

    ODOMETRY = "nav_msgs/msg/Odometry"
    POSE = "geometry_msgs/msg/PoseStamped"
    POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
    TRANSFORMS = "tf2_msgs/msg/TFMessage"
    MARKER = "visualization_msgs/msg/Marker"
    MARKERS = "visualization_msgs/msg/MarkerArray"


class Input(NamedTuple):
    """A message for the monitor. topic: STATES or SHAPES. Times in ns."""

    topic: Topic
    data: bytes
    log_time: int
    publish_time: int


class Converter:
    """Converts a bag, message by message.

    states: number of states of each object. skipped: reasons why something was left out, with their counts.
    Raises SessionError for a topic that is not in the bag or has another type, InputError for an impossible object.
    """

    def __init__(self, mapping: Mapping, topics: dict[str, str], tree: TransformTree) -> None:
        self.skipped: Counter[str] = Counter()
        self.states: Counter[str] = Counter()
        self._mapping = mapping
        self._sources = mapping.topics
        self._tree = tree
        self._markers = MarkerTable(1 + max(source.object_id for source in mapping.sources))
        for topic, sources in self._sources.items():
            for source in sources:
                _check_source(source, topics.get(topic), topics)

    def begin(self, log_time: int) -> Input:
        """Return the descriptions of the objects that are known from the start. Raises InputError, SessionError."""
        objects: list[Change] = []
        for source in self._mapping.sources:
            if source.marker is not None:
                self.states.update({source.name: 0} if source.marker[1] is not None else {})
                continue
            pose = None
            if source.static:
                pose = _pose(self._static_placement(source), source.name)
            else:
                self.states[source.name] = 0
            objects.append(self._description(source, source.object_id, source.name, source.shapes, pose))
        return self._descriptions(log_time, objects, snapshot=True)

    def take(self, topic: str, kind: str, message: Any, log_time: int) -> Iterator[Input]:
        """Yield the inputs that a message of the bag becomes."""
        if kind == SourceType.TRANSFORMS:
            yield from self._take_transforms(topic, message, log_time)
            return
        if kind in (SourceType.MARKER, SourceType.MARKERS):
            yield from self._take_markers(topic, message.markers if kind == SourceType.MARKERS else [message], log_time)
            return
        pose = message.pose if kind == SourceType.POSE else message.pose.pose
        twist = message.twist.twist if kind == SourceType.ODOMETRY else None
        rows = []
        for source in self._sources[topic]:
            frame = frame_name(message.header.frame_id)
            row = self._state(source.name, source.object_id, frame, placement(pose), twist)
            rows += [] if row is None else [(self._stamp(message.header, log_time), row)]
        yield from self._states_of(rows, log_time)

    # -- kinds of messages

    def _take_transforms(self, topic: str, message: Any, log_time: int) -> Iterator[Input]:
        moved: dict[str, Any] = {}
        for each in message.transforms:
            child = frame_name(each.child_frame_id)
            if put_transform(self._tree, each, static=False):
                moved[child] = each.header
        rows = []
        for source in self._sources.get(topic, ()):
            header = moved.get(self._tree.nearest_moving(source.frame) or "")
            if header is not None:
                where = self._tree.find(self._mapping.frame, source.frame)
                if where is None:
                    self._skip(source.name, self._mapping.frame, source.frame)
                    continue
                row = self._state(source.name, source.object_id, self._mapping.frame, where, None)
                rows += [] if row is None else [(self._stamp(header, log_time), row)]
        yield from self._states_of(rows, log_time)

    def _take_markers(self, topic: str, markers: Iterable[Any], log_time: int) -> Iterator[Input]:
        changes: list[Change] = []
        rows = []
        for marker in markers:
            if marker.action in (DELETE, DELETE_ALL):
                changes += map(Removal, self._markers.delete(topic, marker))
                continue
            source = source_of(self._sources[topic], marker)
            if source is None:
                continue
            each = self._markers.object_of(source, marker)
            where = self._placed(each.name, frame_name(marker.header.frame_id), placement(marker.pose))
            if where is None:
                continue
            try:
                shapes = source.shapes or ((marker_shape(marker), Pose()),)
                pose = Pose(where.position, where.quaternion) if source.static else None
            except CollisionMonitorError as error:
                self.skipped[f"{each.name}: {error}"] += 1
                continue
            described = (
                [repr(shape) for shape, _ in shapes],
                None if pose is None else [*pose.position, *pose.quaternion],
            )
            if described != each.described:
                each.described = described
                changes.append(self._description(source, each.object_id, each.name, shapes, pose))
            if not source.static:
                row = self._state(each.name, each.object_id, self._mapping.frame, where, None)
                rows += [] if row is None else [(self._stamp(marker.header, log_time), row)]
        if changes:
            yield self._descriptions(log_time, changes)
        yield from self._states_of(rows, log_time)

    # -- frames and stamps

    def _placed(self, name: str, frame: str, where: Placement) -> Placement | None:
        """Return a pose of the bag in the frame of the session; None if tf does not connect the frames."""
        if frame == self._mapping.frame:
            return where  # unchanged, to its last bit
        parent = self._tree.find(self._mapping.frame, frame)
        if parent is None:
            self._skip(name, self._mapping.frame, frame)
            return None
        return parent @ where

    def _skip(self, name: str, target: str, source: str) -> None:
        frames = ", ".join(self._tree.frames) or "none"
        self.skipped[f"{name}: no transform from {target!r} to {source!r}; frames known from tf: {frames}"] += 1

    def _static_placement(self, source: Source) -> Placement:
        where = IDENTITY
        if source.pose is not None:
            where = Placement(source.pose.position, source.pose.quaternion)
        if not source.frame or source.frame == self._mapping.frame:
            return where
        parent = self._tree.find(self._mapping.frame, source.frame)
        if parent is None:
            raise SessionError(
                f"{source.name}: expected static transforms from {self._mapping.frame!r} to {source.frame!r}; "
                f"there are frames {', '.join(self._tree.frames) or 'none'}"
            )
        return parent @ where

    def _stamp(self, header: Any, log_time: int) -> int:
        """Return the stamp (ns); the time of receipt if the header has none, or if the mapping selects it."""
        stamp = int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
        return stamp if stamp and self._mapping.stamps == HEADER else log_time

    # -- messages

    def _state(self, name: str, object_id: int, frame: str, pose: Placement, twist: Any) -> np.void | None:
        """Return one row of records.STATE; None without a transform. Odometry's twist is in the axes of the body."""
        where = self._placed(name, frame, pose)
        if where is None:
            return None
        state = np.zeros(1, records.STATE)
        state["position"], state["quaternion"], state["id"] = where.position, where.quaternion, object_id
        if twist is None:
            state["flags"] = StateFlag.TWIST_UNKNOWN
        else:
            R_WB = rotation_matrix(where.quaternion)
            state["linear"] = R_WB @ (twist.linear.x, twist.linear.y, twist.linear.z)
            state["angular"] = R_WB @ (twist.angular.x, twist.angular.y, twist.angular.z)
        self.states[name] += 1
        row: np.void = state[0]
        return row

    def _states_of(self, rows: list[tuple[int, np.void]], log_time: int) -> Iterator[Input]:
        """Yield one message for each stamp, the oldest first."""
        for stamp in sorted({stamp for stamp, _ in rows}):
            states = np.array([row for other, row in rows if other == stamp], records.STATE)
            yield Input(Topic.STATES, encode_states(stamp, self._mapping.frame, 0, states), log_time, stamp)

    def _descriptions(self, log_time: int, objects: list[Change], *, snapshot: bool = False) -> Input:
        data = encode_descriptions(log_time, self._mapping.frame, objects, snapshot=snapshot)
        return Input(Topic.SHAPES, data, log_time, log_time)

    def _description(
        self, source: Source, object_id: int, name: str, shapes: tuple[tuple[Shape, Pose], ...], pose: Pose | None
    ) -> ObjectDescription:
        ids = {each.name: each.object_id for each in self._mapping.sources}
        try:
            return ObjectDescription(
                object_id,
                list(shapes),
                name=name,
                static=source.static,
                pose=pose,
                padding=source.padding,
                group=source.group,
                mask=source.mask,
                allowed=tuple(ids[other] for other in source.allowed),
            )
        except CollisionMonitorError as error:
            raise InputError(f"{name}: {error}") from None


def put_transform(tree: TransformTree, stamped: Any, *, static: bool) -> bool:
    """Add a geometry_msgs/TransformStamped to the tree.

    Return False, and leave it out, if its numbers are not finite or its quaternion is not of unit length.
    """
    where = placement(stamped.transform)
    if not (np.isfinite(where.position).all() and np.isfinite(where.quaternion).all()):
        return False
    length = float(np.linalg.norm(where.quaternion))
    if abs(length - 1.0) > 1e-3:
        return False
    where = Placement(where.position, where.quaternion / length)
    tree.put(frame_name(stamped.header.frame_id), frame_name(stamped.child_frame_id), where, static=static)
    return True


def _pose(where: Placement, name: str) -> Pose:
    try:
        return Pose(where.position, where.quaternion)
    except CollisionMonitorError as error:
        raise InputError(f"{name}: {error}") from None


def _check_source(source: Source, kind: str | None, topics: dict[str, str]) -> None:
    if kind is None:
        usable = [f"{topic} ({each})" for topic, each in sorted(topics.items()) if each in list(SourceType)]
        raise SessionError(
            f"{source.name}: expected topic {source.topic} in the bag, got none; "
            f"what can be mapped there is {', '.join(usable) or 'nothing'}"
        )
    if kind not in list(SourceType):
        raise SessionError(f"{source.name}: expected {source.topic} to be one of {', '.join(SourceType)}, got {kind}")
    markers = kind in (SourceType.MARKER, SourceType.MARKERS)
    if markers != (source.marker is not None):
        wanted = "`marker: {ns: …, id: …}`" if markers else "no `marker`"
        raise SessionError(f"{source.name}: {source.topic} is a {kind}; expected {wanted} in the mapping")
    if kind == SourceType.TRANSFORMS and not source.frame:
        raise SessionError(f"{source.name}: {source.topic} is a {kind}; expected `frame: …` in the mapping, got none")
    if kind != SourceType.TRANSFORMS and source.frame:
        raise SessionError(
            f"{source.name}: `frame` is for {SourceType.TRANSFORMS} and static objects; {source.topic} is a {kind}"
        )
