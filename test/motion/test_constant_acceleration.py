"""Bodies with a measured acceleration: against roots of polynomials, dense samples, and in the monitor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor import Motion, Pose, contact, time_of_impact
from collision_monitor.errors import PoseError
from collision_monitor.records import STATE, Method, StateFlag
from collision_monitor.settings.profile import Profile

SECOND = 1_000_000_000
VALID, UNKNOWN = int(StateFlag.ACCELERATION_VALID), int(StateFlag.TWIST_UNKNOWN)


def first_root(p: NDArray[np.float64], v: NDArray[np.float64], a: NDArray[np.float64], reach: float) -> float:
    """First time t >= 0 at which |p + v t + a t^2 / 2| is `reach`; infinite if there is none."""
    quartic = [a @ a / 4, v @ a, v @ v + p @ a, 2 * p @ v, p @ p - reach**2]
    roots = np.roots(quartic)
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(min(real[real > 0.0], default=np.inf))


def test_spheres_meet_at_the_root_of_a_quartic() -> None:
    rng = np.random.default_rng(4)
    statuses = []
    for _ in range(300):
        p, a, b = rng.normal(0, 2, 3), rng.normal(0, 3, 3), rng.normal(0, 1, 3)
        v = rng.normal(0, 0.5, 3) - rng.uniform(0, 1.5) * p - rng.uniform(0, 0.5) * a
        if np.linalg.norm(p) < 1.0:
            continue
        answer = time_of_impact(
            cm.Sphere(0.5),
            Motion(Pose((7, 8, 9)), (1, 2, 3), (1, 1, 0), b),
            cm.Sphere(0.3),
            Motion(Pose(p + np.array((7, 8, 9))), v + np.array((1, 2, 3)), (0, 1, 0), a + b),
        )
        statuses.append(answer.status)
        first, wider = first_root(p, v, a, 0.8), first_root(p, v, a, 0.8 + 1e-5)
        if answer.status == "clear":
            assert first > 2.0
        else:
            assert answer.lower <= first + 1e-9 and wider < 2.0 + 1e-3
        if answer.status == "hit":
            assert answer.upper >= first - 1e-9
            assert answer.upper - answer.lower < 1e-2
    assert min(statuses.count("hit"), statuses.count("clear")) > 50


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (cm.Box((0.7, 0.9, 0.5)), cm.Box((1.2, 0.3, 0.8))),
        (cm.Cylinder(0.3, 0.8), cm.ConvexHull(np.random.default_rng(3).normal(size=(12, 3)) * 0.4)),
    ],
    ids=["boxes", "cylinder and hull"],
)
def test_shapes_that_turn_against_dense_samples(a: cm.Box, b: cm.Box) -> None:
    rng = np.random.default_rng(5)
    times = np.linspace(0.0, 2.0, 81)
    hits = 0
    for _ in range(20):
        A, B = (
            Motion(Pose(rng.uniform(-1.3, 1.3, 3)), rng.normal(0, 1, 3), rng.normal(0, 2, 3), rng.normal(0, 2, 3))
            for _ in range(2)
        )
        answer = time_of_impact(a, A, b, B)
        distance = np.array([contact(a, A.at(t), b, B.at(t)).signed_distance for t in times])
        assert (distance[times < answer.lower] > 0.0).all()
        if answer.status == "hit":
            hits += 1
            assert contact(a, A.at(answer.upper), b, B.at(answer.upper)).signed_distance <= 1e-9
            assert answer.upper - answer.lower < 1e-2
        else:
            assert answer.status == "clear"
    assert 3 < hits < 24


def test_who_brakes_in_time_does_not_meet() -> None:
    """From 2 m/s with 2 m/s^2 the ball stops after 1 m: 1 mm before the wall, or 1 mm beyond it."""
    wall = cm.HalfSpace((-1, 0, 0), -1.5)  # x >= 1.5
    still = Motion(Pose())
    for start, status in ((-0.001, "clear"), (0.001, "hit")):
        braking = Motion(Pose((start, 0, 0)), (2, 0, 0), acceleration=(-2, 0, 0))
        answer = time_of_impact(cm.Sphere(0.5), braking, wall, still)
        assert answer.status == status
    t = 1.0 - np.sqrt(0.001)  # x(t) = 1.001 - (1 - t)^2 reaches 1
    assert answer.lower <= t <= answer.upper
    resting = Motion(Pose((1.0, 0, 0)), acceleration=(-1, 0, 0))
    assert time_of_impact(cm.Sphere(0.5), resting, wall, still).status == "clear"
    pressed = Motion(Pose((1.0, 0, 0)), acceleration=(1, 0, 0))
    assert time_of_impact(cm.Sphere(0.5), pressed, wall, still).status != "clear"


def test_an_acceleration_has_three_finite_numbers() -> None:
    with pytest.raises(PoseError, match="acceleration"):
        Motion(Pose(), acceleration=(0, np.nan, 0))


def scene(count: int, flags: int) -> tuple[NDArray[np.void], NDArray[np.float64]]:
    """States with accelerations, and the accelerations (N, 3) in m/s^2."""
    rng = np.random.default_rng(11)
    rows = np.zeros(count, STATE)
    rows["id"], rows["quaternion"][:, 3], rows["flags"] = np.arange(count), 1.0, flags
    rows["position"], rows["linear"] = rng.uniform(-2.5, 2.5, (count, 3)), rng.normal(0, 1.0, (count, 3))
    rows["angular"] = rng.normal(0, 1, (count, 3))
    rows["acceleration"] = rng.normal(0, 2, (count, 3))
    return rows, rows["acceleration"].copy()


def moved(rows: NDArray[np.void], start: NDArray[np.void], t: float) -> None:
    for k in range(len(rows)):
        motion = Motion(
            Pose(start["position"][k], start["quaternion"][k]), start["linear"][k], start["angular"][k],
            start["acceleration"][k],
        )  # fmt: skip
        rows["position"][k], rows["quaternion"][k] = motion.at(t).position, motion.at(t).quaternion
        rows["linear"][k] = start["linear"][k] + start["acceleration"][k] * t


def monitor_of(count: int) -> tuple[cm.Monitor, list[cm.Box | cm.Sphere]]:
    monitor, shapes = cm.Monitor("exact"), [cm.Box((1.0, 0.7, 0.4)), cm.Sphere(0.6)]
    for k in range(count):
        monitor.add(k, shapes[k % 2])
    return monitor, shapes


def test_the_monitor_predicts_along_the_acceleration() -> None:
    """Predictions equal those of two separate bodies and hold the true time; constant accelerations keep them."""
    count, steps = 10, 5
    rows, _ = scene(count, VALID)
    start = rows.copy()
    monitor, shapes = monitor_of(count)
    reported = 0
    for step in range(steps):
        t = 0.1 * step
        moved(rows, start, t)
        result = monitor.step(round(t * SECOND), rows)
        assert step == 0 or result.status.objects_moved == 0
        touching = {(c["id_a"], c["id_b"]) for c in result.contacts}
        found = {(p["id_a"], p["id_b"]): p for p in result.predictions}
        for i in range(count):
            for j in range(i + 1, count):
                if (i, j) in touching:
                    continue
                motions = [
                    Motion(
                        Pose(rows["position"][k], rows["quaternion"][k]), rows["linear"][k], rows["angular"][k],
                        rows["acceleration"][k],
                    )
                    for k in (i, j)
                ]  # fmt: skip
                alone = time_of_impact(shapes[i % 2], motions[0], shapes[j % 2], motions[1])
                if alone.status == "hit" and alone.upper < 1.999:
                    reported += 1
                    assert found[i, j]["lower"] <= alone.upper and alone.lower <= found[i, j]["upper"]
                elif alone.status == "clear":
                    assert (i, j) not in found or found[i, j]["lower"] > 1.99
    assert reported > 12


def test_without_the_flag_it_is_not_read() -> None:
    digests = []
    for acceleration in (0.0, 5.0, np.nan):
        monitor, _ = monitor_of(16)
        rows, _ = scene(16, 0)
        rows["acceleration"] = acceleration
        for step in range(3):
            monitor.step(step * SECOND // 20, rows)
        digests.append(monitor.digest)
    assert len(set(digests)) == 1


def test_one_that_is_not_finite_is_refused() -> None:
    monitor, _ = monitor_of(2)
    rows, _ = scene(2, VALID)
    rows["acceleration"][1, 0] = np.inf
    monitor.step(0, rows)
    assert sum(monitor.refused.values()) == 1 and "finite" in monitor.last_refusal


def test_an_estimated_twist_is_that_at_the_last_state() -> None:
    """From rest with 2 m/s^2: after 0.1 s the ball is at 0.01 m; its mean speed is 0.1 m/s, its speed 0.2 m/s."""
    monitor = cm.Monitor("exact")
    monitor.add(0, cm.Sphere(0.5))
    monitor.add(1, cm.Sphere(0.5), static=True, pose=cm.Pose((2.0, 0, 0)))
    rows = np.zeros(1, STATE)
    rows["quaternion"][:, 3], rows["flags"], rows["acceleration"][:, 0] = 1.0, VALID | UNKNOWN, 2.0
    for t in (0.0, 0.1):
        rows["position"][:, 0] = t * t
        result = monitor.step(round(t * SECOND), rows)
    (prediction,) = result.predictions
    assert prediction["lower"] <= 0.9 <= prediction["upper"]  # t^2 = 1 at t = 1
    assert prediction["upper"] - prediction["lower"] < 1e-3


@pytest.mark.parametrize("shape", [cm.Box((1.0, 0.7, 0.4)), cm.Box((0.1, 1.6, 0.1))], ids=["spheres", "sphere trees"])
def test_a_bound_says_how_fast_they_close_when_it_begins(shape: cm.Box) -> None:
    """The closing speed of a deferred pair is that at the begin of the bound's interval, not the current one."""
    pairs, speed, hard = 20, 0.5, 2.0
    monitor = cm.Monitor(Profile(pairs_per_step=1))
    rows = np.zeros(2 * pairs, STATE)
    rows["id"], rows["quaternion"][:, 3], rows["flags"] = np.arange(2 * pairs), 1.0, VALID
    rows["position"][:, 1], rows["position"][1::2, 0] = np.repeat(100.0 * np.arange(pairs), 2), 3.0
    rows["linear"][::2, 0], rows["acceleration"][::2, 0] = speed, hard
    for k in range(2 * pairs):
        monitor.add(k, shape)
    for step in range(3):
        now = 0.1 * step
        rows["position"][::2, 0] = speed * now + 0.5 * hard * now * now
        rows["linear"][::2, 0] = speed + hard * now
        result = monitor.step(round(now * SECOND), rows)
        bounds = result.predictions[result.predictions["method"] == int(Method.BOUND)]
        assert len(bounds) > pairs // 2
        assert np.allclose(bounds["closing_speed"], speed + hard * (now + bounds["lower"]))
