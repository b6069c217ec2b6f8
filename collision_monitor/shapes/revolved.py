"""Solids of revolution about z between two discs: a cylinder, a cone and a truncated cone are such.

A profile is the radius `top` at z = +half, the radius `bottom` at z = -half, and the half height `half` (m). In a plane
through the axis, with u the distance from it and v = z, the solid is a trapezium.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Final

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.contact_features import Feature, FeatureType
from collision_monitor.geometry.vector import Vector
from collision_monitor.shapes.feature_types import EDGE, FACE, SURFACE, VERTEX
from collision_monitor.shapes.mass import MassProperties
from collision_monitor.shapes.rays import RayInterval, row_dot, slab_interval
from collision_monitor.shapes.shape import Array
from collision_monitor.shapes.surface_parts import Triangles, revolved_triangles

ROUND_TIE: Final = 1e-6
"""A point within this part of the size of a rim or an apex is on it; a direction within this angle (rad) is along an
axis. The points that GJK finds on round surfaces are off by up to 1e-7 of the size, the depths of EPA by 1e-6. Larger:
a tilted cylinder stands on its face. Smaller: witness points of GJK miss the rim."""

_SURFACE: Final = Feature(FeatureType.SURFACE, (), -1)


@inlined
def revolved_support(top: float, bottom: float, half: float, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of the solid, for m = (x, y, z) of any length."""
    rim = sqrt(x * x + y * y)
    return max(z * half + top * rim, bottom * rim - z * half)


@inlined
def revolved_support_point(top: float, bottom: float, half: float, d: Vector) -> Vector:
    """Farthest point of the solid along d, of any length."""
    dx, dy, dz = d
    rim = sqrt(dx * dx + dy * dy)
    r, z = (top, half) if dz * half + top * rim >= bottom * rim - dz * half else (bottom, -half)
    if rim > 0.0:
        return r * dx / rim, r * dy / rim, z
    return 0.0, 0.0, z


@device
def revolved_distance(top: float, bottom: float, half: float, x: Vector) -> tuple[float, Vector]:
    """Signed distance (m) of a point, and its direction out of the solid: that of a trapezium in a plane."""
    u, v = sqrt(x[0] * x[0] + x[1] * x[1]), x[2]
    wider = bottom - top
    length = sqrt(4.0 * half * half + wider * wider)
    across, along = 2.0 * half / length, wider / length  # normal of the slant
    slant, base, roof = across * (u - top) + along * (v - half), -half - v, v - half
    nu, nv, distance = (across, along, slant) if slant >= base else (0.0, -1.0, base)
    if roof > distance:
        nu, nv, distance = 0.0, 1.0, roof
    if distance > 0.0:
        # nearest points of the slant, from the upper rim (top, half) to the lower one (bottom, -half), and of the discs
        t = min(max(((u - top) * wider + (half - v) * 2.0 * half) / (length * length), 0.0), 1.0)
        su, sv = u - (top + t * wider), v - (half - 2.0 * half * t)
        bu, bv = u - min(u, bottom), v + half
        if bu * bu + bv * bv < su * su + sv * sv:
            su, sv = bu, bv
        bu, bv = u - min(u, top), v - half
        if bu * bu + bv * bv < su * su + sv * sv:
            su, sv = bu, bv
        apart = sqrt(su * su + sv * sv)
        if apart > distance:  # else that face is the nearest, and its normal is exact
            nu, nv, distance = su / apart, sv / apart, apart
    ex, ey = (x[0] / u, x[1] / u) if u > 0.0 else (1.0, 0.0)
    return distance, (nu * ex, nu * ey, nv)


@device
def revolved_feature(top: float, bottom: float, half: float, x: Vector, n: Vector, reach: float) -> tuple[float, float]:
    """Type and index of the feature at a point x of the surface, for an outward normal n.

    Face and rim 0 are at +z and 1 at -z; a cone has its apex as vertex 0, and its only face and rim have the number 0.
    reach (m): distances up to it count as 0.
    """
    reach = max(reach, ROUND_TIE * (max(top, bottom) + 2.0 * half))
    rim, away = sqrt(n[0] * n[0] + n[1] * n[1]), sqrt(x[0] * x[0] + x[1] * x[1])
    if top == 0.0 and away * away + (x[2] - half) ** 2 <= reach * reach:
        return VERTEX, 0.0
    slant = sqrt(4.0 * half * half + (top - bottom) ** 2)
    slope = ((top - bottom) * rim + 2.0 * half * n[2]) / slant  # of the normal along the slant
    side = (2.0 * half * (bottom - away) + (top - bottom) * (x[2] + half)) / slant
    is_lower = top == 0.0 or x[2] < 0.0
    end = 1.0 if is_lower and top > 0.0 else 0.0
    base, down, r = (x[2] + half, -n[2], bottom) if is_lower else (half - x[2], n[2], top)
    if abs(slope) <= ROUND_TIE or base > max(reach, side):  # a line of the side touches as a whole; or away from a disc
        return SURFACE, 0.0
    if abs(r - away) <= reach and not (rim <= ROUND_TIE and down > 0.0):
        return EDGE, end
    return FACE, end


def feature_of_revolved(point: Array, normal: Array, top: float, bottom: float, length: float) -> Feature:
    """`revolved_feature` in NumPy: point (3,) in m, outward normal (3,)."""
    tie = ROUND_TIE * (max(top, bottom) + length)
    if top == 0.0 and float(np.linalg.norm(point - [0.0, 0.0, length / 2])) <= tie:
        return Feature(FeatureType.VERTEX, (0,), -1)
    slope = (length * normal[2] + (top - bottom) * np.hypot(normal[0], normal[1])) / np.hypot(length, top - bottom)
    if abs(slope) <= ROUND_TIE:  # a line of the side touches as a whole
        return _SURFACE
    discs = [(1.0, top), (-1.0, bottom)] if top > 0.0 else [(-1.0, bottom)]
    for number, (side, radius) in enumerate(discs):
        if abs(side * point[2] - length / 2) <= tie:
            on_rim = abs(np.hypot(point[0], point[1]) - radius) <= tie
            is_along = np.hypot(normal[0], normal[1]) <= ROUND_TIE and side * normal[2] > 0.0
            if on_rim and not is_along:
                return Feature(FeatureType.EDGE, (number,), -1)
            return Feature(FeatureType.FACE, (), number)
    return _SURFACE


def support_of_revolved(d: Array, top: float, bottom: float, length: float) -> Array:
    """`revolved_support` in NumPy, for directions d (..., 3)."""
    rim, height = np.hypot(d[..., 0], d[..., 1]), d[..., 2] * length / 2
    return np.asarray(np.maximum(height + top * rim, bottom * rim - height))


def revolved_interval(p: Array, d: Array, top: float, bottom: float, length: float) -> RayInterval:
    """Between the discs, the points with f = x² + y² - w(z)² <= 0, where w is linear and f is a quadratic of t."""
    slope, half = (top - bottom) / length, length / 2
    slab = slab_interval(p, d, half)
    # from the disc that is nearer to the apex, so that nothing cancels there
    down = top + slope * (p[:, 2] - half) if top <= bottom else bottom + slope * (p[:, 2] + half)
    fall = slope * d[:, 2]
    a = d[:, 0] ** 2 + d[:, 1] ** 2 - fall**2
    b = d[:, 0] * p[:, 0] + d[:, 1] * p[:, 1] - fall * down
    c = p[:, 0] ** 2 + p[:, 1] ** 2 - down**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    q = -(b + np.copysign(root, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack([q / a, c / q], axis=1)
    low, high = slab.enter[:, None], slab.leave[:, None]
    roots = np.where(np.isfinite(roots), roots, low)
    ends = np.sort(np.clip(np.concatenate([roots, low, high], axis=1), low, np.maximum(low, high)), axis=1)
    with np.errstate(invalid="ignore"):
        middle = 0.5 * ends[:, :-1] + 0.5 * ends[:, 1:]
        inside = (a[:, None] * middle**2 + 2 * b[:, None] * middle + c[:, None] <= 0.0) & (ends[:, :-1] < ends[:, 1:])
    some = inside.any(axis=1) & (slab.enter <= slab.leave)
    rows = np.arange(len(p))
    enter = np.where(some, ends[rows, inside.argmax(axis=1)], np.inf)
    leave = np.where(some, ends[rows, 3 - inside[:, ::-1].argmax(axis=1)], -np.inf)
    at = p + np.where(some & np.isfinite(enter), enter, 0.0)[:, None] * d
    side = at * [1.0, 1.0, 0.0]
    side[:, 2] = -slope * np.hypot(at[:, 0], at[:, 1])
    length_of_side = np.sqrt(row_dot(side, side))[:, None]
    on_disc = (enter <= slab.enter)[:, None]
    normal = np.where(on_disc, slab.normal, side / np.where(length_of_side > 0.0, length_of_side, 1.0))
    return RayInterval(enter, leave, normal)


def revolved_surface(top: float, bottom: float, length: float) -> Triangles:
    """Coarse triangles of both discs and the side; an apex has no disc."""
    half = length / 2
    profile = [(0.0, -half), (bottom, -half), (top, half)] + ([(0.0, half)] if top > 0.0 else [])
    radii, heights = np.array(profile).T
    return revolved_triangles(radii, heights)


def revolved_mass(top: float, bottom: float, length: float, density: float) -> MassProperties:
    """Closed forms of a truncated cone: integrals of w² and w⁴ over the height, with w linear."""
    b, t, h = bottom, top, length
    second, fourth = b * b + b * t + t * t, b**4 + b**3 * t + b * b * t * t + b * t**3 + t**4
    mass = density * pi * h * second / 3
    up = h * (b * b + 2 * b * t + 3 * t * t) / (4 * second)  # of the centre above the lower disc
    along = density * pi * h * fourth / 10
    across = along / 2 + density * pi * h**3 * (b * b / 30 + b * t / 10 + t * t / 5) - mass * up * up
    return MassProperties(mass, np.array([0.0, 0.0, up - h / 2]), np.diag([across, across, along]))
