"""`time_of_impact` for any two shapes: against exact roots, dense samples and known motions; refusals."""

from __future__ import annotations

from decimal import Decimal, localcontext
from itertools import combinations_with_replacement
from math import inf

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import collision_monitor as cm
from collision_monitor import Motion, Pose, contact, time_of_impact
from collision_monitor.query.impact.impact_kernel import impact_of_chains

ROCK = cm.ConvexHull(np.random.default_rng(3).normal(size=(16, 3)) * 0.4)
SOLIDS = [cm.Sphere(0.4), cm.Box((0.7, 0.9, 0.5)), cm.Capsule(0.2, 0.8), cm.Cylinder(0.4, 0.7), cm.Cone(0.5, 0.9), ROCK]
SOLIDS += [cm.Ellipsoid((0.3, 0.5, 0.6))]
BOX = cm.Box((1, 1, 1))
FLOOR = cm.HalfSpace((0, 0, 1), 0)
BOARD = [(cm.Box((9, 9, 1)), Pose((0, 0, -0.5)))]
HALVES = [(cm.Box((1, 0.5, 1)), Pose((0, 0.25, 0))), (cm.Box((1, 0.5, 1)), Pose((0, -0.25, 0)))]
LYING = (0, np.sqrt(0.5), 0, np.sqrt(0.5))


def name(value):
    return type(value).__name__


def still(*position):
    return Motion(Pose(position))


def turned(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_motion(rng, reach=1.5):
    return Motion(Pose(rng.uniform(-reach, reach, 3), turned(rng)), rng.normal(size=3), rng.normal(size=3))


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32), st.floats(-6, 6))
def test_spheres_against_the_exact_root(seed, exponent):
    rng = np.random.default_rng(seed)
    scale = 10.0**exponent
    r, s = rng.uniform(0.1, 1, 2) * scale
    p, v = rng.uniform(-3, 3, 3) * scale, rng.normal(size=3) * scale
    answer = time_of_impact(cm.Sphere(r), still(0, 0, 0), cm.Sphere(s), Motion(Pose(p), v), 2.0, 1e-6 * scale)
    with localcontext(prec=80):
        P, V = [Decimal(x) for x in p], [Decimal(x) for x in v]
        c = sum(x * x for x in P) - (Decimal(r) + Decimal(s)) ** 2
        a, b = sum(x * x for x in V), sum(x * y for x, y in zip(P, V, strict=True))
        discriminant = b * b - a * c
        root = -b - discriminant.sqrt() if discriminant >= 0 else Decimal(-1)
        first = Decimal(0) if c <= 0 else (root / a if root > 0 else Decimal("inf"))
    if first > 2.0:
        assert answer.status == "clear" or (
            answer.status == "unresolved" and answer.contact.signed_distance < 1e-6 * scale
        )
    else:
        assert answer.status == "hit" or first > 2.0 - 1e-5
        assert answer.lower <= first <= answer.upper
        assert answer.upper - answer.lower <= 1e-5


def test_spheres_that_graze_from_afar():
    """By a relative 1e-14 to 1e-1 of their radius, from up to 1e9 radii away: no root is missed, no miss is a hit."""
    rng = np.random.default_rng(0)
    statuses = []
    for _ in range(300):
        away, by = 10.0 ** rng.uniform(0.5, 9), 10.0 ** rng.uniform(-14, -1) * rng.choice([-1, 1])
        v = turned(rng)[:3]
        v /= np.linalg.norm(v)
        side = np.cross(v, turned(rng)[:3])
        p, v = -v * away + side / np.linalg.norm(side) * (1 + by), v * away
        answer = time_of_impact(cm.Sphere(0.5), still(0, 0, 0), cm.Sphere(0.5), Motion(Pose(p), v), 2.0, 1e-9)
        statuses.append(answer.status)
        with localcontext(prec=100):
            P, V = [Decimal(x) for x in p], [Decimal(x) for x in v]
            a, b = sum(x * x for x in V), sum(x * y for x, y in zip(P, V, strict=True))
            discriminant = b * b - a * (sum(x * x for x in P) - 1)
            if discriminant < 0:
                assert answer.status != "hit"
                continue
            assert answer.status != "clear"
            assert answer.lower <= (-b - discriminant.sqrt()) / a <= answer.upper
        if answer.status == "hit":
            assert answer.upper - answer.lower < 1e-6
    assert statuses.count("hit") > 60 and statuses.count("clear") > 60


@pytest.mark.parametrize(("a", "b"), list(combinations_with_replacement(SOLIDS, 2)), ids=name)
def test_every_pair_against_dense_samples(a, b):
    rng = np.random.default_rng(8)
    times = np.linspace(0.0, 2.0, 81)
    hits = 0
    for _ in range(6):
        A, B = random_motion(rng), random_motion(rng)
        answer = time_of_impact(a, A, b, B)
        assert answer.status in ("hit", "clear")
        distance = np.array([contact(a, A.at(t), b, B.at(t)).signed_distance for t in times])
        before = times < answer.lower
        assert (distance[before] > 0.0).all()
        if answer.status == "hit":
            hits += 1
            assert answer.lower <= answer.upper <= answer.lower + 1e-2
            if answer.lower > 0.0:
                assert -1e-4 < answer.contact.signed_distance <= 1e-9
                assert -1e-9 < contact(a, A.at(answer.lower), b, B.at(answer.lower)).signed_distance <= 2e-6
        swapped = time_of_impact(b, B, a, A)
        assert swapped.status == answer.status
        assert swapped.lower <= answer.upper and answer.lower <= swapped.upper
    assert hits > 0


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32))
def test_a_common_motion_of_the_frame_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    A, B, X = random_motion(rng), random_motion(rng), Pose(rng.uniform(-100, 100, 3), turned(rng))
    drift = rng.normal(size=3)

    def moved(m):
        return Motion(X @ m.pose, X.rotation @ m.linear + drift, X.rotation @ m.angular)

    one, other = time_of_impact(BOX, A, ROCK, B), time_of_impact(BOX, moved(A), ROCK, moved(B))
    assert one.status == other.status
    if one.status == "hit":
        assert one.lower <= other.upper and other.lower <= one.upper


def test_a_spinning_rod_finds_the_ball_and_a_thin_plate_the_bullet():
    rod = Motion(Pose((0, 0, 0)), (0, 0, 0), (0, 20, 0))
    answer = time_of_impact(cm.Capsule(0.01, 2), rod, cm.Sphere(0.05), still(0.9, 0, 0), 1.0)
    angle = np.pi / 2 - np.arcsin(0.06 / 0.9)
    assert answer.status == "hit"
    assert answer.lower <= angle / 20 <= answer.upper
    bullet = Motion(Pose((0, 0, 500)), (0, 0, -1000))
    answer = time_of_impact(cm.Box((1, 1, 1e-3)), still(0, 0, 0), cm.Sphere(5e-4), bullet, 1.0)
    assert answer.status == "hit"
    assert answer.lower <= 0.499999 <= answer.upper + 1e-15


def test_overlapping_already_is_an_impact_at_once():
    answer = time_of_impact(BOX, still(0, 0, 0), BOX, Motion(Pose((0.4, 0, 0)), (9, 0, 0)))
    assert (answer.status, answer.lower, answer.upper) == ("hit", 0.0, 0.0)
    assert answer.contact.signed_distance == pytest.approx(-0.6)


@pytest.mark.parametrize(
    ("linear", "angular", "status"),
    [
        ((0.1, 0, 0), (0, 0, 0), "clear"),  # they separate
        ((0, 0.3, 0), (0, 0, 0), "clear"),  # it slides along the face for the whole horizon, or past its end
        ((0, 0, 0), (0, 0, 0), "clear"),  # it rests
        ((0.1, 0, 0), (0, 0, 0.05), "clear"),  # it separates faster than the rotation closes the gap
        ((-0.1, 0, 0), (0, 0, 0), "hit"),
        ((0.1, 0, 0), (0, 0, 1), "hit"),  # a corner turns in
    ],
)
@pytest.mark.parametrize("horizon", [1e-6, 2.0, 1e6])
def test_what_touches_goes_deeper_or_does_not(linear, angular, status, horizon):
    if horizon > 2.0 and any(angular):
        horizon = 2.0
    answer = time_of_impact(BOX, still(0, 0, 0), BOX, Motion(Pose((1, 0, 0)), linear, angular), horizon)
    if horizon == 1e-6 and status == "hit":
        # 1e-7 m is close to the tolerance: the answer may be unresolved, but not clear
        assert answer.status in ("hit", "unresolved")
    else:
        assert answer.status == status
    if status == "clear":
        assert answer.lower == answer.upper == inf and answer.contact is None


def test_what_touches_parts_and_comes_back_is_found():
    ball = Motion(Pose((0, 0, 0)), (0, 0, 0))
    # the long rod lies on the ball, swings away and its other end comes round
    rod = Motion(Pose((0.6, 0, 0.8)), (0, 0, 0), (0, -2.0, 0))
    start = contact(cm.Sphere(0.5), ball.pose, cm.Box((0.2, 0.2, 2)), rod.pose)
    assert abs(start.signed_distance) < 1e-15
    answer = time_of_impact(cm.Sphere(0.5), ball, cm.Box((0.2, 0.2, 2)), rod, 3.0)
    assert answer.status == "hit"
    times = np.linspace(1e-3, answer.lower, 200)[:-1]
    assert all(
        contact(cm.Sphere(0.5), ball.at(t), cm.Box((0.2, 0.2, 2)), rod.at(t)).signed_distance > -1e-9 for t in times
    )


@pytest.mark.parametrize(
    ("shape", "motion", "below"),
    [
        (cm.Sphere(0.5), Motion(Pose((0, 0, 0.5)), (1, 0, 0), (0, 2, 0)), FLOOR),
        (cm.Sphere(0.5), Motion(Pose((0, 0, 0.5)), (1, 0, 0), (0, 2, 0)), BOARD),
        (cm.Cylinder(0.5, 1), Motion(Pose((0, 0, 0.5), LYING), (0, 1, 0), (-2, 0, 0)), FLOOR),
        (cm.Capsule(0.3, 1), Motion(Pose((0, 0, 0.3), LYING), (0, 1, 0), (-1 / 0.3, 0, 0)), FLOOR),
        (cm.Cylinder(0.5, 1), Motion(Pose((0, 0, 0.5)), (0, 0, 0), (0, 0, 5)), BOARD),
        (BOX, Motion(Pose((0, 0, 0.5)), (1, 0, 0), (0, 0, 3)), FLOOR),
        (HALVES, Motion(Pose((0, 0, 0.5)), (1, 0, 0), (0, 0, 3)), FLOOR),
        (HALVES, Motion(Pose((0, 0, 0.5)), (0, 1, 0)), BOARD),
        (HALVES, Motion(Pose((0, 0, 0.5)), (0, 0, 1)), BOARD),
        (BOX, Motion(Pose((0, 0.5, 0.5)), (0, 1, 0)), [(s, p @ Pose((0, 0, -0.5))) for s, p in HALVES]),  # over a seam
    ],
)
def test_rolling_spinning_and_sliding_are_no_impact(shape, motion, below):
    for horizon in (1e-3, 2, 1000):
        assert time_of_impact(shape, motion, below, still(0, 0, 0), horizon).status == "clear"


def test_a_part_that_touches_does_not_hide_one_that_comes():
    wall = [(cm.Box((9, 9, 1)), Pose((0, 0, -0.5))), (cm.Box((1, 9, 9)), Pose((3, 0, 0)))]
    ball = Motion(Pose((0, 0, 0.5)), (1, 0, 0), (0, 2, 0))
    answer = time_of_impact(cm.Sphere(0.5), ball, wall, still(0, 0, 0), 9)
    assert answer.status == "hit"
    assert answer.lower <= 2.0 <= answer.upper


def test_touching_at_random_against_dense_samples():
    rng = np.random.default_rng(5)
    times = np.concatenate([np.geomspace(1e-6, 2, 25), np.linspace(0, 2, 26)])
    seen = {"hit": 0, "clear": 0, "unresolved": 0}
    for k in range(75):
        a, b = rng.choice(len(SOLIDS), 2)
        A, B = random_motion(rng), random_motion(rng, 2.5)
        gap = contact(SOLIDS[a], A.pose, SOLIDS[b], B.pose)
        B = Motion(Pose(B.pose.position - gap.signed_distance * gap.normal, B.pose.quaternion), B.linear, B.angular)
        if k % 3:  # apart, so that more pairs separate, or without rotation
            B = Motion(B.pose, B.linear + 2 * gap.normal, B.angular * (k % 3 - 1))
        answer = time_of_impact(SOLIDS[a], A, SOLIDS[b], B)
        seen[answer.status] += 1
        distance = np.array([contact(SOLIDS[a], A.at(t), SOLIDS[b], B.at(t)).signed_distance for t in times])
        assert (distance[times < answer.lower] > -1e-8).all()
        if answer.status == "hit":
            assert answer.contact.signed_distance < 0.0
        if answer.status == "clear":
            assert (distance > -1e-8).all()
    assert seen["hit"] > 12 and seen["clear"] > 12


def test_whole_numbers_are_numbers():
    """Integers are converted; else Numba compiles the kernels anew for a quarter of a minute."""
    answer = time_of_impact(cm.Sphere(1), Motion(Pose(), (1, 0, 0)), BOX, still(4, 0, 0), 9, 1, 0, np.int32(50))
    assert answer.status == "hit"
    assert len(impact_of_chains.signatures) == 1


def test_separation_is_kept():
    answer = time_of_impact(cm.Sphere(1), Motion(Pose(), (1, 0, 0)), BOX, still(4, 0, 0), 9.0, separation=0.25)
    assert answer.lower <= 2.25 <= answer.upper
    assert answer.contact.signed_distance == pytest.approx(0.25, abs=2e-6)


def test_compounds_meshes_and_the_plane():
    arm = [(cm.Box((2, 0.2, 0.2)), Pose((1, 0, 0))), (cm.Sphere(0.3), Pose((2, 0, 0)))]
    answer = time_of_impact(arm, Motion(Pose(), (0, 0, 0), (0, 0, 1)), cm.Sphere(0.1), still(0, 2, 0))
    expected = np.pi / 2 - 2 * np.arcsin(0.4 / 4)
    assert answer.lower <= expected <= answer.upper
    torus = trimesh.creation.torus(1.0, 0.25, major_sections=12, minor_sections=6)
    ring = cm.Mesh(torus.vertices, torus.faces)
    through = Motion(Pose((0, 0, 3)), (0, 0, -2))
    assert time_of_impact(ring, still(0, 0, 0), cm.Sphere(0.3), through, 4.0).status == "clear"
    assert time_of_impact(ring, still(0, 0, 0), cm.Sphere(0.8), through, 4.0).status == "hit"
    triangle = cm.Polygon([(0, 0), (1, 0), (0, 1)])
    answer = time_of_impact(triangle, Motion(Pose((0, 0, 7)), (1, 0, -3)), cm.Circle(0.5), still(3, 0, 0), 4.0)
    assert answer.lower <= 1.5 <= answer.upper


def test_too_small_a_budget_is_unresolved_not_clear():
    spin, beside = Motion(Pose(), (1, 0, 0), (3, 4, 5)), still(4, 1.72, 0)
    assert time_of_impact(BOX, spin, BOX, beside, 8.0).status == "clear"
    answer = time_of_impact(BOX, spin, BOX, beside, 8.0, iterations=1)
    assert answer.status == "unresolved"
    assert 0.0 < answer.lower < 8.0 and answer.upper == inf
    assert answer.contact.signed_distance > 0.0
    # a certain hit stays a hit with any budget, with a wider interval
    tight, wide = (time_of_impact(BOX, spin, BOX, still(4, 0, 0), 5.0, iterations=n) for n in (1000, 1))
    assert tight.status == wide.status == "hit"
    assert wide.lower < tight.lower <= wide.upper


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
def test_scale_costs_nothing(scale):
    A = Motion(Pose(), (scale, 0, 0), (0.3, 0.2, 0.1))
    answer = time_of_impact(
        cm.Box(np.array((1, 2, 3)) * scale), A, cm.Sphere(scale), still(4 * scale, 0, 0), 4.0, 1e-6 * scale
    )
    one = time_of_impact(
        cm.Box((1, 2, 3)), Motion(Pose(), (1, 0, 0), (0.3, 0.2, 0.1)), cm.Sphere(1), still(4, 0, 0), 4.0
    )
    assert answer.status == one.status == "hit"
    assert answer.lower == pytest.approx(one.lower, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"horizon": -1.0}, cm.InputError, "horizon: expected a finite number, at least 0, got -1.0"),
        ({"horizon": inf}, cm.InputError, "horizon"),
        ({"tolerance": 0.0}, cm.InputError, "tolerance: expected a finite number, above 0, got 0.0"),
        ({"separation": float("nan")}, cm.InputError, "separation"),
        ({"iterations": 0}, cm.InputError, "iterations"),
        ({"iterations": 2.5}, cm.InputError, "iterations: expected a whole number from 1, got 2.5"),
        ({"horizon": "soon"}, cm.InputError, "horizon: expected a finite number, at least 0, got 'soon'"),
        ({"shape_a": FLOOR, "shape_b": FLOOR}, cm.UnsupportedError, "two HalfSpaces"),
        ({"motion_a": Pose()}, cm.PoseError, "motion A: expected a Motion or a Trajectory, got Pose"),
        ({"shape_b": 7}, cm.ShapeError, "shape B"),
        ({"shape_b": cm.Circle(1)}, cm.UnsupportedError, "meet each other only"),
        (
            {"shape_a": cm.HalfSpace((0, 0, 1)), "motion_a": Motion(Pose(), (0, 0, 0), (1, 0, 0))},
            cm.UnsupportedError,
            "turn",
        ),
    ],
    ids=lambda value: "",
)
def test_what_is_refused(change, error, words):
    arguments = {"shape_a": BOX, "motion_a": still(0, 0, 0), "shape_b": BOX, "motion_b": still(3, 0, 0)} | change
    with pytest.raises(error, match=words):
        time_of_impact(**arguments)


def test_impacts_of_a_soup_do_not_read_all_of_its_faces_again(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    corners = 0.4 * rng.normal(size=(200, 1, 3)) + 0.05 * rng.normal(size=(200, 3, 3))
    soup = cm.Mesh(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    towards = Motion(Pose((3, 0, 0)), (-2, 0, 0), (0, 0, 0.5))
    expected = time_of_impact(soup, still(0, 0, 0), soup, towards)
    assert expected.status == "hit"

    def refused(shape: cm.Mesh) -> None:
        raise AssertionError("all faces are read")

    monkeypatch.setattr("collision_monitor.shapes.kinds.mesh._used", refused)
    again = time_of_impact(soup, still(0, 0, 0), soup, towards)
    assert (again.lower, again.upper) == (expected.lower, expected.upper)
