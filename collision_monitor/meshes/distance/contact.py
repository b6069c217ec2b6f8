"""Contact of two trees: the nearest triangles, the deepest that touch, or how deep one solid is inside the other."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import along, dot, minus, opposite, rotate, sum_of_sizes
from collision_monitor.meshes.distance.nearest import LEAST, MOST_PAIRS, ON_A, ON_B, PLACE_A, nearest_triangles
from collision_monitor.meshes.layout import AXES, CENTER, HALF, RADIUS, REACH, WIDTH
from collision_monitor.meshes.overlap.inside import INSIDE, UNKNOWN, is_either_in
from collision_monitor.meshes.overlap.touching_triangles import deepest_touching, touching_triangles
from collision_monitor.meshes.placing import relative
from collision_monitor.narrow_phase.contact_row import write
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.tolerances import SAT_ROUND_OFF

FARTHER, APART, TOUCHING, ENCLOSED, OPEN = range(5)
"""What is known of a pair: farther than the limit; apart; surfaces touch; one is in the other and surfaces are apart;
surfaces are apart, and round-off or the number of parts leaves open whether one is in the other."""

FACE_TO_FACE: Final = (0.0, 0.0, 1.0)
"""Normal where no direction is better than another."""


@inlined
def reach_in(blocks: Any, root: int) -> float:
    """Distance (m) of the farthest point of a tree from its origin."""
    return blocks[root, REACH, 1]


def tree_reach(tree: NDArray[np.float64]) -> float:
    """Distance (m) of the farthest point of a tree from its origin."""
    return float(tree[0, REACH, 1])


def in_root_box(tree: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (n, 3) in m, in the frame of a tree, are in the box of the whole tree."""
    axes = tree[0, AXES : AXES + 9, 0].reshape(3, 3)
    own = (points - tree[0, CENTER : CENTER + 3, 0]) @ axes
    return np.asarray((np.abs(own) <= tree[0, HALF : HALF + 3, 0]).all(axis=1))


@outlined
def tree_contact(
    blocks_a: Any,
    root_a: int,
    blocks_b: Any,
    root_b: int,
    pose: PairPose,
    limit: float,
    out: Any,
    answer: Any,
    work: Any,
) -> int:
    """Write the contact of two trees into a contact row if they are at most `limit` (m) apart; return what is known.

    pose: as for every pair test. answer: of `nearest_triangles`, with a hint or not. If surfaces touch, the depth is
    that of the deepest pair of triangles. The bound holds round-off only: what parts concave solids may be longer.
    """
    X = relative(pose.R_A, pose.R_B, pose.p)
    round_off = SAT_ROUND_OFF * (reach_in(blocks_a, root_a) + reach_in(blocks_b, root_b) + sum_of_sizes(pose.p))
    # beyond the limit by round-off, because a search for less than 0 would find no surfaces that touch
    distance = nearest_triangles(blocks_a, root_a, blocks_b, root_b, X, limit + round_off, answer, work)
    if distance == 0.0:
        count, _ = touching_triangles(blocks_a, root_a, blocks_b, root_b, X, MOST_PAIRS, work)
        if count > 0:
            depth, n, on_a = deepest_touching(blocks_a, blocks_b, X, work, count, answer)
        else:  # round-off says so of the distance alone
            depth, n, on_a = 0.0, FACE_TO_FACE, (answer[ON_A], answer[ON_A + 1], answer[ON_A + 2])
        write(out, -depth, rotate(pose.R_A, n), rotate(pose.R_A, on_a), round_off)
        return TOUCHING
    known, clear = APART, max(min(distance, limit), 0.0)
    inside = is_either_in(blocks_a, root_a, blocks_b, root_b, X, clear, work)
    if inside == INSIDE:
        known = ENCLOSED
    elif inside == UNKNOWN:
        known = OPEN
    if distance == inf:
        if known == APART and answer[LEAST] == inf:
            return FARTHER
        distance = nearest_triangles(blocks_a, root_a, blocks_b, root_b, X, inf, answer, work)
    on_a, on_b = (answer[ON_A], answer[ON_A + 1], answer[ON_A + 2]), (answer[ON_B], answer[ON_B + 1], answer[ON_B + 2])
    w = minus(on_b, on_a)
    length = sqrt(dot(w, w))
    n = (w[0] / length, w[1] / length, w[2] / length) if length > 0.0 else FACE_TO_FACE
    place = int(answer[PLACE_A])
    on_a = along(on_a, blocks_a[place // WIDTH, RADIUS, place % WIDTH], n)
    if known == ENCLOSED:
        distance, n = -distance, opposite(n)
    round_off += max(abs(distance) - answer[LEAST], 0.0)  # of a search that ended early
    if known == APART and answer[LEAST] <= limit < distance:
        known = OPEN
    write(out, distance, rotate(pose.R_A, n), rotate(pose.R_A, on_a), round_off)
    return known
