"""`cast_ray`: where rays or segments first meet a shape of any kind."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import real_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, Booleans, coordinates
from collision_monitor.shapes.compound import Compound, shape_pairs
from collision_monitor.shapes.planar import flat_pose, is_planar
from collision_monitor.shapes.pose import as_pose
from collision_monitor.shapes.ray_casting import first_hits


class RayHits(NamedTuple):
    """distance (...) in m, infinite for no hit; point (..., 3) and outward unit normal (..., 3) in the world frame.

    Without a hit the point is NaN. The normal is zero without a hit, and for a ray that starts inside, at distance 0.

    >>> hits = cast_ray(cm.Sphere(0.5), cm.Pose(), [(0, 0, 2), (0, 1, 2)], (0, 0, -1))
    >>> hits.hit, hits.distance
    (array([ True, False]), array([1.5, inf]))
    """

    distance: Array
    point: Array
    normal: Array

    @property
    def hit(self) -> Booleans:
        """Whether each ray meets the shape (...)."""
        return np.isfinite(self.distance)


def cast_ray(
    shape: Compound, pose: Any, origin: ArrayLike, direction: ArrayLike, length: ArrayLike = np.inf
) -> RayHits:
    """First points of rays on a shape, or a compound given as a list of (shape, pose), at a pose.

    origin (..., 3) m and direction (..., 3) of any length, in the world frame; length (...): of the rays in m. A
    segment from p to q has the direction q - p and the length |q - p|. A closed mesh is solid, an open one a surface.
    For plane shapes, directions lie in the plane. The answer is right for a ray that is moved by some 1e-15 of the
    size of the shape and of its distance from the origin of the ray. So a ray that grazes may count either way, but no
    ray passes between two faces or edges. (Slides "Ray test", "Line intersection")
    Raises ShapeError, PoseError, InputError.

    >>> cast_ray(cm.Box((1, 1, 1)), cm.Pose(), origin=(0, 0, 2), direction=(0, 0, -1)).point
    array([0. , 0. , 0.5])
    """
    pose = as_pose(pose, "pose")
    p, d = coordinates(origin, "origin", 3), coordinates(direction, "direction", 3)
    try:
        limit = real_array(length)
    except (TypeError, ValueError, OverflowError):
        limit = np.array(np.nan)
    if not (limit >= 0.0).all():
        raise InputError(f"length: expected metres of at least 0, got {length!r:.100}")
    size = np.linalg.norm(d, axis=-1, keepdims=True)
    if not (np.isfinite(size) & (size > 0.0)).all():
        raise InputError("direction: expected vectors of a finite length above 0, got others")
    try:
        p, d = np.broadcast_arrays(p, d / size)
        limit = np.broadcast_to(limit, p.shape[:-1]).reshape(-1)
    except ValueError:
        got = f"{p.shape}, {d.shape} and lengths {limit.shape}"
        raise InputError(f"expected origins, directions and lengths that broadcast, got {got}") from None
    shape_of = p.shape[:-1]
    p, d = p.reshape(-1, 3), d.reshape(-1, 3)
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    for each, offset in shape_pairs(shape, "shape"):
        at = flat_pose(pose @ offset) if is_planar(each) else pose @ offset
        t, n = first_hits(each, (p - at.position) @ at.rotation, d @ at.rotation)
        nearer = t < best
        best[nearer], normal[nearer] = t[nearer], (n @ at.rotation.T)[nearer]
    missed = best > limit
    best[missed], normal[missed] = np.inf, 0.0
    met = np.isfinite(best)
    point = np.where(met[:, None], p + np.where(met, best, 0.0)[:, None] * d, np.nan)
    return RayHits(best.reshape(shape_of), point.reshape((*shape_of, 3)), normal.reshape((*shape_of, 3)))
