"""Lower bounds on the distance of a box from the eight boxes of a block.

In the axes of either box, the other one has an axis-aligned bound; the gaps of the two along the axes give a lower bound
on the distance, also where the boxes are apart along several axes. The loop has no branch, so the processor computes
several members at once.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.meshes.layout import AXES, CENTER, HALF, WIDTH


class Placing(NamedTuple):
    """Pose of a tree in another tree's frame: rotation, row by row, and position (m)."""

    r00: Any
    r01: Any
    r02: Any
    r10: Any
    r11: Any
    r12: Any
    r20: Any
    r21: Any
    r22: Any
    x: Any
    y: Any
    z: Any


@inlined
def inverse(X):
    """The inverse of a pose."""
    return Placing(
        X.r00, X.r10, X.r20, X.r01, X.r11, X.r21, X.r02, X.r12, X.r22,
        -(X.r00 * X.x + X.r10 * X.y + X.r20 * X.z),
        -(X.r01 * X.x + X.r11 * X.y + X.r21 * X.z),
        -(X.r02 * X.x + X.r12 * X.y + X.r22 * X.z),
    )  # fmt: skip


@inlined
def seen_from(blocks, block, member, X):
    """Pose of another tree in the frame of a box; X: that pose in the frame of the box's own tree."""
    a00, a01, a02 = blocks[block, AXES, member], blocks[block, AXES + 1, member], blocks[block, AXES + 2, member]
    a10, a11, a12 = blocks[block, AXES + 3, member], blocks[block, AXES + 4, member], blocks[block, AXES + 5, member]
    a20, a21, a22 = blocks[block, AXES + 6, member], blocks[block, AXES + 7, member], blocks[block, AXES + 8, member]
    x = X.x - blocks[block, CENTER, member]
    y = X.y - blocks[block, CENTER + 1, member]
    z = X.z - blocks[block, CENTER + 2, member]
    return Placing(
        a00 * X.r00 + a10 * X.r10 + a20 * X.r20, a00 * X.r01 + a10 * X.r11 + a20 * X.r21,
        a00 * X.r02 + a10 * X.r12 + a20 * X.r22, a01 * X.r00 + a11 * X.r10 + a21 * X.r20,
        a01 * X.r01 + a11 * X.r11 + a21 * X.r21, a01 * X.r02 + a11 * X.r12 + a21 * X.r22,
        a02 * X.r00 + a12 * X.r10 + a22 * X.r20, a02 * X.r01 + a12 * X.r11 + a22 * X.r21,
        a02 * X.r02 + a12 * X.r12 + a22 * X.r22,
        a00 * x + a10 * y + a20 * z, a01 * x + a11 * y + a21 * z, a02 * x + a12 * y + a22 * z,
    )  # fmt: skip


@device
def box_bounds(blocks_a, a, member, blocks_b, b, X, out):
    """Write lower bounds on the squared distances of a box from the eight boxes of block b into out[0:8] (m^2).

    blocks_a, a, member: the box. X: pose of the tree of b in the frame of the box's tree. A bound of 0 says that the
    boxes may overlap. An unused member of the block gets the bound of its zeros.
    """
    M = seen_from(blocks_a, a, member, X)
    e0, e1, e2 = blocks_a[a, HALF, member], blocks_a[a, HALF + 1, member], blocks_a[a, HALF + 2, member]
    for k in range(WIDTH):
        b00, b01, b02 = blocks_b[b, AXES, k], blocks_b[b, AXES + 1, k], blocks_b[b, AXES + 2, k]
        b10, b11, b12 = blocks_b[b, AXES + 3, k], blocks_b[b, AXES + 4, k], blocks_b[b, AXES + 5, k]
        b20, b21, b22 = blocks_b[b, AXES + 6, k], blocks_b[b, AXES + 7, k], blocks_b[b, AXES + 8, k]
        cx, cy, cz = blocks_b[b, CENTER, k], blocks_b[b, CENTER + 1, k], blocks_b[b, CENTER + 2, k]
        f0, f1, f2 = blocks_b[b, HALF, k], blocks_b[b, HALF + 1, k], blocks_b[b, HALF + 2, k]
        r00, r01, r02 = (
            M.r00 * b00 + M.r01 * b10 + M.r02 * b20,
            M.r00 * b01 + M.r01 * b11 + M.r02 * b21,
            M.r00 * b02 + M.r01 * b12 + M.r02 * b22,
        )
        r10, r11, r12 = (
            M.r10 * b00 + M.r11 * b10 + M.r12 * b20,
            M.r10 * b01 + M.r11 * b11 + M.r12 * b21,
            M.r10 * b02 + M.r11 * b12 + M.r12 * b22,
        )
        r20, r21, r22 = (
            M.r20 * b00 + M.r21 * b10 + M.r22 * b20,
            M.r20 * b01 + M.r21 * b11 + M.r22 * b21,
            M.r20 * b02 + M.r21 * b12 + M.r22 * b22,
        )
        x = M.r00 * cx + M.r01 * cy + M.r02 * cz + M.x
        y = M.r10 * cx + M.r11 * cy + M.r12 * cz + M.y
        z = M.r20 * cx + M.r21 * cy + M.r22 * cz + M.z
        g0 = max(abs(x) - e0 - (abs(r00) * f0 + abs(r01) * f1 + abs(r02) * f2), 0.0)
        g1 = max(abs(y) - e1 - (abs(r10) * f0 + abs(r11) * f1 + abs(r12) * f2), 0.0)
        g2 = max(abs(z) - e2 - (abs(r20) * f0 + abs(r21) * f1 + abs(r22) * f2), 0.0)
        u, v, w = r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z
        h0 = max(abs(u) - f0 - (abs(r00) * e0 + abs(r10) * e1 + abs(r20) * e2), 0.0)
        h1 = max(abs(v) - f1 - (abs(r01) * e0 + abs(r11) * e1 + abs(r21) * e2), 0.0)
        h2 = max(abs(w) - f2 - (abs(r02) * e0 + abs(r12) * e1 + abs(r22) * e2), 0.0)
        out[k] = max(g0 * g0 + g1 * g1 + g2 * g2, h0 * h0 + h1 * h1 + h2 * h2)
