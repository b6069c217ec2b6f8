"""The model of an object for which there is no time: its axis-aligned box and a bound on its excess, in linear time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.objects.models import Modelled
from collision_monitor.records import Model
from collision_monitor.shapes.planar import flat_pose, is_planar
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import Box, HalfSpace, Points, Polygon, Shape, kind_of
from collision_monitor.tolerances import ROUNDED_UP

Array = NDArray[np.float64]


def bounding_box_model(shapes: Sequence[tuple[Shape, Pose]]) -> Modelled:
    """Return the model AABB of an object of any shapes, of a Polygon and a Circle in their plane too.

    Its excess is the distance of the object's point that is nearest to the box's centre from the corner that is
    farthest from it: less than the box's diagonal, and more than `containing_model` states.
    Raises UnsupportedError for a HalfSpace, which has no box.
    """
    if any(isinstance(shape, HalfSpace) for shape, _ in shapes):
        raise UnsupportedError("an object with a HalfSpace has no bounding box; describe its other shapes alone")
    planar = is_planar(shapes[0][0])
    placed = [(shape, flat_pose(pose) if planar else pose) for shape, pose in shapes]
    points = [_own_points(shape) @ pose.rotation.T + pose.position for shape, pose in placed]
    round_ones = [(shape, pose) for shape, pose in placed if not _has_corners(shape)]
    outer = np.concatenate(points)
    low, high = outer.min(axis=0), outer.max(axis=0)
    if round_ones:
        low = np.minimum(low, -reach(round_ones, -np.eye(3)))
        high = np.maximum(high, reach(round_ones, np.eye(3)))
    centre = 0.5 * low + 0.5 * high
    half = np.maximum(high - centre, centre - low)
    half = half + ROUNDED_UP * max(float(half.max()), float(np.abs(centre).max()), 1e-300)
    excess = float(np.linalg.norm(np.abs(outer - centre) + half, axis=1).min()) * (1.0 + ROUNDED_UP)
    piece: Shape = Box(2.0 * half)
    if planar:
        piece = Polygon(half[:2] * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]))
    return Modelled([(piece, Pose(centre))], [0], Model.AABB, excess, convex=False)


def _has_corners(shape: Shape) -> bool:
    """Whether a shape is the hull of its points."""
    kind = kind_of(shape)
    return (kind.corners is not None and not kind.simple) or (isinstance(shape, Polygon) and shape.radius == 0.0)


def _own_points(shape: Shape) -> Array:
    """Some points (n, 3) of a shape in its frame: all corners of a polytope, a cloud, the centre of a round shape."""
    kind = kind_of(shape)
    if kind.corners is not None and not kind.simple:  # the centre of a box tells more than its corners
        return np.asarray(kind.corners(shape))
    match shape:
        case Points():
            return np.asarray(shape.points)
        case Polygon():
            return np.pad(shape.points, ((0, 0), (0, 1)))
    return np.zeros((1, 3))
