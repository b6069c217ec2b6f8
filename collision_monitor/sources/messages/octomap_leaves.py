"""The occupied leaves of an octree as octomap writes it, depth first.

Binary: two bytes for each inner node, two bits for each child: 1 is free, 2 occupied, 3 an inner node, which follows.
Full: for each node its log-odds as float32, its colour of three bytes if it has one, and a byte with a bit for each
child, which follows; a node without children is a leaf. The root is the cube of 2^16 cells about the origin; bits 0, 1
and 2 of a child's number say whether it is the upper one along x, y and z. (Hornung et al., OctoMap, 2013)
"""

from __future__ import annotations

from math import log
from typing import Any, Final

import numpy as np

from collision_monitor._jit import allocating_kernel
from collision_monitor.errors import InputError
from collision_monitor.shapes.kinds.voxels import MOST_VOXELS
from collision_monitor.shapes.registry import Voxels

DEPTH: Final = 16
"""Levels below the root of an octree."""

MOST_BYTES: Final = 64 << 20
"""Bytes of an octree: 0.3 s to read."""

COLOURS: Final = {"OcTree": 0, "OcTreeStamped": 0, "ColorOcTree": 3}
"""Bytes of the colour of a node, for each type of octree in a full map."""

_CUT, _NESTED, _MANY = -1, -2, -3


def octomap_voxels(octomap: Any, probability: float) -> Voxels | None:
    """Return the leaves of an octomap_msgs/Octomap that are occupied with this probability or more; None if none is.

    Raises InputError, ShapeError.
    """
    data = np.array(octomap.data, np.int8).view(np.uint8)
    if len(data) > MOST_BYTES:
        raise InputError(f"data: expected an octree of at most {MOST_BYTES} bytes, got {len(data)}")
    is_full = not octomap.binary
    if is_full and octomap.id not in COLOURS:
        raise InputError(f"id: expected {', '.join(COLOURS)} in a full map, got {str(octomap.id)[:40]!r}")
    if not len(data):
        return None
    cells, edges = np.empty((MOST_VOXELS, 3), np.int32), np.empty(MOST_VOXELS, np.int32)
    colour = COLOURS.get(octomap.id, 0)
    least = np.float32(log(probability / (1.0 - probability)))
    count, at = _read_full(data, colour, least, cells, edges) if is_full else _read_binary(data, cells, edges)
    if count == _CUT:
        raise InputError(f"data: expected a whole octree, got {len(data)} bytes of it: it is cut")
    if count == _NESTED:
        raise InputError(
            f"data: expected {DEPTH} levels, got more at byte {at}: damaged, or of another type than stated"
        )
    if count == _MANY:
        raise InputError(f"data: expected at most {MOST_VOXELS} occupied leaves, got more; publish a coarser map")
    if at < len(data):
        raise InputError(f"data: expected the end at byte {at}, got {len(data)} bytes: of another type than stated")
    half = 1 << (DEPTH - 1)
    return Voxels(cells[:count] - half, float(octomap.resolution), edges[:count]) if count else None


def load_octree_readers() -> None:
    """Load the kernels before messages arrive."""
    cells, edges = np.empty((1, 3), np.int32), np.empty(1, np.int32)
    _read_binary(np.zeros(2, np.uint8), cells, edges)
    _read_full(np.zeros(5, np.uint8), 0, np.float32(1.0), cells, edges)


@allocating_kernel
def _read_binary(data: Any, cells: Any, edges: Any) -> tuple[int, int]:
    """Write the occupied leaves; return their number or what is wrong, and the next byte."""
    if len(data) < 2:
        return _CUT, 0
    stack = np.empty((DEPTH, 5), np.int64)  # bits of the children, the next one, the lower corner
    stack[0] = 0
    stack[0, 0] = np.int64(data[0]) | np.int64(data[1]) << 8
    depth, at, count = 0, 2, 0
    while depth >= 0:  # terminates: each node is read once
        child = stack[depth, 1]
        if child == 8:
            depth -= 1
            continue
        stack[depth, 1] += 1
        bits = (stack[depth, 0] >> (2 * child)) & 3
        if bits < 2:
            continue
        edge = 1 << (DEPTH - 1 - depth)
        x = stack[depth, 2] + (child & 1) * edge
        y = stack[depth, 3] + (child >> 1 & 1) * edge
        z = stack[depth, 4] + (child >> 2) * edge
        if bits == 2:
            if count == len(edges):
                return _MANY, at
            cells[count, 0], cells[count, 1], cells[count, 2], edges[count] = x, y, z, edge
            count += 1
            continue
        if depth + 1 == DEPTH:
            return _NESTED, at
        if at + 2 > len(data):
            return _CUT, at
        depth += 1
        stack[depth, 0] = np.int64(data[at]) | np.int64(data[at + 1]) << 8
        stack[depth, 1], stack[depth, 2], stack[depth, 3], stack[depth, 4] = 0, x, y, z
        at += 2
    return count, at


@allocating_kernel
def _read_full(data: Any, colour: int, least: Any, cells: Any, edges: Any) -> tuple[int, int]:
    """As `_read_binary`. colour: bytes of a node's colour; least: log-odds of an occupied leaf."""
    stack = np.empty((DEPTH + 1, 5), np.int64)
    depth, at, count, size = -1, 0, 0, 5 + colour
    x = y = z = 0
    while True:  # terminates: each node is read once
        if at + size > len(data):
            return _CUT, at
        value, children = data[at : at + 4].view(np.float32)[0], np.int64(data[at + 4 + colour])
        at += size
        depth += 1
        if children == 0 and not value < least:
            if count == len(edges):
                return _MANY, at
            cells[count, 0], cells[count, 1], cells[count, 2] = x, y, z
            edges[count] = 1 << (DEPTH - depth)
            count += 1
        if children != 0 and depth == DEPTH:
            return _NESTED, at
        stack[depth, 0], stack[depth, 1] = children, 0
        stack[depth, 2], stack[depth, 3], stack[depth, 4] = x, y, z
        while depth >= 0:
            while stack[depth, 1] < 8 and not stack[depth, 0] >> stack[depth, 1] & 1:
                stack[depth, 1] += 1
            if stack[depth, 1] < 8:
                break
            depth -= 1
        if depth < 0:
            return count, at
        child, edge = stack[depth, 1], 1 << (DEPTH - 1 - depth)
        stack[depth, 1] += 1
        x = stack[depth, 2] + (child & 1) * edge
        y = stack[depth, 3] + (child >> 1 & 1) * edge
        z = stack[depth, 4] + (child >> 2) * edge
