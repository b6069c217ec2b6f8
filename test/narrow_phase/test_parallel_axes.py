"""Cones, cylinders, capsules and spheres that overlap with parallel axes: whole circles of directions tie."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from pairs import contact
from scipy.spatial.transform import Rotation

from collision_monitor.shapes.registry import Capsule, Cone, Cylinder, Sphere, TruncatedCone

SHAPES = (Cone(0.25, 0.5), Cone(0.5, 1.0), Capsule(0.25, 0.5), Sphere(0.3), Cylinder(0.25, 0.5), Cylinder(0.5, 1.0))
REVOLVED = (*SHAPES[:3], *SHAPES[4:], TruncatedCone(0.4, 0.2, 0.8))
UPRIGHT, UPSIDE_DOWN = np.eye(3), np.diag([1.0, -1.0, -1.0])


def reach(shape, d):
    """Support distances of a shape along unit directions d (N, 3), by its definition."""
    across, along = np.hypot(d[:, 0], d[:, 1]), d[:, 2]
    if isinstance(shape, Sphere):
        return np.full(len(d), shape.radius)
    half = 0.5 * shape.length
    if isinstance(shape, Capsule):
        return shape.radius + half * np.abs(along)
    if isinstance(shape, Cylinder):
        return shape.radius * across + half * np.abs(along)
    if isinstance(shape, TruncatedCone):
        return np.maximum(shape.bottom_radius * across - half * along, shape.top_radius * across + half * along)
    return np.maximum(shape.radius * across - half * along, half * along)


@pytest.mark.parametrize(("a", "b"), list(product(SHAPES, SHAPES)), ids=repr)
@pytest.mark.parametrize("R", [UPRIGHT, UPSIDE_DOWN], ids=["same way up", "upside down"])
def test_depth_is_the_least_over_all_directions(a, b, R):
    rng = np.random.default_rng(7)
    d = rng.normal(size=(5000, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    for p in (np.zeros(3), np.array([0.0, 0.0, 0.1]), np.array([0.05, 0.0, -0.1]), *rng.uniform(-0.3, 0.3, (5, 3))):
        c = contact(a, b, p, UPRIGHT, R)
        if c.distance > 0.0:
            continue
        assert c.bound < 1e-8
        assert np.all(reach(a, d) + reach(b, -d @ R) - d @ p >= -c.distance - 1e-9)
        n = np.asarray(c.normal)[None]
        assert (reach(a, n) + reach(b, -n @ R) - n @ p)[0] == pytest.approx(-c.distance, abs=1e-9)
        assert n[0] @ c.point_a == pytest.approx(reach(a, n)[0], abs=1e-9)
        assert n[0] @ (c.point_b - p) == pytest.approx(-reach(b, -n @ R)[0], abs=1e-9)


@pytest.mark.parametrize(("a", "b"), list(product(REVOLVED, REVOLVED)), ids=repr)
def test_axes_that_are_nearly_parallel_have_nearly_the_depth_of_parallel_ones(a, b):
    """A turn by an angle moves no point of B by more than the angle times its size, 1 m; EPA alone knew only mm."""
    rng = np.random.default_rng(8)
    for angle in 10.0 ** np.arange(-13.0, -3.0):
        p = np.array([0.0, 0.0, rng.uniform(-0.2, 0.2)]) if angle < 1e-6 else rng.uniform(-0.1, 0.1, 3)
        parallel = contact(a, b, p, UPRIGHT, UPRIGHT)
        turn = Rotation.from_rotvec(angle * np.array([0.6, 0.8, 0.0])).as_matrix()
        turned = contact(a, b, p, UPRIGHT, turn)
        assert turned.distance < 0.0
        assert abs(turned.distance - parallel.distance) <= angle + turned.bound + parallel.bound
        assert turned.bound < 4.0 * angle + 1e-9
        d = rng.normal(size=(2000, 3))
        d /= np.linalg.norm(d, axis=1)[:, None]
        least = (reach(a, d) + reach(b, -d @ turn) - d @ p).min()
        assert least >= -turned.distance - turned.bound
