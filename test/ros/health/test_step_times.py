import math

import pytest

from collision_monitor.ros.health.step_times import StepTimes

MS = 1_000_000


def test_nothing_is_known_before_the_first_step():
    summary = StepTimes(10.0).summary(0)
    assert summary["rate"] == 0.0
    assert all(math.isnan(summary[name]) for name in ("step_duration", "step_duration_p99", "latency"))


def test_duration_rate_and_latency_of_a_steady_stream():
    times = StepTimes(10.0)
    for step in range(2000):
        duration = 9 * MS if step % 50 == 0 else 2 * MS
        times.add(step * 10 * MS, step * 10 * MS + duration, 3 * MS)
    summary = times.summary(2000 * 10 * MS)
    assert summary["step_duration"] == pytest.approx(2e-3)
    assert summary["step_duration_p99"] == pytest.approx(9e-3)
    assert summary["latency"] == pytest.approx(3e-3)
    assert summary["rate"] == pytest.approx(100, abs=1)


def test_the_longest_step_stays_known():
    times = StepTimes(10.0)
    assert str(times) == "no step"
    for step in range(3000):
        times.add(step * 10 * MS, step * 10 * MS + (90 if step in (12, 500) else 2) * MS, MS)
    assert (times.longest, times.longest_step) == (pytest.approx(0.09), 13)
    assert str(times) == "3000 steps, the longest took 90.0 ms (step 13)"


def test_the_rate_goes_to_zero_when_nothing_comes():
    times = StepTimes(10.0)
    times.add(0, MS, MS)
    assert times.summary(2_000 * MS)["rate"] == 0.0


@pytest.mark.parametrize(
    ("latency", "agrees"), [(0, True), (9_000 * MS, True), (-20 * MS, False), (11_000 * MS, False)]
)
def test_clocks_that_do_not_agree_give_no_latency(latency, agrees):
    times = StepTimes(10.0)
    times.add(0, MS, latency)
    assert math.isnan(times.summary(MS)["latency"]) is not agrees
