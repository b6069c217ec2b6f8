"""What the node logs of refused input: each kind once at once, then at most every 10 s with its count."""

import itertools
import math

import numpy as np
import pytest

from collision_monitor import codec, records
from collision_monitor.errors import Refusal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.ros.health.refusal_log import PERIOD, RefusalLog
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere

SECOND = 1_000_000_000
BALL = ((Sphere(0.5), Pose()),)


def state(object_id, x=0.0, quaternion=(0, 0, 0, 1)):
    row = np.zeros((), records.STATE)
    row["id"], row["position"][0], row["quaternion"] = object_id, x, quaternion
    return row


@pytest.fixture
def lines():
    return []


@pytest.fixture
def pipeline():
    return Pipeline()


@pytest.fixture
def monitor(pipeline):
    monitor = pipeline.monitor
    for object_id in range(1, 9):
        monitor.add(object_id, Sphere(0.5), name=f"ball {object_id}" if object_id != 2 else "\x1b[31mred\n")
    return monitor


def test_a_flood_is_one_line_at_once_and_then_one_every_ten_seconds(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    for k in range(25_000):  # 25 s at 1 kHz
        monitor.refuse(Refusal.FRAME, f"frame {k}")
        log.report("/states", k * SECOND // 1000)
    assert lines == [
        "/states: frame 0",
        "/states: frame 10000 (10000 times since the last line)",
        "/states: frame 20000 (10000 times since the last line)",
    ]
    log.catch_up(25 * SECOND)
    assert len(lines) == 3
    log.catch_up(20 * SECOND + PERIOD)
    assert lines[3:] == ["/states: frame 24999 (4999 times since the last line)"]
    log.catch_up(90 * SECOND)
    assert len(lines) == 4


def test_each_kind_and_each_topic_has_its_line(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    for reason in Refusal:
        monitor.refuse(reason, f"why {reason.value}", 3)
    log.report("/states", 0)
    monitor.refuse(Refusal.FRAME, "another frame")
    log.report("/shapes", 0)
    assert lines == [f"/states: why {reason.value} (3 times)" for reason in Refusal] + ["/shapes: another frame"]


def test_nothing_refused_is_no_line(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    for k in range(100):
        monitor.step(k * SECOND // 50, np.stack([state(1), state(2, 5)]))
        log.report("/states", k)
        log.report_stale("/states", k)
        log.catch_up(k)
    assert lines == []


def test_two_kinds_in_one_message_have_their_own_texts(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    monitor.step(SECOND, np.stack([state(77), state(1, math.nan), state(2, 0, (0, 0, 0, 0))]))
    log.report("/states", 0)
    assert [line.split(",")[0] for line in lines] == [
        "/states: expected the id of an object that was described",
        "/states: object 1: expected finite numbers up to 1e18 in pose and twist",
        "/states: object 2: expected a unit quaternion within 1e-3",
    ]


def test_a_restart_is_logged_at_once_although_the_jump_was_refused_just_before(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    for k, stamp in enumerate((60 * SECOND, 61 * SECOND, SECOND, SECOND + 1)):
        monitor.step(stamp, np.stack([state(1)]))
        log.report("/states", k)
    assert len(lines) == 2
    assert "stamp of object 1: expected within 10 s of the last one, got -60.000 s" in lines[0]
    assert "time jumped by -60.000 s" in lines[1]


def test_stale_objects_are_named_in_one_printable_line(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    monitor.step(0, np.stack([state(k, 5 * k) for k in range(1, 9)]))
    for k in range(1, 200):  # 20 s
        monitor.step(k * SECOND // 10, np.stack([state(8)]))
        log.report_stale("/states", k * SECOND // 10)
    assert len(lines) == 2
    assert lines[0].startswith("/states: no usable new state of object 1 ('ball 1'), 2 ('\\x1b[31mred\\n'), 3 ")
    assert lines[0].endswith("5 ('ball 5') and 2 more: stale")
    assert all(line.isprintable() for line in lines)


def test_a_first_users_mistakes_are_in_the_log_with_object_topic_and_numbers(start, team):
    monitor = start("run", "--ros-args", "-p", "stale_after:=0.3")
    team.meet()
    good = (state(1), state(2, 3.0))
    team.describe(*(ObjectDescription(k, BALL, name=f"ball {k}") for k in (1, 2, 3)))
    team.status(lambda s: s.objects == 3)
    team.ask(*good, state(3, 9.0))
    bad_shape = bytearray(codec.encode_descriptions(0, "world", [ObjectDescription(4, BALL)]))
    at = bytes(bad_shape).index(np.float64(0.5).tobytes())
    bad_shape[at : at + 8] = np.float64(-0.5).tobytes()
    sent = 0
    while sent < 20 or "no usable new state of object" not in monitor.words:
        assert sent < 400
        sent += 1
        team.ask(*good, state(77), state(3, math.nan), state(3, 0, (0, 0, 0, 0)))
        team.say(*good, frame_id="moon")
        team.say(*good, stamp=team.now - 3600 * SECOND)
        team.publish_states(b"\xff" * 7)
        team.publish_shapes(bytes(bad_shape))
        team.listen(0.03)
    team.status(lambda s: s.refused_shape == sent and s.refused_malformed == sent)
    assert 1 in {status.objects_stale for status in team.statuses}
    assert monitor.stop() == 0
    words, states, shapes = monitor.words, "/object_monitor/objects/states", "/object_monitor/objects/shapes"
    for line in (
        f"{states}: expected the id of an object that was described, got 77",
        f"{states}: object 3: expected finite numbers",
        f"{states}: object 3: expected a unit quaternion within 1e-3, got [0.0, 0.0, 0.0, 0.0]",
        f"{states}: ObjectStateArray: expected frame_id 'world', got 'moon'",
        f"{states}: stamp of object 1, 2: expected within 10 s of the last one, got -3",
        f"{states}: no usable new state of object 3 ('ball 3'): stale",
    ):
        assert words.count(line) == 1, line
    assert words.count(f"]: {states}: ") == 7
    assert words.count(f"{shapes}: ") == 1
    assert "-0.5" in words.split(f"{shapes}: ")[1].splitlines()[0]
    assert words.count("[WARN]") - words.count("no newer states") == 8


def test_a_simulation_that_restarts_is_followed_and_logged(start, team):
    monitor = start("run")
    team.meet()
    team.describe(*(ObjectDescription(k, BALL, name=f"ball {k}") for k in (1, 2)))
    team.status(lambda s: s.objects == 2)
    for k in range(50):
        contacts, _ = team.ask(state(1), state(2, 50.0), stamp=5 * SECOND + k * SECOND // 50)
        assert len(contacts.contacts) == 0
    before = len(team.contacts)
    for k in range(3):  # the simulation starts again at 0 s, and now they touch
        team.say(state(1), state(2, 0.8), stamp=k * SECOND // 50)
        team.until(lambda: len(team.contacts) == before + k + 1)  # noqa: B023
    stamps = [m.header.stamp.sec * SECOND + m.header.stamp.nanosec for m in team.contacts[before:]]
    assert stamps == [5 * SECOND + 49 * SECOND // 50, SECOND // 50, 2 * SECOND // 50]
    assert [len(m.contacts) for m in team.contacts[before:]] == [0, 1, 1]
    ticks = itertools.count(3)

    def go_on():  # or else the status may come after a silence that makes the objects stale
        team.say(state(1), state(2, 0.8), stamp=next(ticks) * SECOND // 50)
        team.listen(0.02)
        return team.statuses[-1].contacts == 1

    team.until(go_on)
    status = team.statuses[-1]
    assert "time jumped by -5.960 s" in status.last_refusal
    assert (status.refused_old, status.objects_stale, status.objects_unseen) == (2, 0, 0)
    assert monitor.stop() == 0
    assert monitor.words.count("time jumped by -5.960 s") == 1


def test_a_clock_that_stands_still_is_silence(start, team):
    monitor = start("run", "--ros-args", "-p", "stale_after:=0.3")
    team.meet()
    team.describe(*(ObjectDescription(k, BALL) for k in (1, 2)))
    team.status(lambda s: s.objects == 2)
    for _ in range(60):  # header.stamp was never set
        team.say(state(1), state(2, 50.0), stamp=0)
        team.listen(0.01)
    assert team.status(lambda s: s.objects_stale == 2).refused_old > 50
    assert monitor.stop() == 0
    assert "no newer states on /object_monitor/objects/states: all moving objects are stale" in monitor.words
    assert "got another one with the same stamp" in monitor.words


def test_objects_without_a_state_are_named_at_the_second_look_and_every_ten_seconds(pipeline, monitor, lines):
    log = RefusalLog(pipeline, lines.append)
    monitor.step(0, np.stack([state(k) for k in range(3, 9)]))
    for k in range(45):
        log.report_unseen("/states", k * SECOND // 2)
        if k == 0:
            assert lines == []  # it may just have been described
    text = "/states: no state so far of object 1 ('ball 1'), 2 ('\\x1b[31mred\\n'): nothing is known about it"
    assert lines == [text] * 3
    monitor.step(SECOND, np.stack([state(k) for k in range(1, 9)]))
    for k in range(45, 90):
        log.report_unseen("/states", k * SECOND // 2)
    assert len(lines) == 3


def test_a_monitor_without_any_state_says_so_after_some_seconds(pipeline, lines):
    log = RefusalLog(pipeline, lines.append)
    for k in range(70):
        log.report_unseen("/states", k * SECOND // 2)
        if k == 9:
            assert lines == []
    assert lines == ["/states: no state arrived so far, neither here nor from a sources file"] * 3
