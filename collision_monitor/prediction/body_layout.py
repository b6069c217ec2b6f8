"""Layout of a body from its shapes: the chain of its parts, its bounding sphere, its spin radius, and what is plain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.shape_table import BOX, CAPSULE, CIRCLE, CONE, CYLINDER, SPHERE, ShapeTable
from collision_monitor.prediction.bodies import Multibody

_REVOLVED = [SPHERE, CIRCLE, CAPSULE, CYLINDER, CONE]
"""Kinds that are solids of revolution about the z axis of their shape."""


def lay_out_body(multibody: Multibody, i: int, slots: Sequence[int], shape_of: Sequence[int]) -> None:
    """Assign the shapes in the table's `slots` to body i. shape_of: index of each in the object's description."""
    table, parts, bodies = multibody
    chain = np.asarray(slots)
    bodies.first_shape[i] = slots[0]
    parts.index[chain] = shape_of
    parts.next[chain[:-1]] = chain[1:]
    parts.next[chain[-1]] = -1
    position = table.local_position[chain]
    is_turned = (table.local_rotation[chain] != np.eye(3)).any(axis=(1, 2))
    parts.placed[chain] = is_turned | position.any(axis=1)
    radius = float((np.linalg.norm(position, axis=1) + table.radius[chain]).max())
    bodies.motion["radius"][i] = radius
    is_round = len(slots) == 1 and table.kind[slots[0]] in (SPHERE, CIRCLE) and not position.any()
    bodies.spin_radius[i] = 0.0 if is_round else radius  # rotation moves every body but a single ball about its origin
    bodies.revolved[i] = bool(_are_revolved(table, chain).all())


def _are_revolved(table: ShapeTable, slots: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether shapes are solids of revolution about the z axis of their body, up to its direction."""
    on_axis = (table.local_position[slots, :2] == 0.0).all(axis=1)
    along = np.abs(table.local_rotation[slots, 2, 2]) == 1.0
    is_ball = np.isin(table.kind[slots], [SPHERE, CIRCLE])
    return np.asarray(np.isin(table.kind[slots], _REVOLVED) & on_axis & (along | is_ball))


def note_plain(multibody: Multibody, which: NDArray[np.intp]) -> None:
    """Note which of the bodies `which` (M,) are plain: one ball or one box without margin, and the object itself.

    A contact of two such bodies then reads one number of each, where it would read five columns to find that out.
    """
    table, parts, bodies = multibody
    shape = bodies.first_shape[which]
    kind = table.kind[shape]
    is_alone = (parts.next[shape] < 0) & ~parts.placed[shape] & (bodies.excess[which] == 0.0)
    is_plain = is_alone & ((kind == SPHERE) | (kind == BOX) & (table.margin[shape] == 0.0))
    bodies.plain[which] = np.where(is_plain, kind, 0)
