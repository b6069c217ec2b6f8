"""Convex solids and poses as rows of numbers, made once and kept with the object, for kernels that take single pairs.

A kernel takes an array in 50 ns, and a shape table of ten in 2 µs. So the rows cross the border, and the kernel copies
those of a pair into a table with two slots.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined
from collision_monitor.narrow_phase.work_memory import WORK_SIZE
from collision_monitor.shapes.pose import Motion, Pose
from collision_monitor.shapes.registry import KINDS
from collision_monitor.shapes.shape_table import ShapeTable, ShapeTableBuilder

Array = NDArray[np.float64]

PACKED_KINDS: Final = frozenset(kind.shape for kind in KINDS if kind.packed)
"""Classes of the solids that one row of the shape table represents exactly."""

# a packed shape: kind, size (4), radius, number of vertices n, then n of all x, all y, all z and all vertex indices
_SIZE: Final = 1
_RADIUS: Final = 5
_COUNT: Final = 6
_VERTICES: Final = 7

_SECTIONS: Final = {
    "kind": 1,  # the columns of a ShapeTable with two slots
    "size": 8,
    "margin": 2,
    "radius": 2,
    "vertex_start": 1,
    "vertex_count": 1,
    "local_position": 6,
    "local_rotation": 18,
    "rotation": 18,  # rotations (2, 3, 3) to world axes
    "work": WORK_SIZE,
    "vertices": 0,  # (3, n), then the indices (n,) of int32
}
_BEGIN: Final = dict(zip(_SECTIONS, accumulate(_SECTIONS.values(), initial=0), strict=False))
_SIZES, _MARGIN, _RADII, _START = (_BEGIN[name] for name in ("size", "margin", "radius", "vertex_start"))
_COUNTS, _LOCAL_POSITION, _LOCAL_ROTATION = (
    _BEGIN[name] for name in ("vertex_count", "local_position", "local_rotation")
)
_ROTATION, _WORK, _TABLE_VERTICES = (_BEGIN[name] for name in ("rotation", "work", "vertices"))


def packed_shape(shape: Any) -> Array | None:
    """Row of a solid of PACKED_KINDS, kept as its attribute `packed_shape`, because it never changes; else None."""
    if type(shape) not in PACKED_KINDS:
        return None
    builder = ShapeTableBuilder(slots=1, vertices=0)
    builder.append(shape)
    table = builder.used
    count = int(table.vertex_count[0])
    columns = table.kind, table.size[0], table.radius, [count], table.vertices[:, :count].ravel()
    row = np.concatenate([*columns, table.vertex_index[:count]]).astype(np.float64)
    vars(shape)["packed_shape"] = row
    return row


def packed_pose(pose: Any) -> Array | None:
    """Position and quaternion (1, 7) of a Pose, kept as its attribute `packed_pose`; else None.

    The pose's own arrays are read-only, which is another type for numba. Its attribute `point` is the position as three
    numbers.
    """
    if type(pose) is not Pose:
        return None
    row: Array = np.concatenate([pose.position, pose.quaternion])[None]
    vars(pose).update(packed_pose=row, point=tuple(row[0, :3].tolist()))
    return row


def packed_motion(motion: Any) -> Array | None:
    """Pose, linear, angular velocity and acceleration (1, 16) of a Motion, kept as `packed_motion`; else None."""
    if type(motion) is not Motion:
        return None
    vectors = motion.pose.position, motion.pose.quaternion, motion.linear, motion.angular, motion.acceleration
    row: Array = np.concatenate(vectors)[None]
    vars(motion)["packed_motion"] = row
    return row


def pair_memory(vertices: int) -> Array:
    """Memory for pairs of shapes with up to this number of vertices together."""
    return np.zeros(_TABLE_VERTICES + 4 * vertices)


@inlined
def fits(memory, a, at_a, b, at_b):
    """Whether the memory is large enough for the packed shapes that begin at a[at_a] and b[at_b]."""
    return len(memory) >= _TABLE_VERTICES + 4 * (a[at_a + _COUNT] + b[at_b + _COUNT])


@inlined
def load_pair(memory, a, at_a, b, at_b):
    """Copy the packed shapes that begin at a[at_a] and b[at_b] into the memory.

    Return their ShapeTable, rotations (2, 3, 3) for the caller to write, and scratch memory of the pair tests.
    """
    count_a, count_b = int(a[at_a + _COUNT]), int(b[at_b + _COUNT])
    count = count_a + count_b
    end = _TABLE_VERTICES + 3 * count
    table = ShapeTable(
        memory[0:1].view(np.uint8),
        memory[_SIZES:_MARGIN].reshape((2, 4)),
        memory[_MARGIN:_RADII],
        memory[_RADII:_START],
        memory[_START:_COUNTS].view(np.int32),
        memory[_COUNTS:_LOCAL_POSITION].view(np.int32),
        memory[_TABLE_VERTICES:end].reshape((3, count)),
        memory[end : end + count].view(np.int32),
        memory[_LOCAL_POSITION:_LOCAL_ROTATION].reshape((2, 3)),
        memory[_LOCAL_ROTATION:_ROTATION].reshape((2, 3, 3)),
        memory[0:0].reshape((0, 16, 8)),  # no trees
    )
    for slot in range(2):
        packed, at, before, own = (a, at_a, 0, count_a) if slot == 0 else (b, at_b, count_a, count_b)
        table.kind[slot] = np.uint8(packed[at])
        for k in range(4):
            table.size[slot, k] = packed[at + _SIZE + k]
        table.radius[slot] = packed[at + _RADIUS]
        table.vertex_start[slot], table.vertex_count[slot] = before, own
        for k in range(own):
            for c in range(3):
                table.vertices[c, before + k] = packed[at + _VERTICES + c * own + k]
            table.vertex_index[before + k] = np.int32(packed[at + _VERTICES + 3 * own + k])
    return table, memory[_ROTATION:_WORK].reshape((2, 3, 3)), memory[_WORK:_TABLE_VERTICES]
