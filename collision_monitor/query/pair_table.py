"""The table of two shapes with their trees. It is remembered: to copy 5,000 triangles at each query takes 1 ms."""

from __future__ import annotations

from typing import Final

from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.shapes.forest import Forest
from collision_monitor.shapes.registry import Mesh, Points, Shape
from collision_monitor.shapes.shape_table import ShapeTable, ShapeTableBuilder

REMEMBERED: Final = 256 << 20
"""Bytes of the trees in all remembered tables."""


def _bytes(table: ShapeTable, *arguments: object) -> int:
    return int(table.blocks.nbytes)


@bounded_cache(REMEMBERED, _bytes)
def pair_table(a: Shape, b: Shape, all_trees: bool) -> ShapeTable:
    """Two shapes in slots 0 and 1, with the trees of meshes and clouds; all_trees: of convex solids too."""
    trees = [shape_tree(shape) if all_trees or isinstance(shape, Mesh | Points) else None for shape in (a, b)]
    different = {id(tree): tree for tree in trees if tree is not None}
    builder = ShapeTableBuilder(slots=2, forest=Forest(sum(map(len, different.values()))))
    for shape, tree in zip((a, b), trees, strict=True):
        builder.append(shape, tree=tree)
    return builder.table
