"""Cells in space, of one size or of several as the leaves of an octree."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import hides_some
from collision_monitor.errors import ShapeError
from collision_monitor.records import ShapeType
from collision_monitor.shapes.cells.cell_faces import MOST_ALONG, Indices
from collision_monitor.shapes.cells.cell_solids import CUBE_TILE, cube_rectangles
from collision_monitor.shapes.cells.packed_cells import packed, unpacked
from collision_monitor.shapes.cells.tiled_solid import TiledSolid, along_curve, tiled_mass, tiles_of_rectangles
from collision_monitor.shapes.kind import Booleans, Fields
from collision_monitor.shapes.kinds import mesh
from collision_monitor.shapes.shape import Array, positive
from collision_monitor.tolerances import LARGEST_INPUT

MOST_VOXELS: Final = 1_000_000
"""Cells of one shape. Larger: 2 s to make its surface."""

MOST_FACES: Final = 12_000_000
"""Unit faces of all cells, before those between two cells are left out: large leaves have many."""


class Voxels(TiledSolid):
    """Occupied cells in space as one solid without inner faces, each a cube with edges along x, y and z.

    cells (n, 3): integers; the cube of (i, j, k) begins at these multiples of `resolution` (m). edges (n,): of the
    cubes, in cells, powers of two of which i, j and k are multiples, as of the leaves of an octree; None: all are 1.
    Cells that are given twice count once. The order of the cells does not matter.
    Raises ShapeError, also for leaves within others, and for more than MOST_VOXELS.

    >>> Voxels([(0, 0, 0), (1, 0, 0), (2, 0, 0)], 0.1, edges=[1, 1, 2])
    Voxels(3 cells of 0.1 to 0.2 m)
    """

    cells: NDArray[np.int32]
    resolution: float
    edges: NDArray[np.int32]

    def __init__(self, cells: ArrayLike, resolution: float, edges: ArrayLike | None = None) -> None:
        given = np.asarray(cells) if not hides_some(cells) else np.zeros(0)
        if given.ndim != 2 or given.shape[1] != 3 or not len(given) or given.dtype.kind not in "iu":
            raise ShapeError(
                f"Voxels cells: expected integers of shape (n, 3), n >= 1, got {given.dtype} {given.shape}"
            )
        if len(given) > MOST_VOXELS:
            raise ShapeError(
                f"Voxels cells: expected at most {MOST_VOXELS}, got {len(given)}; cut the map, or make it coarser"
            )
        size = np.ones(len(given), np.int64) if edges is None else np.asarray(edges)
        if size.shape != (len(given),) or size.dtype.kind not in "iu":
            raise ShapeError(f"Voxels edges: expected {len(given)} integers, got {size.dtype} {size.shape}")
        low, edge = given.astype(np.int64), size.astype(np.int64)
        if not ((edge >= 1) & (edge & (edge - 1) == 0) & (edge < MOST_ALONG)).all() or (low % edge[:, None]).any():
            raise ShapeError("Voxels edges: expected powers of two of which the cells are multiples, got others")
        if np.ptp(np.concatenate([low, low + edge[:, None]]), axis=0).max() >= MOST_ALONG - int(edge.max()) - CUBE_TILE:
            raise ShapeError(f"Voxels cells: expected less than {MOST_ALONG} cells along each axis, got more")
        length = positive(resolution, "Voxels resolution")
        if not max(abs(low).max(), 1) * length <= LARGEST_INPUT:
            raise ShapeError(f"Voxels cells: expected places up to {LARGEST_INPUT:g} m, got some beyond")
        if 6 * (edge**2).sum() > MOST_FACES:
            raise ShapeError(
                f"Voxels edges: expected leaves of at most {MOST_FACES} unit faces, got {6 * (edge**2).sum()}"
            )
        self._set(*_along_curve(low, edge), length)

    def _set(self, low: Indices, edge: Indices, resolution: float) -> None:
        cells, edges = low.astype(np.int32), edge.astype(np.int32)
        for array in (cells, edges):
            array.setflags(write=False)
        self.__dict__.update(cells=cells, edges=edges, resolution=resolution)

    @cached_property
    def tiles(self) -> tuple[Array, ...]:  # type: ignore[override]
        """Triangles (n, 3, 3) in m of each tile with faces."""
        low = _low(self.cells, self.edges)
        found = cube_rectangles(self.cells - low, self.edges.astype(np.int64))
        size = np.full(3, self.resolution)
        return tuple(tiles_of_rectangles(found, (CUBE_TILE,) * 3, size, low).values())

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles hold the cells alone."""
        return {name: self.__dict__[name] for name in ("cells", "edges", "resolution")}

    def __repr__(self) -> str:
        most = f" to {self.edges.max() * self.resolution:g}" if self.edges.max() > 1 else ""
        return f"Voxels({len(self.cells)} cells of {self.resolution:g}{most} m)"


def _low(cells: NDArray[Any], edges: NDArray[Any]) -> Indices:
    """The lower corner (3,) of a lattice for the cells, a multiple of tiles and of the largest edge."""
    step = max(CUBE_TILE, int(edges.max()))
    low: Indices = cells.min(axis=0).astype(np.int64) // step * step
    return low


def _along_curve(low: Indices, edge: Indices) -> tuple[Indices, Indices]:
    """The cells and their edges in the order of the Z curve, each once. Raises ShapeError if one is within another."""
    number = along_curve(low - _low(low, edge))
    order = np.argsort(number, kind="stable")
    number, low, edge = number[order], low[order], edge[order]
    kept = np.ones(len(number), np.bool_)
    kept[1:] = (number[1:] != number[:-1]) | (edge[1:] != edge[:-1])
    number, low, edge = number[kept], low[kept], edge[kept]
    inside = np.flatnonzero(number[:-1] + edge[:-1] ** 3 > number[1:])
    if len(inside):
        k = int(inside[0])
        raise ShapeError(
            f"Voxels: expected leaves beside each other, got {low[k + 1].tolist()} within the one of {edge[k]} cells "
            f"at {low[k].tolist()}"
        )
    return low, edge


def _contains(shape: Voxels, p: Array) -> Booleans:
    """Whether points are in a cell, of which the sides belong to both cells."""
    low = _low(shape.cells, shape.edges)
    at = p / shape.resolution - low
    begin = along_curve(shape.cells - low)
    end = begin + shape.edges.astype(np.int64) ** 3
    top = int((shape.cells - low + shape.edges[:, None]).max())
    found = np.zeros(len(p), np.bool_)
    for k in range(8):
        upper = [bool(k >> axis & 1) for axis in range(3)]
        cell: Array = np.where(upper, np.floor(at), np.ceil(at) - 1.0)
        there = np.asarray(((cell >= 0.0) & (cell < top)).all(axis=1))
        number = along_curve(np.where(there[:, None], cell, 0.0).astype(np.int64))
        which = np.searchsorted(begin, number, "right") - 1
        found |= there & (which >= 0) & (number < end[which])
    return found


def _fields(shape: Voxels) -> Fields:
    low = _low(shape.cells, shape.edges)
    steps = np.diff(along_curve(shape.cells - low), prepend=0)
    levels = np.log2(shape.edges).astype("<i8")
    data = packed(np.concatenate([steps.astype("<i8"), levels]))
    return Fields((float(len(steps)), shape.resolution, *map(float, low)), data=data)


def _make(fields: Fields) -> Voxels:
    count, resolution, *low = fields.dimensions
    if not (1 <= count <= MOST_VOXELS) or count % 1 or any(each % 1 or abs(each) > LARGEST_INPUT for each in low):
        raise ShapeError(f"Voxels: expected 1 to {MOST_VOXELS} cells from a whole number on, got {fields.dimensions}")
    steps, levels = unpacked(fields.data, "<i8", 2 * int(count), "Voxels").reshape(2, -1)
    if not ((steps >= 0) & (steps < 1 << 60) & (levels >= 0) & (levels < 17)).all() or (np.cumsum(steps) < 0).any():
        raise ShapeError("Voxels, data: expected steps along the Z curve, then levels from 0 to 16, got others")
    number = np.cumsum(steps)
    cells = np.stack([_gathered(number >> axis) for axis in range(3)], axis=1)
    return Voxels(cells + np.array(low, np.int64), resolution, np.left_shift(1, levels))


def _gathered(x: Indices) -> Indices:
    """Every third bit of a number, the reverse of the Z curve."""
    x = x & 0x1249249249249249
    x = (x | (x >> 2)) & 0x10C30C30C30C30C3
    x = (x | (x >> 4)) & 0x100F00F00F00F00F
    x = (x | (x >> 8)) & 0x1F0000FF0000FF
    x = (x | (x >> 16)) & 0x1F00000000FFFF
    return (x | (x >> 32)) & 0xFFFFF


KIND: Final = dataclasses.replace(
    mesh.KIND,
    number=ShapeType.VOXELS,
    name="voxels",
    shape=Voxels,
    dimensions="count, resolution, x, y, z",
    fields=_fields,
    make=_make,
    contains=_contains,
    mass=tiled_mass,
    scaled=None,
)
