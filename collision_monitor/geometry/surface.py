"""Surface of a triangle mesh: equal vertices welded, connected parts, open edges, orientation.

Two vertices with equal coordinates are one point, although a mesh may list them twice: STL files list three vertices
for each face. Whether a surface encloses a volume is a property of the welded faces.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SHEET: Final = 0.5
"""Length of the sum of the area vectors, as part of the area, from which an open surface counts as a sheet. The sum is
0 for a closed surface, 0.5 for half a sphere and 1 for a plane. Larger: a rough terrain counts as a solid with a hole.
Smaller: a solid that misses a large part counts as a sheet, which has no inside."""


FLAT: Final = 1e-12
"""Largest height over the plane of its largest face, as part of its size, at which a surface lies in that plane.
Larger: a thin shell loses its inside. Smaller: round-off of a pose gives a flat surface an inside, but no hull."""


class Surface:
    """Connectivity of a mesh with vertices (n, 3) in m and faces (m, 3).

    faces (k, 3): its distinct faces, each vertex replaced by the first equal one; a face with two equal vertices and a
    repeated face are left out. vertices: as given.
    """

    def __init__(self, vertices: Array, faces: NDArray[Any]) -> None:
        self.vertices = vertices
        first = first_equal(vertices)
        self.welded = int((first != np.arange(len(first))).sum())
        """Number of vertices that equal an earlier one."""
        welded = first[faces]
        solid = _are_solid(welded)
        kept = _are_distinct(welded[solid])
        self.faces: Indices = welded[solid][kept]
        self.repeated: Indices = np.flatnonzero(solid)[~kept]
        """Indices of the given faces that repeat another, in any order of its vertices. They count once."""

    @cached_property
    def _edges(self) -> tuple[Indices, bool]:
        """Open edges (e, 2), and whether as many faces pass each other edge one way as the other.

        The list of all edges is not kept: a third of a mesh's memory without its tree.
        """
        n, start, end = len(self.vertices), self.faces, np.roll(self.faces, -1, axis=1)
        key = np.minimum(start, end) * n
        key += np.maximum(start, end)
        key = np.sort(2 * key.ravel() + (start < end).ravel())  # sorting numbers is much faster than sorting rows
        forward = (key & 1).astype(bool)
        key >>= 1
        begin = np.flatnonzero(np.append(True, key[1:] != key[:-1])) if len(key) else key
        count = np.diff(begin, append=len(key))
        passes = np.add.reduceat(forward, begin, dtype=np.int64) if len(begin) else count
        odd = count % 2 == 1
        edge = key[begin[odd]]
        return np.column_stack([edge // n, edge % n]), bool((odd | (2 * passes == count)).all())

    @property
    def open_edges(self) -> Indices:
        """Edges (e, 2) that belong to an odd number of faces."""
        return self._edges[0]

    @property
    def closed(self) -> bool:
        """Whether the surface encloses a volume without a gap."""
        return len(self.faces) > 0 and len(self.open_edges) == 0

    @property
    def oriented(self) -> bool:
        """Whether neighbouring faces have the same side outside, at every edge that is not open."""
        return self._edges[1]

    @cached_property
    def part(self) -> Indices:
        """Number (k,) of the connected part of each face."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        start, end = self.faces[:, :2].ravel(), self.faces[:, 1:].ravel()
        ones = np.ones(len(start), np.int8)
        graph = coo_array((ones, (start, end)), shape=(len(self.vertices),) * 2)
        return np.asarray(connected_components(graph, directed=False)[1][self.faces[:, 0]], np.int64)

    @cached_property
    def in_open_part(self) -> NDArray[np.bool_]:
        """Whether each face (k,) belongs to a connected part with an open edge."""
        of_vertex = np.zeros(len(self.vertices), np.int64)
        of_vertex[self.faces] = self.part[:, None]
        return np.isin(self.part, of_vertex[self.open_edges[:, 0]])

    @cached_property
    def sheet(self) -> bool:
        """Whether the open parts look mostly one way, as a terrain or a wall does; a sheet has no inside.

        So is an open surface in one plane, whichever way its faces look. Closed parts beside it have one.
        """
        if self.closed or not len(self.faces):
            return not self.closed
        points = self.vertices[np.unique(self.faces)]
        extent = np.ptp(points, axis=0).max()  # by which lengths are divided, so that no area underflows
        a, b, c = np.moveaxis(self.vertices[self.faces[self.in_open_part]], 1, 0)
        area = np.cross((b - a) / extent, (c - a) / extent)
        size = np.linalg.norm(area, axis=1)
        if self.oriented and np.linalg.norm(area.sum(axis=0)) >= SHEET * size.sum():
            return True
        k = int(np.argmax(size))
        return bool(np.abs((points - a[k]) / extent @ area[k]).max() <= FLAT * size[k])

    @cached_property
    def hole(self) -> Array:
        """Corners (h, 3) of the open edges (m); none if the surface is closed or a sheet.

        A surface that completes the solid is assumed to lie in the convex hull of these points.
        """
        ends = self.open_edges[:0] if self.sheet else self.open_edges
        return np.asarray(self.vertices[np.unique(ends)])

    @property
    def certain(self) -> bool:
        """Whether the winding number of the faces tells what is inside: no hole, and oriented.

        Of a sheet nothing is inside, unless there are closed parts beside it, whose faces alone have to be counted.
        """
        if self.sheet:
            return bool(self.in_open_part.all())
        return self.closed and self.oriented

    @cached_property
    def volume(self) -> float:
        """Enclosed volume (m³) if the surface is closed, negative if the faces look inward."""
        a, b, c = np.moveaxis(self.vertices[self.faces] - self.vertices.mean(axis=0), 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0

    def __str__(self) -> str:
        if self.closed:
            way = "outward" if self.volume >= 0.0 else "inward"
            return f"closed, oriented {way}" if self.oriented else "closed, not oriented"
        kind = "a sheet without an inside" if self.sheet else "its inside is uncertain"
        kind += "" if self.certain or not self.sheet else " beside closed parts"
        return f"open at {len(self.open_edges)} edges, {kind}"


def first_equal(points: Array) -> Indices:
    """Index (n,) of the first point equal to each of the points (n, 3)."""
    first = np.arange(len(points))
    some = _with_equal_key(_mixed((points + 0.0).view(np.uint64)))  # + 0.0: -0 equals 0
    order = some[np.lexsort(points[some].T)]
    ordered = points[order]
    new = np.ones(len(order), bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    # lexsort is stable, so the first of equal points has the smallest index
    first[order] = order[np.maximum.accumulate(np.where(new, np.arange(len(order)), 0))]
    return first


def _mixed(rows: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One number (n,) for each row (n, 3): equal for equal rows, and hardly ever for others."""
    a, b, c = rows.T
    mixed = (a * np.uint64(0x9E3779B97F4A7C15)) ^ (a >> np.uint64(29))
    mixed = (mixed + b) * np.uint64(0xBF58476D1CE4E5B9) ^ (mixed >> np.uint64(31))
    mixed = (mixed + c) * np.uint64(0x94D049BB133111EB)
    return np.asarray(mixed ^ (mixed >> np.uint64(32)))


def _with_equal_key(keys: NDArray[np.uint64]) -> Indices:
    """Indices, ascending, of the keys that occur more than once. Sorting numbers is much faster than sorting rows."""
    ordered = np.sort(keys)
    repeated = ordered[1:][ordered[1:] == ordered[:-1]]
    return np.flatnonzero(np.isin(keys, repeated)) if len(repeated) else np.zeros(0, np.int64)


def _are_solid(faces: Indices) -> NDArray[np.bool_]:
    """Whether the vertices of each face (k, 3) are three."""
    a, b, c = faces.T
    return np.asarray((a != b) & (b != c) & (c != a))


def _are_distinct(faces: Indices) -> NDArray[np.bool_]:
    """Whether each face (k, 3) repeats none before it, in any order of the vertices."""
    ordered = np.sort(faces, axis=1)
    some = _with_equal_key(_mixed(ordered.astype(np.uint64)))
    order = some[np.lexsort(ordered[some].T)]
    repeats = np.zeros(len(faces), bool)
    repeats[order[1:]] = (ordered[order[1:]] == ordered[order[:-1]]).all(axis=1)
    return ~repeats
