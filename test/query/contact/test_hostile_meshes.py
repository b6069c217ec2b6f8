"""Meshes that no tree prunes: slivers in one line, bodies very far away, soups in soups. The work is counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernels import tree_distance
from numpy.typing import NDArray
from processor_time import within

import collision_monitor as cm
from collision_monitor import Motion, Pose
from collision_monitor._jit import kernel
from collision_monitor.impact.body_impact import BodyPair, ImpactQuery, Window, chains_impact
from collision_monitor.impact.impact_record import CLEAR, IMPACT
from collision_monitor.meshes.distance.nearest import LEAST, answer_row
from collision_monitor.meshes.distance.nearest import MEMORY as TREE_MEMORY
from collision_monitor.meshes.distance.solid import MOST_EXAMINED
from collision_monitor.meshes.trees.shape_trees import kept_tree
from collision_monitor.query.body import exact_body, kept_slots, plant
from collision_monitor.query.contact import open_gap
from collision_monitor.query.impact import moving_body
from collision_monitor.query.impact.impact_kernel import MEMORY, set_pair
from collision_monitor.query.library import LIBRARY

RNG = np.random.default_rng(3)


def slivers(count: int) -> cm.Mesh:
    """Triangles of 1 um in the x axis, between -1 and 1."""
    corners = np.zeros((count, 3, 3))
    corners[:, :, 0] = RNG.uniform(-1.0, 1.0, (count, 3))
    corners[:, 1, 1] = 1e-6
    return cm.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def soup(count: int) -> cm.Mesh:
    corners = 0.4 * RNG.normal(size=(count, 1, 3)) + 0.05 * RNG.normal(size=(count, 3, 3))
    return cm.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def test_slivers_that_touch_are_followed_in_a_bounded_time() -> None:
    mesh, drum = slivers(2_000), cm.Cylinder(0.5, 1.0)
    turning = Motion(Pose(), angular=(0.3, 0.5, 0.7))
    sinking = Motion(Pose((0, 0, 0.5)), (0, 0, -0.3), (0.5, -0.2, 0.1))
    cm.time_of_impact(mesh, turning, drum, sinking)
    with within(2.0):
        found = cm.time_of_impact(mesh, turning, drum, sinking)
    assert found.status != "clear" and found.lower == 0.0


def test_round_off_does_not_hide_which_triangles_of_a_body_very_far_away_are_nearest() -> None:
    """A search that ends early, because it opens too many leaves, states a lower bound below the distance."""
    tree, work, answer = kept_tree(soup(8_000)).tree, np.empty(TREE_MEMORY), answer_row()
    far = np.array([2e17, -3e17, 1e18])
    distance = tree_distance(tree, np.eye(3), np.zeros(3), tree, np.eye(3), far, np.inf, answer, work)
    assert distance == pytest.approx(np.linalg.norm(far), rel=1e-14)
    assert answer[LEAST] == distance


@pytest.mark.parametrize("solid", [cm.ConvexHull(RNG.normal(size=(30, 3))), cm.Ellipsoid((0.2, 0.3, 0.5))])
def test_a_cloud_very_far_away_keeps_its_bound(solid: cm.Shape) -> None:
    cloud, far = cm.Points(RNG.normal(size=(2 * MOST_EXAMINED, 3)), 0.01), np.array([2e17, -3e17, 1e18])
    found = cm.contact(cloud, Pose(), solid, Pose(far))
    assert abs(found.signed_distance - np.linalg.norm(far)) <= found.error_bound < 1e-9 * np.linalg.norm(far)


def test_the_depth_of_more_slivers_than_are_examined_is_within_its_bound() -> None:
    """The deepest point of the x axis in an ellipsoid is its centre, 0.3 m from the surface."""
    count = 2 * MOST_EXAMINED
    corners = np.zeros((count, 3, 3))
    corners[:, :, 0] = RNG.uniform(-1.0, 1.0, (count, 1)) + 1e-7 * RNG.normal(size=(count, 3))
    mesh = cm.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    found = cm.contact(mesh, Pose(), cm.Ellipsoid((0.5, 0.4, 0.3)), Pose())
    assert found.signed_distance - found.error_bound <= -0.3 + 1e-4 <= found.signed_distance + 1e-3


def test_points_are_not_located_in_a_soup_beyond_a_number_of_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    located = []
    locate = open_gap.locate_in_welded_surface
    monkeypatch.setattr(open_gap, "MOST_TESTS", 4_000)
    monkeypatch.setattr(
        open_gap, "locate_in_welded_surface", lambda own, surface: located.append(own) or locate(own, surface)
    )
    a, b = (exact_body(soup(400), name) for name in "ab")
    assert open_gap.location_of(a, Pose(), b, Pose()) == (open_gap.UNKNOWN, open_gap.UNKNOWN)
    assert sum(map(len, located)) * 400 <= 2 * 4_000


def terrain(count: int) -> cm.Mesh:
    """A square of 10 m, flat about its middle and waves of 0.1 m around that."""
    x, y = np.meshgrid(*[np.linspace(-5, 5, count)] * 2, indexing="ij")
    z = np.where(np.hypot(x, y) < 2, 0, 0.1 * np.sin(3 * x) ** 2)
    k = np.arange(count * count).reshape(count, count)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    return cm.Mesh(np.stack([x, y, z], -1).reshape(-1, 3), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.5, 0.0, 0.0)], ids=str)
@pytest.mark.parametrize("other", [cm.Box((0.5, 0.4, 0.3)), cm.Cylinder(0.3, 0.3), terrain(12)], ids=repr)
def test_only_triangles_near_a_body_on_a_terrain_are_followed_one_by_one(
    other: cm.Shape, velocity: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    ground = terrain(32)
    height = 0.0 if isinstance(other, cm.Mesh) else 0.15
    a, b = Motion(Pose()), Motion(Pose((0.3, 0.2, height)), velocity)
    monkeypatch.setattr(moving_body, "MANY_FACES", 10_000)
    whole = cm.time_of_impact(ground, a, other, b)
    counts = []
    follow = moving_body.touching_pieces
    monkeypatch.setattr(
        "collision_monitor.query.impact.impact_of_motions.touching_pieces",
        lambda *arguments: counts.append(follow(*arguments)) or counts[-1],
    )
    monkeypatch.setattr(moving_body, "MANY_FACES", 100)
    found = cm.time_of_impact(ground, a, other, b)
    assert found.lower == pytest.approx(whole.lower, abs=1e-5)
    assert (found.status == "clear") == (whole.status == "clear")
    if not isinstance(other, cm.Mesh):
        assert len(counts[0]) < len(ground.faces) / 10


@pytest.mark.parametrize("other", [soup(200), cm.Cylinder(0.5, 1.0)], ids=["mesh", "solid"])
def test_the_search_ends_where_the_time_has_no_finer_resolution(other: cm.Shape) -> None:
    """At 1e18 m/s the boxes take steps that do not change the time; 1,000 steps count as one distance query."""
    a = Motion(Pose(), angular=(0.3, 0.5, 0.7))
    b = Motion(Pose((3.0, 0.2, 1e18)), (0.6, -0.2, -1e18), (0.1, -0.4, 0.9))
    chains, numbers = [], []
    for shape, motion in ((soup(500), a), (other, b)):
        kept = kept_slots(shape)
        assert kept is not None
        plant(kept, shape)
        chains.append(np.int32(kept.first))
        numbers.append([*motion.pose.numbers, *motion.numbers])
    event = np.zeros(1, IMPACT)
    queries = impact_of(*LIBRARY.tuples, MEMORY.scratch, MEMORY.motion, tuple(chains), np.array(numbers), event)
    assert queries <= 2
    assert event[0]["status"] != CLEAR and event[0]["lower"] == pytest.approx(1.0)


@kernel
def impact_of(
    table: Any, parts: Any, scratch: Any, motion: Any, chains: Any, numbers: NDArray[np.float64], event: Any
) -> int:
    """Write the impact of two chains; return the number of distance queries."""
    set_pair(table, parts, chains, motion, numbers, 0, numbers, 1)
    pair = BodyPair(motion[0], motion[1], chains[0], chains[1], motion[0].radius, motion[1].radius)
    search = ImpactQuery(0.0, 1e-6, 1000)
    queries: int = chains_impact(table, parts, pair, Window(0.0, 2.0), search, scratch, event[0])
    return queries
