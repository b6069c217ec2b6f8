"""The table of pair tests: which test answers for which two kinds of shape.

Pairs are brought into one order (by kind, then by slot) first, so that swapping A and B mirrors the answer bit by bit.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.geometry.shape_table import (
    BOX,
    CAPSULE,
    CIRCLE,
    CONE,
    CONVEX_HULL,
    CYLINDER,
    HALF_SPACE,
    POLYGON,
    SPHERE,
)
from collision_monitor.narrow_phase.box_box import axis_direction, box_box_separation, sat, touching_features
from collision_monitor.narrow_phase.capsule_capsule import capsule_capsule_contact
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE, WORK_SIZE
from collision_monitor.narrow_phase.convex_convex import convex_contact, convex_separation
from collision_monitor.narrow_phase.cylinder_cylinder import is_parallel, parallel_cylinders_contact
from collision_monitor.narrow_phase.half_space import half_space_contact, half_spaces_contact
from collision_monitor.narrow_phase.polygon_polygon import planar_contact
from collision_monitor.narrow_phase.sphere_box import sphere_box_contact, sphere_box_separation
from collision_monitor.narrow_phase.sphere_cone import sphere_cone_contact
from collision_monitor.narrow_phase.sphere_sphere import sphere_sphere_contact, sphere_sphere_separation
from collision_monitor.tolerances import FACE_PREFERENCE, FEATURE_TIE


@inlined
def _swapped(table: Any, a: int, b: int) -> bool:
    """Whether the canonical order is b, a."""
    ka, kb = table.kind[a], table.kind[b]
    return ka > kb or (ka == kb and a > b)


@inlined
def separation(
    table: Any, a: int, b: int, R_WA: Any, R_WB: Any, px: float, py: float, pz: float, out: Any, work: Any
) -> float:
    """Certified lower bound (m) of the distance of shapes a and b, with its unit direction from A to B in out[0:3].

    p = position of b - position of a, world axes. <= 0 where they overlap or touch. Projected on the direction, the
    shapes are apart by this much. Exact for all pairs but separated boxes, whose bound is the largest SAT gap.
    """
    swapped = _swapped(table, a, b)
    if swapped:
        a, b = b, a
        R_WA, R_WB = R_WB, R_WA
        px, py, pz = -px, -py, -pz
    gap = _separation(table, a, b, R_WA, R_WB, px, py, pz, out, work)
    if swapped:
        out[0] = -out[0]
        out[1] = -out[1]
        out[2] = -out[2]
    return gap


@inlined
def _separation(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, out: Any, work: Any
) -> float:
    ka, kb = table.kind[a], table.kind[b]
    margin = table.margin[a] + table.margin[b]
    if ka == BOX and kb == BOX:
        return box_box_separation(
            table.size[a, 0], table.size[a, 1], table.size[a, 2], table.size[b, 0], table.size[b, 1], table.size[b, 2],
            margin, RA, RB, px, py, pz, out,
        )  # fmt: skip
    if ka == SPHERE and kb == SPHERE:
        return sphere_sphere_separation(
            table.size[a, 0] + table.margin[a], table.size[b, 0] + table.margin[b], px, py, pz, out
        )
    if ka == SPHERE and kb == BOX:
        return sphere_box_separation(
            table.size[a, 0] + margin, table.size[b, 0], table.size[b, 1], table.size[b, 2], RB, px, py, pz, out
        )
    # the closed forms that are left: a contact costs little more than a distance
    answer = work[0:CONTACT_SIZE]
    if _closed_form(table, a, b, RA, RB, px, py, pz, answer):
        out[0] = answer[1]
        out[1] = answer[2]
        out[2] = answer[3]
        return answer[0] - answer[10]
    return convex_separation(table, a, b, RA, RB, px, py, pz, inf, out, work)


@inlined
def _closed_form(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, out: Any
) -> bool:
    """The contact into out, where one formula gives it; sphere-sphere, sphere-box and box-box are not looked for."""
    ka, kb = table.kind[a], table.kind[b]
    if kb == HALF_SPACE:
        if ka == HALF_SPACE:
            half_spaces_contact(table, a, b, RA, RB, px, py, pz, out)
        else:
            half_space_contact(table, a, b, RA, RB, px, py, pz, out)
        return True
    if ka >= CIRCLE:
        planar_contact(table, a, b, RA, RB, px, py, out)
        return True
    if kb == CAPSULE and (ka == CAPSULE or ka == SPHERE):
        capsule_capsule_contact(
            table.size[a, 0] + table.margin[a], table.size[a, 1], table.size[b, 0] + table.margin[b], table.size[b, 1],
            RA, RB, px, py, pz, out,
        )  # fmt: skip
        return True
    if kb == CYLINDER and ka != BOX and is_parallel(table, a, RA, RB):
        parallel_cylinders_contact(table, a, b, RB, px, py, pz, out)
        return True
    if kb == CONE and ka == SPHERE:
        sphere_cone_contact(
            table.size[a, 0] + table.margin[a], table.size[b, 0], table.size[b, 1], table.margin[b],
            RB, px, py, pz, out,
        )  # fmt: skip
        return True
    return False


@inlined
def contact_within(
    table: Any,
    a: int,
    b: int,
    R_WA: Any,
    R_WB: Any,
    px: float,
    py: float,
    pz: float,
    limit: float,
    out: Any,
    work: Any,
) -> bool:
    """Whether the signed distance is at most `limit` (m); only then out[0:15] holds the contact (see answer.py).

    Arguments as in `separation`. Most pairs of a broad phase are apart: they cost as little as can prove it.
    """
    swapped = _swapped(table, a, b)
    if swapped:
        a, b = b, a
        R_WA, R_WB = R_WB, R_WA
        px, py, pz = -px, -py, -pz
    if not (_contact(table, a, b, R_WA, R_WB, px, py, pz, limit, out, work) and out[0] <= limit):
        return False
    if swapped:
        _mirror(out, -px, -py, -pz)
    return True


@inlined
def _mirror(out: Any, px: float, py: float, pz: float) -> None:
    """The contact of (b, a) from that of (a, b)."""
    for i in range(3):
        p = px if i == 0 else (py if i == 1 else pz)
        out[1 + i] = -out[1 + i]
        witness = out[4 + i]
        out[4 + i] = out[7 + i] + p
        out[7 + i] = witness + p
    for i in range(11, 13):
        feature = out[i]
        out[i] = out[i + 2]
        out[i + 2] = feature


@inlined
def contact(
    table: Any, a: int, b: int, R_WA: Any, R_WB: Any, px: float, py: float, pz: float, out: Any, work: Any
) -> None:
    """Signed distance, normal, witness points, error bound and features in out[0:15] (see answer.py)."""
    contact_within(table, a, b, R_WA, R_WB, px, py, pz, inf, out, work)


@inlined
def _contact(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, limit: float, out: Any, work: Any
) -> bool:
    ka, kb = table.kind[a], table.kind[b]
    if ka == BOX and kb == BOX:
        return _boxes(table, a, b, RA, RB, px, py, pz, limit, out, work)
    if ka == SPHERE and kb == SPHERE:
        sphere_sphere_contact(
            table.size[a, 0] + table.margin[a], table.size[b, 0] + table.margin[b], px, py, pz, out
        )
    elif ka == SPHERE and kb == BOX:
        sphere_box_contact(
            table.size[a, 0] + table.margin[a], table.size[b, 0], table.size[b, 1], table.size[b, 2],
            table.margin[b], RB, px, py, pz, out,
        )  # fmt: skip
    elif not _closed_form(table, a, b, RA, RB, px, py, pz, out):
        return convex_contact(table, a, b, RA, RB, px, py, pz, limit, out, work)
    return True


@inlined
def _boxes(
    table: Any, a: int, b: int, RA: Any, RB: Any, px: float, py: float, pz: float, limit: float, out: Any, work: Any
) -> bool:
    """SAT, and GJK for the distance of boxes whose nearest features no SAT axis is at a right angle to."""
    ha, hb = table.size[a], table.size[b]
    ma, mb = table.margin[a], table.margin[b]
    reach = limit + ma + mb
    gap, axis, sign = sat(ha[0], ha[1], ha[2], hb[0], hb[1], hb[2], RA, RB, px, py, pz, reach)
    if gap > reach:
        return False
    size = max(max(ha[0], ha[1], ha[2]), max(hb[0], hb[1], hb[2]))
    if gap > 0.0:
        if not convex_contact(table, a, b, RA, RB, px, py, pz, limit, out, work):
            return False
        if out[0] + ma + mb - gap > FACE_PREFERENCE * size:
            return True
    nx, ny, nz = axis_direction(axis, sign, RA, RB)
    if gap > 0.0:
        # where corners are nearest the gap can be as long as the distance to 1e-9, and they beside the axis by 1e-5
        ax, ay, az = out[2] * nz - out[3] * ny, out[3] * nx - out[1] * nz, out[1] * ny - out[2] * nx
        if gap * sqrt(ax * ax + ay * ay + az * az) > FEATURE_TIE * size:
            return True
        # the SAT axis is the direction of the distance too, and has no noise however near the boxes are
    touching_features(ha, hb, RA, RB, px, py, pz, gap, nx, ny, nz, out, work)
    if ma > 0.0 or mb > 0.0:
        out[0] -= ma + mb
        for i in range(3):
            out[4 + i] += ma * out[1 + i]
            out[7 + i] -= mb * out[1 + i]
    return True


# The loops are device functions: in a kernel each rotation[a] would count references (see _jit).


@device
def _contacts(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        contact(
            table,
            a,
            b,
            rotation[a],
            rotation[b],
            position[b, 0] - position[a, 0],
            position[b, 1] - position[a, 1],
            position[b, 2] - position[a, 2],
            out[k],
            work,
        )


@device
def _contacts_within(
    table: Any, position: Any, rotation: Any, pairs: Any, limit: float, found: Any, out: Any, work: Any
) -> int:
    count = 0
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        if contact_within(
            table,
            a,
            b,
            rotation[a],
            rotation[b],
            position[b, 0] - position[a, 0],
            position[b, 1] - position[a, 1],
            position[b, 2] - position[a, 2],
            limit,
            out[count],
            work,
        ):
            found[count] = k
            count += 1
    return count


@device
def _separations(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        out[k, 3] = separation(
            table,
            a,
            b,
            rotation[a],
            rotation[b],
            position[b, 0] - position[a, 0],
            position[b, 1] - position[a, 1],
            position[b, 2] - position[a, 2],
            out[k],
            work,
        )


@kernel
def _contact_serial(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    _contacts(table, position, rotation, pairs, out, work)


@kernel
def _within_serial(
    table: Any, position: Any, rotation: Any, pairs: Any, limit: float, found: Any, out: Any, work: Any
) -> int:
    return _contacts_within(table, position, rotation, pairs, limit, found, out, work)


@kernel
def _separation_serial(table: Any, position: Any, rotation: Any, pairs: Any, out: Any, work: Any) -> None:
    _separations(table, position, rotation, pairs, out, work)


def contact_batch(
    table: Any, position: NDArray[np.float64], rotation: NDArray[np.float64], pairs: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Contacts (M, 15) of the pairs (M, 2) of slots at position (K, 3) and rotation (K, 3, 3), world axes."""
    out = np.zeros((len(pairs), CONTACT_SIZE))
    _contact_serial(table, position, rotation, pairs, out, np.zeros(WORK_SIZE))
    return out


def contact_within_batch(
    table: Any,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    pairs: NDArray[np.int32],
    limit: float,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Which of the pairs are at most `limit` (m) apart, ascending (H,), and their contacts (H, 15)."""
    found = np.empty(len(pairs), np.int32)
    out = np.zeros((len(pairs), CONTACT_SIZE))
    count = _within_serial(table, position, rotation, pairs, limit, found, out, np.zeros(WORK_SIZE))
    return found[:count], out[:count]


def separation_batch(
    table: Any, position: NDArray[np.float64], rotation: NDArray[np.float64], pairs: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Directions and certified lower bounds (M, 4) of the pairs; arguments as in `contact_batch`."""
    out = np.zeros((len(pairs), 4))
    _separation_serial(table, position, rotation, pairs, out, np.zeros(WORK_SIZE))
    return out


KIND_NAMES: Final = {
    SPHERE: "sphere",
    BOX: "box",
    CAPSULE: "capsule",
    CYLINDER: "cylinder",
    CONE: "cone",
    CONVEX_HULL: "convex hull",
    HALF_SPACE: "half-space",
    CIRCLE: "circle",
    POLYGON: "polygon",
}


_TESTS: Final = {
    (SPHERE, SPHERE): "sphere_sphere",
    (SPHERE, BOX): "sphere_box",
    (SPHERE, CAPSULE): "capsule_capsule",
    (CAPSULE, CAPSULE): "capsule_capsule",
    (SPHERE, CONE): "sphere_cone",
    (SPHERE, CYLINDER): "cylinder_cylinder",
    (BOX, BOX): "box_box",
}


_METHODS: Final = {
    "sphere_sphere": "centres",
    "sphere_box": "clamping",
    "capsule_capsule": "closest points of segments",
    "sphere_cone": "closed form",
    "cylinder_cylinder": "closed form where the axes are parallel, else GJK and EPA",
    "box_box": "SAT",
    "half_space": "support distance",
    "convex_convex": "GJK and EPA",
    "polygon_polygon": "SAT in the plane",
}


def pair_test(kind_a: int, kind_b: int) -> str:
    """The narrow phase test for two kinds, kind_a <= kind_b."""
    if kind_b == HALF_SPACE:
        return "half_space"
    if kind_a >= CIRCLE:
        return "polygon_polygon"
    if kind_b == CYLINDER and kind_a in (CAPSULE, CYLINDER):
        return "cylinder_cylinder"
    return _TESTS.get((kind_a, kind_b), "convex_convex")
