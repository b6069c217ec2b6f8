"""Broad phase for bodies that all move: counts the bodies into cells, sorts them by cell, compares row by row.

Each size class (`size_classes`) has its own cells, as wide as its largest body. The cells of a class form a dense array
if their number is a small multiple of the number of bodies, else a hash table, so that empty space costs nothing. In
both, the cells of a row along x are adjacent, so the three cells that a body reaches in a row hold one contiguous range
of bodies.
Source: lecture slides "Efficient collision detection: spatial partitioning" (uniform, hashed and multiresolution
grids); counting sort by cell: Green, "Particle simulation using CUDA", 2010.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor._jit.prefetch import prefetch
from collision_monitor._jit.vectors import LANES
from collision_monitor.broad_phase.lanes import boxes_overlap, lowest_bit, spheres_overlap_lanes
from collision_monitor.broad_phase.region import Region
from collision_monitor.broad_phase.size_classes import ABSENT, OCTAVES, STARTING, classify
from collision_monitor.tolerances import EPSILON

DENSE: Final = 4
"""Cells per body up to which a class has a dense array, since filling it must not cost more than the search."""

FEWEST_CELLS: Final = 64
"""Number of cells allowed for any class, however few its bodies are."""

STRIP: Final = 2
"""log2 of the number of rows in a strip of cells."""

FARTHEST_CELL: Final = 2.0**52
"""Hashed cell coordinates are clipped here, where float64 still represents every integer; bodies beyond share cells."""

AHEAD: Final = 8
"""Iterations between prefetch and use: 100,000 bodies fit into no cache and are not in the order of the cells."""

PAD: Final = LANES
"""Elements behind the last sorted body that a vector load may read."""

_HASHED, _DENSE, _WHOLE = 0, 1, 2
_FIRST, _COUNT, _BASE, _MODE, _NX, _NY, _NZ, _STRIP = range(8)
_INVERSE, _REACH, _LARGEST = range(3)


class CellGrid(NamedTuple):
    """Scratch memory for N bodies. Classes of bodies that start a search come first; class 0 is the unbounded ones."""

    klass: Any  # (N,) uint8
    bucket: Any  # (N,) int32: the body's cell, numbered over all classes
    start: Any  # (T + 2,) int32: first place of each cell in `order`
    order: Any  # (N,) int32: the bodies sorted by cell
    layout: Any  # (ABSENT + 1, 8) int64, per class: first place, count, first cell, mode, cells along x, y, z, strip
    scale: Any  # (ABSENT + 1, 3) float64: 1 / cell width (1/m), largest half extent (m) with round-off, and without
    origin: Any  # (3,) float64: lower corner of the dense cells (m)
    centre: Any  # (3, N + PAD) float64, sorted by cell


class Bounds(NamedTuple):
    """Bounds of the bodies, in the order of the grid's places: boxes, or spheres with their radii in row 0."""

    extent: Any  # (3, N + PAD) float64: half extents or radii (m)
    balls: bool


def make_grid(capacity: int) -> CellGrid:
    """Allocate scratch memory for up to `capacity` bodies."""
    cells = DENSE * capacity + (ABSENT + 1) * FEWEST_CELLS
    return CellGrid(
        klass=np.zeros(capacity, np.uint8),
        bucket=np.zeros(capacity, np.int32),
        start=np.zeros(cells + 2, np.int32),
        order=np.zeros(capacity, np.int32),
        layout=np.zeros((ABSENT + 1, 8), np.int64),
        scale=np.zeros((ABSENT + 1, 3)),
        origin=np.zeros(3),
        centre=np.zeros((3, capacity + PAD)),
    )


@inlined
def _hash(y: Any, z: Any) -> Any:
    h = np.uint64(y) * np.uint64(0x9E3779B97F4A7C15)
    h = (h ^ (h >> np.uint64(29)) ^ np.uint64(z)) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0x94D049BB133111EB)
    return np.int64(h >> np.uint64(34))


@inlined
def _dense(x: float, origin: float, inverse: float) -> Any:
    return np.int64((x - origin) * inverse)


@inlined
def _row(y: Any, z: Any, nz: Any, strip: Any) -> Any:
    """Index of the row of cells (y, z)."""
    return (((y >> strip) * nz + z) << strip) + (y & ((1 << strip) - 1))


@inlined
def _hashed(x: float, inverse: float) -> Any:
    return np.int64(min(max(np.floor(x * inverse), -FARTHEST_CELL), FARTHEST_CELL))


@device
def measure_classes(size: Any, grid: Any) -> None:
    """Count the bodies of each class and find its largest half extent; call after `classify`."""
    grid.layout[:] = 0
    grid.scale[:] = 0.0
    for i in range(size.size):
        k = grid.klass[i]
        grid.layout[k, _COUNT] += 1
        grid.scale[k, _LARGEST] = max(grid.scale[k, _LARGEST], size[i])


@device
def plan_cells(lx: float, ly: float, lz: float, hx: float, hy: float, hz: float, grid: Any) -> Any:
    """Choose the cells of each class for centres between the corners l and h (m); call after `measure_classes`.

    Returns the number of cells over all classes; the last cell holds the absent bodies.
    """
    layout, scale = grid.layout, grid.scale
    grid.origin[0], grid.origin[1], grid.origin[2] = lx, ly, lz
    # round-off of a difference of two coordinates and of the product with 1 / cell width
    slack = 32.0 * EPSILON * max(abs(lx), abs(ly), abs(lz), abs(hx), abs(hy), abs(hz))
    first = cells = np.int64(0)
    for k in range(ABSENT + 1):
        count = layout[k, _COUNT]
        layout[k, _FIRST] = first
        layout[k, _BASE] = cells
        layout[k, _MODE] = _WHOLE
        first += count
        if count == 0:
            continue
        if k == 0 or k == STARTING or k == ABSENT:
            scale[k, _REACH] = np.inf
            cells += 1
            continue
        reach = scale[k, _LARGEST] * (1.0 + 16.0 * EPSILON) + slack
        scale[k, _REACH] = reach
        inverse = 1.0 / max(2.0 * reach, 1e-150)
        scale[k, _INVERSE] = inverse
        nx = np.floor((hx - lx) * inverse) + 1.0
        ny = np.floor((hy - ly) * inverse) + 1.0
        nz = np.floor((hz - lz) * inverse) + 1.0
        # rows in strips, so that neighbouring rows are close in memory and stay in the cache in large scenes too
        strip = STRIP if ny >= 4.0 * 2.0**STRIP else 0
        rows = np.ceil(ny * 0.5**strip) * 2.0**strip * nz
        if nx * rows <= max(DENSE * count, FEWEST_CELLS):
            layout[k, _MODE] = _DENSE
            layout[k, _STRIP] = strip
            layout[k, _NX] = np.int64(nx)
            layout[k, _NY] = np.int64(ny)
            layout[k, _NZ] = np.int64(nz)
            cells += np.int64(nx * rows)
        else:
            buckets = np.int64(FEWEST_CELLS)
            while buckets < 2 * count:
                buckets *= 2
            layout[k, _MODE] = _HASHED
            layout[k, _NX] = buckets - 1
            cells += buckets
    return cells


@device
def find_buckets(centre: Any, grid: Any, begin: int, end: int) -> None:
    """Compute the cell of the bodies begin ... end - 1."""
    ox, oy, oz = grid.origin[0], grid.origin[1], grid.origin[2]
    for i in range(begin, end):
        k = grid.klass[i]
        bucket = grid.layout[k, _BASE]
        mode = grid.layout[k, _MODE]
        inverse = grid.scale[k, _INVERSE]
        if mode == _DENSE:
            x = _dense(centre[i, 0], ox, inverse)
            y = _dense(centre[i, 1], oy, inverse)
            z = _dense(centre[i, 2], oz, inverse)
            bucket += _row(y, z, grid.layout[k, _NZ], grid.layout[k, _STRIP]) * grid.layout[k, _NX] + x
        elif mode == _HASHED:
            row = _hash(_hashed(centre[i, 1], inverse), _hashed(centre[i, 2], inverse))
            bucket += (_hashed(centre[i, 0], inverse) + row) & grid.layout[k, _NX]
        grid.bucket[i] = bucket


@device
def sort_by_cell(n: int, cells: int, grid: Any) -> None:
    """Counting sort: fills grid.order, and grid.start so that cell c holds the places start[c] ... start[c + 1] - 1."""
    start, bucket, order = grid.start, grid.bucket, grid.order
    start[: cells + 2] = 0
    for i in range(n):
        start[bucket[i] + 2] += 1
    total = 0
    for c in range(2, cells + 2):
        total += start[c]
        start[c] = total
    for i in range(n):
        place = start[bucket[i] + 1]
        order[place] = i
        start[bucket[i] + 1] = place + 1


@device
def gather_centres(centre: Any, grid: Any, begin: int, end: int) -> None:
    """Copy the centres of the places begin ... end - 1 into the order of the cells."""
    for p in range(begin, end):
        prefetch(centre, np.intp(grid.order[min(p + AHEAD, end - 1)]))
        i = grid.order[p]
        grid.centre[0, p] = centre[i, 0]
        grid.centre[1, p] = centre[i, 1]
        grid.centre[2, p] = centre[i, 2]


@inlined
def searches(grid: Any, a: int, b: int) -> bool:
    """Return whether bodies of class a search class b: their own, coarser ones, and classes that start no search."""
    return (b <= a or b >= STARTING) and grid.layout[a, _COUNT] > 0 and grid.layout[b, _COUNT] > 0


@inlined
def class_is_empty(grid: Any, a: int) -> bool:
    """Return whether class a has no bodies."""
    return grid.layout[a, _COUNT] == 0


@inlined
def places(grid: Any, a: int) -> Any:
    """First place of class a and the place behind its last."""
    return grid.layout[a, _FIRST], grid.layout[a, _FIRST] + grid.layout[a, _COUNT]


@inlined
def keep_overlapping(grid: Any, bounds: Any, p: int, low: int, high: int, found: Any, n: int) -> int:
    """Append the places low ... high - 1 with bounds that overlap those of place p to found[n:]; return the new n."""
    x, y, z = grid.centre[0, p], grid.centre[1, p], grid.centre[2, p]
    own = Region(x, y, z, bounds.extent[0, p], bounds.extent[1, p], bounds.extent[2, p])
    for q in range(low, max(high, low + 1), LANES):  # also tests an empty range, which is cheaper than a branch
        if bounds.balls:
            bits = spheres_overlap_lanes(grid.centre, bounds.extent, q, own)
        else:
            bits = boxes_overlap(grid.centre, bounds.extent, q, own)
        bits &= (1 << max(min(high - q, LANES), 0)) - 1
        while bits != 0:
            found[n] = q + lowest_bit(bits)
            n += 1
            bits &= bits - 1
    return n


@inlined
def _of_row(grid: Any, inverse: float, y: int, z: int, found: Any, begin: int, n: int) -> int:
    """Keep the places in found[begin:n] that are in the row (y, z), as other rows can hash to the same cells."""
    kept = begin
    for m in range(begin, n):
        q = found[m]
        if _hashed(grid.centre[1, q], inverse) == y and _hashed(grid.centre[2, q], inverse) == z:
            found[kept] = q
            kept += 1
    return kept


@inlined
def _clamped(x: float, origin: float, inverse: float, last: int) -> Any:
    return np.int64(min(max((x - origin) * inverse, 0.0), np.float64(last)))


@inlined
def _in_dense_cells(grid: Any, bounds: Any, a: int, b: int, p: int, found: Any, n: int) -> int:
    """`partners` in a class whose cells form an array."""
    base = grid.layout[b, _BASE]
    nx, ny, nz, strip = grid.layout[b, _NX], grid.layout[b, _NY], grid.layout[b, _NZ], grid.layout[b, _STRIP]
    inverse = grid.scale[b, _INVERSE]
    cx, cy, cz = grid.centre[0, p], grid.centre[1, p], grid.centre[2, p]
    rx, ry, rz = _reaches(grid, bounds, b, p)
    ox, oy, oz = grid.origin[0], grid.origin[1], grid.origin[2]
    x0 = _clamped(cx - rx, ox, inverse, nx - 1)
    x1 = _clamped(cx + rx, ox, inverse, nx - 1)
    y0 = _clamped(cy - ry, oy, inverse, ny - 1)
    y1 = _clamped(cy + ry, oy, inverse, ny - 1)
    z0 = _clamped(cz - rz, oz, inverse, nz - 1)
    z1 = _clamped(cz + rz, oz, inverse, nz - 1)
    if a == b:
        # earlier rows search towards this one; the loop visits all rows ahead, as a data-dependent end costs more
        z0 = _dense(cz, oz, inverse)
        own = _dense(cy, oy, inverse)
        y0, y1, z1 = max(own - 1, 0), min(own + 1, ny - 1), min(z0 + 1, nz - 1)
        row = base + _row(own, z0, nz, strip) * nx
        n = keep_overlapping(grid, bounds, p, p + 1, grid.start[row + x1 + 1], found, n)
        if own < y1:
            row = base + _row(y1, z0, nz, strip) * nx
            n = keep_overlapping(grid, bounds, p, grid.start[row + x0], grid.start[row + x1 + 1], found, n)
        z0 += 1
    for z in range(z0, z1 + 1):
        for y in range(y0, y1 + 1):
            row = base + _row(y, z, nz, strip) * nx
            n = keep_overlapping(grid, bounds, p, grid.start[row + x0], grid.start[row + x1 + 1], found, n)
    return n


@inlined
def _in_hashed_cells(grid: Any, bounds: Any, a: int, b: int, p: int, found: Any, n: int) -> int:
    """`partners` in a class whose cells are in a hash table."""
    base, nx, inverse = grid.layout[b, _BASE], grid.layout[b, _NX], grid.scale[b, _INVERSE]
    cx, cy, cz = grid.centre[0, p], grid.centre[1, p], grid.centre[2, p]
    rx, ry, rz = _reaches(grid, bounds, b, p)
    x0, x1 = _hashed(cx - rx, inverse), _hashed(cx + rx, inverse)
    y0, y1 = _hashed(cy - ry, inverse), _hashed(cy + ry, inverse)
    z0, z1 = _hashed(cz - rz, inverse), _hashed(cz + rz, inverse)
    own_y, own_z = _hashed(cy, inverse), _hashed(cz, inverse)
    if a == b:
        z0 = own_z
    for z in range(z0, z1 + 1):
        for y in range(own_y if a == b and z == own_z else y0, y1 + 1):
            begin = n
            x = x0 + _hash(y, z)
            end = x + (x1 - x0) + 1
            while x < end:
                # the run of cells wraps around at the end of the table
                cell = x & nx
                run = min(end - x, nx + 1 - cell)
                low = grid.start[base + cell]
                if a == b and z == own_z and y == own_y:
                    low = max(low, p + 1)
                n = keep_overlapping(grid, bounds, p, low, grid.start[base + cell + run], found, n)
                x += run
            n = _of_row(grid, inverse, y, z, found, begin, n)
    return n


@inlined
def _reaches(grid: Any, bounds: Any, b: int, p: int) -> Any:
    """How far (m) the centre of a body of class b that overlaps place p may be along x, y and z."""
    reach = grid.scale[b, _REACH]
    rx = bounds.extent[0, p] * (1.0 + 16.0 * EPSILON) + reach
    ry = rx if bounds.balls else bounds.extent[1, p] * (1.0 + 16.0 * EPSILON) + reach
    rz = rx if bounds.balls else bounds.extent[2, p] * (1.0 + 16.0 * EPSILON) + reach
    return rx, ry, rz


@inlined
def partners(grid: Any, bounds: Any, a: int, b: int, p: int, found: Any, n: int) -> int:
    """Append to found[n:] the places of class b that overlap place p of class a; if a == b, each pair only once.

    `found` must have room for all bodies of the class and one more.
    """
    mode = grid.layout[b, _MODE]
    if mode == _DENSE:
        return _in_dense_cells(grid, bounds, a, b, p, found, n)
    first, count, inverse = grid.layout[b, _FIRST], grid.layout[b, _COUNT], grid.scale[b, _INVERSE]
    rx, ry, rz = _reaches(grid, bounds, b, p)
    rows = (2.0 * ry * inverse + 2.0) * (2.0 * rz * inverse + 2.0)
    if mode == _WHOLE or (a != b and not rows * (2.0 * rx * inverse + 2.0) < count):
        low = p + 1 if a == b else first
        return keep_overlapping(grid, bounds, p, low, first + count, found, n)
    return _in_hashed_cells(grid, bounds, a, b, p, found, n)


@allocating_kernel
def classify_bodies(size: Any, starts: Any, grid: Any) -> None:
    """Assign bodies with half extents `size` (N,) m to classes, once for many frames."""
    classify(size, starts, np.empty((OCTAVES, 2), np.int64), np.empty((OCTAVES, 2)), grid)
    measure_classes(size, grid)
