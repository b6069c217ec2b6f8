"""The core of a shape: the shape without the radius that rounds it, which GJK and EPA work on (see shapes/calls.py)."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.shapes.calls import core_radius


class Core(NamedTuple):
    """A slot of the shape table, in the form that support points read."""

    kind: Any
    size: Any  # three numbers, see ShapeTable
    first: Any  # of a hull's vertices
    count: Any


@inlined
def half_extents(table: Any, slot: int) -> Vector:
    """Half extents (m) of a box: the first three numbers of a shape's size."""
    return table.size[slot, 0], table.size[slot, 1], table.size[slot, 2]


@inlined
def core_of(table: Any, slot: int) -> Core:
    """The core of a shape."""
    return Core(table.kind[slot], half_extents(table, slot), table.vertex_start[slot], table.vertex_count[slot])


class CorePair(NamedTuple):
    """The cores of two shapes, and the vertices (3, V) to which a hull among them refers."""

    A: Core
    B: Core
    vertices_a: Any
    vertices_b: Any


@inlined
def core_pair(table: Any, a: int, b: int) -> CorePair:
    """The cores of two shapes."""
    return CorePair(core_of(table, a), core_of(table, b), table.vertices, table.vertices)


@inlined
def rounding(table: Any, slot: int) -> float:
    """Radius (m) of the sphere that rounds the core, margin included."""
    return core_radius(table, slot) + table.margin[slot]


@inlined
def core_length(table: Any, slot: int) -> float:
    """Scale (m) of the round-off of a core."""
    return table.radius[slot] - table.margin[slot]
