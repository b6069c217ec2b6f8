"""Closest points of two lines, rays or segments in space, as the least-squares problem of the slides.

Each is given by a point and a direction, p + alpha u and q + beta v, as on the slides "Intersecting lines in 3d".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, coordinates
from collision_monitor.geometry.lines import LineKind
from collision_monitor.tolerances import SEGMENT_PARALLEL_SIN2


class ClosestPoints(NamedTuple):
    """Parameters alpha, beta (...), points (..., 3), distance (...), estimated intersection (..., 3); lengths in m.

    The intersection is the midpoint of the two points.
    """

    alpha: Array
    beta: Array
    point_a: Array
    point_b: Array
    distance: Array
    intersection: Array


def closest_points(
    p: ArrayLike,
    u: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    first: LineKind = LineKind.SEGMENT,
    second: LineKind = LineKind.SEGMENT,
) -> ClosestPoints:
    """Minimise |p + alpha u - (q + beta v)| over the extents (line: all, ray: >= 0, segment: 0 … 1); all (..., 3).

    The slides only check that the unbounded solution is in range. If it is not, alpha is clamped, beta is the best
    value for it, clamped too, and alpha the best value for that beta: the minimum of this convex problem (Ericson,
    5.1.8–5.1.9). For parallel lines, the result is the middle of the stretch where they run side by side; if that is
    infinite, its end or, without an end, the solution of least norm. A zero direction represents a point.
    """
    vectors = (coordinates(p, "p", 3), coordinates(u, "u", 3), coordinates(q, "q", 3), coordinates(v, "v", 3))
    try:
        p, u, q, v = np.broadcast_arrays(*vectors)
    except ValueError:
        raise InputError(f"expected shapes that broadcast, got {[vector.shape for vector in vectors]}") from None
    (low_a, high_a), (low_b, high_b) = first.value, second.value
    w = q - p

    def on_b(alpha: Array) -> Array:
        """Beta of the point nearest to the point at alpha."""
        return np.clip(_ratio(_dot(v, alpha[..., None] * u - w), _dot(v, v)), low_b, high_b)

    def on_a(beta: Array) -> Array:
        return np.clip(_ratio(_dot(u, beta[..., None] * v + w), _dot(u, u)), low_a, high_a)

    n = np.cross(u, v)
    parallel = _dot(n, n) <= SEGMENT_PARALLEL_SIN2 * _dot(u, u) * _dot(v, v)
    alpha = np.where(parallel, _beside(u, v, w, first, second), _on_lines(u, v, w))
    alpha = np.clip(alpha, low_a, high_a)
    beta = on_b(alpha)
    alpha = on_a(beta)  # changes only if beta was clamped
    offset = alpha[..., None] * u - (w + beta[..., None] * v)
    point_a, point_b = p + alpha[..., None] * u, q + beta[..., None] * v
    return ClosestPoints(
        alpha, beta, point_a, point_b, np.asarray(np.linalg.norm(offset, axis=-1)), 0.5 * point_a + 0.5 * point_b
    )


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))


def _ratio(top: Array, bottom: Array) -> Array:
    """top / bottom, or 0 if bottom is 0 because of a zero direction."""
    return np.where(bottom > 0.0, top / np.where(bottom > 0.0, bottom, 1.0), 0.0)


def _on_lines(u: Array, v: Array, w: Array) -> Array:
    """alpha of the closest points of two lines; meaningless for parallel ones."""
    n = np.cross(u, v)  # |n|² is the determinant of the normal equations, u.u v.v - (u.v)², which would cancel
    return _ratio(_dot(np.cross(w, v), n), _dot(n, n))


def _beside(u: Array, v: Array, w: Array, first: LineKind, second: LineKind) -> Array:
    """alpha in the middle of the stretch where parallel A, B run side by side; out of A's extent if there is none."""
    start, per_beta = _ratio(_dot(u, w), _dot(u, u)), _ratio(_dot(u, v), _dot(u, u))
    with np.errstate(invalid="ignore"):
        ends = [np.where(per_beta == 0.0, 0.0, per_beta * beta) for beta in second.value]
    low = np.maximum(first.value[0], start + np.minimum(*ends))
    high = np.minimum(first.value[1], start + np.maximum(*ends))
    finite_low, finite_high = np.isfinite(low), np.isfinite(high)
    least_norm = start / (1.0 + per_beta * per_beta)
    one_end = np.where(finite_low, low, np.where(finite_high, high, least_norm))
    both = finite_low & finite_high
    return np.where(both, 0.5 * np.where(both, low, 0.0) + 0.5 * np.where(both, high, 0.0), one_end)
