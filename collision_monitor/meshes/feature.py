"""Feature of a triangle or a point of a tree that is farthest along a direction."""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import device
from collision_monitor.meshes.layout import FACE as NUMBER
from collision_monitor.meshes.nearest import triangle_at
from collision_monitor.narrow_phase.contact_row import EDGE, FACE, VERTEX
from collision_monitor.narrow_phase.vector import Vector, dot
from collision_monitor.tolerances import FEATURE_TIE


@device
def triangle_feature(blocks: Any, block: int, k: int, n: Vector, size: float) -> tuple[float, float]:
    """Type (contact_row.py) and index of the feature of a triangle that is farthest along n; size (m): of its mesh.

    Face f has the index f. Its corner c has 3 f + c, as in `faces.ravel()`, and so has its edge from that corner on.
    """
    T, number = triangle_at(blocks, block, k), blocks[block, NUMBER, k]
    a, b, c = dot(T.a, n), dot(T.b, n), dot(T.c, n)
    level = max(a, max(b, c)) - FEATURE_TIE * size
    touching = (a >= level) + (b >= level) + (c >= level)
    if touching == 3:
        return FACE, number
    if touching == 1:
        return VERTEX, 3.0 * number + (0.0 if a >= level else (1.0 if b >= level else 2.0))
    return EDGE, 3.0 * number + (1.0 if a < level else (2.0 if b < level else 0.0))
