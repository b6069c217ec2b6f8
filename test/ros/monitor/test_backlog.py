"""Which of the waiting states a slow node monitors: none of an object whose newest state would be lost."""

from __future__ import annotations

from time import monotonic_ns

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor import codec, records
from collision_monitor.pipeline.state_intake import ReceivedStates
from collision_monitor.ros.monitor.backlog import Backlog, without_outdated

MS = 1_000_000


def message(stamp_ms: int, *ids: int, frame: str = "world", sequence: int = 0) -> bytes:
    states = np.zeros(len(ids), records.STATE)
    states["id"] = ids
    states["quaternion"][:, 3] = 1.0
    return codec.encode_states(stamp_ms * MS, frame, sequence, states)


def remaining(waiting: list[bytes], step_s: float) -> list[bytes]:
    return [each.data for each in without_outdated(list(map(ReceivedStates.decode, waiting)), step_s)]


STREAM = [message(50 * k, 1, 2) for k in range(5)]


def test_a_backlog_that_is_worked_off_soon_loses_nothing() -> None:
    assert remaining(STREAM, 0.015) == STREAM


def test_a_backlog_that_steps_cannot_work_off_is_left_but_for_the_newest() -> None:
    assert remaining(STREAM, 0.06) == STREAM[-1:]


def test_the_objects_of_several_publishers_all_keep_their_newest_states() -> None:
    waiting = [message(0, 1), message(1, 2), message(10, 1), message(12, 3), message(20, 1)]
    assert remaining(waiting, 1.0) == [waiting[1], waiting[3], waiting[4]]


@pytest.mark.parametrize(
    "later",
    [
        pytest.param(message(50, 1, frame="map"), id="another frame"),
        pytest.param(message(50, 1)[:-3], id="truncated"),
        pytest.param(message(0, 1), id="the same stamp"),
        pytest.param(message(50, 2), id="another object"),
    ],
)
def test_what_does_not_replace_a_state_does_not_outdate_it(later: bytes) -> None:
    assert remaining([message(0, 1), later, message(60, 9)], 1.0)[0] == message(0, 1)


@given(
    st.lists(st.tuples(st.integers(0, 8), st.sets(st.integers(1, 4), min_size=1)), min_size=1, max_size=8),
    st.floats(0.0, 1.0),
)
def test_the_newest_state_of_each_object_always_stays(sent: list[tuple[int, set[int]]], step_s: float) -> None:
    waiting = [message(stamp, *sorted(ids), sequence=k) for k, (stamp, ids) in enumerate(sent)]
    places = [waiting.index(each) for each in remaining(waiting, step_s)]
    assert places == sorted(places)  # in the order of arrival
    for object_id in range(1, 5):
        stamps = [stamp for stamp, ids in sent if object_id in ids]
        if stamps:
            newest = [k for k, (stamp, ids) in enumerate(sent) if object_id in ids and stamp == max(stamps)]
            assert set(newest) & set(places)


def chosen(backlog: Backlog, first: bytes) -> list[bytes]:
    return [each.data for each in backlog.choose(ReceivedStates.decode(first))]


def test_only_states_that_waited_for_the_end_of_a_step_count() -> None:
    waiting = STREAM[1:]
    backlog = Backlog(lambda: waiting.pop(0) if waiting else None, 10)
    assert chosen(backlog, STREAM[0]) == STREAM[:1], "nothing was running"
    end = monotonic_ns()
    backlog.end_step(end - 100 * MS, end)
    assert backlog.mean == pytest.approx(0.1)
    assert chosen(backlog, STREAM[0]) == STREAM[-1:]
    assert backlog.outdated == 4
    assert not waiting


def test_no_more_messages_are_taken_than_allowed() -> None:
    backlog = Backlog(lambda: STREAM[0], 10)
    end = monotonic_ns()
    backlog.end_step(end - 100 * MS, end)
    assert len(chosen(backlog, STREAM[0])) == 10


def test_a_single_slow_step_is_not_the_duration_of_the_next_ones() -> None:
    backlog = Backlog(lambda: None, 10)
    for took in [5] * 20 + [1000]:
        backlog.end_step(0, took * MS)
    assert backlog.mean < 0.01
    for _ in range(20):
        backlog.end_step(0, 100 * MS)
    assert backlog.mean == pytest.approx(0.1, rel=0.05)
