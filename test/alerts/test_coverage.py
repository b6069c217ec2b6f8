"""Whom the rules cover, what they hold back from people, and what they name and nothing monitors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from collision_monitor.alerts.missing_objects import MOST, MissingObject
from collision_monitor.alerts.name_patterns import may_name
from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import CollisionAlertArray, Removal, decode_alerts
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Box, Cylinder, Sphere
from test.helpers.alert_scene import STEP_NS, AlertScene, States

ROBOT = ObjectDescription(1, Box((1.0, 1.0, 1.0)), name="robot_1")
PERSON = ObjectDescription(2, Cylinder(0.25, 1.75), name="person_1")
CRATE = ObjectDescription(3, Sphere(0.5), name="crate")
CLASSES = 'classes: {robot: ["robot*"], person: ["person*"], load: [{group: 4}], seven: [7]}\n'
APART: States = {1: ((0, 0, 0),), 2: ((3, 0, 0),), 3: ((0, 9, 0),)}


def rules_with(rule: str, top: str = "") -> Rules:
    return Rules.parse(f"{CLASSES}{top}\nrules: {{r: {{{rule}}}}}\n")


def after_a_step(rules: Rules, states: States = APART, *objects: ObjectDescription) -> CollisionAlertArray:
    scene = AlertScene(objects or (ROBOT, PERSON, CRATE), rules)
    scene.feed(states)
    return decode_alerts(scene.pipeline.raised_alerts(number=5))


def sides(array: CollisionAlertArray) -> dict[str, list[int]]:
    return {each.against: each.ids.tolist() for each in array.coverage}


@pytest.mark.parametrize(
    ("between", "expected"),
    [
        ("[robot, any]", {"any": [1]}),  # a crate is met as `any` only: the rule says nothing of crates and persons
        ("[robot, person]", {"person": [1], "robot": [2]}),
        ("[person, person]", {"person": [2]}),
        ("any", {"any": [1, 2, 3]}),
        ("[seven, any]", {"any": []}),
    ],
)
def test_a_rule_covers_the_objects_of_the_classes_that_it_names(between: str, expected: dict[str, list[int]]) -> None:
    array = after_a_step(rules_with(f"between: {between}, caution: {{distance: 1}}"))
    assert sides(array) == expected
    assert (array.rule_names, array.monitor, array.unmonitored) == (("r",), 5, ())


def test_without_rules_nothing_is_covered() -> None:
    array = after_a_step(Rules())
    assert (array.rule_names, array.coverage, array.alerts) == ((), (), ())


@pytest.mark.parametrize(
    ("top", "covered"),
    [
        ("allowed: [[robot, any]]", []),
        ("allowed: [[any, any]]", []),
        ("allowed: [[robot, robot]]", [1]),
        ("allowed: [[robot, person]]", [1]),  # it is still compared with the crate
        ("zones: {here: {box: [[-2, -2, -2], [2, 2, 2]]}}", [1]),
    ],
)
def test_allowed_pairs_leave_out_only_whom_they_leave_nobody(top: str, covered: list[int]) -> None:
    assert sides(after_a_step(rules_with("between: [robot, any], caution: {distance: 1}", top))) == {"any": covered}


def test_zones_leave_out_objects_whose_pairs_they_may_leave_out() -> None:
    zone = "zones: {here: {box: [[-2, -2, -2], [2, 2, 2]]}}"
    rule = "between: [robot, any], caution: {distance: 1}"
    there: States = {**APART, 1: ((8, 0, 0),)}
    assert sides(after_a_step(rules_with(f"{rule}, inside: [here]", zone))) == {"any": [1]}
    assert sides(after_a_step(rules_with(f"{rule}, inside: [here]", zone), there)) == {"any": []}
    assert sides(after_a_step(rules_with(f"{rule}, outside: [here]", zone))) == {"any": []}
    assert sides(after_a_step(rules_with(f"{rule}, outside: [here]", zone), there)) == {"any": [1]}


def test_an_object_that_the_monitor_checks_with_nobody_is_not_covered() -> None:
    from dataclasses import replace

    rules = rules_with("between: [robot, any], caution: {distance: 1}")
    masked = replace(ROBOT, mask=2)
    assert sides(after_a_step(rules, APART, masked, PERSON, CRATE)) == {"any": []}
    assert sides(after_a_step(rules, APART, masked, replace(PERSON, group=2), CRATE)) == {"any": [1]}
    assert sides(after_a_step(rules, {1: APART[1]}, masked)) == {"any": [1]}  # nobody else is there


def test_an_object_without_a_state_and_a_removed_one_are_not_covered() -> None:
    rules = rules_with("between: [robot, any], caution: {distance: 1}")
    scene = AlertScene((ROBOT, PERSON), rules)
    scene.feed({2: APART[2]})
    assert sides(decode_alerts(scene.pipeline.raised_alerts())) == {"any": []}
    scene.feed({1: APART[1], 2: APART[2]})
    assert sides(decode_alerts(scene.pipeline.raised_alerts())) == {"any": [1]}
    scene.describe(Removal(1))
    assert scene.pipeline.empty_classes == ["robot", "load", "seven"]
    scene.feed({2: APART[2]})
    assert sides(decode_alerts(scene.pipeline.raised_alerts())) == {"any": []}


@pytest.mark.parametrize(
    ("levels", "reach", "ahead", "is_fit"),
    [
        ("caution: {distance: 2.5}, critical: {distance: 0.5}", 2.5, 0.0, True),
        ("caution: {time_to_collision: 1.5}", 0.0, 1.5, False),
        ("caution: {time_to_collision: 9}, critical: {distance: 0.5}", 0.5, 2.0, True),  # the horizon is 2 s
        ("caution: {distance_at_closest_approach: 0.5, time_to_closest_approach: 1}", 0.0, 1.0, True),
        ("caution: {required_deceleration: 2}", 0.0, 0.0, False),
        (
            "caution: {separation_margin: 0}, protective_separation: {reaction_time: 0.1, deceleration: 1}",
            *(0.0, math.inf, True),
        ),
    ],
)
def test_what_a_rule_is_sure_to_see(levels: str, reach: float, ahead: float, is_fit: bool) -> None:
    (one,) = after_a_step(rules_with(f"between: [robot, any], {levels}")).coverage
    assert (one.reach, one.ahead, not one.unfit) == (reach, ahead, is_fit)


def test_before_the_first_step_nothing_that_moves_is_covered() -> None:
    scene = AlertScene((ROBOT, PERSON), rules_with("between: [robot, any], caution: {distance: 1}"))
    array = decode_alerts(scene.pipeline.raised_alerts([MissingObject("person", "no message", 5)]))
    assert (array.step, sides(array), [each.name for each in array.unmonitored]) == (0, {"any": []}, ["person"])


def test_rules_that_change_before_the_next_step_are_known_at_once() -> None:
    scene = AlertScene((ROBOT, PERSON), Rules())
    scene.feed({1: APART[1], 2: APART[2]})
    scene.pipeline.change_rules(rules_with("between: [robot, any], caution: {distance: 1}"), 0)
    assert scene.pipeline.empty_classes == ["load", "seven"]
    assert sides(decode_alerts(scene.pipeline.raised_alerts())) == {"any": [1]}


# -- pairs that people need not hear of


def test_what_rests_parts_or_has_not_lasted_is_told_to_guards() -> None:
    rule = "between: [robot, person], caution: {distance: 4}, critical: {distance: 2}, raise_after: 0.1"
    scene = AlertScene((ROBOT, PERSON), rules_with(rule))
    rests: States = {1: ((0, 0, 0),), 2: ((2, 0, 0),)}
    assert not scene.feed(rests)
    (pair,) = decode_alerts(scene.pipeline.raised_alerts()).held_back
    assert (pair["id_a"], pair["id_b"], pair["level"], pair["rule"]) == (1, 2, 3, 0)
    assert pair["distance"] == pytest.approx(1.25)
    assert pair["point_b"][0] == pytest.approx(1.75)
    parts: States = {1: ((0, 0, 0), (-1, 0, 0)), 2: ((2, 0, 0),)}
    assert not scene.feed(parts)
    (pair,) = decode_alerts(scene.pipeline.raised_alerts()).held_back
    assert pair["closing_speed"] == pytest.approx(-1.0)
    nears: States = {1: ((0, 0, 0), (1, 0, 0)), 2: ((4, 0, 0),)}
    assert not scene.feed(nears)  # caution has to last
    array = decode_alerts(scene.pipeline.raised_alerts())
    assert (len(array.alerts), [int(each["level"]) for each in array.held_back]) == (0, [1])
    scene.feed(nears, 4 * STEP_NS)
    array = decode_alerts(scene.pipeline.raised_alerts())
    assert ([each.level for each in array.alerts], len(array.held_back)) == ([1], 0)
    scene.feed({**nears, 2: ((2, 0, 0),)}, 5 * STEP_NS)
    array = decode_alerts(scene.pipeline.raised_alerts())
    assert ([each.level for each in array.alerts], array.held_back["level"].tolist()) == ([1], [3])


# -- what is not monitored


def test_silent_objects_are_listed_with_whom_they_concern() -> None:
    rules = Rules.parse(
        f"{CLASSES}allowed: [[robot, load]]\nrules: {{a: {{between: [robot, any], caution: {{distance: 1}}}}, "
        "b: {between: [robot, person], caution: {distance: 1}}}\n"
    )
    load = ObjectDescription(4, Sphere(0.1), name="load_1", group=4)
    scene = AlertScene((ROBOT, PERSON, CRATE, load), rules)
    scene.feed({1: APART[1], 2: APART[2]})
    first = decode_alerts(scene.pipeline.raised_alerts())
    assert [(each.against, each.rule) for each in first.coverage] == [("any", "a"), ("person", "b"), ("robot", "b")]
    named = {each.name: (each.coverage, each.is_silent, each.reason) for each in first.unmonitored}
    assert named == {
        "crate": ((0,), True, "no state so far"),
        "load_1": ((), True, "no state so far"),  # its contact with robots is allowed
    }
    for k in range(1, 30):
        scene.feed({1: APART[1], 3: APART[3], 4: ((0, -9, 0),)}, k * STEP_NS)
    (person,) = decode_alerts(scene.pipeline.raised_alerts()).unmonitored
    assert (person.name, person.coverage, person.since_ns) == ("person_1", (0, 1), 0)


@pytest.mark.parametrize(
    ("name", "coverage"),
    [("person_7", (0, 1)), ("person", (0, 1)), ("wall", (0,)), ("robot_3", (0, 2)), ("robot_1", (0, 2))],
)
def test_missing_objects_concern_the_rules_that_may_name_them(name: str, coverage: tuple[int, ...]) -> None:
    rules = Rules.parse(
        'classes: {robot: ["robot*"], person: ["person_*"]}\nrules: {a: {between: [robot, any], caution: '
        "{distance: 1}}, b: {between: [robot, person], caution: {distance: 1}}}\n"
    )
    scene = AlertScene((ROBOT, PERSON), rules)
    scene.feed({1: APART[1], 2: APART[2]})
    missing = [MissingObject(name, "no message on /topic yet", 5)]
    (one,) = decode_alerts(scene.pipeline.raised_alerts(missing)).unmonitored
    assert (one.name, one.reason, one.since_ns, one.is_silent) == (name, missing[0].reason, 5, False)
    assert one.coverage == coverage


def test_a_long_list_ends_with_an_element_that_concerns_all() -> None:
    scene = AlertScene((ROBOT,), rules_with("between: [robot, person], caution: {distance: 1}"))
    scene.feed({1: APART[1]})
    missing = [MissingObject(f"wall_{k}", "no frame", k) for k in range(MOST + 3)]
    found = decode_alerts(scene.pipeline.raised_alerts(missing)).unmonitored
    assert (len(found), found[0].coverage, found[-1].coverage) == (MOST + 1, (), (0, 1))
    assert found[-1].reason == "3 further ones are not listed"


@pytest.mark.parametrize(
    ("pattern", "stem", "may"),
    [
        ("traffic*", "traffic", True), ("t*", "traffic", True), ("*", "x", True), ("traffic_7", "traffic", True),
        ("arm/tool", "arm", True), ("arm/*", "arm", True), ("*_7", "traffic", True), ("traffic", "traffic", True),
        ("truck*", "traffic", False), ("traffic", "traffic_7", False), ("traffic2", "traffic", False), ("", "a", False),
    ],
)  # fmt: skip
def test_patterns_that_may_match_a_group(pattern: str, stem: str, may: bool) -> None:
    assert may_name(pattern, stem) is may


def test_held_back_pairs_of_many_rules_keep_their_order() -> None:
    rules = Rules.parse(
        f"{CLASSES}rules: {{a: {{between: [robot, any], caution: {{distance: 9}}}}, "
        "b: {between: any, caution: {distance: 20}}}\n"
    )
    rows = after_a_step(rules).held_back
    assert list(zip(*(rows[name].tolist() for name in ("rule", "id_a", "id_b")), strict=True)) == [
        *((0, 1, 2), (0, 1, 3), (1, 1, 2), (1, 1, 3), (1, 2, 3)),
    ]
    assert np.isfinite(rows["distance"]).all()
