"""Probabilities within a budget: the soonest pairs first, and a pair that is left out is UNRESOLVED, never absent."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.records import STATE, Method, PredictionStatus
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.registry import Box, Cylinder

PEOPLE = 60
WHOLE = Profile()
LIMITS = (1, 4, 9, 20, 1000)

Predictions = dict[tuple[int, int], Any]


def hall(step: int) -> np.ndarray[Any, Any]:
    """States of people that cross a hall of 15 m, all uncertain."""
    random = np.random.default_rng(5)
    rows = np.zeros(PEOPLE, STATE)
    rows["id"], rows["quaternion"][:, 3] = np.arange(PEOPLE), 1.0
    rows["position"][:, :2], rows["linear"][:, :2] = random.uniform(0, 15, (PEOPLE, 2)), random.normal(size=(PEOPLE, 2))
    rows["position"] += 0.05 * step * rows["linear"]
    rows["position_stddev"], rows["velocity_stddev"] = 0.05, 0.15
    return rows


def predictions(profile: Profile, steps: int = 1) -> list[Predictions]:
    monitor = Monitor(profile, timed=False)
    for k in range(PEOPLE):
        monitor.add(k, Cylinder(0.25, 1.75) if k % 3 else Box((0.6, 0.4, 1.7)))
    results = [monitor.step(step * 50_000_000, hall(step)) for step in range(steps)]
    return [{(int(p["id_a"]), int(p["id_b"])): p for p in result.predictions} for result in results]


def examined(limit: int) -> Predictions:
    return predictions(WHOLE.replace(pairs_per_step=limit))[0]


def test_no_pair_is_absent_or_clear() -> None:
    whole = predictions(WHOLE)[0]
    assert sum(p["status"] == PredictionStatus.POSSIBLE for p in whole.values()) > 10
    for limit in LIMITS:
        limited = examined(limit)
        assert limited.keys() >= whole.keys()
        for pair, p in limited.items():
            if np.isnan(p["probability"]):
                assert p["status"] == PredictionStatus.UNRESOLVED
            else:
                assert p["probability"] == pytest.approx(whole[pair]["probability"], abs=0.03)
                assert p["lower"] <= p["upper"]


def test_what_is_left_out_begins_no_later_than_it_may() -> None:
    whole = predictions(WHOLE)[0]
    for pair, p in examined(1).items():
        is_stated = not np.isnan(p["closing_speed"])  # else it is stated to pass
        if p["method"] == Method.BOUND and not is_stated and pair in whole:
            assert p["lower"] <= whole[pair]["earliest"] + 1e-9
            assert p["upper"] == np.inf


def test_a_larger_budget_leaves_out_fewer() -> None:
    unknown = [sum(np.isnan(p["probability"]) for p in examined(limit).values()) for limit in LIMITS]
    assert unknown == sorted(unknown, reverse=True)
    assert unknown[0] > 30
    assert unknown[-1] == 0


def test_a_budget_that_suffices_changes_no_answer() -> None:
    for one, other in zip(predictions(WHOLE, 4), predictions(WHOLE.replace(pairs_per_step=10_000), 4), strict=True):
        assert one.keys() == other.keys()
        for pair, p in one.items():
            assert p.tobytes() == other[pair].tobytes()


def test_the_soonest_are_done_first() -> None:
    limited = predictions(WHOLE.replace(pairs_per_step=400), 1)[0]
    stated = [p for p in limited.values() if p["method"] not in (Method.BOUND, Method.SAMPLING)]
    done = [float(p["lower"]) for p in stated if not np.isnan(p["probability"])]
    left = [float(p["lower"]) for p in stated if np.isnan(p["probability"])]
    assert done
    assert not left or max(done) <= min(left)


def test_the_number_of_pairs_of_a_timed_step_repeats_it() -> None:
    """A replay gives a step the number of pairs that the clock let it examine, and gets the same bytes."""
    live = Monitor(WHOLE.replace(budget_ms=0.05))
    again = Monitor(WHOLE.replace(budget_ms=0.05), timed=False)
    for monitor in (live, again):
        for k in range(PEOPLE):
            monitor.add(k, Cylinder(0.25, 1.75))
    cuts = []
    for step in range(6):
        reported = live.step(step * 50_000_000, hall(step))
        cuts.append(reported.cut)
        again.profile = again.profile.replace(pairs_per_step=reported.cut or 1_000_000_000)
        assert again.step(step * 50_000_000, hall(step)).predictions.tobytes() == reported.predictions.tobytes()
    assert any(cut is not None for cut in cuts)
    assert live.digest == again.digest
