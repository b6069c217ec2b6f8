"""Upright prisms over polygons: footprints and tracked objects of no simpler shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.geometry.triangulation import convex_parts
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, Polygon, Shape

Floats = NDArray[np.float64]

MOST_CORNERS = 200
"""Corners of a footprint. Cutting a concave one into convex parts takes their square."""


def prism(corners: Floats, low: float, high: float) -> tuple[tuple[Shape, Pose], ...]:
    """Return the prism over a polygon (n, 2) from z = low to z = high (m), in convex parts.

    Without height it is the polygon in the plane. Raises ShapeError.
    """
    if len(corners) > MOST_CORNERS:
        raise ShapeError(f"footprint: expected at most {MOST_CORNERS} corners, got {len(corners)}")
    polygon = Polygon(corners)
    if high == low:
        return ((polygon, Pose()),)
    parts = [np.arange(len(corners))] if is_convex(polygon.points) else convex_parts(polygon.points)
    return tuple((ConvexHull(_extruded(polygon.points[part], low, high)), Pose()) for part in parts)


def _extruded(corners: Floats, low: float, high: float) -> Floats:
    return np.vstack([np.column_stack([corners, np.full(len(corners), z)]) for z in (low, high)])
