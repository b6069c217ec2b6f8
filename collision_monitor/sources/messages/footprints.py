"""geometry_msgs/PolygonStamped: a footprint, such as nav2's `published_footprint`.

A footprint has corners and no pose. The object's frame is the middle of the first footprint, with its axes; the pose of
a later one with as many corners is the best rotation about z and translation between the two, by least squares. If the
corners then differ by more than `shape_tolerance`, the object gets the new shape. Source: Arun, Huang and Blostein,
Least-squares fitting of two 3-D point sets (1987), in the plane.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import CollisionMonitorError, InputError, ShapeError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.motion_models import STRAIGHT, MotionModels
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.prisms import covering_prism, load_prisms
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.tolerances import LARGEST_INPUT

FOOTPRINT: Final = "geometry_msgs/msg/PolygonStamped"

MOST_FOOTPRINT_POINTS: Final = 10_000
"""Corners of a message. Of more than `prisms.MOST_CORNERS`, the convex hull is monitored."""

Floats = NDArray[np.float64]


class FootprintSource(Source):
    """The object of one entry: a prism of the entry's `height` over the footprint, or a polygon of a plane scene."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("height", "shape_tolerance", "position_stddev", "estimate_over", "motion"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own; `height` makes it a prism")
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry
        self._models = MotionModels(entry.name, entry.motion, STRAIGHT)
        self._corners: Floats | None = None  # (n, 2), in the object's frame
        self._span = np.zeros(2)  # lowest and highest corner in it, if they are not of one height
        load_prisms()
        self._coarse = ""  # why it is not the footprint itself that is described

    def begin(self, scene: SourceScene) -> None:
        """See Source. The first footprint describes the object."""
        scene.states[self._entry.name] = 0

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        entry = self._entry
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            return
        given = content.polygon.points
        if len(given) > MOST_FOOTPRINT_POINTS:
            raise ShapeError(f"footprint: expected at most {MOST_FOOTPRINT_POINTS} corners, got {len(given)}")
        points = np.array([(p.x, p.y, p.z) for p in given], np.float64).reshape(-1, 3)
        usable = (np.abs(points) <= LARGEST_INPUT).all(1)
        if not usable.any():
            raise ShapeError("footprint: expected at least 3 finite corners, got 0")
        middle, turn = points[usable].mean(0), 0.0
        centred = points[:, :2] - middle[:2]
        if self._corners is not None and len(self._corners) == len(centred) and usable.all():
            turn = _turn(self._corners, centred)
            centred = _turned(centred, -turn)
        if not self._describe(centred, self._extent(points[usable, 2] - middle[2]), scene):
            return
        states = empty_states([entry.object_id])
        states["position"], states["quaternion"] = middle, (0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2))
        states["flags"] = StateFlag.TWIST_UNKNOWN
        states["position_stddev"] = entry.position_stddev
        if frame is not IDENTITY:
            carry_states(states, frame, None)
        turns = self._models.apply(states, ("",), scene.horizon)
        scene.observe(entry.name, states, stamp_ns, window=entry.estimate_over, turns=turns)

    def _extent(self, heights: Floats) -> Floats:
        """Return the lowest and the highest of heights (n,) about their mean; zeros where they are one height."""
        span = np.array([heights.min(), heights.max()])
        return span if self._entry.height and np.ptp(span) > self._entry.shape_tolerance else np.zeros(2)

    def _describe(self, corners: Floats, span: Floats, scene: SourceScene) -> bool:
        """Describe the object if its footprint has changed; return whether it is described.

        span: its lowest and highest corner.
        """
        entry, known = self._entry, self._corners
        same = known is not None and known.shape == corners.shape
        same = same and bool((np.abs(span - self._span) <= entry.shape_tolerance).all())
        if known is None or not same or not float(np.abs(known - corners).max()) <= entry.shape_tolerance:
            try:
                shapes, self._coarse = covering_prism(corners, span[0], span[1] + entry.height)
                scene.describe(entry.describe(shapes=shapes, extra_padding=entry.shape_tolerance))
            except CollisionMonitorError as error:
                scene.refuse(entry.name, str(error))
                return known is not None  # what it was last stays, where it is now
            self._corners, self._span = corners, span
            if span.any():
                heights = f"footprint: expected corners of one height, got {np.ptp(span):g} m between them"
                self._coarse = self._coarse or f"{heights}; a prism over all of them is monitored"
        if self._coarse:
            scene.refuse(entry.name, self._coarse)
        return True


def _turn(corners: Floats, others: Floats) -> float:
    """Return the rotation (rad) that best takes centred corners (n, 2) to others; 0 if they are not all finite."""
    if not np.isfinite(corners).all():
        return 0.0
    sine = (corners[:, 0] * others[:, 1] - corners[:, 1] * others[:, 0]).sum()
    return math.atan2(sine, (corners * others).sum())


def _turned(points: Floats, angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))
