"""A node with steps that take longer than the period of the states, over DDS."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.ros.monitor.effort import MOST_THREADS
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box

CUBES = 32
MOST = 1000
"""Messages until the node has to have noticed."""
PERIOD = 0.01  # s


def crowd(k: int) -> np.ndarray:
    """The k-th states of cubes that pass each other closely, uncertain in all that a state can declare.

    They return twice a second, so that the steps stay slow.
    """
    states = np.zeros(CUBES, records.STATE)
    states["id"] = np.arange(1, CUBES + 1)
    states["quaternion"][:, 3] = 1.0
    row, column = np.divmod(np.arange(CUBES), 8)
    speed = np.where(row % 2, 1.0, -1.0)
    states["linear"][:, 0] = speed
    states["position"][:, 0] = 1.6 * column + speed * PERIOD * (k % 50)
    states["position"][:, 1] = 1.2 * row
    states["position_stddev"] = states["orientation_stddev"] = 0.1
    return states


@pytest.mark.parametrize("executor", ["single", "events"])
def test_a_slow_node_answers_the_newest_states_with_less_effort(start, team, tmp_path, executor) -> None:
    settings = {"profile": "exact", "uncertainty_samples": 4096, "executor": executor}
    overrides = [word for name, value in settings.items() for word in ("-p", f"{name}:={value}")]
    monitor = start("run", "--record", "run.mcap", "--ros-args", *overrides)
    team.meet()
    team.describe(*(ObjectDescription(k, ((Box((1, 1, 1)), Pose()),)) for k in range(1, CUBES + 1)))
    team.status(lambda s: s.objects == CUBES)
    begin, sent = team.now, 0
    while not (team.statuses and "reduced to" in team.statuses[-1].profile):
        assert sent < MOST
        team.listen(max(0.0, begin * 1e-9 + sent * PERIOD - time.time()))
        stamp = team.say(*crowd(sent), stamp=begin + round(1e9 * sent * PERIOD))
        sent += 1
    team.until(lambda: team._of(team.predictions, stamp))  # the newest states are always answered
    assert team.statuses[-1].step < sent // 2, "the steps were fast enough, so that this test shows nothing"
    assert monitor.stop() == 0
    assert "outdated ones are left out" in monitor.words
    threads = min(len(os.sched_getaffinity(0)), MOST_THREADS)
    assert f"now with the profile exact, {f'on {threads} threads, ' if threads > 1 else ''}reduced to" in monitor.words
    assert "Traceback" not in monitor.words
    report = replay(Session(tmp_path / "run.mcap"))
    assert (report.verdict, report.notes) == (Verdict.IDENTICAL, [])
