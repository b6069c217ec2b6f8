"""octomap_msgs Octomap: the occupied leaves of an octree as one static object, replaced by each message."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import FrameMotion, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.octomap_leaves import load_octree_readers, octomap_voxels

OCTOMAP: Final = "octomap_msgs/msg/Octomap"

OCCUPIED: Final = 0.5
"""Least probability of an occupied leaf by default, as that of octomap."""


class OctomapSource(Source):
    """The map of one entry. Space that the octree does not hold, and its free leaves, are no obstacle."""

    speaks = False

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("threshold",), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own cells")
        if not entry.threshold < 1.0:
            raise InputError(f"{entry.name}, threshold: expected a probability below 1, got {entry.threshold:g}")
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry
        load_octree_readers()
        self._waiting: Any = None  # a map whose frame is not known yet

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        frame = scene.locate(self._entry.name, frame_name(content.header.frame_id), stamp_ns)
        self._waiting = content if frame is None else None
        if frame is not None:
            self._describe(content, frame, scene)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source. A map comes once, maybe before the transforms that say where it is."""
        if self._waiting is None:
            return
        content = self._waiting
        frame = scene.frames.motion(scene.frame, frame_name(content.header.frame_id), now_ns)
        if isinstance(frame, FrameMotion):
            self._waiting = None
            with scene.guard(self._entry.name):
                self._describe(content, frame, scene)

    def _describe(self, octomap: Any, frame: FrameMotion, scene: SourceScene) -> None:
        entry = self._entry
        voxels = octomap_voxels(octomap, entry.threshold or OCCUPIED)
        if voxels is None:
            scene.remove(entry.object_id)
            return
        at = Pose(np.asarray(frame.position), np.asarray(frame.quaternion))
        scene.describe(entry.describe(shapes=((voxels, Pose()),), at=at))
