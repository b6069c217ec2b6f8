"""The order in which a step examines pairs if it has no time for all of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.impact.impact_record import IMPACT
from collision_monitor.monitor.active_pairs import PAIR
from collision_monitor.monitor.event_list import count_until
from collision_monitor.monitor.time_critical import urgency
from collision_monitor.motion.bodies import make_bodies

BODIES = 12

pair = st.tuples(
    st.integers(0, BODIES - 2), st.integers(1, BODIES - 1), st.booleans(), st.sampled_from((0.0, 0.5, 0.5, 1.25, 3.0))
).filter(lambda row: row[0] < row[1])


@given(rows=st.lists(pair, max_size=60, unique_by=lambda row: row[:2]), step=st.integers(1, 2**32))
def test_cheap_ones_first_and_then_by_turns(rows: list[tuple[int, int, bool, float]], step: int) -> None:
    bodies = make_bodies(BODIES)
    bodies.motion["radius"] = 1.0
    bodies.motion["radius"][0] = np.inf  # a half-space
    bodies.spin_radius[3:] = 1.0  # bodies 1 and 2 are spheres, the rest are not
    pairs, events = np.zeros(len(rows), PAIR), np.zeros(len(rows), IMPACT)
    for k, (i, j, touched, lower) in enumerate(sorted(rows)):
        pairs[k] = ((i << 32) | j, i, j, 0.0, 0, touched, 0)
        events[k]["lower"] = lower

    order, cheap = urgency(bodies, pairs, events, step)

    assert sorted(order.tolist()) == list(range(len(rows)))
    is_cheap = [(pairs[k]["i"] == 0 or pairs[k]["j"] < 3) for k in order.tolist()]
    assert is_cheap == sorted(is_cheap, reverse=True)
    assert cheap == sum(is_cheap)
    dear = order[cheap:]
    touched, lower = pairs["touched"][dear] == 1, events["lower"][dear]
    for of_one_kind in (touched, ~touched):
        assert (np.diff(lower[of_one_kind]) >= 0.0).all()  # the pair that waits longest comes first
    both = 2 * min(int(touched.sum()), int((~touched).sum()))
    assert touched[:both].tolist() == [False, True] * (both // 2)  # the two kinds alternate


def test_who_waits_as_long_as_others_is_not_always_the_last() -> None:
    bodies = make_bodies(40)
    bodies.motion["radius"] = bodies.spin_radius[:] = 1.0
    pairs, events = np.zeros(20, PAIR), np.zeros(20, IMPACT)
    pairs["i"], pairs["j"] = np.arange(20), np.arange(20, 40)
    pairs["key"] = (pairs["i"].astype(np.uint64) << np.uint64(32)) | pairs["j"].astype(np.uint64)
    places = np.array([np.argsort(urgency(bodies, pairs, events, step)[0]) for step in range(1, 200)])
    assert (places.min(axis=0) < 5).all()


@given(times=st.lists(st.floats(0.0, 4.0), max_size=40), time=st.floats(0.0, 4.0))
def test_what_begins_by_a_time_is_counted_as_by_numpy(times: list[float], time: float) -> None:
    events = np.zeros(len(times), IMPACT)
    events["lower"] = np.sort(times)
    assert count_until(events, time) == np.searchsorted(np.sort(times), time, side="right")
