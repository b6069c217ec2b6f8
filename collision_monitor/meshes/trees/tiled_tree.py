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
from collision_monitor.geometry.runs import in_runs
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

    @property
    def room(self) -> int:
        """Blocks that it gets in the tree of a map: a power of two, so that a small change does not move the others."""
        return 1 << (len(self.blocks) - BOXES - 1).bit_length()


def _tile_trees(tiles: Sequence[Array], known: Sequence[TileTree]) -> list[TileTree]:
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
    corners = np.concatenate(tiles)  # also of one: the kernel is compiled for arrays that may be written
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


class MapTree(NamedTuple):
    """The tree of a map (n, ROWS, WIDTH), and the trees of the tiles that it is composed of."""

    blocks: Array
    trees: Sequence[TileTree]


def map_tree(tiles: Sequence[Array], former: MapTree | None = None) -> MapTree:
    """Make the tree of a closed surface, given by the triangles (n, 3, 3) in m of its tiles, at least one.

    former: that of a map with some of the same arrays, whose trees are kept. The answer does not depend on it.
    """
    trees = _tile_trees(tiles, () if former is None else former.trees)
    rooms = np.array([each.room for each in trees])
    first = BOXES * (1 + _boxes_above(len(trees))) + np.cumsum(rooms) - rooms
    changed = None if former is None else _changed(trees, former.trees)
    if former is None or changed is None:
        tree = np.zeros((int(first[-1] + rooms[-1]), ROWS, WIDTH))
        changed = list(range(len(trees)))
    else:
        tree = former.blocks.copy()
    _plant(tree, trees, first, np.array(changed, np.int64))
    _number_faces(tree, trees, first, changed)
    if len(trees) > 1:
        size = -(-len(trees) // WIDTH)
        _fill_above(tree, BOXES, size, BOXES * (1 + size), np.empty(REACHES))
    _state_facts(tree, trees)
    return MapTree(tree, trees)


def _changed(trees: Sequence[TileTree], former: Sequence[TileTree]) -> list[int] | None:
    """Which trees differ from the former ones in the same places; None if they do not fit into those."""
    if len(trees) != len(former):
        return None
    changed = [k for k, (new, old) in enumerate(zip(trees, former, strict=True)) if new is not old]
    return changed if all(trees[k].room == former[k].room for k in changed) else None


def _plant(tree: Array, trees: Sequence[TileTree], first: NDArray[np.int64], tiles: NDArray[np.int64]) -> None:
    """Write the trees of some tiles, each from its first block on, and their boxes to those over the tiles."""
    own = [trees[k] for k in tiles.tolist()]
    if not own:
        return
    sizes = np.array([len(each.blocks) - BOXES for each in own])
    start = first[tiles]
    of, within = in_runs(sizes)
    place = start[of] + within
    for each, at in zip(own, start.tolist(), strict=True):
        tree[at : at + len(each.blocks) - BOXES] = each.blocks[BOXES:]
    child = tree[place, CHILD]
    tree[place, CHILD] = child + np.sign(child) * (start - BOXES)[of, None]
    boxes = np.stack([each.blocks[:BOXES, :, 0] for each in own])
    boxes[:, 0, CHILD] += np.sign(boxes[:, 0, CHILD]) * (start - BOXES)
    above = BOXES * (1 + tiles // WIDTH) if len(trees) > 1 else np.zeros(1, np.int64)
    for row in range(BOXES):
        tree[above + row, :, tiles % WIDTH] = boxes[:, row]


def _number_faces(tree: Array, trees: Sequence[TileTree], first: NDArray[np.int64], changed: list[int]) -> None:
    """Number the faces of all tiles through, from the first one that has changed on."""
    if not changed:
        return
    begin = min(changed)
    count = np.array([len(each.corners) for each in trees])
    leaves = (-(-count // WIDTH))[begin:]
    place = first[begin:] + np.array([len(each.blocks) for each in trees[begin:]]) - BOXES - leaves
    of, within = in_runs(leaves)
    last = (count[begin:] - 1) - WIDTH * (leaves - 1)
    last = np.where(within == (leaves - 1)[of], last[of], WIDTH)
    lanes = np.minimum(np.arange(WIDTH), last[:, None])
    base = (np.cumsum(count) - count)[begin:][of] + WIDTH * within
    tree[place[of] + within, FACE] = base[:, None] + lanes


def _state_facts(tree: Array, trees: Sequence[TileTree]) -> None:
    tree[0, CLOSED, 1], tree[0, REACH, 1] = 1.0, max(each.reach for each in trees)
    tree[0, PARTS, 1] = MOST_PARTS + 1  # more than are stored, so that each triangle is examined
    tree[0, TILES, 1] = len(trees)
    digest = blake2b(b"".join(each.digest for each in trees), digest_size=16).digest()
    tree[0, KEY : KEY + 2, 1] = np.frombuffer(digest)


def map_tiles(blocks: Array, root: int) -> NDArray[np.int64]:
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
