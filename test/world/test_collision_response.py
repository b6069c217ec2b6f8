"""Bounces between walls against flying from wall to wall."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.world.collision_response import bounce_between_walls


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
