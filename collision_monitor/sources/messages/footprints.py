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

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.frames import IDENTITY, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.prisms import prism
from collision_monitor.sources.ground.scene_states import carry_states, empty_states
from collision_monitor.sources.ground.source_scene import SourceScene

FOOTPRINT: Final = "geometry_msgs/msg/PolygonStamped"

Floats = NDArray[np.float64]


class FootprintSource:
    """The object of one entry: a prism of the entry's `height` over the footprint, or a polygon of a plane scene."""

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("height", "shape_tolerance", "position_stddev", "estimate_over"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own; `height` makes it a prism")
        self.topics = {entry.topic: (message_type,)}
        self._entry = entry
        self._corners: Floats | None = None  # (n, 2), in the object's frame

    def begin(self, scene: SourceScene) -> None:
        """See Source. The first footprint describes the object."""
        scene.states[self._entry.name] = 0

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source."""
        entry = self._entry
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            return
        points = np.array([(p.x, p.y, p.z) for p in content.polygon.points], np.float64).reshape(-1, 3)
        if len(points) < 3 or not np.isfinite(points).all():
            scene.refuse(entry.name, f"footprint: expected at least 3 finite corners, got {len(points)}")
            return
        middle, turn = points.mean(0), 0.0
        centred = points[:, :2] - middle[:2]
        if self._corners is not None and len(self._corners) == len(centred):
            turn = _turn(self._corners, centred)
            centred = _turned(centred, -turn)
        if not self._describe(centred, scene):
            return
        states = empty_states([entry.object_id])
        states["position"], states["quaternion"] = middle, (0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2))
        states["flags"] = StateFlag.TWIST_UNKNOWN
        states["position_stddev"] = entry.position_stddev
        if frame is not IDENTITY:
            carry_states(states, frame, None)
        scene.observe(states, stamp_ns, window=entry.estimate_over)

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """See Source."""

    def _describe(self, corners: Floats, scene: SourceScene) -> bool:
        entry, known = self._entry, self._corners
        same = known is not None and known.shape == corners.shape
        if known is not None and same and float(np.abs(known - corners).max()) <= entry.shape_tolerance:
            return True
        try:
            shapes = prism(corners, 0.0, entry.height)
            scene.describe(entry.describe(shapes=shapes, extra_padding=entry.shape_tolerance))
        except CollisionMonitorError as error:
            scene.refuse(entry.name, str(error))
            return False
        self._corners = corners
        return True


def _turn(corners: Floats, others: Floats) -> float:
    """Return the rotation (rad) that best takes centred corners (n, 2) to others."""
    sine = (corners[:, 0] * others[:, 1] - corners[:, 1] * others[:, 0]).sum()
    return math.atan2(sine, (corners * others).sum())


def _turned(points: Floats, angle: float) -> Floats:
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))
