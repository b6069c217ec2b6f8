"""The box around some triangles: the smaller of that along their principal axes and that along x, y, z."""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device
from collision_monitor.meshes.layout import AXES, CENTER, HALF
from collision_monitor.meshes.supports import extend, write_supports
from collision_monitor.tolerances import EPSILON

JACOBI_SWEEPS: Final = 6
"""Sweeps for the principal axes. Any rotation is a valid box; fewer sweeps only make it wider."""

CONTAINED: Final = 64 * EPSILON
"""Part of a box's coordinates by which it is enlarged against the round-off of its fit and of later rotations."""


@device
def fit_box(
    corners: Any, radius: Any, order: Any, begin: int, end: int, axes: Any, half: Any, center: Any, reach: Any,
    blocks: Any, block: int, member: int,
) -> None:  # fmt: skip
    """Write the box around the triangles order[begin:end], which are enlarged by radii, to a member of a block.

    axes (2, 3, 3), half, center (2, 3), reach (REACHES,): scratch memory.
    """
    mx = my = mz = 0.0
    origin = corners[order[begin], 0]
    ox, oy, oz = origin[0], origin[1], origin[2]
    xx = xy = xz = yy = yz = zz = 0.0
    for k in range(begin, end):
        for i in range(3):
            x, y, z = corners[order[k], i, 0] - ox, corners[order[k], i, 1] - oy, corners[order[k], i, 2] - oz
            mx, my, mz = mx + x, my + y, mz + z
            xx, xy, xz = xx + x * x, xy + x * y, xz + x * z
            yy, yz, zz = yy + y * y, yz + y * z, zz + z * z
    n = 3.0 * (end - begin)
    mx, my, mz = mx / n, my / n, mz / n
    _principal_axes(
        xx / n - mx * mx, xy / n - mx * my, xz / n - mx * mz, yy / n - my * my, yz / n - my * mz, zz / n - mz * mz,
        axes[0],
    )  # fmt: skip
    for r in range(3):
        for c in range(3):
            axes[1, r, c] = 1.0 if r == c else 0.0
    best, least = 0, np.inf
    for choice in range(2):
        R = axes[choice]
        for c in range(3):
            low, high = np.inf, -np.inf
            for k in range(begin, end):
                for i in range(3):
                    at = (
                        R[0, c] * (corners[order[k], i, 0] - ox)
                        + R[1, c] * (corners[order[k], i, 1] - oy)
                        + R[2, c] * (corners[order[k], i, 2] - oz)
                    )
                    low, high = min(low, at - radius[order[k]]), max(high, at + radius[order[k]])
            center[choice, c], half[choice, c] = low + 0.5 * (high - low), 0.5 * (high - low)
        x, y, z = half[choice, 0], half[choice, 1], half[choice, 2]
        surface = x * y + y * z + z * x
        if surface < least:
            best, least = choice, surface
    R = axes[best]
    scale = abs(ox) + abs(oy) + abs(oz) + half[best, 0] + half[best, 1] + half[best, 2]
    for r in range(3):
        for c in range(3):
            blocks[block, AXES + 3 * r + c, member] = R[r, c]
        along = R[r, 0] * center[best, 0] + R[r, 1] * center[best, 1] + R[r, 2] * center[best, 2]
        blocks[block, CENTER + r, member] = origin[r] + along
        blocks[block, HALF + r, member] = half[best, r] + CONTAINED * scale
    reach[:] = -np.inf
    for k in range(begin, end):
        for i in range(3):
            x = corners[order[k], i, 0] - ox, corners[order[k], i, 1] - oy, corners[order[k], i, 2] - oz
            extend(
                (
                    R[0, 0] * x[0] + R[1, 0] * x[1] + R[2, 0] * x[2] - center[best, 0],
                    R[0, 1] * x[0] + R[1, 1] * x[1] + R[2, 1] * x[2] - center[best, 1],
                    R[0, 2] * x[0] + R[1, 2] * x[1] + R[2, 2] * x[2] - center[best, 2],
                ),
                radius[order[k]],
                reach,
            )
    write_supports(reach, CONTAINED * scale, blocks, block, member)


@device
def _principal_axes(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, R: Any) -> None:
    """Write the eigenvectors of a symmetric matrix into the columns of R (3, 3), by Jacobi rotations."""
    for r in range(3):
        for c in range(3):
            R[r, c] = 1.0 if r == c else 0.0
    for _ in range(JACOBI_SWEEPS):
        for pair in range(3):
            off = xy if pair == 0 else (xz if pair == 1 else yz)
            if off == 0.0:
                continue
            p, q = (0, 1) if pair == 0 else ((0, 2) if pair == 1 else (1, 2))
            first = xx if p == 0 else yy
            second = yy if q == 1 else zz
            theta = 0.5 * (second - first) / off
            t = copysign(1.0, theta) / (abs(theta) + sqrt(theta * theta + 1.0))
            cosine = 1.0 / sqrt(t * t + 1.0)
            sine = t * cosine
            if pair == 0:
                xx, yy, xy, xz, yz = xx - t * xy, yy + t * xy, 0.0, cosine * xz - sine * yz, sine * xz + cosine * yz
            elif pair == 1:
                xx, zz, xz, xy, yz = xx - t * xz, zz + t * xz, 0.0, cosine * xy - sine * yz, sine * xy + cosine * yz
            else:
                yy, zz, yz, xy, xz = yy - t * yz, zz + t * yz, 0.0, cosine * xy - sine * xz, sine * xy + cosine * xz
            for r in range(3):
                a, b = R[r, p], R[r, q]
                R[r, p], R[r, q] = cosine * a - sine * b, sine * a + cosine * b
