"""The plane grid of cells, as of an occupancy map: columns of one height."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import checked_number, hides_some
from collision_monitor.errors import ShapeError
from collision_monitor.records import ShapeType
from collision_monitor.shapes.cells.cell_columns import Tiles, Window, column_tiles, touched_tiles
from collision_monitor.shapes.cells.cell_faces import MOST_ALONG
from collision_monitor.shapes.cells.packed_cells import packed, unpacked
from collision_monitor.shapes.cells.tiled_solid import TiledSolid, tiled_mass
from collision_monitor.shapes.kind import Booleans, Fields
from collision_monitor.shapes.kinds import mesh
from collision_monitor.shapes.shape import Array, positive

MOST_CELLS: Final = 25_000_000
"""Cells of a grid. Larger: 1 s to make its surface."""

FREE, OCCUPIED, UNKNOWN = range(3)
"""Values of `Grid.cells`."""

UNKNOWN_IS: Final = ("unresolved", "obstacle", "free")
"""What unknown cells are."""

OCCUPIED_FROM: Final = 65.0
"""Least value of an occupied cell, as that of nav2's map server."""

NOTHING: Final = "Grid: expected a cell that is occupied or may be, got none; leave the object out"


class Grid(TiledSolid):
    """Columns of one height over the occupied cells (rows, columns) of a plane grid, as one solid without inner faces.

    cells: bools, or numbers as of nav_msgs/OccupancyGrid: below 0 or NaN is unknown, at least `occupied_from` occupied.
    The cell of row i and column j reaches from j to j + 1 along x and from i to i + 1 along y, in `resolution` (m), and
    from 0 to `height` (m) along z. unknown: "unresolved", contacts with unknown cells are UNRESOLVED; or they are an
    "obstacle", or "free". As a mesh, it is everything that may be there.
    Raises ShapeError, also if nothing may be there, and for more than MOST_CELLS.

    >>> Grid([[1, 1, 0], [0, -1, 0]], 0.05, height=1.0, occupied_from=1)
    Grid(2 x 3 cells of 0.05 m: 2 occupied, 1 unknown and unresolved; height=1.0)
    """

    cells: NDArray[np.uint8]
    resolution: float
    height: float
    unknown: str

    def __init__(
        self,
        cells: ArrayLike,
        resolution: float,
        height: float = 2.0,
        unknown: str = UNKNOWN_IS[0],
        occupied_from: float = OCCUPIED_FROM,
    ) -> None:
        values = _cell_values(cells, occupied_from)
        if unknown not in UNKNOWN_IS:
            raise ShapeError(f"Grid, unknown: expected one of {', '.join(UNKNOWN_IS)}, got {unknown!r:.100}")
        self._set(values, positive(resolution, "Grid resolution"), positive(height, "Grid height"), unknown)

    def _set(self, values: NDArray[np.uint8], resolution: float, height: float, unknown: str) -> None:
        values.setflags(write=False)
        self.__dict__.update(cells=values, resolution=resolution, height=height, unknown=unknown)
        if not (self._are(OCCUPIED).any() or (unknown != "free" and self._are(UNKNOWN).any())):
            raise ShapeError(NOTHING)

    def _are(self, value: int) -> Booleans:
        return np.asarray(self.cells == value)

    @property
    def _size(self) -> Array:
        return np.array([self.resolution, self.resolution, self.height])

    def _layers(self, part: NDArray[np.uint8]) -> dict[bool, Booleans]:
        """Which cells of a part are certainly there (False), and which are UNRESOLVED (True)."""
        if self.unknown == "obstacle":
            return {False: part != FREE}
        certain = {False: np.asarray(part == OCCUPIED)}
        return certain if self.unknown == "free" else {**certain, True: np.asarray(part == UNKNOWN)}

    @cached_property
    def _tiles(self) -> dict[bool, Tiles]:
        """The tiles of each layer."""
        return {unsure: column_tiles(filled, self._size) for unsure, filled in self._layers(self.cells).items()}

    @cached_property
    def tiles(self) -> tuple[Array, ...]:  # type: ignore[override]
        """Triangles (n, 3, 3) in m of each tile of everything that may be there."""
        if not self._tiles.get(True):
            return tuple(self._tiles[False].values())
        return tuple(column_tiles(self.cells != FREE, self._size).values())

    @cached_property
    def solids(self) -> tuple[TiledSolid, ...]:
        """The solids of the occupied and of the unresolved cells, as far as there are any."""
        if not self._tiles.get(True):
            return (self,)
        return tuple(TiledSolid(tuple(tiles.values()), unsure) for unsure, tiles in self._tiles.items() if tiles)

    def updated(self, row: int, column: int, cells: ArrayLike, occupied_from: float = OCCUPIED_FROM) -> Grid:
        """The grid with other cells (r, c) from a row and a column on. Only the tiles with these cells are made anew.

        Raises ShapeError for cells beyond the grid, and as the constructor does.
        """
        values = _cell_values(cells, occupied_from)
        rows, columns = self.cells.shape
        if not (0 <= row <= rows - len(values) and 0 <= column <= columns - values.shape[1]):
            raise ShapeError(
                f"Grid update: expected cells within {rows} x {columns}, got {len(values)} x {values.shape[1]} "
                f"from row {row} and column {column} on"
            )
        window = slice(row, row + len(values)), slice(column, column + values.shape[1])
        changed = self.cells.copy()
        changed[window] = values
        changed.setflags(write=False)
        grid = object.__new__(Grid)
        grid.__dict__.update(self.__getstate__(), cells=changed)
        grid._take_tiles(self, window)
        if not any(grid._tiles.values()):
            raise ShapeError(NOTHING)
        return grid

    def share_tiles(self, former: Grid) -> None:
        """Take over the tiles of a grid that differs in some cells, so that only those of the others are made."""
        lattice = self.cells.shape, self.resolution, self.height, self.unknown
        if (former.cells.shape, former.resolution, former.height, former.unknown) != lattice:
            return
        differ = self.cells != former.cells
        spans = [np.flatnonzero(differ.any(axis=axis)) for axis in (1, 0)]
        if not len(spans[0]):
            spans = [np.zeros(1, np.int64)] * 2
        self._take_tiles(former, (slice(spans[0][0], spans[0][-1] + 1), slice(spans[1][0], spans[1][-1] + 1)))

    def _take_tiles(self, former: Grid, window: Window) -> None:
        touched = touched_tiles(self.cells.shape, window)
        layers = self._layers(touched.part(self.cells))
        self.__dict__["_tiles"] = {
            unsure: touched.tiles(filled, self._size, former._tiles[unsure]) for unsure, filled in layers.items()
        }
        trees = {each.unsure: each.__dict__.get("map_tree") for each in former.solids}
        for solid in self.solids:
            solid.__dict__["former_tree"] = trees.get(solid.unsure)

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles hold the cells alone."""
        return {name: self.__dict__[name] for name in ("cells", "resolution", "height", "unknown")}

    def __repr__(self) -> str:
        rows, columns = self.cells.shape
        counts = f"{self._are(OCCUPIED).sum()} occupied, {self._are(UNKNOWN).sum()} unknown and {self.unknown}"
        return f"Grid({rows} x {columns} cells of {self.resolution} m: {counts}; height={self.height})"


def _cell_values(cells: Any, occupied_from: float) -> NDArray[np.uint8]:
    """FREE, OCCUPIED or UNKNOWN for each cell (rows, columns). Raises ShapeError."""
    given = np.asarray(cells) if not hides_some(cells) else np.zeros(0)
    if given.ndim != 2 or given.dtype.kind not in "biuf" or not given.size:
        got = f"{given.dtype} of shape {given.shape}"
        raise ShapeError(f"Grid cells: expected bools or numbers of shape (rows, columns), got {got}")
    rows, columns = len(given), given[0].size
    if given.size > MOST_CELLS or max(rows, columns) >= MOST_ALONG:
        most = f"at most {MOST_CELLS} cells, and {MOST_ALONG - 1} along a side"
        raise ShapeError(f"Grid cells: expected {most}, got {rows} x {columns}; cut the map, or make it coarser")
    if given.dtype.kind == "b":
        return given.astype(np.uint8)
    least = checked_number(occupied_from, "Grid, occupied_from", error=ShapeError)
    values = (given >= least).astype(np.uint8)
    if given.dtype.kind != "u":
        values[~(given >= 0)] = UNKNOWN
    return values


def _contains(shape: Grid, p: Array) -> Booleans:
    """Whether points are in a column, of which the sides belong to both cells."""
    found = np.zeros(len(p), np.bool_)
    filled = np.pad(shape.cells == OCCUPIED if shape.unknown == "free" else shape.cells != FREE, 1)
    at = p[:, 1::-1] / shape.resolution
    low = np.clip(np.ceil(at).astype(np.int64) - 1, -1, np.array(filled.shape) - 2)
    high = np.clip(np.floor(at).astype(np.int64), -1, np.array(filled.shape) - 2)
    for row in (low[:, 0], high[:, 0]):
        for column in (low[:, 1], high[:, 1]):
            found |= filled[row + 1, column + 1]
    return found & (p[:, 2] >= 0.0) & (p[:, 2] <= shape.height)


def _fields(shape: Grid) -> Fields:
    numbers = (*shape.cells.shape, shape.resolution, shape.height, UNKNOWN_IS.index(shape.unknown))
    return Fields(tuple(map(float, numbers)), data=packed(shape.cells))


def _make(fields: Fields) -> Grid:
    rows, columns, resolution, height, choice = fields.dimensions
    if not (1 <= rows < MOST_ALONG and 1 <= columns < MOST_ALONG and rows * columns <= MOST_CELLS):
        raise ShapeError(f"Grid: expected 1 to {MOST_CELLS} cells, got {rows:g} x {columns:g}")
    if choice not in range(len(UNKNOWN_IS)) or rows % 1 or columns % 1:
        raise ShapeError(
            f"Grid: expected whole numbers of rows and columns and 0 to 2 for unknown cells, got {fields.dimensions}"
        )
    values = unpacked(fields.data, np.uint8, int(rows * columns), "Grid").reshape(int(rows), int(columns))
    if values.max() > UNKNOWN:
        raise ShapeError(f"Grid, data: expected 0 (free), 1 (occupied) or 2 (unknown), got {values.max()}")
    grid = object.__new__(Grid)
    grid._set(values, positive(resolution, "Grid resolution"), positive(height, "Grid height"), UNKNOWN_IS[int(choice)])
    return grid


KIND: Final = dataclasses.replace(
    mesh.KIND,
    number=ShapeType.GRID,
    name="grid",
    shape=Grid,
    dimensions="rows, columns, resolution, height, unknown",
    fields=_fields,
    make=_make,
    contains=_contains,
    mass=tiled_mass,
    scaled=None,
)
