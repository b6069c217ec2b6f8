"""How far the content of boxes reaches along a direction: a bound by its supports in 26 directions.

These are the axes of a box and the sums of two and of three of them, with all signs. A direction with the components
a >= b >= c >= 0 in the axes is c (1, 1, 1) + (b - c) (1, 1, 0) + (a - b) (1, 0, 0), so the same sum of the supports is
a bound on its own. (Kay, Kajiya, Ray tracing complex scenes, 1986; Klosowski et al., Efficient collision detection
using bounding volume hierarchies of k-DOPs, 1998: supports in fixed directions)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device, inlined
from collision_monitor._jit.lanes import Lanes, load_lanes, store
from collision_monitor._jit.vectors import DOUBLES
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.meshes.boxes import Block, inner
from collision_monitor.meshes.layout import AXES, CENTER, CORNERS_OF_BOX, EDGES, HALF, ROWS, WIDTH
from collision_monitor.meshes.placing import turned_back

PLANES: Final = ((0, 1, 2), (0, 2, 1), (1, 2, 0))
"""Two axes whose sums are in four rows of EDGES, and the third axis."""


@inlined
def content_reach_along(blocks: Any, block: int, member: int, d: Vector) -> float:
    """Bound on the largest d . x over the points x in a box of a tree, in the tree's frame (m, for a unit vector d)."""
    x, y, z = turned_back(blocks, block, member, d)
    p, q, r = int(x < 0.0), int(y < 0.0), int(z < 0.0)
    x, y, z = abs(x), abs(y), abs(z)
    edges, corners = block + EDGES, block + CORNERS_OF_BOX
    c = blocks[block, CENTER, member], blocks[block, CENTER + 1, member], blocks[block, CENTER + 2, member]
    return (
        dot(c, d)
        + min(x, min(y, z)) * blocks[corners, 4 * p + 2 * q + r, member]
        + max(min(x, y) - z, 0.0) * blocks[edges, 2 * p + q, member]
        + max(min(x, z) - y, 0.0) * blocks[edges, 4 + 2 * p + r, member]
        + max(min(y, z) - x, 0.0) * blocks[edges, 8 + 2 * q + r, member]
        + max(x - max(y, z), 0.0) * blocks[block, HALF, member]
        + max(y - max(x, z), 0.0) * blocks[block, HALF + 1, member]
        + max(z - max(x, y), 0.0) * blocks[block, HALF + 2, member]
    )


class Supports:
    """Boxes with the supports of their content while a kernel is compiled."""

    def __init__(self, row: Callable[[int], Lanes]) -> None:
        """row: a row of the blocks of boxes, from the first of them on."""
        self.half = [row(HALF + k) for k in range(3)]
        self._edges = [[row(ROWS * EDGES + 4 * plane + k) for k in range(4)] for plane in range(3)]
        self._corners = [row(ROWS * CORNERS_OF_BOX + k) for k in range(8)]

    def reach(self, along: list[Lanes]) -> Lanes:
        """`content_reach_along` from the centres of the boxes, along directions in their axes."""
        zero = Lanes.constant(along[0].builder, 0.0)
        back, size = [zero - each for each in along], [abs(each) for each in along]
        least = size[0].least(size[1]).least(size[2])
        total = least * _chosen(back, self._corners)
        for (i, j, k), edges in zip(PLANES, self._edges, strict=True):
            lower, upper = size[i].least(size[j]), size[i].largest(size[j])
            total = total.plus_product((lower - size[k]).largest(zero), _chosen([back[i], back[j]], edges))
            total = total.plus_product((size[k] - upper).largest(zero), self.half[k])
        return total


def _chosen(back: list[Lanes], rows: list[Lanes]) -> Lanes:
    """The row of the signs: the second half of the rows where the first number is above 0, and so on."""
    for each in back:
        half = len(rows) // 2
        rows = [rows[half + k].where(each, rows[k]) for k in range(half)]
    return rows[0]


@intrinsic
def _bounds(typing_context: Any, n: Any, u: Any, gaps: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    signature = types.void(n, u, gaps, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def vector(k: int) -> list[Lanes]:
            return [Lanes.constant(builder, number) for number in cgutils.unpack_tuple(builder, arguments[k])]

        members = Block(context, builder, signature.args[3], arguments[3], arguments[4])
        axes, center, supports = members.matrix(AXES), members.vector(CENTER), Supports(members.row)
        gap = Lanes.constant(builder, 0.0)
        for d, beyond in zip((vector(0), vector(1)), vector(2), strict=True):
            along = [inner([axes[r][c] for r in range(3)], d) for c in range(3)]
            gap = gap.largest(beyond - supports.reach(along) - inner(d, center))
        store(context, builder, gap * gap, signature.args[5], arguments[5], arguments[6])
        return context.get_dummy_value()

    return signature, codegen


@device
def support_bounds(n: Vector, u: Vector, gaps: Any, blocks: Any, block: int, out: Any, at: int) -> None:
    """Write lower bounds on the squared distances of eight boxes from something to out[at: at + 8] (m^2).

    n, u: unit directions from the boxes to it. gaps: how far it begins along each of them (m). A bound of 0 says that
    they may overlap.
    """
    _bounds(n, u, gaps, blocks, block, out, at)


# the directions as vectors, 8 after 8: 12 sums of two axes, 4 unused, 8 sums of three axes
_SIGNS: Final = [1.0, -1.0]
_DIRECTIONS: Final = np.array(
    [
        *((s, t, 0.0) for s in _SIGNS for t in _SIGNS),
        *((s, 0.0, t) for s in _SIGNS for t in _SIGNS),
        *((0.0, s, t) for s in _SIGNS for t in _SIGNS),
        *((0.0, 0.0, 0.0) for _ in range(4)),
        *((s, t, u) for s in _SIGNS for t in _SIGNS for u in _SIGNS),
    ]
)

REACHES: Final = len(_DIRECTIONS)
"""Numbers of `extend`."""


@intrinsic
def _extend(typing_context: Any, x: Any, reach: Any) -> Any:
    signature = types.void(x, reach)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        point = [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0])]
        array = signature.args[1], arguments[1]
        for at in range(0, REACHES, WIDTH):
            rows = _DIRECTIONS[at : at + WIDTH]
            columns = [[row[c] for row in rows] for c in range(3)]
            columns.append([sum(map(abs, row)) ** 0.5 for row in rows])  # a ball reaches as far as they are long
            d = [Lanes(builder, ir.Constant(DOUBLES, column)) for column in columns]
            far = inner(d[:3], point[:3]).plus_product(d[3], point[3])
            place = ir.IntType(64)(at)
            known = load_lanes(context, builder, *array, place)
            store(context, builder, known.largest(far), *array, place)
        return context.get_dummy_value()

    return signature, codegen


@device
def extend(x: Vector, radius: float, reach: Any) -> None:
    """Extend the supports reach (REACHES,) by a ball about x in a box's axes, from its centre (m)."""
    _extend((x[0], x[1], x[2], radius), reach)


@device
def extend_by_box(x: Vector, blocks: Any, block: int, member: int, reach: Any) -> None:
    """Extend the supports by those of a box with the same axes and the centre x."""
    for k in range(12):
        d = _DIRECTIONS[k]
        reach[k] = max(reach[k], blocks[block + EDGES, k, member] + dot(d, x))
    for k in range(8):
        d = _DIRECTIONS[16 + k]
        reach[16 + k] = max(reach[16 + k], blocks[block + CORNERS_OF_BOX, k, member] + dot(d, x))


@device
def write_supports(reach: Any, slack: float, blocks: Any, block: int, member: int) -> None:
    """Write supports of a member of a block of boxes, enlarged as its half extents are by the slack (m)."""
    for k in range(12):
        blocks[block + EDGES, k, member] = reach[k] + 2.0 * slack
    for k in range(8):
        blocks[block + CORNERS_OF_BOX, k, member] = reach[16 + k] + 3.0 * slack
