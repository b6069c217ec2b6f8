"""Invariants of every pair of kinds: swap symmetry, common motion, agreement with FCL, order of the pairs."""

from __future__ import annotations

from itertools import combinations_with_replacement

import fcl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from minkowski import rotation
from pairs import contact

from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.registry import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, HalfSpace, Sphere
from collision_monitor.shapes.shape_table import ShapeTableBuilder

ROCK = ConvexHull(np.random.default_rng(3).normal(size=(32, 3)) * 0.4)
EGG = Ellipsoid((0.3, 0.5, 0.7))
KINDS = [Sphere(0.4), Box((0.7, 0.9, 0.5)), Capsule(0.3, 0.8), Cylinder(0.4, 0.7), Cone(0.5, 0.9), ROCK, EGG]
PAIRS = list(combinations_with_replacement(KINDS, 2))
CURVED = (Cylinder, Cone, Ellipsoid)


def name(value):
    return type(value).__name__


def tolerance(*pair):
    return 4e-6 if any(isinstance(s, CURVED) for s in pair) else 1e-11


@pytest.mark.parametrize(("a", "b"), PAIRS + [(k, HalfSpace((1, 2, 3), 0.1)) for k in KINDS], ids=name)
def test_swapping_mirrors_the_answer(a, b):
    rng = np.random.default_rng(4)
    for _ in range(15):
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.7
        c = contact(a, b, p, R_A, R_B)
        s = contact(a, b, p, R_A, R_B, swap=True)
        assert s.distance == c.distance
        assert s.gap == c.gap
        np.testing.assert_array_equal(s.normal, -c.normal)
        np.testing.assert_array_equal(s.gap_direction, -c.gap_direction)
        np.testing.assert_allclose(s.point_a, c.point_b - p, rtol=0, atol=1e-15)
        np.testing.assert_allclose(s.point_b, c.point_a - p, rtol=0, atol=1e-15)
        assert s.features == c.features[2:] + c.features[:2]
        other = contact(b, a, -p, R_B, R_A)
        assert other.distance == pytest.approx(c.distance, abs=2 * tolerance(a, b))


@pytest.mark.parametrize(("a", "b"), PAIRS, ids=name)
def test_common_motion_changes_nothing(a, b):
    rng = np.random.default_rng(5)
    for _ in range(10):
        R_A, R_B, p, R = rotation(rng), rotation(rng), rng.normal(size=3) * 0.7, rotation(rng)
        c = contact(a, b, p, R_A, R_B)
        m = contact(a, b, R @ p, R @ R_A, R @ R_B)
        assert m.distance == pytest.approx(c.distance, abs=tolerance(a, b))
        far = contact(a, b, p, R_A, R_B, origin=(2.0**20, -(2.0**20), 0))
        assert far.distance == pytest.approx(c.distance, abs=1e-9 + tolerance(a, b))


def scaled(shape, s):
    match shape:
        case Sphere():
            return Sphere(s * shape.radius)
        case Box():
            return Box(s * np.array(shape.size))
        case ConvexHull():
            return ConvexHull(s * shape.points)
        case HalfSpace():
            return HalfSpace(shape.normal, s * shape.offset)
        case Ellipsoid():
            return Ellipsoid(s * np.array(shape.radii))
    return type(shape)(s * shape.radius, s * shape.length)


@pytest.mark.parametrize(("a", "b"), PAIRS + [(k, HalfSpace((1, 2, 3), 0.1)) for k in KINDS], ids=name)
def test_scaling_scales_the_answer(a, b):
    """From nanometres to a million kilometres; scaling by powers of two changes only round-off."""
    rng = np.random.default_rng(7)
    for s in (1e-9, 2.0**-20, 1e-3, 1e9):
        for _ in range(4):
            R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.7
            c, large = contact(a, b, p, R_A, R_B), contact(scaled(a, s), scaled(b, s), s * p, R_A, R_B)
            assert large.distance / s == pytest.approx(c.distance, abs=tolerance(a, b))
            assert large.bound / s == pytest.approx(c.bound, abs=tolerance(a, b))


def mirrored(shape, flip):
    """Mirror image of a shape; round shapes and boxes are their own image in a mirror through their axis."""
    return ConvexHull(shape.points * flip) if isinstance(shape, ConvexHull) else shape


@pytest.mark.parametrize(("a", "b"), PAIRS, ids=name)
@pytest.mark.parametrize("flip", [(-1, 1, 1), (1, -1, 1)])
def test_a_mirror_mirrors_the_answer(a, b, flip):
    rng, flip = np.random.default_rng(8), np.array(flip, float)
    F = np.diag(flip)
    for _ in range(6):
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.9
        c = contact(a, b, p, R_A, R_B)
        m = contact(mirrored(a, flip), mirrored(b, flip), F @ p, F @ R_A @ F, F @ R_B @ F)
        assert m.distance == pytest.approx(c.distance, abs=tolerance(a, b))
        if c.distance > 1e-2:
            np.testing.assert_allclose(m.normal, F @ c.normal, atol=1e-6)


@pytest.mark.parametrize(("a", "b"), PAIRS, ids=name)
def test_moving_by_the_answer_makes_them_touch(a, b):
    """Translation by -distance along the normal brings any pair into contact, a check without an oracle."""
    rng = np.random.default_rng(6)
    for _ in range(10):
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.6
        c = contact(a, b, p, R_A, R_B)
        touching = contact(a, b, p - c.distance * c.normal, R_A, R_B)
        assert abs(touching.distance) <= 2 * tolerance(a, b)


def fcl_object(shape, R, p):
    transform = fcl.Transform(R, p)
    match shape:
        case Sphere():
            geometry = fcl.Sphere(shape.radius)
        case Box():
            geometry = fcl.Box(*shape.size)
        case Capsule():
            geometry = fcl.Capsule(shape.radius, shape.length)
        case Cylinder():
            geometry = fcl.Cylinder(shape.radius, shape.length)
        case Cone():
            geometry = fcl.Cone(shape.radius, shape.length)
        case Ellipsoid():
            geometry = fcl.Ellipsoid(*shape.radii)
    return fcl.CollisionObject(geometry, transform)


@pytest.mark.parametrize(("a", "b"), [q for q in PAIRS if ROCK not in q], ids=name)
def test_fcl_agrees_on_distances(a, b):
    """Only for pairs that are well apart and near the origin; FCL is not accurate enough elsewhere."""
    rng = np.random.default_rng(7)
    checked = 0
    for _ in range(40):
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 1.5
        c = contact(a, b, p, R_A, R_B)
        if c.distance < 0.05:
            continue
        result = fcl.DistanceResult()
        expected = fcl.distance(fcl_object(a, R_A, np.zeros(3)), fcl_object(b, R_B, p), fcl.DistanceRequest(), result)
        assert c.distance == pytest.approx(expected, abs=2e-4)
        checked += 1
    assert checked > 10


number = st.floats(-2, 2).map(lambda x: round(x * 16) / 16)
awkward = st.sampled_from([0.0, 1e-300, 1e-16, 1e-12, 1e-8, -1e-9, 1e-5])
quarter_turns = st.lists(st.sampled_from("xyz"), max_size=4)
TURN = {
    "x": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]),
    "y": np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]]),
    "z": np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]),
}
solid = st.one_of(
    st.builds(Sphere, st.sampled_from([0.25, 1.0])),
    st.builds(Box, st.tuples(*[st.sampled_from([0.0, 0.5, 1.0])] * 2, st.just(1.0))),
    st.builds(Capsule, st.sampled_from([0.25, 0.5]), st.sampled_from([0.5, 1.0])),
    st.builds(Cylinder, st.sampled_from([0.25, 0.5]), st.sampled_from([0.5, 1.0])),
    st.builds(Cone, st.sampled_from([0.25, 0.5]), st.sampled_from([0.5, 1.0])),
    st.builds(Ellipsoid, st.tuples(*[st.sampled_from([0.25, 0.5, 1.0])] * 3)),
    st.sampled_from([ROCK, ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])]),
)


@settings(max_examples=300, deadline=None)
@given(solid, solid, st.tuples(number, number, number), st.tuples(awkward, awkward, awkward), quarter_turns, awkward)
def test_aligned_touching_and_nearly_so(a, b, p, nudge, turns, angle):
    """Grid positions and quarter turns, with tiny disturbances: parallel faces, shared edges, identical poses."""
    R = np.eye(3)
    for turn in turns:
        R = R @ TURN[turn]
    R = R @ np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    p = np.array(p) + nudge
    c = contact(a, b, p, np.eye(3), R)
    # EPA ends early where all directions of an ellipsoid tie
    loose = any(isinstance(shape, Ellipsoid) for shape in (a, b)) and c.distance < 0.0
    assert c.bound < (5e-3 if loose else 1e-4)
    touching = contact(a, b, p - c.distance * c.normal, np.eye(3), R)
    assert abs(touching.distance) <= (c.bound if loose else 0.0) + 1e-5


def test_the_order_of_the_pairs_does_not_change_a_byte():
    rng = np.random.default_rng(9)
    builder = ShapeTableBuilder()
    for k in range(60):
        builder.append(KINDS[k % len(KINDS)], margin=0.01 * (k % 3))
    position = rng.uniform(0, 2, (60, 3))
    rotations = np.stack([rotation(rng) for _ in range(60)])
    pairs = np.array([(i, j) for i in range(60) for j in range(i)], np.int32)
    one = contact_batch(builder.table, position, rotations, pairs)
    again = contact_batch(builder.table, position, rotations, pairs[::-1].copy())
    assert again[::-1].tobytes() == one.tobytes()
