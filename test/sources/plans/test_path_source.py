"""Plans of other programs: paths and trajectories become ObjectTrajectoryArrays, live and imported alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, odometry, transforms, write_bag
from foreign_plans import ROBOT, path, trajectory

from collision_monitor.alerts.rules import Rules
from collision_monitor.cli.main import main
from collision_monitor.codec import decode_predictions, decode_trajectories
from collision_monitor.errors import InputError
from collision_monitor.session import Session
from collision_monitor.session.history.expectations import evaluate_expectations, parse_expectations
from collision_monitor.session.history.read_history import AS_RECORDED, read_history
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag, load_mapping
from collision_monitor.view.recording import RecordedSteps

CORNER = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 0), (1, 3, 0)]


def fed(**plan: Any) -> Fed:
    return Fed(ROBOT, plans={"robot": {"topic": "/plan", **plan}})


def test_a_path_without_stamps_takes_its_speed_and_loses_equal_points() -> None:
    given = fed(speed=0.5, headings="path", tolerance={"across": 0.3})
    given.give("/plan", START, path(CORNER))
    (message,) = given.plans
    (plan,) = message.trajectories
    assert (message.stamp_ns, message.frame_id, plan.object_id) == (START, "map", 1)
    assert plan.times.tolist() == [0.0, 2.0, 4.0, 8.0]
    assert plan.poses[:, :3].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 3, 0]]
    yaw = 2.0 * np.arctan2(plan.poses[:, 5], plan.poses[:, 6])
    assert yaw == pytest.approx([0.0, np.pi / 2, np.pi / 2, np.pi / 2])
    assert plan.tolerance.tolist() == [0.3, 0.2, 0.1, 0.2]
    assert not given.refused


def test_stamps_that_rise_are_the_times() -> None:
    given = fed(speed=9.0)
    given.give("/plan", START, path(CORNER[:3], [START + k * SECOND for k in (1, 3, 4)]))
    assert given.plans[0].trajectories[0].times.tolist() == [1.0, 3.0, 4.0]


def test_an_empty_path_ends_the_plan() -> None:
    given = fed(speed=1.0)
    given.give("/plan", START, path([]))
    assert len(given.plans[0].trajectories[0].times) == 0


def test_a_plan_in_another_frame_is_brought_into_that_of_the_monitor() -> None:
    given = fed(speed=1.0)
    quarter = (0, 0, 0.5**0.5, 0.5**0.5)
    given.give("/tf", START, transforms(START, ("map", "odom", (10, 0, 0), quarter)))
    given.give("/plan", START, path([(0, 0, 0), (2, 0, 0)], frame="odom"))
    poses = given.plans[0].trajectories[0].poses
    assert poses[:, :3] == pytest.approx(np.array([[10, 0, 0], [10, 2, 0]]))
    assert poses[0, 3:] == pytest.approx(quarter)


@pytest.mark.parametrize(
    ("message", "plan", "text"),
    [
        (path(CORNER), {}, "they are all equal, so the plan has no times; give its `speed`"),
        (
            path(CORNER[:3], [1, 3, 2]),
            {"speed": 1.0},
            "or equal ones, got a fall or a stop at pose 2",
        ),
        (path(CORNER[:1]), {"speed": 1.0}, "expected 2 to 20000 poses, or none to end the plan, got 1"),
        (path([(1, 1, 0)] * 3), {"speed": 1.0}, "expected at least 2 poses at different places and times, got one"),
        (path(CORNER, frame="nowhere"), {"speed": 1.0}, "nowhere"),
    ],
)
def test_a_plan_that_cannot_be_used_is_refused_and_counted(message: Any, plan: Any, text: str) -> None:
    given = fed(**plan)
    given.give("/plan", START, message)
    assert given.plans == []
    ((found, count),) = given.refused.items()
    assert text in found and count == 1


def test_a_trajectory_takes_its_times_or_else_its_velocities_until_it_stands() -> None:
    given = fed()
    line = [(float(k), 0, 0) for k in range(4)]
    given.give("/plan", START, trajectory(line, [1, 1, 1, 0], [0.0, 0.5, 1.5, 3.0]))
    given.give("/plan", START + 1, trajectory(line, [1, 3, 1, 0]))
    given.give("/plan", START + 2, trajectory(line, [2, 0, 0, 1]))
    times = [message.trajectories[0].times.tolist() for message in given.plans]
    assert times == [[0.0, 0.5, 1.5, 3.0], [0.0, 0.5, 1.0, 3.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("plans", "text"),
    [
        ({}, "plans: expected a table"),
        ({"robo": {"topic": "/plan"}}, "plans: 'robo' is unknown"),
        ({"robot": {}}, "robot, topic: expected the topic of its plan"),
        ({"robot": {"topic": "/odom"}}, "plans: expected a topic of its own for each plan, got /odom twice"),
        ({"robot": {"topic": "/plan", "speed": 0}}, "robot, speed: expected"),
        ({"robot": {"topic": "/plan", "then": "stop"}}, "robot, then: 'stop' is unknown"),
        ({"robot": {"topic": "/plan", "tolerance": {"acros": 1}}}, "robot, tolerance: 'acros' is unknown"),
    ],
)
def test_an_entry_that_cannot_be_used_is_refused(plans: Any, text: str) -> None:
    with pytest.raises(InputError, match=text):
        Fed(ROBOT, plans=plans)


FILE = """\
frame: map
objects:
  robot: {topic: /odom, shape: {box: [0.4, 0.4, 0.4]}}
  post: {static: true, shape: {sphere: 0.2}, pose: [1, 1.2, 0]}
plans:
  robot: {topic: /plan, speed: 0.5, headings: path, tolerance: {angle: 3}}
"""


def test_a_bag_with_a_path_predicts_the_post_behind_the_bend_and_replays(tmp_path: Path) -> None:
    still = ((0, 0, 0, 1), (0.5, 0, 0), (0, 0, 0))
    stamps = [START + k * SECOND // 10 for k in range(20)]
    messages = [("/odom", t, odometry("map", t, ((t - START) / SECOND * 0.5, 0, 0), *still)) for t in stamps]
    messages.insert(5, ("/plan", stamps[4] + 1, path([(0, 0, 0), (1, 0, 0), (1, 3, 0)])))
    bag = write_bag(tmp_path / "bag", messages)
    (tmp_path / "sources.yaml").write_text(FILE)
    mapping = load_mapping(tmp_path / "sources.yaml")
    result = import_bag(bag, tmp_path / "run.mcap", mapping)
    assert not (result.refused or result.skipped), result
    session = Session(tmp_path / "run.mcap")
    plans = [decode_trajectories(each.data) for each in session.messages() if each.type == "ObjectTrajectoryArray"]
    assert [len(plan.trajectories) for plan in plans] == [1]
    found = [
        len(decode_predictions(each.data).predictions)
        for each in Session(tmp_path / "run.mcap").messages()
        if each.type == "PredictedCollisionArray"
    ]
    assert sum(found[:4]) == 0 and sum(found[6:]) > 8, found
    assert replay(Session(tmp_path / "run.mcap")).verdict is Verdict.IDENTICAL
    import_bag(bag, tmp_path / "again.mcap", mapping)
    one, other = (
        [each.data for each in Session(tmp_path / name).messages() if each.type != "MonitorStatus"]
        for name in ("run.mcap", "again.mcap")
    )
    assert one == other


def leaving_bag(folder: Path) -> Path:
    """A robot that follows its path for 1 s, and then drives straight past the bend."""
    still = ((0, 0, 0, 1), (1.0, 0, 0), (0, 0, 0))
    messages: Any = []
    for k in range(25):
        t = START + k * SECOND // 10
        messages.append(("/odom", t, odometry("map", t, (k / 10, 0, 0), *still)))
    messages.insert(1, ("/plan", START + 1, path([(0, 0, 0), (1, 0, 0), (1, 3, 0)])))
    return write_bag(folder / "bag", messages)


RULES = "rules: {off plan: {left_plan: any, raise_after: 0.2}}\n"


def test_the_report_the_check_and_the_page_say_who_left_its_plan(tmp_path: Path) -> None:
    tolerance = FILE.replace("speed: 0.5", "speed: 1.0").replace("angle: 3", "angle: 3, across: 0.15, along: 0.5")
    (tmp_path / "sources.yaml").write_text(tolerance)
    (tmp_path / "rules.yaml").write_text(RULES)
    import_bag(leaving_bag(tmp_path), tmp_path / "run.mcap", load_mapping(tmp_path / "sources.yaml"))
    session = Session(tmp_path / "run.mcap")
    history = read_history(session)
    (use,) = history.plans
    assert (use.object_id, use.count, use.times_left) == (1, 1, 1)
    assert use.left == [pytest.approx(1.2)]  # more than 0.15 m beside the path behind the bend
    assert main(["report", str(session.path), "-o", str(tmp_path / "run.html")]) == 0
    text = (tmp_path / "run.html").read_text()
    assert "1 of 1 objects with plans left theirs" in text and "<h2>Plans</h2>" in text
    assert '<td><bdi>robot</bdi></td><td class="number">1</td><td class="number">1</td><td>1.200</td>' in text

    rules = Rules.given(str(tmp_path / "rules.yaml"))
    judged = read_history(session, rules=rules)
    assert [(round(time, 3), alert.level) for time, alert in judged.alerts] == [(1.4, 2)]
    assert judged.plans[0].left == use.left
    given = parse_expectations(
        {
            "expect": [
                {"alert": ["robot", "robot"], "rule": "off plan", "between": [1.3, 1.5]},
                {"no_alert": ["robot", "robot"]},
                {"no_alert": ["robot", "post"]},
            ]
        }
    )
    assert [each.holds for each in evaluate_expectations(given, judged, lambda: "")] == [True, False, True]

    steps = RecordedSteps(session, AS_RECORDED)
    moments = [steps.moment(frame) for frame in (5, 20)]
    assert [set(moment.plans) for moment in moments] == [{1}, set()]
    assert [moment.left_plans for moment in moments] == [frozenset(), {1}]
    recorded = RecordedSteps(session)
    for frame in range(len(steps)):
        assert steps.moment(frame).predictions.tobytes() == recorded.moment(frame).predictions.tobytes()
