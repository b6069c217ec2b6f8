"""Upright prisms over polygons: footprints and tracked objects of no simpler shape."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.geometry.qhull import qhull
from collision_monitor.geometry.triangulation import convex_parts
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Circle, ConvexHull, Cylinder, Polygon, Shape
from collision_monitor.sources.ground.track_shapes import LEAST_EXTENT
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]
Parts = tuple[tuple[Shape, Pose], ...]

MOST_CORNERS = 200
"""Corners of a footprint. Cutting a concave one into convex parts takes their square."""

SAME_CORNER: Final = 1e-6
"""Distance, as part of the size of a ring, within which neighbouring corners are one: a ring is often closed by its
first corner again, and float32 rounds by 1e-7."""


def load_prisms() -> None:
    """Import what hulls need before messages arrive."""
    covering_prism(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5], [0.5, 0.5], [0.0, 1.0]]), 0.0, 1.0)
    _hull(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))


def prism(corners: Floats, low: float, high: float) -> Parts:
    """Return the prism over a polygon (n, 2) from z = low to z = high (m), in convex parts.

    Without height it is the polygon in the plane. Raises ShapeError.
    """
    if len(corners) > MOST_CORNERS:
        raise ShapeError(f"footprint: expected at most {MOST_CORNERS} corners, got {len(corners)}")
    polygon = Polygon(corners)
    parts = [np.arange(len(corners))] if is_convex(polygon.points) else convex_parts(polygon.points)
    if high == low:
        return ((polygon, Pose()),)
    return tuple((ConvexHull(_extruded(polygon.points[part], low, high)), Pose()) for part in parts)


def covering_prism(corners: Floats, low: float, high: float) -> tuple[Parts, str]:
    """Return the prism over a polygon, or else over what contains it, with the reason: its convex hull, or a disc.

    A ring with a spike, a hole, crossing edges, one or two corners or no size at all is an obstacle too. Raises
    ShapeError if no corner is finite.
    """
    finite = (np.abs(corners) <= LARGEST_INPUT).all(1)
    if not finite.any():
        raise ShapeError("footprint: expected at least 3 finite corners, got 0")
    ring = _distinct(corners[finite])
    reason = f"footprint: expected at least 3 finite corners, got {int(finite.sum())}"
    if len(ring) >= 3:
        reason = f"footprint: expected finite corners, got {int((~finite).sum())} that are not"
    if finite.all() and len(ring) >= 3:
        try:
            return prism(ring, low, high), ""
        except ShapeError as error:
            reason = str(error)
    try:
        return prism(_hull(ring), low, high), f"{reason}; its convex hull is monitored"
    except ShapeError:
        return _disc(ring, low, high), f"{reason}; a disc that contains it is monitored"


def _distinct(corners: Floats) -> Floats:
    """Return the corners that differ from the one before; if that leaves less than three, all of them."""
    size = float(np.ptp(corners, axis=0).max())
    step = np.abs(corners - np.roll(corners, 1, axis=0)).max(1)
    kept = corners[step > SAME_CORNER * size]
    return kept if len(kept) >= 3 else corners


def _hull(corners: Floats) -> Floats:
    """Return the corners of the convex hull, counter-clockwise. Raises ShapeError for corners on one line."""
    middle, size = corners.mean(0), float(np.ptp(corners, axis=0).max())
    hull = qhull((corners - middle) / size) if size > 0.0 and len(corners) >= 3 else None
    if hull is None:
        raise ShapeError("footprint: expected corners that are not on one line")
    return np.asarray(corners[hull.vertices])


def _disc(corners: Floats, low: float, high: float) -> Parts:
    middle = 0.5 * corners.min(0) + 0.5 * corners.max(0)
    radius = max(float(np.hypot(*(corners - middle).T).max()), LEAST_EXTENT)
    at = Pose((*middle, 0.5 * (low + high)))
    return ((Circle(radius) if high == low else Cylinder(radius, high - low), at),)


def _extruded(corners: Floats, low: float, high: float) -> Floats:
    return np.vstack([np.column_stack([corners, np.full(len(corners), z)]) for z in (low, high)])
