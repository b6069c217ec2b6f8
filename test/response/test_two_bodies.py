"""Response of one body or two without rotation, against the lecture's examples and the conservation laws."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from collision_monitor.errors import InputError
from collision_monitor.response import (
    average,
    clamp,
    collide,
    damping_for,
    last_free,
    penalty_force,
    reflect,
    spring_stiffness,
    stick,
    swap,
)

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


@given(vectors, vectors, normals, masses)
def test_equal_masses_that_stick_take_the_average(va, vb, normal, mass):
    assume((va - vb) @ normal > 0)
    a, b = average(va, vb, normal)
    assert a == pytest.approx(stick(va, vb, mass, mass), abs=1e-12)
    assert a.tolist() == b.tolist()


@given(st.floats(-9, 9), st.floats(-9, 9), normals)
def test_equal_masses_that_meet_head_on_swap(along_a, along_b, normal):
    unit = normal / np.linalg.norm(normal)
    expected = collide(along_a * unit, along_b * unit, normal, 2.0, 2.0)
    for found, wanted in zip(swap(along_a * unit, along_b * unit, normal), expected, strict=True):
        assert found == pytest.approx(wanted, abs=1e-12)


@given(vectors, vectors, normals)
def test_parting_bodies_neither_swap_nor_take_the_average(va, vb, normal):
    assume((va - vb) @ normal <= 0)
    for response in (average, swap):
        assert [v.tolist() for v in response(va, vb, normal)] == [va.tolist(), vb.tolist()]


@given(vectors, vectors, normals, masses, restitutions)
def test_an_infinite_mass_is_a_wall(va, vb, normal, mass, restitution):
    a, b = collide(va, vb, normal, mass, np.inf, restitution)
    assert b.tolist() == vb.tolist()
    assert a - vb == pytest.approx(reflect(va - vb, -normal, restitution), abs=1e-9)
    assert stick(va, vb, mass, np.inf).tolist() == vb.tolist()


def test_two_immovable_bodies_keep_their_velocities_and_never_stick():
    a, b = collide((1.0, 0), (-1.0, 0), (1, 0), np.inf, np.inf)
    assert (a.tolist(), b.tolist()) == ([1.0, 0], [-1.0, 0])
    with pytest.raises(InputError, match="two infinite masses"):
        stick((1.0, 0), (-1.0, 0), np.inf, np.inf)


@given(vectors, normals, st.floats(-5, 5), st.floats(0, 3))
def test_clamping_moves_onto_the_plane_along_its_normal(position, normal, offset, radius):
    unit = normal / np.linalg.norm(normal)
    placed = clamp(position, normal, offset, radius)
    assert placed @ unit >= offset + radius - 1e-9
    assert np.cross(placed - position, unit) == pytest.approx(np.zeros(3), abs=1e-9)
    if position @ unit > offset + radius:
        assert placed.tolist() == position.tolist()


def test_the_last_free_position_undoes_the_whole_step():
    moved = last_free([(0, 1.0), (0, 1.0)], [(2.0, -0.5), (2.0, 0.5)], (0, 1))
    assert moved.tolist() == [[0, 1.0], [2.0, 0.5]]


@pytest.mark.parametrize("restitution", [0.4, 0.7, 0.9, 1.0])
def test_a_damper_gives_about_the_restitution_and_a_spring_the_depth(restitution):
    mass, dt = 2.0, 1e-6
    stiffness = spring_stiffness(mass, 3.0, 0.01)
    damping = damping_for(restitution, stiffness, mass)
    depth, speed, deepest = 0.0, 3.0, 0.0
    while depth >= 0.0:
        force = penalty_force(depth, speed, (0.0, 1.0), stiffness, damping)[1] if depth > 0 else 0.0
        speed -= force / mass * dt
        depth += speed * dt
        deepest = max(deepest, depth)
    assert -speed / 3.0 == pytest.approx(restitution, abs=0.09)
    assert -speed / 3.0 >= restitution - 1e-3
    assert deepest == pytest.approx(0.01, rel=1e-3) if restitution == 1.0 else deepest < 0.01


BAD = [
    (lambda: reflect((1, 0), (0, 1), 1.2), "restitution: expected 0 .* to 1"),
    (lambda: reflect((1, 0), (0, 1), -0.1), "restitution"),
    (lambda: reflect((1, 0), (0, 1), np.nan), "restitution"),
    (lambda: reflect((1, 0), (0, 0)), "zero vector"),
    (lambda: reflect((1, np.nan), (0, 1)), "velocity"),
    (lambda: reflect((1, 0, 0), (0, 1)), "broadcast"),
    (lambda: collide((1, 0), (0, 0), (1, 0), 0.0, 1.0), "mass A: expected positive"),
    (lambda: collide((1, 0), (0, 0), (1, 0), 1.0, -2.0), "mass B: expected positive"),
    (lambda: collide((1, 0), (0, 0), (1, 0), 1.0, np.nan), "mass B"),
    (lambda: collide((1, 0), (0, 0), (1, 0), 1.0, 1.0, 2.0), "restitution"),
    (lambda: stick((1, 0), (0, 0), 1.0, 0.0), "mass B"),
    (lambda: clamp((1, 0), (1, 0), radius=-1.0), "radius"),
    (lambda: penalty_force(0.1, 0.0, (0, 1), -5.0), "stiffness"),
    (lambda: damping_for(0.0, 1.0, 1.0), "no finite damping"),
    (lambda: spring_stiffness(np.inf, 1.0, 0.1), "finite mass"),
]


@pytest.mark.parametrize(("call", "text"), BAD)
def test_impossible_inputs_are_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()


@given(st.floats(-150, 150), st.floats(-150, 150))
def test_masses_of_any_size_work(exponent_a, exponent_b):
    a, b = collide((1.0, 0), (0.0, 0), (1.0, 0), 10.0**exponent_a, 10.0**exponent_b, 0.5)
    assert b[0] - a[0] == pytest.approx(0.5)
