"""The measures against slow versions: distances by `cm.contact` for all pairs, conflicts by small steps of time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.alerts.answered import answered
from collision_monitor.alerts.closest_approach import closest_approaches, sphere_approach
from collision_monitor.alerts.evaluation import evaluate_rule
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.alerts.protective_separation import ProtectiveSeparation
from collision_monitor.alerts.rules import Rules
from collision_monitor.alerts.selection import Classes
from collision_monitor.alerts.traffic import post_encroachment_time, required_deceleration, time_headway
from collision_monitor.motion.stated_motion import Motion

SHAPES = [cm.Sphere(0.4), cm.Box((1.2, 0.5, 0.8)), cm.Capsule(0.3, 0.7), cm.Cylinder(0.25, 1.75)]
N = 24


def made_scene(seed: int) -> tuple[cm.Monitor, list[Any], np.ndarray, np.ndarray]:
    """A monitor after one step with N objects of all shapes, carts (0 to 11) and persons."""
    generator = np.random.default_rng(seed)
    monitor = cm.Monitor()
    for k in range(N):
        monitor.add(k, SHAPES[k % 4], name=f"{'cart' if k < N // 2 else 'person'}_{k}")
    poses = np.hstack([generator.uniform(-4, 4, (N, 3)) * (1, 1, 0.3), generator.normal(size=(N, 4))])
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1)[:, None]
    twists = np.hstack([generator.normal(0, 2, (N, 3)), generator.normal(0, 1, (N, 3))])
    monitor.step(0, np.arange(N), poses, twists)
    return monitor, [SHAPES[k % 4] for k in range(N)], poses, twists


def rules_of(levels: str) -> Rules:
    top = 'classes: {cart: ["cart*"], person: ["person*"]}\n'
    return Rules.parse(f"{top}rules: {{near: {{between: [cart, person], {levels}, quiet_when_parting: false}}}}")


def evaluated(monitor: cm.Monitor, rules: Rules) -> tuple[Any, np.ndarray]:
    scene = MonitoredBodies(monitor.roster, monitor.profile, monitor.now)
    classes = Classes(rules)
    classes.update(monitor.roster)
    result = monitor.last
    assert result is not None
    return evaluate_rule(rules, rules.rules[0], classes, scene, answered(scene, result), np.zeros(0, np.uint64))


def moved(pose: np.ndarray, twist: np.ndarray, t: float) -> cm.Pose:
    return Motion(cm.Pose(pose[:3], pose[3:]), tuple(twist[:3]), tuple(twist[3:])).at(t)


@pytest.mark.parametrize("seed", range(4))
def test_distances_find_exactly_the_pairs_of_brute_force(seed: int) -> None:
    monitor, shapes, poses, _ = made_scene(seed)
    found, level = evaluated(monitor, rules_of("caution: {distance: 1.5}, critical: {distance: 0.4}"))
    reached = {int(key): int(rank) for key, rank in zip(found.keys, level, strict=True) if rank}
    expected = {}
    for a in range(N // 2):
        for b in range(N // 2, N):
            at_a, at_b = (cm.Pose(poses[k, :3], poses[k, 3:]) for k in (a, b))
            contact = cm.contact(shapes[a], at_a, shapes[b], at_b)
            if contact.signed_distance <= 1.5:
                expected[a << 32 | b] = 3 if contact.signed_distance <= 0.4 else 1
                k = int(np.searchsorted(found.keys, np.uint64(a << 32 | b)))
                low, error = found["distance"][k], found["distance_error"][k]
                assert low <= contact.signed_distance + 1e-9
                assert contact.signed_distance <= low + error + 1e-9
    assert reached == expected
    assert len(expected) > 15


@pytest.mark.parametrize("seed", range(3))
def test_the_closest_approach_against_dense_samples(seed: int) -> None:
    monitor, shapes, poses, twists = made_scene(seed)
    scene = MonitoredBodies(monitor.roster, monitor.profile, monitor.now)
    generator = np.random.default_rng(seed)
    i, j = generator.integers(0, N // 2, 12).astype(np.int32), generator.integers(N // 2, N, 12).astype(np.int32)
    slots_i, slots_j = (scene.roster.find_slots(ids.astype(np.uint32)) for ids in (i, j))
    time, least = closest_approaches(scene, slots_i, slots_j, 2.0)
    bound = sphere_approach(scene, slots_i, slots_j, 2.0)
    times = np.linspace(0.0, 2.0, 401)
    for k in range(len(i)):
        a, b = int(i[k]), int(j[k])

        def distance(t: float, a: int = a, b: int = b) -> float:
            x, y = moved(poses[a], twists[a], t), moved(poses[b], twists[b], t)
            return cm.contact(shapes[a], x, shapes[b], y).signed_distance

        distances = list(map(distance, times))
        if min(distances) <= 0.0:
            assert least[k] <= 0.0
            continue
        assert least[k] <= min(distances) + 1e-9
        assert least[k] == pytest.approx(min(distances), abs=0.05)
        assert bound[k] <= least[k] + 1e-9
        assert distance(time[k]) <= min(distances) + 0.02


def test_a_pair_whose_distance_grows_has_its_closest_approach_now() -> None:
    monitor = cm.Monitor()
    monitor.add(1, SHAPES[0])
    monitor.add(2, SHAPES[0])
    monitor.step(0, [1, 2], [(0, 0, 0, 0, 0, 0, 1), (3, 0, 0, 0, 0, 0, 1)], [(-1, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 0)])
    scene = MonitoredBodies(monitor.roster, monitor.profile, monitor.now)
    time, least = closest_approaches(scene, np.array([0], np.int32), np.array([1], np.int32), 2.0)
    assert time[0] == 0.0
    assert least[0] == pytest.approx(2.2, abs=0.01)


def _passing_time(p: np.ndarray, u: np.ndarray, q: np.ndarray, v: np.ndarray, reach: float) -> float:
    """Post-encroachment time of two discs, by small steps: when each is on the other's lane, which has no end."""
    times = np.arange(-20.0, 20.0, 0.002)

    def on_lane(a: np.ndarray, along_a: np.ndarray, b: np.ndarray, along_b: np.ndarray) -> np.ndarray:
        off = a + times[:, None] * along_a - b
        across = off - (off @ along_b)[:, None] * along_b / (along_b @ along_b)
        return times[np.sqrt((across**2).sum(axis=1)) <= reach]

    first, second = on_lane(p, u, q, v), on_lane(q, v, p, u)
    return max(first.min(), second.min()) - min(first.max(), second.max())


@pytest.mark.parametrize("seed", range(20))
def test_the_post_encroachment_time_against_small_steps(seed: int) -> None:
    generator = np.random.default_rng(seed)
    monitor = cm.Monitor(cm.Profile.named("balanced").replace(horizon=8.0))
    monitor.add(0, cm.Sphere(0.4))
    monitor.add(1, cm.Sphere(0.3))
    angle = generator.uniform(0.5, 2.6)
    u = np.array([1.0, 0, 0]) * generator.uniform(1, 2)
    v = np.array([np.cos(angle), np.sin(angle), 0]) * generator.uniform(1, 2)
    p, q = -u * generator.uniform(1, 5), -v * generator.uniform(1, 5)
    poses = np.array([[*p, 0, 0, 0, 1], [*q, 0, 0, 0, 1]])
    monitor.step(0, [0, 1], poses, np.array([[*u, 0, 0, 0], [*v, 0, 0, 0]]))
    scene = MonitoredBodies(monitor.roster, monitor.profile, monitor.now)
    pair = np.array([0], np.int32), np.array([1], np.int32)
    expected = max(_passing_time(p, u, q, v, 0.7), 0.0)
    found, turned = post_encroachment_time(scene, *pair, 8.0)[0], post_encroachment_time(scene, *pair[::-1], 8.0)[0]
    assert found == turned
    assert found == pytest.approx(expected, abs=0.01)


def test_paths_that_do_not_cross_have_no_post_encroachment_time() -> None:
    monitor = cm.Monitor()
    for k in range(4):
        monitor.add(k, cm.Sphere(0.4))
    poses = np.zeros((4, 7))
    poses[:, 6] = 1.0
    poses[:, :3] = [(-3, 0, 0), (-3, 2, 0), (0, -2, 3), (3, 0, 0)]
    twists = np.zeros((4, 6))
    twists[:, :3] = [(1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 0)]  # along, parallel, above, at rest
    monitor.step(0, range(4), poses, twists)
    scene = MonitoredBodies(monitor.roster, monitor.profile, monitor.now)
    others = np.array([1, 2, 3], np.int32)
    assert np.isinf(post_encroachment_time(scene, np.zeros(3, np.int32), others, 2.0)).all()


def test_braking_with_the_required_deceleration_stops_at_contact() -> None:
    for distance, closing in ((2.0, 3.0), (0.1, 1.0), (5.0, 0.2)):
        (needed,) = required_deceleration(np.array([distance]), np.array([closing]))
        gap, speed, dt = distance, closing, 1e-5
        while speed > 0.0:
            gap, speed = gap - speed * dt, speed - needed * dt
        assert gap == pytest.approx(0.0, abs=1e-3)
    away = required_deceleration(np.array([1.0, -0.1, 0.0]), np.array([-1.0, 0.0, 1.0]))
    assert away.tolist() == [0.0, np.inf, np.inf]


def test_the_headway_is_that_of_the_faster_one() -> None:
    distance, toward_a = np.array([2.0, 2.0, 2.0, -1.0]), np.array([1.0, -1.0, -1.0, 1.0])
    found = time_headway(distance, toward_a, np.array([0.5, 4.0, -0.1, 1.0]))
    assert found.tolist() == [2.0, 0.5, np.inf, 0.0]


@pytest.mark.parametrize("robot", [0.0, 0.4, 1.5])
@pytest.mark.parametrize("human", [-1.0, 0.0, 2.5])
def test_the_protective_separation_distance_against_a_simulated_stop(robot: float, human: float) -> None:
    separation = ProtectiveSeparation(0.2, 0.0, 1.5, 1.6, 0.1, 0.05, 0.02)
    time, dt, speed, nearer = 0.0, 1e-4, robot, 0.0
    while time < 0.2 or speed > 0.0:
        nearer += (max(human, 1.6) + speed) * dt
        speed = max(speed - 1.5 * dt, 0.0) if time >= 0.2 else speed
        time += dt
    (found,) = separation.distance(np.array([robot]), np.array([human]))
    assert found == pytest.approx(nearer + 0.17, abs=2e-3)


def test_a_constant_stopping_time_is_never_shorter_than_uniform_braking() -> None:
    uniform = ProtectiveSeparation(0.1, deceleration=2.0).distance(np.array([1.0]), np.array([0.0]))
    constant = ProtectiveSeparation(0.1, stopping_time=0.5).distance(np.array([1.0]), np.array([0.0]))
    assert constant[0] - uniform[0] == pytest.approx(0.25)  # v Ts in place of v Ts / 2


def test_the_margin_counts_the_first_class_as_the_robot() -> None:
    monitor = cm.Monitor()
    monitor.add(1, cm.Sphere(0.5), name="person_1")
    monitor.add(2, cm.Sphere(0.5), name="cart_1")
    monitor.step(0, [1, 2], [(0, 0, 0, 0, 0, 0, 1), (4, 0, 0, 0, 0, 0, 1)], [(0, 0, 0, 0, 0, 0), (-1, 0, 0, 0, 0, 0)])
    rules = rules_of("caution: {separation_margin: 5}, protective_separation: {reaction_time: 0.1, deceleration: 1}")
    found, level = evaluated(monitor, rules)
    assert level.tolist() == [1]
    assert found["separation_margin"][0] == pytest.approx(3.0 - (1.6 * 1.1 + 0.1 + 0.5), abs=1e-6)
