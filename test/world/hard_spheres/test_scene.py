"""The scene of hard spheres, watched by a monitor: its predictions are what happens."""

import sys
from pathlib import Path

from collision_monitor.world.hard_spheres.hard_spheres_scene import HardSpheresScene

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from confirmed_predictions import HORIZON, by_object_id, compare, in_process


def test_the_monitors_predictions_happen_within_their_intervals():
    scene, again = (HardSpheresScene(80, 4, 50.0) for _ in range(2))
    steps = list(in_process(scene, 3.0))
    truth = by_object_id(again.spheres.run(3.0 + HORIZON + 0.1, record=True), 80)
    confirmed = compare(steps, truth, 80)
    assert confirmed.predictions > 10_000
    assert confirmed.wrong == 0
    assert confirmed.happened + confirmed.prevented == confirmed.predictions
    assert confirmed.first_happened == confirmed.first == len(steps)
    assert confirmed.predicted == confirmed.due > 1000
