"""Axis-aligned box as an argument of kernels: one tuple of six numbers."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined


class Region(NamedTuple):
    """Axis-aligned box by its centre and half extents (m)."""

    x: float
    y: float
    z: float
    hx: float
    hy: float
    hz: float


@inlined
def regions_overlap(a: Any, b: Any) -> Any:
    """Return whether two boxes, Regions or records with the same fields, overlap or touch."""
    return abs(a.x - b.x) <= a.hx + b.hx and abs(a.y - b.y) <= a.hy + b.hy and abs(a.z - b.z) <= a.hz + b.hz


@inlined
def hull_of_regions(a: Any, b: Any) -> Region:
    """The smallest box that contains two."""
    x, y, z = min(a.x - a.hx, b.x - b.hx), min(a.y - a.hy, b.y - b.hy), min(a.z - a.hz, b.z - b.hz)
    hx = 0.5 * (max(a.x + a.hx, b.x + b.hx) - x)
    hy = 0.5 * (max(a.y + a.hy, b.y + b.hy) - y)
    hz = 0.5 * (max(a.z + a.hz, b.z + b.hz) - z)
    return Region(x + hx, y + hy, z + hz, hx, hy, hz)
