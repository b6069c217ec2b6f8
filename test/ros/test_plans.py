"""Plans over DDS: a planner in one process, the monitor in another, and the replay of its recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from collision_monitor import records
from collision_monitor.codec import ObjectTrajectory, encode_trajectories
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import message_class, quality_of
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere


def state(position: tuple[float, float, float], linear: tuple[float, float, float]) -> Any:
    row = np.zeros((), records.STATE)
    row["id"], row["position"], row["linear"], row["quaternion"] = 1, position, linear, (0, 0, 0, 1)
    return row


def trajectory(points: list[tuple[float, float, float]], times: list[float], object_id: int = 1) -> ObjectTrajectory:
    poses = np.array([[*point, 0, 0, 0, 1] for point in points], float).reshape(-1, 7)
    tolerance = np.array([0.1, 2.0, 0.1, 2.0])  # m along it and s: the states come when a busy machine sends them
    return ObjectTrajectory(np.array(times, float), poses, np.zeros((0, 6)), tolerance, object_id)


def test_a_robot_whose_plan_turns_into_a_post_is_predicted_to_meet_it(start: Any, team: Any, tmp_path: Path) -> None:
    path = tmp_path / "plans.mcap"
    monitor = start("run", "--record", str(path))
    team.meet()
    plans = team.node.create_publisher(
        message_class(Topic.TRAJECTORIES.type_name), Topic.TRAJECTORIES.of(), quality_of(Topic.TRAJECTORIES)
    )
    team.until(lambda: plans.get_subscription_count() == 1)
    post = ObjectDescription(2, Sphere(0.2), name="post", static=True, pose=Pose((1, 1.2, 0)))
    team.describe(ObjectDescription(1, Sphere(0.2), name="robot"), post)
    team.status(lambda s: s.objects == 2)
    _, predictions = team.ask(state((0, 0, 0), (1, 0, 0)))
    assert not predictions.predictions
    stamp = predictions.header.stamp.sec * 10**9 + predictions.header.stamp.nanosec

    turn = trajectory([(0, 0, 0), (1, 0, 0), (1, 2, 0)], [0, 1, 3])
    bad = trajectory([(0, 0, 0), (1, 0, 0)], [0, -1], object_id=1)
    plans.publish(encode_trajectories(stamp, "world", [turn]))
    plans.publish(encode_trajectories(stamp, "world", [bad, trajectory([(0, 0, 0)] * 2, [0, 1], 7)]))
    status = team.status(lambda s: s.refused_malformed == 1 and s.refused_unknown_id == 1)
    assert "object 7" in status.last_refusal
    _, predictions = team.ask(state((0.02, 0, 0), (1, 0, 0)))
    (impact,) = predictions.predictions
    assert (impact.id_a, impact.id_b) == (1, 2)
    assert impact.lower <= 1.8 and impact.upper > 1.7

    plans.publish(encode_trajectories(stamp, "world", [trajectory([], [])]))
    team.until(lambda: not team.ask(state((0.03, 0, 0), (1, 0, 0)))[1].predictions)
    assert monitor.stop() == 0
    report = replay(Session(path))
    assert report.verdict is Verdict.IDENTICAL, report
    assert "expected rising ones" in monitor.words
    assert "Traceback" not in monitor.words
