"""Spheres and capsules in closed form, against sampled or rational answers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from minkowski import rotation
from pairs import EYE, contact

from collision_monitor.shapes.registry import Box, Capsule, HalfSpace, Sphere


def test_spheres_against_rational_arithmetic():
    rng = np.random.default_rng(1)
    for exponent in range(-9, 10, 3):
        scale = 10.0**exponent
        for _ in range(10):
            p, ra, rb = rng.normal(size=3) * scale, *(rng.uniform(0.1, 1, 2) * scale)
            c = contact(Sphere(ra), Sphere(rb), p)
            distance = Fraction(c.distance) + Fraction(ra) + Fraction(rb)
            squared = sum(Fraction(x) ** 2 for x in p)
            # |sqrt(squared) - distance| ~ |squared - distance^2| / (2 distance)
            assert abs(squared - distance**2) / (2 * distance) < Fraction(scale) * Fraction(1e-15) * 4
            assert float(abs(squared - distance**2) / (2 * distance)) <= c.bound


@pytest.mark.parametrize("p", [(1, 0, 0), (0, 3, 4), (-2, 1, 2)])
def test_spheres_touch_exactly(p):
    d = np.linalg.norm(p)
    c = contact(Sphere(d / 4), Sphere(3 * d / 4), p)
    assert c.distance == 0.0
    np.testing.assert_allclose(c.normal, np.array(p) / d, atol=1e-16)


@pytest.mark.parametrize("tiny", [0.0, 1e-300, 1e-170, 1e-20])
def test_concentric(tiny):
    p = (0, 0, tiny)
    assert contact(Sphere(1), Sphere(2), p).distance == -3
    assert contact(Sphere(1), Box((2, 4, 6)), p).distance == pytest.approx(-2, abs=1e-15)
    assert contact(Sphere(1), Capsule(0.5, 2), p).distance == pytest.approx(-1.5, abs=1e-15)
    assert contact(Capsule(1, 3), Capsule(0.5, 2), p).distance == pytest.approx(-1.5, abs=1e-15)


def test_sphere_in_and_out_of_a_box():
    box, sphere = Box((2, 4, 6)), Sphere(0.5)
    out = contact(box, sphere, (2, 0, 0))
    assert out.distance == 0.5
    np.testing.assert_array_equal(out.normal, (1, 0, 0))
    assert out.features == (3, 0, 4, 0)
    corner = contact(box, sphere, (1 + 2, 2 + 3, 3 + 6))
    assert corner.distance == 6.5
    assert corner.features == (1, 7, 4, 0)
    edge = contact(box, sphere, (1 + 3, 2 + 4, 0))
    assert edge.distance == 4.5
    assert edge.features[0] == 2
    inside = contact(box, sphere, (0.2, -1.5, 0))
    assert inside.distance == -1.0
    np.testing.assert_array_equal(inside.normal, (0, -1, 0))
    np.testing.assert_allclose(inside.point_a, (0.2, -2, 0))
    assert contact(box, sphere, (1, 0, 0)).distance == -0.5


def test_sphere_and_box_against_the_definition():
    rng = np.random.default_rng(2)
    for _ in range(300):
        half, R, p, r = rng.uniform(0.1, 1, 3), rotation(rng), rng.normal(size=3), rng.uniform(0.1, 1)
        q = R.T @ -p
        excess = np.abs(q) - half
        expected = np.linalg.norm(np.maximum(excess, 0)) + min(excess.max(), 0) - r
        c = contact(Sphere(r), Box(2 * half), p, EYE, R)
        assert c.distance == pytest.approx(expected, abs=1e-14)
        assert np.linalg.norm(c.point_a) == pytest.approx(r)
        local = np.abs(R.T @ (c.point_b - p))
        assert (local <= half + 1e-12).all()
        assert np.abs(local - half).min() < 1e-12


def test_capsules_against_a_dense_search():
    rng = np.random.default_rng(3)
    s = np.linspace(-1, 1, 801)
    for _ in range(60):
        la, lb, ra, rb = rng.uniform(0.2, 1, 4)
        R_A, R_B, p = rotation(rng), rotation(rng), rng.normal(size=3) * 0.8
        along = p + np.outer(s, R_B[:, 2] * lb)
        t = np.clip(along @ R_A[:, 2] / la, -1, 1)
        sampled = np.linalg.norm(along - np.outer(t, R_A[:, 2] * la), axis=1).min()
        c = contact(Capsule(ra, 2 * la), Capsule(rb, 2 * lb), p, R_A, R_B)
        assert sampled - 1e-2 * lb**2 <= c.distance + ra + rb <= sampled + 1e-15
        c = contact(Sphere(ra), Capsule(rb, 2 * lb), p, R_A, R_B)
        assert c.distance + ra + rb == pytest.approx(np.linalg.norm(along, axis=1).min(), abs=1e-2)
        assert c.distance + ra + rb <= np.linalg.norm(along, axis=1).min() + 1e-15


@pytest.mark.parametrize("angle", [0.0, 1e-16, 1e-13, 1e-11, 1e-10, 1e-8, 1e-6, 1e-3])
def test_nearly_parallel_capsules(angle):
    R = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    c = contact(Capsule(0.1, 2), Capsule(0.1, 2), (0.5, 0, 0.25), EYE, R)
    assert c.distance == pytest.approx(0.3, abs=1e-15)
    c = contact(Capsule(0.1, 2), Capsule(0.1, 2), (0, 0.5, 0), EYE, R)
    assert c.distance == pytest.approx(0.3 - np.sin(angle), abs=2e-10 + angle**2)


def test_crossing_cores_part_across_both():
    Rx = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])  # core along x
    for shift in (0.0, 1e-17, 1e-12, 1e-3):
        c = contact(Capsule(0.1, 2), Capsule(0.2, 2), (0.1, shift, 0.3), EYE, Rx)
        assert c.distance == pytest.approx(shift - 0.3, abs=1e-15)
        np.testing.assert_allclose(c.normal, (0, 1, 0), atol=1e-14) if shift else None
    along = contact(Capsule(0.1, 2), Capsule(0.2, 2), (0, 0, 1))
    assert along.distance == pytest.approx(-0.3)
    assert abs(along.normal[2]) < 1e-15


@pytest.mark.parametrize("other", [Sphere(1), Box((2, 2, 2)), Capsule(0.5, 1)])
def test_half_space(other):
    floor = HalfSpace((0, 0, 2), 1.0)  # z <= 0.5
    c = contact(other, floor, (0, 0, -1.75))
    assert c.distance == pytest.approx(0.25)
    np.testing.assert_array_equal(c.normal, (0, 0, -1))
    assert contact(other, floor, (0, 0, 99.0)).distance == pytest.approx(-100.5)
    swapped = contact(floor, other, (0, 0, 1.75))
    assert swapped.distance == pytest.approx(0.25)
    np.testing.assert_array_equal(swapped.normal, (0, 0, 1))
