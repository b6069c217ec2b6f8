"""Tests of the event list against a plain search for the minimum."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.world.hard_spheres.event_tree import empty_tree, schedule


@given(st.integers(1, 40), st.lists(st.tuples(st.integers(0, 39), st.integers(0, 20)), max_size=80))
def test_the_root_is_the_earliest_event_with_ties_to_the_lower_index(count, changes):
    times, winners = empty_tree(count)
    plain = np.full(count, np.inf)
    for sphere, time in changes:
        sphere %= count
        schedule(times, winners, sphere, float(time))
        plain[sphere] = time
        assert times[1] == plain.min()
        assert winners[1] == plain.argmin()
