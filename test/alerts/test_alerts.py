"""Alerts of a pipeline: one message for each change, from the steps and their stamps alone."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import (
    AlertCause,
    Removal,
    decode_alert,
    decode_alerts,
    decode_states,
    encode_alert,
    encode_states,
)
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.settings_event import encode_settings
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Cylinder, Sphere
from test.helpers.alert_scene import CLASSES, STEP_NS, AlertScene, States, rules_of

CART = ObjectDescription(1, Box((2.0, 1.0, 1.0)), name="cart")
PERSON = ObjectDescription(2, Cylinder(0.25, 1.75), name="person_1")
TIMES = "caution: {time_to_collision: 2}, warning: {time_to_collision: 1}, critical: {time_to_collision: 0.3}"


def passing(time: float) -> States:
    """A cart at 2 m/s drives through a person who stands at x = 5."""
    return {1: ((2.0 * time, 0, 0), (2.0, 0, 0)), 2: ((5.0, 0, 0), (0, 0, 0))}


def standing(distance: float) -> States:
    return {1: ((0, 0, 0),), 2: ((1.25 + distance, 0, 0),)}


def levels(alerts: Any) -> list[tuple[float, int, int]]:
    return [(round(time, 3), alert.previous_level, alert.level) for time, alert in alerts]


def test_a_pass_raises_each_level_once_and_clears() -> None:
    scene = AlertScene([CART, PERSON], rules_of(TIMES, ", clear_after: 0.2"))
    found = list(scene.run(passing, 100))
    # contact from t = 1.875 to 3.125 s; parting touching pairs are still touching
    assert levels(found) == [(0.0, 0, 1), (0.9, 1, 2), (1.6, 2, 3), (3.3, 3, 0)]
    assert [alert.number for _, alert in found] == [1, 2, 3, 4]
    assert {(alert.id_a, alert.id_b, alert.name_a, alert.name_b) for _, alert in found} == {(1, 2, "cart", "person_1")}
    assert {(alert.class_a, alert.class_b) for _, alert in found} == {("cart", "person")}
    assert {alert.since_ns for _, alert in found} == {0}
    assert found[1][1].time_to_collision == pytest.approx(0.975, abs=0.06)
    assert "time to collision 0.9" in found[1][1].text
    assert "(below 1 s)" in found[1][1].text


def test_without_rules_there_is_nothing() -> None:
    scene = AlertScene([CART, PERSON], Rules())
    assert not list(scene.run(passing, 100))
    assert "alerts" not in scene.pipeline.snapshot().facts
    assert set(scene.pipeline.settings()) == {"profile"}


def test_a_condition_has_to_last() -> None:
    scene = AlertScene([CART, PERSON], rules_of("caution: {distance: 1}", ", raise_after: 0.1, quiet_at_rest: false"))
    near, far = standing(0.5), standing(3.0)
    assert not [a for k in range(12) for a in scene.feed(near if k % 3 else far)]
    changes = [scene.feed(near) for _ in range(4)]
    assert [len(each) for each in changes] == [1, 0, 0, 0]  # two steps before were near already
    assert [len(scene.feed(far)) for _ in range(3)] == [1, 0, 0]


def test_pairs_that_rest_or_part_are_quiet_unless_the_rule_wants_them() -> None:
    rests = AlertScene([CART, PERSON], rules_of("caution: {distance: 1}"))
    assert not rests.feed(standing(0.5))
    parts: States = {1: ((0, 0, 0), (-1, 0, 0)), 2: ((1.75, 0, 0),)}
    assert not AlertScene([CART, PERSON], rules_of("caution: {distance: 1}")).feed(parts)
    assert AlertScene([CART, PERSON], rules_of("caution: {distance: 1}, quiet_when_parting: false")).feed(parts)
    assert AlertScene([CART, PERSON], rules_of("caution: {distance: 1}, quiet_at_rest: false")).feed(standing(0.5))
    closes: States = {1: ((0, 0, 0), (1, 0, 0)), 2: ((1.75, 0, 0),)}
    assert AlertScene([CART, PERSON], rules_of("caution: {distance: 1}")).feed(closes)
    touching_and_parting: States = {1: ((0, 0, 0), (-1, 0, 0)), 2: ((1.2, 0, 0),)}
    assert AlertScene([CART, PERSON], rules_of("caution: {distance: 1}")).feed(touching_and_parting)


def test_a_stale_object_keeps_its_alert() -> None:
    ghost = ObjectDescription(3, Sphere(0.1), name="other")
    scene = AlertScene([CART, PERSON, ghost], rules_of("caution: {distance: 1}", ", quiet_at_rest: false"))
    assert scene.feed({**standing(0.5), 3: ((50, 0, 0),)})[0].level == 1
    for _ in range(40):  # 2 s without a word about cart and person
        assert not scene.feed({3: ((50, 0, 0),)})
    (cleared,) = scene.feed({**standing(9.0), 3: ((50, 0, 0),)})
    assert (cleared.previous_level, cleared.level) == (1, 0)


def test_a_stale_object_raises_by_its_widened_bounds() -> None:
    ghost = ObjectDescription(3, Sphere(0.1), name="other")
    scene = AlertScene([CART, PERSON, ghost], rules_of("caution: {distance: 1}"))
    assert not scene.feed({**standing(3.0), 3: ((50, 0, 0),)})
    found = [alert for _ in range(40) for alert in scene.feed({3: ((50, 0, 0),)})]
    (raised,) = found  # 1 m/s² for both: 3 m - t² <= 1 m from 1.41 s on
    assert raised.stamp_ns == pytest.approx(1.45e9, abs=1e8)
    assert raised.cause == AlertCause.UNRESOLVED
    assert "(not settled, or stale)" in raised.text


def test_an_unresolved_pair_raises_and_does_not_clear() -> None:
    scene = AlertScene([CART, PERSON], rules_of(TIMES), profile=Profile.named("balanced").replace(pairs_per_step=1))
    many = [ObjectDescription(k, Box((2.0, 1.0, 1.0)), name=f"cart_{k}") for k in range(3, 40)]
    scene.describe(*many)
    crowd: States = {k: ((0.3 * k, 0, 0), (1.0, 0, 0)) for k in (1, *range(3, 40))}
    first = scene.feed({**crowd, 2: ((8.0, 0.1, 0), (-1, 0, 0))})
    unresolved = [each for each in first if each.cause == AlertCause.UNRESOLVED]
    assert unresolved
    assert all(each.level > 0 for each in unresolved)


def test_a_removed_object_ends_its_alert() -> None:
    scene = AlertScene([CART, PERSON], rules_of("caution: {distance: 1}", ", quiet_at_rest: false, clear_after: 5"))
    scene.feed(standing(0.5))
    scene.describe(Removal(2))
    (ended,) = scene.feed({1: ((0, 0, 0),)})
    assert (ended.level, ended.cause, ended.name_b) == (0, AlertCause.REMOVED, "person_1")
    assert "an object was removed" in ended.text
    assert not scene.feed({1: ((0, 0, 0),)})


def test_one_side_first_and_the_other_side_first_are_the_same() -> None:
    swapped = [replace(CART, object_id=2), replace(PERSON, object_id=1)]
    rules = rules_of(
        "caution: {distance: 2, required_deceleration: 1}, warning: {separation_margin: 0.5}",
        ", protective_separation: {reaction_time: 0.1, deceleration: 2}",
    )
    one = list(AlertScene([CART, PERSON], rules).run(passing, 80))
    other = list(AlertScene(swapped, rules).run(lambda t: dict(zip((2, 1), passing(t).values(), strict=True)), 80))
    assert levels(one) == levels(other)
    for (_, a), (_, b) in zip(one, other, strict=True):
        assert (a.class_a, a.class_b) == (b.class_b, b.class_a)
        for name in ("distance", "required_deceleration", "separation_margin", "closing_speed"):
            assert getattr(a, name) == pytest.approx(getattr(b, name), abs=1e-9, nan_ok=True)


def test_a_rigid_motion_of_the_scene_changes_no_level() -> None:
    rules = rules_of("caution: {distance: 2, post_encroachment_time: 1}, warning: {time_headway: 0.5}")
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

    def moved(time: float) -> States:
        return {k: (turn @ p + (100, -50, 7), *(turn @ v for v in rest)) for k, (p, *rest) in passing(time).items()}

    turned = [replace(CART, shapes=Box((1.0, 2.0, 1.0))), PERSON]
    assert levels(AlertScene([CART, PERSON], rules).run(passing, 80)) == levels(
        AlertScene(turned, rules).run(moved, 80)
    )


def test_static_pairs_groups_and_allowed_pairs_are_left_out() -> None:
    rules = rules_of("caution: {distance: 1}", ", quiet_at_rest: false")
    fixed = [
        replace(CART, static=True, pose=Pose()),
        replace(PERSON, static=True, pose=Pose((1.5, 0, 0))),
    ]
    assert not AlertScene(fixed, rules).feed({})
    assert not AlertScene([replace(CART, mask=2), PERSON], rules).feed(standing(0.5))
    assert not AlertScene([replace(CART, allowed=(2,)), PERSON], rules).feed(standing(0.5))
    allowed = rules_of("caution: {distance: 1}", ", quiet_at_rest: false", top="allowed: [[person, cart]]")
    assert not AlertScene([CART, PERSON], allowed).feed(standing(0.5))
    assert AlertScene([CART, PERSON], rules).feed(standing(0.5))


@pytest.mark.parametrize(
    ("zone", "key", "is_raised"),
    [
        ("{box: [[-9, -9, -9], [9, 9, 9]]}", "inside", True),
        ("{box: [[5, 5, 5], [9, 9, 9]]}", "inside", False),
        ("{box: [[-9, -9, -9], [9, 9, 9]]}", "outside", False),
        ("{box: [[-9, -9, -9], [1, 9, 9]]}", "outside", True),  # the person is not wholly in it
        ("{half_space: [1, 0, 0, -0.5]}", "inside", True),  # the cart reaches into it
        ("{half_space: [1, 0, 0, -1.9]}", "inside", False),
        ("{polygon: [[-9, -9], [9, -9], [0, 9]], z: [5, 6]}", "inside", False),
    ],
)
def test_zones(zone: str, key: str, is_raised: bool) -> None:
    rules = rules_of("caution: {distance: 1}", f", quiet_at_rest: false, {key}: [area]", f"zones: {{area: {zone}}}")
    assert bool(AlertScene([CART, PERSON], rules).feed(standing(0.5))) is is_raised


def test_probability_counts_what_is_declared() -> None:
    rules = rules_of("caution: {probability: 0.3}, critical: {probability: 0.99}")
    certain = AlertScene([CART, PERSON], rules).feed(passing(1.5))
    assert (certain[0].level, certain[0].probability) == (3, 1.0)
    scene = AlertScene([CART, PERSON], rules)
    data = scene.message({1: ((0, 0.8, 0), (2, 0, 0)), 2: ((3.0, 0, 0), (0, 0, 0))}, 0)
    states = decode_states(data).states.copy()
    states["position_stddev"] = 0.2
    outputs = scene.pipeline.on_states(encode_states(0, "world", 0, states))
    assert outputs is not None
    (alert,) = map(decode_alert, outputs.alerts)
    assert alert.level == 1
    assert 0.3 < alert.probability < 0.6
    assert math.isinf(alert.time_to_collision)  # as stated they pass each other


def test_all_raised_alerts_are_listed_with_the_highest_first() -> None:
    far = ObjectDescription(3, Cylinder(0.25, 1.75), name="person_2")
    scene = AlertScene([CART, PERSON, far], rules_of(TIMES))
    scene.feed({**passing(1.0), 3: ((2.0 + 1.25 + 3.0, 0, 0),)})
    array = decode_alerts(scene.pipeline.raised_alerts())
    assert [(each.level, each.id_b) for each in array.alerts] == [(2, 2), (1, 3)]
    assert (array.highest, array.number, array.step) == (2, 2, 1)


# -- changes at run time


def test_a_rule_that_keeps_its_name_goes_on_and_others_end() -> None:
    scene = AlertScene([CART, PERSON], rules_of("caution: {distance: 1}", ", quiet_at_rest: false"))
    scene.feed(standing(0.5))
    more = "caution: {distance: 2}, critical: {distance: 0.6}"
    scene.pipeline.change_rules(rules_of(more, ", quiet_at_rest: false"), 0)
    (rises,) = scene.feed(standing(0.5))
    assert (rises.previous_level, rises.level, rises.since_ns) == (1, 3, 0)
    other = Rules.parse(f"{CLASSES}rules: {{else: {{between: [cart, any], caution: {{distance: 1}}}}}}")
    scene.pipeline.change_rules(other, 0)
    (ended,) = scene.feed(standing(0.5))
    assert (ended.rule, ended.level, ended.cause) == ("near", 0, AlertCause.REMOVED)
    assert "the rule was removed" in ended.text
    scene.pipeline.change_rules(Rules(), 0)
    assert not scene.feed(standing(0.5))
    assert scene.pipeline.settings()["rules"] == ""


def test_a_damaged_change_of_rules_is_refused_and_counted() -> None:
    scene = AlertScene([CART, PERSON], rules_of("caution: {distance: 1}", ", quiet_at_rest: false"))
    scene.pipeline.on_settings(encode_settings(0, "", {"rules": "rules: ["}))
    assert "expected YAML" in scene.pipeline.monitor.last_refusal
    assert scene.feed(standing(0.5))


def test_a_time_that_is_set_back_keeps_the_alert() -> None:
    scene = AlertScene([CART, PERSON], rules_of("caution: {distance: 1}", ", quiet_at_rest: false, clear_after: 0.3"))
    begin = 1_000_000_000_000
    assert scene.feed(standing(0.5), begin)
    for k in range(3):
        assert not scene.feed(standing(0.5), k * STEP_NS)
    changes = [scene.feed(standing(9.0), k * STEP_NS) for k in range(3, 12)]
    assert [len(each) for each in changes].count(1) == 1


@pytest.mark.parametrize("cut", [7, 25, 41])
def test_a_snapshot_continues_with_the_same_alerts(cut: int) -> None:
    rules = rules_of(
        "caution: {time_to_collision: 2, distance: 3, distance_at_closest_approach: 0.5}, warning: {time_headway: 0.5}",
        ", raise_after: 0.12, clear_after: 0.4",
    )
    whole = AlertScene([CART, PERSON], rules)
    expected: list[bytes] = []
    for k in range(80):
        if k == cut:
            snapshot = whole.pipeline.snapshot()
        found = whole.feed(passing(k * STEP_NS * 1e-9))
        expected += map(encode_alert, found if k >= cut else [])
    rest = AlertScene([], Rules())
    rest.pipeline, rest.step = Pipeline.restored(type(snapshot).decode(snapshot.encode()), "world"), cut
    assert [encode_alert(alert) for _, alert in rest.run(passing, 80 - cut)] == expected
    assert expected
