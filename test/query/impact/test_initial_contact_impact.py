"""Several impacts at one instant, and lasting contacts: an object that rests or slides is one contact."""

from __future__ import annotations

import numpy as np

import collision_monitor as cm
from collision_monitor.records import STATE, Phase

STEP = 20_000_000


def test_impacts_at_one_instant_come_out_together_in_order() -> None:
    """Eight balls fall on a floor and meet in pairs at the same time: one list, sorted by time and ids."""
    count, answers = 8, []
    for order in (np.arange(count), np.arange(count)[::-1]):
        monitor = cm.Monitor("exact")
        for k in range(count):
            monitor.add(k, cm.Sphere(0.5))
        monitor.add(100, cm.HalfSpace((0, 0, 1), 0.0), static=True, pose=cm.Pose())
        rows = np.zeros(count, STATE)
        rows["id"], rows["quaternion"][:, 3] = np.arange(count), 1.0
        rows["position"][:, 0] = 3.0 * (np.arange(count) // 2) * 5.0 + np.where(np.arange(count) % 2, 1.5, -1.5)
        rows["position"][:, 2] = 1.5
        rows["linear"][:, 0], rows["linear"][:, 2] = np.where(np.arange(count) % 2, -1.0, 1.0), -1.0
        answers.append(monitor.step(0, rows[order]).predictions)
    first, second = answers
    expected = sorted([(k, k + 1) for k in range(0, count, 2)] + [(k, 100) for k in range(count)])
    assert sorted(zip(first["id_a"].tolist(), first["id_b"].tolist(), strict=True)) == expected
    assert np.abs(first["lower"] - 1.0).max() < 3e-6
    assert first.tobytes() == second.tobytes()
    keys = list(zip(first["lower"], first["id_a"], first["id_b"], strict=True))
    assert keys == sorted(keys)


def test_what_slides_on_the_floor_is_one_contact() -> None:
    """A box slides and a ball rests on the floor for ten seconds: two contacts begin, none ends, no event piles up."""
    monitor = cm.Monitor()
    monitor.add(0, cm.Box((1, 1, 1)))
    monitor.add(1, cm.Sphere(0.5))
    monitor.add(2, cm.HalfSpace((0, 0, 1), 0.0), static=True, pose=cm.Pose())
    rows = np.zeros(2, STATE)
    rows["id"], rows["quaternion"][:, 3], rows["position"][:, 2] = (0, 1), 1.0, 0.5
    rows["position"][1, 1], rows["linear"][0, 0] = 5.0, 1.0
    phases, pending = [], []
    for step in range(500):
        rows["position"][0, 0] = step * 0.02
        result = monitor.step(step * STEP, rows)
        phases.append(sorted(result.contacts["phase"].tolist()))
        pending.append(result.status.events_pending)
        assert len(result.contacts) == 2
    assert phases[0] == [Phase.BEGIN, Phase.BEGIN]
    assert all(phase == [Phase.PERSIST, Phase.PERSIST] for phase in phases[1:])
    assert max(pending) <= 4
