"""Tests of the facts of a report, on sessions with known events and known outcomes of each prediction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from played_session import drive_states, record_drive, record_scene, record_states

from collision_monitor import Pose, Sphere, contact
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.report.assessment import assess
from collision_monitor.report.facts import gather
from collision_monitor.report.footprint import footprint
from collision_monitor.session import Session
from collision_monitor.session.history.alerts import AlertOutcome, stated_error
from collision_monitor.session.history.read_history import read_history
from collision_monitor.shapes.registry import Box, HalfSpace, Polygon
from collision_monitor.world.crossing import Crossing

STEP = 0.02


def test_a_drive_and_a_warning_that_came_to_nothing(drive: Path) -> None:
    history = read_history(Session(drive))
    facts = gather(history)
    (collision,) = facts.collisions
    assert collision.pair == (1, 2)
    assert 1.5 <= collision.begin <= 1.5 + STEP  # the front of its ball is at 0.7 m, the post's at 2.2 m
    assert collision.warned == pytest.approx(collision.begin)  # predicted from the first step on
    assert facts.surprises == facts.possible == facts.gaps == []
    assert [alert.pair for alert in facts.nothing] == [(1, 3)]
    assert facts.nothing[0].time[-1] == pytest.approx(0.5, abs=1.5 * STEP)
    assert facts.risky == [(1, 2), (1, 3)]
    assert np.all(stated_error(facts.answered[collision], collision, facts.period) == 0.0)
    found = assess(history, facts)
    assert (found.kind, found.answer, found.doubts) == ("collisions", "1 collision", [])
    assert any("alarms (pairs × steps) were false" in line for line in found.findings)


def test_an_alert_at_the_end_is_open(tmp_path: Path) -> None:
    history = read_history(Session(record_drive(tmp_path / "short.mcap", 0.4)))
    facts = gather(history)
    assert not facts.collisions and not facts.nothing
    assert {alert.outcome for each in facts.alerts.values() for alert in each} == {AlertOutcome.OPEN}
    found = assess(history, facts)
    assert (found.kind, found.answer) == ("clear", "No collisions")
    assert any("still predicted" in line for line in found.findings)


def test_the_collisions_of_the_crossing_scene(crossing: Path) -> None:
    history = read_history(Session(crossing))
    facts = gather(history)
    expected = {(e.id_a, e.id_b): e.begin for e in Crossing(None, None).expected if e.begin is not None}
    assert len(facts.collisions) == len(expected) > 5
    for each in facts.collisions:
        assert expected[each.pair] - 1e-6 <= each.begin <= expected[each.pair] + STEP + 1e-6
        low, high = facts.answered[each].first_stated
        assert low <= expected[each.pair] + 1e-9 and expected[each.pair] <= high + 1e-9
        assert np.abs(stated_error(facts.answered[each], each, facts.period)).max() < 1e-6


def test_distances_are_those_of_the_shapes(drive: Path) -> None:
    history = read_history(Session(drive))
    times, distance = gather(history).tracks.distance((1, 2))
    compound = history.objects[1].shapes
    for k in (0, 40, 90):
        here = contact(list(compound), Pose((times[k], 0, 0)), Sphere(0.5), Pose((2.7, 0, 0)))
        assert distance[k] == pytest.approx(here.signed_distance, abs=1e-12)


def test_a_track_breaks_where_an_object_jumped(tmp_path: Path) -> None:
    facts = gather(read_history(Session(record_scene(tmp_path / "jump.mcap", "crossing", 9.0))))
    times, distance = facts.tracks.distance((1, 2))
    assert times[np.isnan(distance)] == pytest.approx([8.0], abs=1.5 * STEP)
    assert np.abs(np.diff(distance)[~np.isnan(np.diff(distance))]).max() < 0.1


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0])
def test_footprints_hold_their_shapes(angle: float) -> None:
    turn = np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])
    at = np.array([5.0, -3.0, 1.0])

    def area(shape: object) -> float:
        (outline,) = footprint(ObjectDescription(1, shape), at, turn)
        x, y = (outline - at[:2]).T
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    assert area(Box((2.0, 0.5, 1.0))) == pytest.approx(1.0)
    assert np.pi <= area(Sphere(1.0)) <= 1.002 * np.pi
    assert area(Polygon([(0, 0), (2, 0), (2, 2), (1, 1), (0, 2)])) == pytest.approx(3.0)  # concave
    assert footprint(ObjectDescription(1, HalfSpace((0, 0, 1), 0.0)), at, turn) == []  # the ground
    (wall,) = footprint(ObjectDescription(1, HalfSpace((1, 0, 0), 2.0)), at, turn)
    n = np.array([np.cos(angle), np.sin(angle)])
    assert ((wall - at[:2]) @ n).max() == pytest.approx(2.0)


def test_times_go_on_where_the_clock_is_set_back(tmp_path: Path) -> None:
    descriptions, states = drive_states(2.0)
    twice = [*states, *((t - 50.0, rows) for t, rows in states)]
    history = read_history(Session(record_states(tmp_path / "loop.mcap", descriptions, twice)))
    facts = gather(history)
    assert history.restarts == 1 and np.all(np.diff(history.times) >= 0.0)
    assert history.duration == pytest.approx(4.0, abs=3 * STEP)
    first, second = (each.begin for each in facts.collisions if each.pair == (1, 2))
    assert (first, second - first) == pytest.approx((1.5, 2.0), abs=2 * STEP)
    times, distance = facts.tracks.distance((1, 2))
    assert np.interp([1.0, 3.0], times, distance) == pytest.approx([0.5, 0.5], abs=3 * STEP)
    assert any("the clock was set back (1 time)" in doubt for doubt in assess(history, facts).doubts)


def test_nothing_is_concluded_across_a_gap(tmp_path: Path) -> None:
    descriptions, states = drive_states(3.0)
    seen = [(t, rows) for t, rows in states if not 0.31 < t < 1.19 and not 1.79 < t < 2.61]
    history = read_history(Session(record_states(tmp_path / "gaps.mcap", descriptions, seen)))
    facts = gather(history)
    assert np.ravel(facts.gaps) == pytest.approx([0.3, 1.2, 1.78, 2.62], abs=STEP)
    assert not facts.nothing  # the state of the ball is unknown after 0.3 s
    first = next(each for each in facts.collisions if each.pair == (1, 2))
    assert first.warned == pytest.approx(0.3, abs=2 * STEP)  # the predictions before the gap do not count
    assert [each.pair for each in facts.collisions].count((1, 2)) == 1  # it lasts through the second gap


def test_the_end_of_a_contact_that_nobody_saw_is_not_known(tmp_path: Path) -> None:
    descriptions, states = drive_states(2.0)
    later = [(t + 5.0, rows) for t, rows in drive_states(0.5)[1]]  # the objects are apart again
    history = read_history(Session(record_states(tmp_path / "gap.mcap", descriptions, [*states, *later])))
    (collision,) = (each for each in history.collisions if each.pair == (1, 2))
    assert collision.end is None and collision.last == pytest.approx(1.98)
