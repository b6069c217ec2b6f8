"""Where rays first meet a shape, in the shape's frame; each kind says how (see `rays.py` for the methods)."""

from __future__ import annotations

import numpy as np

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.coordinates import Array
from collision_monitor.shapes.registry import Shape, kind_of


def first_hits(shape: Shape, p: Array, d: Array) -> tuple[Array, Array]:
    """Least t >= 0 (n,), infinite for none, and outward unit normals (n, 3) there, zero inside and for none.

    p (n, 3) m, unit d (n, 3), in the shape's frame. A ray that starts inside meets the solid at t = 0.
    Raises UnsupportedError, InputError.
    """
    kind = kind_of(shape)
    if kind.first_hits is not None:
        return kind.first_hits(shape, p, d)
    if kind.rays is None:
        raise UnsupportedError(f"{type(shape).__name__}: rays are not offered for it")
    best, normals = np.full(len(p), np.inf), np.zeros_like(p)
    for part in kind.rays(shape, p, d):
        meets = (part.enter <= part.leave) & (part.leave >= 0.0)
        t = np.where(meets, np.maximum(part.enter, 0.0), np.inf)
        nearer = t < best
        best[nearer] = t[nearer]
        normals[nearer] = np.where((part.enter >= 0.0)[:, None], part.normal, 0.0)[nearer]
    return best, normals
