"""Candidates of bodies with a new or extended prediction: tests of all bodies, and both grids, find the same."""

from __future__ import annotations

from typing import Any

import pytest

from collision_monitor.monitor import candidates
from collision_monitor.monitor.candidates import Candidates
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.settings.profile import Profile
from collision_monitor.world import make_scene


@pytest.mark.parametrize("scene", ["clutter", "fleet"])
def test_both_grids_find_the_pairs_that_tests_of_all_bodies_find(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    both: list[tuple[int, int]] = []
    find = Candidates._partners

    def compare(self: Candidates, step: StepContext, which: Any) -> Any:
        monkeypatch.setattr(candidates, "MOST_TESTS", 10**9)
        tested = {tuple(sorted(pair)) for pair in find(self, step, which).tolist()}
        monkeypatch.setattr(candidates, "MOST_TESTS", -1)
        for most_queries, mostly_new in ((2.0, 0.5), (-1.0, 2.0), (-1.0, 0.0)):
            monkeypatch.setattr(candidates, "MOST_QUERIES", most_queries)
            monkeypatch.setattr(candidates, "MOSTLY_NEW", mostly_new)
            swept = find(self, step, which)
            assert {tuple(sorted(pair)) for pair in swept.tolist()} == tested
            assert len(swept) == len(tested)
        both.append((len(which), len(swept)))
        return swept

    monkeypatch.setattr(Candidates, "_partners", compare)
    played = make_scene(scene)
    monitor = Monitor(Profile(horizon=1.0))
    for description in played.descriptions:
        monitor.describe(description)
    for step in range(120):
        monitor.step(step * 20_000_000, played.states())
        played.step(0.02)
    some = [(bodies, pairs) for bodies, pairs in both if bodies < len(played.descriptions) / 2]
    assert len(some) > 10, "bodies that are predicted further, beside others that are not"
    assert sum(pairs for _, pairs in some) > 100
