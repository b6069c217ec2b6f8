"""`time_of_impact_batch` answers like `time_of_impact`, row by row; refusals."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest
import trimesh

import collision_monitor as cm
from collision_monitor import Motion, Pose, time_of_impact, time_of_impact_batch

BOX = cm.Box((0.7, 0.9, 0.5))
ROCK = cm.ConvexHull(np.random.default_rng(3).normal(size=(16, 3)) * 0.4)
ARM = [(cm.Box((1, 0.2, 0.2)), Pose((0.5, 0, 0))), (cm.Sphere(0.3), Pose((1, 0, 0)))]
TORUS = trimesh.creation.torus(0.6, 0.2, major_sections=6, minor_sections=4)
RING = cm.Mesh(TORUS.vertices, TORUS.faces)
STILL = (0, 0, 0, 0, 0, 0, 1)


def states(rng, n, reach=1.5):
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.column_stack([rng.uniform(-reach, reach, (n, 3)), q]), rng.normal(size=(n, 6))


@pytest.mark.parametrize(
    ("a", "b", "n"),
    [
        (BOX, ROCK, 60),
        (cm.Sphere(0.5), cm.Sphere(0.3), 60),
        (ARM, BOX, 40),
        (ROCK, cm.HalfSpace((0, 0, 1), -1), 40),
        (RING, cm.Sphere(0.2), 6),
        (cm.Circle(0.5), cm.Polygon([(0, 0), (1, 0), (0, 1)]), 10),
    ],
    ids=lambda value: type(value).__name__,
)
def test_each_row_is_the_answer_for_one(a, b, n):
    rng = np.random.default_rng(9)
    pa, ta = states(rng, n)
    pb, tb = states(rng, n)
    planar = isinstance(a, cm.Circle)
    if planar:
        pa[:, 3:6] = pb[:, 3:6] = 0.0
        pa[:, 6] = pb[:, 6] = 1.0
    if isinstance(b, cm.HalfSpace):
        tb[:, 3:] = 0.0
    answers = time_of_impact_batch(a, pa, ta, b, pb, tb, separation=0.01)
    for k in range(n):
        A, B = (Motion(Pose(p[k, :3], p[k, 3:]), t[k, :3], t[k, 3:]) for p, t in ((pa, ta), (pb, tb)))
        one = time_of_impact(a, A, b, B, separation=0.01)
        assert (answers.status[k], answers.lower[k]) == (one.status, pytest.approx(one.lower, rel=1e-12))
        assert answers.upper[k] == pytest.approx(one.upper, rel=1e-12)
    assert {"hit", "clear"} <= set(answers.status)


def test_spheres_in_many_motions_against_the_roots_in_100_digits():
    """Includes spheres that graze by a relative 1e-14 to 1e-1 of their radius, from up to 1e9 radii away."""
    rng = np.random.default_rng(2)
    n = 3000
    away, by = 10.0 ** rng.uniform(0.5, 9, n), 10.0 ** rng.uniform(-14, -1, n) * rng.choice([-1, 1], n)
    by[::2] = rng.uniform(-1, 1, n // 2)  # half of them do not graze
    v = rng.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    side = np.cross(v, rng.normal(size=(n, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    p, v = -v * away[:, None] + side * (1 + by)[:, None], v * away[:, None]
    poses, twists = np.tile(STILL, (n, 1)).astype(float), np.zeros((n, 6))
    poses[:, :3], twists[:, :3] = p, v
    answers = time_of_impact_batch(cm.Sphere(0.75), STILL, np.zeros(6), cm.Sphere(0.25), poses, twists, 2.0, 1e-9)
    for k in range(n):
        with localcontext(prec=100):
            P, V = [Decimal(x) for x in p[k]], [Decimal(x) for x in v[k]]
            a, b = sum(x * x for x in V), sum(x * y for x, y in zip(P, V, strict=True))
            discriminant = b * b - a * (sum(x * x for x in P) - 1)
            if discriminant < 0:
                assert answers.status[k] != "hit"
                continue
            assert answers.status[k] != "clear"
            assert answers.lower[k] <= (-b - discriminant.sqrt()) / a <= answers.upper[k]
    certain = answers.status == "hit"
    assert (answers.upper[certain] - answers.lower[certain]).max() < 1e-6
    assert (answers.status == "unresolved").sum() < 0.2 * n
    assert certain.sum() > 0.3 * n and (answers.status == "clear").sum() > 0.3 * n


def test_single_rows_are_repeated_and_many_fit():
    n = 10_000
    poses = np.tile(STILL, (n, 1)) + np.linspace(0, 8, n)[:, None] * np.array([1, 0, 0, 0, 0, 0, 0])
    answers = time_of_impact_batch(cm.Sphere(1), STILL, (1, 0, 0, 0, 0, 0), cm.Sphere(1), poses, np.zeros(6), 5.0)
    expected = np.maximum(poses[:, 0] - 2, 0)
    hit = expected < 5
    assert (answers.status == np.where(hit, "hit", "clear")).all()
    assert (answers.lower[hit] <= expected[hit]).all() and (expected[hit] <= answers.upper[hit] + 1e-12).all()
    assert time_of_impact_batch(BOX, STILL, np.zeros(6), BOX, np.zeros((0, 7)), np.zeros(6)).lower.shape == (0,)


def test_what_touches_is_followed_here_too():
    cube = cm.Box((1, 1, 1))
    twists = np.array([(0.1, 0, 0, 0, 0, 0), (0, 0.3, 0, 0, 0, 0), (0, 0, 0, 3, 0, 0), (-0.1, 0, 0, 0, 0, 0)])
    answers = time_of_impact_batch(cube, STILL, np.zeros(6), cube, (1, 0, 0, 0, 0, 0, 1), twists)
    assert list(answers.status) == ["clear", "clear", "clear", "hit"]


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"poses_a": np.zeros((2, 6))}, cm.InputError, r"poses A: expected an array \(N, 7\), got shape \(2, 6\)"),
        ({"poses_a": "here"}, cm.InputError, "poses A: expected poses as rows"),
        ({"twists_b": np.full(6, np.nan)}, cm.PoseError, "twists B: expected finite numbers"),
        (
            {"poses_b": np.zeros(7)},
            cm.PoseError,
            "poses B: expected quaternions of unit length.*got one of length 0 in row 0",
        ),
        (
            {"poses_a": [STILL] * 2, "twists_a": np.zeros((3, 6))},
            cm.InputError,
            "got poses A 2, twists A 3",
        ),
        ({"poses_a": [STILL] * 2, "poses_b": [STILL] * 3}, cm.InputError, "got motions_a 2, motions_b 3"),
        ({"horizon": -1}, cm.InputError, "horizon"),
        ({"shapes_a": cm.HalfSpace((0, 0, 1), 0), "twists_a": np.ones(6)}, cm.UnsupportedError, "turn"),
    ],
    ids=lambda value: "",
)
def test_what_is_refused(change, error, words):
    arguments = {"shapes_a": BOX, "poses_a": STILL, "twists_a": np.zeros(6)}
    arguments |= {"shapes_b": BOX, "poses_b": STILL, "twists_b": np.zeros(6)} | change
    with pytest.raises(error, match=words):
        time_of_impact_batch(**arguments)
