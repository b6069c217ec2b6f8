"""`cm.conflicts`: against closed forms, and against `cm.impacts` of each pair alone."""

from __future__ import annotations

from itertools import combinations
from math import inf, sqrt
from typing import Any

import numpy as np
import pytest
from contact_intervals import SHAPES

import collision_monitor as cm
from collision_monitor.errors import InputError, TooCostlyError, UnsupportedError
from collision_monitor.query.conflicts import encounters

Times = list[tuple[float, float, float, float]]


def times_of(found: list[cm.Conflict], a: Any, b: Any) -> Times:
    return [(*each.entry, *each.exit) for each in found if {each.a, each.b} == {a, b}]


def test_balls_that_cross_meet_when_the_closed_form_says() -> None:
    rng = np.random.default_rng(1)
    starts, ends = rng.uniform(-10.0, 10.0, (2, 30, 3))
    plans = [cm.Trajectory([0, 10], [a, b]) for a, b in zip(starts, ends, strict=True)]
    found = cm.conflicts([cm.Sphere(1.0)] * 30, plans)
    expected = 0
    for i, j in combinations(range(30), 2):
        p, v = starts[j] - starts[i], ((ends[j] - starts[j]) - (ends[i] - starts[i])) / 10.0
        a, half_b, c = v @ v, p @ v, p @ p - 4.0
        root = half_b * half_b - a * c
        if (
            root <= 0.0
            or (enters := (-half_b - sqrt(root)) / a) >= 10.0
            or (leaves := (-half_b + sqrt(root)) / a) <= 0.0
        ):
            assert times_of(found, i, j) == []
            continue
        expected += 1
        ((first, sure, last, apart),) = times_of(found, i, j)
        assert first - 1e-9 <= max(enters, 0.0) <= sure + 1e-9 and sure - first < 1e-6
        assert last - 1e-9 <= min(leaves, 10.0) and (leaves > 10.0 or apart >= leaves - 1e-9)
        assert leaves > 10.0 or apart - last < 1e-6
    assert expected > 10 and len(found) == expected
    assert [each.entry[0] for each in found] == sorted(each.entry[0] for each in found)


def plan(rng: np.random.Generator, between: Any) -> cm.Trajectory:
    count = int(rng.integers(2, 6))
    times, heading = np.cumsum(rng.uniform(0.3, 2.0, count)) - 1.0, np.cumsum(rng.uniform(-0.6, 0.6, count))
    poses = np.zeros((count, 7))
    poses[:, :3] = np.cumsum(rng.normal(0.0, 1.0, (count, 3)), axis=0) * (1.0, 1.0, 0.2)
    poses[:, 5], poses[:, 6] = np.sin(heading), np.cos(heading)
    twists = rng.normal(0.0, 1.0, (count, 3)) if between == "curve" else None
    return cm.Trajectory(times, poses, twists, between=between, then=str(rng.choice(["rest", "go on"])))  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(4))
def test_each_pair_has_the_intervals_of_its_own_query(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kinds = list(SHAPES.values())
    shapes = {k: kinds[k % len(kinds)] for k in range(8)}
    plans = {k: plan(rng, str(rng.choice(["straight", "arc", "curve"]))) for k in shapes}
    world = {"wall": (cm.Box((0.2, 5.0, 2.0)), (2.0, 0, 0)), "floor": cm.HalfSpace((0, 0, 1), -1.5)}
    found = cm.conflicts(shapes, plans, world, horizon=4.0)
    bodies = {**shapes, "wall": world["wall"][0], "floor": world["floor"]}
    motions = {**plans, "wall": cm.Motion(cm.Pose((2.0, 0, 0))), "floor": cm.Motion(cm.Pose())}
    met = 0
    for a, b in combinations(bodies, 2):
        if a in world:
            continue
        alone = cm.impacts(bodies[a], motions[a], bodies[b], motions[b], 4.0, tolerance=3e-8)
        own = times_of(found, a, b)
        for each in alone:
            if each.entry[1] < inf:
                met += 1
                assert any(first <= each.entry[1] + 1e-9 and each.exit[0] <= apart + 1e-9 for first, _, _, apart in own)
        for first, sure, last, _ in own:
            if sure < inf:
                assert any(each.entry[0] <= sure + 1e-9 and last <= each.exit[1] + 1e-9 for each in alone), (
                    first,
                    last,
                )
    assert met > 3


def test_the_order_of_the_objects_does_not_matter() -> None:
    rng = np.random.default_rng(7)
    plans = {k: plan(rng, "arc") for k in range(10)}
    one = cm.conflicts(dict.fromkeys(plans, SHAPES["box"]), plans, horizon=4.0)
    back = dict(reversed(plans.items()))
    other = cm.conflicts(dict.fromkeys(back, SHAPES["box"]), back, horizon=4.0)
    assert len(one) == len(other) > 5
    for a, b in combinations(plans, 2):
        for mine, theirs in zip(times_of(one, a, b), times_of(other, a, b), strict=True):
            assert mine == pytest.approx(theirs, abs=2e-6)


def test_an_unknown_plan_may_meet_anything_from_its_end_on() -> None:
    plans = {
        "a": cm.Trajectory([0, 2], [(0, 0, 0), (1, 0, 0)], then="unknown"),
        "b": cm.Trajectory([0, 5], [(9, 9, 9)] * 2),
    }
    (found,) = cm.conflicts(dict.fromkeys(plans, cm.Sphere(0.1)), plans)
    assert (found.a, found.b, found.status, found.entry, found.exit) == (
        "a",
        None,
        "unresolved",
        (2.0, inf),
        (2.0, inf),
    )
    assert found.contact is None


def test_contacts_that_come_again_are_all_there_and_beyond_the_limit_unresolved() -> None:
    swings = cm.Trajectory(np.arange(9), [(0.0, (-1.0) ** k, 0.0) for k in range(9)])
    given = {"bob": cm.Sphere(0.1)}, {"bob": swings}, {"post": (cm.Sphere(0.1), (0, 0, 0))}
    found = cm.conflicts(*given)
    assert len(found) == 8
    assert [0.5 * (each.entry[0] + each.exit[1]) for each in found] == pytest.approx(np.arange(8) + 0.5, abs=1e-5)
    few = cm.conflicts(*given, separation=0.5, most=2)
    hits = [each for each in few if each.status == "hit"]
    assert all(any(one.entry[0] <= each.entry[1] and each.exit[0] <= one.exit[1] for one in few) for each in found)
    assert len(hits) <= 16


def test_bodies_that_stay_in_touch_are_never_left_out() -> None:
    plans = {"a": cm.Trajectory([0, 4], [(0, 0, 0), (4, 0, 0)]), "b": cm.Trajectory([0, 4], [(0.9, 0, 0), (4.9, 0, 0)])}
    (found,) = cm.conflicts(dict.fromkeys(plans, cm.Box((1, 1, 1))), plans)
    assert (found.entry, found.exit) == ((0.0, 0.0), (4.0, inf))


def test_pairs_that_may_touch_and_static_ones_do_not_count() -> None:
    plans = {name: cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)]) for name in "abc"}
    world = [(cm.Box((1, 1, 1)), (50, 0, 0)), (cm.Box((1, 1, 1)), (50, 0, 0))]
    found = cm.conflicts(dict.fromkeys(plans, cm.Sphere(1)), plans, world, ignore=[("b", "a")])
    assert {(each.a, each.b) for each in found} == {("a", "c"), ("b", "c")}


def test_what_does_not_fit_is_refused() -> None:
    ball, path = cm.Sphere(1), cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)])
    assert cm.conflicts({}, {}) == []
    with pytest.raises(InputError, match="expected a trajectory for each object, got none for 'b'"):
        cm.conflicts({"a": ball, "b": ball}, {"a": path})
    with pytest.raises(InputError, match="static: expected names that no object has, got 'a'"):
        cm.conflicts({"a": ball}, {"a": path}, {"a": (ball, (0, 0, 0))})
    with pytest.raises(InputError, match="ignore: expected pairs of names"):
        cm.conflicts({"a": ball}, {"a": path}, ignore=[("a", "z")])
    with pytest.raises(InputError, match="a plan that ends in the future, got the last end at -1 s"):
        cm.conflicts([ball], [cm.Trajectory([-2, -1], [(0, 0, 0), (1, 0, 0)])])
    with pytest.raises(InputError, match="horizon: expected one"):
        cm.conflicts([ball], [cm.Motion(cm.Pose())])
    with pytest.raises(UnsupportedError, match="a HalfSpace with a plan"):
        cm.conflicts([cm.HalfSpace((0, 0, 1), 0)], [path])
    with pytest.raises(UnsupportedError, match="meet each other only"):
        cm.conflicts([ball, cm.Circle(1)], [path, path])
    with pytest.raises(InputError, match="objects: expected a mapping from names, or a list, got int"):
        cm.conflicts(3, [path])


def test_too_many_encounters_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(encounters, "MOST_ENCOUNTERS", 3)
    with pytest.raises(TooCostlyError, match=r"at most 3 encounters, got more by 0\.000 s; give fewer objects"):
        cm.conflicts([cm.Sphere(1)] * 4, [cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)])] * 4)
