"""What a Python program may write: names in place of ids, seconds, matrices, objects of trimesh; distances."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import trimesh

import collision_monitor as cm
from collision_monitor.errors import InputError
from collision_monitor.records import STATE, StateFlag

IDENTITY = np.eye(4)


def moved(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def named() -> cm.Monitor:
    monitor = cm.Monitor()
    assert monitor.add("wall", cm.Box((1, 4, 2)), static=True, pose=(4, 0, 0)) == 1
    assert monitor.add("robot", cm.Box((1, 1, 1))) == 2
    assert monitor.add(7, cm.Sphere(0.5), name="ball") == 7
    assert monitor.add("next", cm.Sphere(0.1)) == 8
    return monitor


def test_names_matrices_and_seconds_give_the_bytes_of_ids_numbers_and_nanoseconds() -> None:
    by_name, by_id = named(), named()
    rows = np.array([[0.25, 0, 0, 0, 0, 0, 1], [0, 2.5, 0, 0, 0, 0.6, 0.8]])
    matrices = [cm.Pose(row[:3], row[3:]).matrix for row in rows]
    twists = [[2.0, 0, 0, 0, 0, 0], [0, -2.0, 0, 0, 0, 0]]
    expected = by_id.step(1_250_000_000, [2, 7], rows, twists)
    for poses in (matrices, np.array(matrices), [cm.Pose(row[:3], row[3:]) for row in rows], rows):
        monitor = named()
        found = monitor.step(stamp=1.25, ids=["robot", "ball"], poses=poses, twists=twists)
        assert (found.stamp_ns, len(found.predictions)) == (1_250_000_000, 1)
        assert found.predictions["id_a"].tolist() == expected.predictions["id_a"].tolist()
        assert found.predictions["lower"] == pytest.approx(expected.predictions["lower"], abs=1e-12)
    found = by_name.step(stamp=1.25, ids=np.array(["robot", "ball"]), poses=rows, twists=twists)
    assert found.predictions.tobytes() == expected.predictions.tobytes()


def test_a_matrix_that_is_no_pose_is_refused_and_the_others_are_taken() -> None:
    monitor = named()
    poses = np.array([2.0 * IDENTITY, moved(0, 9), np.full((4, 4), np.nan)])
    with pytest.warns(cm.RefusalWarning):
        result = monitor.step(stamp=0.0, ids=["robot", "ball", "next"], poses=poses)
    assert [(each.reason, each.count) for each in result.refused] == [(cm.Refusal.NON_FINITE, 2)]
    assert monitor.unseen_ids == [2, 8]


def test_without_twists_the_motion_is_that_from_pose_to_pose() -> None:
    """It once meant "at rest" in silence: a robot that drives into a wall had no prediction."""
    monitor, flagged = named(), named()
    for k in range(3):
        stamp, x = 0.1 * k, 0.2 * k  # 2 m/s
        result = monitor.step(stamp=stamp, ids=["robot"], poses=[moved(x)])
        states = np.zeros(1, STATE)
        states["id"], states["quaternion"][:, 3], states["flags"] = 2, 1.0, StateFlag.TWIST_UNKNOWN
        states["position"][0, 0] = x
        known = flagged.step(round(1e9 * stamp), states)
        assert result.predictions.tobytes() == known.predictions.tobytes()
    (prediction,) = result.predictions
    assert prediction["lower"] <= (3.5 - 0.5 - 0.4) / 2.0 <= prediction["upper"]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: m.step(ids=["robot"], poses=[IDENTITY]), "stamp_ns .nanoseconds. or stamp .s., got neither"),
        (lambda m: m.step(3, ["robot"], [IDENTITY], stamp=3.0), "got both"),
        (lambda m: m.step(0.5, ["robot"], [IDENTITY]), "or stamp=t"),
        (lambda m: m.step(stamp=float("nan"), ids=["robot"], poses=[IDENTITY]), "stamp: expected a number"),
        (lambda m: m.step(stamp=0, ids=["rabbit"], poses=[IDENTITY]), "got 'rabbit': there are 'wall', 'robot'"),
        (lambda m: m.step(stamp=0, ids=["twin"], poses=[IDENTITY]), r"got 'twin': ids \[20, 21\] have it"),
        (lambda m: m.remove("rabbit"), "got 'rabbit'"),
        (lambda m: m.follow("rabbit", None), "got 'rabbit'"),
        (lambda m: m.add("more", cm.Sphere(1), allowed=["rabbit"]), "got 'rabbit'"),
        (lambda m: m.distance("robot", "wall"), "'robot': expected an object with a state"),
        (lambda m: m.nearest(99), "expected the id of an object that was described, got 99"),
    ],
)
def test_what_is_not_known_is_an_error_that_says_what_is(call, words) -> None:  # type: ignore[no-untyped-def]
    monitor = named()
    for k in (20, 21):
        monitor.add(k, cm.Sphere(0.1), name="twin")
    with pytest.raises(InputError, match=words):
        call(monitor)


def test_objects_are_allowed_replaced_and_removed_by_name() -> None:
    monitor = named()
    monitor.add("tool", cm.Sphere(0.5), allowed=["robot"])
    result = monitor.step(stamp=0, ids=["robot", "tool"], poses=[IDENTITY, IDENTITY])
    assert len(result.contacts) == 0
    assert monitor.add("tool", cm.Sphere(0.5), replace=True) == 9
    result = monitor.step(stamp=0.1, ids=["robot"], poses=[IDENTITY])
    assert result.contacts["id_b"].tolist() == [9]
    monitor.remove("tool")
    assert 9 not in monitor


def test_a_result_is_printed_with_names_also_of_what_is_gone() -> None:
    monitor = named()
    result = monitor.step(stamp=0, ids=["robot", "ball"], poses=[IDENTITY, moved(0.5)])
    assert "contact: robot and ball, -0." in repr(result)
    monitor.remove("ball")
    assert "contact: robot and object 7, -0." in repr(result)


def test_objects_of_trimesh_are_shapes_everywhere() -> None:
    box, ours = trimesh.creation.box((1, 2, 3)), cm.Box((1, 2, 3))
    assert cm.Mesh(box).faces.tolist() == box.faces.tolist()
    at, ball = cm.Pose((2, 0, 0)), cm.Sphere(0.5)
    assert cm.distance(box, (0, 0, 0), ball, at) == pytest.approx(cm.distance(ours, (0, 0, 0), ball, at), abs=1e-12)
    assert cm.distance([(box, at)], (0, 0, 0), ball, (0, 0, 0)) == pytest.approx(1.0, abs=1e-12)
    monitor = cm.Monitor()
    monitor.add("box", box, static=True, pose=np.eye(4))
    monitor.add("ball", ball)
    monitor.step(stamp=0, ids=["ball"], poses=[moved(2)])
    assert monitor.distance("box", "ball") == pytest.approx(1.0, abs=1e-12)


def scattered(count: int, seed: int) -> tuple[cm.Monitor, dict[int, tuple[object, cm.Pose]]]:
    """A monitor after a step, and its shapes with their poses."""
    random = np.random.default_rng(seed)
    kinds = (cm.Sphere(0.3), cm.Box((0.5, 1.0, 0.2)), cm.Capsule(0.1, 2.0), cm.Cone(0.4, 1.0))
    monitor, placed = cm.Monitor(), {}
    turned = random.normal(size=(count, 4))
    poses = np.hstack([random.uniform(-4, 4, (count, 3)), turned / np.linalg.norm(turned, axis=1)[:, None]])
    for k in range(count):
        monitor.add(k, kinds[k % len(kinds)])
        placed[k] = kinds[k % len(kinds)], cm.Pose(poses[k, :3], poses[k, 3:])
    monitor.add(count, cm.HalfSpace((0, 0, 1)), static=True, pose=(0, 0, -3))
    placed[count] = cm.HalfSpace((0, 0, 1)), cm.Pose((0, 0, -3))
    monitor.step(stamp=0, ids=np.arange(count), poses=poses)
    return monitor, placed


@pytest.mark.parametrize("seed", range(3))
def test_distances_and_neighbours_are_those_of_all_pairs_of_shapes(seed: int) -> None:
    monitor, placed = scattered(90, seed)
    for a in range(0, 90, 7):
        apart = {b: cm.distance(*placed[a], *placed[b]) for b in placed if b != a}
        nearest = min(apart, key=apart.__getitem__)
        found = monitor.nearest(a)
        assert found is not None and (found.object_id, found.name) == (nearest, f"object_{nearest}")
        assert found.distance == pytest.approx(apart[nearest], abs=1e-9)
        gap = np.linalg.norm(found.point - found.other_point)
        assert gap == pytest.approx(abs(found.distance), abs=1e-9)
        assert cm.distance(cm.Sphere(1e-9), found.other_point, *placed[a]) <= 1e-6
        for b in list(apart)[:5]:
            assert monitor.distance(a, b) == pytest.approx(apart[b], abs=1e-9)


def test_the_nearest_is_one_that_is_checked_and_seen() -> None:
    monitor = cm.Monitor()
    monitor.add("arm", cm.Sphere(0.5), group=1)
    assert monitor.add("tool", cm.Sphere(0.5), allowed=["arm"]) == 2
    monitor.add("ghost", cm.Sphere(0.5), group=2, mask=2)
    monitor.add("unseen", cm.Sphere(0.5))
    monitor.add("far", cm.Sphere(0.5))
    poses = [moved(0), moved(0.1), moved(0.2), moved(50)]
    monitor.step(stamp=0, ids=["arm", "tool", "ghost", "far"], poses=poses)
    found = monitor.nearest("arm")
    assert found is not None and (found.name, found.distance) == ("far", 49.0)
    monitor.remove("far")
    assert monitor.nearest("arm") is None


def test_a_result_can_be_stored() -> None:
    monitor = named()
    result = monitor.step(stamp=0, ids=["robot"], poses=[IDENTITY])
    stored = pickle.loads(pickle.dumps(result))
    assert stored.predictions.tobytes() == result.predictions.tobytes()
    assert stored.roster is None and stored.status == result.status
