"""Table of the pair tests: the test for each pair of kinds of shape.

Pairs are first brought into a canonical order (by kind, then by slot), so that swapping A and B mirrors the result bit
by bit. The kernels below look the test up in the table. Each test is in the file of this folder with its name.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.geometry.vector import Vector
from collision_monitor.narrow_phase.box_box import box_box_contact, box_box_separation
from collision_monitor.narrow_phase.capsule_capsule import capsule_capsule_contact
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    CONTACT_SIZE,
    DISTANCE,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
)
from collision_monitor.narrow_phase.convex_convex import convex_contact, convex_separation
from collision_monitor.narrow_phase.core import half_extents
from collision_monitor.narrow_phase.cylinder_cylinder import is_parallel, parallel_cylinders_contact
from collision_monitor.narrow_phase.gjk import EXACT, Accuracy
from collision_monitor.narrow_phase.half_space import half_space_contact, half_spaces_contact
from collision_monitor.narrow_phase.pair_pose import PairPose, pair_pose, swapped
from collision_monitor.narrow_phase.polygon_polygon import planar_contact
from collision_monitor.narrow_phase.sphere_box import sphere_box_contact, sphere_box_separation
from collision_monitor.narrow_phase.sphere_solid import sphere_solid_contact
from collision_monitor.narrow_phase.sphere_sphere import sphere_sphere_contact, sphere_sphere_separation
from collision_monitor.narrow_phase.work_memory import WORK_SIZE
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.capsule import CAPSULE
from collision_monitor.shapes.kinds.circle import CIRCLE
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.shapes.registry import CURVED, KINDS

TEST_METHODS: Final = {
    "sphere_sphere": "centres",
    "sphere_box": "clamping",
    "capsule_capsule": "closest points of segments",
    "sphere_solid": "distance of the centre",
    "cylinder_cylinder": "closed form where the axes are parallel, else GJK and EPA",
    "box_box": "SAT",
    "half_space": "support distance",
    "polygon_polygon": "SAT in the plane",
    "convex_convex": "GJK and EPA",
}
"""Methods of the tests; the keys are the names of their files."""

(
    SPHERE_SPHERE,
    SPHERE_BOX,
    CAPSULE_CAPSULE,
    SPHERE_SOLID,
    CYLINDER_CYLINDER,
    BOX_BOX,
    HALF_SPACE_ANY,
    POLYGON_POLYGON,
    CONVEX_CONVEX,
) = range(len(TEST_METHODS))

PAIR_TESTS: Final = {
    (SPHERE, SPHERE): SPHERE_SPHERE,
    (SPHERE, BOX): SPHERE_BOX,
    (SPHERE, CAPSULE): CAPSULE_CAPSULE,
    (SPHERE, CYLINDER): CYLINDER_CYLINDER,
    (BOX, BOX): BOX_BOX,
    (CAPSULE, CAPSULE): CAPSULE_CAPSULE,
    (CAPSULE, CYLINDER): CYLINDER_CYLINDER,
    (CYLINDER, CYLINDER): CYLINDER_CYLINDER,
    (CIRCLE, CIRCLE): POLYGON_POLYGON,
    (CIRCLE, POLYGON): POLYGON_POLYGON,
    (POLYGON, POLYGON): POLYGON_POLYGON,
}
"""Pairs of kinds with a test of their own, the smaller kind first. Any solid and a half-space have HALF_SPACE_ANY, a
sphere and a solid with an exact distance SPHERE_SOLID, all others CONVEX_CONVEX. Plane shapes never meet solids."""

_TEST_OF: Final = np.full((len(CURVED), len(CURVED)), CONVEX_CONVEX, np.uint8)
"""The test for the kernels: a row for each kind of A, a column for each kind of B."""

_TEST_OF[:, HALF_SPACE] = HALF_SPACE_ANY
_TEST_OF[SPHERE, [kind.number for kind in KINDS if kind.exact]] = SPHERE_SOLID
for _kinds, _test in PAIR_TESTS.items():
    _TEST_OF[_kinds] = _test


def pair_test(kind_a: int, kind_b: int) -> str:
    """Name of the test of two kinds, and of its file."""
    first, second = sorted((kind_a, kind_b), key=lambda kind: (kind == HALF_SPACE, kind))
    return tuple(TEST_METHODS)[_TEST_OF[first, second]]


@inlined
def is_second(table: Any, a: int, b: int, p: Vector) -> bool:
    """Whether the canonical order of two shapes is b, a. p: B's origin relative to A's (m).

    It depends on the shapes alone, not on their slots, so that an answer has the same bits whatever was asked before.
    """
    ka, kb = table.kind[a], table.kind[b]
    if ka != kb:
        return ka == HALF_SPACE or (ka > kb and kb != HALF_SPACE)
    for c in range(3):
        if table.size[a, c] != table.size[b, c]:
            return table.size[a, c] > table.size[b, c]
    if table.radius[a] != table.radius[b]:
        return table.radius[a] > table.radius[b]
    return p[0] > 0.0 or (p[0] == 0.0 and (p[1] > 0.0 or (p[1] == 0.0 and p[2] > 0.0)))


@inlined
def separation(table: Any, a: int, b: int, pose: PairPose, out: Any, work: Any, accuracy: Accuracy = EXACT) -> float:
    """Certified lower bound (m) of the distance of shapes a and b, with its unit direction from A to B in out[0:3].

    The bound is <= 0 if the shapes overlap or touch. Their projections on the direction are apart by the bound. It is
    as accurate as wanted for all pairs except separated boxes, whose bound is the largest SAT gap. The direction of a
    bound of at most accuracy.near is undefined.
    """
    is_swapped = is_second(table, a, b, pose.p)
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    gap = _separation(table, a, b, pose, accuracy, out, work)
    if is_swapped:
        out[0] = -out[0]
        out[1] = -out[1]
        out[2] = -out[2]
    return gap


@inlined
def _separation(table: Any, a: int, b: int, pose: PairPose, accuracy: Accuracy, out: Any, work: Any) -> float:
    test = _TEST_OF[table.kind[a], table.kind[b]]
    if test == BOX_BOX:
        margin = table.margin[a] + table.margin[b]
        return box_box_separation(half_extents(table, a), half_extents(table, b), margin, pose, out)
    if test == SPHERE_SPHERE:
        return sphere_sphere_separation(
            table.size[a, 0] + table.margin[a], table.size[b, 0] + table.margin[b], pose.p, out
        )
    if test == SPHERE_BOX:
        radius = table.size[a, 0] + (table.margin[a] + table.margin[b])
        return sphere_box_separation(radius, half_extents(table, b), pose.R_B, pose.p, out)
    # the other closed forms, in which a contact costs little more than a distance
    answer = work[0:CONTACT_SIZE]
    if _closed_form(test, table, a, b, pose, answer):
        out[0] = answer[NORMAL]
        out[1] = answer[NORMAL + 1]
        out[2] = answer[NORMAL + 2]
        return answer[DISTANCE] - answer[BOUND]
    return convex_separation(table, a, b, pose, accuracy, out, work)


@inlined
def contact_within(table: Any, a: int, b: int, pose: PairPose, limit: float, out: Any, work: Any) -> bool:
    """Whether the signed distance may be at most `limit` (m) within its error bound; only then `out` holds the contact.

    Most pairs of a broad phase are apart, so a test stops as soon as that is certain.
    """
    is_swapped = is_second(table, a, b, pose.p)
    p = pose.p
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    if not (_contact(table, a, b, pose, limit, out, work) and out[DISTANCE] - out[BOUND] <= limit):
        return False
    if is_swapped:
        mirror(out, p)
    return True


@inlined
def mirror(out: Any, p: Vector) -> None:
    """Turn the contact of the swapped pair (b, a) in out into that of (a, b); p: B's origin relative to A's (m)."""
    for i in range(3):
        by = p[0] if i == 0 else (p[1] if i == 1 else p[2])
        out[NORMAL + i] = -out[NORMAL + i]
        witness = out[POINT_A + i]
        out[POINT_A + i] = out[POINT_B + i] + by
        out[POINT_B + i] = witness + by
    for i in range(2):  # type and index
        feature = out[FEATURE_TYPE_A + i]
        out[FEATURE_TYPE_A + i] = out[FEATURE_TYPE_B + i]
        out[FEATURE_TYPE_B + i] = feature


@inlined
def pair_contact(table: Any, a: Any, b: Any, pose: PairPose, out: Any, work: Any) -> None:
    """Write the contact of shapes a and b to `out` (see contact_row.py)."""
    contact_within(table, a, b, pose, inf, out, work)


@inlined
def _contact(table: Any, a: int, b: int, pose: PairPose, limit: float, out: Any, work: Any) -> bool:
    test = _TEST_OF[table.kind[a], table.kind[b]]
    if test == BOX_BOX:
        return box_box_contact(table, a, b, pose, limit, out, work)
    if test == SPHERE_SPHERE:
        sphere_sphere_contact(table.size[a, 0] + table.margin[a], table.size[b, 0] + table.margin[b], pose.p, out)
    elif test == SPHERE_BOX:
        radius = table.size[a, 0] + table.margin[a]
        sphere_box_contact(radius, half_extents(table, b), table.margin[b], pose.R_B, pose.p, out)
    elif not _closed_form(test, table, a, b, pose, out):
        return convex_contact(table, a, b, pose, limit, out, work)
    return True


@inlined
def _closed_form(test: int, table: Any, a: int, b: int, pose: PairPose, out: Any) -> bool:
    """Write the contact to out if the test is a closed form that the callers do not handle; return whether it is."""
    if test == HALF_SPACE_ANY:
        if table.kind[a] == HALF_SPACE:
            half_spaces_contact(table, a, b, pose, out)
        else:
            half_space_contact(table, a, b, pose, out)
        return True
    if test == POLYGON_POLYGON:
        planar_contact(table, a, b, pose, out)
        return True
    if test == CAPSULE_CAPSULE:
        capsule_capsule_contact(
            table.size[a, 0] + table.margin[a], table.size[a, 1], table.size[b, 0] + table.margin[b], table.size[b, 1],
            pose, out,
        )  # fmt: skip
        return True
    if test == CYLINDER_CYLINDER and is_parallel(table, a, pose):
        parallel_cylinders_contact(table, a, b, pose.R_B, pose.p, out)
        return True
    if test == SPHERE_SOLID:
        sphere_solid_contact(table, a, b, pose, out)
        return True
    return False


# The loops are device functions, because in a kernel each rotation[a] would count references (see _jit).


@device
def _contacts(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        pair_contact(table, a, b, pair_pose(position, rotation, a, b), out[k], work)


@kernel
def _contact_serial(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    _contacts(table, position, rotation, pairs, out, work)


def contact_batch(
    table: Any, position: NDArray[np.float64], rotation: NDArray[np.float64], pairs: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Contacts (M, CONTACT_SIZE) of the pairs (M, 2) of slots; position (K, 3) m, rotation (K, 3, 3) to world axes."""
    out = np.zeros((len(pairs), CONTACT_SIZE))
    _contact_serial(table, position, rotation, pairs, out, np.zeros(WORK_SIZE))
    return out
