"""A solid whose closed surface comes in tiles, as that of a map: a mesh that need not be examined to be known."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.surface import Indices, Surface
from collision_monitor.shapes.cells.cell_faces import Rectangles, rectangle_corners, rectangle_tiles
from collision_monitor.shapes.kinds.mesh import Mesh
from collision_monitor.shapes.mass import MassProperties, polyhedron_mass
from collision_monitor.shapes.shape import Array, Shape

_CURVE_BITS: Final = 6
"""Bits of a coordinate within a tile that the order of its faces follows."""


class TiledSurface(Surface):
    """The surface of a map: closed by construction, also where a corner of one face lies on an edge of another."""

    welded = 0
    repeated = np.zeros(0, np.int64)
    closed = True

    def __init__(self, solid: TiledSolid) -> None:
        self._solid = solid

    @cached_property
    def vertices(self) -> Array:  # type: ignore[override]
        """Those of the solid."""
        return self._solid.vertices

    @cached_property
    def faces(self) -> Indices:  # type: ignore[override]
        """Those of the solid."""
        return self._solid.faces.astype(np.int64)

    @cached_property
    def _edges(self) -> tuple[Indices, bool]:
        return np.zeros((0, 2), np.int64), True


class TiledSolid(Mesh):
    """Solid that is bounded by the triangles of its tiles: arrays (n, 3, 3) in m, counter-clockwise from outside.

    unsure: it is not known whether the solid is there, as of unknown cells: contacts with it are UNRESOLVED.
    """

    tiles: tuple[Array, ...]
    unsure: bool = False

    def __init__(self, tiles: Sequence[Array], unsure: bool = False) -> None:
        self.__dict__.update(tiles=tuple(tiles), unsure=unsure)

    @property
    def solids(self) -> tuple[TiledSolid, ...]:
        """The solids that it consists of: what is certainly there, then what may be there."""
        return (self,)

    @cached_property
    def vertices(self) -> Array:
        """The corners (3 m, 3) of its faces in m, three for each."""
        return np.concatenate(self.tiles).reshape(-1, 3)

    @cached_property
    def faces(self) -> NDArray[np.int32]:
        """Faces (m, 3) of vertex indices, tile by tile."""
        return np.arange(3 * self.face_count, dtype=np.int32).reshape(-1, 3)

    @property
    def face_count(self) -> int:
        """Number of faces of its solids."""
        return sum(sum(map(len, solid.tiles)) for solid in self.solids)

    @cached_property
    def surface(self) -> Surface:
        """Its surface, which is closed and oriented."""
        return TiledSurface(self)

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles hold the tiles alone."""
        return {"tiles": self.tiles, "unsure": self.unsure}

    def __repr__(self) -> str:
        return f"TiledSolid({self.face_count} faces in {len(self.tiles)} tiles)"


def is_unsure(shape: Shape) -> bool:
    """Whether it is not known if a shape is there."""
    return isinstance(shape, TiledSolid) and shape.unsure


def tiled_mass(shape: TiledSolid, density: float) -> MassProperties:
    """Mass properties of everything that may be there, for a density (kg/m³)."""
    return polyhedron_mass(shape.vertices, shape.faces.astype(np.int64), density)


def along_curve(cells: Indices) -> Indices:
    """Number (n,) of cells (n, 3) >= 0 along the Z curve, for less than 2^20 along each axis. (Morton, 1966)"""
    number: Indices = _spread(cells[:, 0]) | (_spread(cells[:, 1]) << 1) | (_spread(cells[:, 2]) << 2)
    return number


def _spread(x: Indices) -> Indices:
    """The bits of a number below 2^20 with two zeros behind each."""
    x = (x | (x << 32)) & 0x1F00000000FFFF
    x = (x | (x << 16)) & 0x1F0000FF0000FF
    x = (x | (x << 8)) & 0x100F00F00F00F00F
    x = (x | (x << 4)) & 0x10C30C30C30C30C3
    return (x | (x << 2)) & 0x1249249249249249


def grouped_by_tile(triangles: Array, number: Indices, within: Indices) -> dict[int, Array]:
    """Triangles (m, 3, 3) of each tile that has some, by its number, in this order.

    triangles (n, k, 3, 3): in n groups, each of the tile with this number (n,), at a place (n,) within it, whose bits
    are at most 3 _CURVE_BITS.
    """
    if not len(number):
        return {}
    order = np.argsort((number - number.min()) << (3 * _CURVE_BITS) | within, kind="stable")
    number = number[order]
    begin = np.flatnonzero(np.diff(number, prepend=-1))
    parts = np.split(triangles[order].reshape(-1, 3, 3), triangles.shape[1] * begin[1:])
    return dict(zip(number[begin].tolist(), parts, strict=True))


def tiles_of_rectangles(found: Rectangles, edge: tuple[int, int, int], size: Array, low: Indices) -> dict[int, Array]:
    """Triangles (n, 3, 3) in m of each tile with faces, by its number along the Z curve.

    edge: of the tiles along x, y and z, in cells, powers of two. size (3,): of a cell (m). low (3,): place of the
    lattice's origin, in cells. The faces of a tile follow a Z curve.
    """
    corners = rectangle_corners(found)
    middle = corners[:, 0] + corners[:, 2]  # in half cells
    shift = np.array([max(int(2 * each).bit_length() - 1 - _CURVE_BITS, 0) for each in edge])
    within = along_curve((middle % (2 * np.array(edge))) >> shift)
    triangles = ((corners + low) * size)[:, [[0, 1, 2], [0, 2, 3]]]
    return grouped_by_tile(triangles, along_curve(rectangle_tiles(found, edge)), within)
