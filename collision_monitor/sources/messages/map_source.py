"""What the sources of maps share: a map comes once, maybe before the transforms that say where it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import FrameMotion, frame_name
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene


class MapSource(Source):
    """The map of one entry, replaced by each message. A map whose frame is not known yet waits for it."""

    speaks = False

    def __init__(self, entry: ObjectEntry, topics: Mapping[str, tuple[str, ...]]) -> None:
        self.name, self.topics, self._entry = entry.name, topics, entry
        self._waiting: Any = None  # a map whose frame is not known yet

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        frame = scene.locate(self.name, frame_name(content.header.frame_id), stamp_ns)
        self._waiting = content if frame is None else None
        if frame is not None:
            self.take_map(content, frame, scene)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        content = self._waiting
        if content is None:
            return
        frame = scene.frames.motion(scene.frame, frame_name(content.header.frame_id), now_ns)
        if isinstance(frame, FrameMotion):
            self._waiting = None
            with scene.guard(self.name):
                self.take_map(content, frame, scene)

    def take_map(self, content: Any, frame: FrameMotion, scene: SourceScene) -> None:
        """Describe the map of a message whose frame is known. Raises InputError, ShapeError, PoseError."""
        raise NotImplementedError


def map_pose(message: Any) -> Pose:
    """The pose of a map in its frame, of a geometry_msgs/Pose; a quaternion of zeros is none. Raises PoseError."""
    p, q = message.position, message.orientation
    quaternion = q.x, q.y, q.z, q.w
    return Pose((p.x, p.y, p.z), quaternion if any(quaternion) else (0.0, 0.0, 0.0, 1.0))
