"""Static objects of the sources file: each stands at its pose in its frame."""

from __future__ import annotations

from collision_monitor.shapes.pose import Pose, multiply, rotation_matrix
from collision_monitor.sources.ground.frames import FrameMotion
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene


class StandingObjects(Source):
    """Describes the static objects as soon as tf_static connects their frames with the monitor's."""

    name = "objects"
    speaks = False

    def __init__(self, entries: list[ObjectEntry]) -> None:
        self.topics = {}
        self._waiting = entries

    def begin(self, scene: SourceScene) -> None:
        """See Source. Describes the objects in the monitor's frame."""
        ours = [entry for entry in self._waiting if entry.frame in ("", scene.frame)]
        self._waiting = [entry for entry in self._waiting if entry not in ours]
        for entry in ours:
            scene.describe(entry.describe(at=entry.pose or Pose()))
        self._list_missing(scene)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source. Describes the objects whose frames are known by now."""
        placed = []
        for entry in self._waiting:
            frame = scene.frames.motion(scene.frame, entry.frame, now_ns)
            if isinstance(frame, FrameMotion) and not frame.moving:
                with scene.guard(entry.name):  # such as a place too far away
                    scene.describe(entry.describe(at=_placed(frame, entry.pose or Pose())))
                    scene.has(entry.name, entry.name)
                    placed.append(entry)
        if placed:
            self._waiting = [entry for entry in self._waiting if entry not in placed]
        self._list_missing(scene)

    def misplaced(self, scene: SourceScene) -> list[str]:
        """Return the reason for each object that is not described yet."""
        return [f"{entry.name}: {self._reason(entry, scene)}" for entry in self._waiting]

    def _list_missing(self, scene: SourceScene) -> None:
        for entry in self._waiting:
            scene.lacks(entry.name, entry.name, self._reason(entry, scene))

    def _reason(self, entry: ObjectEntry, scene: SourceScene) -> str:
        moving = scene.frames.nearest_moving(entry.frame)
        if moving is not None:
            return (
                f"a static object stands in its frame, but {moving!r} comes by /tf and may move: expected static "
                f"transforms from {scene.frame!r} to {entry.frame!r}, or `topic: /tf` instead of `static: true`"
            )
        known = scene.frames.some_names
        return f"expected static transforms from {scene.frame!r} to {entry.frame!r}; there are frames {known}"


def _placed(frame: FrameMotion, pose: Pose) -> Pose:
    position = frame.position + rotation_matrix(frame.quaternion) @ pose.position
    return Pose(position, multiply(frame.quaternion, pose.quaternion))
