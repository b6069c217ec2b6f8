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
