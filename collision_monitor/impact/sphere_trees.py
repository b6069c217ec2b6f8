"""Sphere trees of long bodies: bounds on the first contact that are tighter than those of the bounding spheres.

Source: slides "Time-critical collision detection" (from coarse to fine through the spheres of a tree). A tree halves a
long body across its length, LEVELS times, and gives each piece a sphere. The pieces are those of the convex hull of
the body. The octree of `geometry.lecture.sphere_tree` is finer and made for solids with holes, but its cells stand out
too far: for two long hulls it needs a hundred pairs of spheres where ten suffice here (docs/tradeoff.md).
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.geometry.vector import Vector, cross
from collision_monitor.impact.body_impact import Window, tube_of
from collision_monitor.impact.impact_record import CLEAR, TREE_BOUND
from collision_monitor.impact.sphere_interval import meeting_of_spheres, relative_motion_at, sphere_interval
from collision_monitor.motion.motion import change_at, half_acceleration, most_turning, pair_state, rotation_at
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.tolerances import ROUNDED_UP

Array = NDArray[np.float64]

LEVELS: Final = 2
"""Number of levels below the first: four pieces. One more level costs twice as much and gains little."""

WORTH: Final = 0.4
"""Largest radius of the finest spheres, as a fraction of the first one's. Beyond it a tree gains hardly anything."""

MOST_CORNERS: Final = 2000
"""Most corners of a body with a tree. With more, a tree takes a second to make."""


class Trees(NamedTuple):
    """The trees of all bodies, one after another; centres in the body's frame (m)."""

    root: Any  # (N,) int32: a body's first sphere; -1: no tree, only the bounding sphere
    center: Any  # (K, 3)
    radius: Any  # (K,)
    child: Any  # (K,) int32: the first of its two halves; -1: none
    stack: Any  # (M, 2) int32: scratch, the pairs of spheres still to examine


Tree = tuple[Array, Array]
"""Centres (2^(LEVELS + 1) - 1, 3) and radii of one tree, in the order of the levels."""

_CHILD: Final = np.array([2 * k + 1 if k < 2**LEVELS - 1 else -1 for k in range(2 ** (LEVELS + 1) - 1)], np.int32)


def body_tree(table: Any, next_part: NDArray[np.int32], first_shape: int) -> Tree | None:
    """Make the tree of the body whose shapes begin at that slot of the table; None if no tree is useful.

    That is so if a shape is neither a box nor a hull, if the body is not long, or if it has more than MOST_CORNERS.
    """
    corners, margin, slot = [], 0.0, first_shape
    while slot >= 0:
        if table.kind[slot] == CONVEX_HULL:
            begin = int(table.vertex_start[slot])
            points = table.vertices[:, begin : begin + int(table.vertex_count[slot])].T
        elif table.kind[slot] == BOX:
            points = table.size[slot, :3] * np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        else:
            return None
        corners.append(points @ table.local_rotation[slot].T + table.local_position[slot])
        margin = max(margin, float(table.margin[slot]))
        slot = int(next_part[slot])
    found = np.unique(np.concatenate(corners), axis=0)
    return _halved(found, margin) if 1 < len(found) <= MOST_CORNERS else None


def _halved(corners: Array, margin: float) -> Tree | None:
    """Make the tree of the convex hull of the corners (n, 3), grown by the margin (m); None if it is not long."""
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    axes = np.linalg.svd(corners - middle, full_matrices=False)[2]
    if len(axes) < 3:
        return None
    points = (corners - middle) @ axes.T
    points = points[:, np.argsort(-np.ptp(points, axis=0))]
    axes = axes[np.argsort(-np.ptp((corners - middle) @ axes.T, axis=0))]
    cuts = np.linspace(points[:, 0].min(), points[:, 0].max(), 2**LEVELS + 1)
    sections = [_section(points, float(cut)) for cut in cuts[1:-1]]
    sections = [np.empty((0, 3)), *sections, np.empty((0, 3))]
    spheres = []
    for level in range(LEVELS + 1):
        step = 2 ** (LEVELS - level)
        for k in range(0, 2**LEVELS, step):
            inside = (points[:, 0] >= cuts[k]) & (points[:, 0] <= cuts[k + step])
            piece = np.concatenate([points[inside], sections[k], sections[k + step]])
            center = 0.5 * (piece.min(axis=0) + piece.max(axis=0))
            spheres.append((*center, float(np.linalg.norm(piece - center, axis=1).max())))
    found = np.array(spheres)
    radius = (found[:, 3] + margin) * (1.0 + ROUNDED_UP)
    if radius[-(2**LEVELS) :].max() > WORTH * radius[0]:
        return None
    return found[:, :3] @ axes + middle, radius + ROUNDED_UP * float(np.abs(middle).max())


def _section(points: Array, cut: float) -> Array:
    """Points (m, 3) in the plane x = cut whose convex hull is the section of the points' hull: where lines cross it."""
    low, high = points[points[:, 0] < cut], points[points[:, 0] > cut]
    share = (cut - low[:, None, 0]) / (high[:, 0] - low[:, None, 0])
    section: Array = (low[:, None] + share[..., None] * (high - low[:, None])).reshape(-1, 3)
    return section


def joined_trees(trees: list[Tree | None], capacity: int) -> Trees:
    """Join the trees of the bodies in the slots 0, 1, … (None: no tree); capacity: number of slots."""
    size = 2 ** (LEVELS + 1) - 1
    there = [tree for tree in trees if tree is not None]
    root = np.full(capacity, -1, np.int32)
    root[[k for k, tree in enumerate(trees) if tree is not None]] = size * np.arange(len(there))
    first = np.repeat(size * np.arange(len(there), dtype=np.int32), size)
    child = np.tile(_CHILD, len(there))
    return Trees(
        root=root,
        center=np.concatenate([np.empty((0, 3)), *(center for center, _ in there)]),
        radius=np.concatenate([np.empty(0), *(radius for _, radius in there)]),
        child=np.where(child < 0, -1, first + child).astype(np.int32),
        stack=np.zeros((8 * LEVELS + 8, 2), np.int32),
    )


class _Ball(NamedTuple):
    """A sphere of a tree relative to its body's origin, in world axes, and its change while the body turns."""

    p: Any  # (3,): centre (m)
    v: Any  # (3,): velocity of the centre relative to the body's origin (m/s)
    radius: Any  # m
    growth: Any  # of the radius (m/s)


@inlined
def _ball(trees: Trees, at: int, m: Any, R: Any, w: Vector, turning: Any, span: float) -> _Ball:
    """Sphere `at` of a body in motion m (MOTION) with rotation R, which turns at w (rad/s) for `span` (s).

    turning: largest angular speed in the span (rad/s), and angular acceleration (rad/s^2). at = -1: the body's bounding
    sphere.
    """
    if at < 0:
        return _Ball((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), m.radius, 0.0)
    rate, harder = turning
    cx, cy, cz = trees.center[at, 0], trees.center[at, 1], trees.center[at, 2]
    x = R[0, 0] * cx + R[0, 1] * cy + R[0, 2] * cz
    y = R[1, 0] * cx + R[1, 1] * cy + R[1, 2] * cz
    z = R[2, 0] * cx + R[2, 1] * cy + R[2, 2] * cz
    growth = rate * sqrt(cx * cx + cy * cy + cz * cz)
    if rate * span >= 2.0:
        return _Ball((x, y, z), (0.0, 0.0, 0.0), trees.radius[at], growth)
    # it leaves its tangent by (rate t)^2 / 2 of the lever; its chord over the span is
    growth *= 0.5 * rate * span
    if harder > 0.0:
        growth += 0.5 * harder * span * sqrt(cx * cx + cy * cy + cz * cz)
    return _Ball((x, y, z), cross(w, (x, y, z)), trees.radius[at], growth)


@inlined
def _turning(m: Any, begin: float, end: float, harder: Vector) -> tuple[float, float]:
    """Largest angular speed of a motion in a span (rad/s), and the magnitude of its angular acceleration (rad/s^2)."""
    return most_turning(m, begin, end), sqrt(harder[0] * harder[0] + harder[1] * harder[1] + harder[2] * harder[2])


@device
def tree_meeting(bodies: Any, trees: Trees, i: int, j: int, window: Window, margin: float, rotation: Any) -> float:
    """Return a time (s after the window's begin) before which the trees of bodies i and j cannot meet; inf: never.

    The centres of the spheres move straight, with their velocity at the time when the bounding spheres meet. Their
    deviation from that by rotation is counted as growth of the radius. rotation (2 or more, 3, 3): scratch.
    """
    A, B = bodies.motion[i], bodies.motion[j]
    R_i, R_j = rotation[0], rotation[1]
    begin, end = window
    tube = tube_of(A, B, begin)
    p, v = relative_motion_at(A, B, begin)
    growth = tube.growth + half_acceleration(A, B, begin, end) * (end - begin)  # bounds the deviation from the tangent
    reach = A.radius + B.radius + margin + tube.start
    soonest, last = sphere_interval(p, v, reach, growth, end - begin, 1.0)
    if soonest > last:
        return inf
    span = last - soonest
    px, py, pz = p[0] + v[0] * soonest, p[1] + v[1] * soonest, p[2] + v[2] * soonest
    rotation_at(A, begin + soonest, R_i)
    rotation_at(B, begin + soonest, R_j)
    wide = (margin + (tube.start + growth * soonest)) * (1.0 + 1e-12)
    start = begin + soonest
    state = pair_state(A, B, start)
    change = change_at(A, B, state, start, span)
    turning_a, turning_b = _turning(A, start, end, change.turning_a), _turning(B, start, end, change.turning_b)
    stack = trees.stack
    stack[0, 0], stack[0, 1] = trees.root[i], trees.root[j]
    waiting, best = 1, inf
    while waiting > 0:  # terminates: each pair of spheres is removed once, and adds two with the halves of one
        waiting -= 1
        a, b = stack[waiting, 0], stack[waiting, 1]
        ball_a = _ball(trees, a, A, R_i, state.w_a, turning_a, span)
        ball_b = _ball(trees, b, B, R_j, state.w_b, turning_b, span)
        d = (px + (ball_b.p[0] - ball_a.p[0]), py + (ball_b.p[1] - ball_a.p[1]), pz + (ball_b.p[2] - ball_a.p[2]))
        u = (
            v[0] + (ball_b.v[0] - ball_a.v[0]),
            v[1] + (ball_b.v[1] - ball_a.v[1]),
            v[2] + (ball_b.v[2] - ball_a.v[2]),
        )
        first, last = sphere_interval(
            d, u, wide + ball_a.radius + ball_b.radius, growth + ball_a.growth + ball_b.growth, span, 1.0
        )
        if first > last or first >= best:
            continue
        next_a = -1 if a < 0 else trees.child[a]
        next_b = -1 if b < 0 else trees.child[b]
        if next_a >= 0 and (next_b < 0 or ball_a.radius >= ball_b.radius):
            for k in range(2):
                stack[waiting, 0], stack[waiting, 1] = next_a + k, b
                waiting += 1
            continue
        if next_b >= 0:
            for k in range(2):
                stack[waiting, 0], stack[waiting, 1] = a, next_b + k
                waiting += 1
            continue
        best = first
        if best == 0.0:
            break
    return best + soonest


@kernel
def tighten(bodies: Any, trees: Trees, events: Any, now: float, margin: float, rotation: Any) -> None:
    """Delay events (IMPACT) that are bounds by bounding spheres until the sphere trees meet.

    status = CLEAR if they do not meet before the cover times. rotation (2 or more, 3, 3): scratch.
    """
    for k in range(events.size):
        event = events[k]
        A, B = bodies.motion[event.i], bodies.motion[event.j]
        window = Window(max(now, event.lower), min(A.cover, B.cover))
        if window.begin < window.end and not (bodies.planned[event.i] or bodies.planned[event.j]):
            wait = tree_meeting(bodies, trees, event.i, event.j, window, margin, rotation)
            if wait == inf:
                event.status = CLEAR
            elif wait > 0.0:
                event.lower = window.begin + wait
                meeting_of_spheres(A, B, relative_motion_at(A, B, window.begin), window.begin, wait, event)
        event.method = TREE_BOUND
