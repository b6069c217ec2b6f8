"""Horizons and rates of classes of objects, against monitors without classes."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.accuracy.playback import by_pair
from collision_monitor.errors import ProfileError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world import make_scene

RATE = 20.0


def played(profile: Profile, seconds: float = 3.0):
    """Yield the answers to a fleet, with the horizon (s) of each object by its id."""
    scene = make_scene("fleet", objects=60, seed=2, noise=0.0)
    monitor = Monitor(profile)
    for description in scene.descriptions:
        monitor.describe(description)
    for _ in range(round(seconds * scene.rate)):
        yield monitor.step(round(scene.time * 1e9), scene.states()), monitor
        scene.step()


def test_a_pair_is_predicted_for_the_shorter_of_both_horizons() -> None:
    base = Profile.named("exact").replace(horizon=4.0)
    names = {d.name.rstrip("0123456789_") for d in make_scene("fleet", objects=60, seed=2).descriptions}
    assert any(name.startswith("person") for name in names), names
    classes = base.replace(horizon_by_name="rack*=4, person*=1")
    queries = np.zeros(2)
    dropped = 0
    for (mine, monitor), (whole, _) in zip(played(classes), played(base), strict=True):
        queries += mine.status.impact_queries, whole.status.impact_queries
        expected = {}
        for pair, row in by_pair(whole.predictions).items():
            shortest = min(1.0 if monitor.name(k).startswith("person") else 4.0 for k in pair)
            if row["lower"] <= shortest - 1e-6:
                expected[pair] = row
            dropped += row["lower"] > shortest
        found = by_pair(mine.predictions)
        assert expected.keys() <= found.keys()
        for pair, row in found.items():
            assert row["lower"] <= min(1.0 if monitor.name(k).startswith("person") else 4.0 for k in pair)
            if pair in expected:
                assert row["lower"] == pytest.approx(expected[pair]["lower"], abs=1e-6)
        assert np.array_equal(mine.contacts["id_b"], whole.contacts["id_b"])
    assert dropped > 20
    assert queries[0] < queries[1]


def test_states_of_a_class_are_used_at_its_rate_and_its_answers_stay_true() -> None:
    """A pallet brakes within the allowed acceleration between two used states: its wall is never certainly clear."""
    profile = Profile.named("exact").replace(rate_by_name="pallet*=2", stale_acceleration=2.0, uncertainty=False)
    monitor, truth = Monitor(profile), Monitor(profile.replace(rate_by_name=""))
    for each in (monitor, truth):
        each.add(1, Box((1, 1, 1)), name="pallet_1")
        each.add(2, Box((0.2, 4, 4)), name="wall", static=True, pose=Pose((1.5, 0, 0)))
        each.add(3, Sphere(0.1), name="person")
    used = set()
    for k in range(60):
        t = k / RATE
        x, v = t * t * 0.5, t  # accelerates at 1 m/s^2 towards the wall, until beyond it
        arguments = ([1, 3], [(x, 0, 0, 0, 0, 0, 1), (0, 9, 0, 0, 0, 0, 1)], [(v, 0, 0, 0, 0, 0), (0,) * 6])
        mine, exact = (each.step(round(t * 1e9), *arguments) for each in (monitor, truth))
        used.add(float(monitor.roster.bodies.time[monitor.roster.slot(1)]))
        assert not mine.refused and monitor.roster.bodies.time[monitor.roster.slot(3)] == pytest.approx(t)
        for row in exact.contacts:
            (found,) = (c for c in mine.contacts if c["id_b"] == row["id_b"])
            off = abs(found["signed_distance"] - row["signed_distance"])
            assert off <= found["error_bound"] + 1e-12
        touching = {int(row["id_b"]) for row in mine.contacts}
        for pair, row in by_pair(exact.predictions).items():
            assert pair in by_pair(mine.predictions) or pair[1] in touching, (k, pair, row)
    assert len(used) == 6
    assert sorted(used) == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0, 2.5])


def test_a_rate_holds_after_a_restored_snapshot_and_for_objects_described_later() -> None:
    profile = Profile(rate_by_name="slow_*=1", horizon_by_name="slow_*=0.5")
    monitor = Monitor(profile)
    monitor.add(1, Sphere(0.1), name="slow_1")
    state = [(0, 0, 0, 0, 0, 0, 1)]
    monitor.step(0, [1], state)
    other = Monitor.restored(profile, monitor.snapshot())
    for each in (monitor, other):
        each.add(2, Sphere(0.1), name="slow_2")
        for k in range(1, 5):
            each.step(k * 10**8, [1, 2], state * 2)
        slots = [each.roster.slot(object_id) for object_id in (1, 2)]
        assert each.roster.bodies.time[slots] == pytest.approx([0.0, 0.1])
    assert monitor.digest == other.digest


@pytest.mark.parametrize(
    ("setting", "value", "text"),
    [
        ("horizon_by_name", "pallet*", "horizon_by_name: expected patterns of names with a value each"),
        ("horizon_by_name", "a=1, a=2", "got the pattern 'a' twice"),
        ("horizon_by_name", "a=1,,b=2", "got ''"),
        ("horizon_by_name", "pallet*=3", "horizon_by_name, pallet*: expected at most the horizon, 2 s, got 3"),
        ("horizon_by_name", "pallet*=-1", "horizon_by_name, pallet*: expected a number of s from 0 to 1e+06, got -1.0"),
        ("rate_by_name", "pallet*=0", "rate_by_name, pallet*: expected a number of Hz from 0.001 to 1e+06, got 0.0"),
        ("rate_by_name", "pallet*=nan", "expected a number of Hz from 0.001 to 1e+06, got nan"),
        ("rate_by_name", "pallet*=fast", "got 'pallet*=fast'"),
        ("rate_by_name", 3.0, "rate_by_name: expected a text such as 'person*=4, pallet_?=1', got 3.0"),
        ("rate_by_name", ", ".join(f"a{k}=1" for k in range(65)), "at most 64, got 65"),
    ],
)
def test_a_wrong_value_names_the_setting_the_value_and_the_choices(setting: str, value: object, text: str) -> None:
    with pytest.raises(ProfileError) as raised:
        Profile(**{setting: value})
    assert text in str(raised.value)


def test_the_first_pattern_that_matches_counts() -> None:
    monitor = Monitor(Profile(horizon_by_name="box_1=0.25, box_*=1"))
    for k in range(3):
        monitor.add(k, Sphere(0.1), name=f"box_{k}")
    values = monitor.roster.values_by_name((("box_1", 0.25), ("box_*", 1.0)), 2.0)
    assert values[:3].tolist() == [1.0, 0.25, 1.0]
