"""A point inside two solids whose triangles only touch, which proves that they overlap.

Where faces of both solids are in one plane, no triangle passes through another one, however deep the solids are in each
other. But behind those faces, on the inner side of both, are points of both solids. Such points are guessed from the
triangles that touch; the proof is that both surfaces enclose a ball about one of them.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, along, direction, plus, scaled
from collision_monitor.meshes.distance.nearest import PAIRS, triangle_at
from collision_monitor.meshes.layout import CLOSED, WIDTH
from collision_monitor.meshes.overlap.common_part import common_part, is_flat, normal_of
from collision_monitor.meshes.overlap.inside import INSIDE, OUTSIDE, is_clear, locate_in_surface
from collision_monitor.meshes.overlap.touching_triangles import nearly_touching
from collision_monitor.meshes.placing import Placing, inverse, place_point, place_triangle

MOST_TOUCHING: Final = 256
"""Most pairs of triangles that touch to take points from. More: solids with fine coplanar faces that slide past each
other take longer. Fewer: the pairs may all be at places where the solids only touch."""

MOST_TRIES: Final = 12
FEWER_TRIES: Final = 3
"""Most pairs of either kind to take points from, 1 us each for small meshes, where faces look outward, and for each
other choice of sides. More, fewer: as before."""

SIDES: Final = ((-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0))
"""Sides of the faces of both on which the solids are; faces look outward in nearly all meshes."""

OPPOSED: Final = 1e-3
"""Length of the sum of two unit vectors that count as opposed: the solids are on different sides of one plane."""

DEPTHS: Final = 4
LESS: Final = 0.125
"""Number of distances from such a point to try, and the ratio of each to the one before. More, or a larger ratio: they
fit into thinner solids, and take longer. The ratio of the last to the first is 1/512."""


class _Both(NamedTuple):
    """Two trees in one array, and the pose of A in B's frame."""

    blocks: Any
    root_a: Any
    root_b: Any
    Y: Placing


@inlined
def bounds_solid(blocks: Any, root: int) -> bool:
    """Whether a tree is that of a closed surface."""
    return blocks[root, CLOSED, 1] != 0.0


@device
def common_ball(
    blocks: Any, root_a: int, root_b: int, X: Placing, radius: float, slack: float, far: float, work: Any
) -> bool:
    """Whether a ball with this radius (m) is found that is certainly inside both of two closed surfaces.

    X: pose of B in A's frame. slack: distance at which triangles count as touching (m). far: about as deep as the
    solids may be in each other (m), or infinite. work (MEMORY,).
    """
    count = nearly_touching(blocks, root_a, blocks, root_b, X, slack, MOST_TOUCHING, work)
    both = _Both(blocks, root_a, root_b, inverse(X))
    for side_a, side_b in SIDES:
        for flat in (True, False):  # what is in one plane, and has the same side inside, is certainly in both
            tries = MOST_TRIES if side_a + side_b < 0.0 else FEWER_TRIES
            for k in range(count):
                a, b = int(work[PAIRS + 2 * k]), int(work[PAIRS + 2 * k + 1])
                S = triangle_at(blocks, a // WIDTH, a % WIDTH)
                T = place_triangle(X, triangle_at(blocks, b // WIDTH, b % WIDTH))
                n, m = normal_of(S), normal_of(T)
                length, u = direction(plus(scaled(n, side_a), scaled(m, side_b)))
                if length < OPPOSED or is_flat(S, T, n, m, slack) != flat:
                    continue
                part = common_part(S, T, n, m, slack)
                if part.reach <= 2.0 * slack or (flat and part.room <= 2.0 * slack):
                    continue
                if _is_ball_along(both, part.middle, u, 0.5 * min(far, part.reach), radius, work):
                    return True
                tries -= 1
                if tries == 0:
                    break
    return False


@device
def _is_ball_along(both: _Both, x: Vector, u: Vector, depth: float, radius: float, work: Any) -> bool:
    """Whether a ball in both solids is found along u from a point x where they touch, up to this depth (m)."""
    nearest = along(x, depth * LESS ** (DEPTHS - 1), u)
    if locate_in_surface(both.blocks, both.root_a, nearest, work) == OUTSIDE:
        return False
    if locate_in_surface(both.blocks, both.root_b, place_point(both.Y, nearest), work) == OUTSIDE:
        return False
    for _ in range(DEPTHS):
        y = along(x, depth, u)
        in_a = _is_ball_in(both.blocks, both.root_a, y, radius, work)
        if in_a and _is_ball_in(both.blocks, both.root_b, place_point(both.Y, y), radius, work):
            return True
        depth *= LESS
    return False


@device
def _is_ball_in(blocks: Any, root: int, x: Vector, radius: float, work: Any) -> bool:
    """Whether a ball is certainly inside a closed surface."""
    return locate_in_surface(blocks, root, x, work) == INSIDE and is_clear(blocks, root, x, radius, work)
