"""Time of the sources: it goes back, jumps, stands still or is missing, and everything that holds a stamp follows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, T, marker, markers, odometry, pose_stamped, transforms
from foreign_messages import detection, detections, track, tracked_objects
from hypothesis import given
from hypothesis import strategies as st
from played_sources import JOINTS, MILLISECOND, Played
from recorded_bags import STILL

from collision_monitor.codec import encode_states
from collision_monitor.errors import InputError, Refusal
from collision_monitor.monitor.state.timeline import Progress
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.sources.ground.source_time import MOST_STREAMS, Clock, SourceTime

STEP = 50_000_000
SPHERE = {"sphere": 1.0}
ARM = Path(__file__).parents[2] / "examples/arm/arm.urdf"
Message = tuple[str, int, tuple[str, Any]]
STEPPING: list[dict[str, Any]] = [{}, {"rate": 20}, {"step": "/odom"}]
BACK = [0.3, 2.0, 5.0, 9.9, 30.0]


MOST_OF_A_RUN = 60
"""Messages of a topic in a run: with a longer run, they come less often."""


def run(begin: int, received: int, steps: int = 40, period: int = STEP) -> Iterator[Message]:
    """A robot that drives in a frame of tf, a person that it sees, a track and a detection. period: ns."""
    for k in range(steps):
        t, stamp, now = k * period / SECOND, begin + k * period, received + k * period
        yield "/tf", now, transforms(stamp, ("map", "odom", (100 + t, 0, 0), (0, 0, 0, 1)))
        yield "/odom", now, odometry("odom", stamp, (t, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))
        yield "/person", now, pose_stamped("odom", stamp, (3, t, 0))
        yield "/tracks", now, tracked_objects("map", stamp, track(1, (t, 5, 0), linear=(1, 0, 0)))
        yield "/detections", now, detections("map", stamp, detection((2 * t, 9, 0), name="7"))


OBJECTS = {
    "robot": {"topic": "/odom", "shape": SPHERE},
    "person": {"topic": "/person", "shape": SPHERE},
    "tracks": {"topic": "/tracks"},
    "people": {"topic": "/detections"},
    "frame": {"topic": "/tf", "frame": "odom", "shape": SPHERE},
}


@pytest.mark.parametrize("stepping", STEPPING)
@pytest.mark.parametrize("back", BACK)
def test_a_bag_in_a_loop_gives_the_second_run_like_the_first(back: float, stepping: dict[str, Any]) -> None:
    steps = min(max(round(back * 20), 6), MOST_OF_A_RUN)
    period = max(STEP, round(back * SECOND / steps))
    fed = Fed(OBJECTS, begin=START, **stepping)
    fed.give_all(run(START, START, steps, period))
    first, count = list(fed.steps), len(fed.steps)
    fed.give_all(run(START, START + steps * period, steps, period))
    second = fed.steps[count:]
    assert len(second) >= 0.9 * len(first) - 8  # what the second messages confirm is missing
    at = {step.stamp_ns: step for step in first}
    compared = 0
    for step in second:
        if step.stamp_ns < START + 4 * period or step.stamp_ns not in at:  # twists need two poses
            continue
        known = {int(row["id"]): row for row in at[step.stamp_ns].states}
        for row in step.states:
            other = known.get(int(row["id"]))
            if other is not None:
                compared += 1
                np.testing.assert_allclose(row["position"], other["position"], atol=1e-9)
                np.testing.assert_allclose(row["linear"], other["linear"], atol=1e-6)
    assert compared >= 5 * (steps - 5) - 15 if stepping else compared > 0
    assert {name.partition("_")[0] for name in fed.names} == {"robot", "person", "tracks", "people", "frame"}


@pytest.mark.parametrize("back", BACK)
def test_an_arm_moves_on_after_its_time_went_back(back: float) -> None:
    played = Played({"urdf": str(ARM), "joint_states": "/joint_states", "base": {"pose": [0, 0, 0]}}, rate=50)
    begin = START + round(back * SECOND)
    played.joints(begin, np.zeros(8), np.zeros(8))
    played.joints(begin + 20 * MILLISECOND, np.zeros(8), np.zeros(8))
    for k in range(10):
        content = np.full(8, 0.01 * k)
        played.joints(START + 20 * k * MILLISECOND, content, np.zeros(8), JOINTS)
    assert len(played.states) == 10
    assert played.steps[-1].stamp_ns == START + 180 * MILLISECOND
    assert not any("max_age" in text for text in played.refusals)


def test_markers_and_tracks_of_the_time_before_end_in_the_time_after() -> None:
    fed = Fed(
        {"m": {"topic": "/m", "marker": {"ns": "a"}}, "tracks": {"topic": "/tracks", "forget_after": 0.2}}, begin=START
    )
    shown = marker("a", 1, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=START + 8 * SECOND)
    shown.lifetime = T["builtin_interfaces/msg/Duration"](1, 0)
    fed.give("/m", START, markers(shown))
    fed.give("/tracks", START, tracked_objects("map", START + 8 * SECOND, track(1, (0, 0, 0)), track(2, (9, 0, 0))))
    for k in range(60):
        stamp = START + k * STEP
        fed.give("/tracks", START + k * STEP, tracked_objects("map", stamp, track(1, (0, 0, 0))))
    gone = [change for change in fed.names if change.startswith("-")]
    assert len(gone) == 2  # the track that is not seen any more, and the marker after its lifetime


def test_markers_that_wait_when_the_time_goes_back_are_of_the_time_after() -> None:
    """More new markers in one message than are described at once: the others are shown later."""
    objects = {"m": {"topic": "/m", "marker": {"ns": "a"}}, "robot": {"topic": "/odom", "shape": SPHERE}}
    fed = Fed(objects, begin=START, allowance=2)
    each = [marker("a", i, 1, (1, 1, 1), (i, 0, 0), frame="map", stamp=START + 8 * SECOND) for i in range(8)]
    fed.give("/odom", START, odometry("map", START + 8 * SECOND, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    fed.give("/m", START, markers(*each))
    for k in range(8):
        stamp = START + k * STEP
        fed.give("/odom", START + 1 + k, odometry("map", stamp, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    assert len(fed.changes) == 9 and not fed.refused
    late = [step for step in fed.steps if step.stamp_ns > START + SECOND and (step.states["position"][:, 0] > 3).any()]
    assert not late


@pytest.mark.parametrize("lag", [0.1, 0.4, 0.9])
def test_two_publishers_of_one_topic_with_different_delays_are_one_time(lag: float) -> None:
    """A slow publisher without delay, and a fast one whose stamps lag behind: time never goes back."""
    clock, restarts = Clock(1.0), 0
    for k in range(2000):
        now = START + k * 10_000_000
        if k % 100 == 0:
            restarts += clock.advance("/t", now, now) is Progress.RESTARTS
        restarts += clock.advance("/t", now - round(lag * SECOND), now) is Progress.RESTARTS
    assert restarts <= 1  # before the delay was known


def test_publishers_that_are_gone_make_room_for_others() -> None:
    """Markers with a new id each are streams of their own."""
    clock = Clock(1.0)
    for k in range(MOST_STREAMS + 100):
        clock.advance(("/m", k), START + k, START + k)
    later = START + 12 * SECOND
    for k in range(2 * 12):
        clock.advance("/slow", START + k * SECOND // 2, START + k * SECOND // 2)
    found = [clock.advance("/odom", later + k * STEP, later + k * STEP) for k in range(20)]
    found += [clock.advance("/odom", later + k * STEP, later + (20 + k) * STEP) for k in range(5)]
    assert found.count(Progress.RESTARTS) == 1


def test_one_stamp_of_the_future_stops_the_steps_for_half_a_second_only() -> None:
    fed = Fed({"robot": {"topic": "/odom", "shape": SPHERE}, "m": {"topic": "/m", "marker": {"ns": "a"}}}, rate=20)
    for k in range(100):
        stamp = START + k * STEP
        fed.give("/odom", stamp, odometry("map", stamp, (k, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        if k == 50:
            early = marker("a", 1, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=stamp + 9 * SECOND)
            fed.give("/m", stamp, markers(early))
    seen = {step.stamp_ns for step in fed.steps}
    missing = [k for k in range(100) if START + k * STEP not in seen]
    assert len(missing) <= 13 and max(missing) <= 65


def test_a_transform_of_the_far_future_hides_no_frame() -> None:
    fed = Fed({"thing": {"topic": "/p", "shape": SPHERE}})
    for k in range(30):
        stamp = START + k * STEP
        fed.give("/tf", stamp, transforms(stamp, ("map", "base", (k, 0, 0), (0, 0, 0, 1))))
        if k == 10:
            fed.give("/tf", stamp, transforms(stamp + 3600 * SECOND, ("map", "base", (0, 0, 0), (0, 0, 0, 1))))
        fed.give("/p", stamp, pose_stamped("base", stamp, (0, 1, 0)))
    assert fed.rows["position"][:, 0].tolist() == [float(k) for k in range(30)]
    assert any("expected one within 10 s of the others" in text for text in fed.refused)


def test_late_transforms_take_their_place_in_the_history() -> None:
    fed = Fed({"thing": {"topic": "/p", "shape": SPHERE}})
    for k in (0, 2, 1):
        fed.give("/tf", START, transforms(START + k * SECOND, ("map", "base", (k * k, 0, 0), (0, 0, 0, 1))))
    fed.give("/p", START, pose_stamped("base", START + SECOND, (0, 0, 0)))
    assert fed.rows["position"][0, 0] == 1.0


def test_one_transform_message_out_of_order_does_not_set_time_back() -> None:
    """Its frames have different stamps, and none of them confirms another."""
    frames = {name: {"topic": "/tf", "frame": name, "shape": SPHERE} for name in "ab"}
    fed = Fed(frames, begin=START, rate=20)
    for now, k in enumerate([0, 1, 2, 3, 4, 6, 5, 7, 8, 9]):
        each = [transforms(START + k * STEP + j, ("map", name, (k, j, 0), (0, 0, 0, 1))) for j, name in enumerate("ab")]
        content = T["tf2_msgs/msg/TFMessage"]([one for _, message in each for one in message.transforms])
        fed.give("/tf", START + now * STEP, (each[0][0], content))
    stamps = [step.stamp_ns for step in fed.steps]
    assert stamps == sorted(stamps)


# -- topics that are slow, or silent for long


@pytest.mark.parametrize("stepping", STEPPING)
@pytest.mark.parametrize("period", [8.0, 10.5, 15.0, 60.0, 3600.0])
def test_a_slow_topic_that_is_the_only_one_is_monitored(period: float, stepping: dict[str, Any]) -> None:
    """By the clock of receipt as much time passes: no stamp is one of another clock."""
    fed = Fed({"robot": {"topic": "/odom", "shape": SPHERE}}, begin=START, **stepping)
    pipeline = Pipeline("balanced", "map", timed=False)
    pipeline.on_shapes(fed.feed.begin(START)[0].data)
    for k in range(8):
        stamp = START + round(k * period * SECOND)
        fed.give("/odom", stamp + 3_000_000, odometry("map", stamp, (k, 0, 0), *STILL))
    assert not fed.refused
    assert fed.rows["position"][:, 0].tolist() == [float(k) for k in range(8)]
    answers = [pipeline.on_states(encode_states(each.stamp_ns, "map", 0, each.states, None)) for each in fed.steps]
    assert pipeline.monitor.refused[Refusal.TIME] == (7 if period > 1000 else 0)  # beyond, the monitor begins anew
    assert pipeline.monitor.refused[Refusal.OLD] == 0
    assert answers[-1].result.stamp_ns == fed.steps[-1].stamp_ns


def test_a_slow_topic_does_not_confirm_a_clock_that_is_ahead() -> None:
    """What is ahead by more than passed since the last message of any topic still needs a second one."""
    fed = Fed({"robot": {"topic": "/odom", "shape": SPHERE}, "person": {"topic": "/person", "shape": SPHERE}})
    for k in range(40):
        now = START + k * SECOND
        fed.give("/odom", now, odometry("map", now, (k, 0, 0), *STILL))
        if k == 20:
            fed.give("/person", now, pose_stamped("map", now + 15 * SECOND, (0, 0, 0)))
    assert [text for text in fed.refused if "expected one within 10 s" in text]
    assert (fed.rows["id"] == 1).sum() == 40


# -- messages without a stamp


@pytest.mark.parametrize("stepping", STEPPING)
@pytest.mark.parametrize("first", [True, False])
def test_messages_without_a_stamp_take_the_time_of_the_others(first: bool, stepping: dict[str, Any]) -> None:
    """In a simulation, the stamps begin at 10 s and the messages are received today."""
    objects = {"robot": {"topic": "/odom", "shape": SPHERE}, "post": {"topic": "/post", "shape": SPHERE}}
    fed = Fed(objects, begin=START, **stepping)
    for k in range(40):
        stamp, now = 10 * SECOND + k * STEP, START + k * STEP
        messages: list[Message] = [
            ("/tf", now, transforms(stamp, ("map", "base", (5, 0, 0), (0, 0, 0, 1)))),
            ("/odom", now, odometry("base", stamp, (0.05 * k, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))),
            ("/post", now + 1000, pose_stamped("base", 0, (7, 0, 0))),
        ]
        fed.give_all(reversed(messages) if first and k == 0 else messages)
    rows = fed.rows[fed.rows["id"] == 1]
    assert len(rows) >= 39 and (np.abs(rows["position"][:, 0] - 5) < 3).all()
    stamps = [step.stamp_ns for step in fed.steps if (step.states["id"] == 1).any()]
    assert min(stamps) >= 10 * SECOND and max(stamps) <= 12 * SECOND
    assert (fed.rows["id"] == 2).sum() >= 38
    assert all("frames known from tf: none" in text for text in fed.refused)  # before the first transform


def test_a_file_without_any_stamp_goes_by_the_clock_of_receipt() -> None:
    fed = Fed({"post": {"topic": "/post", "shape": SPHERE}}, rate=20)
    for k in range(20):
        fed.give("/post", START + k * STEP, pose_stamped("map", 0, (k, 0, 0)))
    assert [step.stamp_ns for step in fed.steps] == [START + k * STEP for k in range(20)]
    assert fed.rows["linear"][-1].tolist() == pytest.approx([20, 0, 0])


def test_objects_without_stamps_go_on_when_the_others_are_silent() -> None:
    objects = {"robot": {"topic": "/odom", "shape": SPHERE}, "post": {"topic": "/post", "shape": SPHERE}}
    fed = Fed(objects, rate=20)
    for k in range(100):
        if k < 20:
            stamp = 10 * SECOND + k * STEP
            fed.give("/odom", START + k * STEP, odometry("map", stamp, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        fed.give("/post", START + k * STEP, pose_stamped("map", 0, (k, 0, 0)))
    assert fed.steps[-1].stamp_ns == 10 * SECOND + 99 * STEP
    assert len(fed.steps) >= 85


@pytest.mark.parametrize("speed", [0.05, 0.5, 1.0, 2.0])
def test_objects_without_stamps_take_the_time_of_tf_if_nothing_else_has_one(speed: float) -> None:
    """In a simulation that is slower or faster than the clock of receipt."""
    fed = Fed({"post": {"topic": "/post", "shape": SPHERE}}, begin=START, rate=20)
    for k in range(400):
        stamp, now = 10 * SECOND + round(k * STEP * speed), START + k * STEP
        fed.give("/tf", now, transforms(stamp, ("map", "base", (stamp / SECOND, 0, 0), (0, 0, 0, 1))))
        fed.give("/post", now, pose_stamped("base", 0, (0, 0, 0)))
    assert not fed.refused
    for step in fed.steps:
        assert step.states["position"][:, 0] == pytest.approx(step.stamp_ns / SECOND, abs=1e-6)
    assert fed.steps[-1].stamp_ns == pytest.approx(10 * SECOND + 400 * STEP * speed, abs=2 * STEP * max(speed, 1.0))


@pytest.mark.parametrize("speed", [0.02, 0.05, 0.5, 1.0])
def test_objects_without_stamps_do_not_run_ahead_of_rare_stamps(speed: float) -> None:
    """A slow simulation: odometry every second by the clock of receipt, and a post without stamps 50 times as often."""
    fed = Fed({"robot": {"topic": "/odom", "shape": SPHERE}, "post": {"topic": "/post", "shape": SPHERE}}, rate=20)
    for k in range(2000):
        stamp, now = 10 * SECOND + round(k * STEP * speed / 2.5), START + k * STEP // 5 * 2
        if k % 50 == 0:
            fed.give("/odom", now, odometry("map", stamp, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        fed.give("/post", now, pose_stamped("map", 0, (0, 0, 0)))
    last = 10 * SECOND + round(2000 * STEP * speed / 2.5)
    assert abs(fed.steps[-1].stamp_ns - last) <= 2 * STEP
    assert not fed.refused
    assert (fed.rows["id"] == 1).sum() >= min(38, (last - 10 * SECOND) // STEP)


# -- stamps that no clock shows


@pytest.mark.parametrize(
    ("sec", "nanosec"), [(2**31 - 1, 10**9), (2**31 - 1, 2**32 - 1), (-1, 0), (-(2**31), 0), (-(2**31), 2**32 - 1)]
)
def test_a_stamp_that_no_clock_shows_is_refused_and_the_next_message_is_taken(sec: int, nanosec: int) -> None:
    fed = Fed({"robot": {"topic": "/odom", "shape": SPHERE}}, rate=20)
    kind, content = odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0))
    content.header.stamp.sec, content.header.stamp.nanosec = sec, nanosec
    fed.give("/odom", START, (kind, content))
    (text,) = fed.refused
    assert text.startswith("/odom: stamp: expected a time from 1970 to 2038")
    assert [row.what for row in fed.feed.unmonitored] == ["/odom"]
    fed.give("/odom", START, odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    assert len(fed.steps) == 1 and not fed.feed.unmonitored


def test_nanoseconds_beyond_a_second_are_seconds() -> None:
    fed = Fed({"robot": {"topic": "/odom", "shape": SPHERE}})
    kind, content = odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0))
    content.header.stamp.nanosec = 1_000_000_000
    fed.give("/odom", START, (kind, content))
    assert fed.steps[0].stamp_ns == START + SECOND


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 100), st.integers(0, 100)), max_size=60))
def test_the_time_is_always_that_of_a_message(messages: list[tuple[str, int, int]]) -> None:
    time = SourceTime(by_header=True, rate=20.0, step_topic="", max_age=1.0)
    for stream, stamp, received in messages:
        given_stamp = time.message_stamp(stamp * SECOND // 10, received * SECOND // 10)
        before = time.now_ns
        progress = time.advance(stream, given_stamp, received * SECOND // 10)
        if progress is Progress.RESTARTS:
            assert time.now_ns == given_stamp.ns
        elif progress is Progress.CONTINUES:
            assert time.now_ns >= before
        else:
            assert time.now_ns == before
        due = time.step_due(stream, given_stamp.ns)
        assert due is None or due <= time.now_ns
    with pytest.raises(InputError, match="expected a time from 1970 to 2038"):
        time.message_stamp(-1, 0)
