"""Trees of the convex shapes of a table, for their pairs with meshes. Shapes without one are searched by GJK."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.meshes.trees.shape_trees import made_tree
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.capsule import CAPSULE
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.shapes.registry import Box, Capsule, ConvexHull, Sphere, Triangle
from collision_monitor.shapes.shape_table import TREE, ShapeTableBuilder

Array = NDArray[np.float64]

NO_TREE: Final = -1.0
"""In place of a tree, for a box or a hull that is too flat for one, so that it is not tried again."""


def slot_tree(table: Any, slot: int) -> Array | None:
    """Tree of the convex shape in a slot, without its margin; None for one that triangles cannot represent."""
    size = table.size[slot]
    match int(table.kind[slot]):
        case kind if kind == SPHERE:
            return made_tree(Sphere(size[0]))
        case kind if kind == CAPSULE:
            return made_tree(Capsule(size[0], 2.0 * size[1]))
        case kind if kind == BOX:
            return made_tree(Box(2.0 * size[:3]))
        case kind if kind == CONVEX_HULL:
            start, count = int(table.vertex_start[slot]), int(table.vertex_count[slot])
            points = np.unique(table.vertices[:, start : start + count].T, axis=0)
            return made_tree(ConvexHull(points) if len(points) > 3 else Triangle(np.resize(points, (3, 3))))
    return None


def plant_trees(builder: ShapeTableBuilder) -> None:
    """Give every convex shape of a table with a mesh the tree that its pairs with meshes need."""
    table = builder.table
    if not (table.kind == MESH).any():
        return
    without = np.isin(table.kind, (SPHERE, CAPSULE, BOX, CONVEX_HULL)) & (table.size[:, TREE] == 0.0)
    for slot in np.flatnonzero(without).tolist():
        tree = slot_tree(table, slot)
        if tree is not None:
            builder.plant(slot, tree)
        else:
            table.size[slot, TREE] = NO_TREE
