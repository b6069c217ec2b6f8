"""Tests of the collision response against the lecture's examples and the conservation laws."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from collision_monitor.world.collision_response import bounce_between_walls, collide, penalty_force, reflect, stick

vectors = arrays(np.float64, 3, elements=st.floats(-100, 100))
normals = vectors.filter(lambda n: np.linalg.norm(n) > 1e-3)
masses = st.floats(1e-2, 1e3)
restitutions = st.floats(0, 1)


def energy(mass, velocity):
    return 0.5 * mass * (velocity @ velocity)


def test_the_slides_vertical_wall():
    assert reflect((3.0, -3.0), (-1.0, 0.0)).tolist() == [-3.0, -3.0]


def test_the_slides_horizontal_wall():
    assert reflect((3.0, -3.0), (0.0, 1.0)).tolist() == [3.0, 3.0]


def test_a_wall_at_45_degrees_swaps_the_components():
    assert reflect((2.0, 0.0), (-1.0, 1.0)) == pytest.approx([0.0, 2.0])


def test_a_body_that_leaves_the_wall_keeps_its_velocity():
    assert reflect((3.0, 1.0), (1.0, 0.0)).tolist() == [3.0, 1.0]


def test_a_damped_bounce_keeps_the_damping_factor_of_the_normal_speed():
    assert reflect((1.0, -2.0), (0.0, 1.0), 0.8) == pytest.approx([1.0, 1.6])


@given(vectors, normals)
def test_reflection_keeps_the_speed_and_leaves_the_wall(velocity, normal):
    after = reflect(velocity, normal)
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(velocity), rel=1e-12, abs=1e-12)
    assert after @ normal >= -1e-9 * np.linalg.norm(normal) * np.linalg.norm(velocity)


@given(vectors, normals, restitutions)
def test_a_reflection_in_a_batch_equals_one_alone(velocity, normal, restitution):
    batch = reflect(np.stack([velocity, -velocity]), np.stack([normal, normal]), np.full(2, restitution))
    assert batch[0] == pytest.approx(reflect(velocity, normal, restitution))
    assert batch[1] == pytest.approx(reflect(-velocity, normal, restitution))


def test_equal_masses_head_on_swap_their_velocities():
    a, b = collide((2.0, 0, 0), (-1.0, 0, 0), (1.0, 0, 0), 3.0, 3.0)
    assert a.tolist() == [-1.0, 0, 0]
    assert b.tolist() == [2.0, 0, 0]


def test_a_light_ball_bounces_off_a_heavy_one():
    a, b = collide((1.0, 0, 0), (0, 0, 0), (1.0, 0, 0), 1.0, 3.0)
    assert a == pytest.approx([-0.5, 0, 0])
    assert b == pytest.approx([0.5, 0, 0])


@given(vectors, vectors, normals, masses, masses, restitutions)
def test_a_collision_conserves_momentum(va, vb, normal, ma, mb, restitution):
    a, b = collide(va, vb, normal, ma, mb, restitution)
    before, after = ma * va + mb * vb, ma * a + mb * b
    assert after == pytest.approx(before, abs=1e-9 * (ma + mb) * 200)


@given(vectors, vectors, normals, masses, masses)
def test_an_elastic_collision_conserves_energy(va, vb, normal, ma, mb):
    a, b = collide(va, vb, normal, ma, mb)
    before = energy(ma, va) + energy(mb, vb)
    assert energy(ma, a) + energy(mb, b) == pytest.approx(before, rel=1e-9, abs=1e-9)


@given(vectors, vectors, normals, masses, masses, restitutions)
def test_restitution_is_the_ratio_of_separating_to_closing_speed(va, vb, normal, ma, mb, restitution):
    unit = normal / np.linalg.norm(normal)
    closing = (va - vb) @ unit
    assume(closing > 1e-6)
    a, b = collide(va, vb, normal, ma, mb, restitution)
    assert (b - a) @ unit == pytest.approx(restitution * closing, rel=1e-9, abs=1e-8)


@given(vectors, vectors, normals, masses, masses, restitutions)
def test_restitution_never_adds_energy(va, vb, normal, ma, mb, restitution):
    a, b = collide(va, vb, normal, ma, mb, restitution)
    before = energy(ma, va) + energy(mb, vb)
    assert energy(ma, a) + energy(mb, b) <= before * (1 + 1e-9) + 1e-9


@given(vectors, vectors, normals, masses, masses)
def test_restitution_zero_sticks_along_the_normal(va, vb, normal, ma, mb):
    unit = normal / np.linalg.norm(normal)
    assume((va - vb) @ unit > 0)
    a, b = collide(va, vb, normal, ma, mb, 0.0)
    assert a @ unit == pytest.approx(b @ unit, abs=1e-9)


@given(vectors, vectors, normals, masses, masses)
def test_parting_bodies_are_left_alone(va, vb, normal, ma, mb):
    assume((va - vb) @ normal <= 0)
    a, b = collide(va, vb, normal, ma, mb)
    assert a.tolist() == va.tolist()
    assert b.tolist() == vb.tolist()


@given(vectors, vectors, masses, masses)
def test_sticking_conserves_momentum_and_loses_energy(va, vb, ma, mb):
    common = stick(va, vb, ma, mb)
    assert (ma + mb) * common == pytest.approx(ma * va + mb * vb, abs=1e-8 * (ma + mb))
    before = energy(ma, va) + energy(mb, vb)
    assert energy(ma + mb, common) <= before * (1 + 1e-9) + 1e-9


def test_the_penalty_force_is_a_spring_and_a_damper_that_only_push():
    force = penalty_force([0.1, 0.1, 0.1, -0.1], [0.0, 2.0, -200.0, 5.0], (0, 0, 2.0), 100.0, 3.0)
    assert force[:, 2] == pytest.approx([10.0, 16.0, 0.0, 0.0])
    assert not force[:, :2].any()


def test_a_ball_on_an_undamped_spring_comes_back_with_its_speed():
    mass, stiffness, dt = 2.0, 5e3, 1e-5
    height, speed = 0.1, -1.0
    while height <= 0.1:
        force = penalty_force(0.1 - height, -speed, (0.0, 1.0), stiffness)[1]
        speed += force / mass * dt
        height += speed * dt
    assert speed == pytest.approx(1.0, abs=1e-3)


@given(st.floats(0, 1), st.floats(-50, 50), st.floats(1e-3, 1.0))
def test_bounces_between_walls_equal_flying_from_wall_to_wall(start, speed, dt):
    """Reference: fly to the next wall, turn back, repeat."""
    position, velocity, left = start, speed, dt
    while velocity != 0.0:
        wall = 1.0 if velocity > 0.0 else 0.0
        until = (wall - position) / velocity
        if until >= left:
            break
        position, velocity, left = wall, -velocity, left - until
    position += velocity * left
    at, moving = bounce_between_walls(np.array([start]), np.array([speed]), np.zeros(1), np.ones(1), dt)
    assert at[0] == pytest.approx(position, abs=1e-9)
    if 1e-9 < position < 1 - 1e-9:
        assert moving[0] == velocity


def test_an_inelastic_bounce_happens_at_its_time():
    """0.5 m at 2 m/s take 0.25 s; the other 0.25 s go back at half the speed."""
    at, moving = bounce_between_walls(np.array([0.5]), np.array([2.0]), np.zeros(1), np.ones(1), 0.5, 0.5)
    assert at[0] == pytest.approx(0.75)
    assert moving[0] == -1.0


def test_several_inelastic_bounces_happen_in_one_step():
    at, moving = bounce_between_walls(np.array([0.5]), np.array([10.0]), np.zeros(1), np.ones(1), 1.0, 0.5)
    assert (at[0], moving[0]) == pytest.approx((0.5625, -1.25))


@given(st.floats(0, 1), st.floats(-50, 50), st.floats(1e-3, 1.0), st.floats(0.05, 0.99))
def test_inelastic_bounces_equal_flying_from_wall_to_wall(start, speed, dt, restitution):
    """Reference: fly to the next wall, turn back more slowly, repeat."""
    position, velocity, left = start, speed, dt
    while velocity != 0.0:
        wall = 1.0 if velocity > 0.0 else 0.0
        until = (wall - position) / velocity
        if until >= left:
            break
        position, velocity, left = wall, -restitution * velocity, left - until
    position += velocity * left
    at, moving = bounce_between_walls(np.array([start]), np.array([speed]), np.zeros(1), np.ones(1), dt, restitution)
    assert at[0] == pytest.approx(position, abs=1e-9)
    if 1e-9 < position < 1 - 1e-9:
        assert moving[0] == pytest.approx(velocity, rel=1e-9)


def test_a_body_without_restitution_stays_at_the_wall():
    at, moving = bounce_between_walls(np.array([0.5, 0.5]), np.array([2.0, 0.0]), np.zeros(2), np.ones(2), 1.0, 0.0)
    assert at.tolist() == [1.0, 0.5]
    assert not moving.any()
