"""Contact points of two boxes whose faces lie on each other or nearly so, each with its own gap.

A simulation needs all corners that may touch within a step, also those of a slightly tilted box, to hold it; the patch
of `narrow_phase.manifold`, made for reports, holds only the corners that touch now.
"""

from __future__ import annotations

from typing import Any, Final

from collision_monitor._jit import device, kernel

MOST_CORNERS: Final = 8
"""Most corners of a face clipped by a rectangle."""

FACE_ON: Final = 0.996
"""Cosine (5 degrees) between the contact's normal and a face normal above which the contact is one of that face."""

TIE: Final = 1e-6
"""The face of A wins over the face of B by this part, and a corner within this part of the size counts as on an edge,
so that contact points of boxes at rest do not flicker."""


@kernel
def face_contacts(
    half: Any, position: Any, rotation: Any, pairs: Any, normal: Any, margin: float, point: Any, gap: Any, count: Any,
    scratch: Any,
) -> None:  # fmt: skip
    """Clip the face of one box against the face of the other (Sutherland and Hodgman, 1974), for M pairs.

    half (N, 3) m, position (N, 3) m, rotation (N, 3, 3); normal (M, 3) from A to B, replaced by the face's. Writes to
    point (M, 8, 3) in m, gap (M, 8) in m and count (M,): 0 if the contact is not one of faces. scratch (2, 8, 3).
    """
    for k in range(len(pairs)):
        count[k] = 0
        face, side = _reference_face(rotation, pairs[k], normal[k])
        if face < 0:
            continue
        ref, other = pairs[k, side], pairs[k, 1 - side]
        # unit normal of the reference face, towards the other box
        toward = 1.0 if side == 0 else -1.0
        along = 0.0
        for c in range(3):
            along += rotation[ref, c, face] * normal[k, c]
        sign = toward if along > 0.0 else -toward
        _lay_opposite_face(half, position, rotation, ref, other, face, sign, scratch[0])
        size, source = _clip(half[ref], face, scratch)
        u, v = (face + 1) % 3, (face + 2) % 3
        for c in range(3):
            normal[k, c] = toward * sign * rotation[ref, c, face]
        for m in range(size):
            height = scratch[source, m, 2]
            if height <= margin:
                i = count[k]
                gap[k, i] = height
                for c in range(3):
                    point[k, i, c] = (
                        position[ref, c]
                        + scratch[source, m, 0] * rotation[ref, c, u]
                        + scratch[source, m, 1] * rotation[ref, c, v]
                        + sign * (half[ref, face] + 0.5 * height) * rotation[ref, c, face]
                    )
                count[k] = i + 1


@device
def _reference_face(rotation: Any, pair: Any, normal: Any) -> Any:
    """The axis of the face that looks most along the normal, and the side of its box; (-1, 0) if none does."""
    face, side, best = -1, 0, FACE_ON
    for s in range(2):
        body = pair[s]
        for axis in range(3):
            cosine = 0.0
            for c in range(3):
                cosine += rotation[body, c, axis] * normal[c]
            if abs(cosine) > best + (TIE if s == 1 else 0.0):
                best, face, side = abs(cosine), axis, s
    return face, side


@device
def _lay_opposite_face(
    half: Any, position: Any, rotation: Any, ref: int, other: int, face: int, sign: float, corners: Any
) -> None:
    """Write the corners (4, 3) in m of the face of the other box that looks most against the reference face.

    Along the two axes of the reference face, and its height over that.
    """
    u, v = (face + 1) % 3, (face + 2) % 3
    back, against = 0, 0.0
    for axis in range(3):
        cosine = 0.0
        for c in range(3):
            cosine += rotation[other, c, axis] * rotation[ref, c, face]
        if abs(cosine) > abs(against):
            back, against = axis, cosine
    up = -1.0 if against * sign > 0.0 else 1.0
    p, q = (back + 1) % 3, (back + 2) % 3
    for corner in range(4):
        x = half[other, p] if corner == 0 or corner == 3 else -half[other, p]
        y = half[other, q] if corner < 2 else -half[other, q]
        for row in range(3):
            axis = u if row == 0 else (v if row == 1 else face)
            total = 0.0
            for c in range(3):
                at = (
                    position[other, c] - position[ref, c]
                    + up * half[other, back] * rotation[other, c, back]
                    + x * rotation[other, c, p] + y * rotation[other, c, q]
                )  # fmt: skip
                total += at * rotation[ref, c, axis]
            corners[corner, row] = total if row < 2 else sign * total - half[ref, face]


@device
def _clip(half: Any, face: int, scratch: Any) -> Any:
    """Clip the corners in scratch[0] by the four edges of a face. Return how many are left, and where in scratch."""
    u, v = (face + 1) % 3, (face + 2) % 3
    size, source = 4, 0
    edge_on = TIE * (half[u] + half[v])
    for edge in range(4):
        row, limit = edge // 2, half[u] if edge < 2 else half[v]
        way = 1.0 if edge % 2 == 0 else -1.0
        kept = 0
        for m in range(size):
            n = (m + 1) % size
            here, there = limit - way * scratch[source, m, row], limit - way * scratch[source, n, row]
            if here >= -edge_on and kept < MOST_CORNERS:
                for c in range(3):
                    scratch[1 - source, kept, c] = scratch[source, m, c]
                kept += 1
            crosses = min(here, there) < -edge_on and max(here, there) > edge_on
            if crosses and kept < MOST_CORNERS:
                part = here / (here - there)
                for c in range(3):
                    scratch[1 - source, kept, c] = scratch[source, m, c] + part * (
                        scratch[source, n, c] - scratch[source, m, c]
                    )
                kept += 1
        size, source = kept, 1 - source
    return size, source
