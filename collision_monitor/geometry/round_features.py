"""Features of an outline: the corner or the edge of a polygon or a segment at a point of it.

A shape that is a core grown by a radius has the features of its core.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.geometry.contact_features import Feature, FeatureType
from collision_monitor.geometry.coordinates import Array
from collision_monitor.geometry.points import closest_point_on_segment, point_distance

OUTLINE_TIE: Final = 1e-6
"""A point within this part of the size of a corner is on it; points of GJK are off by up to 1e-7 of the size."""


def feature_of_outline(point: Array, normal: Array, corners: Array) -> Feature:
    """Corner or edge of a polygon or a segment (n, d) at a point (d,) of its boundary, for an outward normal (d,).

    An edge that is perpendicular to the normal touches as a whole; else a corner at the point wins. The edge after
    corner k ends at corner k + 1, and the last one at corner 0.
    """
    tie = OUTLINE_TIE * float(np.ptp(corners, axis=0).max())
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
