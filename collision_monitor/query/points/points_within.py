"""`points_within`: which points of a cloud are near a shape or inside it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import ShapeError, UnsupportedError
from collision_monitor.query.body import exact_body
from collision_monitor.query.points.near_points import near_points
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import as_pose
from collision_monitor.shapes.registry import Points


def points_within(cloud: Points, pose: Any, shape: Compound, shape_pose: Any, limit: float = 0.0) -> NDArray[np.bool_]:
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
    pose, shape_pose = as_pose(pose, "pose"), as_pose(shape_pose, "shape pose")
    body = exact_body(shape, "shape")
    if body.is_planar:
        plane = " and ".join(sorted({type(each).__name__ for each, _ in body.shapes}))
        raise UnsupportedError(f"points_within: expected solid shapes, got {plane}")
    return near_points(cloud, pose, body, shape_pose, checked_number(limit, "limit", least=0.0))
