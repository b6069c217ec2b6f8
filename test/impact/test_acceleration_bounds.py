"""Declared acceleration bounds widen the interval of an impact: against formulas and simulated drivers."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.records import STATE, PredictionStatus, StateFlag
from collision_monitor.settings.profile import Profile

SECOND = 1_000_000_000
HORIZON = 2.0


def head_on(speed: float, gap: float, uncertain: bool = True, **bounds: float) -> np.void:
    """Prediction of a ball that moves towards a standing ball."""
    monitor = cm.Monitor(Profile.named("balanced").replace(horizon=HORIZON, uncertainty=uncertain))
    monitor.add(0, cm.Sphere(0.5), **bounds)
    monitor.add(1, cm.Sphere(0.5))
    poses = [[0, 0, 0, 0, 0, 0, 1], [1.0 + gap, 0, 0, 0, 0, 0, 1]]
    (prediction,) = monitor.step(0, [0, 1], poses, [[speed, 0, 0, 0, 0, 0], [0] * 6]).predictions
    return prediction


@pytest.mark.parametrize("uncertain", [True, False])
@pytest.mark.parametrize(("speed", "gap", "bound"), [(2.0, 2.0, 0.5), (1.0, 1.5, 1.0), (5.0, 1.0, 3.0)])
def test_the_ends_are_those_of_accelerating_and_of_braking(
    speed: float, gap: float, bound: float, uncertain: bool
) -> None:
    reported = head_on(speed, gap, uncertain, max_linear_acceleration=bound)
    accelerating = (sqrt(speed**2 + 2 * bound * gap) - speed) / bound
    assert reported["lower"] <= accelerating
    assert reported["lower"] == pytest.approx(accelerating, rel=0.02)
    if speed**2 > 2 * bound * gap:
        braking = (speed - sqrt(speed**2 - 2 * bound * gap)) / bound
        assert braking <= reported["upper"] <= braking + HORIZON / 12
        assert reported["status"] == PredictionStatus.HIT
    else:
        assert reported["upper"] == inf
        assert reported["status"] == PredictionStatus.UNRESOLVED
    assert np.isfinite(reported["probability"]) == uncertain


def test_turning_harder_reaches_sooner() -> None:
    """A rod turns about its middle towards a ball beside its end."""
    lowers = []
    for bound in (0.0, 1.0):
        monitor = cm.Monitor()
        monitor.add(0, cm.Capsule(0.05, 4.0), max_angular_acceleration=bound)
        monitor.add(1, cm.Sphere(0.1))
        poses = [[0, 0, 0, 0, 0, 0, 1], [1.0, 0, 1.7, 0, 0, 0, 1]]
        twists = [[0, 0, 0, 0, 0.5, 0], [0] * 6]
        (reported,) = monitor.step(0, [0, 1], poses, twists).predictions
        lowers.append(float(reported["lower"]))
    turned = 0.5 * lowers[0]  # rad, until it meets the ball
    assert lowers[1] <= (sqrt(0.5**2 + 2 * turned) - 0.5) / 1.0  # with the declared acceleration in the same sense
    assert lowers[1] > 0.3 * lowers[0]


def test_no_driver_within_the_bounds_touches_before_the_lower_end() -> None:
    """Balls choose a new acceleration within their bounds every 50 ms; small steps follow them."""
    rng = np.random.default_rng(3)
    drivers, dt, radius = 500, 0.01, 0.5
    reported = 0
    for _ in range(12):
        bound = rng.uniform(0.2, 3.0)
        velocity = rng.normal(0, 1, 3) * 1.5
        start = -velocity * rng.uniform(0.8, 1.6) + rng.normal(0, 0.3, 3)
        if np.linalg.norm(start) < 2.5 * radius:
            continue
        monitor = cm.Monitor()
        monitor.add(0, cm.Sphere(radius))
        monitor.add(1, cm.Sphere(radius), max_linear_acceleration=bound)
        poses = [[0, 0, 0, 0, 0, 0, 1], [*start, 0, 0, 0, 1]]
        found = monitor.step(0, [0, 1], poses, [[0] * 6, [*velocity, 0, 0, 0]]).predictions
        if not len(found) or found["status"][0] == PredictionStatus.POSSIBLE:
            continue
        reported += 1
        p, v, a = np.tile(start, (drivers, 1)), np.tile(velocity, (drivers, 1)), np.zeros((drivers, 3))
        for step in range(int(found["lower"][0] / dt)):
            if step % 5 == 0:  # half of them towards the other ball, half in random directions
                a = -p + rng.normal(0, 1, p.shape) * (np.arange(drivers) % 2)[:, None]
                a *= bound / np.linalg.norm(a, axis=1, keepdims=True)
            p += v * dt + 0.5 * a * dt * dt
            v += a * dt
            assert np.linalg.norm(p, axis=1).min() > 2 * radius
    assert reported >= 5


def test_a_twist_estimated_from_poses_has_the_error_of_their_difference() -> None:
    sigma, dt = 0.02, 0.1
    monitor = cm.Monitor()
    for object_id in (0, 1):
        monitor.add(object_id, cm.Sphere(0.5))
    rows = np.zeros(2, STATE)
    rows["id"], rows["quaternion"] = (0, 1), (0, 0, 0, 1)
    rows["position"][1] = 4.0, 0.0, 0.0
    rows["flags"][1] = StateFlag.TWIST_UNKNOWN
    rows["position_stddev"][1] = sigma
    rows["velocity_stddev"] = np.nan
    assert len(monitor.step(0, rows).predictions) == 0
    rows["position"][1] = 3.8, 0.0, 0.0
    (reported,) = monitor.step(int(dt * SECOND), rows).predictions
    assert reported["upper"] == pytest.approx(1.4, abs=0.01)  # 2.8 m at 2 m/s
    rng = np.random.default_rng(1)
    p = np.array([3.8, 0, 0]) + rng.normal(0, sigma, (50_000, 3))
    v = np.array([-2.0, 0, 0]) + rng.normal(0, sqrt(2) * sigma / dt, (50_000, 3))
    t = np.clip(-(p * v).sum(1) / (v * v).sum(1), 0, HORIZON)  # nearest
    assert reported["probability"] == pytest.approx((np.linalg.norm(p + v * t[:, None], axis=1) < 1.0).mean(), abs=0.02)


@pytest.mark.parametrize("min_probability", [0.3, 0.01])
def test_every_pair_that_the_bounds_allow_to_meet_is_reported(min_probability: float) -> None:
    """Two bodies that both accelerate as hard as they may, in the worst directions, for the whole horizon."""
    rng = np.random.default_rng(21)
    profile = Profile(horizon=4.0, min_probability=min_probability)
    met = improbable = 0
    for _ in range(120):
        bound = rng.uniform(0.2, 1.5)
        shapes = cm.Box((0.8, 0.5, 0.4)), cm.Capsule(0.2, 0.6)
        p, v = np.array([rng.normal(size=3) * 6.0, np.zeros(3)]), rng.normal(size=(2, 3))
        monitor = cm.Monitor(profile)
        rows = np.zeros(2, STATE)
        rows["id"], rows["position"], rows["linear"], rows["quaternion"] = (1, 2), p, v, (0, 0, 0, 1)
        for k in range(2):
            monitor.add(k + 1, shapes[k], max_linear_acceleration=bound)
        predictions = monitor.step(1_000_000_000, rows).predictions
        aim = p[1] - p[0] + (v[1] - v[0]) * rng.uniform(1.0, 4.0)  # towards where the other one passes
        push = bound * aim / np.linalg.norm(aim)
        motions = [cm.Motion(cm.Pose(p[k]), v[k], (0, 0, 0), (push, -push)[k]) for k in range(2)]
        true = cm.time_of_impact(shapes[0], motions[0], shapes[1], motions[1], horizon=4.0)
        if true.status == "hit" and true.lower > 0.0:
            met += 1
            assert len(predictions) == 1
            assert predictions["lower"][0] <= true.upper
            improbable += np.isnan(predictions["probability"][0])
        if len(predictions) and np.isnan(predictions["probability"][0]):
            assert predictions["status"][0] == PredictionStatus.POSSIBLE
    assert met > 20
    assert improbable > 0 or min_probability < 0.1
