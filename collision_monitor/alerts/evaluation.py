"""Evaluates a rule after a step: finds its pairs, measures them, and compares them with the thresholds."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.closest_approach import closest_approaches, sphere_approach
from collision_monitor.alerts.measures import COLUMNS, Array, Measures, Slots
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.quiet import quiet_pairs
from collision_monitor.alerts.rules import Rule, Rules
from collision_monitor.alerts.selection import Classes, select
from collision_monitor.alerts.thresholds import APPROACH
from collision_monitor.alerts.traffic import post_encroachment_time, required_deceleration, time_headway
from collision_monitor.broad_phase.box_pairs import box_pairs
from collision_monitor.impact.impact_record import ids_of_keys, pair_keys
from collision_monitor.monitor.candidates import filters_of, keep_checked
from collision_monitor.monitor.nearest_points import nearest_points_at

REACH: Final = 1.0 + 1e-9
"""Factor on distances that decide which pairs are measured, so that rounding loses none."""


def evaluate_rule(
    rules: Rules, rule: Rule, classes: Classes, scene: MonitoredBodies, answers: Measures, raised: NDArray[np.uint64]
) -> tuple[Measures, NDArray[np.uint8]]:
    """Return the measures of the rule's pairs, and the level (n,) whose thresholds each of them passes; 0: none.

    answers: of all pairs in the answers. raised: keys of the pairs whose alert is raised, which are measured as well.
    """
    if rule.is_of_plans:
        return _off_plan(rule, classes, scene)
    found = answers.take(select(rules, rule, classes, scene, answers))
    if rule.needs_states:
        found = _with_near(rules, rule, classes, scene, found, raised)
        _measure(rule, classes, scene, found)
    found.uncertain |= scene.stale[found.i] | scene.stale[found.j]
    found.reached = _levels(rule, found)
    found.quiet = quiet_pairs(rule, scene, found)
    return found, _levels(rule, found)


def _off_plan(rule: Rule, classes: Classes, scene: MonitoredBodies) -> tuple[Measures, NDArray[np.uint8]]:
    """Return the members of the rule's class that left their plans, each of them as a pair with itself."""
    ids = np.array(scene.off_plan, np.uint32)
    slots = scene.roster.find_slots(ids)
    chosen = classes.of(rule.between[0])[slots] & scene.present[slots] & (slots >= 0)
    ids, slots = ids[chosen], slots[chosen]
    found = Measures(pair_keys(ids, ids), slots, slots)
    for name in COLUMNS:
        found[name] = np.full(len(ids), np.nan)
    found.uncertain = scene.stale[slots]
    found.reached = np.full(len(ids), rule.levels[0].level, np.uint8)
    return found, found.reached


def _levels(rule: Rule, found: Measures) -> NDArray[np.uint8]:
    level = np.zeros(len(found), np.uint8)
    for each in rule.levels:
        level[each.met(found)] = each.level
    return level


def _with_near(
    rules: Rules, rule: Rule, classes: Classes, scene: MonitoredBodies, found: Measures, raised: NDArray[np.uint64]
) -> Measures:
    """Return the measures with the pairs added that are near enough to pass a threshold, and the raised ones."""
    i, j = _near(rule, classes, scene)
    ids = scene.roster.bodies.id
    keys = pair_keys(np.minimum(ids[i], ids[j]), np.maximum(ids[i], ids[j]))
    keys = np.unique(np.concatenate([found.keys, keys, raised]))
    i, j = (scene.roster.find_slots(ids.astype(np.uint32)) for ids in ids_of_keys(keys))
    both = Measures(keys, i, j)
    both = both.take(select(rules, rule, classes, scene, both) | np.isin(keys, found.keys))
    both.fill(found)
    return both


def _near(rule: Rule, classes: Classes, scene: MonitoredBodies) -> tuple[Slots, Slots]:
    """Return the pairs of bodies whose spheres, grown by their reaches, meet and that the monitor checks."""
    first, second = map(classes.of, rule.between)
    which = np.flatnonzero(scene.present & (first | second))
    half = scene.radius[which] + scene.doubt[which] + _reach(rule, scene, which)
    half = np.repeat(half[:, None] * REACH, 3, axis=1)
    fewer = first if np.count_nonzero(first) <= np.count_nonzero(second) else second
    pairs = which[box_pairs(scene.position[which], half, fewer[which])].astype(np.int32)
    pairs = pairs[: keep_checked(*filters_of(scene.roster.bodies), scene.roster.allowed_keys, pairs)]
    return pairs[:, 0], pairs[:, 1]


def _reach(rule: Rule, scene: MonitoredBodies, slots: NDArray[np.intp]) -> Array:
    """Return for each body (n,) the distance (m) that it adds to the largest at which its pairs pass a threshold."""
    speed, horizon = scene.speed[slots], scene.profile.horizon
    reach = np.zeros(len(slots))
    for level in rule.levels:
        for name, value in level.values.items():
            match name:
                case "distance":
                    one = np.full(len(slots), 0.5 * max(value, 0.0))
                case "distance_at_closest_approach":
                    bent = np.sqrt((scene.acceleration[slots] ** 2).sum(axis=1)) + scene.bending[slots]
                    one = 0.5 * value + speed * horizon + 0.5 * bent * horizon**2
                case "required_deceleration":
                    one = speed**2 / max(value, 1e-9)  # (a + b)^2 <= 2 a^2 + 2 b^2
                case "time_headway":
                    one = speed * value
                case "post_encroachment_time":
                    one = speed * (horizon + value)
                case "separation_margin":
                    assert rule.separation is not None
                    one = rule.separation.distance(speed, speed) + 0.5 * max(value, 0.0)
                case _:
                    continue
            reach = np.maximum(reach, one)
    return reach


def _measure(rule: Rule, classes: Classes, scene: MonitoredBodies, found: Measures) -> None:
    """Measure the pairs from the states."""
    i, j, wanted = found.i, found.j, rule.measures
    limits = np.full(len(i), np.inf)
    now, acceleration = np.full(len(i), scene.now), scene.profile.stale_acceleration
    near = nearest_points_at(scene.roster.multibody, i, j, now, limits, acceleration, scene.scratch)
    distance = near.distance - near.error
    found["distance"], found["distance_error"] = distance, 2.0 * near.error
    found["closing_speed"], found.points = near.closing, near.points
    speed_i = (scene.velocity_at(i, near.points[:, 0]) * near.normal).sum(axis=1)  # of i toward j
    speed_j = -(scene.velocity_at(j, near.points[:, 1]) * near.normal).sum(axis=1)
    if "required_deceleration" in wanted:
        found["required_deceleration"] = required_deceleration(distance, near.closing)
    if "time_headway" in wanted:
        found["time_headway"] = time_headway(distance, speed_j, speed_i)
    if rule.separation is not None:
        here, _ = classes.orders(rule.between, i, j)
        robot, human = np.where(here, speed_i, speed_j), np.where(here, speed_j, speed_i)
        found["separation_margin"] = distance - rule.separation.distance(robot, human)
    if "post_encroachment_time" in wanted:
        found["post_encroachment_time"] = post_encroachment_time(scene, i, j, scene.profile.horizon)
    if APPROACH[0] in wanted:
        _approach(rule, scene, found)


def _approach(rule: Rule, scene: MonitoredBodies, found: Measures) -> None:
    """Measure the closest approach of the pairs whose bounding spheres come near enough."""
    horizon = scene.profile.horizon
    largest = max(level.values.get(APPROACH[0], 0.0) for level in rule.levels)
    bound = sphere_approach(scene, found.i, found.j, horizon)
    which = np.flatnonzero(bound <= largest * REACH)
    time, distance = closest_approaches(scene, found.i[which], found.j[which], horizon, largest)
    found["distance_at_closest_approach"][which], found["time_to_closest_approach"][which] = distance, time
