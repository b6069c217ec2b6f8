"""`contains`: which points are in a shape of any kind."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Booleans, coordinates
from collision_monitor.shapes.compound import Compound, shape_pairs
from collision_monitor.shapes.containment import TESTS, inside
from collision_monitor.shapes.planar import flat_pose, is_planar
from collision_monitor.shapes.pose import as_pose


def contains(shape: Compound, pose: Any, points: ArrayLike, test: str = "closed form") -> Booleans:
    """Whether points (..., 3) in m, in the world frame, are in a shape or a compound at a pose, or on its boundary.

    test: "closed form" for every shape with an inside; "ray" for polygons and polyhedra, by the parity of a ray;
    "sides" for convex ones, by the sides of their edges or faces. Answers for polygons without a radius, hulls and
    meshes are exact for the points in the shape's frame, others for points moved by some 1e-15 of its size. In a mesh,
    "closed form" takes the union of its solids, also where they overlap, and counts a point as contained if faces
    that are not oriented leave it open. Points of two coordinates are in the x-y plane. (Slides "Point in polygon -
    ray test", "Point in convex polygon", "A vertex is inside a convex polyhedron if …") Raises ShapeError, PoseError,
    InputError; UnsupportedError for a shape that the test does not take, and a mesh that is not closed.

    >>> contains(cm.Sphere(0.5), cm.Pose(), [(0, 0, 0.4), (0, 0, 0.6)])
    array([ True, False])
    """
    pose = as_pose(pose, "pose")
    if test not in TESTS:
        raise InputError(f"test: expected one of {', '.join(TESTS)}, got {test!r}")
    given = coordinates(points, "points")
    p = np.zeros((given[..., 0].size, 3))
    p[:, : given.shape[-1]] = given.reshape(-1, given.shape[-1])
    found = np.zeros(len(p), bool)
    for each, offset in shape_pairs(shape, "shape"):
        at = flat_pose(pose @ offset) if is_planar(each) else pose @ offset
        found |= inside(each, (p - at.position) @ at.rotation, test)
    return found.reshape(given.shape[:-1])
