"""Plans on the page: ribbons, paths and poses of impact along them, and who left theirs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from collision_monitor.codec import encode_descriptions, encode_states, encode_trajectories
from collision_monitor.codec.trajectories import ObjectTrajectory
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import STATE
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere
from collision_monitor.view.moment import Moment
from collision_monitor.view.picture import Role, draw
from collision_monitor.view.state_text import object_html, state_html
from collision_monitor.view.topic_content import TopicContent

ROBOT = ObjectDescription(1, Sphere(0.4), name="robot")
POST = ObjectDescription(2, Sphere(0.2), name="post", static=True, pose=Pose((1, 1.5, 0)))
BEND = [(0, 0, 0), (1, 0, 0), (1, 3, 0)]


class Watched:
    """A pipeline, and the scene that gets its messages."""

    def __init__(self) -> None:
        self.pipeline, self.scene = Pipeline("exact"), TopicContent()
        self._both("on_shapes", "ObjectDescriptionArray", encode_descriptions(0, "world", [ROBOT, POST], snapshot=True))

    def _both(self, method: str, kind: str, data: bytes) -> Any:
        self.scene.take(kind, data)
        return getattr(self.pipeline, method)(data)

    def follow(self, points: Any, times: Any, stamp_ns: int = 0) -> None:
        poses = np.zeros((len(points), 7))
        poses[:, 6] = 1.0
        if len(points):
            poses[:, :3] = points
        plan = ObjectTrajectory(np.array(times, float), poses, np.zeros((0, 6)), np.zeros(4), 1)
        self._both("on_trajectories", "ObjectTrajectoryArray", encode_trajectories(stamp_ns, "world", [plan]))

    def step(self, time: float, position: Any, linear: Any) -> Moment:
        rows = np.zeros(1, STATE)
        rows["id"], rows["position"], rows["quaternion"], rows["linear"] = 1, position, (0, 0, 0, 1), linear
        outputs = self._both("on_states", "ObjectStateArray", encode_states(round(time * 1e9), "world", 0, rows))
        if outputs is not None:  # else the stamp was refused
            self.scene.take("ContactArray", outputs.contacts)
            self.scene.take("PredictedCollisionArray", outputs.predictions)
        return self.scene.moment()


def watched() -> Watched:
    found = Watched()
    found.follow(BEND, [0, 1, 4])
    return found


def test_the_ribbon_is_the_rest_of_the_plan_and_as_wide_as_the_object() -> None:
    moment = watched().step(0.5, (0.5, 0, 0), (1, 0, 0))
    vertices, faces = draw(moment).ribbons
    left, right = vertices[0::2], vertices[1::2]
    middle = (left + right) / 2
    assert middle[0] == pytest.approx([0.5, 0, 0]) and middle[-1] == pytest.approx([1, 3, 0])
    assert np.linalg.norm(left - right, axis=1) == pytest.approx(0.4 * 3**0.5)
    assert len(faces) == len(vertices) - 2 and faces.max() == len(vertices) - 1
    on_x, on_y = middle[:, 1] == 0, np.abs(middle[:, 0] - 1) < 1e-6
    assert (on_x | on_y).all()
    a, b, c = vertices[faces].swapaxes(0, 1)
    assert (np.cross(b - a, c - a)[:, 2] > 0).mean() > 0.95  # up, but where it folds at the corner


def test_the_collision_and_the_path_to_it_are_on_the_plan() -> None:
    """The state says straight on, past the post; the plan bends and meets it."""
    moment = watched().step(0.5, (0.5, 0, 0), (1, 0, 0))
    (row,) = moment.predictions
    picture = draw(moment)
    (batch,) = (each for (role, _), each in picture.batches.items() if role is Role.IMPACT)
    # on x = 1, 0.6 m before the centre of the post
    assert batch.position[0] == pytest.approx([1, 0.9, 0], abs=1e-3)
    assert picture.paths[-1, 1] == pytest.approx([1, 0.9, 0], abs=1e-3)
    assert row["lower"] == pytest.approx(0.5 + 0.9, abs=1e-3)


def test_a_plan_that_is_left_has_no_ribbon_and_the_texts_say_so() -> None:
    scene = watched()
    kept = scene.step(0.5, (0.5, 0, 0), (1, 0, 0))
    assert "follows its plan, which ends in 3.5 s" in object_html(kept, 1)
    assert "off their plans" not in state_html("", kept, [])
    left = scene.step(0.6, (0.6, 0.5, 0), (1, 0, 0))
    assert scene.pipeline.monitor.off_plan == [1] and left.left_plans == {1}
    assert not len(draw(left).ribbons[0])
    assert "has left its plan" in object_html(left, 1)
    assert "off their plans: robot" in state_html("", left, [])
    scene.follow([], [])
    assert "has left its plan" not in object_html(scene.step(0.7, (0.7, 0.5, 0), (1, 0, 0)), 1)


def test_a_plan_that_is_over_or_of_an_earlier_time_is_not_shown() -> None:
    scene = watched()
    assert scene.step(4.1, (1, 3, 0), (0, 0, 0)).plans
    assert not scene.step(4.3, (1, 3, 0), (0, 0, 0)).plans
    scene.follow(BEND, [0, 100, 400], stamp_ns=round(4.3e9))
    assert scene.step(44.3, (0.4, 0, 0), (0.01, 0, 0)).plans
    for time in (0.0, 0.05):  # the clock is set back, and a second stamp says so too
        scene.step(time, (0, 0, 0), (1, 0, 0))
    assert scene.pipeline.restarts == 1 and scene.pipeline.monitor.following == []
    assert not scene.scene.moment().plans


def test_a_kept_scene_does_not_change_with_a_later_one() -> None:
    scene = watched()
    scene.step(0.5, (0.5, 0, 0), (1, 0, 0))
    kept = scene.scene.copy()
    scene.step(0.6, (0.6, 0.5, 0), (1, 0, 0))
    assert kept.moment().plans and not scene.scene.moment().plans
