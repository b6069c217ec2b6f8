"""Layout of a body from its shapes: the chain of its parts, its bounding sphere, its spin radius, and what is plain."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.motion.bodies import Multibody
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.shapes.registry import BALL, REVOLVED


def lay_out_body(multibody: Multibody, i: int, slots: Sequence[int], shape_of: Sequence[int]) -> None:
    """Assign the shapes in the table's `slots` to body i. shape_of: index of each in the object's description."""
    _lay_out(multibody, i, np.array(slots), np.array(shape_of))


@settled
@kernel
def _lay_out(multibody: Multibody, i: int, slots: Any, shape_of: Any) -> None:
    table, parts, bodies = multibody
    last = slots.size - 1
    radius = -np.inf
    revolved = True
    for k in range(slots.size):
        s = slots[k]
        parts.index[s] = shape_of[k]
        parts.next[s] = slots[k + 1] if k < last else -1
        x, y, z = table.local_position[s, 0], table.local_position[s, 1], table.local_position[s, 2]
        parts.placed[s] = x != 0.0 or y != 0.0 or z != 0.0 or _is_turned(table.local_rotation[s])
        radius = max(radius, sqrt(x * x + y * y + z * z) + table.radius[s])
        revolved = revolved and x == 0.0 and y == 0.0 and _is_revolved(table, s)
    bodies.first_shape[i] = first = slots[0]
    bodies.motion[i].radius = radius
    # rotation moves every body but a single ball about its origin
    is_round = last == 0 and BALL[table.kind[first]] and not table.local_position[first].any()
    bodies.spin_radius[i] = 0.0 if is_round else radius
    bodies.revolved[i] = revolved


@inlined
def _is_turned(rotation: Any) -> bool:
    for a in range(3):
        for b in range(3):
            if rotation[a, b] != (1.0 if a == b else 0.0):
                return True
    return False


@inlined
def _is_revolved(table: Any, s: int) -> bool:
    """Whether a shape is a solid of revolution about an axis parallel to the z axis of its body."""
    kind = table.kind[s]
    along = abs(table.local_rotation[s, 2, 2]) == 1.0
    return BALL[kind] or (along and REVOLVED[kind])


@settled
@kernel
def note_plain(multibody: Multibody, which: Any) -> None:
    """Note which of the bodies `which` (M,) are plain: one ball or one box without margin, and the object itself.

    A contact of two such bodies then reads one number of each, where it would read five columns to find that out.
    """
    table, parts, bodies = multibody
    for i in which:
        s = bodies.first_shape[i]
        kind = table.kind[s]
        is_alone = parts.next[s] < 0 and not parts.placed[s] and bodies.excess[i] == 0.0
        is_plain = is_alone and (kind == SPHERE or (kind == BOX and table.margin[s] == 0.0))
        bodies.plain[i] = kind if is_plain else 0
