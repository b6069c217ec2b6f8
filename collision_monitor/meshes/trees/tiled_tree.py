"""Tree over the triangles of a map: a tree for each tile, and boxes over the tiles.

The triangles of a tile come in the order of a space-filling curve, so that boxes around runs of them are small. A tile
that has not changed keeps its tree, so that an update of a map makes those of a few tiles, and the boxes above.
(Kamel, Faloutsos, On packing R-trees, 1993)
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import blake2b
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor.geometry.vector import minus
from collision_monitor.meshes.layout import (
    AXES,
    BOXES,
    CENTER,
    CHILD,
    CLOSED,
    CORNERS,
    FACE,
    HALF,
    KEY,
    MOST_PARTS,
    PARTS,
    REACH,
    ROWS,
    TILES,
    WIDTH,
)
from collision_monitor.meshes.supports import REACHES, extend, extend_by_box, write_supports
from collision_monitor.meshes.trees.box_fit import CONTAINED

Array = NDArray[np.float64]

MOST_TOGETHER: Final = 1 << 16
"""Most triangles of the tiles whose trees are made in one array, which lives as long as one of them."""


class TileTree(NamedTuple):
    """The tree of a tile: its triangles (n, 3, 3) in m, its blocks, distance of its farthest point (m), its digest."""

    corners: Array
    blocks: Array
    reach: float
    digest: bytes


def tile_trees(tiles: Sequence[Array], known: Sequence[TileTree] = ()) -> list[TileTree]:
    """Make the tree of each tile, given by its triangles (n, 3, 3) in m; the trees of the same arrays are kept."""
    found = {id(each.corners): each for each in known}
    new = [tile for tile in tiles if id(tile) not in found]
    while new:
        count = 1 + int(np.searchsorted(np.cumsum([len(tile) for tile in new[1:]]), MOST_TOGETHER))
        for each in _made(new[:count]):
            found[id(each.corners)] = each
        new = new[count:]
    return [found[id(tile)] for tile in tiles]


def _made(tiles: list[Array]) -> list[TileTree]:
    corners = tiles[0] if len(tiles) == 1 else np.concatenate(tiles)
    begin = np.cumsum([0, *map(len, tiles)])
    first = np.cumsum([0, *(_number_of_blocks(len(tile)) for tile in tiles)])
    blocks = np.zeros((int(first[-1]), ROWS, WIDTH))
    far = np.empty(len(tiles))
    _fill_tiles(corners, begin, first, blocks, np.empty(REACHES), far)
    far = np.nextafter(np.sqrt(far) * (1.0 + CONTAINED), np.inf)
    return [
        TileTree(tile, blocks[first[k] : first[k + 1]], float(far[k]), blake2b(tile.data, digest_size=16).digest())
        for k, tile in enumerate(tiles)
    ]


def tiled_tree(trees: Sequence[TileTree]) -> Array:
    """Compose the tree of a closed surface of the trees of its tiles, at least one; its faces are numbered through."""
    count = len(trees)
    above = _boxes_above(count)
    sizes = np.array([len(each.blocks) - BOXES for each in trees])
    first = BOXES * (1 + above) + np.cumsum(sizes) - sizes
    tree = np.concatenate([np.zeros((BOXES * (1 + above), ROWS, WIDTH)), *(each.blocks[BOXES:] for each in trees)])
    child = tree[BOXES * (1 + above) :, CHILD]
    child += np.sign(child) * np.repeat(first - BOXES, sizes)[:, None]
    faces = np.array([len(each.corners) for each in trees])
    leaves = -(-faces // WIDTH)
    within = np.arange(leaves.sum()) - np.repeat(np.cumsum(leaves) - leaves, leaves)
    tree[np.repeat(first + sizes - leaves, leaves) + within, FACE] += np.repeat(np.cumsum(faces) - faces, leaves)[
        :, None
    ]
    boxes = np.stack([each.blocks[:BOXES, :, 0] for each in trees])
    boxes[:, 0, CHILD] += np.sign(boxes[:, 0, CHILD]) * (first - BOXES)
    k = np.arange(count)
    for row in range(BOXES):
        tree[(BOXES if count > 1 else 0) + BOXES * (k // WIDTH) + row, :, k % WIDTH] = boxes[:, row]
    if count > 1:
        size = -(-count // WIDTH)
        _fill_above(tree, BOXES, size, BOXES * (1 + size), np.empty(REACHES))
    _state_facts(tree, trees)
    return tree


def _state_facts(tree: Array, trees: Sequence[TileTree]) -> None:
    tree[0, CLOSED, 1], tree[0, REACH, 1] = 1.0, max(each.reach for each in trees)
    tree[0, PARTS, 1] = MOST_PARTS + 1  # more than are stored, so that each triangle is examined
    tree[0, TILES, 1] = len(trees)
    digest = blake2b(b"".join(each.digest for each in trees), digest_size=16).digest()
    tree[0, KEY : KEY + 2, 1] = np.frombuffer(digest)


def tiles_of(blocks: Array, root: int) -> NDArray[np.int64]:
    """Numbers of triangles of the tiles of the tree that begins at a block; none for a tree without tiles."""
    count = int(blocks[root, TILES, 1])
    if not count:
        return np.zeros(0, np.int64)
    members = blocks[root, CHILD, :1].astype(np.int64)
    while len(members) < count:  # down the boxes over the tiles, of which each level is eight times as long
        children = blocks[root + members, CHILD].ravel().astype(np.int64)
        members = children[children != 0]
    last = members.copy()
    while (last > 0).any():
        inner = np.flatnonzero(last > 0)
        children = blocks[root + last[inner], CHILD].astype(np.int64)
        last[inner] = children[np.arange(len(inner)), (children != 0).sum(axis=1) - 1]
    ends = blocks[root - last, FACE].max(axis=1).astype(np.int64) + 1
    return np.diff(ends, prepend=0)


def _boxes_above(size: int) -> int:
    """Number of blocks of boxes over so many members, up to a single one."""
    boxes = 0
    while size > 1:
        size = -(-size // WIDTH)
        boxes += size
    return boxes


def _number_of_blocks(triangles: int) -> int:
    leaves = -(-triangles // WIDTH)
    return BOXES * (1 + _boxes_above(leaves)) + leaves


@device
def _write_box_of(blocks: Any, block: int, is_leaf: bool, child: int, box: int, member: int, reach: Any) -> None:
    """Write the box around a block of triangles, or of boxes along x, y and z, to a member of a block of boxes."""
    at = CORNERS if is_leaf else CENTER
    lx = ly = lz = np.inf
    hx = hy = hz = -np.inf
    for lane in range(WIDTH):
        if not is_leaf and blocks[block, CHILD, lane] == 0.0:
            break
        for i in range(3 if is_leaf else 1):
            x, y, z = (
                blocks[block, at + 3 * i, lane],
                blocks[block, at + 3 * i + 1, lane],
                blocks[block, at + 3 * i + 2, lane],
            )
            a, b, c = 0.0, 0.0, 0.0
            if not is_leaf:
                a, b, c = blocks[block, HALF, lane], blocks[block, HALF + 1, lane], blocks[block, HALF + 2, lane]
            lx, ly, lz = min(lx, x - a), min(ly, y - b), min(lz, z - c)
            hx, hy, hz = max(hx, x + a), max(hy, y + b), max(hz, z + c)
    slack = CONTAINED * (max(abs(lx), abs(hx)) + max(abs(ly), abs(hy)) + max(abs(lz), abs(hz)))
    own = lx + 0.5 * (hx - lx), ly + 0.5 * (hy - ly), lz + 0.5 * (hz - lz)
    half = 0.5 * (hx - lx), 0.5 * (hy - ly), 0.5 * (hz - lz)
    for c in range(3):
        blocks[box, AXES + 4 * c, member] = 1.0
        blocks[box, CENTER + c, member] = own[c]
        blocks[box, HALF + c, member] = half[c] + slack
    blocks[box, CHILD, member] = child
    reach[:] = -np.inf
    for lane in range(WIDTH):
        if not is_leaf and blocks[block, CHILD, lane] == 0.0:
            break
        for i in range(3 if is_leaf else 1):
            arm = (
                blocks[block, at + 3 * i, lane],
                blocks[block, at + 3 * i + 1, lane],
                blocks[block, at + 3 * i + 2, lane],
            )
            if is_leaf:
                extend(minus(arm, own), 0.0, reach)
            else:
                extend_by_box(minus(arm, own), blocks, block, lane, reach)
    write_supports(reach, slack, blocks, box, member)


@device
def _write_levels(blocks: Any, base: int, first: int, size: int, is_leaf: bool, free: int, reach: Any) -> None:
    """Write the boxes over a level of blocks, up to one in the block `base`. free: first block for them."""
    while size > 1:
        for k in range(size):
            block = first + (k if is_leaf else BOXES * k)
            child = base - block if is_leaf else block - base
            _write_box_of(blocks, block, is_leaf, child, free + BOXES * (k // WIDTH), k % WIDTH, reach)
        first, size, is_leaf = free, (size + WIDTH - 1) // WIDTH, False
        free += BOXES * size
    _write_box_of(blocks, first, is_leaf, base - first if is_leaf else first - base, base, 0, reach)


@kernel
def _fill_above(blocks: Any, first: int, size: int, free: int, reach: Any) -> None:
    """Write the boxes over a level of blocks of boxes. reach (REACHES,): scratch memory."""
    _write_levels(blocks, 0, first, size, False, free, reach)


@kernel
def _fill_tiles(corners: Any, begin: Any, start: Any, blocks: Any, reach: Any, far: Any) -> None:
    """Write the tree of each tile from its start on, and the largest squared distance from the origin (T,)."""
    for tile in range(len(far)):
        base, n = start[tile], begin[tile + 1] - begin[tile]
        leaves = (n + WIDTH - 1) // WIDTH
        first = start[tile + 1] - leaves
        far[tile] = 0.0
        for lane in range(WIDTH * leaves):
            k = begin[tile] + min(lane, n - 1)
            block, member = first + lane // WIDTH, lane % WIDTH
            for i in range(3):
                square = 0.0
                for c in range(3):
                    x = corners[k, i, c]
                    blocks[block, CORNERS + 3 * i + c, member] = x
                    square += x * x
                far[tile] = max(far[tile], square)
            blocks[block, FACE, member] = k - begin[tile]
        _write_levels(blocks, base, first, leaves, True, base + BOXES, reach)
