"""Objects that were stale: their bounds are as wide as their silence was long, and narrow again when they report."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pytest

from collision_monitor.monitor.adaptive_tubes import AVERAGED_STEPS, REST
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.registry import Sphere
from collision_monitor.world import make_scene

FIRST, SECOND, OTHER = 1, 2, 3


class Road:
    """Two balls on one line, 1 m/s apart from meeting for a long time, and a ball of another publisher far away."""

    def __init__(self, profile: Profile) -> None:
        self.monitor = Monitor(profile)
        self.now = 0.0
        for object_id in (FIRST, SECOND, OTHER):
            self.monitor.add(object_id, Sphere(0.5))

    def step(self, elapsed: float, ids: Collection[int]) -> StepResult:
        self.now += elapsed
        x = {FIRST: self.now, SECOND: 20.0, OTHER: 1000.0}
        poses = [[x[object_id], 0, 0, 0, 0, 0, 1] for object_id in ids]
        twists = [[float(object_id == FIRST), 0, 0, 0, 0, 0] for object_id in ids]
        return self.monitor.step(round(self.now * 1e9), list(ids), poses, twists)


@pytest.mark.parametrize("silence", [0.6, 3.0, 9.0])
def test_a_pair_that_reports_again_after_a_silence_has_narrow_bounds_again(silence: float) -> None:
    road = Road(Profile())
    for _ in range(10):
        road.step(0.02, (FIRST, SECOND, OTHER))
    stale = road.step(silence, (OTHER,))
    assert stale.status.objects_stale == 2
    result = road.step(0.02, (FIRST, SECOND, OTHER))
    assert result.status.objects_stale == 0
    assert len(result.predictions) == 0, "they are 10 s apart"
    while road.now < 17.5:
        result = road.step(0.02, (FIRST, SECOND, OTHER))
    (prediction,) = result.predictions
    assert prediction["status"] == PredictionStatus.HIT
    assert prediction["lower"] == pytest.approx(19.0 - road.now, abs=0.01)


def test_a_publisher_that_is_slower_than_others_is_not_predicted_anew_at_each_state() -> None:
    """One object reports at 10 Hz, the other at 100 Hz: neither is ever stale, and both keep their predictions."""
    road = Road(Profile())
    ids = [(FIRST, OTHER) if step % 10 == 0 else (OTHER,) for step in range(300)]
    moved = [road.step(0.01, each).status.objects_moved for each in ids]
    assert sum(moved[50:]) < 10


def _moved_per_step(profile: Profile, noise: float) -> list[int]:
    scene = make_scene("fleet", objects=40, noise=noise)
    monitor = Monitor(profile)
    for description in scene.descriptions:
        monitor.describe(description)
    return [monitor.step(round(k * 2e7), scene.step(0.02)).status.objects_moved for k in range(60)]


def test_adaptive_tolerances_are_as_narrow_as_the_noise_allows() -> None:
    """With exact states predictions are as tight as without tolerance; with noise most objects keep theirs."""
    wide = Profile.named("fast")
    fixed = wide.replace(adaptive_tolerances=False)
    assert sum(_moved_per_step(wide, 0.005)[20:]) < 0.5 * 40 * 40
    scene = make_scene("clutter")
    unresolved = []
    for profile in (wide, fixed):
        monitor = Monitor(profile)
        for description in scene.descriptions:
            monitor.describe(description)
        predictions = monitor.step(0, scene.states()).predictions
        unresolved.append(np.count_nonzero(predictions["status"] == PredictionStatus.UNRESOLVED))
    assert unresolved[0] < 0.1 * unresolved[1]


def test_few_objects_keep_the_narrowest_tolerances() -> None:
    """Predicting some objects anew is faster than examining what wider tolerances leave open."""
    scene = make_scene("billiards")
    monitors = [Monitor(Profile.named(name).replace(uncertainty=False)) for name in ("fast", "exact")]
    for monitor in monitors:
        for description in scene.descriptions:
            monitor.describe(description)
    for k in range(60):
        states = scene.step(0.02)
        fast, exact = (monitor.step(round(k * 2e7), states.copy()).status for monitor in monitors)
        assert (fast.predictions, fast.unresolved) == (exact.predictions, exact.unresolved)


def test_a_scene_that_restarts_in_every_step_keeps_the_narrowest_tolerances_for_a_while() -> None:
    """While nearly all objects turn, wide tolerances save nothing; with noise alone they are tried again."""
    rng = np.random.default_rng(4)
    n, turns = 60, 4 * AVERAGED_STEPS
    monitor = Monitor("fast")
    for k in range(n):
        monitor.add(k, Sphere(0.3))
    position, velocity = rng.uniform(-8, 8, (n, 3)), rng.uniform(-0.5, 0.5, (n, 3))
    moved = []
    for step in range(turns + REST + 20):
        if step < turns:
            velocity = rng.uniform(-0.5, 0.5, (n, 3))
        poses = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (n, 1))
        poses[:, :3] = position + rng.uniform(-1e-3, 1e-3, (n, 3))
        result = monitor.step(round(step * 2e7), range(n), poses, np.hstack([velocity, np.zeros((n, 3))]))
        moved.append(result.status.objects_moved)
        position += velocity * 0.02
    assert set(moved[: turns + REST // 2]) == {n}
    assert np.mean(moved[-20:]) < 0.2 * n


def test_adaptive_tolerances_survive_a_snapshot() -> None:
    scene = make_scene("fleet", objects=40, noise=0.005)
    monitor = Monitor("fast")
    for description in scene.descriptions:
        monitor.describe(description)
    for k in range(30):
        monitor.step(round(k * 2e7), scene.step(0.02))
    again = Monitor.restored(monitor.profile, monitor.snapshot())
    for k in range(30, 40):
        states = scene.step(0.02)
        mine, theirs = (each.step(round(k * 2e7), states.copy()) for each in (monitor, again))
        assert mine.predictions.tobytes() == theirs.predictions.tobytes()
