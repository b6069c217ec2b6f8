"""The common part of two triangles that touch, and balls in two solids whose triangles do no more than that."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from collision_monitor._jit import kernel
from collision_monitor.meshes.distance.nearest import MEMORY
from collision_monitor.meshes.distance.triangle_pair import Corners
from collision_monitor.meshes.overlap.common_part import common_part, is_flat, normal_of
from collision_monitor.meshes.overlap.common_point import common_ball
from collision_monitor.meshes.placing import relative
from collision_monitor.meshes.trees.shape_trees import made_tree
from collision_monitor.shapes.registry import Mesh

Array = NDArray[np.float64]
SLACK = 1e-10
SQUARE = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0), (4, 5, 6, 7)]
CUBE = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))])
FACES = np.array([face for a, b, c, d in SQUARE for face in ((a, b, c), (a, c, d))])


@kernel
def parts(S, T, slack, out):  # type: ignore[no-untyped-def]
    A = Corners((S[0, 0], S[0, 1], S[0, 2]), (S[1, 0], S[1, 1], S[1, 2]), (S[2, 0], S[2, 1], S[2, 2]))
    B = Corners((T[0, 0], T[0, 1], T[0, 2]), (T[1, 0], T[1, 1], T[1, 2]), (T[2, 0], T[2, 1], T[2, 2]))
    n, m = normal_of(A), normal_of(B)
    part = common_part(A, B, n, m, slack)
    out[0], out[1], out[2] = part.middle
    out[3], out[4] = part.reach, part.room
    return is_flat(A, B, n, m, slack)


@kernel
def balls(blocks, root_b, R_a, R_b, p, sizes, work):  # type: ignore[no-untyped-def]
    radius, slack, far = sizes
    return common_ball(blocks, 0, root_b, relative(R_a, R_b, (p[0], p[1], p[2])), radius, slack, far, work)


def part_of(S: object, T: object, turn: Rotation) -> tuple[bool, Array, float, float]:
    out = np.zeros(5)
    flat = parts(turn.apply(np.array(S, float)), turn.apply(np.array(T, float)), SLACK, out)
    return flat, turn.inv().apply(out[:3]), out[3], out[4]


TURNS = [Rotation.identity(), *Rotation.random(20, rng=np.random.default_rng(5))]
FLAT = [(0, 0, 0), (2, 0, 0), (0, 2, 0)]


@pytest.mark.parametrize("turn", TURNS)
def test_the_middle_of_the_common_part(turn: Rotation) -> None:
    flat, middle, reach, room = part_of(FLAT, [(1, 0, 0), (3, 0, 0), (1, 2, 0)], turn)  # a corner of 1 x 1
    assert flat and room > 0.2 and reach > 0.4
    assert middle[2] == pytest.approx(0.0, abs=1e-12) and middle[0] > 1.0 and middle[1] > 0.0 and middle[:2].sum() < 2.0
    flat, middle, reach, room = part_of(FLAT, [(0, 0, 0), (0, 2, 0), (-2, 0, 0)], turn)  # an edge
    assert flat and abs(room) < 1e-9 and middle == pytest.approx([0, 1, 0], abs=1e-9)
    flat, middle, reach, _ = part_of(FLAT, [(0.5, -1, -1), (0.5, 3, -1), (0.5, 1, 3)], turn)  # a segment inside
    assert not flat and middle == pytest.approx([0.5, 0.75, 0], abs=1e-9) and reach == pytest.approx(0.75)
    flat, middle, reach, _ = part_of(FLAT, [(0, 0, 0), (2, 0, 0), (1, 0, 2)], turn)  # an edge of both
    assert not flat and middle == pytest.approx([1, 0, 0], abs=1e-9) and reach == pytest.approx(1.0)
    _, _, reach, _ = part_of(FLAT, [(0, 0, 1), (2, 0, 1), (0, 2, 1)], turn)  # none
    assert reach == 0.0
    _, _, reach, _ = part_of(FLAT, [(2, 0, 0), (3, 0, 1), (3, 0, -1)], turn)  # a point
    assert reach < 1e-9


DEEP = [(0.5, 0, 0), (0.5, 0.5, 0), (0, 0, 1e-6), (-0.3, 0, 0), (0, -1 + 1e-7, 0)]
TOUCHING = [(1, 0, 0), (1, 0.5, 0), (1, 1, 0), (1, 1, 1), (0, 0.2, -1), (1.2, 0, 0), (1 - 1e-13, 0, 0)]


@pytest.mark.parametrize("inward", [False, True])
@pytest.mark.parametrize("turn", TURNS[:6])
def test_balls_in_cubes_with_faces_in_one_plane(turn: Rotation, inward: bool) -> None:
    first = made_tree(Mesh(CUBE, FACES))
    own = TURNS[-1]  # of the second cube in its frame
    second = made_tree(Mesh(own.apply(CUBE), FACES[:, ::-1] if inward else FACES))
    assert first is not None and second is not None
    blocks, work = np.concatenate([first, second]), np.zeros(MEMORY)
    R_a, R_b = turn.as_matrix(), (turn * own.inv()).as_matrix()
    for p in DEEP + TOUCHING:
        for far in (np.inf, 1.0 - np.abs(p).max()):
            found = balls(blocks, len(first), R_a, R_b, turn.apply(p), (SLACK, SLACK, far), work)
            assert found == (p in DEEP)


def test_a_ball_is_as_large_as_asked_for() -> None:
    tree = made_tree(Mesh(CUBE, FACES))
    assert tree is not None
    work = np.zeros(MEMORY)
    for depth in (1e-6, 1e-3, 0.1):
        p = np.array((1.0 - depth, 0.0, 0.0))
        for radius, expected in ((0.4 * depth, True), (0.6 * depth, False)):
            assert balls(tree, 0, np.eye(3), np.eye(3), p, (radius, SLACK, depth), work) == expected
