"""Tests of what a result says: refusals, contacts that ended, a stamp that jumps, a known id."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import collision_monitor as cm

SECOND = 1_000_000_000
APART, TOUCHING = [(0, 0, 0, 0, 0, 0, 1), (9, 0, 0, 0, 0, 0, 1)], [(0, 0, 0, 0, 0, 0, 1), (0.9, 0, 0, 0, 0, 0, 1)]


@pytest.fixture
def monitor() -> cm.Monitor:
    made = cm.Monitor(warns=False)
    for object_id in (1, 2):
        made.add(object_id, cm.Sphere(0.5))
    return made


def test_a_known_id_is_replaced_only_on_demand(monitor: cm.Monitor) -> None:
    with pytest.raises(cm.InputError, match="write replace=True"):
        monitor.add(1, cm.Sphere(2.0))
    monitor.step(0, [1, 2], [(0, 0, 0, 0, 0, 0, 1), (2, 0, 0, 0, 0, 0, 1)])
    monitor.add(1, cm.Sphere(2.0), replace=True)
    assert len(monitor.step(1, [2], [(2, 0, 0, 0, 0, 0, 1)]).contacts) == 1
    monitor.remove(1)
    monitor.add(1, cm.Sphere(0.5))


def test_contacts_that_ended_stand_apart(monitor: cm.Monitor) -> None:
    first = monitor.step(0, [1, 2], TOUCHING)
    assert len(first.contacts) == 1 and not len(first.ended)
    second = monitor.step(SECOND // 10, [1, 2], APART)
    assert not len(second.contacts) and (second.ended["id_a"], second.ended["id_b"]) == (1, 2)
    assert "ended: object_1 and object_2" in repr(second)
    third = monitor.step(SECOND // 5, [1, 2], APART)
    assert not len(third.contacts) and not len(third.ended)


def test_a_result_lists_what_its_step_refused_and_no_more(monitor: cm.Monitor) -> None:
    result = monitor.step(0, [1, 2, 77, 78], [*APART, *APART])
    (refused,) = result.refused
    assert (refused.reason, refused.count) == (cm.Refusal.UNKNOWN_ID, 2)
    assert "got 7" in refused.text and refused.text in repr(result)
    assert monitor.step(1, [1, 2], APART).refused == ()
    assert monitor.refused[cm.Refusal.UNKNOWN_ID] == 2


def test_a_stamp_that_jumps_gives_its_reason_and_no_old_answers(monitor: cm.Monitor) -> None:
    assert len(monitor.step(0, [1, 2], TOUCHING).contacts) == 1
    result = monitor.step(3600 * SECOND, [1, 2], APART)
    assert not result.accepted and not len(result.contact_rows) and not len(result.predictions)
    (refused,) = result.refused
    assert refused.reason is cm.Refusal.TIME and "+3600.000 s" in refused.text
    assert "refused" in repr(result)
    confirmed = monitor.step(3600 * SECOND + 1, [1, 2], APART)
    assert confirmed.accepted and "the timeline restarts there" in confirmed.refused[0].text


def test_the_first_refusal_of_each_kind_warns() -> None:
    monitor = cm.Monitor()
    monitor.add(1, cm.Sphere(0.5))
    with pytest.warns(cm.RefusalWarning, match="got 7"):
        monitor.step(0, [7], APART[:1])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        monitor.step(1, [7], APART[:1])
    with pytest.warns(cm.RefusalWarning, match="finite"):
        monitor.step(2, [1], [(np.nan, 0, 0, 0, 0, 0, 1)])


def test_answers_become_data_frames_where_pandas_is(monitor: cm.Monitor) -> None:
    result = monitor.step(0, [1, 2], TOUCHING)
    try:
        import pandas  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match="pip install pandas"):
            result.to_pandas()
    else:
        assert result.to_pandas()["normal_x"].tolist() == [1.0]
