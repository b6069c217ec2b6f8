"""Tests that the batches over arrays of pairs agree with one call for each pair."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.query.pair_arrays import pose_rows

RNG = np.random.default_rng(2)
TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
CORNER = cm.Mesh([*TETRAHEDRON, (0.2, 0.2, 0.2)], [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 2, 4), (2, 3, 4), (3, 1, 4)])
SHAPES = [
    cm.Box((1, 0.5, 0.7)),
    cm.Sphere(0.4),
    cm.ConvexHull(RNG.normal(size=(60, 3)) / 3),
    CORNER,
    [(cm.Sphere(0.3), cm.Pose((1, 0, 0))), (cm.Box((1, 1, 1)), cm.Pose())],
    cm.HalfSpace((0, 0, 1), -1.0),
]
COUNT = 40


def poses(count: int = COUNT) -> NDArray[np.float64]:
    rows = RNG.normal(size=(count, 7))
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1)[:, None]
    return rows


def pose(row: NDArray[np.float64]) -> cm.Pose:
    return cm.Pose(row[:3], row[3:])


def test_contacts_agree_with_single_calls() -> None:
    a = [SHAPES[k % 5] for k in range(COUNT)]
    b = [SHAPES[k // 2 % 6] for k in range(COUNT)]
    poses_a, poses_b = poses(), poses()
    found = cm.contacts(a, poses_a, b, poses_b)
    for k in range(COUNT):
        one = cm.contact(a[k], pose(poses_a[k]), b[k], pose(poses_b[k]))
        assert found.signed_distance[k] == pytest.approx(one.signed_distance, abs=1e-12)
        assert found.error_bound[k] == pytest.approx(one.error_bound, rel=1e-3, abs=1e-12)
        if abs(one.signed_distance) > 1e-3:
            np.testing.assert_allclose(found.normal[k], one.normal, atol=1e-9)
        np.testing.assert_allclose(
            found.point_b[k] - found.point_a[k], found.signed_distance[k] * found.normal[k], atol=1e-12
        )
    assert found.overlaps.any() and not found.overlaps.all()


def test_matrices_are_the_poses_of_single_calls_to_the_bit() -> None:
    rows = poses()
    rows[::2, 3:] = np.eye(4)[np.arange(len(rows[::2])) % 4]  # half turns and none
    matrices = np.array([pose(row).matrix for row in rows])
    expected = [cm.Pose.from_matrix(matrix).numbers for matrix in matrices]
    for given in (matrices, list(matrices), matrices.tolist(), np.asfortranarray(matrices)):
        assert pose_rows(given, "poses A").tolist() == [list(numbers) for numbers in expected]
    assert pose_rows(matrices[0], "poses A").tolist() == [list(expected[0])]
    assert pose_rows(matrices[:0], "poses A").shape == (0, 7)


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        ((3, 3), 2.0, "the last row 0 0 0 1"),
        ((1, 3), np.nan, "a finite position"),
        ((2, 3), 1e300, "a finite position"),
        ((0, 0), 3.0, "a rotation"),
        ((0, 0), np.nan, "a rotation"),
    ],
)
def test_a_matrix_that_is_no_pose_is_refused_with_its_number(place: tuple[int, int], value: float, words: str) -> None:
    matrices = np.tile(np.eye(4), (COUNT, 1, 1))
    matrices[7][place] = matrices[20][place] = value
    with pytest.raises(cm.PoseError, match=f"poses B, 7: matrix: expected {words}"):
        cm.contacts(SHAPES[0], cm.Pose(), SHAPES[1], matrices)


def test_one_shape_and_one_pose_apply_to_all_pairs() -> None:
    many = poses()
    found = cm.contacts(SHAPES[0], cm.Pose(), SHAPES[2], many)
    listed = cm.contacts([SHAPES[0]] * COUNT, [cm.Pose()] * COUNT, [SHAPES[2]] * COUNT, [pose(row) for row in many])
    np.testing.assert_allclose(found.signed_distance, listed.signed_distance, atol=1e-14)
    compound = cm.contacts(SHAPES[4], cm.Pose(), SHAPES[1], many)
    assert len(compound) == COUNT


def test_times_of_impact_agree_with_single_calls() -> None:
    a = [SHAPES[k % 5] for k in range(COUNT)]
    b = [SHAPES[k // 2 % 3] for k in range(COUNT)]
    poses_a, poses_b = poses(), poses() + np.r_[4, np.zeros(6)]
    twists = RNG.normal(size=(COUNT, 6)) - np.r_[3, np.zeros(5)]
    found = cm.times_of_impact(a, poses_a, np.zeros(6), b, poses_b, twists, horizon=3.0)
    for k in range(COUNT):
        still, moving = cm.Motion(pose(poses_a[k])), cm.Motion(pose(poses_b[k]), twists[k, :3], twists[k, 3:])
        one = cm.time_of_impact(a[k], still, b[k], moving, horizon=3.0)
        assert found.status[k] == one.status
        assert found.lower[k] == pytest.approx(one.lower, abs=1e-9)
        assert found.upper[k] == pytest.approx(one.upper, abs=1e-9)
    assert set(found.status) >= {"hit", "clear"}


def test_progress_reports_every_part() -> None:
    done: list[int] = []
    count = 40_000
    cm.contacts(cm.Sphere(1), cm.Pose(), cm.Sphere(1), poses(count), progress=done.append)
    assert done == sorted(done) and len(done) == 3 and done[-1] == count


def test_no_pairs_are_no_error() -> None:
    assert len(cm.contacts(cm.Sphere(1), cm.Pose(), cm.Sphere(1), np.zeros((0, 7)))) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([SHAPES[0]] * 3, poses(2), SHAPES[1], cm.Pose()), "expected one length of all arguments"),
        ((SHAPES[0], np.zeros((2, 7)), SHAPES[1], cm.Pose()), "unit length .* got one of length 0 in row 0"),
        ((SHAPES[0], np.full((1, 7), np.nan), SHAPES[1], cm.Pose()), "finite numbers .* in row 0"),
        ((SHAPES[0], np.zeros((2, 6)), SHAPES[1], cm.Pose()), r"an array \(N, 7\)"),
        (("box", cm.Pose(), SHAPES[1], cm.Pose()), "shape A: expected a shape"),
        (([], cm.Pose(), SHAPES[1], cm.Pose()), "shapes A: expected a shape"),
        (([SHAPES[0], 7], cm.Pose(), SHAPES[1], cm.Pose()), "expected a shape"),
    ],
)
def test_other_arguments_are_refused(arguments: tuple[object, ...], words: str) -> None:
    with pytest.raises(cm.CollisionMonitorError, match=words):
        cm.contacts(*arguments)  # type: ignore[arg-type]


def same(a: cm.Contact, b: cm.Contact) -> bool:
    names = ("signed_distance", "error_bound", "normal", "point_a", "point_b", "points_a", "model_a")
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


def test_a_number_selects_the_contact_of_the_single_call() -> None:
    a, b = [SHAPES[k % 3] for k in range(COUNT)], [SHAPES[k // 2 % 3] for k in range(COUNT)]
    poses_a, poses_b = [pose(row) for row in poses()], [pose(row) for row in poses()]
    found = cm.contacts(a, poses_a, b, poses_b)
    for k, one in enumerate(found):
        direct = cm.contact(a[k], poses_a[k], b[k], poses_b[k])
        assert same(one, direct) and same(found[k - COUNT], direct)
        assert one.arguments[::2] == (a[k], b[k])


def test_a_selected_contact_has_the_numbers_of_the_batch() -> None:
    a, b = [SHAPES[k % 5] for k in range(COUNT)], [SHAPES[k // 2 % 6] for k in range(COUNT)]
    found = cm.contacts(a, poses(), b, poses())
    for k, one in enumerate(found):
        for name in ("signed_distance", "error_bound", "normal", "point_a", "point_b"):
            assert np.array_equal(getattr(one, name), getattr(found, name)[k])


@pytest.mark.parametrize(
    "which",
    [slice(3, 20, 4), slice(None, None, -1), [5, -1, 5], [], np.array([7, 2]), np.arange(COUNT) % 3 == 0],
    ids=["slice", "reversed", "list", "empty", "numbers", "mask"],
)
def test_several_pairs_are_selected_as_from_an_array(which: Any) -> None:
    twists = RNG.normal(size=(COUNT, 6))
    for found in (
        cm.contacts(SHAPES[0], cm.Pose(), SHAPES[1], poses()),
        cm.times_of_impact(SHAPES[0], cm.Pose((5, 0, 0)), [-1] + [0] * 5, SHAPES[1], poses(), twists),
    ):
        numbers = np.arange(COUNT)[which]
        part = found[which]
        assert type(part) is type(found) and len(part) == len(numbers)
        assert [repr(one) for one in part] == [repr(found[k]) for k in numbers]
        assert [repr(one) for one in part[1:]] == [repr(found[k]) for k in numbers[1:]]


def test_a_number_selects_the_impact_of_the_single_call() -> None:
    moving = poses() + np.r_[2, np.zeros(6)]
    twists = RNG.normal(size=(COUNT, 6)) - np.r_[3, np.zeros(5)]
    for shape in (SHAPES[0], SHAPES[1], SHAPES[3]):
        still = np.zeros((COUNT, 6))
        here = np.tile([0.0, 0, 0, 0, 0, 0, 1], (COUNT, 1))
        for found in (
            cm.times_of_impact(shape, cm.Pose(), still, SHAPES[1], moving, twists, horizon=3.0),
            cm.time_of_impact_batch(shape, here, still, SHAPES[1], moving, twists, horizon=3.0),
        ):
            for k, one in enumerate(found):
                assert (one.status, one.lower, one.upper) == (found.status[k], found.lower[k], found.upper[k])
                motion = cm.Motion(pose(moving[k]), twists[k, :3], twists[k, 3:])
                direct = cm.time_of_impact(shape, cm.Motion(cm.Pose()), SHAPES[1], motion, horizon=3.0)
                assert (one.status, one.method) == (direct.status, direct.method)
                assert one.lower == pytest.approx(direct.lower, abs=1e-9)
                if direct.contact is not None:
                    assert one.contact is not None
                    assert one.contact.signed_distance == pytest.approx(direct.contact.signed_distance, abs=1e-6)


@pytest.mark.parametrize(
    "which", [COUNT, -COUNT - 1, 1.0, "first", True, None, (0, 1), [[0, 1]], [COUNT], [True, False]], ids=repr
)
def test_what_selects_no_pair_raises(which: Any) -> None:
    found = cm.contacts(SHAPES[0], cm.Pose(), SHAPES[1], poses())
    with pytest.raises(IndexError):
        found[which]


def test_results_of_a_batch_can_be_pickled() -> None:
    found = cm.contacts(SHAPES[0], cm.Pose(), SHAPES[1], poses())
    assert same(pickle.loads(pickle.dumps(found))[3], found[3])
