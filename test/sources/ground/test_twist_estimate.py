"""Estimated twists equal least squares over all poses of the window, at any rate; stated ones turn with their body."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fed import Fed, in_world
from foreign_bag import SECOND, START, odometry, pose_stamped
from foreign_messages import track, tracked_objects
from scipy.spatial.transform import Rotation

SPHERE = {"sphere": 1.0}


@pytest.mark.parametrize("rate", [10, 30, 100, 400])
def test_the_velocity_is_the_slope_through_all_poses_of_the_window(rate: int) -> None:
    rng = np.random.default_rng(rate)
    window, sigma, period = 0.5, 0.02, SECOND // rate
    ours, exact, stated, times, places = [], [], [], [], []
    fed = Fed({"it": {"topic": "/p", "shape": SPHERE, "estimate_over": window, "position_stddev": sigma}})
    for number in range(1, 31):  # windows that share no pose
        while len(times) <= number * (round(window * rate) + 2):
            t = len(times) * period / SECOND
            p = np.array([1.5 * t, -0.5 * t, 0.2]) + rng.normal(0, sigma, 3)
            fed.give("/p", START, pose_stamped("map", START + len(times) * period, p))
            times.append(t)
            places.append(p)
        row = fed.rows[-1]
        used = np.array(times) >= times[-1] - window - 1e-9
        ours.append(row["linear"] - (1.5, -0.5, 0))
        exact.append(np.polyfit(np.array(times)[used], np.array(places)[used], 1)[0] - (1.5, -0.5, 0))
        stated.append(row["velocity_stddev"])
    assert np.std(ours) <= 1.08 * np.std(exact)
    assert np.std(ours) == pytest.approx(np.mean(stated), rel=0.25)


def test_a_turn_is_estimated_over_the_window_at_a_high_rate() -> None:
    fed = Fed({"it": {"topic": "/p", "shape": SPHERE, "estimate_over": 0.5}})
    for k in range(300):
        t = k / 200
        q = Rotation.from_rotvec((0.1 * t, 0, 0.8 * t)).as_quat()
        fed.give("/p", START, pose_stamped("map", START + k * SECOND // 200, (0, 0, 0), q))
    np.testing.assert_allclose(fed.rows[-1]["angular"], (0.1, 0, 0.8), atol=1e-3)
    assert fed.rows[-1]["flags"] == 0


def test_a_gap_and_a_return_leave_old_poses_out() -> None:
    fed = Fed({"it": {"topic": "/p", "shape": SPHERE, "estimate_over": 0.5}})
    for k in range(40):
        fed.give("/p", START, pose_stamped("map", START + k * SECOND // 100, (k * 0.01, 0, 0)))
    for k in range(3):
        fed.give("/p", START, pose_stamped("map", START + 5 * SECOND + k * SECOND // 100, (9 - k * 0.02, 0, 0)))
    np.testing.assert_allclose(fed.rows[-1]["linear"], (-2, 0, 0), atol=1e-9)


@pytest.mark.parametrize("kind", ["odometry", "track"])
def test_a_velocity_along_the_axes_of_the_body_turns_with_it_to_the_step(kind: str) -> None:
    """A car drives a circle at 2 m/s and 0.8 rad/s; its messages come every 0.1 s, between two steps."""
    fed = Fed({"car": {"topic": "/car", **({"shape": SPHERE} if kind == "odometry" else {})}}, rate=10)
    speed, turn = 2.0, 0.8
    for k in range(20):
        t = 0.1 * k + 0.04
        stamp = START + round(t * SECOND)
        q = (0, 0, math.sin(turn * t / 2), math.cos(turn * t / 2))
        p = (speed / turn * math.sin(turn * t), speed / turn * (1 - math.cos(turn * t)), 0)
        message = odometry("map", stamp, p, q, (speed, 0, 0), (0, 0, turn))
        if kind == "track":
            message = tracked_objects("map", stamp, track(1, p, q, (speed, 0, 0), (0, 0, turn)))
        fed.give("/car", stamp, message)
    assert len(fed.steps) >= 18
    for step in fed.steps[1:]:
        t = (step.stamp_ns - START) / SECOND
        (row,) = in_world(step.states)
        radius = speed / turn
        np.testing.assert_allclose(
            row["position"], (radius * np.sin(turn * t), radius * (1 - np.cos(turn * t)), 0), atol=1e-9
        )
        tangent = np.array([math.cos(turn * t), math.sin(turn * t), 0])
        np.testing.assert_allclose(row["linear"], speed * tangent, atol=1e-9)
        x_axis = Rotation.from_quat(row["quaternion"]).as_matrix()[:, 0]
        np.testing.assert_allclose(x_axis, tangent, atol=1e-9)
