"""What the kernels of single queries do with their arguments, numbers and arrays one by one.

The arrays of a table cost 20 ns each as arguments, and 200 ns in a named tuple.
"""

from __future__ import annotations

from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.impact.body_impact import Scratch
from collision_monitor.motion.bodies import Parts
from collision_monitor.motion.motion import quaternion_to_matrix
from collision_monitor.shapes.shape_table import ShapeTable


@inlined
def tables_of(
    kind: Any, size: Any, margin: Any, radius: Any, vertex_start: Any, vertex_count: Any, vertices: Any,
    vertex_index: Any, local_position: Any, local_rotation: Any, blocks: Any, next_part: Any, index: Any, placed: Any,
    rotation: Any, quaternion: Any, out: Any, work: Any, tree: Any, answer: Any, triangle: Any, piece: Any,
) -> tuple[ShapeTable, Parts, Scratch]:  # fmt: skip
    """Group the arrays of `Library.arrays` and of a Scratch, which each of these kernels takes first."""
    table = ShapeTable(
        kind, size, margin, radius, vertex_start, vertex_count, vertices, vertex_index, local_position, local_rotation,
        blocks,
    )  # fmt: skip
    parts = Parts(next_part, index, placed)
    return table, parts, Scratch(rotation, quaternion, out, work, tree, answer, triangle, piece)


@inlined
def set_rotation(scratch: Scratch, x: float, y: float, z: float, w: float, R: Any) -> None:
    """Write the rotation matrix (3, 3) of a unit quaternion."""
    q = scratch.quaternion
    q[0, 0], q[0, 1], q[0, 2], q[0, 3] = x, y, z, w
    quaternion_to_matrix(q, 0, R)
