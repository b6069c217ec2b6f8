"""The bodies of a scene and their shapes as the kernels read them: structure of arrays."""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import inlined
from collision_monitor._jit.alignment import columns_in_one_block
from collision_monitor.geometry.vector import Vector
from collision_monitor.motion.motion import MOTION

LAST_STATE: Final = np.dtype(
    [
        ("position", np.float64, 3),
        ("quaternion", np.float64, 4),
        ("linear", np.float64, 3),
        ("angular", np.float64, 3),
        ("acceleration", np.float64, 3),  # 0 where it is not measured; of its Course
    ]
)
"""The last state of a body: two cache lines, because a contact reads it whole, of bodies in random memory order."""


class BodyTable(NamedTuple):
    """N slots of bodies: a structure of arrays, except for the motions and the last states. World frame, SI units."""

    used: Any  # (N,) bool: the slot holds a body
    id: Any  # (N,) uint32
    version: Any  # (N,) uint32: incremented whenever the motion changes
    static: Any  # (N,) bool
    seen: Any  # (N,) bool: the body has a state (static bodies always have)
    group: Any  # (N,) uint32
    mask: Any  # (N,) uint32
    first_shape: Any  # (N,) int32: slot in the shape table; further shapes follow by Parts.next
    spin_radius: Any  # (N,) float64: distance of the farthest point that rotation moves (m); 0: none
    plain: Any  # (N,) uint8: kind of its only shape, a ball or a box; 0: not plain (`note_plain`)
    revolved: Any  # (N,) bool: all shapes are solids of revolution about the body's z axis
    model: Any  # (N,) uint8: records.Model that represents the object
    excess: Any  # (N,) float64: largest distance by which the model exceeds the object (m)
    concave: Any  # (N,) bool: a concave object has a convex model, which may overlap where the object is not
    slack: Any  # (N,) float64: largest time beyond the horizon that is predicted (s); 0: not set
    motion: Any  # (N,) MOTION
    ref_quaternion: Any  # (N, 4): the reference motion's orientation at its time
    time: Any  # (N,) float64: of the last state
    position: Any  # (N, 3): columns of LAST_STATE
    quaternion: Any  # (N, 4)
    linear: Any  # (N, 3)
    angular: Any  # (N, 3)
    acceleration: Any  # (N, 3)
    course: Any  # (N,) uint8: kind of the Course from the last state on
    rest: Any  # (N,) float64: s after the last state, from which on the body stands; read if the course is not straight
    planned: Any  # (N,) bool: the body follows a plan, and its motion is one of the pieces
    pieces: Any  # (M,) MOTION: the pieces of the plans of all bodies, those of a plan one after the other


DERIVED: Final = ("plain", "planned", "pieces")
"""Columns that follow from the others and from the shapes, or belong to `Plans`; the bodies' snapshot lacks them."""


class Parts(NamedTuple):
    """The assignment of the shapes in the table to bodies; K slots, like the table."""

    next: Any  # (K,) int32: the body's next shape, -1 after the last
    index: Any  # (K,) uint32: its place in the body's description
    placed: Any  # (K,) bool: its pose in the body's frame is not the identity


class Multibody(NamedTuple):
    """All bodies with their shapes: the argument that nearly every kernel takes first."""

    table: Any  # geometry.shape_table.ShapeTable
    parts: Parts
    bodies: BodyTable


_COLUMNS: Final[dict[str, Any]] = {
    **dict.fromkeys(("used", "static", "seen", "revolved", "concave", "planned"), np.bool_),
    **dict.fromkeys(("id", "version", "group", "mask"), np.uint32),
    **dict.fromkeys(("spin_radius", "excess", "slack", "time", "rest"), np.float64),
    **dict.fromkeys(("plain", "model", "course"), np.uint8),
    "first_shape": np.int32,
    "motion": MOTION,
    "ref_quaternion": (np.float64, 4),
    "state": LAST_STATE,
}


def make_bodies(capacity: int) -> BodyTable:
    """Make `capacity` empty slots."""
    columns = columns_in_one_block(capacity, _COLUMNS)
    state = columns.pop("state")
    fields = {name: state[name] for name in state.dtype.names or ()}
    bodies = BodyTable(**columns, **fields, pieces=np.zeros(0, MOTION))
    bodies.first_shape[:] = -1
    bodies.motion["covered"] = -np.inf
    bodies.rest[:] = bodies.motion["rest"] = bodies.motion["until"] = np.inf
    return bodies


def make_parts(capacity: int) -> Parts:
    """Make `capacity` slots without shapes."""
    return Parts(np.full(capacity, -1, np.int32), np.zeros(capacity, np.uint32), np.zeros(capacity, np.bool_))


def enlarge(source: NamedTuple, target: NamedTuple) -> None:
    """Copy the arrays of `source` to the front of those of `target`."""
    for old, new in zip(source, target, strict=True):
        new[: len(old)] = old


@inlined
def place_shape(table: Any, parts: Parts, s: int, R_body: Any, R_shape: Any) -> Vector:
    """Write the rotation of shape s of a body with rotation R_body into R_shape; return its offset from the body (m).

    Both are in world axes.
    """
    if not parts.placed[s]:
        for r in range(3):
            for c in range(3):
                R_shape[r, c] = R_body[r, c]
        return 0.0, 0.0, 0.0
    x, y, z = table.local_position[s, 0], table.local_position[s, 1], table.local_position[s, 2]
    for r in range(3):
        for c in range(3):
            R_shape[r, c] = (
                R_body[r, 0] * table.local_rotation[s, 0, c]
                + R_body[r, 1] * table.local_rotation[s, 1, c]
                + R_body[r, 2] * table.local_rotation[s, 2, c]
            )
    return (
        R_body[0, 0] * x + R_body[0, 1] * y + R_body[0, 2] * z,
        R_body[1, 0] * x + R_body[1, 1] * y + R_body[1, 2] * z,
        R_body[2, 0] * x + R_body[2, 1] * y + R_body[2, 2] * z,
    )


@inlined
def next_pair(parts: Parts, first_b: int, a: int, b: int) -> tuple[int, int]:
    """The pair of shapes after (a, b) of two bodies, in the order of both chains; a is -1 after the last pair.

    first_b: first shape of the second body. A loop over all pairs of shapes:

        a, first_b = bodies.first_shape[i], bodies.first_shape[j]
        b = first_b
        while a >= 0:
            if b == first_b: ...  # depends on a alone
            ...
            a, b = next_pair(parts, first_b, a, b)
    """
    b = parts.next[b]
    if b < 0:
        a, b = parts.next[a], first_b
    return a, b


@inlined
def chain_radius(table: Any, parts: Parts, first: int) -> float:
    """Radius (m) of a sphere about the origin of a chain of shapes that contains them."""
    s, radius = first, 0.0
    while s >= 0:
        x, y, z = table.local_position[s, 0], table.local_position[s, 1], table.local_position[s, 2]
        radius = max(radius, sqrt(x * x + y * y + z * z) + table.radius[s])
        s = parts.next[s]
    return radius
