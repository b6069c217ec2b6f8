"""`Monitor.follow`: bodies are predicted along their plans, until they leave them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from contact_intervals import SHAPES as SOLIDS
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.errors import InputError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.records import STATE, PredictionStatus

STEP = 50_000_000
SHAPES: list[Any] = [cm.Sphere(0.3), *(SOLIDS[name] for name in ("box", "capsule", "compound", "mesh"))]


def plan(rng: np.random.Generator, between: Any, size: float = 2.0) -> cm.Trajectory:
    count = int(rng.integers(4, 10))
    times = np.cumsum(rng.uniform(0.2, 0.8, count)) - rng.uniform(0.0, 0.3)
    position = rng.uniform(-size, size, 3) + np.cumsum(rng.normal(0.0, 0.5, (count, 3)), axis=0)
    turns = np.cumsum(rng.normal(0.0, 0.5, (count, 3)), axis=0)
    poses = np.concatenate([position, Rotation.from_rotvec(turns).as_quat()], axis=1)
    return cm.Trajectory(times, poses, rng.normal(size=(count, 3)) if between == "curve" else None, between=between)


def states(
    ids: list[int], plans: list[cm.Trajectory], t: float, off: NDArray[np.float64] | None = None
) -> NDArray[np.void]:
    """States of bodies on their plans, off by some metres, with twists that say nothing of the plan."""
    rows = np.zeros(len(ids), STATE)
    rows["id"] = ids
    for row, path in zip(rows, plans, strict=True):
        numbers = path.at(t).numbers
        row["position"], row["quaternion"] = numbers[:3], numbers[3:]
    if off is not None:
        rows["position"] += off
    return rows


def remaining(path: cm.Trajectory, t: float) -> cm.Trajectory:
    """What is left of a plan at a time, by its own points."""
    made = object.__new__(cm.Trajectory)
    made.__dict__.update(path.__dict__, times=path.times - t, begins=path.begins - t)
    return made


@pytest.mark.parametrize("between", ["straight", "arc", "curve"])
@pytest.mark.parametrize("profile", ["balanced", "fast", "exact", "a budget"])
def test_predictions_are_the_impacts_of_the_plans(profile: str, between: str) -> None:
    """As of `time_of_impact`, which is checked against dense samples: for each pair, at each step, nothing missed."""
    rng = np.random.default_rng(sum(map(ord, profile + between)))
    settings = cm.Profile.named("balanced" if profile == "a budget" else profile)
    settings = settings.replace(horizon=1.5, **({"pairs_per_step": 2} if profile == "a budget" else {}))
    seen = exact = 0
    for _ in range(3):
        monitor = cm.Monitor(settings)
        paths = [plan(rng, between, 0.8) for _ in SHAPES]
        ids = list(range(1, len(SHAPES) + 1))
        for object_id, shape, path in zip(ids, SHAPES, paths, strict=True):
            monitor.add(object_id, shape)
            monitor.follow(object_id, path)
        for k in range(24):
            t = k * STEP * 1e-9
            result = monitor.step(k * STEP, states(ids, paths, t))
            rows = {(int(each["id_a"]), int(each["id_b"])): each for each in result.predictions}
            touching = {(int(each["id_a"]), int(each["id_b"])) for each in result.contacts}
            for i in ids:
                for j in ids[i:]:
                    if (i, j) in touching:
                        continue
                    one, other = remaining(paths[i - 1], t), remaining(paths[j - 1], t)
                    found = cm.time_of_impact(SHAPES[i - 1], one, SHAPES[j - 1], other, 3.0)
                    row = rows.get((i, j))
                    if found.status == "hit" and found.upper < 1.4:
                        seen += 1
                        assert row is not None, f"step {k}: {i} and {j} meet at {found.lower} s"
                        assert row["lower"] <= found.upper + 1e-9
                        assert row["upper"] >= found.lower - 1e-9
                    if row is not None and row["status"] == PredictionStatus.HIT:
                        exact += 1
                        assert found.lower <= row["upper"] + 1e-9
        assert monitor.following == [i for i in ids if paths[i - 1].times[-1] + 0.2 >= t]
    assert seen > 20 and exact > 2


def crossing() -> tuple[cm.Monitor, list[cm.Trajectory]]:
    """A robot that turns into the way of a post, and one that turns away from another post before it."""
    monitor = cm.Monitor()
    turns = [
        cm.Trajectory([0, 1, 3], [(0, 0, 0), (1, 0, 0), (1, 2, 0)]),
        cm.Trajectory([0, 1, 3], [(0, 10, 0), (1, 10, 0), (1, 12, 0)]),
    ]
    for k in range(2):
        monitor.add(k + 1, cm.Sphere(0.2))
    monitor.add(8, cm.Sphere(0.2), static=True, pose=cm.Pose((1, 1.2, 0)))
    monitor.add(9, cm.Sphere(0.2), static=True, pose=cm.Pose((1.6, 10, 0)))
    for k, path in enumerate(turns):
        monitor.follow(k + 1, path)
    return monitor, turns


def moving(rows: NDArray[np.void], speed: float = 1.0) -> NDArray[np.void]:
    rows["linear"] = (speed, 0, 0)
    return rows


def test_a_body_that_is_exactly_on_its_plan_has_narrow_bounds_in_each_profile() -> None:
    for profile in ("fast", "balanced", "exact"):
        monitor, turns = crossing()
        monitor.profile = profile
        (row,) = monitor.step(0, moving(states([1, 2], turns, 0.0))).predictions
        assert row["lower"] <= 1.8 <= row["upper"] and row["upper"] - row["lower"] < 0.05


def test_two_robots_turn_before_a_post_and_into_one() -> None:
    monitor, turns = crossing()
    result = monitor.step(0, moving(states([1, 2], turns, 0.0)))
    (row,) = result.predictions
    assert (row["id_a"], row["id_b"]) == (1, 8)
    assert row["lower"] == pytest.approx(1.8, abs=0.01) and row["lower"] <= 1.8 <= row["upper"]
    for k in (1, 2):
        monitor.follow(k, None)
    result = monitor.step(STEP, moving(states([1, 2], turns, 0.05)))
    assert [(each["id_a"], each["id_b"]) for each in result.predictions] == [(2, 9)]


def test_the_bounds_are_as_wide_as_the_body_is_off_its_plan() -> None:
    monitor, turns = crossing()
    off = np.array([(0.0, 0.04, 0.03), (0, 0, 0)])
    (row,) = monitor.step(0, moving(states([1, 2], turns, 0.0, off))).predictions
    assert row["lower"] <= 1.75 and row["upper"] >= 1.85 and row["upper"] - row["lower"] < 0.25
    for k in range(1, 30):  # it comes back onto the plan
        (row,) = monitor.step(k * STEP, moving(states([1, 2], turns, k * 0.05))).predictions
    assert row["upper"] - row["lower"] < 0.05


def test_a_body_that_leaves_its_plan_goes_on_as_its_state_says() -> None:
    monitor, turns = crossing()
    monitor.step(0, moving(states([1, 2], turns, 0.0)))
    result = monitor.step(STEP, moving(states([1, 2], turns, 0.05, np.array([(0, 0.15, 0), (0, 0, 0)]))))
    assert result.left == (1,) and monitor.following == [2]
    assert "left its plan: object_1" in repr(result)
    assert len(result.predictions) == 0
    result = monitor.step(2 * STEP, moving(states([1, 2], turns, 0.1, np.array([(0, 0.15, 0), (0, 0, 0)]))))
    assert result.left == ()
    late = states([2], turns[1:], 0.15)
    late["position"] -= (0.35, 0, 0)  # 0.2 m and 0.2 s are allowed along the plan
    assert monitor.step(3 * STEP, late).left == ()
    late["position"] -= (0.2, 0, 0)
    assert monitor.step(4 * STEP, late).left == (2,)


def test_predictions_name_who_follows_a_plan_and_who_left_it() -> None:
    monitor = cm.Monitor(cm.Profile(horizon=5.0))
    for k in (1, 2, 3):
        monitor.add(k, cm.Sphere(0.3))
    rows = np.zeros(3, STATE)
    rows["id"], rows["quaternion"][:, 3] = (1, 2, 3), 1.0
    rows["position"][:, 0], rows["linear"][:, 0] = (0.0, 2.0, 4.0), (0.5, 0.0, -0.5)
    monitor.follow(2, cm.Trajectory([0.0, 9.0], [(2.0, 0.0, 0.0)] * 2))
    plans = [monitor.step(0, rows).predictions]
    rows["position"][1, 1] = 0.3
    plans += [monitor.step(STEP, rows).predictions, monitor.step(2 * STEP, rows).predictions]
    monitor = cm.Monitor.restored(monitor.profile, Snapshot.decode(monitor.snapshot().encode()))
    plans.append(monitor.step(3 * STEP, rows).predictions)
    monitor.follow(3, cm.Trajectory([0.0, 5.0], [(4.0, 0.0, 0.0), (1.5, 0.0, 0.0)]), stamp_ns=0)
    monitor.follow(2, None)
    plans.append(monitor.step(4 * STEP, rows).predictions)
    found = [{(int(row["id_a"]), int(row["id_b"])): int(row["plans"]) for row in each} for each in plans]
    follows, left = ({(1, 2): 2, (2, 3): 1, (1, 3): 0}, {(1, 2): 8, (2, 3): 4, (1, 3): 0})
    assert found[:4] == [follows, left, left, left]
    assert found[4] == {(1, 2): 0, (2, 3): 2, (1, 3): 2}


def test_a_body_that_turns_away_from_its_plan_leaves_it() -> None:
    monitor, turns = crossing()
    rows = moving(states([1, 2], turns, 0.0))
    rows["quaternion"][0] = Rotation.from_rotvec((0, 0, 0.2)).as_quat()
    assert monitor.step(0, rows).left == (1,)


def test_from_every_moment_a_snapshot_goes_on_with_the_same_bytes() -> None:
    rng = np.random.default_rng(4)
    paths = [plan(rng, "curve", 1.0) for _ in SHAPES]
    ids = list(range(1, len(SHAPES) + 1))
    monitor = cm.Monitor(cm.Profile(uncertainty=False))
    for object_id, shape, path in zip(ids, SHAPES, paths, strict=True):
        monitor.add(object_id, shape)
        monitor.follow(object_id, path)
    snapshots = [monitor.snapshot()]
    noise = rng.normal(0.0, 0.02, (40, len(ids), 3))
    answers = []
    for k in range(40):
        answers.append(monitor.step(k * STEP, states(ids, paths, k * 0.05, noise[k])))
        snapshots.append(monitor.snapshot())
    for begin in range(0, 40, 3):
        other = cm.Monitor.restored(monitor.profile, Snapshot.decode(snapshots[begin].encode()))
        for k in range(begin, min(begin + 6, 40)):
            result = other.step(k * STEP, states(ids, paths, k * 0.05, noise[k]))
            assert result.predictions.tobytes() == answers[k].predictions.tobytes()
            assert result.contacts.tobytes() == answers[k].contacts.tobytes()
            assert result.left == answers[k].left


def test_a_damaged_plan_in_a_snapshot_is_refused() -> None:
    monitor, turns = crossing()
    monitor.step(0, moving(states([1, 2], turns, 0.0)))
    good = monitor.snapshot()

    def changed(name: str, field: str, index: int, value: float) -> Snapshot:
        arrays = {key: array.copy() for key, array in good.arrays.items()}
        arrays[name][field][index] = value
        return Snapshot(arrays, good.facts)

    for name, field, index, value in [
        ("plans.rows", "slot", 0, 99), ("plans.rows", "slot", 0, 2), ("plans.rows", "slot", 0, 1),
        ("plans.rows", "count", 0, 2), ("plans.rows", "count", 0, 10**6), ("plans.rows", "count", 0, -1),
        ("plans.pieces", "until", 0, 99.0), ("plans.pieces", "until", 3, 99.0), ("plans.pieces", "course", 1, 77),
    ]:  # fmt: skip
        with pytest.raises(InputError, match="snapshot"):
            cm.Monitor.restored("balanced", changed(name, field, index, value))
    for field, value in (("first", 10**6), ("first", -5)):  # not read: the plans are one after the other
        cm.Monitor.restored("balanced", changed("plans.rows", field, 0, value)).step(STEP, states([1, 2], turns, 0.05))
    restored = cm.Monitor.restored("balanced", changed("plans.pieces", "piece", 2, 10**9))
    assert restored.following == [1, 2]
    restored.step(STEP, moving(states([1, 2], turns, 0.05)))


def test_plans_come_and_go_and_the_others_keep_theirs() -> None:
    """New plans at each step, longer and shorter ones: the pieces of the others move in memory."""
    rng = np.random.default_rng(8)
    monitor, fresh = cm.Monitor(), cm.Trajectory([0, 40], [(0, 0, 0), (40, 0, 0)])
    monitor.add(1, cm.Sphere(0.2))
    monitor.add(2, cm.Sphere(0.2), static=True, pose=cm.Pose((3, 0, 0)))
    monitor.follow(1, fresh)
    for k in range(10, 30):
        monitor.add(k, cm.Sphere(0.1))
    for k in range(40):
        for j in rng.integers(10, 30, 6):
            times = np.linspace(0.0, 5.0, int(rng.integers(2, 60)))
            monitor.follow(int(j), cm.Trajectory(times, [(float(j), 50 + t, 0) for t in times]))
        if k % 7 == 3:
            monitor.remove(10 + k // 7)
            monitor.add(10 + k // 7, cm.Sphere(0.1))
        result = monitor.step(k * STEP, states([1], [fresh], k * 0.05))
        assert [(each["id_a"], each["id_b"]) for each in result.predictions] == [(1, 2)] * (k * 0.05 > 0.6)
        assert 1 in monitor.following


def test_a_new_plan_costs_the_pairs_of_its_object_alone() -> None:
    rng = np.random.default_rng(2)
    monitor = cm.Monitor()
    ids = list(range(50))
    paths = [cm.Trajectory(np.linspace(0, 50, 51), rng.uniform(-20, 20, (51, 3))) for _ in ids]
    for object_id in ids:
        monitor.add(object_id, cm.Sphere(0.2))
        monitor.follow(object_id, paths[object_id])
    for k in range(100):
        if k == 90:
            paths[7] = cm.Trajectory(paths[7].times, [paths[7].at(4.5), *rng.uniform(-20, 20, (50, 3))])
            monitor.follow(7, paths[7], stamp_ns=int(4.5e9))
            paths[7] = cm.Trajectory(paths[7].times + 4.5, paths[7].poses)
        status = monitor.step(k * STEP, states(ids, paths, k * 0.05)).status
        if k > 0:
            assert status.objects_moved == (k == 90)


def test_silent_bodies_go_on_along_their_plans_with_wider_bounds() -> None:
    monitor, turns = crossing()
    monitor.step(0, moving(states([1, 2], turns, 0.0)))
    rows = monitor.step(int(0.4e9), np.zeros(0, STATE)).predictions
    (row,) = rows[rows["id_a"] == 1]
    assert row["lower"] <= 1.4 <= row["upper"] and row["lower"] > 0.5
    assert monitor.following == [1, 2]
    for t in np.arange(0.5, 1.5, 0.05):
        rows = monitor.step(round(t * 1e9), moving(states([1, 2], turns, t))).predictions
        row = rows[rows["id_a"] == 1][0]
        assert row["lower"] <= 1.8 - t + 1e-9 <= row["upper"]
    assert row["upper"] - row["lower"] < 0.02


def test_plans_end_are_replaced_and_begin_at_a_stamp() -> None:
    path = cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)])
    monitor = cm.Monitor()
    monitor.add(1, cm.Sphere(0.2))
    monitor.add(2, cm.Sphere(0.2), static=True, pose=cm.Pose((2, 0, 0)))
    monitor.step(0, states([1], [path], 0.0))
    monitor.follow(1, path, stamp_ns=int(0.5e9))  # it stands until then, and ends before the wall
    assert len(monitor.step(STEP, moving(states([1], [path], 0.0), 3.0)).predictions) == 0
    assert monitor.following == [1]
    monitor.follow(1, cm.Trajectory([0, 1], [(0, 0, 0), (3, 0, 0)]), stamp_ns=int(0.5e9))
    (row,) = monitor.step(2 * STEP, states([1], [path], 0.0)).predictions
    assert row["lower"] == pytest.approx(0.4 + 1.6 / 3.0, abs=0.01)
    monitor.follow(1, path, stamp_ns=int(-0.5e9))
    monitor.step(int(0.65e9), states([1], [path], 1.0))
    assert monitor.following == [1]
    assert monitor.step(int(0.75e9), states([1], [path], 1.0)).left == ()
    assert monitor.following == []


def test_an_object_that_becomes_static_follows_no_plan() -> None:
    monitor, turns = crossing()
    monitor.step(0, moving(states([1, 2], turns, 0.0)))
    monitor.add(1, cm.Sphere(0.2), static=True, pose=cm.Pose((0, 0, 0)), replace=True)
    assert monitor.following == [2]
    assert len(monitor.step(STEP, moving(states([2], turns[1:], 0.05))).predictions) == 0
    cm.Monitor.restored(monitor.profile, Snapshot.decode(monitor.snapshot().encode()))


def test_what_cannot_be_followed_is_refused() -> None:
    path = cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)])
    monitor = cm.Monitor()
    monitor.add(1, cm.Sphere(0.2))
    monitor.add(2, cm.Sphere(0.2), static=True, pose=cm.Pose((2, 0, 0)))
    monitor.step(int(5e9), states([1], [path], 0.0))
    for arguments, named, text in [
        ((3, path), {}, "the id of an object that was described, got 3"),
        ((2, path), {}, "expected an object that moves, got a static one"),
        ((1, cm.Motion((0, 0, 0))), {}, "expected a Trajectory or None, got Motion"),
        ((1, path), {"stamp_ns": int(3e9)}, "expected a plan that is not over, got one that ended 1.000 s ago"),
        ((1, path), {"stamp_ns": 0.5}, "expected an integer number of nanoseconds"),
        ((1, path), {"tolerance": (1, 2)}, "expected a Tolerance of 4 numbers"),
        ((1, path), {"tolerance": cm.Tolerance(across=-1.0)}, "expected finite numbers >= 0"),
        ((1, path), {"tolerance": "wide"}, "tolerance: expected numbers"),
        ((1, cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)], then="unknown")), {}, "says what comes after its end"),
    ]:
        with pytest.raises(InputError, match=text):
            monitor.follow(*arguments, **named)  # type: ignore[arg-type]
    assert monitor.following == []


def test_a_jump_of_the_clock_a_region_and_a_new_description() -> None:
    monitor, turns = crossing()
    monitor.profile = monitor.profile.replace(region_min=(-5.0, -5.0, -5.0), region_max=(5.0, 5.0, 5.0))
    for k in range(3):
        assert len(monitor.step(k * STEP, moving(states([1, 2], turns, k * 0.05))).predictions) == 1
    monitor.describe(cm.ObjectDescription(1, cm.Sphere(0.4)))
    (row,) = monitor.step(3 * STEP, moving(states([1, 2], turns, 0.15))).predictions
    assert row["lower"] == pytest.approx(1.45, abs=0.01)
    monitor.profile = "fast"
    (row,) = monitor.step(4 * STEP, moving(states([1, 2], turns, 0.2))).predictions
    assert 1.2 < row["lower"] <= 1.4 <= row["upper"] < 1.6
    for k in range(2):
        monitor.step(int(1e12) + k * STEP, moving(states([1, 2], turns, 0.2)))
    assert monitor.restarts == 1 and monitor.following == []


def test_a_body_with_one_state_in_ten_steps_is_seldom_predicted_anew() -> None:
    monitor, turns = crossing()
    anew = []
    for k in range(250):
        known = k % 10 == 0
        rows = moving(states([1, 2], turns, k * 0.01)) if known else np.zeros(0, STATE)
        result = monitor.step(k * 10_000_000, rows)
        anew.append(result.status.objects_moved)
        at = 1.8 - 0.01 * k
        if 0.1 < at < 1.7:
            row = result.predictions[result.predictions["id_a"] == 1][0]
            assert row["lower"] <= at + 1e-9 <= row["upper"]
    assert sum(anew[50:]) < 10


def test_a_plan_that_is_over_before_the_first_step_is_refused() -> None:
    path = cm.Trajectory([0, 1], [(0, 0, 0), (1, 0, 0)])
    monitor = cm.Monitor(warns=False)
    monitor.add(1, cm.Sphere(0.2))
    monitor.follow(1, path, stamp_ns=0)
    result = monitor.step(int(9e9), states([1], [path], 1.0))
    (refused,) = result.refused
    assert "object 1: expected a plan that is not over, got one that ended 8.000 s ago" in refused.text
    assert monitor.following == []


def test_a_noisy_body_is_seldom_predicted_anew() -> None:
    rng = np.random.default_rng(6)
    monitor, turns = crossing()
    anew = 0
    for k in range(55):
        off = np.array([rng.normal(0.0, 0.01, 3), (0, 0, 0)])
        anew += monitor.step(k * STEP, moving(states([1, 2], turns, k * 0.05, off))).status.objects_moved
    assert anew < 12
