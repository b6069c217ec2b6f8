"""A prediction that is older than what it predicts is not certain, live and in a replay."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor import codec, records
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.settings_event import NOW, encode_settings
from collision_monitor.records import PredictionStatus
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere

IMPACT = 1.0
"""s: two balls of 0.5 m, 2 m apart, at 1 m/s."""


def balls() -> list[ObjectDescription]:
    ball = ((Sphere(0.5), Pose()),)
    return [ObjectDescription(1, ball, static=True, pose=Pose()), ObjectDescription(2, ball)]


def state(x: float) -> np.ndarray:
    row = np.zeros(1, records.STATE)
    row["id"], row["position"][:, 0], row["quaternion"][:, 3], row["linear"][:, 0] = 2, x, 1.0, -1.0
    return row


@pytest.mark.parametrize(
    ("now", "status"),
    [
        (None, PredictionStatus.HIT),
        (0.9, PredictionStatus.HIT),
        (1.1, PredictionStatus.UNRESOLVED),
        (-5.0, PredictionStatus.HIT),  # the clock of the stamps is ahead
        (1e6, PredictionStatus.HIT),  # another clock
    ],
)
def test_only_what_has_begun_by_now_is_uncertain(now: float | None, status: PredictionStatus) -> None:
    monitor = Monitor()
    for each in balls():
        monitor.describe(each)
    result = monitor.step(10**12, state(2.0), now_ns=None if now is None else 10**12 + round(1e9 * now))
    assert result.predictions["status"].tolist() == [status]
    assert result.predictions["upper"][0] == pytest.approx(IMPACT, abs=5e-3)
    assert result.overtaken == (status is PredictionStatus.UNRESOLVED) == result.status.unresolved


def test_a_replay_has_the_same_answers() -> None:
    shapes = codec.encode_descriptions(0, "world", balls())
    live, again = Pipeline(), Pipeline(timed=False)
    events = 0
    for each in (live, again):
        each.on_shapes(shapes)
    for k, delay in enumerate((0.0, 1.5, 0.0, 0.5)):
        stamp = k * 10**8
        data = codec.encode_states(stamp, "world", 0, state(2.0 - 0.1 * k))
        outputs = live.on_states(data, stamp + round(1e9 * delay))
        assert outputs is not None
        if outputs.settings is not None:
            events += 1
            again.on_settings(outputs.settings)
        replayed = again.on_states(data)
        assert replayed is not None
        assert (replayed.predictions, replayed.digest) == (outputs.predictions, outputs.digest)
    assert events == 1
    assert live.monitor.last is not None
    assert live.monitor.last.predictions["status"].tolist() == [PredictionStatus.HIT]


@pytest.mark.parametrize("value", ["soon", 1.5])
def test_a_recorded_time_that_is_none_is_refused(value: object) -> None:
    pipeline = Pipeline()
    pipeline.on_settings(encode_settings(0, "", {NOW: value}))
    assert "now_ns: expected a time in ns" in pipeline.monitor.last_refusal
