"""Tests of the lecture's test of two particles against their motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from collision_monitor.errors import InputError
from collision_monitor.geometry.lecture.particle_particle import closest_approach, particle_particle


def test_both_pass_the_crossing_of_their_paths_at_one_time():
    meet = particle_particle([0, 0], [1, 1], [4, 0], [-1, 1], 1e-9, 1e-9)
    assert meet.collides and meet.alpha == meet.beta == 2
    late = particle_particle([0, 0], [1, 1], [4, 0], [-2, 2], 1e-9, 0.5)
    assert not late.collides and (late.alpha, late.beta) == (2, 1)
    assert particle_particle([0, 0], [1, 1], [4, 0], [-2, 2], 1e-9, 1.0).collides


def test_paths_behind_the_particles_do_not_count():
    assert not particle_particle([0, 0, 0], [-1, 0, 0], [1, 0, 0], [1, 0, 0], 0.5, 10.0).collides
    assert not particle_particle([1, 1], [1, 1], [-1, 1], [-1, 1], 0.5, 10.0).collides


def test_in_space_paths_only_come_near():
    a = particle_particle([0, 0, 0], [1, 0, 0], [2, -2, 0.1], [0, 1, 0], 0.2, 0.1)
    assert a.collides and abs(a.distance - 0.1) < 1e-15
    assert not particle_particle([0, 0, 0], [1, 0, 0], [2, -2, 0.1], [0, 1, 0], 0.05, 0.1).collides


@pytest.mark.parametrize("speeds", [(1, -1), (1, -3), (2, 0), (3, 1), (0, -1)])
def test_head_on_overtaking_and_at_rest_on_one_line(speeds):
    meet = particle_particle([0, 0, 0], [speeds[0], 0, 0], [8, 0, 0], [speeds[1], 0, 0], 1e-9, 1e-9)
    assert meet.collides
    assert meet.alpha == meet.beta == 8 / (speeds[0] - speeds[1])


def test_following_at_the_same_speed_never_meets():
    assert not particle_particle([0, 0, 0], [1, 0, 0], [8, 0, 0], [1, 0, 0], 0.1, 1.0).collides


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_what_meets_at_a_chosen_time_is_found(seed):
    rng = np.random.default_rng(seed)
    where, v_a, v_b = rng.normal(size=(3, 10, 3))
    when = rng.uniform(0.1, 5, size=(10, 1))
    p_a, p_b = where - when * v_a, where - when * v_b
    meet = particle_particle(p_a, v_a, p_b, v_b, 1e-9, 1e-6)
    assert meet.collides.all() and np.allclose(meet.alpha, when[:, 0], rtol=1e-8)
    time, distance = closest_approach(p_a, v_a, p_b, v_b)
    assert np.allclose(time, when[:, 0], rtol=1e-8) and distance.max() < 1e-8
    swapped = particle_particle(p_b, v_b, p_a, v_a, 1e-9, 1e-6)
    assert swapped.collides.all() and np.allclose(swapped.beta, meet.alpha, rtol=1e-8)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_the_closest_approach_beats_a_fine_sampling(seed):
    p_a, v_a, p_b, v_b = np.random.default_rng(seed).normal(size=(4, 3))
    time, distance = closest_approach(p_a, v_a, p_b, v_b)
    sampled = np.linalg.norm(p_a - p_b + np.linspace(0, 50, 5001)[:, None] * (v_a - v_b), axis=1).min()
    assert time >= 0 and distance <= sampled + 1e-12


@pytest.mark.parametrize("far", [0.0, 1e6, 1e10, 1e15])
def test_far_from_the_origin_the_times_are_the_same(far):
    meet = particle_particle([far, 0], [1, 1], [far + 4, 0], [-2, 2], 1e-9, 0.5)
    assert not meet.collides and (meet.alpha, meet.beta) == (2, 1)


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_a_row_does_not_change_the_answer_of_another(seed):
    random = np.random.default_rng(seed)
    scale = 10.0 ** random.integers(-3, 16, size=(6, 1))
    rows = [scale * random.integers(-4, 5, size=(6, 3)) for _ in range(2)]
    speeds = random.integers(-2, 3, size=(2, 6, 3)).astype(float)
    batch = particle_particle(rows[0], speeds[0], rows[1], speeds[1], 1e-3, 1e-3)
    for i in range(6):
        alone = particle_particle(rows[0][i], speeds[0][i], rows[1][i], speeds[1][i], 1e-3, 1e-3)
        assert tuple(field[i] for field in batch) == tuple(alone)


def test_bad_thresholds_are_refused():
    with pytest.raises(InputError, match="distance_threshold"):
        particle_particle([0, 0], [1, 1], [4, 0], [-1, 1], -1.0, 1.0)
    with pytest.raises(InputError, match="finite"):
        particle_particle([0, np.nan], [1, 1], [4, 0], [-1, 1], 1.0, 1.0)
