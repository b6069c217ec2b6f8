"""Rectangles of the surface of columns on a plane grid, and of cubes in space."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.shapes.cells.cell_faces import BITS, Indices, Rectangles, face_key, joined_rectangles, merged

Booleans = NDArray[np.bool_]

GRID_TILE: Final = 64
"""Edge of the tiles of a plane grid, in cells. Larger: an update makes more of the surface anew. Smaller: a wall has
more faces."""

CUBE_TILE: Final = 32
"""Edge of the tiles of cells in space, in cells."""


def column_rectangles(filled: Booleans, first: tuple[int, int]) -> Rectangles:
    """Rectangles of columns over the inner cells of an array (rows + 2, columns + 2).

    filled: which cells are columns; those of the border have no faces of their own, but cover those beside them.
    first: row and column of the first inner cell. x is the column, y the row; columns reach from 0 to 1 in z.
    """
    turned = np.ascontiguousarray(filled.T)
    row, column = first
    parts = [
        _turned_over(_sides(turned, (column, row), 0)),
        _sides(filled, (row, column), 1),
    ]
    at, along = np.nonzero(turned[1:-1, 1:-1])
    bottom = merged(face_key(np.zeros_like(at), 0, at + column, along + row), 2, (GRID_TILE, GRID_TILE))
    one = np.ones_like(bottom.plane)
    return joined_rectangles([*parts, bottom, bottom._replace(plane=one, outward=one)])


def _turned_over(found: Rectangles) -> Rectangles:
    """The same with u and v exchanged."""
    return found._replace(u=found.v, u_end=found.v_end, v=found.u, v_end=found.u_end)


def _sides(filled: Booleans, first: tuple[int, int], axis: int) -> Rectangles:
    """Rectangles between rows of an array with a border; u is z, v runs along a row."""
    change = filled[1:, 1:-1] != filled[:-1, 1:-1]
    change[0] &= filled[1, 1:-1]  # faces of the border are not ours
    change[-1] &= filled[-2, 1:-1]
    at, along = np.nonzero(change)
    outward = filled[at, along + 1].astype(np.int64)  # whether the lower side is filled
    keys = face_key(at + first[0], outward, 0, along + first[1])
    keys.sort()
    return merged(keys, axis, (1, GRID_TILE))


def cube_rectangles(low: Indices, edge: Indices) -> Rectangles:
    """Rectangles of the union of cubes that do not overlap: lower corners (n, 3) >= 0 and edges (n,), in cells."""
    return joined_rectangles([merged(_unit_faces(low, edge, axis), axis, (CUBE_TILE, CUBE_TILE)) for axis in range(3)])


def _unit_faces(low: Indices, edge: Indices, axis: int) -> Indices:
    """The `face_key` of the faces normal to an axis that no other cube shares, sorted."""
    place = (low[:, axis] << (2 * BITS)) | (low[:, (axis + 1) % 3] << BITS) | low[:, (axis + 2) % 3]
    parts = []
    for each in np.unique(edge).tolist():
        u, v = np.indices((each, each)).reshape(2, -1)
        below = (place[edge == each, None] + ((u << BITS) | v)).ravel() << 1
        parts += [below, below + ((each << (2 * BITS + 1)) | 1)]
    keys = np.concatenate(parts)
    keys.sort()
    shared = np.zeros(len(keys), np.bool_)
    shared[:-1] = (keys[1:] == keys[:-1] + 1) & (keys[:-1] & 1 == 0)
    shared[1:] |= shared[:-1].copy()
    keys = keys[~shared]
    flat = keys >> 1
    keys = ((flat >> (2 * BITS)) << (2 * BITS + 1)) | ((keys & 1) << (2 * BITS)) | (flat & ((1 << (2 * BITS)) - 1))
    keys.sort()
    return keys
