"""Steps that end before all pairs are examined: answers for deferred pairs hold, and no collision is clear."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from collision_monitor import records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor, disagreements
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.errors import ProfileError
from collision_monitor.impact import sphere_trees
from collision_monitor.monitor.budget import EXAMINE, FEWEST, TREES, PairBudget, StepClock, TimeBudget
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull
from collision_monitor.world import Scene, make_scene

SECOND = 1_000_000_000
MODES = ("steady", "jumps")


def by_pair(rows: np.ndarray[Any, Any]) -> dict[tuple[int, int], Any]:
    return {(int(row["id_a"]), int(row["id_b"])): row for row in rows}


def rods(scene: Scene) -> list[ObjectDescription]:
    """Long hulls and boxes in place of the scene's objects; their sphere trees are tighter than bounding spheres."""
    random = np.random.default_rng(4)
    corners = random.normal(size=(40, 3))
    corners *= (0.8, 0.1, 0.08) / np.linalg.norm(corners, axis=1, keepdims=True)
    shapes = [ConvexHull(corners), Box((0.1, 1.4, 0.12))]
    return [replace(d, shapes=((shapes[d.object_id % 2], Pose()),)) for d in scene.descriptions]


def play(profile: Profile, mode: str, steps: int = 25, *, long: bool = False) -> list[tuple[StepResult, StepResult]]:
    """Answers with a budget, and answers of plain recomputation, for the same states."""
    scene = make_scene("clutter", objects=150 if long else 300)
    limited, plain = Monitor(profile), ReferenceMonitor(profile.replace(pairs_per_step=1_000_000_000))
    for description in rods(scene) if long else scene.descriptions:
        limited.describe(description)
        plain.describe(description)
    random = np.random.default_rng(3)
    answers = []
    for step in range(steps):
        states = scene.states()
        if mode == "jumps":  # all change their course in every step: no prediction can be kept
            states["linear"] += random.uniform(-0.3, 0.3, states["linear"].shape)
        answers.append((limited.step(step * SECOND // 50, states), plain.step(step * SECOND // 50, states)))
        scene.step()
    return answers


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("limit", "long"), [(1, False), (40, False), (150, False), (30, True), (200, True)])
def test_no_collision_is_reported_clear_and_every_interval_holds(mode: str, limit: int, long: bool) -> None:
    deferred = unresolved = 0
    for mine, truth in play(Profile(pairs_per_step=limit), mode, long=long):
        reported = by_pair(mine.contacts[mine.contacts["phase"] != records.Phase.END])
        touching = by_pair(truth.contacts[truth.contacts["phase"] != records.Phase.END])
        stated, true = by_pair(mine.predictions), by_pair(truth.predictions)
        assert touching.keys() <= reported.keys() | stated.keys()
        for pair, contact in reported.items():
            if pair in touching:
                really = touching[pair]["signed_distance"]
                assert abs(contact["signed_distance"] - really) <= contact["error_bound"] + 1e-9
            else:
                assert contact["status"] == records.ContactStatus.UNRESOLVED
        for pair, event in true.items():
            if event["status"] == records.PredictionStatus.HIT and event["upper"] < 2.0:
                assert pair in reported or pair in stated, f"{pair} collides in {event['lower']} s"
            if pair in stated:
                assert stated[pair]["lower"] <= event["upper"]
                assert stated[pair]["upper"] >= event["lower"]
        for pair in stated.keys() & touching.keys():
            assert stated[pair]["lower"] == 0.0 and stated[pair]["status"] == records.PredictionStatus.UNRESOLVED
        bounds = mine.predictions["method"] == records.Method.BOUND
        assert (mine.predictions["status"][bounds] == records.PredictionStatus.UNRESOLVED).all()
        assert (
            np.isfinite(mine.predictions["point"]).all()
            and np.isfinite([contact["error_bound"] for contact in reported.values()]).all()
        )
        assert (mine.cut is None) == (mine.status.deferred == 0)
        deferred += mine.status.deferred
        unresolved += mine.status.unresolved
    assert deferred > 0 and unresolved > 0


@pytest.mark.parametrize("mode", MODES)
def test_sphere_trees_tell_more_than_bounding_spheres(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same number of pairs in a step, trees report fewer pairs that do not collide."""
    reported = []
    for corners in (sphere_trees.MOST_CORNERS, 0):
        monkeypatch.setattr(sphere_trees, "MOST_CORNERS", corners)
        played = play(Profile(pairs_per_step=200), mode, 10, long=True)
        reported.append(sum(len(mine.contacts) + len(mine.predictions) for mine, _ in played))
    true = sum(len(truth.contacts) + len(truth.predictions) for _, truth in played)
    assert true <= reported[0] < 0.8 * reported[1]


@pytest.mark.parametrize("mode", MODES)
def test_a_budget_that_is_enough_changes_no_answer(mode: str) -> None:
    scene_without, scene_with = play(Profile(), mode, 25), play(Profile(pairs_per_step=999_999), mode, 25)
    for (free, _), (limited, _) in zip(scene_without, scene_with, strict=True):
        assert limited.cut is None and limited.status.deferred == 0
        assert np.array_equal(free.contacts.view(np.uint8), limited.contacts.view(np.uint8))
        a, b = (np.sort(each.predictions, order=["id_a", "id_b"]) for each in (free, limited))
        for name in ("id_a", "id_b", "status"):
            assert np.array_equal(a[name], b[name])
        # the search starts at another time, so the last bits differ
        assert (a["lower"] <= b["upper"]).all() and (b["lower"] <= a["upper"]).all()


def test_what_was_left_is_caught_up_with_when_there_is_time() -> None:
    scene = make_scene("clutter", objects=120)
    monitor, plain = Monitor(Profile(pairs_per_step=20, adaptive_tolerances=False)), ReferenceMonitor()
    for description in scene.descriptions:
        monitor.describe(description)
        plain.describe(description)
    states = scene.states()
    left = [monitor.step(step, states).status.deferred for step in range(4)]
    assert left == sorted(left, reverse=True) and left[0] > left[-1] > 0, "more are done in every step"
    monitor.profile = monitor.profile.replace(pairs_per_step=1_000_000_000)
    result, truth = monitor.step(8, states), plain.step(8, states)
    assert result.status.deferred == 0 and result.cut is None
    assert disagreements(result, truth, 2.0) == []
    assert not (result.predictions["method"] == records.Method.BOUND).any()


def test_the_most_urgent_are_done_first() -> None:
    scene = make_scene("clutter", objects=300)
    monitor = Monitor(Profile(pairs_per_step=50))
    for description in scene.descriptions:
        monitor.describe(description)
    predictions = monitor.step(0, scene.states()).predictions
    later = predictions[predictions["lower"] > 0.0]
    done = later["lower"][later["method"] != records.Method.BOUND]
    left = later["lower"][later["method"] == records.Method.BOUND]
    assert len(done) > 5 and len(left) > 5
    assert np.median(done) < np.median(left)


def test_touching_pairs_take_turns() -> None:
    """With a small budget, each touching pair is examined again within a few steps."""
    scene = make_scene("clutter", objects=120)
    monitor = Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
    states = scene.states()
    touching = len(monitor.step(0, states).contacts)
    monitor.profile = Profile(pairs_per_step=10)
    seen: set[tuple[int, int]] = set()
    for step in range(1, 40):
        contacts = monitor.step(step, states).contacts
        assert (contacts["phase"] == records.Phase.PERSIST).all()
        settled = contacts[contacts["status"] == records.ContactStatus.TOUCHING]
        seen |= by_pair(settled).keys()
    assert len(seen) == touching


def test_a_cut_step_replays_with_the_pairs_it_came_to() -> None:
    """The clock permits another number of pairs in every step; a replay needs no clock, also from the middle."""
    scene = make_scene("clutter", objects=300)
    live = Pipeline(Profile(budget_ms=50.0))
    again = Pipeline(live.monitor.profile, timed=False)
    shapes = encode_descriptions(0, "world", scene.descriptions, snapshot=True)
    live.on_shapes(shapes)
    again.on_shapes(shapes)
    random = np.random.default_rng(5)
    cuts = []
    for step in range(25):
        states = scene.states()
        states["linear"] += random.uniform(-0.3, 0.3, states["linear"].shape)
        data = encode_states(step * SECOND // 50, "world", step + 1, states)
        room = 0.0 if step == 13 else random.uniform(0.5e-3, 10e-3) if step % 3 else 50e-3
        live.monitor.clock._end = 50e-3 - room
        live.monitor.clock._deviation = 0.0
        outputs = live.on_states(data)
        assert outputs is not None
        if outputs.settings is not None:
            again.on_settings(outputs.settings)
        replayed = again.on_states(data)
        assert replayed is not None
        assert (replayed.contacts, replayed.predictions) == (outputs.contacts, outputs.predictions)
        assert again.status() == live.status()
        cuts.append(outputs.result.cut)
        scene.step()
        if step == 13:
            assert outputs.result.cut == FEWEST
            again = Pipeline.restored(live.snapshot(), "world")
    assert FEWEST in cuts and None in cuts


class TestBudgets:
    def test_pairs_are_counted(self) -> None:
        budget = PairBudget(10)
        assert [budget.next(7, EXAMINE), budget.next(7, EXAMINE), budget.next(4, EXAMINE)] == [7, 3, 0]
        assert budget.done == 10

    def test_time_that_is_over_leaves_a_few_pairs_and_stays_over(self) -> None:
        with StepClock() as clock:
            budget = TimeBudget(clock, 0.0, 100)
            assert [budget.next(50, EXAMINE), budget.next(50, EXAMINE)] == [FEWEST, 0]
            assert budget.done == FEWEST

    def test_a_bad_estimate_is_forgotten(self) -> None:
        """After one slow pair no pair seems to fit; after some steps the budget admits more again."""
        clock = StepClock()
        clock.cost[EXAMINE] = 1.0
        tries = []
        while max(tries, default=0) <= FEWEST:
            with clock:
                budget = TimeBudget(clock, 0.01, 1000)
                tries.append(budget.next(500, EXAMINE))
                budget.stop()
            assert len(tries) < 100
        assert len(tries) > 5

    def test_a_bad_estimate_is_forgotten_where_other_work_goes_on(self) -> None:
        """Pairs of trees use up the minimum of each step; shapes are examined after some steps nevertheless."""
        clock = StepClock()
        clock.cost[EXAMINE] = 1.0
        for _ in range(100):
            with clock:
                budget = TimeBudget(clock, 0.01, 1000)
                assert budget.next(FEWEST, TREES) == FEWEST
                if budget.next(500, EXAMINE):
                    break
                budget.stop()
        else:
            raise AssertionError("no pair was ever looked at")

    def test_pairs_that_cost_much_are_done_one_by_one(self) -> None:
        with StepClock() as clock:
            clock.cost[EXAMINE] = 0.3
            budget = TimeBudget(clock, 1.0, 1000)
            assert budget.next(FEWEST, TREES) == FEWEST
            assert budget.next(500, EXAMINE) == 1

    def test_steps_that_are_always_late_do_not_make_a_pair_cost_nothing(self) -> None:
        clock = StepClock()
        for _ in range(5000):
            with clock:
                budget = TimeBudget(clock, 0.0, 100)
                assert budget.next(50, TREES) == FEWEST
        assert clock.cost[TREES] > 0.0

    def test_the_end_of_a_step_is_left_room_for(self) -> None:
        clock = StepClock()
        for _ in range(3):
            with clock:
                TimeBudget(clock, 1.0, 10).stop()
        assert 0.0 < clock.reserve < 0.01

    @pytest.mark.parametrize(("setting", "value"), [("budget_ms", 0.0), ("budget_ms", -1.0), ("pairs_per_step", 0)])
    def test_a_budget_of_nothing_is_refused(self, setting: str, value: float) -> None:
        with pytest.raises(ProfileError, match=f"{setting}: expected .* to .*, got {value:g}"):
            Profile().replace(**{setting: value})
