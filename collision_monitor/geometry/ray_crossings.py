"""Where rays meet edges in the plane and triangles in space, by the exact tests of segments.

A ray is replaced by its segment from p to a point behind all edges or faces. Which of them the segment meets is exact,
so no ray passes between two neighbours. (Slides "Line intersection", "Edge intersection face test")
"""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.geometry.coordinates import Array
from collision_monitor.geometry.lines import Relation, intersect
from collision_monitor.geometry.polyhedra import edge_face
from collision_monitor.tolerances import EPSILON

ROUND_OFF: Final = 16 * EPSILON
"""Round-off of a distance as part of the coordinates. Larger: more faces get the exact test. Smaller: a hit is lost."""


def edge_hits(p: Array, d: Array, start: Array, end: Array) -> Array:
    """Distances (n, k) in m along rays p, d (n, 1, 2) to edges (k, 2); infinite for none and for edges along it."""
    middle = (start.min(axis=0) + start.max(axis=0)) / 2
    reach = np.linalg.norm(start - middle, axis=1).max()
    length = 2.0 * (np.linalg.norm(p - middle, axis=-1) + reach)
    found = intersect(p, p + length[..., None] * d, start, end)
    return np.where(found.relation == Relation.POINT, found.t_a * length, np.inf)


def face_hits(p: Array, d: Array, triangles: Array) -> tuple[Array, Array]:
    """First t (n,) of rays on triangles (k, 3, 3), infinite for none, and unit normals (n, 3) against the ray."""
    middle = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - middle[:, None], axis=2).max(axis=1)
    offset = middle - p[:, None]
    along = _dot(offset, d[:, None])
    beside = np.linalg.norm(offset - along[..., None] * d[:, None], axis=-1)
    away = np.linalg.norm(offset, axis=-1)
    noise = ROUND_OFF * (away + np.abs(p).max(axis=1, keepdims=True) + radius)
    i, j = np.nonzero((beside <= radius + noise) & (along >= -radius - noise))
    best, normal = np.full(len(p), np.inf), np.zeros_like(p)
    if len(i) == 0:
        return best, normal
    end = p + 2.0 * (away + radius).max(axis=1, keepdims=True) * d
    met = np.isfinite(edge_face(p[i], end[i], *np.moveaxis(triangles[j], 1, 0)).t)
    i, j = i[met], j[met]
    u, v = triangles[j, 1] - triangles[j, 0], triangles[j, 2] - triangles[j, 0]
    n = np.cross(u, v)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
    extent = _dot(triangles[j] - p[i, None], d[i, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        t = _dot(triangles[j, 0] - p[i], n) / _dot(d[i], n)
    low = np.maximum(extent.min(axis=1), 0.0)  # a face along the ray is met somewhere on its length
    t = np.clip(np.nan_to_num(t, nan=0.0), low, np.maximum(extent.max(axis=1), low))
    order = np.lexsort((t, i))
    ray, head = np.unique(i[order], return_index=True)
    first = order[head]
    best[ray], normal[ray] = t[first], -np.sign(_dot(n[first], d[ray]))[:, None] * n[first]
    return best, normal


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))
