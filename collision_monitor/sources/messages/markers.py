"""Markers as objects, with the shapes that they show."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Cylinder, Shape, Sphere
from collision_monitor.sources.ground.frames import IDENTITY, FrameMotion, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.track_shapes import with_extent
from collision_monitor.sources.ground.tracks import MOST_TRACKS, DescribedTrack, TrackTable
from collision_monitor.sources.messages.marker_arrays import ADD, DELETE, MARKER, MARKERS, MarkerArrays

__all__ = ["MARKER", "MARKERS", "MarkerSource", "marker_shape"]

MARKERS_AT_ONCE: Final = 500
"""Markers that waited and are shown together."""

_CUBE, _SPHERE, _CYLINDER = 1, 2, 3
_ROUND: Final = 1e-6
"""Relative difference up to which two diameters count as equal, because markers are often made from float32."""

Floats = NDArray[np.float64]


class MarkerSource(Source):
    """The marker of one entry, or all markers of its namespace. They stay until deleted or expired.

    DELETEALL deletes the markers of its namespace; without one, those of all. A marker that a message deletes and adds
    again has never been away.
    """

    speaks = False

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        if entry.marker is None:
            raise InputError(
                f"{entry.name}: {entry.topic} is a {message_type}; expected `marker: {{ns: …, id: …}}` in the mapping"
            )
        entry.allow_only(("marker", "static", "forget_after", "position_stddev", "estimate_over"), message_type)
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry
        self._namespace, self._only = entry.marker
        before = mapping.topics[entry.topic]
        taken = [each.marker for each in before[: before.index(entry)] if each.marker is not None]
        self._taken = {number for namespace, number in taken if namespace == self._namespace}  # by lines before
        forget_after = entry.forget_after if "forget_after" in entry.given else math.inf
        self._tracks = TrackTable(entry.name, forget_after)
        self._waiting: dict[int, tuple[MarkerArrays, int, int]] = {}  # by id: message, row and stamp, to be described
        self._unusable: dict[int, tuple[int, float]] = {}  # by id: stamp, and ns until it is gone; they are listed
        self._forget_after = forget_after * 1e9

    def take(self, topic: str, content: MarkerArrays, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. A marker is described when it appears."""
        cleared = max(content.cleared.get("", -1), content.cleared.get(self._namespace, -1))
        last = content.last.get(self._namespace, {})
        if self._only is not None:
            last = {self._only: last[self._only]} if self._only in last else {}
        shown = {}
        for number, row in last.items():
            if content.actions[row] == DELETE:
                self._drop(number, scene)
            elif row > cleared and not self._taken & {number, None}:
                shown[number] = row
        if cleared >= 0:
            for key in self._tracks.all_keys():
                if key not in shown:
                    self._tracks.drop(key, scene)
            self._waiting.clear()
            self._unusable.clear()
            scene.unmonitored.drop(self.name, f"{self.name}_")
        self._show(content, list(shown.values()), stamp_ns, scene)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        if self._waiting and scene.may_describe:
            by_message: dict[tuple[int, int], list[int]] = {}
            contents = {}
            for number in list(self._waiting)[:MARKERS_AT_ONCE]:
                content, row, stamp = self._waiting.pop(number)
                contents[id(content)] = content
                by_message.setdefault((id(content), stamp), []).append(row)
            for (which, stamp), rows in by_message.items():
                self._show(contents[which], rows, stamp, scene)
        self._tracks.expire(now_ns, scene)
        for number in [number for number, (seen, life) in self._unusable.items() if now_ns - seen > life]:
            del self._unusable[number]
            scene.has(self.name, self._marker_name(number))  # what is gone is not missing

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.restart(now_ns)
        self._unusable = {number: (now_ns, life) for number, (_, life) in self._unusable.items()}
        messages = {id(content): content for content, _, _ in self._waiting.values()}
        unstamped = {key: replace(each, stamps=[0] * len(each.stamps)) for key, each in messages.items()}
        self._waiting = {
            number: (unstamped[id(content)], row, now_ns) for number, (content, row, _) in self._waiting.items()
        }

    def _drop(self, number: int, scene: SourceScene) -> None:
        self._tracks.drop(number, scene)
        self._waiting.pop(number, None)
        self._unusable.pop(number, None)
        scene.has(self.name, self._marker_name(number))

    def _show(self, content: MarkerArrays, rows: list[int], stamp_ns: int, scene: SourceScene) -> None:
        """Show rows of a message, each of another marker: those of one frame and stamp together."""
        groups: dict[tuple[str, int], list[int]] = {}
        for row in rows:
            with scene.guard(self.name, str(content.ids[row])):
                if content.actions[row] != ADD:
                    action = content.actions[row]
                    raise InputError(f"action: expected 0 (ADD), 2 (DELETE) or 3 (DELETEALL), got {action}")
                stamp = scene.time.part_stamp(content.stamps[row], stamp_ns)
                groups.setdefault((content.frames[row], stamp), []).append(row)
        for (frame, stamp), some in groups.items():
            with scene.guard(self.name):
                at = scene.locate(self.name, frame_name(frame), stamp)
                if at is None:
                    self._tracks.touch([content.ids[row] for row in some], stamp)
                else:
                    self._show_in_frame(content, some, at, stamp, scene)

    def _show_in_frame(
        self, content: MarkerArrays, rows: list[int], at: FrameMotion, stamp_ns: int, scene: SourceScene
    ) -> None:
        entry = self._entry
        states = empty_states([0] * len(rows))
        poses = content.poses[rows]
        states["position"], states["quaternion"] = poses[:, :3], poses[:, 3:]
        states["quaternion"][~poses[:, 3:].any(1)] = 0.0, 0.0, 0.0, 1.0  # as RViz takes it
        if at is not IDENTITY:
            carry_states(states, at, None)
        kept = []
        for k, row in enumerate(rows):
            track = self._described(content, row, states[k], stamp_ns, scene)
            if track is not None:
                track.seen_ns, track.lifetime_ns = max(track.seen_ns, stamp_ns), max(content.lifetimes[row], 0)
                states["id"][k] = track.object_id
                kept.append(k)
        if kept and not entry.static:
            states["flags"] = StateFlag.TWIST_UNKNOWN
            states["position_stddev"] = entry.position_stddev
            scene.observe(entry.name, states[kept], stamp_ns, window=entry.estimate_over)

    def _marker_name(self, number: int) -> str:
        return f"{self.name}_{number}" if self._only is None else self.name

    def _described(
        self, content: MarkerArrays, row: int, state: Any, stamp_ns: int, scene: SourceScene
    ) -> DescribedTrack | None:
        """Describe a marker if it is new or has changed. Return its track; None if it is not described."""
        entry, number = self._entry, content.ids[row]
        track = self._tracks.known(number)
        before = None if track is None else track.shape
        place = (*state["position"].tolist(), *state["quaternion"].tolist()) if entry.static else ()
        shown = content.kinds[row], *content.scales[row].tolist(), place
        if before == shown:
            return track
        name = self._marker_name(number)
        if not scene.may_describe:
            if number not in self._waiting and len(self._waiting) + len(self._tracks) >= MOST_TRACKS:
                scene.refuse(self.name, f"expected at most {MOST_TRACKS} objects of one entry, with those that wait")
                return None if before is None else track
            self._waiting[number] = content, row, stamp_ns
            scene.lacks(entry.name, name, "it waits, because a message had too many new markers at once")
            return None if before is None else track
        with scene.guard(entry.name, "" if name == entry.name else name):
            shapes = entry.shapes or ((marker_shape(content.kinds[row], content.scales[row]), Pose()),)
            at = Pose(state["position"], state["quaternion"]) if entry.static else None
            own_id = entry.object_id if self._only is not None else None
            track = self._tracks.get(number, name, stamp_ns, scene, own_id)
            if track is None:
                return None
            scene.describe(entry.describe(track.object_id, name, shapes, at=at))
            track.shape = shown
            self._unusable.pop(number, None)
            scene.has(entry.name, name)
            return track
        if before is None:
            scene.lacks(entry.name, name, scene.last_refusal[entry.name])
            life = min(max(content.lifetimes[row], 0) or math.inf, self._forget_after)
            if number in self._unusable or len(self._unusable) < MOST_TRACKS:
                self._unusable[number] = stamp_ns, life
            return None
        return track  # what it showed before stays, where it is now


def marker_shape(kind: int, scale: Floats) -> Shape:
    """Return the shape that a marker of a kind and scale (3,) shows. Raises UnsupportedError, ShapeError."""
    x, y, z = with_extent(scale).tolist()
    is_round = abs(x - y) <= _ROUND * abs(x)
    if kind == _CUBE:
        return Box((x, y, z))
    if kind == _SPHERE and is_round and abs(x - z) <= _ROUND * abs(x):
        return Sphere(x / 2)
    if kind == _CYLINDER and is_round:
        return Cylinder(x / 2, z)
    raise UnsupportedError(
        f"expected a marker CUBE (1), SPHERE (2) or CYLINDER (3), these with equal diameters, got type {kind}; "
        "a `shape` in the mapping takes its place"
    )
