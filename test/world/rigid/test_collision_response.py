"""Bounces between walls against flying from wall to wall."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.world.rigid.collision_response import bounce_between_walls


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
