"""`points_within`: which points of a cloud are near a shape or inside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import PoseError, ShapeError, UnsupportedError
from collision_monitor.objects.models import exact_model
from collision_monitor.query.arguments import Compound
from collision_monitor.query.contact.surface_pair import points_near
from collision_monitor.shapes.compound import shape_pairs
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Points


def points_within(
    cloud: Points, pose: Pose, shape: Compound, shape_pose: Pose, limit: float = 0.0
) -> NDArray[np.bool_]:
    """Which points (n,) of a cloud are within `limit` (m) of a shape or a compound, or inside it, with their radius.

    For the robot that carries the sensor: keep the others. Of an open mesh, only the surface counts. Raises
    ShapeError, PoseError, InputError; UnsupportedError for a plane shape.

    >>> import collision_monitor as cm
    >>> cloud = cm.Points([(0, 0, 0.4), (3, 0, 0)], 0.05)
    >>> own = cm.points_within(cloud, cm.Pose(), cm.Box((1, 1, 1)), cm.Pose())
    >>> cm.Points(cloud.points[~own], cloud.radius)
    Points(1 points, radius=0.05)
    """
    if not isinstance(cloud, Points):
        raise ShapeError(f"cloud: expected Points, got {type(cloud).__name__}")
    for each, name in ((pose, "pose"), (shape_pose, "shape pose")):
        if not isinstance(each, Pose):
            raise PoseError(f"{name}: expected a Pose, got {type(each).__name__}")
    shapes = shape_pairs(shape, "shape")
    if any(is_planar(each) for each, _ in shapes):
        raise UnsupportedError("points_within: expected solid shapes, got Circle or Polygon")
    distance = checked_number(limit, "limit", least=0.0)
    near = np.zeros(len(cloud.points), np.bool_)
    for piece, offset in exact_model(shapes).pieces:
        near |= points_near(cloud.points, cloud.radius, pose, piece, shape_pose @ offset, distance)
    return near
