"""The surface of a union of lattice cells: its unit faces, merged to rectangles.

A unit face is where a cell of the union meets a cell that is not in it. Faces of two cells of the union cancel, so that
the surface has no inner faces. Faces of one plane are merged along a row, and equal runs of neighbouring rows to
rectangles, within tiles, so that a change of some cells changes the rectangles of their tiles alone.
(Lysenko, Meshing in a Minecraft game, 2012: greedy meshing)
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]

BITS: Final = 17
"""Bits of a lattice coordinate in the number of a unit face: 131,072 cells along each axis."""

MOST_ALONG: Final = 1 << BITS
"""Most cells of a map along one axis."""

_RUN: Final = 7
"""Bits of the length of a run, at most the edge of a tile, 64 cells; every edge is a power of two."""

_MASK: Final = (1 << BITS) - 1


class Rectangles(NamedTuple):
    """Rectangles in lattice planes, each (n,), in lattice units: from (u, v) to (u_end, v_end) in a plane of an axis.

    outward: 1 if the normal points along the axis, else 0. u and v run along the next two axes in cyclic order.
    """

    axis: Indices
    plane: Indices
    outward: Indices
    u: Indices
    u_end: Indices
    v: Indices
    v_end: Indices


def face_key(plane: Indices, outward: Indices | int, u: Indices | int, v: Indices) -> Indices:
    """Number of a unit face with the lower corner (u, v): it grows with plane, outward, u and v in this order."""
    key: Indices = (((plane << 1) | outward) << (2 * BITS)) | (u << BITS) | v
    return key


def merged(keys: Indices, axis: int, tile: tuple[int, int]) -> Rectangles:
    """Merge unit faces normal to an axis, given by their sorted `face_key`.

    tile: edges along u and v, in cells, that no rectangle crosses.
    """
    begin, length = _runs(keys, tile[1])
    key = keys[begin]
    side, u, v = key >> (2 * BITS), (key >> BITS) & _MASK, key & _MASK
    keys = (((side << BITS) | v) << (_RUN + BITS)) | (length << BITS) | u
    keys.sort()
    begin, height = _runs(keys, tile[0])
    key = keys[begin]
    u, length, key = key & _MASK, (key >> BITS) & ((1 << _RUN) - 1), key >> (_RUN + BITS)
    v, side = key & _MASK, key >> BITS
    return Rectangles(np.full(len(u), axis), side >> 1, side & 1, u, u + height, v, v + length)


def _runs(keys: Indices, edge: int) -> tuple[Indices, Indices]:
    """First place and length of each run of numbers that follow each other, cut at multiples of an edge."""
    new = np.ones(len(keys), np.bool_)
    new[1:] = keys[1:] != keys[:-1] + 1
    new[1:] |= (keys[1:] & (edge - 1)) == 0
    begin = np.flatnonzero(new)
    return begin, np.diff(begin, append=len(keys))


def joined_rectangles(parts: list[Rectangles]) -> Rectangles:
    """Concatenate rectangles."""
    return Rectangles(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def rectangle_tiles(found: Rectangles, tile: tuple[int, int, int]) -> Indices:
    """Tile (n, 3) of the cells behind each rectangle. tile: edges of the tiles along x, y and z, in cells."""
    tiles = np.empty((len(found.axis), 3), np.int64)
    for axis in range(3):
        some = found.axis == axis
        tiles[some, axis] = (found.plane[some] - found.outward[some]) // tile[axis]
        for along, low in (((axis + 1) % 3, found.u), ((axis + 2) % 3, found.v)):
            tiles[some, along] = low[some] // tile[along]
    return tiles


def rectangle_corners(found: Rectangles) -> Indices:
    """Corners of each rectangle (n, 4, 3), in lattice units, counter-clockwise seen from outside."""
    corners = np.empty((len(found.axis), 4, 3), np.int64)
    inward = found.outward == 0
    u = [found.u, np.where(inward, found.u, found.u_end), found.u_end, np.where(inward, found.u_end, found.u)]
    v = [found.v, np.where(inward, found.v_end, found.v), found.v_end, np.where(inward, found.v, found.v_end)]
    for axis in range(3):
        some = np.flatnonzero(found.axis == axis)
        for k in range(4):
            corners[some, k, axis] = found.plane[some]
            corners[some, k, (axis + 1) % 3] = u[k][some]
            corners[some, k, (axis + 2) % 3] = v[k][some]
    return corners
