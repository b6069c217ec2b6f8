"""vision_msgs/Detection3DArray: boxes without speeds. The speeds are estimated from successive poses.

A detection with an `id` keeps its track by it. One without continues the track of its class that `nearest_tracks`
assigns to it, by the predicted positions and within `gate`.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Shape
from collision_monitor.sources.ground.covariances import usable_blocks
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.motion_models import STRAIGHT, MotionModels
from collision_monitor.sources.ground.nearest_tracks import assigned, load_assignment
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.track_shapes import (
    Measured,
    diameter_around,
    held_by,
    rounded_up,
    upright_cylinder,
    with_extent,
)
from collision_monitor.sources.ground.tracks import LONGEST_KEY, DescribedTrack, TrackTable
from collision_monitor.sources.messages.poses import worst_stddev
from collision_monitor.tolerances import LARGEST_INPUT

DETECTIONS: Final = "vision_msgs/msg/Detection3DArray"

WINDOW: Final = 0.5
"""s of poses from which a speed is estimated, unless the entry has `estimate_over`."""

MOST_DETECTIONS: Final = 1000
"""Detections of a message. Those without ids are compared with all tracks."""

_BOX, _CYLINDER = 0, 1

Floats = NDArray[np.float64]
Key = tuple[str, str | int]
"""Class, and id or number."""


class DetectionSource(Source):
    """The detections of one entry, with their own boxes or with the entry's `each`."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        keys = ("covariance", "forget_after", "min_existence", "shape_tolerance", "position_stddev", "estimate_over")
        entry.allow_only((*keys, "each", "gate", "motion"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} holds many objects; `each` is the shape of each")
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry
        self._models = MotionModels(entry.name, entry.motion, STRAIGHT, classes=None)
        self._tracks = TrackTable(entry.name, entry.forget_after)
        self._last: dict[Key, tuple[int, Floats, Floats]] = {}  # stamp, position, velocity
        self._number = 0
        load_assignment()
        self._heard_ns = 0  # stamp of the last message: a detector that is silent does not say that a track is gone

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. An object is described when it is first detected."""
        entry = self._entry
        self._heard_ns = max(self._heard_ns, stamp_ns)
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            self._tracks.touch(self._last, stamp_ns)
            return
        if more := content.detections[MOST_DETECTIONS:]:
            text = f"expected at most {MOST_DETECTIONS} detections in a message, got {len(content.detections)}"
            scene.refuse(entry.name, text, len(more))
            self._keep(more, stamp_ns)
        found = [each for each in content.detections[:MOST_DETECTIONS] if self._is_wanted(each, scene)]
        if not found:
            return
        states = self._states(found, scene)
        if frame is not IDENTITY:
            carry_states(states, frame, None)
        near = (np.abs(states["position"]) <= LARGEST_INPUT).all(1)  # False for NaN
        if not near.all():
            text = f"position: expected finite numbers up to {LARGEST_INPUT:g}, got others"
            scene.refuse(entry.name, text, int((~near).sum()))
            self._keep([each for each, good in zip(found, near.tolist(), strict=True) if not good], stamp_ns)
            found, states = [each for each, good in zip(found, near.tolist(), strict=True) if good], states[near]
        turned = [bool((q == 0.0).all()) for q in states["quaternion"]]
        states["quaternion"][turned] = 0.0, 0.0, 0.0, 1.0
        kept = []
        for k, key in enumerate(self._keys(found, states["position"], stamp_ns, scene)):
            track = None if key is None else self._tracks.get(key, self._track_name(key), stamp_ns, scene)
            if key is not None and track is not None and self._describe(track, found[k], scene, turned=turned[k]):
                states["id"][k] = track.object_id
                kept.append(k)
                self._note(key, states["position"][k], stamp_ns)
        if kept:
            states = states[kept]
            turns = self._models.apply(states, [_class(found[k]) for k in kept], scene.horizon)
            scene.observe(entry.name, states, stamp_ns, window=entry.estimate_over or WINDOW, turns=turns)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.expire(self._heard_ns, scene)
        if len(self._last) > len(self._tracks):
            here = set(self._tracks.all_keys())
            self._last = {key: last for key, last in self._last.items() if key in here}

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""
        self._tracks.restart(now_ns)
        self._last.clear()
        self._heard_ns = now_ns

    def _keep(self, unplaced: list[Any], stamp_ns: int) -> None:
        """Let the tracks stay that detections without a usable place may be: without an id, all such of their class."""
        own = {(_class(each), each.id) for each in unplaced}
        loose = {word for word, name in own if not name}
        touched = (key for key in self._last if key in own or (key[0] in loose and isinstance(key[1], int)))
        self._tracks.touch(touched, stamp_ns)

    def _is_wanted(self, each: Any, scene: SourceScene) -> bool:
        """Whether a detection is likely enough, and of use."""
        score = _score(each)
        if score is not None and score < self._entry.min_existence:
            return False
        for word in (each.id, _class(each)):
            if len(word) > LONGEST_KEY:
                scene.refuse(self.name, f"expected an id and a class of at most {LONGEST_KEY} characters, got longer")
                return False
        return True

    def _states(self, found: list[Any], scene: SourceScene) -> Any:
        """Return the states of detections in the frame of the message, without ids."""
        states = empty_states([0] * len(found))
        boxes = [each.bbox.center for each in found]
        states["position"] = [(b.position.x, b.position.y, b.position.z) for b in boxes]
        states["quaternion"] = [(b.orientation.x, b.orientation.y, b.orientation.z, b.orientation.w) for b in boxes]
        states["flags"] = StateFlag.TWIST_UNKNOWN
        states["position_stddev"] = self._entry.position_stddev
        if self._entry.covariance:
            self._put_uncertainty(states, found, scene)
        return states

    # -- which detection is which track

    def _keys(self, found: list[Any], positions: Any, stamp_ns: int, scene: SourceScene) -> list[Key | None]:
        """Return the key of the track of each detection; None for one whose id the message has twice."""
        keys: list[Key | None] = [None] * len(found)
        taken: set[Key] = set()
        loose: dict[str, list[int]] = {}
        for k, each in enumerate(found):
            own: Key = _class(each), each.id
            if not each.id:
                loose.setdefault(own[0], []).append(k)
            elif own in taken:
                scene.refuse(self._entry.name, f"id {each.id!r}: expected it once in a message, got it twice")
            else:
                keys[k] = own
                taken.add(own)
        for word, rows in loose.items():
            tracks = [key for key in self._last if key[0] == word and isinstance(key[1], int)]
            expected = self._expected(tracks, stamp_ns)
            usable = np.flatnonzero((np.abs(expected) <= LARGEST_INPUT).all(1))
            i, j = assigned(np.asarray(positions[rows]), expected[usable], self._entry.gate)
            for row, column in zip(i.tolist(), usable[j].tolist(), strict=True):
                keys[rows[row]] = tracks[column]
        for k in sorted(k for rows in loose.values() for k in rows if keys[k] is None):
            self._number += 1
            keys[k] = (_class(found[k]), self._number)
        return keys

    def _expected(self, tracks: list[Key], stamp_ns: int) -> Floats:
        """Return where tracks are expected at a stamp, (m, 3)."""
        last = [self._last[key] for key in tracks]
        elapsed = np.array([stamp_ns - stamp for stamp, _, _ in last], np.float64) * 1e-9
        position = np.array([p for _, p, _ in last]).reshape(-1, 3)
        velocity = np.array([v for _, _, v in last]).reshape(-1, 3)
        return np.asarray(position + velocity * elapsed[:, None])

    def _track_name(self, key: Key) -> str:
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

    def _describe(self, track: DescribedTrack, each: Any, scene: SourceScene, *, turned: bool) -> bool:
        """Describe one track if it is new or has changed. turned: in a way that is not known. Return if it is there."""
        entry = self._entry
        size = with_extent(np.array([each.bbox.size.x, each.bbox.size.y, each.bbox.size.z], np.float64))
        measured: Measured = _BOX, size
        if turned:  # the upright cylinder about the box
            measured = _CYLINDER, np.append(np.repeat(diameter_around(size[None, :2]), 2), size[2])
        if track.shape is not None and (entry.each or held_by(track.shape, measured, entry.shape_tolerance)):
            return True
        described = rounded_up(measured, entry.shape_tolerance)
        with scene.guard(entry.name, track.name):
            if not scene.may_describe:
                raise InputError("it waits, because the message has too many new objects at once")
            shapes = entry.each or ((_shape(*described), Pose()),)
            scene.describe(entry.describe(track.object_id, track.name, shapes))
            track.shape = described
        if track.shape is None:
            scene.lacks(entry.name, track.name, scene.last_refusal[entry.name])
            return False
        scene.has(entry.name, track.name)
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


def _shape(kind: int, size: Floats) -> Shape:
    return Box(size) if kind == _BOX else upright_cylinder(size)


def _class(detection: Any) -> str:
    """Return the likeliest class of a detection, the first of several; empty if it has none. NaN is the least."""
    best, most = "", -2.0
    for it in detection.results:
        score = float(it.hypothesis.score)
        score = score if score >= 0.0 else -1.0  # not known
        if score > most:
            best, most = str(it.hypothesis.class_id), score
    return best


def _score(detection: Any) -> float | None:
    """Return the largest score of a detection; None if it has none that is known: negative numbers and NaN are not."""
    known = [float(it.hypothesis.score) for it in detection.results if it.hypothesis.score >= 0.0]
    return max(known, default=None)
