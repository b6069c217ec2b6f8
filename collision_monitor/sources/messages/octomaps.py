"""octomap_msgs Octomap: the occupied leaves of an octree as one static object, replaced by each message."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.frames import FrameMotion
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.map_source import MapSource
from collision_monitor.sources.messages.octomap_leaves import load_octree_readers, octomap_voxels

OCTOMAP: Final = "octomap_msgs/msg/Octomap"

OCCUPIED: Final = 0.5
"""Least probability of an occupied leaf by default, as that of octomap."""


class OctomapSource(MapSource):
    """The map of one entry. Space that the octree does not hold, and its free leaves, are no obstacle."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("threshold",), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own cells")
        if not entry.threshold < 1.0:
            raise InputError(f"{entry.name}, threshold: expected a probability below 1, got {entry.threshold:g}")
        super().__init__(entry, {entry.topic: (message_type,)})
        load_octree_readers()

    def take_map(self, content: Any, frame: FrameMotion, scene: SourceScene) -> None:
        """See MapSource."""
        entry = self._entry
        voxels = octomap_voxels(content, entry.threshold or OCCUPIED)
        if voxels is None:
            scene.remove(entry.object_id)
            return
        at = Pose(np.asarray(frame.position), np.asarray(frame.quaternion))
        scene.describe(entry.describe(shapes=((voxels, Pose()),), at=at))
