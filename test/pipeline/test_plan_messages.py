"""ObjectTrajectoryArray: plans as messages, refused one by one, recorded and replayed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from session_scene import CONTACTS, NODE, PREDICTIONS, SHAPES, START, STATES, TYPES

from collision_monitor.codec import (
    ObjectTrajectory,
    decode_predictions,
    decode_trajectories,
    encode_descriptions,
    encode_states,
    encode_trajectories,
)
from collision_monitor.errors import MessageError, Refusal
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.plan_intake import trajectory_of
from collision_monitor.records import STATE
from collision_monitor.session import Recorder, Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere

PLANS = f"{NODE}/objects/trajectories"
STEP = 50_000_000
ZEROS = np.zeros(4)


def trajectory(points: list[tuple[float, float, float]], times: list[float], **fields: int) -> ObjectTrajectory:
    poses = np.array([[*point, 0, 0, 0, 1] for point in points], float)
    return ObjectTrajectory(np.array(times, float), poses, np.zeros((0, 6)), ZEROS, **{"object_id": 1, **fields})


TURN = trajectory([(0, 0, 0), (1, 0, 0), (1, 2, 0)], [0, 1, 3])


def states(k: int) -> bytes:
    t = k * STEP * 1e-9
    rows = np.zeros(1, STATE)
    rows["id"], rows["quaternion"][:, 3] = 1, 1.0
    rows["position"] = (min(t, 1.0), max(t - 1.0, 0.0), 0.0)
    rows["linear"] = (1, 0, 0) if t < 1.0 else (0, 1, 0)
    return encode_states(START + k * STEP, "world", k + 1, rows)


def pipeline() -> Pipeline:
    made = Pipeline("balanced")
    post = ObjectDescription(2, Sphere(0.2), name="post", static=True, pose=Pose((1, 1.2, 0)))
    made.on_shapes(encode_descriptions(START, "world", [ObjectDescription(1, Box((0.4, 0.4, 0.4))), post]))
    return made


def first(made: Pipeline, k: int) -> list[tuple[int, int, float]]:
    outputs = made.on_states(states(k))
    assert outputs is not None
    rows = decode_predictions(outputs.predictions).predictions
    return [(int(row["id_a"]), int(row["id_b"]), round(float(row["lower"]), 2)) for row in rows]


def test_a_message_lets_an_object_follow_its_plan_and_an_empty_one_ends_that() -> None:
    made = pipeline()
    made.on_trajectories(encode_trajectories(START, "world", [TURN]))
    assert first(made, 0) == [(1, 2, 1.8)]
    made.on_trajectories(encode_trajectories(START, "", [trajectory([], [])]))
    assert first(made, 1) == []
    made.on_trajectories(encode_trajectories(START, "world", [TURN]))
    assert first(made, 2) == [(1, 2, 1.7)]
    assert not any(made.refused.values())


def test_the_bytes_come_back() -> None:
    rates = np.eye(3, 6), np.ones((3, 6))
    curve = ObjectTrajectory(np.arange(3.0), np.eye(3, 7), rates[0], np.arange(4.0), 7, 2, 1, 0.5, rates[1])
    message = decode_trajectories(data := encode_trajectories(START, "map", [TURN, curve]))
    assert (message.stamp_ns, message.frame_id, len(message.trajectories)) == (START, "map", 2)
    assert encode_trajectories(message.stamp_ns, message.frame_id, message.trajectories) == data
    for cut in range(0, len(data) - 3):
        with pytest.raises(MessageError):
            decode_trajectories(data[:cut])


def test_a_curve_of_degree_5_is_followed_as_it_is_by_the_monitor_itself() -> None:
    times, poses = np.array([0.0, 2.0]), np.array([[0.0, 0, 0, 0, 0, 0, 1], [4.0, 0, 0, 0, 0, 0, 1]])
    still = np.zeros((2, 6))
    given = ObjectTrajectory(times, poses, still, ZEROS, 1, between=2, accelerations=still)
    found = trajectory_of(decode_trajectories(encode_trajectories(START, "world", [given])).trajectories[0])
    wanted = Trajectory(times, poses, still, accelerations=still[:, :3])
    assert (found.numbers == wanted.numbers).all() and (found.tubes == wanted.tubes).all()
    assert found.at(0.5).position[0] == pytest.approx(4.0 * (10 / 4**3 - 15 / 4**4 + 6 / 4**5), abs=1e-6)


@pytest.mark.parametrize(
    ("bad", "reason", "text"),
    [
        (replace(TURN, times=np.array([0.0, 2.0, 1.0])), Refusal.MALFORMED, "object 1: times: expected rising ones"),
        (replace(TURN, times=np.array([0.0, np.nan, 1.0])), Refusal.MALFORMED, "times: expected finite"),
        (replace(TURN, times=np.zeros(1), poses=TURN.poses[:1]), Refusal.MALFORMED, "times: expected 2 to"),
        (replace(TURN, poses=TURN.poses[:2]), Refusal.MALFORMED, r"poses: expected shape \(3, 7\)"),
        (replace(TURN, poses=0.0 * TURN.poses), Refusal.MALFORMED, "quaternions of unit length"),
        (replace(TURN, poses=1e30 * TURN.poses), Refusal.MALFORMED, "poses: expected finite numbers"),
        (replace(TURN, times=1e-9 * TURN.times), Refusal.MALFORMED, "at most 100000 m/s"),
        (replace(TURN, twists=np.full((3, 6), 1e18), between=2), Refusal.MALFORMED, "twists: expected finite"),
        (replace(TURN, twists=np.zeros((1, 6))), Refusal.MALFORMED, "twists: expected shape"),
        (replace(TURN, accelerations=np.zeros((3, 6))), Refusal.MALFORMED, "accelerations: expected a curve with"),
        (replace(TURN, between=2), Refusal.MALFORMED, "twists: expected linear velocities"),
        (replace(TURN, between=9), Refusal.MALFORMED, "between and then: expected"),
        (replace(TURN, then=9), Refusal.MALFORMED, "between and then: expected"),
        (replace(TURN, tolerance=np.full(4, -1.0)), Refusal.MALFORMED, "tolerance: expected finite numbers >= 0"),
        (replace(TURN, tolerance=np.full(4, np.nan)), Refusal.MALFORMED, "tolerance: expected finite numbers >= 0"),
        (replace(TURN, object_id=2), Refusal.MALFORMED, "object 2: expected an object that moves, got a static one"),
        (replace(TURN, object_id=3), Refusal.UNKNOWN_ID, "object 3: expected the id of an object that was described"),
        (replace(TURN, times=TURN.times - 9.0), Refusal.MALFORMED, "expected a plan that is not over"),
    ],
)
def test_a_bad_plan_alone_is_refused_and_the_object_goes_on(bad: ObjectTrajectory, reason: Refusal, text: str) -> None:
    made = pipeline()
    other = ObjectDescription(4, Sphere(0.1))
    made.on_shapes(encode_descriptions(START, "world", [other]))
    first(made, 0)
    good = trajectory([(50, 0, 0), (51, 0, 0)], [0, 9], object_id=4)
    made.on_trajectories(encode_trajectories(START, "world", [bad, good]))
    assert made.refused[reason] == 1 and sum(made.refused.values()) == 1
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(made.refusal_texts[reason])
    assert made.monitor.following == [4]
    assert first(made, 1) == []


def test_a_message_of_another_frame_or_type_is_refused() -> None:
    made = pipeline()
    made.on_trajectories(encode_trajectories(START, "odom", [TURN]))
    made.on_trajectories(states(0))
    made.on_trajectories(b"")
    assert made.refused[Refusal.FRAME] == 1 and made.refused[Refusal.MALFORMED] == 2
    assert made.monitor.following == []


def test_a_recorded_plan_is_replayed_to_the_same_bytes(tmp_path: Path) -> None:
    made = pipeline()
    path = tmp_path / "plans.mcap"
    recorder = Recorder(path, {**TYPES, PLANS: "ObjectTrajectoryArray"}, made.metadata(node=NODE), snapshots=True)
    now = START
    post = ObjectDescription(2, Sphere(0.2), name="post", static=True, pose=Pose((1, 1.2, 0)))
    shapes = encode_descriptions(START, "world", [ObjectDescription(1, Box((0.4, 0.4, 0.4))), post])
    made = Pipeline("balanced")
    made.on_shapes(shapes)
    recorder.write(SHAPES, shapes, now, now)
    predicted = 0
    for k in range(60):
        now += STEP
        if k in (5, 30):
            plan = encode_trajectories(START, "world", [TURN])
            made.on_trajectories(plan)
            recorder.write(PLANS, plan, now, now)
        data = states(k)
        outputs = made.on_states(data)
        assert outputs is not None
        recorder.write(STATES, data, now, now)
        recorder.write(CONTACTS, outputs.contacts, now, now)
        recorder.write(PREDICTIONS, outputs.predictions, now, now)
        predicted += len(decode_predictions(outputs.predictions).predictions)
        if k == 20:
            recorder.write_snapshot(made.snapshot())
    recorder.close()
    assert predicted > 30
    for start in (0.0, 1.5):
        report = replay(Session(path), start=start)
        assert report.verdict is Verdict.IDENTICAL, report
