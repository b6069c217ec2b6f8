"""Pairs that are left out because they are far, and pairs that surely meet, against samples followed exactly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.monitor.uncertain_predictions import ENTRY, sigmas_for
from collision_monitor.records import STATE
from collision_monitor.settings.profile import Profile
from collision_monitor.uncertainty.near_pairs import NearPairRange, find_near
from collision_monitor.uncertainty.sampled_impacts import Sampling, impact_probabilities
from collision_monitor.uncertainty.samples.error_samples import make_workspace
from collision_monitor.uncertainty.samples.normal_samples import normal_samples
from collision_monitor.world import make_scene


def left_out(monitor: cm.Monitor, pairs: NDArray[np.int32]) -> NDArray[np.float64]:
    """Probabilities of at most 300 of the pairs (P, 2) of slots that are left out because they are far."""
    p, roster, spread = Profile(), monitor.roster, monitor._uncertain.spread
    entries, found = np.zeros(len(pairs), ENTRY), np.empty(len(pairs), np.int64)
    entries["i"], entries["j"] = pairs.T
    nearness = NearPairRange(sigmas_for(p.min_probability), p.contact_margin, p.horizon, p.stale_acceleration)
    count = find_near(roster.multibody, spread, entries, 0.0, nearness, found)
    far = np.setdiff1d(np.arange(len(pairs)), found[:count])
    assert 0 < count < len(pairs)
    some = pairs[np.random.default_rng(0).choice(far, min(len(far), 300), replace=False)]
    sampling = Sampling(
        monitor._settings.impact, p.horizon, p.stale_acceleration, True, 0.0, 0.0, 0.0, p.confidence, roster.planar,
        *normal_samples(128),
    )  # fmt: skip
    answers = np.empty((len(some), 4))
    impact_probabilities(roster.multibody, spread, some, 0.0, sampling, make_workspace(), answers)
    return np.nan_to_num(answers[:, 3])


@pytest.mark.parametrize(("name", "noise"), [("fleet", 0.03), ("swarm", 0.05)])
def test_pairs_that_are_left_out_meet_too_rarely(name: str, noise: float) -> None:
    scene, monitor = make_scene(name, objects=60, noise=noise, seed=2), cm.Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
    monitor.step(0, scene.states())
    pairs = np.stack(np.triu_indices(monitor.roster.top, 1), axis=1).astype(np.int32)
    assert left_out(monitor, pairs).max() < Profile().min_probability


def test_a_face_of_a_turned_wall_leaves_out_only_balls_that_stay_beside_it() -> None:
    rng, monitor = np.random.default_rng(4), cm.Monitor()
    q = np.array([0.2, -0.5, 0.3, 0.8])
    monitor.add(0, cm.Box((8.0, 6.0, 0.4)), static=True, pose=cm.Pose((0, 0, 0), tuple(q / np.linalg.norm(q))))
    rows = np.zeros(300, STATE)
    rows["id"], rows["quaternion"][:, 3] = np.arange(1, 301), 1.0
    rows["position"], rows["linear"] = rng.uniform(-4, 4, (300, 3)), rng.normal(0, 0.7, (300, 3))
    rows["position_stddev"] = rows["velocity_stddev"] = 0.05
    for k in range(1, 301):
        monitor.add(k, cm.Sphere(0.2))
    monitor.step(0, rows)
    probabilities = left_out(monitor, np.stack([np.zeros(300), np.arange(1, 301)], axis=1).astype(np.int32))
    assert len(probabilities) > 50  # the sphere of the wall holds nearly all of the balls
    assert probabilities.max() < Profile().min_probability


def meeting(offset: float, sigma: float) -> np.void:
    """Prediction of two boxes of 1 m that approach each other, off by `offset` (m) sideways."""
    monitor = cm.Monitor()
    for k in range(2):
        monitor.add(k, cm.Box((1, 1, 1)))
    rows = np.zeros(2, STATE)
    rows["id"], rows["quaternion"][:, 3] = (0, 1), 1.0
    rows["position"][1], rows["linear"][1] = (3.0, offset, 0.1), (-1.5, 0, 0)
    rows["position_stddev"] = sigma / np.sqrt(2.0)
    result = monitor.step(0, rows)
    assert (result.samples == 128) == (offset < 1.0 - 5 * sigma)
    return result.predictions[0]


@pytest.mark.parametrize("offset", [0.0, 0.5, 0.85, 0.95])
def test_a_pair_that_surely_meets_has_the_times_of_the_normal_distribution(offset: float) -> None:
    """The faces meet at 2 m / 1.5 m/s; the error of that time is sigma / 1.5 m/s."""
    sigma = 0.02
    reported = meeting(offset, sigma)
    certain = offset < 0.9
    assert reported["probability"] == pytest.approx(1.0 if certain else 0.994, abs=1e-9 if certain else 0.005)
    if certain:
        spread, middle = sigma / 1.5, 2.0 / 1.5
        assert middle - 2.4 * spread < reported["earliest"] < middle - 1.645 * spread
        assert middle + 1.645 * spread < reported["latest"] < middle + 2.4 * spread
        assert reported["most_likely"] == pytest.approx(middle, abs=0.2 * spread)
