"""vision_msgs/Detection3DArray: boxes without speeds. The speeds are estimated from successive poses.

A detection with an `id` keeps its track by it. One without continues the nearest track of its class whose predicted
position is within `gate`; the nearest pairs are taken first.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box
from collision_monitor.sources.ground.covariances import usable_blocks
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.track_shapes import held_by, rounded_up
from collision_monitor.sources.ground.tracks import DescribedTrack, TrackTable
from collision_monitor.sources.messages.poses import worst_stddev

DETECTIONS: Final = "vision_msgs/msg/Detection3DArray"

WINDOW: Final = 0.5
"""s of poses from which a speed is estimated, unless the entry has `estimate_over`."""

MOST_DETECTIONS: Final = 1000
"""Detections of a message. Those without ids are compared with all tracks."""

Key = tuple[str, str | int]
"""Class, and id or number."""


class DetectionSource:
    """The detections of one entry, with their own boxes or with the entry's `each`."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        keys = ("covariance", "forget_after", "min_existence", "shape_tolerance", "position_stddev", "estimate_over")
        entry.allow_only((*keys, "each", "gate"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} holds many objects; `each` is the shape of each")
        self.topics = {entry.topic: (message_type,)}
        self._entry = entry
        self._tracks = TrackTable(entry.forget_after)
        self._last: dict[Key, tuple[int, NDArray[np.float64], NDArray[np.float64]]] = {}  # stamp, position, velocity
        self._number = 0

    def begin(self, scene: SourceScene) -> None:
        """See Source. An object is described when it is first detected."""

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        entry = self._entry
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            self._tracks.touch(self._last, stamp_ns)
            return
        if len(content.detections) > MOST_DETECTIONS:
            text = f"expected at most {MOST_DETECTIONS} detections in a message, got {len(content.detections)}"
            scene.refuse(entry.name, text, len(content.detections) - MOST_DETECTIONS)
        found = [it for it in content.detections[:MOST_DETECTIONS] if _score(it) >= entry.min_existence]
        if not found:
            return
        states = empty_states([0] * len(found))
        boxes = [each.bbox.center for each in found]
        states["position"] = [(b.position.x, b.position.y, b.position.z) for b in boxes]
        states["quaternion"] = [(b.orientation.x, b.orientation.y, b.orientation.z, b.orientation.w) for b in boxes]
        states["flags"] = StateFlag.TWIST_UNKNOWN
        states["position_stddev"] = entry.position_stddev
        if entry.covariance:
            self._put_uncertainty(states, found, scene)
        if frame is not IDENTITY:
            carry_states(states, frame, None)
        kept = []
        keys = self._keys(found, states["position"], stamp_ns, scene)
        for k, key in enumerate(keys):
            track = None if key is None else self._tracks.get(key, self._name(key), stamp_ns, scene)
            if key is not None and track is not None and self._describe(track, found[k], scene):
                states["id"][k] = track.object_id
                kept.append(k)
                self._note(key, states["position"][k], stamp_ns)
        if kept:
            scene.observe(states[kept], stamp_ns, window=entry.estimate_over or WINDOW)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.expire(now_ns, scene)
        here = set(self._tracks.all_keys())
        for key in [key for key in self._last if key not in here]:
            del self._last[key]

    # -- which detection is which track

    def _keys(self, found: list[Any], positions: Any, stamp_ns: int, scene: SourceScene) -> list[Key | None]:
        """Return the key of the track of each detection; None for one whose id the message has twice."""
        keys: list[Key | None] = [None] * len(found)
        taken: set[Key] = set()
        for k, each in enumerate(found):
            own: Key = _class(each), each.id
            if each.id and own in taken:
                scene.refuse(self._entry.name, f"id {each.id!r}: expected it once in a message, got it twice")
            elif each.id:
                keys[k] = own
                taken.add(own)
        loose = [k for k, each in enumerate(found) if not each.id]
        pairs = []
        for k in loose:
            for track, (last_ns, position, velocity) in self._last.items():
                if isinstance(track[1], int) and track[0] == _class(found[k]):
                    expected = position + velocity * (stamp_ns - last_ns) * 1e-9
                    distance = math.dist(positions[k], expected)
                    if distance <= self._entry.gate:
                        pairs.append((distance, k, track))
        for _, k, nearest in sorted(pairs):
            if keys[k] is None and nearest not in taken:
                keys[k] = nearest
                taken.add(nearest)
        for k in loose:
            if keys[k] is None:
                self._number += 1
                keys[k] = (_class(found[k]), self._number)
        return keys

    def _name(self, key: Key) -> str:
        return "_".join(filter(None, (self._entry.name, key[0], str(key[1]))))[:200]

    def _note(self, key: Key, position: Any, stamp_ns: int) -> None:
        """Keep the position, and the velocity since the last one, for the next message."""
        velocity = np.zeros(3)
        if key in self._last:
            last_ns, before, _ = self._last[key]
            if stamp_ns > last_ns:
                velocity = (position - before) / ((stamp_ns - last_ns) * 1e-9)
        self._last[key] = stamp_ns, np.array(position), velocity

    # -- what it is

    def _describe(self, track: DescribedTrack, each: Any, scene: SourceScene) -> bool:
        entry = self._entry
        measured = 0, np.array([each.bbox.size.x, each.bbox.size.y, each.bbox.size.z])
        if track.shape is not None and (entry.each or held_by(track.shape, measured, entry.shape_tolerance)):
            return True
        described = rounded_up(measured, entry.shape_tolerance)
        try:
            shapes = entry.each or ((Box(described[1]), Pose()),)
            scene.describe(entry.describe(track.object_id, track.name, shapes))
        except CollisionMonitorError as error:
            scene.refuse(entry.name, f"{track.name}: {error}")
            return track.shape is not None
        track.shape = described
        return True

    def _put_uncertainty(self, states: Any, found: list[Any], scene: SourceScene) -> None:
        none = np.zeros(36)
        given = np.array([it.results[0].pose.covariance if it.results else none for it in found], np.float64)
        blocks = usable_blocks(given)
        worst = worst_stddev(blocks.linear)
        states["position_stddev"] = np.where(np.isnan(worst), states["position_stddev"], worst)
        states["orientation_stddev"] = blocks.stddev
        turns = blocks.yaw_only & (blocks.stddev > 0.0)
        states["flags"][turns] |= np.uint32(StateFlag.YAW_ONLY)
        if wrong := int((~blocks.valid).sum()):
            text = "covariance: expected symmetric matrices without negative eigenvalues; it was ignored"
            scene.refuse(self._entry.name, text, wrong)


def _class(detection: Any) -> str:
    """Return the likeliest class of a detection; empty if it has none."""
    best = max(detection.results, key=lambda it: it.hypothesis.score, default=None)
    return "" if best is None else str(best.hypothesis.class_id)


def _score(detection: Any) -> float:
    return max((float(it.hypothesis.score) for it in detection.results), default=1.0)
