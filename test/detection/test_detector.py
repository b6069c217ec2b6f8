"""Tests of full detection against the contact test of every pair, with one thread and with two."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from collision_monitor.detection.detector import DetectedContacts, Detector
from collision_monitor.detection.partitioned import BROAD_PHASES
from collision_monitor.errors import InputError, PoseError, UnsupportedError
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.shapes.registry import Box, Capsule, ConvexHull, Cylinder, HalfSpace, Mesh, Shape, Sphere
from collision_monitor.shapes.shape_table import ShapeTableBuilder

Array = NDArray[np.float64]
N = 300


def spheres(rng: np.random.Generator) -> list[Shape]:
    return [Sphere(r) for r in rng.uniform(0.2, 0.6, N)]


def boxes(rng: np.random.Generator) -> list[Shape]:
    return [Box(s) for s in rng.uniform(0.4, 1.2, (N, 3))]


def mixed(rng: np.random.Generator) -> list[Shape]:
    kinds = (lambda r, h: Sphere(r), lambda r, h: Box((r, h, 1)), Capsule, Cylinder)
    return [kinds[k % 4](r, h) for k, (r, h) in enumerate(rng.uniform(0.2, 0.8, (N, 2)))]


def hulls(rng: np.random.Generator) -> list[Shape]:
    few = [ConvexHull(rng.normal(size=(32, 3)) * 0.3) for _ in range(8)]
    return [few[k] for k in rng.integers(0, 8, N)]


def one_plane(rng: np.random.Generator) -> list[Shape]:
    return boxes(rng)


def sizes_from_1_cm_to_100_m(rng: np.random.Generator) -> list[Shape]:
    return [Sphere(r) if r < 1 else Box((r, r, 0.1)) for r in 10 ** rng.uniform(-2, 2, N)]


def with_the_ground(rng: np.random.Generator) -> list[Shape]:
    return [HalfSpace((0, 0, 1), 0.5), *mixed(rng)[1:]]


SCENES = [spheres, boxes, mixed, hulls, one_plane, sizes_from_1_cm_to_100_m, with_the_ground]


def poses(rng: np.random.Generator, scene: object) -> tuple[Array, Array]:
    positions = rng.uniform(0, 5, (N, 3))
    if scene is one_plane:
        positions[:, 2] = 1.7
    if scene is sizes_from_1_cm_to_100_m:
        positions *= 20
    quaternions = rng.normal(size=(N, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    if scene is with_the_ground:
        positions[0], quaternions[0] = 0, (0, 0, 0, 1)
    return positions, quaternions


def every_pair(shapes: list[Shape], positions: Array, quaternions: Array, margin: float) -> tuple[Array, Array]:
    builder = ShapeTableBuilder()
    for shape in shapes:
        builder.append(shape)
    pairs = np.column_stack(np.triu_indices(len(shapes), 1)).astype(np.int32)
    contacts = contact_batch(builder.table, positions, rotation_matrix(quaternions), pairs)
    near = contacts[:, 0] <= margin
    return pairs[near], contacts[near]


def check(
    found: DetectedContacts, shapes: list[Shape], positions: Array, quaternions: Array, margin: float = 0.0
) -> None:
    pairs, contacts = every_pair(shapes, positions, quaternions, margin)
    assert np.array_equal(found.pairs, pairs)
    sized = 1e-9  # of the size, which is about 1 m; curved shapes are accurate to their own stated bound
    bound = sized + found.error_bound + contacts[:, 10]
    assert (np.abs(found.signed_distance - contacts[:, 0]) <= bound).all()
    # for other shapes, two directions can be equally near, and round-off chooses between them
    simple = np.array([isinstance(shape, Sphere | Box) for shape in shapes])
    exact = simple[pairs].all(axis=1)
    assert np.allclose(found.normal[exact], contacts[exact, 1:4], atol=1e-9)
    middle = positions[pairs[:, 0]] + (contacts[:, 4:7] + contacts[:, 7:10]) / 2
    assert np.allclose(found.point[exact], middle[exact], atol=1e-8 * np.abs(positions).max())
    apart = np.einsum("ij,ij->i", found.point_b - found.point_a, found.normal)
    assert np.allclose(apart, found.signed_distance, atol=1e-9 * (1 + np.abs(found.point_a).max(initial=0)))


@pytest.mark.parametrize("margin", [0.0, 0.1])
@pytest.mark.parametrize("scene", SCENES)
def test_contacts_are_those_of_every_pair(scene, margin: float) -> None:
    rng = np.random.default_rng(3)
    shapes = scene(rng)
    detector = Detector(shapes, margin=margin)
    for _ in range(3):
        positions, quaternions = poses(rng, scene)
        found = detector.detect(positions, quaternions)
        assert len(found) > 20
        check(found, shapes, positions, quaternions, margin)


def test_earlier_contacts_stay_as_they_were() -> None:
    rng = np.random.default_rng(4)
    detector = Detector(boxes(rng))
    first = detector.detect(*poses(rng, boxes))
    before = first.pairs.copy(), first.table.copy()
    detector.detect(*poses(rng, boxes))
    assert np.array_equal(first.pairs, before[0]) and np.array_equal(first.table, before[1])


@pytest.mark.parametrize("scene", [spheres, boxes, mixed])
def test_two_threads_give_the_same_bytes(scene) -> None:
    rng = np.random.default_rng(5)
    shapes = [shape for _ in range(12) for shape in scene(rng)]
    one, two = Detector(shapes), Detector(shapes, threads=2)
    for _ in range(3):
        positions = rng.uniform(0, 13, (len(shapes), 3))
        quaternions = rng.normal(size=(len(shapes), 4))
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        a, b = one.detect(positions, quaternions), two.detect(positions, quaternions)
        assert len(a) > 500
        assert a.pairs.tobytes() == b.pairs.tobytes() and a.table.tobytes() == b.table.tobytes()


@pytest.mark.parametrize("threads", [1, 2])
def test_more_contacts_than_there_was_room_for(threads: int) -> None:
    n = 3200
    detector = Detector([Sphere(1.0)] * n, threads=threads)
    positions = np.zeros((n, 3))
    positions[:, 0] = 3.0 * np.arange(n)
    quaternions = np.tile([0.0, 0, 0, 1], (n, 1))
    assert len(detector.detect(positions, quaternions)) == 0
    assert len(detector.detect(positions * 0.02, quaternions)) == sum(n - k for k in range(1, 34))
    assert len(detector.detect(positions, quaternions)) == 0


def test_static_pairs_are_left_out() -> None:
    rng = np.random.default_rng(6)
    shapes = mixed(rng)
    positions, quaternions = poses(rng, mixed)
    static = rng.random(N) < 0.7
    all_pairs = Detector(shapes).detect(positions, quaternions).pairs
    found = Detector(shapes, static=static).detect(positions, quaternions).pairs
    assert np.array_equal(found, all_pairs[~static[all_pairs].all(axis=1)])


def test_no_shapes_and_one() -> None:
    assert len(Detector([]).detect(np.zeros((0, 3)), np.zeros((0, 4)))) == 0
    assert len(Detector([Sphere(1.0)]).detect([[0, 0, 0]], [[0, 0, 0, 1]])) == 0


def test_bad_poses_are_refused_by_row() -> None:
    detector = Detector([Sphere(1.0)] * 3)
    good = np.zeros((3, 3)), np.tile([0.0, 0, 0, 1], (3, 1))
    assert len(detector.detect(*good)) == 3
    for value in (np.nan, np.inf, 1e19):
        bad = good[0].copy()
        bad[1, 2] = value
        with pytest.raises(PoseError, match=r"positions\[1\]: expected finite numbers up to 1e\+18 m"):
            detector.detect(bad, good[1])
    for value in (np.nan, 0.0, 1.1):
        bad = good[1].copy()
        bad[2, 3] = value
        with pytest.raises(PoseError, match=r"quaternions\[2\]: expected unit length within 0.001"):
            detector.detect(good[0], bad)
    with pytest.raises(InputError, match=r"expected positions of shape \(3, 3\) and quaternions of shape \(3, 4\)"):
        detector.detect(good[0][:2], good[1])
    assert len(detector.detect(*good)) == 3


def test_bad_settings_are_refused() -> None:
    with pytest.raises(InputError, match="margin"):
        Detector([Sphere(1.0)], margin=-1.0)
    with pytest.raises(InputError, match="threads: expected 1 to"):
        Detector([Sphere(1.0)], threads=0)
    with pytest.raises(InputError, match="static: expected 1 flags"):
        Detector([Sphere(1.0)], static=[True, False])
    with pytest.raises(UnsupportedError, match="Mesh has no narrow phase"):
        Detector([Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])])


@pytest.mark.parametrize("broad_phase", BROAD_PHASES[1:])
@pytest.mark.parametrize("scene", [mixed, with_the_ground])
def test_every_broad_phase_gives_the_same_contacts(scene: Any, broad_phase: str) -> None:
    rng = np.random.default_rng(5)
    shapes, static = scene(rng), rng.random(N) < 0.3
    at = poses(rng, scene)
    expected = Detector(shapes, static=static, margin=0.05).detect(*at)
    found = Detector(shapes, static=static, margin=0.05, broad_phase=broad_phase).detect(*at)
    assert found.pairs.tolist() == expected.pairs.tolist()
    bound = found.error_bound + expected.error_bound + 1e-9
    assert (np.abs(found.signed_distance - expected.signed_distance) <= bound).all()
    assert found.point_b - found.point_a == pytest.approx(found.signed_distance[:, None] * found.normal, abs=1e-9)


def test_a_broad_phase_refuses_what_it_cannot_do() -> None:
    with pytest.raises(InputError, match=r"expected one of grid, brute-force, .*k-d-tree.* got 'magic'"):
        Detector([Sphere(1)], broad_phase="magic")
    with pytest.raises(InputError, match="at most 5000 objects"):
        Detector([Sphere(1)] * 5001, broad_phase="brute-force")
    detector = Detector([Sphere(1)] * 2, broad_phase="octree")
    with pytest.raises(PoseError, match=r"quaternions\[1\]"):
        detector.detect(np.zeros((2, 3)), [(0, 0, 0, 1), (0, 0, 0, 2)])
