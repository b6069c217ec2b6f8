"""Objects that were stale: their bounds are as wide as their silence was long, and narrow again when they report."""

from __future__ import annotations

from collections.abc import Collection

import pytest

from collision_monitor.geometry.shapes import Sphere
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.records import PredictionStatus
from collision_monitor.settings.profile import Profile

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
