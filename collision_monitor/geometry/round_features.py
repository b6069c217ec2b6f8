"""Features of shapes with round parts, and of polygons in the plane, at a point of their surface.

The points that GJK finds on round surfaces are off by up to 1e-7 of the size, so the tolerance is larger than that of
polyhedra. A shape that is a core grown by a radius has the features of its core.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.geometry.contact_features import Feature, FeatureType
from collision_monitor.geometry.coordinates import Array
from collision_monitor.geometry.points import closest_point_on_segment, point_distance

ROUND_TIE: Final = 1e-6
"""A point within this part of the size of a rim or an apex is on it; a direction within this angle (rad) is along an
axis. Larger: a tilted cylinder stands on its face. Smaller: witness points of GJK miss the rim."""

_SURFACE: Final = Feature(FeatureType.SURFACE, (), -1)


def feature_of_cylinder(point: Array, normal: Array, radius: float, length: float) -> Feature:
    """Feature at a point (3,) in the frame of a cylinder, for an outward normal: face 0 is at +z and 1 at -z."""
    tie = ROUND_TIE * (radius + length)
    if abs(normal[2]) <= ROUND_TIE:  # a line of the side touches as a whole
        return _SURFACE
    for face, side in enumerate((1.0, -1.0)):
        if abs(side * point[2] - length / 2) <= tie:
            on_rim = abs(np.hypot(point[0], point[1]) - radius) <= tie
            if on_rim and not _is_along(side * normal):
                return Feature(FeatureType.EDGE, (face,), -1)
            return Feature(FeatureType.FACE, (), face)
    return _SURFACE


def feature_of_cone(point: Array, normal: Array, radius: float, length: float) -> Feature:
    """Feature at a point (3,) in the frame of a cone: its apex is vertex 0, its rim edge 0, its base face 0."""
    tie = ROUND_TIE * (radius + length)
    if point_distance(point, np.array([0.0, 0.0, length / 2])) <= tie:
        return Feature(FeatureType.VERTEX, (0,), -1)
    slope = (length * normal[2] - radius * np.hypot(normal[0], normal[1])) / np.hypot(length, radius)
    if abs(point[2] + length / 2) > tie or abs(slope) <= ROUND_TIE:  # a line of the slant touches as a whole
        return _SURFACE
    if abs(np.hypot(point[0], point[1]) - radius) <= tie and not _is_along(-normal):
        return Feature(FeatureType.EDGE, (0,), -1)
    return Feature(FeatureType.FACE, (), 0)


def feature_of_outline(point: Array, normal: Array, corners: Array) -> Feature:
    """Corner or edge of a polygon or a segment (n, d) at a point (d,) of its boundary, for an outward normal (d,).

    An edge that is perpendicular to the normal touches as a whole; else a corner at the point wins. The edge after
    corner k ends at corner k + 1, and the last one at corner 0.
    """
    tie = ROUND_TIE * float(np.ptp(corners, axis=0).max())
    start = np.arange(len(corners)) if len(corners) > 2 else np.arange(1)
    end = (start + 1) % len(corners)
    away = point_distance(point, closest_point_on_segment(point, corners[start], corners[end])[0])
    level = np.abs((corners - point) @ normal) <= tie
    whole = np.flatnonzero((away <= tie) & level[start] & level[end])
    at = point_distance(point, corners)
    if not len(whole) and at.min() <= tie:
        return Feature(FeatureType.VERTEX, (int(at.argmin()),), -1)
    edge = int(whole[0]) if len(whole) else int(away.argmin())
    return Feature(FeatureType.EDGE, (int(start[edge]), int(end[edge])), -1)


def _is_along(normal: Array) -> bool:
    """Whether a unit vector is along +z."""
    return bool(np.hypot(normal[0], normal[1]) <= ROUND_TIE and normal[2] > 0.0)
