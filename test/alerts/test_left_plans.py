"""Alerts about objects that leave their plans."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from collision_monitor.alerts.rules import Rules
from collision_monitor.alerts.rules_in_force import rules_in_force
from collision_monitor.codec import encode_trajectories
from collision_monitor.codec.trajectories import ObjectTrajectory
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import PlanFlag
from collision_monitor.shapes.registry import Sphere
from test.helpers.alert_scene import CLASSES, STEP_NS, AlertScene, States

CART = ObjectDescription(1, Sphere(0.5), name="cart")
OTHER = ObjectDescription(3, Sphere(0.5), name="cart_2")
PERSON = ObjectDescription(2, Sphere(0.3), name="person_1")


def rules(more: str = "", of: str = "cart") -> Rules:
    return Rules.parse(f"{CLASSES}rules: {{off plan: {{left_plan: {of}{more}}}}}\n")


def plan(object_id: int, speed: float, y: float = 0.0, at: float = 0.0) -> ObjectTrajectory:
    """Along x from x = at * speed on."""
    poses = np.zeros((2, 7))
    poses[:, 0], poses[:, 1], poses[:, 6] = (at * speed, at * speed + 20 * speed), y, 1.0
    return ObjectTrajectory(np.array([0.0, 20.0]), poses, np.zeros((0, 6)), np.zeros(4), object_id)


def give(scene: AlertScene, *plans: ObjectTrajectory) -> None:
    scene.pipeline.on_trajectories(encode_trajectories(max(scene.step - 1, 0) * STEP_NS, "world", list(plans)))


def turning_away(time: float) -> States:
    """The first cart leaves the x axis after 1 s; the second keeps to its own plan at y = 9."""
    y = max(time - 1.02, 0.0)
    return {
        1: ((time, y, 0), (1, float(y > 0), 0)), 2: ((time, 5, 0), (1, 0, 0)), 3: ((time, 9, 0), (1, 0, 0)),
    }  # fmt: skip


def changes(alerts: Any) -> list[tuple[float, int, int]]:
    return [(round(time, 3), alert.previous_level, alert.level) for time, alert in alerts]


def scene_of(given: Rules) -> AlertScene:
    scene = AlertScene([CART, OTHER, PERSON], given)
    give(scene, plan(1, 1.0), plan(3, 1.0, y=9.0))
    return scene


def test_an_object_that_leaves_its_plan_raises_an_alert_with_itself_until_it_gets_another_plan() -> None:
    scene = scene_of(rules())
    found = list(scene.run(turning_away, 40))
    assert changes(found) == [(1.15, 0, 2)]  # more than 0.1 m across
    (alert,) = (alert for _, alert in found)
    assert (alert.id_a, alert.id_b, alert.name_a, alert.rule) == (1, 1, "cart", "off plan")
    assert alert.text == "cart: has left its plan"
    assert (alert.class_a, alert.class_b) == ("cart", "cart")
    assert np.isnan(alert.distance) and np.isnan(alert.time_to_collision)
    y = turning_away(scene.step * STEP_NS * 1e-9)[1][0][1]
    give(scene, plan(1, 1.0, y=y, at=(scene.step - 1) * STEP_NS * 1e-9))
    later = scene.feed({**turning_away(scene.step * STEP_NS * 1e-9), 1: ((scene.step * 0.05, y, 0), (1, 0, 0))})
    assert [(each.level, each.text) for each in later] == [(0, "cart: cleared after 0.85 s")]


def test_delays_and_levels_are_those_of_other_rules() -> None:
    found = list(scene_of(rules(", level: critical, raise_after: 0.3")).run(turning_away, 40))
    assert changes(found) == [(1.45, 0, 3)]


def test_only_the_class_of_the_rule_counts() -> None:
    assert not list(scene_of(rules(of="person")).run(turning_away, 40))
    assert len(list(scene_of(rules(of="any")).run(turning_away, 40))) == 1


def test_a_plan_that_is_over_is_not_left() -> None:
    scene = AlertScene([CART], rules())
    short = plan(1, 1.0)
    give(scene, ObjectTrajectory(short.times / 20, short.poses, short.twists, short.tolerance, 1))
    assert not list(scene.run(lambda t: {1: ((min(20 * t, 20.0), 0, 0), (20.0 if t < 1 else 0, 0, 0))}, 80))


def test_a_new_plan_ends_that_the_last_one_was_left() -> None:
    scene = scene_of(rules())
    scene.describe(ObjectDescription(9, Sphere(0.5), name="wall"))
    list(scene.run(turning_away, 40))
    give(scene, plan(1, 1.0, y=1.0, at=39 * 0.05))
    ahead = {1: ((40 * 0.05, 1, 0), (1, 0, 0)), 9: ((40 * 0.05 + 2, 1, 0), (0, 0, 0))}
    outputs = scene.pipeline.on_states(scene.message(ahead, 40 * STEP_NS))
    assert outputs is not None
    (row,) = outputs.result.predictions
    assert row["plans"] == PlanFlag.FOLLOWS_A


def test_a_snapshot_keeps_the_alert() -> None:
    scene = scene_of(rules())
    list(scene.run(turning_away, 30))
    snapshot = scene.pipeline.snapshot()
    other = AlertScene([], rules())
    other.pipeline = Pipeline.restored(type(snapshot).decode(snapshot.encode()), "world")
    other.step = scene.step
    assert not list(other.run(turning_away, 10))
    give(other, plan(1, 1.0, y=1.0, at=39 * 0.05))
    assert [each.level for each in other.feed({1: ((2.0, 1, 0), (1, 0, 0))})] == [0]


def test_the_rule_is_listed_and_covers_no_pairs() -> None:
    scene = scene_of(rules(", raise_after: 0.5"))
    list(scene.run(turning_away, 40))
    array = scene.pipeline.raised_alert_array()
    assert len(array.alerts) == 1 and not array.coverage and not len(array.held_back)
    (found,) = rules_in_force(scene.pipeline.rules, array, str)
    assert found.is_whole and found.summary == "covers the plans of cart"
    assert found.values == {
        "left_plan": "cart", "level": "warning", "raise_after [s]": "0.5", "clear_after [s]": "0",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("left_plan: carts", "the class 'carts' is unknown"),
        ("left_plan: cart, level: high", "the level 'high' is unknown"),
        ("left_plan: cart, between: [cart, any]", "the key 'between' is unknown"),
        ("left_plan: cart, warning: {distance: 1}", "the key 'warning' is unknown"),
    ],
)
def test_what_does_not_fit_is_refused(text: str, error: str) -> None:
    with pytest.raises(InputError, match=error):
        Rules.parse(f"{CLASSES}rules: {{off plan: {{{text}}}}}\n")
