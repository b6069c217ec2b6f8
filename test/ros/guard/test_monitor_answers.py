"""Why a guard cannot rely on the monitor's answers: each reason by itself, and none when all is well."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from collision_monitor.codec import (
    CollisionAlertArray,
    ObjectDescriptionArray,
    ObjectStateArray,
    Removal,
    RuleCoverage,
    UnmonitoredObject,
)
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import HELD_BACK, STATE
from collision_monitor.ros.guard.guard_limits import GuardLimits
from collision_monitor.ros.guard.guarded_objects import GuardedObjects
from collision_monitor.ros.guard.monitor_answers import HEARD, ClockReading, Fault, MonitorAnswers
from collision_monitor.ros.guard.speed_limit import Braking
from collision_monitor.shapes.registry import Sphere

SECOND = 1_000_000_000
T = 100 * SECOND
NAMES = {1: "base", 2: "six/arm", 3: "six/tool", 4: "person_1", 5: "wall"}


def covering(ids: Sequence[int] = (1, 2, 3), rule: str = "guard", **fields: Any) -> RuleCoverage:
    given = {"against": "any", "reach": 2.5, "ahead": 0.0, "unfit": "", **fields}
    return RuleCoverage(rule=rule, ids=np.array(ids, np.uint32), **given)


def answer(**fields: Any) -> CollisionAlertArray:
    given = {"monitor": 7, "rule_names": ("guard",), "coverage": (covering(),), **fields}
    return CollisionAlertArray(given.pop("stamp_ns", T), "map", given.pop("step", 9), 0, 0, (), **given)


def robot(names: dict[int, str] = NAMES, patterns: Sequence[str] = ("base", "six/*")) -> GuardedObjects:
    made = GuardedObjects(tuple(patterns), patterns[0])
    objects = tuple(ObjectDescription(k, Sphere(0.1), name=name) for k, name in names.items())
    made.describe(ObjectDescriptionArray(0, "map", True, objects))
    made.move(states(list(names)), 0.0)
    return made


def states(ids: Sequence[int], stamp_ns: int = T, **fields: Any) -> ObjectStateArray:
    rows = np.zeros(len(ids), STATE)
    rows["id"], rows["quaternion"][:, 3] = ids, 1.0
    for name, value in fields.items():
        rows[name] = value
    return ObjectStateArray(stamp_ns, "map", 0, rows, np.zeros(0))


def fault(array: CollisionAlertArray | None = None, own: GuardedObjects | None = None, **time: float) -> Fault | None:
    """The fault after one answer; time: of the look, by the stamps' clock and the steady one (s)."""
    answers = MonitorAnswers("object_monitor", GuardLimits())
    answers.take(answer() if array is None else array, 0.0)
    now = ClockReading(T + round(time.get("clock", 0.0) * SECOND), time.get("steady", 0.0))
    return answers.fault(robot() if own is None else own, now)


def text(found: Fault | None) -> str:
    assert found is not None
    return found.text


def test_there_is_no_fault_when_all_is_well() -> None:
    assert fault() is None
    assert fault(clock=0.25, steady=0.25) is None


def test_nothing_heard_is_a_fault() -> None:
    answers = MonitorAnswers("object_monitor", GuardLimits())
    assert text(answers.fault(robot(), ClockReading(T, 0.0))) == "no status of object_monitor: does the monitor run?"


@pytest.mark.parametrize(
    ("array", "time", "expected"),
    [
        (answer(step=0), {}, "no step of object_monitor yet"),
        (answer(), {"steady": 0.4}, "no step of object_monitor for 0.4 s"),
        (answer(stamp_ns=T - 2 * SECOND), {}, "the answers of object_monitor are 2.0 s old"),
        (answer(stamp_ns=T + SECOND), {}, "are 1.0 s ahead of the guard's clock: another clock"),
        (answer(stamp_ns=0), {"clock": 3e8}, "the answers of object_monitor are 3472 days old"),
    ],
)
def test_late_answers_are_a_fault(array: CollisionAlertArray, time: dict[str, float], expected: str) -> None:
    assert expected in text(fault(array, **time))


def test_the_same_step_again_is_no_news() -> None:
    answers = MonitorAnswers("object_monitor", GuardLimits())
    for k in range(5):
        answers.take(answer(), 0.1 * k)  # the monitor repeats its last step
    assert text(answers.fault(robot(), ClockReading(T, 0.4))) == "no step of object_monitor for 0.4 s"


def test_two_monitors_and_a_restarted_one_are_a_fault_until_one_is_left() -> None:
    answers, own = MonitorAnswers("object_monitor", GuardLimits()), robot()
    answers.take(answer(), 0.0)
    answers.take(answer(monitor=8, step=10), 0.1)
    assert "2 monitors answer as object_monitor" in text(answers.fault(own, ClockReading(T, 0.1)))
    for k in range(2, 14):
        answers.take(answer(monitor=8, step=10 + k), 0.1 * k)
    own.move(states([1, 2, 3], T + 1), 1.3)
    assert answers.fault(own, ClockReading(T, 1.3)) is None
    assert HEARD < 1.3


def test_every_name_needs_an_object() -> None:
    own = robot({1: "base", 4: "person_1"})
    assert text(fault(own=own)) == "no object is named 'six/*'"
    assert text(fault(own=robot(patterns=("turtle", "base")))) == "no object is named 'turtle'"


def test_every_object_of_the_robot_needs_a_fresh_state() -> None:
    own = robot()
    own.describe(ObjectDescriptionArray(0, "map", False, (ObjectDescription(6, Sphere(0.1), name="six/cam"),)))
    wide = answer(coverage=(covering((1, 2, 3, 6)),))
    assert text(fault(wide, own)) == "no state of 'six/cam' so far"
    own.move(states([6], T - 5 * SECOND), 0.0)
    assert text(fault(wide, own)) == "the states of 'six/cam' are 5.0 s old"
    own.move(states([6], T - SECOND // 10), 0.0)
    assert fault(wide, own) is None
    own.move(states([6], T), -0.5)
    assert text(fault(wide, own)) == "no state of 'six/cam' for 0.5 s"
    own.move(states([6], T), 0.0)
    assert text(fault(wide, own)) == "no state of 'six/cam' for 0.5 s"  # a stamp that stands still is no news
    own.move(states([6], T + 1, position=(np.nan, 0, 0)), 0.0)
    assert text(fault(wide, own)) == "no state of 'six/cam' for 0.5 s"


def test_every_object_of_the_robot_has_to_be_covered() -> None:
    assert "no rule in force covers 'six/tool' now; the rules are 'guard'" in text(
        fault(answer(coverage=(covering((1, 2)),)))
    )
    assert "covers 'base', 'six/arm', 'six/tool'" in text(fault(answer(coverage=(covering(()),))))
    assert text(fault(answer(rule_names=(), coverage=()))).startswith("no alerts of object_monitor: has it rules?")
    two = answer(coverage=(covering((1,)), covering((2, 3), "arms")))
    assert fault(two) is None


@pytest.mark.parametrize(
    ("one", "expected"),
    [
        (UnmonitoredObject("six/forearm", "six: no file", T), "part of the robot: six: no file"),
        (UnmonitoredObject("six", "no message on /joint_states yet", T), "part of the robot"),
        (UnmonitoredObject("", "3 further ones are not listed", T, False, (0,)), "part of the robot: 3 further"),
        (UnmonitoredObject("shelf", "shelf: no frame", T, False, (0,)), "though the rules name it: shelf: no frame"),
        (UnmonitoredObject("shelf", "shelf: no frame", T, False, (1,)), ""),
        (UnmonitoredObject("shelf", "shelf: no frame", T, False, ()), ""),
        (UnmonitoredObject("person_1", "no usable new state", T - 2 * SECOND, True, (0,)), "'person_1': no usable new"),
        (UnmonitoredObject("person_1", "no usable new state", T - SECOND // 2, True, (0,)), ""),
        (UnmonitoredObject("person_1", "no usable new state", T - 2 * SECOND, True, (1,)), ""),
    ],
)
def test_what_is_not_monitored_is_a_fault_where_it_concerns_the_robot(one: UnmonitoredObject, expected: str) -> None:
    array = answer(coverage=(covering(), covering((4,), "people", against="robot")), unmonitored=(one,))
    found = fault(array)
    assert (found is None) if not expected else expected in text(found)


def test_a_fault_keeps_its_kind_while_only_numbers_change() -> None:
    first, second = fault(steady=0.4), fault(steady=7.0)
    assert first is not None
    assert second is not None
    assert first.kind == second.kind
    assert first.text != second.text


# -- what the answers say of the robot


def test_pairs_of_the_robot_with_itself_and_of_others_do_not_count() -> None:
    answers, own = MonitorAnswers("object_monitor", GuardLimits()), robot()
    rows = np.zeros(4, HELD_BACK)
    rows["id_a"], rows["id_b"] = [1, 1, 3, 4], [2, 4, 5, 5]
    rows["level"], rows["distance"] = [3, 2, 1, 3], [0.1, 0.2, 0.3, 0.4]
    rows["point_a"][:, 0], rows["point_b"][:, 0] = 1.0, 2.0
    answers.take(answer(held_back=rows), 0.0)
    found = list(answers.near(own))
    assert [(pair.part, pair.other, pair.level, pair.distance) for pair in found] == [
        (1, "person_1", 2, 0.2),
        (3, "wall", 1, 0.3),
    ]
    assert (found[0].at[0], found[0].to[0]) == (1.0, 2.0)
    assert "base and person_1: warning by rule 'guard', without an alert yet" in found[0].text


def test_the_speed_is_limited_by_the_object_whose_rules_see_least() -> None:
    braking, answers, own = Braking(), MonitorAnswers("object_monitor", GuardLimits()), robot()
    short = covering((1, 2, 3), "people", against="person", reach=0.5)
    answers.take(answer(coverage=(covering(), short)), 0.0)
    assert answers.fastest(own, braking) == braking.speed(2.5, 0.0)  # the rule against every object sees farther
    answers.take(answer(coverage=(covering((1, 2)), covering((3,), reach=1.0))), 0.0)
    assert answers.fastest(own, braking) == braking.speed(1.0, 0.0)
    both = covering(against="person", reach=5.0), covering(rule="shelves", against="shelf", reach=1.0)
    answers.take(answer(coverage=both), 0.0)
    assert answers.fastest(own, braking) == braking.speed(1.0, 0.0)


def test_rules_that_do_not_see_what_stands_near_are_worth_a_warning() -> None:
    answers, own = MonitorAnswers("object_monitor", GuardLimits()), robot()
    blind = covering((2,), "times", unfit="it has no threshold on a distance")
    answers.take(answer(coverage=(covering((1, 3)), blind)), 0.0)
    (doubt,) = answers.doubts(own)
    assert doubt.startswith("rule 'times' of 'six/arm': it has no threshold on a distance")
    answers.take(answer(coverage=(covering(), blind)), 0.0)
    assert not answers.doubts(own)


# -- objects


def test_a_snapshot_replaces_all_objects_and_a_removal_one() -> None:
    own = robot()
    assert (own.base, list(own.names)) == (1, [1, 2, 3])
    own.describe(ObjectDescriptionArray(0, "map", False, (Removal(3),)))
    assert list(own.names) == list(own.states) == [1, 2]
    renamed = ObjectDescription(2, Sphere(0.1), name="shelf")
    own.describe(ObjectDescriptionArray(0, "map", False, (renamed,)))
    assert list(own.names) == list(own.states) == [1]
    own.describe(ObjectDescriptionArray(0, "map", True, (ObjectDescription(9, Sphere(0.1), name="six/a"),)))
    assert (own.base, own.names, own.states) == (None, {9: "six/a"}, {})


def test_a_snapshot_for_a_new_subscriber_leaves_the_places() -> None:
    own = robot()
    objects = tuple(ObjectDescription(k, Sphere(0.1), name=name) for k, name in {**NAMES, 3: "six/other"}.items())
    own.describe(ObjectDescriptionArray(0, "map", True, objects))
    assert list(own.states) == [1, 2]  # 3 is another object now


def test_an_unknown_velocity_counts_as_none() -> None:
    own = robot()
    own.move(states([1], T + 1, linear=(np.nan, 0, 0), angular=(0, 0, 0.5)), 0.0)
    pose = own.states[1].pose
    assert (pose.linear, pose.angular) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))


def test_a_late_state_of_one_object_is_found_among_many() -> None:
    array = answer(coverage=(covering(range(1, 40)),))
    own = robot({1: "base", **{k: f"six/{k}" for k in range(2, 40)}})
    assert fault(array, own) is None
    old = own.states[17]
    own.states[17] = old._replace(stamp_ns=T - SECOND)
    assert text(fault(array, own)) == "the states of 'six/17' are 1.0 s old"
