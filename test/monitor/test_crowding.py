"""A crowd beyond the bound on pairs is left out and counted as unseen, and everything else is monitored as before."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor import Box, Monitor, Pose, Sphere
from collision_monitor.errors import Refusal
from collision_monitor.monitor import crowding

CROWD = range(100, 160)
PAIR = (1, 2)


@pytest.fixture(autouse=True)
def bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crowding, "MOST_PAIRS", 500)


def scene() -> Monitor:
    """Two spheres that touch, a floor below everything, and 60 spheres that can be anywhere."""
    it = Monitor("exact")
    it.add(3, Box((1e4, 1e4, 1.0)), static=True, pose=Pose((0, 0, -1.0)))
    for object_id in (*PAIR, *CROWD):
        it.add(object_id, Sphere(0.4))
    return it


def poses(crowd_at: np.ndarray) -> np.ndarray:
    rows = np.zeros((2 + len(CROWD), 7))
    rows[:, 6] = 1.0
    rows[0, 0], rows[1, 0] = 100.0, 100.5
    rows[2:, :3] = crowd_at
    return rows


IDS = np.array([*PAIR, *CROWD])
TOGETHER = np.zeros((len(CROWD), 3))
APART = np.arange(len(CROWD))[:, None] * [0.0, 3.0, 0.0]


def pairs(result: object) -> set[tuple[int, int]]:
    return {(int(c["id_a"]), int(c["id_b"])) for c in result.contacts if c["phase"] != 2}


def test_a_crowd_is_unseen_and_named_and_the_others_are_monitored():
    it = scene()
    for step in range(3):
        result = it.step(step * 10**7, IDS, poses(TOGETHER))
        assert pairs(result) == {(1, 2)}
        assert result.status.objects_unseen == len(CROWD)
    assert it.refused[Refusal.MALFORMED] == 3 * len(CROWD)
    assert "500 pairs" in it.last_refusal and "ids 100, 101, 102, …" in it.last_refusal


def test_a_crowd_that_parts_is_monitored_again():
    it = scene()
    it.step(0, IDS, poses(TOGETHER))
    result = it.step(10**7, IDS, poses(APART))
    assert result.status.objects_unseen == 0
    assert pairs(result) == {(1, 2)}
    apart = APART.copy()
    apart[1] = apart[0] + [0.5, 0, 0]
    assert pairs(it.step(2 * 10**7, IDS, poses(apart))) == {(1, 2), (100, 101)}


def test_a_crowd_that_gathers_one_by_one_is_left_out_too():
    it = scene()
    at = APART.copy()
    it.step(0, IDS, poses(at))
    most = 0
    for step in range(len(CROWD)):
        at[step] = 0.0
        result = it.step((1 + step) * 10**7, IDS, poses(at))
        most = max(most, len(result.contacts))
        assert (1, 2) in pairs(result)
        touching = {(a, b) for a, b in pairs(result) if a >= 100}
        gathered = step + 1
        assert touching <= {(100 + a, 100 + b) for a in range(gathered) for b in range(a + 1, gathered)}
        if result.status.objects_unseen == 0:  # nothing is missing without being counted
            assert len(touching) == gathered * (gathered - 1) // 2
    assert most <= 500 + len(CROWD)
    assert it.refused[Refusal.MALFORMED] > 0


def test_the_same_states_give_the_same_answers_from_a_snapshot():
    it = scene()
    it.step(0, IDS, poses(TOGETHER))
    again = Monitor.restored("exact", it.snapshot())
    for step, at in enumerate((TOGETHER, APART, TOGETHER, APART), start=1):
        assert (
            it.step(step * 10**7, IDS, poses(at)).contacts.tobytes()
            == again.step(step * 10**7, IDS, poses(at)).contacts.tobytes()
        )
    assert it.digest == again.digest


def test_a_static_body_is_never_left_out():
    it = scene()
    at = TOGETHER.copy()
    at[:, 2] = -0.4  # on the floor
    it.step(0, IDS, poses(at))
    below = poses(APART)
    below[2:, 2] = -0.4
    assert {(3, object_id) for object_id in CROWD} <= pairs(it.step(10**7, IDS, below))
