"""Objects that are frames of tf."""

from __future__ import annotations

from typing import Any, Final

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.frames import frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import empty_states
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.poses import require_shape

TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"


class FrameSource:
    """The object of one entry with `frame`: a state whenever its frame, or the nearest moving one above, gets a pose.

    The twist is left to an estimate from successive poses.
    """

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        if not entry.frame:
            raise InputError(f"{entry.name}: {entry.topic} is a {message_type}; expected `frame: …`, got none")
        entry.allow_only(("frame", "position_stddev", "estimate_over"), message_type)
        require_shape(entry)
        self.topics = {entry.topic: (message_type,)}
        self._entry = entry

    def begin(self, scene: SourceScene) -> None:
        """See Source. The feed describes entries with a shape."""

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. The feed has put the transforms into the tree; `stamp_ns` is that of the moved frame."""
        entry = self._entry
        frame = scene.locate(entry.name, entry.frame, stamp_ns)
        if frame is None:
            return
        states = empty_states([entry.object_id])
        states["position"], states["quaternion"] = frame.position, frame.quaternion
        states["flags"] = StateFlag.TWIST_UNKNOWN
        states["position_stddev"] = entry.position_stddev
        scene.observe(states, stamp_ns, window=entry.estimate_over)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""

    def moved_by(self, content: Any, scene: SourceScene) -> Any:
        """Return the header of the transform in this message that moves the object; None if there is none."""
        return header_of(content, scene.frames.nearest_moving(self._entry.frame))


def header_of(content: Any, child: str | None) -> Any:
    """Return the header of the last transform of a TFMessage to a frame; None if there is none."""
    return next((t.header for t in reversed(content.transforms) if frame_name(t.child_frame_id) == child), None)
