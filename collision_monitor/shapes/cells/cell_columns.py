"""The tiles of columns over the cells of a plane grid, anew or where a part of the cells has changed."""

from __future__ import annotations

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


def changed_column_tiles(filled: Booleans, size: Array, window: Window, former: Tiles) -> Tiles:
    """The same where only the cells of a window have changed: the others' arrays are those of `former`."""
    low = [max(each.start - 1, 0) // GRID_TILE for each in window]
    high = [-(-min(each.stop + 1, n) // GRID_TILE) for each, n in zip(window, filled.shape, strict=True)]
    part = np.zeros([(b - a) * GRID_TILE + 2 for a, b in zip(low, high, strict=True)], np.bool_)
    begin = [a * GRID_TILE - 1 for a in low]
    inner = filled[tuple(slice(max(b, 0), b + n) for b, n in zip(begin, part.shape, strict=True))]
    part[tuple(slice(max(-b, 0), max(-b, 0) + n) for b, n in zip(begin, inner.shape, strict=True))] = inner
    new = tiles_of_rectangles(column_rectangles(part, (begin[0] + 1, begin[1] + 1)), _EDGE, size, _NOWHERE)
    row, column = (each.ravel() for each in np.mgrid[low[0] : high[0], low[1] : high[1]])
    touched: Indices = np.column_stack([column, row, np.zeros_like(row)])
    stale = set(along_curve(touched).tolist())
    return dict(sorted([*(each for each in former.items() if each[0] not in stale), *new.items()]))
