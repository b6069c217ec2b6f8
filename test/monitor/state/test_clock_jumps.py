"""Clocks that jump, of all publishers or of one: overlapping objects are reported, or known to be without a state."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.errors import Refusal
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere

MILLISECOND = 1_000_000
SECOND = 1_000_000_000
PERIOD = 20 * MILLISECOND
YEAR = 365 * 86400 * SECOND
START = 20 * YEAR

NEAR, FAR = 0.8, 50.0
"""m between two spheres of diameter 1 m: they overlap, or are far apart."""


@dataclass
class Publisher:
    """A publisher of two spheres, with a clock of its own."""

    ids: tuple[int, int]
    clock: int
    distance: float = FAR
    sent: list[tuple[int, float]] = field(default_factory=list)

    @property
    def pair(self) -> tuple[int, int]:
        return self.ids

    def say(self, monitor: Monitor, *, stamp: int | None = None, distance: float | None = None) -> StepResult:
        """Send the two states; without a stamp, at the next time of the clock."""
        if stamp is None:
            self.clock += PERIOD
        said = (self.clock if stamp is None else stamp, self.distance if distance is None else distance)
        self.sent = [*self.sent[-3:], said]
        rest = np.zeros((2, 6))  # a jump of the distance is no motion
        return monitor.step(said[0], list(self.ids), poses(100.0 * self.ids[0], said[1]), rest)


def poses(x: float, distance: float) -> NDArray[np.float64]:
    rows = np.zeros((2, 7))
    rows[:, 0], rows[:, 6] = (x, x + distance), 1.0
    return rows


def team(*clocks: int, profile: Profile | str = "balanced") -> tuple[Monitor, list[Publisher]]:
    monitor, publishers = Monitor(profile), []
    for k, clock in enumerate(clocks):
        publishers.append(Publisher((2 * k + 1, 2 * k + 2), clock))
        for object_id in publishers[-1].ids:
            monitor.add(object_id, Sphere(0.5))
    for _ in range(3):
        for publisher in publishers:
            publisher.say(monitor)
    return monitor, publishers


def reported(result: StepResult) -> set[tuple[int, int]]:
    """Pairs that touch or may touch."""
    contacts = result.contacts[result.contacts["phase"] != records.Phase.END]
    unresolved = result.predictions["status"] == records.PredictionStatus.UNRESOLVED
    rows = [*contacts, *result.predictions[unresolved]]
    return {(int(row["id_a"]), int(row["id_b"])) for row in rows}


def refused(monitor: Monitor) -> int:
    return sum(monitor.refused.values())


def unusable(monitor: Monitor) -> set[int]:
    """Objects that are counted as stale or unseen."""
    bodies, roster = monitor._roster.bodies, monitor._roster
    return {*monitor.stale_ids, *(k for k in monitor.ids if not bodies.seen[roster.slot(k)])}


# ---------------------------------------------------------------------- all clocks


@pytest.mark.parametrize("back", [60 * MILLISECOND, 8 * SECOND, 11 * SECOND, 10 * YEAR])
def test_time_that_goes_back_is_noticed_at_the_second_message(back: int) -> None:
    monitor, (publisher,) = team(START)
    publisher.distance = NEAR
    publisher.say(monitor)
    publisher.clock -= back
    publisher.say(monitor)
    assert (monitor.restarts, refused(monitor)) == (0, 1 if back > 10 * SECOND else 2)
    result = publisher.say(monitor)
    assert (result.accepted, result.stamp_ns, monitor.restarts) == (True, publisher.clock, 1)
    assert [int(c["phase"]) for c in result.contact_rows] == [records.Phase.END, records.Phase.BEGIN]
    assert "time jumped by -" in monitor.last_refusal
    assert monitor.refusal_texts[Refusal.TIME] == monitor.last_refusal
    assert result.status.objects_stale == result.status.objects_unseen == 0


def test_what_no_message_of_the_new_time_names_is_unseen() -> None:
    monitor, (one, other) = team(START, START + MILLISECOND)
    for publisher in (one, other):
        publisher.clock -= 8 * SECOND
    one.say(monitor)
    assert one.say(monitor).status.objects_unseen == 2
    assert other.say(monitor).status.objects_unseen == 0
    assert monitor.restarts == 1


def test_an_object_that_appears_in_the_earlier_time_does_not_hide_that_the_others_are_old() -> None:
    monitor, _ = team(START)
    monitor.add(9, Sphere(0.5))
    for k in range(2):
        stamp = START - 5 * SECOND + k * PERIOD
        result = monitor.step(stamp, [1, 2, 9], np.vstack([poses(0, NEAR), poses(900, 0)[:1]]))
    assert monitor.restarts == 1
    assert reported(result) == {(1, 2)}


def test_a_message_without_moving_objects_says_nothing_about_time() -> None:
    monitor, (publisher,) = team(START)
    monitor.add(9, Sphere(0.5), static=True, pose=Pose((900, 0, 0)))
    for k in range(100):
        monitor.step(START - 5 * SECOND + k * PERIOD, [], np.zeros((0, 7)))
        monitor.step(START - 5 * SECOND + k * PERIOD, [9, 77], poses(0, 0))
    assert monitor.restarts == 0
    assert publisher.say(monitor).stamp_ns == publisher.clock


@pytest.mark.parametrize("sent_again", [1, 2, 3])
def test_one_late_message_restarts_nothing_however_often_it_comes(sent_again: int) -> None:
    monitor, (publisher,) = team(START)
    late = publisher.sent[0]
    for _ in range(20):
        publisher.say(monitor)
        for _ in range(sent_again):
            publisher.say(monitor, stamp=late[0], distance=late[1])
    assert monitor.restarts == 0


@pytest.mark.parametrize("outlier", [-12 * SECOND, -3 * SECOND, 9 * SECOND, 20 * SECOND, 2**62])
def test_an_outlier_is_over_at_the_second_message_after_it(outlier: int) -> None:
    monitor, (publisher,) = team(START)
    publisher.say(monitor, stamp=publisher.clock + outlier)
    publisher.distance = NEAR
    publisher.say(monitor)
    result = publisher.say(monitor)
    assert result.stamp_ns == publisher.clock
    assert reported(result) == {(1, 2)}
    assert monitor.restarts == (1 if outlier == 9 * SECOND else 0)


@pytest.mark.parametrize("between", [3 * SECOND, 15 * SECOND])
def test_clocks_that_jump_to_different_times_are_both_followed(between: int) -> None:
    monitor, publishers = team(START, START + MILLISECOND)
    for k, publisher in enumerate(publishers):
        publisher.clock += YEAR + k * between
        publisher.distance = NEAR
    for _ in range(3):
        for publisher in publishers:
            publisher.say(monitor)
    assert monitor.restarts >= 1
    result = monitor.last  # the last accepted one: a refused step has no answers
    assert result is not None
    for publisher in publishers:
        assert publisher.pair in reported(result) or {*publisher.ids} <= unusable(monitor)
    assert reported(result)


# ---------------------------------------------------------------------- one clock among several


@pytest.mark.parametrize("back", [SECOND, 9 * SECOND, 60 * SECOND])
def test_the_objects_of_one_clock_that_goes_back_are_stale_and_named(back: int) -> None:
    monitor, (good, bad) = team(START, START + MILLISECOND)
    bad.clock -= back
    for _ in range(26):
        result = good.say(monitor)
        bad.say(monitor)
    assert monitor.restarts == 0
    assert (result.status.objects_stale, monitor.stale_ids) == (2, [3, 4])
    assert "object 3" in monitor.last_refusal
    if back > 10 * SECOND:
        assert "stamp of object 3, 4: expected within 10 s of the last one, got -59.999 s" in monitor.last_refusal
    else:
        assert "object 3: expected one state a message, newer than its last one" in monitor.last_refusal
        assert monitor.last_refusal.endswith(f"got one that is {(back - 26 * PERIOD) / 1e9:.3f} s older")


def test_the_pairs_of_one_clock_that_goes_back_become_unresolved() -> None:
    monitor, (good, bad) = team(START, START + MILLISECOND)
    bad.clock -= 9 * SECOND
    for _ in range(400):
        result = good.say(monitor)
        bad.say(monitor)
    assert monitor.restarts == 0, "8 s later it still lags"
    rows = [c for c in result.contacts if int(c["id_a"]) == 3]
    assert [int(c["status"]) for c in rows] == [records.ContactStatus.UNRESOLVED]
    assert rows[0]["error_bound"] >= 2 * 0.5 * 7.9**2
    assert reported(result) == {(3, 4)}


def ahead(by: int) -> tuple[Monitor, Publisher, Publisher]:
    """A publisher whose clock jumped ahead, after one message of each since then."""
    monitor, (good, bad) = team(START, START + MILLISECOND)
    bad.clock += by
    bad.say(monitor)
    good.say(monitor)
    return monitor, good, bad


def test_while_one_clock_is_ahead_the_others_objects_are_stale_and_unresolved() -> None:
    monitor, good, bad = ahead(8 * SECOND)
    for _ in range(100):
        bad.say(monitor)
        result = good.say(monitor)
    assert monitor.restarts == 0
    assert monitor.stale_ids == [1, 2]
    (row,) = [c for c in result.contacts if int(c["id_a"]) == 1]
    assert row["status"] == records.ContactStatus.UNRESOLVED  # 50 m apart, and 2 x 32 m of doubt
    assert row["error_bound"] >= 2 * 0.5 * 8.0**2


def test_a_clock_that_was_ahead_and_is_corrected_is_followed_at_its_second_message() -> None:
    monitor, good, bad = ahead(8 * SECOND)
    bad.clock -= 8 * SECOND
    for publisher in (bad, good, bad):
        publisher.distance = NEAR
        result = publisher.say(monitor)
    assert monitor.restarts == 1
    assert result.stamp_ns == bad.clock
    result = good.say(monitor)
    assert reported(result) == {(1, 2), (3, 4)}
    assert monitor.stale_ids == []


def test_time_goes_back_when_the_publisher_that_was_ahead_is_silent_for_as_long_as_stale_after() -> None:
    monitor, good, _ = ahead(8 * SECOND)
    steps = 0
    while monitor.restarts == 0:
        assert {1, 2} <= unusable(monitor)
        result = good.say(monitor)
        steps += 1
    assert steps == 26  # 0.52 s
    assert result.stamp_ns == good.clock
    assert (result.status.objects_stale, result.status.objects_unseen) == (0, 2)


def test_a_publisher_with_a_long_delay_restarts_nothing() -> None:
    """Its states are 0.45 s older than those of the others, which come less often."""
    monitor, (slow, delayed) = team(START, START - 450 * MILLISECOND)
    for k in range(500):
        delayed.say(monitor)
        if k % 10 == 0:
            slow.clock += 9 * PERIOD
            slow.say(monitor)
    assert (monitor.restarts, refused(monitor)) == (0, 0)


# ---------------------------------------------------------------------- any clocks

deltas = st.one_of(
    st.integers(-200 * MILLISECOND, 200 * MILLISECOND),
    st.integers(-12 * SECOND, 12 * SECOND),
    st.integers(-10 * YEAR, 10 * YEAR),
)
jumps = st.tuples(st.sampled_from(["all", "first", "second"]), deltas, st.integers(2, 40))


@given(st.lists(jumps, min_size=1, max_size=6), st.integers(0, PERIOD - 1))
def test_after_any_jump_two_messages_suffice(clock_jumps: list[tuple[str, int, int]], offset: int) -> None:
    """At each jump the spheres of the publisher change their distance, so that an old answer would be wrong."""
    monitor, publishers = team(START, START + offset)
    asunder = False  # one of the clocks jumped alone
    for which, delta, rounds in clock_jumps:
        jumping = {"all": publishers, "first": publishers[:1], "second": publishers[1:]}[which]
        asunder |= which != "all"
        for publisher in jumping:
            publisher.clock += delta
            publisher.distance = NEAR
        for k in range(rounds):
            before = {}
            for publisher in publishers:
                count = refused(monitor)
                publisher.say(monitor)
                result = monitor.last  # the last accepted one
                assert result is not None
                before[publisher.ids[0]] = refused(monitor) - count
            if k < 1:
                continue
            for publisher in jumping:
                if publisher.pair not in reported(result):
                    assert asunder, "all clocks agree, so every pair is reported"
                    lately = {*publisher.ids} <= unusable(monitor)
                    assert lately or before[publisher.ids[0]], "its states are accepted, so the pair is reported"
                    assert lately or k * PERIOD <= (SECOND // 2) + PERIOD, "it has had time to become stale"
        for publisher in jumping:
            publisher.distance = FAR
            publisher.say(monitor)


@given(st.lists(st.sampled_from(["go on", "swap", "late", "twice"]), min_size=1, max_size=60), st.integers(1, 3))
def test_reordering_within_one_step_and_duplicates_restart_nothing(events: list[str], count: int) -> None:
    monitor, publishers = team(*(START + k * MILLISECOND for k in range(count)))
    for k, event in enumerate(events):
        publisher = publishers[k % count]
        if event == "swap":
            publisher.clock += PERIOD
            publisher.say(monitor, stamp=publisher.clock + PERIOD)
            publisher.say(monitor, stamp=publisher.clock)
            publisher.clock += PERIOD
        elif event in ("late", "twice"):
            publisher.say(monitor, stamp=publisher.sent[-1 if event == "twice" else -2][0])
        for each in publishers:
            result = each.say(monitor)
    assert monitor.restarts == 0
    assert result.stamp_ns == max(publisher.clock for publisher in publishers)


@given(st.lists(st.tuples(deltas, st.integers(0, 4)), max_size=20))
@settings(max_examples=25)
def test_a_monitor_restored_amid_jumps_gives_the_same_answers(events: list[tuple[int, int]]) -> None:
    monitor, (publisher,) = team(START)
    for delta, steps in events:
        publisher.clock += delta
        restored = Monitor.restored(monitor.profile, Snapshot.decode(monitor.snapshot().encode()))
        for _ in range(steps):
            clock = publisher.clock
            mine = publisher.say(monitor)
            publisher.clock = clock
            theirs = publisher.say(restored)
            assert (mine.accepted, mine.stamp_ns, mine.status) == (theirs.accepted, theirs.stamp_ns, theirs.status)
            assert (monitor.restarts, monitor.last_refusal) == (restored.restarts, restored.last_refusal)
        assert monitor.digest == restored.digest


def test_the_text_of_a_refusal_has_a_limit() -> None:
    monitor = Monitor()
    monitor.refuse(Refusal.FRAME, "x" * 10**6)
    assert len(monitor.last_refusal) == len(monitor.refusal_texts[Refusal.FRAME]) == 1000
