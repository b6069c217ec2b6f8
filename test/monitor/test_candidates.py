"""Candidates: single queries of the hashed grid and one sweep of a dense grid find the same pairs."""

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
def test_one_sweep_finds_the_pairs_that_looking_up_finds(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    both: list[tuple[int, int]] = []
    find = Candidates._partners

    def compare(self: Candidates, step: StepContext, which: Any) -> Any:
        monkeypatch.setattr(candidates, "MOST_QUERIES", 2.0)
        looked_up = {tuple(sorted(pair)) for pair in find(self, step, which).tolist()}
        monkeypatch.setattr(candidates, "MOST_QUERIES", -1.0)
        swept = find(self, step, which)
        assert {tuple(sorted(pair)) for pair in swept.tolist()} == looked_up
        assert len(swept) == len(looked_up)
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
    assert len(some) > 10, "some steps predict only some of the bodies"
    assert sum(pairs for _, pairs in some) > 100
