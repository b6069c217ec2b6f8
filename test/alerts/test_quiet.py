"""What a rule leaves out: never a certain impact within a time threshold, and nothing because of another threshold."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.alerts.alerts import Alerts
from collision_monitor.alerts.rules import Rules
from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.codec import CollisionAlert
from collision_monitor.records import STATE, PredictionStatus, StateFlag

CLASSES = "classes: {robot: ['robot*'], post: ['post*']}\n"
ROD = {"angular": (0, 0, 2.0), "quaternion": (0, 0, math.sin(math.radians(10)), math.cos(math.radians(10)))}
UP = {"position": (0, 0, 0.5), "linear": (0, 0, 2.0), "acceleration": (0, 0, -9.81), "flags": 2}
START = {"acceleration": (3, 0, 0), "flags": 2}
SHAPES = [cm.Sphere(0.3), cm.Box((1.2, 0.4, 0.5)), cm.Capsule(0.2, 0.8), cm.Cylinder(0.25, 1.0)]
N = 10


def raised(levels: str, shape: Any, state: dict[str, Any], post: Any, place: tuple[float, ...]) -> list[CollisionAlert]:
    """The alerts of one step of a robot and a static post."""
    monitor = cm.Monitor()
    monitor.add(1, shape, name="robot")
    monitor.add(100, post, name="post", static=True, pose=cm.Pose(place))
    row = np.zeros(1, STATE)
    row["id"], row["quaternion"][:, 3] = 1, 1.0
    for name, value in state.items():
        row[name][0] = value
    alerts = Alerts(Rules.parse(f"{CLASSES}rules: {{r: {{between: [robot, post], {levels}}}}}"))
    return alerts.step(monitor, monitor.step(0, row), "map", monitor.name)


SCENES = {
    "a rod that turns away and comes round": (cm.Box((2, 0.1, 0.1)), ROD, cm.Cylinder(0.05, 1), (0.9, 0, 0)),
    "a ball thrown up": (cm.Sphere(0.1), UP, cm.Box((4, 4, 0.2)), (0, 0, -0.1)),
    "a start from rest": (cm.Sphere(0.3), START, cm.Cylinder(0.2, 1), (1.7, 0, 0)),
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(
    "levels",
    [
        "critical: {time_to_collision: 1.8}",
        "critical: {time_to_collision: 1.8, distance: 0.05}",
        "caution: {time_to_collision: 2}, critical: {time_to_collision: 1.8, separation_margin: 0}, "
        "protective_separation: {reaction_time: 0.1, deceleration: 2}",
        "critical: {distance_at_closest_approach: 0.01, time_to_closest_approach: 1.8}",
        "critical: {probability: 0.9}",
    ],
)
def test_a_certain_impact_within_the_time_is_never_quiet(scene: str, levels: str) -> None:
    (alert,) = raised(levels, *SCENES[scene])
    assert alert.level == LEVELS.index("critical") + 1


def test_the_speeds_now_and_at_the_impact_are_two_measures() -> None:
    (alone,) = raised("critical: {time_to_collision: 1.8}", *SCENES["a ball thrown up"])
    (beside,) = raised("critical: {time_to_collision: 1.8, distance: 0.05}", *SCENES["a ball thrown up"])
    assert math.isnan(alone.closing_speed)  # the rule measures nothing of now
    assert beside.closing_speed == pytest.approx(-2.0)
    falls = math.sqrt(2.0**2 + 2 * 9.81 * 0.4)
    assert alone.impact_speed == beside.impact_speed == pytest.approx(falls, abs=5e-3)
    touching = {"position": (0, 0, 0.05), "linear": (0, 0, -1.0)}
    (contact,) = raised("critical: {time_to_collision: 1}", cm.Sphere(0.1), touching, *SCENES["a ball thrown up"][2:])
    assert contact.closing_speed == pytest.approx(1.0)
    assert math.isnan(contact.impact_speed)


def test_what_rests_or_parts_now_stays_quiet_for_thresholds_on_now() -> None:
    near = cm.Sphere(0.3), {}, cm.Cylinder(0.2, 1), (0.8, 0, 0)
    away = cm.Sphere(0.3), {"linear": (-1.0, 0, 0)}, cm.Cylinder(0.2, 1), (0.8, 0, 0)
    for scene in (near, away):
        for levels in ("critical: {distance: 1}", "critical: {distance_at_closest_approach: 1}"):
            assert not raised(levels, *scene)
    touching = cm.Sphere(0.3), {}, cm.Cylinder(0.2, 1), (0.4, 0, 0)  # a pallet on a floor
    assert not raised("critical: {time_to_collision: 1, distance: 1, probability: 0.5}", *touching)


# -- properties over random rules and scenes

MOST = {
    "time_to_collision": 2.0,
    "probability": 0.9,
    "distance": 2.0,
    "distance_at_closest_approach": 1.0,
    "required_deceleration": 4.0,
    "time_headway": 2.0,
    "post_encroachment_time": 2.0,
    "separation_margin": 1.0,
}
SEPARATION = ", protective_separation: {reaction_time: 0.1, deceleration: 2}"


def drawn_levels(generator: np.random.Generator) -> list[dict[str, float]]:
    """Thresholds of three levels, each tighter than those of the level below; some levels are empty."""
    measures = [name for name in MOST if generator.random() < 0.4] or ["time_to_collision"]
    found: list[dict[str, float]] = []
    for level in range(3):
        tight = (1.0, 0.6, 0.3)[level]
        rises = {"required_deceleration": 1.0 / tight, "probability": 1.1 - tight}
        found.append({name: MOST[name] * rises.get(name, tight) for name in measures if generator.random() < 0.6})
    if not any(found):
        found[0] = {measures[0]: MOST[measures[0]]}
    return found


def with_one_more(levels: list[dict[str, float]], generator: np.random.Generator) -> list[dict[str, float]]:
    """The same with one threshold more, on any measure and level, that contradicts none."""
    more = [dict(each) for each in levels]
    for _ in range(50):
        name, level = str(generator.choice(list(MOST))), int(generator.integers(3))
        if name in more[level]:
            continue
        above = name in ("required_deceleration", "probability")
        value = float(generator.uniform(0.1, 1.0) * MOST[name])
        lower = [each[name] for each in more[:level] if name in each]
        higher = [each[name] for each in more[level + 1 :] if name in each]
        if above:
            fits = all(value >= each for each in lower) and all(value <= each for each in higher)
        else:
            fits = all(value <= each for each in lower) and all(value >= each for each in higher)
        if fits:
            more[level][name] = value
            return more
    return more


def text_of(levels: list[dict[str, float]], more: str) -> str:
    parts = [
        f"{LEVELS[k]}: {{{', '.join(f'{name}: {value!r}' for name, value in each.items())}}}"
        for k, each in enumerate(levels)
        if each
    ]
    separation = SEPARATION if any("separation_margin" in each for each in levels) else ""
    return f"{{between: [robot, any], {', '.join(parts)}{separation}{more}}}"


class RandomScene:
    """Robots and posts that drive, turn, accelerate, rest, fall silent and are uncertain, the same for each seed."""

    def __init__(self, seed: int) -> None:
        generator = self._generator = np.random.default_rng(seed)
        self.monitor = cm.Monitor(cm.Profile.named("balanced").replace(uncertainty_samples=64))
        for k in range(N):
            static = k == N - 1
            pose = cm.Pose((0.0, 0.0, 0.0)) if static else None
            name = f"{'robot' if k < N // 2 else 'post'}_{k}"
            self.monitor.add(k, SHAPES[k % 4], name=name, static=static, pose=pose)
        rows = self._rows = np.zeros(N - 1, STATE)
        rows["id"] = np.arange(N - 1)
        rows["position"] = generator.uniform(-2.5, 2.5, (N - 1, 3)) * (1, 1, 0.2)
        angle = generator.uniform(-3, 3, N - 1)
        rows["quaternion"][:, 2], rows["quaternion"][:, 3] = np.sin(angle / 2), np.cos(angle / 2)
        moves, turns, accelerates, doubts = generator.random((4, N - 1)) < np.array([[0.6], [0.4], [0.3], [0.2]])
        rows["linear"] = moves[:, None] * generator.normal(0, 1, (N - 1, 3)) * (1, 1, 0.1)
        rows["angular"][:, 2] = turns * generator.normal(0, 1.5, N - 1)
        rows["acceleration"] = accelerates[:, None] * generator.normal(0, 2, (N - 1, 3)) * (1, 1, 0)
        rows["flags"] = accelerates * StateFlag.ACCELERATION_VALID
        rows["position_stddev"] = doubts * 0.1
        self._silent_from = np.where(generator.random(N - 1) < 0.2, 3, 99)
        self.stamp, self.count = 0, 0

    def step(self) -> Any:
        dt = 0.1
        rows = self._rows
        if self.count:
            rows["position"] += rows["linear"] * dt + 0.5 * rows["acceleration"] * dt**2
            rows["linear"] += rows["acceleration"] * dt
        result = self.monitor.step(self.stamp, rows[self._silent_from > self.count])
        self.stamp += 100_000_000
        self.count += 1
        return result


def levels_of(alerts: Alerts, scene: RandomScene) -> tuple[Any, dict[tuple[str, int, int], int]]:
    """Take a step; return its result, and the level of each raised alert."""
    result = scene.step()
    alerts.step(scene.monitor, result, "map", scene.monitor.name)
    return result, {(each.rule, each.id_a, each.id_b): each.level for each in alerts.raised(0, "map", 0).alerts}


@pytest.mark.parametrize("seed", range(60))
def test_a_further_threshold_or_rule_never_lowers_a_level(seed: int) -> None:
    generator = np.random.default_rng([seed, 1])
    levels = drawn_levels(generator)
    flags = "".join(
        f", {name}: {str(bool(generator.integers(2))).lower()}" for name in ("quiet_at_rest", "quiet_when_parting")
    )
    delays = generator.choice(["", ", raise_after: 0.2", ", clear_after: 0.3", ", raise_after: 0.1, clear_after: 0.2"])
    first = text_of(levels, flags + delays)
    second = text_of(with_one_more(levels, generator), flags + delays)
    other = text_of(drawn_levels(generator), "")
    texts = [f"{CLASSES}rules: {{r: {first}}}", f"{CLASSES}rules: {{r: {second}, s: {other}}}"]
    ways = [(Alerts(Rules.parse(text)), RandomScene(seed)) for text in texts]
    for _ in range(12):
        (_, few), (_, more) = (levels_of(*way) for way in ways)
        lower = {key: (level, more.get(key, 0)) for key, level in few.items() if more.get(key, 0) < level}
        assert not lower, (first, second)


@pytest.mark.parametrize("seed", range(40))
def test_every_certain_impact_within_the_time_raises_whatever_else_a_rule_has(seed: int) -> None:
    generator = np.random.default_rng([seed, 2])
    levels = drawn_levels(generator)
    level = int(generator.integers(3))
    limit = (2.0, 1.2, 0.6)[level]
    for each in levels:
        each.pop("time_to_collision", None)
    levels[level]["time_to_collision"] = limit
    alerts, scene = Alerts(Rules.parse(f"{CLASSES}rules: {{r: {text_of(levels, '')}}}")), RandomScene(seed)
    seen = 0
    for _ in range(8):
        result, found = levels_of(alerts, scene)
        for row in result.predictions[result.predictions["status"] == PredictionStatus.HIT]:
            if row["lower"] <= limit and int(row["id_a"]) < N // 2:  # one of them is a robot
                assert found.get(("r", int(row["id_a"]), int(row["id_b"])), 0) > level
                seen += 1
    SEEN[seed] = seen


SEEN: dict[int, int] = defaultdict(int)


def test_the_scenes_above_have_certain_impacts() -> None:
    for seed in range(6):
        test_every_certain_impact_within_the_time_raises_whatever_else_a_rule_has(seed)
    assert sum(SEEN.values()) > 20


def test_the_text_names_only_thresholds_that_count() -> None:
    (alert,) = raised("critical: {time_to_collision: 1.8, distance: 3}", *SCENES["a ball thrown up"])
    assert "time to collision" in alert.text
    assert "distance" not in alert.text  # it parts now, so its distance raises nothing
