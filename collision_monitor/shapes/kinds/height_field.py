"""Terrain: a surface over a plane grid of points, and the ground below it."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import real_array, real_number
from collision_monitor.errors import ShapeError
from collision_monitor.records import ShapeType
from collision_monitor.shapes.cells.cell_columns import column_tiles
from collision_monitor.shapes.cells.cell_solids import GRID_TILE
from collision_monitor.shapes.cells.packed_cells import packed, unpacked
from collision_monitor.shapes.cells.tiled_solid import TiledSolid, along_curve, grouped_by_tile, tiled_mass
from collision_monitor.shapes.kind import Booleans, Fields
from collision_monitor.shapes.kinds import mesh
from collision_monitor.shapes.kinds.grid import UNKNOWN_IS
from collision_monitor.shapes.shape import Array, positive
from collision_monitor.tolerances import LARGEST_INPUT

MOST_HEIGHTS: Final = 250_000
"""Points of a terrain. Larger: 1 s to make its surface, which has five triangles for each."""

_BELOW: Final = 1.0
"""How far the ground reaches below the lowest height by default (m)."""


class HeightField(TiledSolid):
    """Terrain: heights (rows, columns) in m over a grid of points, and the ground below them down to `base` (m).

    The point of row i and column j is at x = j, y = i times `resolution` (m). Each four points are two triangles, cut
    from the point of the lower row and column. base: by default 1 m below the lowest height. A NaN is unknown, and with
    it the squares around it: unknown: "unresolved", they may be columns up to the greatest height, and contacts with
    them are UNRESOLVED; or they are such columns, an "obstacle"; or "free".
    Raises ShapeError, also for more than MOST_HEIGHTS.

    >>> HeightField([[0.0, 0.1], [0.2, 0.1]], 0.5)
    HeightField(2 x 2 heights from 0 to 0.2 m, 0.5 m apart, base=-1.0)
    """

    heights: Array
    resolution: float
    base: float
    unknown: str

    def __init__(
        self, heights: ArrayLike, resolution: float, base: float | None = None, unknown: str = UNKNOWN_IS[0]
    ) -> None:
        try:
            given = np.array(real_array(heights))
            low = None if base is None else real_number(base)
        except (TypeError, ValueError, OverflowError):
            text = "HeightField: expected heights of shape (rows, columns) and a base in m, got others"
            raise ShapeError(text) from None
        if given.ndim != 2 or min(given.shape) < 2 or given.size > MOST_HEIGHTS:
            raise ShapeError(
                f"HeightField heights: expected 2 x 2 to {MOST_HEIGHTS} of shape (rows, columns), got {given.shape}"
            )
        known = given[~np.isnan(given)]
        if not len(known) or not (np.abs(known) <= LARGEST_INPUT).all():
            raise ShapeError(
                f"HeightField heights: expected NaN or heights up to {LARGEST_INPUT:g} m, some of them known"
            )
        if low is None:
            low = float(known.min()) - _BELOW
        if not -LARGEST_INPUT <= low < known.min():
            raise ShapeError(f"HeightField base: expected a height below {known.min():g} m, got {low!r}")
        if unknown not in UNKNOWN_IS:
            raise ShapeError(f"HeightField, unknown: expected one of {', '.join(UNKNOWN_IS)}, got {unknown!r:.100}")
        given.setflags(write=False)
        length = positive(resolution, "HeightField resolution")
        self.__dict__.update(heights=given, resolution=length, base=low, unknown=unknown)
        if self._is_known.any() or (unknown != "free"):
            return
        raise ShapeError("HeightField: expected four known heights around a square, got none; leave the object out")

    @cached_property
    def _is_known(self) -> Booleans:
        """Which squares (rows - 1, columns - 1) have four known corners."""
        k = ~np.isnan(self.heights)
        return k[1:, 1:] & k[1:, :-1] & k[:-1, 1:] & k[:-1, :-1]

    @cached_property
    def solids(self) -> tuple[TiledSolid, ...]:
        """The known terrain, and the columns of unknown squares, as far as there are any."""
        unknown = ~self._is_known & (self.unknown != "free")
        if not unknown.any():
            return (self,)
        top = float(np.nanmax(self.heights))
        found = column_tiles(unknown, np.array([self.resolution, self.resolution, top - self.base]))
        columns = [tile + np.array([0.0, 0.0, self.base]) for tile in found.values()]
        ground = [TiledSolid(self._ground)] if self._is_known.any() else []
        return (*ground, TiledSolid(columns, unsure=self.unknown == "unresolved"))

    @cached_property
    def tiles(self) -> tuple[Array, ...]:  # type: ignore[override]
        """Triangles (n, 3, 3) in m of each tile of everything that may be there."""
        if not (~self._is_known).any() or self.unknown == "free":
            return self._ground
        return tuple(tile for solid in self.solids for tile in solid.tiles)

    @cached_property
    def _ground(self) -> tuple[Array, ...]:
        row, column = np.nonzero(self._is_known)
        edge = along_curve(np.column_stack([column, row, 0 * row]) // GRID_TILE)
        within = along_curve(np.column_stack([column, row, 0 * row]) % GRID_TILE)
        corners = [self._points(row + r, column + c) for r, c in ((0, 0), (0, 1), (1, 1), (1, 0))]
        a, b, c, d = corners
        a0, b0, c0, d0 = (each * (1, 1, 0) + (0, 0, self.base) for each in corners)
        faces = [_faces([(a, b, c), (a, c, d), (c0, b0, a0), (d0, c0, a0)])]
        groups, places = [edge], [within]
        beside = np.pad(self._is_known, 1)
        for (r, q), (p, s, p0, s0) in zip(
            ((-1, 0), (0, 1), (1, 0), (0, -1)),
            ((a, b, a0, b0), (b, c, b0, c0), (c, d, c0, d0), (d, a, d0, a0)),
            strict=True,
        ):
            open_ = ~beside[row + 1 + r, column + 1 + q]
            sides = _faces([(p0, s0, s), (p0, s, p)])[open_]
            faces.append(np.concatenate([sides, sides[:, :0]], axis=1))
            groups.append(edge[open_])
            places.append(within[open_])
        tiles: dict[int, list[Array]] = {}
        for part, number, place in zip(faces, groups, places, strict=True):
            for key, triangles in grouped_by_tile(part, number, place).items():
                tiles.setdefault(key, []).append(triangles)
        return tuple(np.concatenate(tiles[key]) for key in sorted(tiles))

    def _points(self, row: Any, column: Any) -> Array:
        return np.column_stack([self.resolution * column, self.resolution * row, self.heights[row, column]])

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles hold the heights alone."""
        return {name: self.__dict__[name] for name in ("heights", "resolution", "base", "unknown")}

    def __repr__(self) -> str:
        rows, columns = self.heights.shape
        low, high = np.nanmin(self.heights), np.nanmax(self.heights)
        unknown = int((~self._is_known).sum())
        rest = f", {unknown} squares unknown and {self.unknown}" if unknown else ""
        return (
            f"HeightField({rows} x {columns} heights from {low:g} to {high:g} m, {self.resolution:g} m apart, "
            f"base={self.base}{rest})"
        )


def _faces(triangles: list[tuple[Array, Array, Array]]) -> Array:
    """Triangles (n, k, 3, 3) of k lists of corners (n, 3)."""
    return np.stack([np.stack(each, axis=1) for each in triangles], axis=1)


def _fields(shape: HeightField) -> Fields:
    numbers = (*shape.heights.shape, shape.resolution, shape.base, UNKNOWN_IS.index(shape.unknown))
    return Fields(tuple(map(float, numbers)), data=packed(shape.heights.astype("<f8")))


def _make(fields: Fields) -> HeightField:
    rows, columns, resolution, base, choice = fields.dimensions
    if not (rows >= 2 and columns >= 2 and rows * columns <= MOST_HEIGHTS) or rows % 1 or columns % 1:
        raise ShapeError(f"HeightField: expected 2 x 2 to {MOST_HEIGHTS} heights, got {rows:g} x {columns:g}")
    if choice not in range(len(UNKNOWN_IS)):
        raise ShapeError(f"HeightField: expected 0 to 2 for unknown squares, got {choice:g}")
    heights = unpacked(fields.data, "<f8", int(rows * columns), "HeightField").reshape(int(rows), int(columns))
    return HeightField(heights, resolution, base, UNKNOWN_IS[int(choice)])


KIND: Final = dataclasses.replace(
    mesh.KIND,
    number=ShapeType.HEIGHT_FIELD,
    name="height field",
    shape=HeightField,
    dimensions="rows, columns, resolution, base, unknown",
    fields=_fields,
    make=_make,
    mass=tiled_mass,
    scaled=None,
)
