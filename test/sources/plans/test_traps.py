"""What goes wrong with plans of other programs: the answers stay right, or go back to what the states say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, STORE, T, odometry, pose, transforms
from foreign_messages import AUTOWARE, decoder, predicted_objects, track
from foreign_plans import path, trajectory

from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.records import PlanFlag
from collision_monitor.sources import Feed, RawMessage
from collision_monitor.sources.ground.mapping import make_mapping

ROBOT = {"topic": "/odom", "shape": {"sphere": 0.3}}
POST = {"static": True, "shape": {"sphere": 0.2}, "pose": [2.0, 1.2, 0.0]}
BEND = [(0, 0, 0), (2, 0, 0), (2, 4, 0)]
STILL = (0, 0, 0, 1)


class Monitored:
    """Messages through the sources into a monitor. row: the last prediction of the robot and the post, or None."""

    def __init__(self, objects: Any = None, **top: Any) -> None:
        content = {"frame": "map", "rate": 10, "objects": objects or {"robot": ROBOT, "post": POST}, **top}
        self.feed, self.pipeline = Feed(make_mapping(content), decoder()), Pipeline("balanced", "map")
        self.row: Any = None
        self.left: list[int] = []
        self._bound: set[str] = set()
        self._take(self.feed.begin(0))

    def give(self, topic: str, received: int, message: tuple[str, Any]) -> None:
        kind, content = message
        if topic not in self._bound:
            self._bound.add(topic)
            self.feed.bind(topic, kind)
        self._take(self.feed.take(RawMessage(topic, kind, bytes(STORE.serialize_cdr(content, kind)), received)))

    def drive(self, k: int, x: float, speed: float = 1.0, y: float = 0.0) -> None:
        t = START + k * SECOND // 10
        self.give("/odom", t, odometry("map", t, (x, y, 0), STILL, (speed, 0, 0), (0, 0, 0)))

    def _take(self, inputs: Any) -> None:
        for each in inputs:
            if each.topic is Topic.STATES:
                outputs = self.pipeline.on_states(each.data)
                if outputs is not None:
                    rows = outputs.result.predictions
                    self.row = rows[0] if len(rows) else None
                    self.left += outputs.result.left
            elif each.topic is Topic.TRAJECTORIES:
                self.pipeline.on_trajectories(each.data)
            else:
                self.pipeline.on_shapes(each.data)

    @property
    def follows(self) -> bool:
        return self.pipeline.monitor.following == [1]


def on_path(**plan: Any) -> Monitored:
    return Monitored(plans={"robot": {"topic": "/plan", "speed": 1.0, "tolerance": {"angle": 2.0}, **plan}})


def meets_in(scene: Monitored, seconds: float, within: float = 0.12) -> None:
    """The prediction is on the plan, and due then."""
    assert scene.row is not None and scene.row["plans"] == PlanFlag.FOLLOWS_A
    assert scene.row["lower"] <= seconds <= min(scene.row["upper"], 9.0) + within
    assert scene.row["lower"] == pytest.approx(seconds, abs=within + 0.2)


def test_a_robot_that_is_on_its_way_when_the_plan_comes() -> None:
    scene = on_path()
    for k in range(10):
        scene.drive(k, 0.1 * k)
        if k == 8:
            scene.give("/plan", START + 8 * SECOND // 10, path(BEND, stamp=START + 8 * SECOND // 10))
    meets_in(scene, 0.1 * (20 - 9) + 0.7)


def test_a_plan_whose_start_is_elsewhere_is_left_at_once_and_the_states_say_what_follows() -> None:
    scene = on_path()
    scene.drive(0, 0.0)
    scene.give("/plan", START, path([(0, 3, 0), (2, 3, 0), (2, 0, 0)]))
    for k in range(1, 4):
        scene.drive(k, 0.1 * k)
    assert not scene.follows and scene.left == [1] and scene.row is None


def test_a_plan_that_is_older_than_the_state_counts_from_its_own_stamp() -> None:
    """The planner took 0.5 s; its path begins where the robot was."""
    scene = on_path()
    for k in range(8):
        scene.drive(k, 0.1 * k)
    scene.give("/plan", START + 7 * SECOND // 10 + 1, path([(0.2, 0, 0), *BEND[1:]], stamp=START + 2 * SECOND // 10))
    scene.drive(8, 0.8)
    meets_in(scene, 2.0 + 0.7 - 0.8)


def test_a_trajectory_that_is_over_is_refused_and_changes_nothing() -> None:
    scene = Monitored(plans={"robot": {"topic": "/plan"}})
    for k in range(60):
        scene.drive(k, 0.01 * k, 0.1)
    line = [(float(k), 0, 0) for k in range(4)]
    scene.give("/plan", START + 6 * SECOND, trajectory(line, [1, 1, 1, 0], [0.0, 0.5, 1.5, 3.0]))
    scene.drive(61, 0.61, 0.1)
    assert not scene.follows
    assert any("ended" in text for text in scene.pipeline.refusal_texts.values())


@pytest.mark.parametrize("speed", [0.6, 1.4])
def test_execution_that_is_scaled_in_time_keeps_its_path(speed: float) -> None:
    """The path has no times; a robot at another speed stays on it and its impact is predicted."""
    scene = on_path()
    scene.drive(0, 0.0, speed)
    scene.give("/plan", START, path(BEND))
    k = 0
    while speed * (k + 1) / 10 < 1.7:
        k += 1
        scene.drive(k, speed * k / 10, speed)
    assert scene.follows and scene.left == []
    assert scene.row is not None and scene.row["plans"] == PlanFlag.FOLLOWS_A


def test_execution_of_a_trajectory_with_times_that_is_scaled_leaves_it() -> None:
    scene = Monitored(plans={"robot": {"topic": "/plan"}})
    line = [(0.5 * k, 0, 0) for k in range(9)]
    scene.drive(0, 0.0)
    scene.give("/plan", START, trajectory(line, [1] * 9, [0.5 * k for k in range(9)]))
    for k in range(1, 20):
        scene.drive(k, 0.05 * k, 0.5)
    assert scene.left == [1] and not scene.follows


def test_a_jump_of_the_frame_leaves_the_plan_until_the_next_message() -> None:
    """Localisation moves odom by 1 m; the plan, in map, stays where it was."""
    robot = {**ROBOT}
    scene = Monitored(
        {"robot": robot, "post": POST},
        plans={"robot": {"topic": "/plan", "speed": 1.0, "tolerance": {"angle": 2.0}}},
    )
    for k in range(12):
        t, shift = START + k * SECOND // 10, 1.0 if k >= 6 else 0.0
        scene.give("/tf", t, transforms(t, ("map", "odom", (0, shift, 0), STILL)))
        scene.give("/odom", t, odometry("odom", t, (0.1 * k, 0, 0), STILL, (1, 0, 0), (0, 0, 0)))
        if k == 2:
            scene.give("/plan", t, path([(0.2, 0, 0), *BEND[1:]], frame="odom", stamp=t))
        if k == 5:
            assert scene.follows
        if k == 8:
            assert not scene.follows and scene.left == [1]
        if k == 9:
            scene.give("/plan", t, path([(0.9, 0, 0), *BEND[1:]], frame="odom", stamp=t))
    assert scene.follows


def test_a_gap_in_the_messages_keeps_the_plan_until_its_end() -> None:
    scene = on_path()
    scene.drive(0, 0.0)
    scene.give("/plan", START, path(BEND))
    for k in (1, 2, 8):  # 0.6 s without a message of the robot
        scene.drive(k, 0.1 * k)
    meets_in(scene, 2.0 + 0.7 - 0.8)


def test_predictions_by_a_clock_two_steps_off_are_left_and_the_track_goes_on_by_its_state() -> None:
    """Paths that begin 1 s late, at 5 m/s: 5 m ahead of the track."""
    scene = Monitored({"traffic": {"topic": "/t"}, "post": {**POST, "pose": [9.0, 0.0, 0.0]}})
    one = track(1, (0, 0, 0), linear=(5, 0, 0), label=1, predicted=True)
    duration = T["builtin_interfaces/msg/Duration"](0, 500_000_000)
    late = [pose((5.0 + 2.5 * k, 4.0 * k, 0)) for k in range(9)]
    one.kinematics.predicted_paths = [T[AUTOWARE + "PredictedPath"](late, duration, 1.0)]
    scene.give("/t", START, predicted_objects("map", START, one))
    assert scene.pipeline.monitor.off_plan == [2] or len(scene.left) == 1
    assert scene.row is not None and not scene.row["plans"] & (PlanFlag.FOLLOWS_A | PlanFlag.FOLLOWS_B)
    assert scene.row["lower"] == pytest.approx((9.0 - 0.2 - 2.0) / 5, abs=0.1)


def test_steps_of_a_path_on_a_grid_are_no_bends() -> None:
    """A staircase of 5 cm takes little longer than the straight way."""
    steps = [(0.05 * ((k + 1) // 2), 0.05 * (k // 2), 0) for k in range(200)]
    plan = {"topic": "/plan", "speed": 1.0, "lateral_acceleration": 0.5}
    given = Fed({"robot": ROBOT}, rate=10, plans={"robot": plan})
    given.give("/plan", START, path(steps))
    given.give("/odom", START, odometry("map", START, (0, 0, 0), STILL, (0, 0, 0), (0, 0, 0)))
    (message,) = given.plans
    length = float(np.linalg.norm(np.diff(np.array(steps), axis=0), axis=1).sum())
    assert message.trajectories[0].times[-1] == pytest.approx(length, rel=0.05)
