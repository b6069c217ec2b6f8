"""Objects that are frames of tf."""

from __future__ import annotations

from typing import Any

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.motion_models import ARC, MotionModels
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import empty_states
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.poses import require_shape
from collision_monitor.sources.messages.transform_arrays import TRANSFORMS

__all__ = ["TRANSFORMS", "FrameSource"]


class FrameSource(Source):
    """The object of one entry with `frame`: a state whenever its frame, or the nearest moving one above, gets a pose.

    The twist is left to an estimate from successive poses.
    """

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        if not entry.frame:
            raise InputError(f"{entry.name}: {entry.topic} is a {message_type}; expected `frame: …`, got none")
        entry.allow_only(("frame", "position_stddev", "estimate_over", "motion"), message_type)
        require_shape(entry)
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self.frame = entry.frame
        self._entry = entry
        self._models = MotionModels(entry.name, entry.motion, ARC)

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
        turns = self._models.apply(states, ("",), scene.horizon)
        scene.observe(entry.name, states, stamp_ns, window=entry.estimate_over, turns=turns)

    def moved_by(self, scene: SourceScene) -> str | None:
        """Return the frame whose transforms move the object; None if there is none."""
        return scene.frames.nearest_moving(self._entry.frame)
