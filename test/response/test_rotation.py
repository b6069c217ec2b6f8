"""Collision of two bodies that turn: conservation laws, closed forms, and bad input."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from collision_monitor.errors import InputError
from collision_monitor.response import RigidBody, collide, collide_rotating

seeds = st.integers(0, 2**32 - 1)
restitutions = st.floats(0, 1)
frictions = st.floats(0, 2)


def random_bodies(seed):
    rng = np.random.default_rng(seed)
    bodies = []
    for _ in range(2):
        spread = rng.normal(size=(3, 3))
        bodies.append(RigidBody(rng.uniform(0.1, 10), spread @ spread.T + 0.1 * np.eye(3), *rng.normal(size=(3, 3))))
    return *bodies, rng.normal(size=3), rng.normal(size=3)


def momentum(*bodies):
    return sum(b.mass * b.velocity for b in bodies)


def angular_momentum(*bodies):
    return sum(b.mass * np.cross(b.position, b.velocity) + b.inertia @ b.angular for b in bodies)


def energy(*bodies):
    return sum(0.5 * b.mass * b.velocity @ b.velocity + 0.5 * b.angular @ b.inertia @ b.angular for b in bodies)


def closing(a, b, point, normal):
    slip = a.velocity + np.cross(a.angular, point - a.position) - b.velocity - np.cross(b.angular, point - b.position)
    return slip @ normal / np.linalg.norm(normal)


@given(seeds, restitutions, frictions)
def test_momentum_and_angular_momentum_are_conserved_and_energy_never_grows(seed, restitution, friction):
    a, b, point, normal = random_bodies(seed)
    after = collide_rotating(a, b, point, normal, restitution, friction)
    assert momentum(*after) == pytest.approx(momentum(a, b), abs=1e-9)
    assert angular_momentum(*after) == pytest.approx(angular_momentum(a, b), abs=1e-8)
    assert energy(*after) <= energy(a, b) * (1 + 1e-9)


@given(seeds, restitutions)
def test_without_friction_restitution_is_the_ratio_of_speeds(seed, restitution):
    a, b, point, normal = random_bodies(seed)
    before = closing(a, b, point, normal)
    assume(before > 1e-6)
    after = collide_rotating(a, b, point, normal, restitution)
    assert closing(*after, point, normal) == pytest.approx(-restitution * before, rel=1e-7, abs=1e-9)
    if restitution == 1.0:
        assert energy(*after) == pytest.approx(energy(a, b))


@given(seeds, restitutions, frictions)
def test_swapping_the_bodies_swaps_the_answer(seed, restitution, friction):
    a, b, point, normal = random_bodies(seed)
    first = collide_rotating(a, b, point, normal, restitution, friction)
    second = collide_rotating(b, a, point, -normal, restitution, friction)[::-1]
    for one, other in zip(first, second, strict=True):
        assert one.velocity == pytest.approx(other.velocity, abs=1e-9)
        assert one.angular == pytest.approx(other.angular, abs=1e-9)


def test_a_hit_through_both_centres_is_a_collision_without_rotation():
    a = RigidBody(2.0, np.eye(3), (0, 0, 0.0), (1.0, 0, 0))
    b = RigidBody(3.0, np.eye(3), (2.0, 0, 0), (-1.0, 0, 0))
    after = collide_rotating(a, b, (1.0, 0, 0), (1.0, 0, 0), 0.5)
    expected = collide((1.0, 0, 0), (-1.0, 0, 0), (1.0, 0, 0), 2.0, 3.0, 0.5)
    for body, velocity in zip(after, expected, strict=True):
        assert body.velocity == pytest.approx(velocity)
        assert not np.any(body.angular)


def test_a_ball_that_falls_at_a_slant_on_rough_ground_rolls_off():
    """A ball that grips ends with v = 5/7 of its speed, and turns at v / r (Garwin, 1969, for no tangential bounce)."""
    radius, mass = 0.1, 1.5
    ball = RigidBody(mass, 0.4 * mass * radius**2 * np.eye(3), (0, 0, radius), (7.0, 0, -3.0))
    ground = RigidBody(np.inf, np.eye(3), (0, 0, 0.0), (0, 0, 0.0))
    found, still = collide_rotating(ball, ground, (0, 0, 0.0), (0, 0, -1.0), 0.5, 10.0)
    assert found.velocity == pytest.approx([5.0, 0, 1.5])
    assert found.angular == pytest.approx([0, 5.0 / radius, 0])
    assert not np.any(still.velocity)


def test_a_ball_that_slides_loses_friction_times_the_normal_impulse():
    ball = RigidBody(1.0, 0.004 * np.eye(3), (0, 0, 0.1), (7.0, 0, -3.0))
    ground = RigidBody(np.inf, np.eye(3), (0, 0, 0.0), (0, 0, 0.0))
    found, _ = collide_rotating(ball, ground, (0, 0, 0.0), (0, 0, -1.0), 0.5, 0.1)
    assert found.velocity == pytest.approx([7.0 - 0.1 * 4.5, 0, 1.5])
    assert found.angular == pytest.approx([0, 0.1 * 0.1 * 4.5 / 0.004, 0])


def test_a_batch_equals_one_after_the_other():
    cases = [random_bodies(seed) for seed in range(50)]
    stacked = [RigidBody(*(np.array([case[k][f] for case in cases]) for f in range(5))) for k in range(2)]
    points, normals = (np.array([case[k] for case in cases]) for k in (2, 3))
    batch = collide_rotating(*stacked, points, normals, 0.3, 0.4)
    for k, case in enumerate(cases):
        for one, many in zip(collide_rotating(*case, 0.3, 0.4), batch, strict=True):
            assert many.velocity[k] == pytest.approx(one.velocity, abs=1e-12)
            assert many.angular[k] == pytest.approx(one.angular, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"mass": 0.0}, "mass A"),
        ({"inertia": np.zeros((3, 3))}, "inertia A: expected a positive definite"),
        ({"inertia": np.eye(2)}, "inertia A: expected shape"),
        ({"velocity": (np.inf, 0, 0)}, "velocity A"),
        ({"velocity": (0, 0)}, "space|broadcast"),
    ],
)
def test_impossible_bodies_are_refused(change, text):
    a, b, point, normal = random_bodies(1)
    with pytest.raises(InputError, match=text):
        collide_rotating(a._replace(**change), b, point, normal)
    with pytest.raises(InputError, match="friction"):
        collide_rotating(a, b, point, normal, 1.0, -0.1)
