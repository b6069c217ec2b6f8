"""Bounds on the angle by which bodies have turned from their reference, against SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from collision_monitor._jit import kernel
from collision_monitor.motion.bodies import make_bodies
from collision_monitor.motion.turning import BLOCK, COLUMNS, turned_away

KERNEL = kernel(turned_away.py_func)


def bounds(reference: Rotation, spin: np.ndarray, seconds: np.ndarray, last: Rotation) -> np.ndarray:
    n = len(seconds)
    bodies = make_bodies(n)
    bodies.ref_quaternion[:], bodies.quaternion[:] = reference.as_quat(), last.as_quat()
    bodies.motion["time"], bodies.time[:] = 2.0, 2.0 + seconds
    for name, column in zip(("wx", "wy", "wz"), spin.T, strict=True):
        bodies.motion[name] = column
    angles = np.full(n, np.nan)
    for start in range(0, n, BLOCK):
        KERNEL(bodies, start, min(BLOCK, n - start), np.empty((COLUMNS, BLOCK)), angles[start:])
    return angles


@pytest.mark.parametrize("away", [0.0, 1e-9, 1e-4, 0.1, 1.0, 3.0])
def test_it_bounds_the_true_angle_and_is_close_to_it(away: float) -> None:
    rng = np.random.default_rng(3)
    n = 3 * BLOCK + 5
    spin = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-6, 3, (n, 1))
    spin[::7] = 0.0
    seconds = rng.uniform(0, 3, n)
    reference = Rotation.random(n, rng)
    there = Rotation.from_rotvec(spin * seconds[:, None]) * reference
    axes = rng.normal(size=(n, 3))
    last = Rotation.from_rotvec(away * axes / np.linalg.norm(axes, axis=1, keepdims=True)) * there
    got = bounds(reference, spin, (2.0 + seconds) - 2.0, last)
    rounding = 1e-14 * (1.0 + np.linalg.norm(spin, axis=1) * seconds)
    assert (got >= away - rounding).all()
    assert (got <= away * (1.0 + 0.03 * away**2) + 1e-11 * (1.0 + np.linalg.norm(spin, axis=1))).all()


def test_turned_too_far_to_tell_is_no_bound_but_infinite() -> None:
    spin = np.array([[0.0, 0.0, 3e6], [0.0, 0.0, np.inf], [0.0, 0.0, 1.0]])
    got = bounds(Rotation.identity(3), spin, np.ones(3), Rotation.identity(3))
    assert got[0] == got[1] == np.inf
    assert got[2] == pytest.approx(1.0, rel=0.05)
