"""The tiles of columns over the cells of a plane grid, anew or where a part of the cells has changed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.shapes.cells.cell_faces import Indices
from collision_monitor.shapes.cells.cell_solids import GRID_TILE, column_rectangles
from collision_monitor.shapes.cells.tiled_solid import along_curve, tiles_of_rectangles
from collision_monitor.shapes.shape import Array

Booleans = NDArray[np.bool_]
Tiles = dict[int, Array]
Window = tuple[slice, slice]
"""Rows and columns of a part of a grid."""

_EDGE = GRID_TILE, GRID_TILE, 1
_NOWHERE = np.zeros(3, np.int64)


def column_tiles(filled: Booleans, size: Array) -> Tiles:
    """Triangles of each tile with faces, by its number. filled (rows, columns); size (3,): of a column (m)."""
    found = column_rectangles(np.pad(filled, 1), (0, 0))
    return tiles_of_rectangles(found, _EDGE, size, _NOWHERE)


class TouchedTiles(NamedTuple):
    """The tiles of a grid (rows, columns) whose faces depend on some cells: from low to high, along y and x."""

    low: tuple[int, int]
    high: tuple[int, int]

    def part(self, cells: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The cells of these tiles, with a border of one cell; 0 beyond the grid."""
        part = np.zeros([(b - a) * GRID_TILE + 2 for a, b in zip(self.low, self.high, strict=True)], np.uint8)
        begin = [a * GRID_TILE - 1 for a in self.low]
        inner = cells[tuple(slice(max(b, 0), b + n) for b, n in zip(begin, part.shape, strict=True))]
        part[tuple(slice(max(-b, 0), max(-b, 0) + n) for b, n in zip(begin, inner.shape, strict=True))] = inner
        return part

    def tiles(self, filled: Booleans, size: Array, former: Tiles) -> Tiles:
        """The tiles of the grid: these anew, from the cells of their part that are columns; the others as they were."""
        first = self.low[0] * GRID_TILE, self.low[1] * GRID_TILE
        new = tiles_of_rectangles(column_rectangles(filled, first), _EDGE, size, _NOWHERE)
        row, column = (each.ravel() for each in np.mgrid[self.low[0] : self.high[0], self.low[1] : self.high[1]])
        these: Indices = np.column_stack([column, row, np.zeros_like(row)])
        known = former.copy()
        for number in along_curve(these).tolist():
            known.pop(number, None)
        return dict(sorted([*known.items(), *new.items()]))


def touched_tiles(shape: tuple[int, int], window: Window) -> TouchedTiles:
    """The tiles of a grid of some shape whose faces depend on the cells of a window."""
    low = [max(each.start - 1, 0) // GRID_TILE for each in window]
    high = [-(-min(each.stop + 1, n) // GRID_TILE) for each, n in zip(window, shape, strict=True)]
    return TouchedTiles((low[0], low[1]), (high[0], high[1]))
