"""Markers as objects, with the shapes that they show."""

from __future__ import annotations

import math
from typing import Any, Final

from collision_monitor.errors import CollisionMonitorError, InputError, UnsupportedError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Cylinder, Shape, Sphere
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.tracks import DescribedTrack, TrackTable
from collision_monitor.sources.messages.poses import put_pose

MARKER: Final = "visualization_msgs/msg/Marker"
MARKERS: Final = "visualization_msgs/msg/MarkerArray"

_DELETE, _DELETE_ALL = 2, 3
_CUBE, _SPHERE, _CYLINDER = 1, 2, 3
_ROUND: Final = 1e-6
"""Relative difference up to which two diameters count as equal, because markers are often made from float32."""


class MarkerSource:
    """The marker of one entry, or all markers of its namespace. They stay until deleted or expired."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        if entry.marker is None:
            raise InputError(
                f"{entry.name}: {entry.topic} is a {message_type}; expected `marker: {{ns: …, id: …}}` in the mapping"
            )
        entry.allow_only(("marker", "static", "forget_after", "position_stddev", "estimate_over"), message_type)
        self.topics = {entry.topic: (message_type,)}
        self._entry = entry
        before = mapping.topics[entry.topic]
        self._before = [each.marker for each in before[: before.index(entry)]]
        self._tracks = TrackTable(entry.forget_after if "forget_after" in entry.given else math.inf)
        self._ends: dict[tuple[str, int], int] = {}  # ns at which a lifetime ends

    def begin(self, scene: SourceScene) -> None:
        """See Source. A marker is described when it appears."""

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        for marker in content.markers if hasattr(content, "markers") else (content,):
            key = marker.ns, marker.id
            if marker.action == _DELETE_ALL:
                for other in self._tracks.all_keys():
                    self._tracks.drop(other, scene)
            elif marker.action == _DELETE:
                self._tracks.drop(key, scene)
            elif self._is_ours(key):
                self._show(marker, scene.stamp_of(marker.header, stamp_ns), scene)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.expire(now_ns, scene)
        for key in [key for key, end in self._ends.items() if end < now_ns]:
            del self._ends[key]
            self._tracks.drop(key, scene)

    def _is_ours(self, key: tuple[str, int]) -> bool:
        def selects(marker: tuple[str, int | None] | None) -> bool:
            return marker in (key, (key[0], None))

        return selects(self._entry.marker) and not any(map(selects, self._before))

    def _show(self, marker: Any, stamp_ns: int, scene: SourceScene) -> None:
        entry, key = self._entry, (marker.ns, marker.id)
        is_one = entry.marker == key
        name = entry.name if is_one else f"{entry.name}_{marker.id}"
        frame = scene.locate(name, frame_name(marker.header.frame_id), stamp_ns)
        if frame is None:
            return
        try:
            shapes = entry.shapes or ((marker_shape(marker), Pose()),)
        except CollisionMonitorError as error:
            scene.refuse(name, str(error))
            return
        track = self._tracks.get(key, name, stamp_ns, scene, entry.object_id if is_one else None)
        if track is None:
            return
        lifetime = marker.lifetime.sec * 1_000_000_000 + marker.lifetime.nanosec
        if lifetime > 0:
            self._ends[key] = stamp_ns + lifetime
        else:
            self._ends.pop(key, None)
        states = empty_states([track.object_id])
        put_pose(states, marker.pose)
        if frame is not IDENTITY:
            carry_states(states, frame, None)
        self._describe(track, shapes, states, scene)
        if not entry.static:
            states["flags"] = StateFlag.TWIST_UNKNOWN
            states["position_stddev"] = entry.position_stddev
            scene.observe(states, stamp_ns, window=entry.estimate_over)

    def _describe(self, track: DescribedTrack, shapes: Any, states: Any, scene: SourceScene) -> None:
        shown = [repr(shape) for shape, _ in shapes], states[0].tobytes() if self._entry.static else None
        if shown == track.shape:
            return
        try:
            at = Pose(states["position"][0], states["quaternion"][0]) if self._entry.static else None
            scene.describe(self._entry.describe(track.object_id, track.name, shapes, at=at))
        except CollisionMonitorError as error:
            scene.refuse(track.name, str(error))
            return
        track.shape = shown


def marker_shape(marker: Any) -> Shape:
    """Return the shape that the marker shows. Raises UnsupportedError for an unknown one, ShapeError."""
    x, y, z = marker.scale.x, marker.scale.y, marker.scale.z
    is_round = abs(x - y) <= _ROUND * abs(x)
    if marker.type == _CUBE:
        return Box((x, y, z))
    if marker.type == _SPHERE and is_round and abs(x - z) <= _ROUND * abs(x):
        return Sphere(x / 2)
    if marker.type == _CYLINDER and is_round:
        return Cylinder(x / 2, z)
    raise UnsupportedError(
        f"expected a marker CUBE (1), SPHERE (2) or CYLINDER (3), these with equal diameters, got type {marker.type}; "
        "a `shape` in the mapping takes its place"
    )
