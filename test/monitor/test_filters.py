"""Each filter ignores exactly what it describes: the answers equal the full answers, filtered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from collision_monitor import records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor, disagreements
from collision_monitor.errors import ProfileError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, HalfSpace, Sphere
from collision_monitor.world import make_scene

SECOND = 1_000_000_000
Rows = np.ndarray[Any, Any]
LOW, HIGH = (1.0, 1.0, 0.0), (3.0, 4.0, 9.0)


def play(
    make: Callable[[Profile], Monitor], profile: Profile, steps: int = 50, rods: int = 0
) -> list[tuple[StepResult, Rows]]:
    """Answers and states of a scene whose objects enter and leave the region, and of `rods` beside it."""
    scene = make_scene("clutter", objects=60)
    monitor = make(profile)
    for description in scene.descriptions:
        monitor.describe(description)
    for k in range(rods):
        monitor.add(61 + 2 * k, Box((2.0, 0.1, 0.1)))
        monitor.add(62 + 2 * k, Sphere(0.1))
    found = []
    for step in range(steps):
        states = np.concatenate([scene.states(), rods_and_balls(rods, step / 20)])
        found.append((monitor.step(step * SECOND // 20, states), states))
        scene.step(0.05)
    return found


def rods_and_balls(count: int, t: float) -> Rows:
    """Rods that turn into balls, which roll away from the middles of the rods: their origins part, and they meet."""
    states = np.zeros(2 * count, records.STATE)
    states["id"], states["quaternion"][:, 3] = 61 + np.arange(2 * count), 1.0
    rod, ball = states[::2], states[1::2]
    states["position"][:, 1] = 200.0 + 5.0 * (np.arange(2 * count) // 2)
    rod["angular"][:, 2] = 1.0
    rod["quaternion"][:, 2:] = np.sin(0.5 * t), np.cos(0.5 * t)
    away = np.array([np.cos(1.8), np.sin(1.8), 0.0])
    ball["position"] += (0.6 + 0.05 * t) * away
    ball["linear"] = 0.05 * away
    return states


def relative(states: Rows, rows: Rows) -> tuple[Rows, Rows]:
    """Position and velocity of b relative to a, for each row; the ids are 1 … n."""
    a, b = rows["id_a"].astype(int) - 1, rows["id_b"].astype(int) - 1
    return states["position"][b] - states["position"][a], states["linear"][b] - states["linear"][a]


@pytest.mark.parametrize("make", [Monitor, ReferenceMonitor])
def test_minimum_closing_speed(make: Callable[[Profile], Monitor]) -> None:
    left_out = 0
    for (full, _), (mine, _) in zip(play(make, Profile()), play(make, Profile(min_closing_speed=0.8)), strict=True):
        expected = full.predictions[full.predictions["closing_speed"] >= 0.8]
        assert np.array_equal(mine.predictions.view(np.uint8), expected.view(np.uint8))
        assert np.array_equal(mine.contacts.view(np.uint8), full.contacts.view(np.uint8))
        assert mine.status.predictions == len(expected)
        left_out += len(full.predictions) - len(expected)
    assert left_out > 50


@pytest.mark.parametrize("make", [Monitor, ReferenceMonitor])
def test_pairs_that_move_apart(make: Callable[[Profile], Monitor]) -> None:
    left_out = 0
    loose = Profile(position_tolerance=0.05, adaptive_tolerances=False)  # so that some pairs that pass are predicted
    for (full, states), (mine, _) in zip(
        play(make, loose, rods=5), play(make, loose.replace(ignore_separating=True), rods=5), strict=True
    ):
        position, velocity = relative(states, full.predictions)
        expected = full.predictions[(position * velocity).sum(axis=1) <= 0.0]
        assert np.array_equal(mine.predictions.view(np.uint8), expected.view(np.uint8))
        assert np.array_equal(mine.contacts.view(np.uint8), full.contacts.view(np.uint8))
        left_out += len(full.predictions) - len(expected)
    assert left_out > 100


def inside(states: Rows, radius: Rows) -> set[int]:
    """Ids of the objects whose bounding spheres reach into the region."""
    nearest = np.clip(states["position"], LOW, HIGH)
    return set(states["id"][np.linalg.norm(states["position"] - nearest, axis=1) <= radius].tolist())


def both_in(ids: set[int], rows: Rows) -> Rows:
    return np.isin(rows["id_a"], list(ids)) & np.isin(rows["id_b"], list(ids))


def test_region_of_interest() -> None:
    scene = make_scene("clutter", objects=60)
    table = Monitor()
    for description in scene.descriptions:
        table.describe(description)
    radius = table._roster.bodies.motion["radius"][:60]
    region = Profile(region_min=LOW, region_max=HIGH)
    answers = zip(play(ReferenceMonitor, Profile()), play(ReferenceMonitor, region), play(Monitor, region), strict=True)
    before: set[tuple[int, int]] = set()
    left_out = reported = 0
    for (full, states), (plain, _), (mine, _) in answers:
        ids = inside(states, radius)
        expected = full.predictions[both_in(ids, full.predictions)]
        for name in ("id_a", "id_b", "status"):
            assert np.array_equal(plain.predictions[name], expected[name])
        for name in ("lower", "upper", "point", "normal", "closing_speed"):  # the search starts at another time
            assert np.allclose(plain.predictions[name], expected[name], atol=1e-4)
        full_touching = full.contacts[full.contacts["phase"] != records.Phase.END]
        touching = plain.contacts[plain.contacts["phase"] != records.Phase.END]
        expected = full_touching[both_in(ids, full_touching)]
        for name in ("id_a", "id_b", "signed_distance", "point_a", "normal", "status"):
            assert np.array_equal(touching[name], expected[name])
        pairs = {(int(c["id_a"]), int(c["id_b"])) for c in touching}
        begun = {(int(c["id_a"]), int(c["id_b"])) for c in plain.contacts if c["phase"] == records.Phase.BEGIN}
        ended = {(int(c["id_a"]), int(c["id_b"])) for c in plain.ended}
        assert (begun, ended) == (pairs - before, before - pairs), "who enters begins, who leaves ends"
        before = pairs
        assert disagreements(mine, plain, 2.0) == []
        left_out += len(full.predictions) - len(plain.predictions)
        reported += len(plain.predictions)
        assert mine.status.candidate_pairs <= full.status.candidate_pairs
    assert left_out > 50 and reported > 50


def test_a_region_that_changes_takes_objects_in_and_out() -> None:
    monitor = Monitor()
    monitor.add(1, Sphere(0.5))
    monitor.add(2, Sphere(0.5))
    monitor.add(3, HalfSpace((0, 0, 1), -0.4), static=True, pose=Pose())
    monitor.add(4, Box((1, 1, 1)), static=True, pose=Pose((30, 0, 0)))
    poses = np.array([[0, 0, 0, 0, 0, 0, 1.0], [0.8, 0, 0, 0, 0, 0, 1.0]])
    found = []
    regions = [(-100.0, 100.0), (10.0, 20.0), (-100.0, 100.0), (-1.0, 0.1), (-1e18, 1e18), (29.9, 100.0)]
    for step, (low, high) in enumerate(regions):
        monitor.profile = monitor.profile.replace(region_min=(low, -9, -9), region_max=(high, 9, 9))
        contacts = monitor.step(step, [1, 2], poses).contact_rows
        found.append([(int(c["id_a"]), int(c["id_b"]), int(c["phase"])) for c in contacts])
    everything = [(1, 2), (1, 3), (2, 3)]
    begin, persist, end = records.Phase.BEGIN, records.Phase.PERSIST, records.Phase.END
    assert found == [
        [(*pair, begin) for pair in everything],
        [(*pair, end) for pair in everything],
        [(*pair, begin) for pair in everything],
        [(1, 2, end), (1, 3, persist), (2, 3, end)],
        [(1, 2, begin), (1, 3, persist), (2, 3, begin)],
        [(*pair, end) for pair in everything],
    ]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"region_min": (0, 0, 5), "region_max": (1, 1, 4)}, "min <= max, got 5 > 4 along z"),
        ({"region_min": (0, 0)}, r"region_min: expected three numbers of metres, got \(0, 0\)"),
        ({"region_min": "here"}, "region_min: expected three numbers of metres, got 'here'"),
        ({"region_max": (0, float("nan"), 0)}, r"region_max: expected -1e\+18 to 1e\+18 m, got nan"),
        ({"ignore_separating": 1}, "ignore_separating: expected true or false, got 1"),
        ({"min_closing_speed": -1}, "min_closing_speed: expected 0 to"),
    ],
)
def test_impossible_filters_are_named(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ProfileError, match=words):
        Profile(**settings)


def test_who_fell_silent_on_the_way_out_may_have_stayed() -> None:
    """A stale object may have stayed in the region, so its pair may touch, with and without a region."""
    answers = []
    for profile in (Profile(), Profile(region_max=(1.0, 1e18, 1e18))):
        monitor = Monitor(profile)
        for object_id in (1, 2):
            monitor.add(object_id, Sphere(0.3))
        states = np.zeros(2, records.STATE)
        states["id"], states["quaternion"][:, 3] = (1, 2), 1.0
        states["position"][1], states["linear"][1] = (0.7, 0.0, 0.0), (1.0, 0.0, 0.0)
        monitor.step(0, states)
        answers.append([monitor.step(k * SECOND // 10, states[:1]) for k in range(1, 31)])
    full, mine = ([len(step.contacts) + len(step.predictions) for step in steps] for steps in answers)
    assert full == mine
    assert max(full) == 1
