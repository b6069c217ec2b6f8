"""The triangles of a tree in the user's order, from which the same tree can be built again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.meshes.layout import CHILD, CLOSED, CORNERS, FACE, FIRST_PART, MOST_PARTS, PARTS, WIDTH
from collision_monitor.meshes.trees.tiled_tree import map_tiles, map_tree
from collision_monitor.meshes.trees.tree import tree_of

Array = NDArray[np.float64]


class TreeSurface(NamedTuple):
    """What `tree_of` takes: corners (m, 3, 3), whether they bound a solid, a point of each connected part (k, 3).

    tiles: numbers of the triangles of each tile of a map, which has no points of parts; else none.
    """

    corners: Array
    closed: bool
    parts: Array
    tiles: NDArray[np.int64]

    @property
    def tree(self) -> Array:
        """The tree over the triangles."""
        if len(self.tiles):
            return map_tree(np.split(self.corners, np.cumsum(self.tiles)[:-1])).blocks
        return tree_of(self.corners, closed=self.closed, parts=self.parts)


def surface_of(blocks: Array, root: int) -> TreeSurface:
    """The surface of the tree of a mesh that begins at a block."""
    boxes = np.array([root])
    leaves = []
    while len(boxes):
        child = blocks[boxes, CHILD].ravel().astype(np.int64)
        leaves.append(root - child[child < 0])
        boxes = root + child[child > 0]
    members = np.concatenate(leaves)
    face = blocks[members, FACE].ravel().astype(np.int64)
    corners = np.empty((face.max() + 1, 3, 3))
    corners[face] = blocks[members, CORNERS : CORNERS + 9].transpose(0, 2, 1).reshape(-1, 3, 3)
    tiles = map_tiles(blocks, root)
    if len(tiles):
        return TreeSurface(corners, True, np.zeros((0, 3)), tiles)
    first, count = root + int(blocks[root, FIRST_PART, 1]), int(blocks[root, PARTS, 1])
    stored = min(count, MOST_PARTS)
    points = blocks[first : first + -(-stored // WIDTH), :3].transpose(0, 2, 1).reshape(-1, 3)[:stored]
    parts = np.resize(points, (count, 3))  # only the number of the others counts
    return TreeSurface(corners, bool(blocks[root, CLOSED, 1]), parts, tiles)
