"""Arcs and stops: against integration, against dense samples for every kind of shape, in the monitor and in batches."""

from __future__ import annotations

import pickle
from math import inf
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor import Motion, Pose, contact, time_of_impact
from collision_monitor.errors import PoseError
from collision_monitor.motion.moved_states import moved_states
from collision_monitor.records import STATE, StateFlag
from collision_monitor.settings.profile import Profile

SECOND = 1_000_000_000
VALID, UNKNOWN = int(StateFlag.ACCELERATION_VALID), int(StateFlag.TWIST_UNKNOWN)
BODY, STOPS = int(StateFlag.BODY_TWIST), int(StateFlag.STOPS)

Array = NDArray[np.float64]


def torus(radius: float, tube: float, around: int, across: int) -> tuple[Array, NDArray[np.int64]]:
    """Corners and triangles of a closed torus."""
    u, v = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across, indexing="ij")
    ring = radius + tube * np.cos(v)
    corners = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    at = lambda a, b: (a % around) * across + b % across  # noqa: E731
    first = np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], axis=-1).reshape(-1, 3)
    second = np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], axis=-1).reshape(-1, 3)
    return corners, np.concatenate([first, second])


SHAPES: dict[str, Any] = {
    "sphere": cm.Sphere(0.4),
    "box": cm.Box((0.9, 0.5, 0.4)),
    "capsule": cm.Capsule(0.2, 0.8),
    "cylinder": cm.Cylinder(0.3, 0.8),
    "cone": cm.Cone(0.3, 0.8),
    "ellipsoid": cm.Ellipsoid((0.5, 0.3, 0.2)),
    "hull": cm.ConvexHull(np.random.default_rng(3).normal(size=(14, 3)) * 0.3),
    "compound": [(cm.Box((0.8, 0.2, 0.2)), Pose((0.3, 0, 0))), (cm.Sphere(0.2), Pose((-0.4, 0.3, 0.1)))],
    "mesh": cm.Mesh(*torus(0.5, 0.15, 12, 6)),
    "cloud": cm.Points(np.random.default_rng(4).normal(size=(60, 3)) * 0.3, 0.02),
}


def exponential(A: Array) -> Array:
    """exp(A) of a small matrix, by its series after halvings."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(), 1e-30)))) + 4)
    term = result = np.eye(len(A))
    for k in range(1, 16):
        term = term @ (A / 2.0**halvings) / k
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


def integrated(motion: dict[str, Any], duration: float, steps: int = 200_000) -> Array:
    """Pose (4, 4) after some time: the exponential of the twist along the body's own axes, for the time it has turned.

    The speed of both changes as the acceleration along the velocity says, until the body stands.
    """
    v, w, a = (np.array(motion[name], float) for name in ("linear", "angular", "acceleration"))
    t = (np.arange(steps) + 0.5) * duration / steps
    factor = 1.0 + a @ v / (v @ v) * t
    seconds = (np.maximum(factor, 0.0) if motion["stops"] else factor).sum() * duration / steps
    twist = np.zeros((4, 4))
    twist[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    twist[:3, 3] = v
    return np.asarray(Pose(motion["position"], motion["quaternion"]).matrix @ exponential(seconds * twist))


def random_motion(rng: np.random.Generator, *, brakes: bool, stops: bool) -> dict[str, Any]:
    q = rng.normal(size=4)
    v, w = rng.normal(size=3), rng.normal(size=3) * rng.choice([0.05, 0.7, 3.0])
    a = (rng.uniform(-1.5, 0.8) if brakes else 0.0) * v
    return {
        "position": rng.normal(size=3), "quaternion": q / np.linalg.norm(q), "linear": v, "angular": w,
        "acceleration": a, "stops": stops,
    }  # fmt: skip


def stated(given: dict[str, Any]) -> Motion:
    pose = Pose(given["position"], given["quaternion"])
    twist = given["linear"], given["angular"], given["acceleration"]
    return Motion(pose, *twist, frame="body", stops=given["stops"])


@pytest.mark.parametrize(("brakes", "stops"), [(False, False), (True, False), (True, True)])
def test_the_place_on_a_course_is_that_of_the_exponential(brakes: bool, stops: bool) -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        given = random_motion(rng, brakes=brakes, stops=stops)
        t = rng.uniform(0.1, 3.0)
        assert np.abs(stated(given).at(t).matrix - integrated(given, t)).max() < 1e-9


def test_an_arc_of_a_tiny_angle_is_a_line_and_neighbours_agree() -> None:
    still = Motion(Pose(), (1, 2, 3), (0, 0, 0), frame="body")
    assert still.is_straight
    before = still.at(2.0).position
    for rate in 10.0 ** np.array([*np.arange(-300, -6, 9.0), -162.0, -161.0, -9.0]):
        at = Motion(Pose(), (1, 2, 3), (0, 0, rate), frame="body").at(2.0).position
        assert np.abs(at - before).max() <= 10.0 * rate + 1e-15
    series = [
        Motion(Pose(), (1, 0, 0), (0, 0, 0.25 * f), frame="body").at(2.0).position for f in (1 - 1e-12, 1 + 1e-12)
    ]
    assert np.abs(series[0] - series[1]).max() < 1e-11


def test_a_body_that_brakes_stands_and_one_that_reverses_says_so() -> None:
    brakes = Motion(Pose(), (2, 0, 0), (0, 0, 1), (-1, 0, 0), stops=True)
    assert brakes.at(2.0).position == pytest.approx((2, 0, 0)) and brakes.at(50.0).position == pytest.approx((2, 0, 0))
    assert brakes.at(50.0).quaternion == pytest.approx(brakes.at(2.0).quaternion)
    back = Motion(Pose(), (2, 0, 0), (0, 0, 0), (-1, 0, 0))
    assert back.at(6.0).position == pytest.approx((-6, 0, 0))
    assert "stands from 2 s on" in repr(brakes) and "arc" in repr(Motion(Pose(), (1, 0, 0), (0, 0, 1), frame="body"))
    again = pickle.loads(pickle.dumps(brakes))
    assert again.numbers == brakes.numbers and again.pose.numbers == brakes.pose.numbers


def test_a_frame_that_is_neither_is_refused() -> None:
    with pytest.raises(PoseError, match=r"frame: expected 'world' or 'body', got 'base_link'"):
        Motion(Pose(), frame="base_link")  # type: ignore[arg-type]


def meeting_pair(rng: np.random.Generator) -> tuple[Motion, Motion]:
    """Two motions that come near each other at some time; at least one bends or brakes."""
    one = stated(random_motion(rng, brakes=bool(rng.integers(2)), stops=bool(rng.integers(2))))
    given = random_motion(rng, brakes=bool(rng.integers(2)), stops=bool(rng.integers(2)))
    kind, t = rng.integers(3), rng.uniform(0.2, 1.8)

    def other(position: Array) -> Motion:
        pose = Pose(position, given["quaternion"])
        if kind == 0:
            return Motion(pose, given["linear"], given["angular"], given["acceleration"], stops=True)
        return stated({**given, "position": position}) if kind == 1 else Motion(pose)

    away = one.at(t).position - other(np.zeros(3)).at(t).position
    return one, other(away + rng.normal(size=3) * 0.6)


def least_distance(a: Any, one: Motion, b: Any, other: Motion, times: Array) -> float:
    """Least distance at some times, less its error."""
    found = (contact(a, one.at(t), b, other.at(t)) for t in times)
    return min((each.signed_distance - each.error_bound for each in found), default=inf)


@pytest.mark.parametrize("kinds", list(zip(SHAPES, [*list(SHAPES)[3:], *list(SHAPES)[:3]], strict=True)), ids="-".join)
def test_the_impact_is_where_dense_samples_find_it(kinds: tuple[str, str]) -> None:
    rng = np.random.default_rng(sum(map(ord, "".join(kinds))))
    a, b = SHAPES[kinds[0]], SHAPES[kinds[1]]
    statuses = []
    for _ in range(40):
        one, other = meeting_pair(rng)
        found = time_of_impact(a, one, b, other, horizon=2.0)
        statuses.append(found.status)
        if found.lower > 0.0:  # nothing is late
            assert least_distance(a, one, b, other, np.linspace(0.0, min(found.lower, 2.0), 60)[:-1]) > -1e-9
        if found.status == "hit":
            at = contact(a, one.at(found.upper), b, other.at(found.upper))
            assert at.signed_distance <= at.error_bound
            assert (
                found.lower == 0.0 or contact(a, one.at(found.lower), b, other.at(found.lower)).signed_distance < 2e-6
            )
        swapped = time_of_impact(b, other, a, one, horizon=2.0)
        assert swapped.lower == pytest.approx(found.lower, abs=2e-5)
    assert statuses.count("hit") > 8 and "clear" in statuses
    assert statuses.count("unresolved") <= 2


def test_the_batch_answers_as_the_single_call() -> None:
    rng = np.random.default_rng(12)
    given = [[random_motion(rng, brakes=True, stops=True) for _ in range(60)] for _ in range(2)]
    for pair in zip(*given, strict=True):
        pair[1]["position"] = pair[0]["position"] + rng.normal(size=3)
    poses, twists, accelerations = (
        [np.array([np.concatenate([each[name] for name in names]) for each in side]) for side in given]
        for names in (("position", "quaternion"), ("linear", "angular"), ("acceleration",))
    )
    a, b = SHAPES["box"], SHAPES["cylinder"]
    found = cm.times_of_impact(
        a, poses[0], twists[0], b, poses[1], twists[1], 2.0,
        accelerations_a=accelerations[0], accelerations_b=accelerations[1], frame="body", stops=True,
    )  # fmt: skip
    for k, (one, other) in enumerate(zip(*given, strict=True)):
        single = time_of_impact(a, stated(one), b, stated(other), 2.0)
        assert (single.status, single.lower, single.upper) == (found.status[k], found.lower[k], found.upper[k])
        assert found[k].status == single.status
    assert {"hit", "clear"} <= set(found.status)


def test_a_moved_and_turned_scene_has_the_same_times() -> None:
    rng = np.random.default_rng(13)
    for _ in range(60):
        given = [random_motion(rng, brakes=True, stops=True) for _ in range(2)]
        X = Pose(rng.normal(size=3) * 10.0, random_motion(rng, brakes=False, stops=False)["quaternion"])
        times = []
        for moves in (False, True):
            motions = []
            for each in given:
                pose = Pose(each["position"], each["quaternion"])
                pose = X @ pose if moves else pose
                motions.append(stated({**each, "position": pose.position, "quaternion": pose.quaternion}))
            times.append(time_of_impact(SHAPES["box"], motions[0], SHAPES["hull"], motions[1]))
        assert times[0].status == times[1].status
        assert times[0].lower == pytest.approx(times[1].lower, abs=1e-5)


def states_of(given: list[dict[str, Any]], flags: int) -> NDArray[np.void]:
    rows = np.zeros(len(given), STATE)
    rows["id"] = np.arange(1, len(given) + 1)
    for name in ("position", "quaternion", "linear", "angular", "acceleration"):
        rows[name] = [each[name] for each in given]
    rows["flags"] = flags
    return rows


@pytest.mark.parametrize("age", [0.0, 0.4])
def test_the_monitor_predicts_along_the_course_also_from_late_states(age: float) -> None:
    rng = np.random.default_rng(14)
    hits = 0
    for _ in range(40):
        given = [random_motion(rng, brakes=True, stops=True) for _ in range(2)]
        t = rng.uniform(0.3, 2.0)
        given[1]["position"] += stated(given[0]).at(t).position - stated(given[1]).at(t).position
        given[1]["position"] += rng.normal(size=3) * 0.4
        a, b = SHAPES["box"], SHAPES["capsule"]
        monitor = cm.Monitor(Profile(stale_acceleration=0.0))
        monitor.add(1, a)
        monitor.add(2, b)
        monitor.step(SECOND, states_of(given, BODY | STOPS | VALID))
        now = SECOND + round(age * SECOND)
        result = monitor.step(now, np.zeros(0, STATE))
        motions = [stated(each) for each in given]
        exact = time_of_impact(a, motions[0], b, motions[1], horizon=2.0 + age)
        rows = result.predictions
        distance = contact(a, motions[0].at(age), b, motions[1].at(age)).signed_distance
        if distance <= 0.0:
            assert len(result.contacts) == 1
            assert result.contacts["signed_distance"][0] == pytest.approx(distance, abs=1e-6)
        elif exact.status == "hit" and exact.lower > age:
            hits += 1
            assert len(rows) == 1 and rows["lower"][0] == pytest.approx(exact.lower - age, abs=2e-3)
            assert rows["lower"][0] <= exact.upper - age and rows["upper"][0] >= exact.lower - age
        elif exact.status == "clear":
            assert not len(rows)
    assert hits > 8


def test_a_robot_that_follows_its_arc_is_not_predicted_anew() -> None:
    monitor = cm.Monitor()
    monitor.add(1, cm.Box((0.6, 0.4, 0.3)))
    monitor.add(2, cm.Sphere(0.3))
    arc = Motion(Pose(), (1, 0, 0), (0, 0, 0.5), frame="body")
    given = {"linear": (1, 0, 0), "angular": (0, 0, 0.5), "acceleration": (0, 0, 0)}
    still = {"position": (50, 0, 0), "quaternion": (0, 0, 0, 1), **dict.fromkeys(given, (0, 0, 0))}
    moved = 0
    for k in range(100):
        pose = arc.at(0.05 * k)
        rows = states_of([{**given, "position": pose.position, "quaternion": pose.quaternion}, still], BODY)
        moved += monitor.step(SECOND + 50_000_000 * k, rows).status.objects_moved
    assert moved == 2  # both are new in the first step


def test_the_twist_of_an_arc_is_estimated_from_poses() -> None:
    arc = Motion(
        Pose((1, 2, 3), Pose.from_euler(0.1, 0.2, 0.3).quaternion), (1, 0.2, 0.1), (0.1, 0.2, 0.8), frame="body"
    )
    target = arc.at(1.9)
    monitor = cm.Monitor("exact")
    monitor.add(1, cm.Sphere(0.1))
    monitor.add(2, cm.Sphere(0.05))
    still = {"position": target.position, "quaternion": (0, 0, 0, 1)}
    zero = dict.fromkeys(("linear", "angular", "acceleration"), (0, 0, 0))
    for t in (0.0, 0.2):
        pose = arc.at(t)
        rows = states_of([{"position": pose.position, "quaternion": pose.quaternion, **zero}, {**still, **zero}], 0)
        rows["flags"][0] = BODY | UNKNOWN
        result = monitor.step(SECOND + round(t * SECOND), rows)
    exact = time_of_impact(cm.Sphere(0.1), arc, cm.Sphere(0.05), Motion(Pose(target.position)))
    assert result.predictions["lower"][0] == pytest.approx(exact.lower - 0.2, abs=1e-6)


def test_the_speed_of_a_turn_that_starts_does_not_run_away() -> None:
    """A robot that turns in place and begins to drive keeps its rate of turn."""
    starts = Motion(Pose(), (1e-3, 0, 0), (0, 0, 0.5), (0.5, 0, 0), frame="body")
    angles = [2.0 * np.arctan2(*starts.at(t).quaternion[2:]) for t in (1.0, 2.0)]
    assert angles == pytest.approx([0.5, 1.0])


def test_a_rate_whose_square_underflows_is_no_clear() -> None:
    slow = Motion(Pose(), (10, 0, 0), (0, 0, 1e-162), frame="body")
    assert time_of_impact(cm.Sphere(0.5), slow, cm.Sphere(0.5), Motion(Pose((10, 0, 0)))).status == "hit"


def test_round_off_decides_no_course() -> None:
    """A velocity along the axis of rotation, and an acceleration across it, at any heading."""
    for yaw in np.linspace(0.0, 6.0, 40):
        pose = Pose((0, 0, 0), Pose.from_euler(0, 0, yaw).quaternion)
        at = Motion(pose, (1, 0, 0), (0.1, 0, 0), (0, 2, 0), frame="body").at(2.0).position
        assert pose.rotation.T @ at == pytest.approx((2, 4, 0))
    aside = [Motion(Pose(), (10, 0, 0), (0, 0, w), (0, 3, 0), frame="body").at(2.0).position[1] for w in (0.0, 1e-12)]
    assert aside == pytest.approx([6.0, 6.0])


def test_a_body_that_reverses_is_followed_through_its_standstill() -> None:
    """Its first state is exactly as old as it takes to stand."""
    given = {"position": (0, 0, 0), "quaternion": (0, 0, 0, 1), "linear": (2, 0, 0), "angular": (0, 0, 0.1)}
    wall = {"position": (-2, 0, 0), "quaternion": (0, 0, 0, 1), "linear": (0, 0, 0), "angular": (0, 0, 0)}
    rows = states_of([{**given, "acceleration": (-1, 0, 0)}, {**wall, "acceleration": (0, 0, 0)}], BODY | VALID)
    times = []
    for age in (1.9, 2.0, 2.1):
        monitor = cm.Monitor(Profile(stale_acceleration=0.0, horizon=6.0))
        monitor.add(1, cm.Sphere(0.3))
        monitor.add(2, cm.Box((0.2, 4, 4)))
        monitor.step(SECOND, rows)
        found = monitor.step(SECOND + round(age * SECOND), np.zeros(0, STATE)).predictions
        times.append(age + float(found["lower"][0]))
    assert times == pytest.approx([times[0]] * 3, abs=5e-3)


def test_a_scene_in_the_plane_drops_the_acceleration_out_of_it() -> None:
    monitor = cm.Monitor()
    monitor.add(1, cm.Circle(0.3))
    monitor.add(2, cm.Circle(0.3))
    moving = {"position": (0, 0, 0), "quaternion": (0, 0, 0, 1), "linear": (2, 0, 0), "angular": (0, 0, 0)}
    behind = {**moving, "position": (-3, 0, 0), "linear": (0, 0, 0), "acceleration": (0, 0, 0)}
    rows = states_of([{**moving, "acceleration": (-1, 0, 9.81)}, behind], VALID | STOPS)
    assert not len(monitor.step(SECOND, rows).predictions)


def test_states_moved_twice_are_those_moved_once() -> None:
    rng = np.random.default_rng(17)
    given = [random_motion(rng, brakes=True, stops=bool(k % 2)) for k in range(40)]
    for flags in (BODY | VALID, BODY | VALID | STOPS, VALID | STOPS, BODY):
        rows = states_of(given, flags)
        twice, once = moved_states(moved_states(rows, 0.2), 0.3), moved_states(rows, 0.5)
        for name in ("position", "linear", "angular", "acceleration"):
            np.testing.assert_allclose(twice[name], once[name], atol=1e-9)
