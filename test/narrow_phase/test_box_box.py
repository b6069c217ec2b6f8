"""Boxes against every face of their Minkowski difference, and cases that break SAT."""

from __future__ import annotations

import numpy as np
import pytest
from minkowski import polytope_signed_distance, rotation
from pairs import EYE, contact, points_of, projected_gap

from collision_monitor.shapes.registry import Box

VERTEX, EDGE, FACE = 1, 2, 3


def on_surface(box, R, centre, point) -> bool:
    """Whether a point is on the box's surface to 1e-9 of its size."""
    local = R.T @ (point - centre)
    half = np.array(box.size) / 2
    tolerance = 1e-9 * half.max() * 4
    return bool((np.abs(local) <= half + tolerance).all() and (np.abs(np.abs(local) - half) <= tolerance).any())


@pytest.mark.parametrize("aside", [1e-3, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7, 1e-8])
@pytest.mark.parametrize("gap", [1.0, 1e-3])
def test_corners_nearly_across_a_face(gap, aside):
    """Two corners are nearest, although the gap across a face is the same to nine digits."""
    cube = Box((1, 1, 1))
    c = contact(cube, cube, (1 + aside, 1 + aside / 2, 1 + gap))
    expected = np.hypot(gap, np.hypot(aside, aside / 2))
    assert abs(c.distance - expected) <= c.bound
    np.testing.assert_allclose(c.point_a, (0.5, 0.5, 0.5), atol=1e-9)
    np.testing.assert_allclose(c.point_b, (0.5 + aside, 0.5 + aside / 2, 0.5 + gap), atol=1e-9)


@pytest.mark.parametrize("spread", [0.2, 0.6, 1.0, 2.0])
def test_random_pairs_against_the_minkowski_difference(spread):
    rng = np.random.default_rng(int(spread * 10))
    for _ in range(60):
        a, b = Box(rng.uniform(0.1, 1.2, 3)), Box(rng.uniform(0.1, 1.2, 3))
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * spread
        c = contact(a, b, p, R_A, R_B)
        expected = polytope_signed_distance(points_of(a) @ R_A.T, points_of(b) @ R_B.T + p)
        assert abs(c.distance - expected) <= 1e-13
        assert abs(projected_gap(a, b, p, R_A, R_B, c.normal) - c.distance) <= 1e-12
        assert abs(projected_gap(a, b, p, R_A, R_B, c.gap_direction) - c.gap) <= 1e-12
        assert on_surface(a, R_A, 0, c.point_a)
        assert on_surface(b, R_B, p, c.point_b)


def test_sat_gap_is_the_depth_or_a_bound_of_the_distance():
    rng = np.random.default_rng(5)
    exact = 0
    for _ in range(300):
        a, b = Box(rng.uniform(0.1, 1.2, 3)), Box(rng.uniform(0.1, 1.2, 3))
        c = contact(a, b, rng.normal(size=3), rotation(rng), rotation(rng))
        if c.distance < 0:
            assert abs(c.gap - c.distance) <= 1e-9
        else:
            assert 0 < c.gap <= c.distance
            exact += c.distance - c.gap < 1e-9
    assert exact > 20, "vertex-face and edge-edge neighbours get their distance from SAT alone"


@pytest.mark.parametrize(
    ("p", "normal", "distance", "features"),
    [
        ((1, 0, 0), (1, 0, 0), 0.0, (FACE, 0, FACE, 1)),
        ((0, -0.9, 0), (0, -1, 0), -0.1, (FACE, 3, FACE, 2)),
        ((0, 0, 1.5), (0, 0, 1), 0.5, (FACE, 4, FACE, 5)),
        ((0, 0, 0), (1, 0, 0), -1.0, (FACE, 0, FACE, 1)),
    ],
)
def test_aligned_cubes(p, normal, distance, features):
    c = contact(Box((1, 1, 1)), Box((1, 1, 1)), p)
    assert c.distance == pytest.approx(distance, abs=1e-15)
    np.testing.assert_allclose(c.normal, normal, atol=1e-15)
    assert c.features == features


def test_witness_is_the_middle_of_the_shared_face():
    c = contact(Box((2, 2, 2)), Box((1, 1, 1)), (1.2, 0.9, 1.45))
    # face x = 1 of A and face x = 0.7 of B share y in 0.4 ... 1, z in 0.95 ... 1
    np.testing.assert_allclose(c.point_a[2], 0.975 if c.normal[0] else 1.0, atol=1e-12)
    c = contact(Box((2, 2, 2)), Box((1, 1, 1)), (1.45, 0.9, 0.0))
    np.testing.assert_allclose(c.point_a, (1, 0.7, 0), atol=1e-12)
    np.testing.assert_allclose(c.point_b, (0.95, 0.7, 0), atol=1e-12)


def test_edge_against_edge():
    s = np.sqrt(0.5)
    R_A = np.array([[s, -s, 0], [s, s, 0], [0, 0, 1]])  # an edge along z points to +x
    R_B = np.array([[s, 0, s], [0, 1, 0], [-s, 0, s]])  # an edge along y points to -x
    for gap in (-0.1, 0.0, 0.1):
        c = contact(Box((1, 1, 1)), Box((1, 1, 1)), (2 * s + gap, 0, 0), R_A, R_B)
        assert c.distance == pytest.approx(gap, abs=1e-14)
        np.testing.assert_allclose(c.normal, (1, 0, 0), atol=1e-14)
        np.testing.assert_allclose(c.point_a, (s, 0, 0), atol=1e-14)
        if gap <= 0:
            assert c.features[0] == EDGE
            assert c.features[2] == EDGE


def test_vertex_on_face():
    s = np.sqrt(0.5)
    Rz = np.array([[s, -s, 0], [s, s, 0], [0, 0, 1]])
    t, u = np.sqrt(2 / 3), np.sqrt(1 / 3)
    R = np.array([[t, 0, u], [0, 1, 0], [-u, 0, t]]) @ Rz
    tip = R @ [-0.5, -0.5, -0.5]
    down = -max(points_of(Box((1, 1, 1))) @ R.T @ [0, 0, -1])
    c = contact(Box((4, 4, 1)), Box((1, 1, 1)), (0.3, -0.2, 0.5 - down - 0.01), EYE, R)
    assert c.distance == pytest.approx(-0.01, abs=1e-14)
    np.testing.assert_allclose(c.normal, (0, 0, 1), atol=1e-14)
    assert c.features[:2] == (FACE, 4)
    assert c.features[2] == VERTEX
    assert tip is not None


@pytest.mark.parametrize("angle", [0.0, 1e-18, 1e-15, 1e-12, 1e-9, 2e-7, 1e-6, 2e-6, 1e-4])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_nearly_parallel_edges_invent_nothing(angle, axis):
    c, s = np.cos(angle), np.sin(angle)
    R = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    a, b = Box((1, 2, 3)), Box((3, 1, 2))
    p = np.array([1.7, 0.3, 0.2])
    answer = contact(a, b, p, np.eye(3), R)
    best = max(projected_gap(a, b, p, np.eye(3), R, n) for n in np.eye(3))
    assert answer.distance == pytest.approx(best, abs=1e-9 + 4 * angle**2 + 3 * angle)
    assert abs(projected_gap(a, b, p, np.eye(3), R, answer.normal) - answer.distance) < 1e-8


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e9])
def test_scale(scale):
    rng = np.random.default_rng(8)
    for _ in range(20):
        sa, sb, p = rng.uniform(0.1, 1.2, 3), rng.uniform(0.1, 1.2, 3), rng.normal(size=3) * 0.8
        R_A, R_B = rotation(rng), rotation(rng)
        one = contact(Box(sa), Box(sb), p, R_A, R_B)
        other = contact(Box(sa * scale), Box(sb * scale), p * scale, R_A, R_B)
        assert other.distance / scale == pytest.approx(one.distance, abs=1e-12)
        np.testing.assert_allclose(other.normal, one.normal, atol=1e-9)


def test_plates_and_needles():
    plate, needle = Box((1, 1, 0)), Box((0, 0, 1))
    c = contact(plate, needle, (0.1, 0.2, 0.75))
    assert c.distance == pytest.approx(0.25, abs=1e-12)
    c = contact(plate, needle, (0.1, 0.2, 0.3))
    assert c.distance == pytest.approx(-0.2, abs=1e-12)
    c = contact(plate, plate)
    assert c.distance == 0.0
    np.testing.assert_array_equal(np.abs(c.normal), (0, 0, 1))
    c = contact(plate, plate, (0.5, 0.5, 1e-3))
    assert c.distance == pytest.approx(1e-3, abs=1e-15)
    c = contact(needle, needle, (0, 0, 0.5), EYE, EYE)
    assert c.distance == pytest.approx(0.0, abs=1e-15)
    s = np.sqrt(0.5)
    c = contact(needle, needle, (0.2, 0, 0), EYE, np.array([[1, 0, 0], [0, s, -s], [0, s, s]]))
    assert c.distance == pytest.approx(0.2, abs=1e-12)


def test_margins_round_the_boxes():
    a = Box((1, 1, 1))
    for p in ((1.5, 0, 0), (1.5, 1.5, 0), (1.5, 1.4, 1.3), (0.8, 0, 0)):
        bare = contact(a, a, p)
        grown = contact(a, a, p, margins=(0.1, 0.05))
        assert grown.distance == pytest.approx(bare.distance - 0.15, abs=1e-12)
        np.testing.assert_allclose(grown.point_a, bare.point_a + 0.1 * bare.normal, atol=1e-12)
        np.testing.assert_allclose(grown.point_b, bare.point_b - 0.05 * bare.normal, atol=1e-12)
        assert grown.gap <= grown.distance
