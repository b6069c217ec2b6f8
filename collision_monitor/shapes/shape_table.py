"""All shapes as one structure of arrays, which the kernels read instead of shape objects.

The dtypes and the memory order never depend on the content, so that adding a shape compiles nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nextafter
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit.vectors import LANES
from collision_monitor.errors import InputError, ShapeError, UnsupportedError
from collision_monitor.shapes.forest import REACH, Forest
from collision_monitor.shapes.kind import Row
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL, TRIANGLE_RING
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.points import POINTS
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import SUPPORTED_SHAPES, Points, Shape, kind_of

Array = NDArray[np.float64]

TREE: Final = 3
"""Column of `size` with the first block of the shape's tree plus 1, or 0; a half-space has its offset there."""

_UPRIGHT: Final = np.eye(3)

SHARED: Final = ("vertices", "vertex_index", "blocks")
"""Fields of a table without a row for each slot."""


class ShapeTable(NamedTuple):
    """K slots of shapes, and the hull vertices (m). A slot with kind 0 is free. Kernels take this as one argument.

    What the numbers of `size` mean stands at `row` of each kind (kinds/), and whether its radius is part of the margin.
    The last number of all kinds but the half-space is its tree (TREE); a mesh and a cloud always have one, and nothing
    else.
    Hull vertices come in blocks padded to a multiple of LANES with the last vertex, so that the support scan has no
    tail.
    """

    kind: Any  # (K,) uint8, records.ShapeType
    size: Any  # (K, 4) float64
    margin: Any  # (K,) float64: radius of the sphere by which the shape is enlarged (m)
    radius: Any  # (K,) float64: radius of the bounding sphere about the shape's origin, including the margin (m)
    vertex_start: Any  # (K,) int32
    vertex_count: Any  # (K,) int32, a multiple of LANES; 0 if the shape has no vertices
    vertices: Any  # (3, V) float64: all x, all y, all z
    vertex_index: Any  # (V,) int32: the vertex's index in the user's points
    local_position: Any  # (K, 3) float64: position of the shape in its object's frame (m)
    local_rotation: Any  # (K, 3, 3) float64
    blocks: Any  # (N, 16, 8) float64: the trees, see meshes.layout


def _empty(slots: int, vertices: int) -> ShapeTable:
    return ShapeTable(
        kind=np.zeros(slots, np.uint8),
        size=np.zeros((slots, 4)),
        margin=np.zeros(slots),
        radius=np.zeros(slots),
        vertex_start=np.zeros(slots, np.int32),
        vertex_count=np.zeros(slots, np.int32),
        vertices=np.zeros((3, vertices)),
        vertex_index=np.zeros(vertices, np.int32),
        local_position=np.zeros((slots, 3)),
        local_rotation=np.tile(_UPRIGHT, (slots, 1, 1)),
        blocks=np.zeros((1, 16, 8)),
    )


def _resized(table: ShapeTable, slots: int, vertices: int) -> ShapeTable:
    new = _empty(slots, vertices)
    for source, target in zip(table[:-1], new[:-1], strict=True):
        target[tuple(slice(n) for n in source.shape)] = source
    return new._replace(blocks=table.blocks)


def take(table: ShapeTable, slots: NDArray[np.int_]) -> ShapeTable:
    """Return a table of these slots in this order; a slot may occur several times. Vertices and trees are shared."""
    rows = {name: getattr(table, name)[slots] for name in table._fields if name not in SHARED}
    return table._replace(**rows)


def join(tables: Sequence[ShapeTable]) -> ShapeTable:
    """Concatenate several tables of shapes without trees into one, in order."""
    columns = {name: [getattr(table, name) for table in tables] for name in ShapeTable._fields[:-1]}
    start = np.cumsum([0] + [len(index) for index in columns["vertex_index"][:-1]])
    columns["vertex_start"] = [each + np.int32(at) for each, at in zip(columns["vertex_start"], start, strict=True)]
    rows = {name: np.concatenate(each, axis=int(name == "vertices")) for name, each in columns.items()}
    return ShapeTable(**rows, blocks=tables[0].blocks)


def triangle_table(corners: Array) -> ShapeTable:
    """Table of triangles (n, 3, 3) about their own origins. Equals `append` of each, but fast for a large mesh."""
    n = len(corners)
    table = _empty(n, LANES * n)
    radius = np.linalg.norm(corners, axis=2).max(axis=1)
    lanes = np.minimum(np.arange(LANES, dtype=np.int32), TRIANGLE_RING[-1])
    return table._replace(
        kind=np.full(n, CONVEX_HULL, np.uint8),
        radius=np.nextafter(radius * (1 + 1e-15), inf),
        vertex_start=np.arange(0, LANES * n, LANES, dtype=np.int32),
        vertex_count=np.full(n, LANES, np.int32),
        vertices=np.ascontiguousarray(corners[:, lanes].reshape(-1, 3).T),
        vertex_index=np.tile(lanes, n),
    )


class ShapeTableBuilder:
    """Builds a ShapeTable. `table` is the current table and must be read again after `append`.

    posed: slots whose local pose may differ from the identity, which the rows of all others hold.
    """

    def __init__(self, slots: int = 64, vertices: int = 512, forest: Forest | None = None) -> None:
        self._forest = forest or Forest()
        self.table = _empty(max(slots, 1), max(vertices, LANES))._replace(blocks=self._forest.blocks)
        self._slots = 0
        self._vertices = 0
        self._free_slots: list[int] = []
        self._free_blocks: dict[int, list[int]] = {}
        self._blocks: dict[bytes, tuple[int, int]] = {}  # bytes of the points -> start, count
        self._users: dict[int, tuple[bytes, int]] = {}  # start -> key of the block, number of slots that share it
        self._trees: dict[int, int] = {}  # slot -> first block of its tree
        self.posed: set[int] = set()

    @classmethod
    def restored(cls, table: ShapeTable, free_slots: list[int], free_blocks: dict[int, list[int]]) -> ShapeTableBuilder:
        """Restore a builder from its `used` table and its `free` slots and blocks."""
        slots, vertices = len(table.kind), len(table.vertex_index)
        builder = cls()
        table = table._replace(blocks=builder.table.blocks)
        builder.table = _resized(table, max(slots, len(builder.table.kind)), max(vertices, LANES))
        builder._slots, builder._vertices, builder.posed = slots, vertices, set(range(slots))
        builder._free_slots, builder._free_blocks = free_slots, free_blocks
        for slot in np.flatnonzero(table.vertex_count):
            start, count = int(table.vertex_start[slot]), int(table.vertex_count[slot])
            index = table.vertex_index[start : start + count]
            chosen = index[: len(np.unique(index))]  # without the padding
            key = chosen.tobytes() + table.vertices[:, start : start + len(chosen)].T.tobytes()
            builder._blocks[key] = start, count
            builder._users[start] = key, builder._users.get(start, (key, 0))[1] + 1
        return builder

    @property
    def used(self) -> ShapeTable:
        """The part of the table that has been used so far, as a view."""
        by_vertex = {
            "vertices": self.table.vertices[:, : self._vertices],
            "vertex_index": self.table.vertex_index[: self._vertices],
            "blocks": self.table.blocks,
        }
        rows = {name: column[: self._slots] for name, column in self.table._asdict().items() if name not in by_vertex}
        return ShapeTable(**rows, **by_vertex)

    @property
    def free(self) -> tuple[list[int], dict[int, list[int]]]:
        """Free slots, and free blocks of vertices by their length; the last of each list is used next."""
        return list(self._free_slots), {count: list(starts) for count, starts in self._free_blocks.items()}

    def __len__(self) -> int:
        """Number of shapes in the table."""
        return self._slots - len(self._free_slots)

    def append(
        self,
        shape: Shape,
        pose: Pose | None = None,
        margin: float = 0.0,
        corners: NDArray[np.int32] | None = None,
        tree: Array | None = None,
    ) -> int:
        """Add a shape at a pose in its object's frame, enlarged by `margin` (m); return its slot.

        corners: the `hull_vertices` of a ConvexHull, if they are known already. tree: of a mesh or a cloud, which is
        needed (`meshes.trees.shape_trees`).
        Raises UnsupportedError for a kind without kernels, ShapeError for an invalid margin.
        """
        if not 0.0 <= margin < inf:
            raise ShapeError(f"margin: expected a finite number of metres >= 0, got {margin!r}")
        kind = kind_of(shape)
        row = kind.row(shape, corners)
        if row is None and tree is not None:
            number = POINTS if isinstance(shape, Points) else MESH  # also of a map
            row = Row(number, (), float(tree[REACH]), shape.radius if isinstance(shape, Points) else 0.0)
        if row is None:
            raise UnsupportedError(f"{type(shape).__name__} has no narrow phase; supported are {SUPPORTED_SHAPES}")
        start, count = (0, 0) if row.ring is None or row.points is None else self._share(row.points, row.ring)
        margin += row.margin
        slot = self._new_slot()
        table = self.table
        table.size[slot] = (*row.size, 0.0, 0.0, 0.0, 0.0)[:4]
        table.margin[slot] = margin
        # rounded up, because the sphere must contain the shape in spite of round-off
        table.radius[slot] = nextafter(row.radius * (1 + 1e-15) + margin, inf)
        if count:
            table.vertex_start[slot], table.vertex_count[slot] = start, count
        if pose is not None:
            table.local_position[slot], table.local_rotation[slot] = pose.position, pose.rotation
            self.posed.add(slot)
        elif slot in self.posed:
            table.local_position[slot], table.local_rotation[slot] = 0.0, _UPRIGHT
            self.posed.remove(slot)
        table.kind[slot] = row.number
        if tree is not None:
            self.plant(slot, tree)
        return slot

    def plant(self, slot: int, tree: Array) -> None:
        """Give the shape in a slot, which is no half-space, a tree of its surface."""
        first = self._trees[slot] = self._forest.add(tree)
        self.table = self.table._replace(blocks=self._forest.blocks)
        self.table.size[slot, TREE] = first + 1

    def remove(self, slot: int) -> None:
        """Free a slot for reuse. Raises InputError if it holds no shape."""
        table = self.table
        if not 0 <= slot < self._slots or not table.kind[slot]:
            raise InputError(f"expected the slot of a shape in the table, got {slot!r}")
        if table.vertex_count[slot]:
            start = int(table.vertex_start[slot])
            table.vertex_start[slot] = 0
            key, users = self._users[start]
            if users > 1:
                self._users[start] = key, users - 1
            else:
                del self._users[start], self._blocks[key]
                self._free_blocks.setdefault(int(table.vertex_count[slot]), []).append(start)
            table.vertex_count[slot] = 0
        if slot in self._trees:
            self._forest.drop(self._trees.pop(slot))
            table.size[slot, TREE] = 0.0
        table.kind[slot] = 0
        self._free_slots.append(slot)

    def _new_slot(self) -> int:
        if self._free_slots:
            return self._free_slots.pop()
        capacity = len(self.table.kind)
        if self._slots == capacity:
            self.table = _resized(self.table, 2 * capacity, len(self.table.vertex_index))
        self._slots += 1
        return self._slots - 1

    def _share(self, points: Array, chosen: NDArray[np.int32]) -> tuple[int, int]:
        """Start and count of the block of the chosen points; slots with equal points share one block."""
        key = chosen.tobytes() + points[chosen].tobytes()
        if key in self._blocks:
            start, count = self._blocks[key]
            self._users[start] = key, self._users[start][1] + 1
            return start, count
        chosen = np.pad(chosen, (0, -len(chosen) % LANES), mode="edge")
        count = len(chosen)
        start = self._new_block(count)
        self.table.vertices[:, start : start + count] = points[chosen].T
        self.table.vertex_index[start : start + count] = chosen
        self._blocks[key] = start, count
        self._users[start] = key, 1
        return start, count

    def _new_block(self, count: int) -> int:
        if self._free_blocks.get(count):
            return self._free_blocks[count].pop()
        capacity = len(self.table.vertex_index)
        if self._vertices + count > capacity and self._free_vertices > capacity // 2:
            self._close_gaps()
        needed = self._vertices + count
        if needed > capacity:
            self.table = _resized(self.table, len(self.table.kind), max(needed, 2 * capacity))
        self._vertices = needed
        return needed - count

    @property
    def _free_vertices(self) -> int:
        """Number of vertices in free blocks."""
        return sum(count * len(starts) for count, starts in self._free_blocks.items())

    def _close_gaps(self) -> None:
        """Move the blocks of vertices together. Otherwise hulls of ever other sizes would leave ever more gaps."""
        table = self.table
        starts = np.array(sorted(self._users), np.int32)
        counts = np.array([self._blocks[self._users[start][0]][1] for start in starts.tolist()], np.int32)
        ends = np.cumsum(counts, dtype=np.int32)
        source = np.repeat(starts - (ends - counts), counts) + np.arange(counts.sum())
        vertices, vertex_index = np.zeros_like(table.vertices), np.zeros_like(table.vertex_index)
        vertices[:, : len(source)] = table.vertices[:, source]
        vertex_index[: len(source)] = table.vertex_index[source]
        used = table.vertex_count > 0
        vertex_start = table.vertex_start.copy()
        vertex_start[used] = (ends - counts)[np.searchsorted(starts, vertex_start[used])]
        self.table = table._replace(vertices=vertices, vertex_index=vertex_index, vertex_start=vertex_start)
        moved = dict(zip(starts.tolist(), (ends - counts).tolist(), strict=True))
        self._blocks = {key: (moved[start], count) for key, (start, count) in self._blocks.items()}
        self._users = {moved[start]: user for start, user in self._users.items()}
        self._free_blocks.clear()
        self._vertices = len(source)
