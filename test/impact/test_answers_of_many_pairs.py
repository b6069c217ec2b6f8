"""An answer depends on its pair alone, not on the pairs that the same scratch memory served before."""

from __future__ import annotations

import numpy as np

import collision_monitor as cm
from collision_monitor.monitor.uncertain_predictions import sigmas_for
from collision_monitor.settings.profile import Profile
from collision_monitor.uncertainty.plane_memory import make_plane_memory
from collision_monitor.uncertainty.plane_probability import plane_probabilities
from collision_monitor.uncertainty.sampled_impacts import Sampling
from collision_monitor.uncertainty.samples.error_samples import make_workspace
from collision_monitor.uncertainty.samples.normal_samples import normal_samples, sample_columns
from collision_monitor.world import make_scene

SAMPLES = 256


def test_the_order_of_the_pairs_changes_no_answer() -> None:
    scene = make_scene("fleet", objects=40, noise=0.02, seed=3)
    p, monitor = Profile(), cm.Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
    monitor.step(0, scene.states())
    roster, spread = monitor._roster, monitor._uncertain.spread
    entries = monitor._uncertain.entries
    pairs = np.stack([entries["i"], entries["j"]], axis=1)
    for stated in (True, False):
        sampling = Sampling(
            monitor._settings.impact, p.horizon, p.stale_acceleration, stated, sigmas_for(p.min_probability), 3.7,
            p.min_probability, p.confidence, roster.planar, *normal_samples(SAMPLES),
        )  # fmt: skip
        columns, answers = sample_columns(SAMPLES), []
        for order in (np.arange(len(pairs)), np.random.default_rng(0).permutation(len(pairs))):
            found = np.empty((len(pairs), 4))
            work, memory = make_workspace(), make_plane_memory(SAMPLES)
            some = np.ascontiguousarray(pairs[order])
            plane_probabilities(roster.multibody, spread, some, 0.0, sampling, columns, memory, work, found)
            answers.append(found[np.argsort(order)])
        assert (answers[0][:, 3] > 0.01).sum() > 5
        np.testing.assert_array_equal(*answers)
