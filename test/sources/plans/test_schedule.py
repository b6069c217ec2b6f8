"""Objects with a declared schedule: where they are at each step, and what is predicted of them."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, odometry, transforms

from collision_monitor import Box, Monitor, Sphere
from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.records import StateFlag

CART = {"topic": "/odom", "shape": {"sphere": 0.2}}
GATE = {
    "shape": {"box": [0.2, 2.0, 1.0]},
    "schedule": {
        "poses": {"closed": [3, 0, 0], "open": [3, 2.4, 0]},
        "at": {0: "closed", 1: "closed", 3: "open", 5: "open", 7: "closed"},
        "repeat": 10,
    },
}


def fed(seconds: float, period: float = 0.1, rate: float = 10, **schedule: Any) -> Fed:
    """The gate beside a cart whose messages come each `period`."""
    gate = {**GATE, "schedule": {**GATE["schedule"], **schedule}}  # type: ignore[dict-item]
    given = Fed({"cart": CART, "gate": gate}, rate=rate)
    drive(given, seconds, period)
    return given


def drive(given: Fed, seconds: float, period: float = 0.1, begin: int = START) -> None:
    for k in range(round(seconds / period) + 1):
        t = begin + round(k * period * SECOND)
        given.give("/odom", t, odometry("map", t, (0, 9, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))


def gate_rows(given: Fed) -> tuple[Any, Any]:
    """Times (s after START) and states of the gate."""
    found = [(step.stamp_ns, row) for step in given.steps for row in step.states if row["id"] == 2]
    return np.array([(t - START) / SECOND for t, _ in found]), np.array([row for _, row in found])


def expected_y(t: Any) -> Any:
    t = np.asarray(t) % 10.0
    u = np.clip(np.where(t < 5, (t - 1) / 2, (7 - t) / 2), 0, 1)
    return 2.4 * u * u * (3 - 2 * u)


def test_the_states_are_those_of_the_declared_time_law_round_after_round() -> None:
    given = fed(25)
    times, rows = gate_rows(given)
    assert len(times) == 251
    assert rows["position"][:, 1] == pytest.approx(expected_y(times), abs=0.003)
    assert np.abs(rows["linear"][:, 1]).max() == pytest.approx(2.4 / 2 * 1.5, rel=0.02)
    assert rows["flags"].tolist() == [StateFlag.BODY_TWIST] * 251
    assert not given.refused


def test_each_round_has_a_plan_that_goes_on_beyond_it() -> None:
    given = fed(25)
    assert [(m.stamp_ns - START) / SECOND for m in given.plans] == [0, 10, 20]
    for message in given.plans:
        (plan,) = message.trajectories
        assert plan.object_id == 2 and plan.times[-1] >= 12.0
        path = Trajectory(plan.times, plan.poses, between="arc")
        for t in np.linspace(0, 12, 100):
            assert path.at(t).position[1] == pytest.approx(expected_y(t), abs=0.003)


def test_a_gate_that_will_close_is_predicted_to_meet_what_stands_in_it() -> None:
    """The states alone say that the gate stands: without its plan nothing is predicted."""
    given = fed(5.0)
    (plan,) = given.plans[0].trajectories
    found = []
    for follows in (True, False):
        monitor = Monitor(profile="balanced")
        monitor.add(1, Sphere(0.2), static=True, pose=(3, 1, 0))
        monitor.add(2, Box((0.2, 2.0, 1.0)))
        if follows:
            monitor.follow(2, Trajectory(plan.times, plan.poses, between="arc"), stamp_ns=START)
        result = None
        for k in (46, 47, 48, 49):
            row = given.steps[k].states[given.steps[k].states["id"] == 2]
            result = monitor.step(given.steps[k].stamp_ns, row)
        assert result is not None
        found.append(len(result.predictions))
    assert found == [1, 0]


def test_a_door_turns_about_its_hinge() -> None:
    half = cos(pi / 4), sin(pi / 4)
    door = {
        "shape": {"box": [1.0, 0.05, 2.0]},
        "schedule": {
            "poses": {"shut": [0.5, 0, 1], "wide": [0, 0.5, 1, 0, 0, half[1], half[0]]},
            "at": {0: "shut", 2: "wide"},
            "moves": "steady",
        },
    }
    given = Fed({"cart": CART, "door": door}, rate=10)
    drive(given, 4)
    _, rows = gate_rows(given)
    assert np.linalg.norm(rows["position"][:, :2], axis=1) == pytest.approx(0.5)
    angle = np.arctan2(rows["position"][:, 1], rows["position"][:, 0])
    assert angle == pytest.approx(np.minimum(np.arange(41) * 0.1 / 2, 1) * pi / 2)
    assert rows["angular"][10, 2] == pytest.approx(pi / 4) and rows["angular"][30, 2] == 0.0


def test_the_load_of_a_conveyor_jumps_back() -> None:
    load = {
        "shape": {"box": [0.4, 0.4, 0.4]},
        "schedule": {
            "poses": {"in": [0, 0, 0], "out": [4, 0, 0]}, "at": {0: "in", 4: "out"}, "moves": "steady", "repeat": 4,
        },
    }  # fmt: skip
    given = Fed({"cart": CART, "load": load}, rate=10)
    drive(given, 10)
    times, rows = gate_rows(given)
    assert rows["position"][:, 0] == pytest.approx(np.round(times, 6) % 4.0)
    assert [message.trajectories[0].times.tolist() for message in given.plans] == [[0, 4]] * 3


def test_time_0_is_the_first_step_or_the_declared_stamp() -> None:
    given = fed(3.0, begin=START / SECOND - 2.0)
    times, rows = gate_rows(given)
    assert rows["position"][:, 1] == pytest.approx(expected_y(times + 2.0), abs=0.003)


def test_a_schedule_of_an_object_with_a_topic_gives_its_plan_alone() -> None:
    given = Fed({"gate": {**GATE, "topic": "/gate"}})
    for k in range(5):
        t = START + k * SECOND // 10
        given.give("/gate", t, odometry("map", t, (3, 0.01, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    assert len(given.steps) == 5 and len(given.plans) == 1
    assert {row["position"][1] for step in given.steps for row in step.states} == {0.01}


def test_after_a_jump_of_time_the_schedule_begins_anew_and_its_plan_a_step_later() -> None:
    given = fed(3.0)
    back = START - 1000 * SECOND
    drive(given, 1.0, begin=back)
    later = [message.stamp_ns for message in given.plans[1:]]
    assert later and later[0] < START
    _, rows = gate_rows(given)
    assert rows["position"][-1, 1] == pytest.approx(0.0)


def test_its_frame_is_awaited_and_listed() -> None:
    given = Fed({"cart": CART, "gate": {**GATE, "schedule": {**GATE["schedule"], "frame": "hall"}}}, rate=10)  # type: ignore[dict-item]
    drive(given, 0.5)
    assert [(each.line, each.what) for each in given.feed.unmonitored if each.line == "gate"] == [("gate", "gate")]
    assert not given.plans
    given.give("/tf_static", START, transforms(START, ("map", "hall", (10, 0, 0), (0, 0, 0, 1))))
    drive(given, 0.5, begin=START + SECOND)
    assert not [each for each in given.feed.unmonitored if each.line == "gate"]
    assert gate_rows(given)[1]["position"][-1, 0] == pytest.approx(13)
    assert given.plans[0].trajectories[0].poses[0, 0] == pytest.approx(13)


@pytest.mark.parametrize(
    ("schedule", "text"),
    [
        ({"poses": {}}, "gate, poses: expected a table of names"),
        ({"at": {}}, "gate, at: expected 1 to 1000 times with poses"),
        ({"at": {0: "ajar"}}, "gate, at, 0: 'ajar' is unknown"),
        ({"at": {3: "open", 1: "closed"}}, "gate, at: expected rising times, got 3 and then 1"),
        ({"at": {11: "open"}}, "gate, at: expected times up to `repeat`, 10 s, got 11"),
        ({"repeat": 0.01}, "gate, repeat: expected"),
        ({"moves": "fast"}, "gate, moves: 'fast' is unknown"),
        ({"law": 1}, "gate, schedule: 'law' is unknown"),
    ],
)
def test_a_schedule_that_cannot_be_used_is_refused(schedule: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        fed(0.0, **schedule)


def test_only_a_single_object_with_a_shape_has_a_schedule() -> None:
    with pytest.raises(InputError, match="gate, schedule: expected one of a single object with a `shape`"):
        Fed({"gate": {**GATE, "static": True}})
    with pytest.raises(InputError, match="gate, schedule: expected one of a single object with a `shape`"):
        Fed({"gate": {"schedule": GATE["schedule"]}})
