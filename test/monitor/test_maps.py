"""Maps in the monitor: the same answers as of the same solid made of boxes; snapshots, updates, unknown cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.meshes.trees.shape_trees import kept_tree
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.records import STATE, ContactStatus, PredictionStatus

SECOND = 1_000_000_000


def cells_of(seed: int, shape: tuple[int, int] = (90, 100), density: float = 0.06) -> Any:
    return np.random.default_rng(seed).random(shape) < density


def boxes(cells: Any, edge: float, height: float) -> list[tuple[cm.Box, cm.Pose]]:
    """One box for each cell."""
    at = (np.argwhere(cells)[:, ::-1] + 0.5) * edge
    return [(cm.Box((edge, edge, height)), cm.Pose((x, y, height / 2))) for x, y in at.tolist()]


def moving(seed: int, count: int, far: float) -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(seed)
    poses, twists = np.zeros((count, 7)), np.zeros((count, 6))
    poses[:, :2], poses[:, 2] = rng.uniform(0, far, (count, 2)), rng.uniform(0.2, 1.5, count)
    q = rng.normal(size=(count, 4))
    poses[:, 3:] = q / np.linalg.norm(q, axis=1, keepdims=True)
    twists[:, :2], twists[:, 5] = rng.normal(0, 0.8, (count, 2)), rng.normal(0, 0.5, count)
    shapes = [cm.Box((0.3, 0.2, 0.2)), cm.Sphere(0.15), cm.Cylinder(0.1, 0.3), cm.Capsule(0.08, 0.2)]
    return [shapes[k % 4] for k in range(count)], poses, twists


def monitor_of(thing: Any, shapes: Any, pose: Any = (0, 0, 0)) -> cm.Monitor:
    """A map, and shapes that meet nothing else."""
    monitor = cm.Monitor("exact")
    monitor.add(1, thing, static=True, pose=pose, group=2)
    for k, shape in enumerate(shapes):
        monitor.add(2 + k, shape, mask=2)
    return monitor


@pytest.mark.parametrize("seed", range(3))
def test_a_grid_has_the_contacts_and_predictions_of_its_cells(seed: int) -> None:
    cells = cells_of(seed, (30, 30), 0.15)
    shapes, poses, twists = moving(seed, 40, 15.0)
    ids, at = np.arange(2, 42), (0, 0, 0, 0, 0, np.sin(0.2), np.cos(0.2))
    answers = []
    for thing in (cm.Grid(cells, 0.5, 1.5), boxes(cells, 0.5, 1.5)):
        monitor = monitor_of(thing, shapes, at)
        result = monitor.step(stamp=0.0, ids=ids, poses=poses, twists=twists)
        answers.append(({*result.contacts["id_b"].tolist()}, result.predictions))
    assert answers[0][0] == answers[1][0] and len(answers[0][0]) > 3
    assert answers[0][1]["id_b"].tolist() == answers[1][1]["id_b"].tolist() and len(answers[0][1]) > 3
    np.testing.assert_allclose(answers[0][1]["lower"], answers[1][1]["lower"], atol=1e-4)


def test_a_robot_that_slides_along_a_wall_meets_no_edge_within_it() -> None:
    """The wall is longer than a tile, and the robot a little in it: each normal is that of the wall."""
    cells = np.zeros((70, 400), bool)
    cells[:30] = True
    monitor = cm.Monitor("exact")
    monitor.add(1, cm.Grid(cells, 0.05, 1.0), static=True, pose=(0, 0, 0))
    monitor.add(2, cm.Box((0.6, 0.4, 0.5)))
    for k, x in enumerate(np.linspace(1.0, 19.0, 500)):
        pose = x, 1.5 + 0.2 - 0.003, 0.5, 0, 0, 0, 1
        result = monitor.step(stamp=0.01 * k, ids=[2], poses=[pose], twists=[(1.8, 0, 0, 0, 0, 0)])
        (contact,) = result.contacts
        np.testing.assert_allclose(contact["normal"], (0, 1, 0), atol=1e-9)
        assert contact["signed_distance"] == pytest.approx(-0.003, abs=1e-9)
    assert not len(result.predictions)


def test_updates_and_a_restored_snapshot_answer_as_a_new_monitor() -> None:
    grid, rng = cm.Grid(cells_of(1, (150, 140)), 0.1, 1.5), np.random.default_rng(2)
    shapes, poses, twists = moving(5, 20, 14.0)
    monitor = monitor_of(grid, shapes)
    for k in range(6):
        rows, columns = rng.integers(1, 60, 2)
        part = rng.random((rows, columns)) < 0.1
        grid = grid.updated(int(rng.integers(0, 150 - rows)), int(rng.integers(0, 140 - columns)), part)
        monitor.add(1, grid, static=True, pose=(0, 0, 0), group=2, replace=True)
        monitor.step(stamp=0.1 * k, ids=np.arange(2, 22), poses=poses, twists=twists)
    fresh = monitor_of(cm.Grid(grid.cells == 1, 0.1, 1.5), shapes)
    poses[:, :2] += 0.05
    given = {"ids": np.arange(2, 22), "poses": poses, "twists": twists}
    restored = cm.Monitor.restored("exact", monitor.snapshot())
    results = [each.step(stamp=0.6, **given) for each in (monitor, restored, fresh)]
    assert results[0].contacts.tobytes() == results[1].contacts.tobytes() and len(results[0].contacts)
    assert results[0].predictions.tobytes() == results[1].predictions.tobytes()
    for name in ("id_b", "signed_distance", "normal", "point_a"):
        np.testing.assert_array_equal(results[0].contacts[name], results[2].contacts[name])


def test_unknown_cells_are_unresolved_obstacles_or_free() -> None:
    cells = np.array([[100, 0, 0, 0, -1, 0, 0, 0, 0]])
    found = {}
    for unknown in ("unresolved", "obstacle", "free"):
        monitor = cm.Monitor("exact")
        monitor.add(1, cm.Grid(cells, 1.0, 1.0, unknown=unknown), static=True, pose=(0, 0, 0))
        for k in range(3):
            monitor.add(2 + k, cm.Sphere(0.2))
        poses = [(x, 0.5, 0.5, 0, 0, 0, 1) for x in (1.1, 3.9, 7.0)]  # at the wall, at the unknown cell, towards it
        twists = [(0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 0, 0), (-2, 0, 0, 0, 0, 0)]
        result = monitor.step(stamp=0.0, ids=[2, 3, 4], poses=poses, twists=twists)
        again = cm.Monitor.restored("exact", monitor.snapshot()).step(stamp=0.01, ids=[2], poses=poses[:1])
        assert [c["status"] for c in again.contacts] == [c["status"] for c in result.contacts]
        pairs = zip(result.contacts["id_b"].tolist(), result.contacts["status"].tolist(), strict=True)
        hits = result.predictions[result.predictions["id_a"] == 1]
        found[unknown] = dict(pairs), *((hit["status"], hit["upper"], hit["lower"]) for hit in hits)
    sure, doubt = ContactStatus.TOUCHING, ContactStatus.UNRESOLVED
    when = pytest.approx((7.0 - 0.2 - 5.0) / 2, abs=1e-3)
    assert found["unresolved"] == ({2: sure, 3: doubt}, (PredictionStatus.UNRESOLVED, np.inf, when))
    assert found["obstacle"] == ({2: sure, 3: sure}, (PredictionStatus.HIT, when, when))
    assert found["free"] == ({2: sure},)


@pytest.mark.parametrize(
    "shape",
    [
        cm.Grid(cells_of(3, (130, 70)), 0.1, 1.0),
        cm.Grid(np.where(cells_of(3, (130, 70)), -1, 100 * cells_of(4, (130, 70))), 0.1, 1.0),
        cm.Voxels(np.argwhere(np.random.default_rng(1).random((40, 30, 20)) < 0.1) - 15, 0.2),
        cm.HeightField(np.random.default_rng(2).random((70, 20)), 0.3),
    ],
    ids=["grid", "unknown", "voxels", "terrain"],
)
def test_the_pipeline_takes_maps_from_messages_and_restores_them(shape: Any) -> None:
    pipeline, rng = Pipeline("exact"), np.random.default_rng(8)
    spheres = [ObjectDescription(2 + k, cm.Sphere(0.3), mask=2) for k in range(30)]
    described = ObjectDescription(1, shape, static=True, pose=cm.Pose((0, 0, 0)), group=2)
    pipeline.on_shapes(encode_descriptions(0, "world", [described, *spheres]))
    states = np.zeros(30, STATE)
    states["id"], states["quaternion"] = np.arange(2, 32), (0, 0, 0, 1)
    states["position"] = rng.uniform(shape.vertices.min(axis=0), shape.vertices.max(axis=0), (30, 3))
    states["linear"] = rng.normal(size=(30, 3))
    pipeline.on_states(encode_states(0, "world", 0, states))
    assert not sum(pipeline.refused.values())
    restored = Pipeline.restored(pipeline.snapshot(), "world")
    states["position"] += 0.05 * states["linear"]
    answers = [each.on_states(encode_states(SECOND // 20, "world", 1, states)) for each in (pipeline, restored)]
    assert answers[0] is not None and answers[1] is not None
    assert answers[0].contacts == answers[1].contacts and answers[0].predictions == answers[1].predictions
    assert len(answers[0].result.contacts) + len(answers[0].result.predictions) > 0


def test_a_grid_that_is_described_again_keeps_the_tiles_that_did_not_change() -> None:
    pipeline, cells = Pipeline(), cells_of(1, (300, 300))
    grids = []
    for _ in range(2):
        described = ObjectDescription(1, cm.Grid(cells, 0.1), static=True, pose=cm.Pose((0, 0, 0)))
        pipeline.on_shapes(encode_descriptions(0, "world", [described]))
        grids.append(pipeline.catalogue.descriptions[1].shapes[0][0])
        cells = cells.copy()
        cells[70:80, 70:80] ^= True
    kept = {id(tile) for tile in grids[0].tiles}
    assert sum(id(tile) not in kept for tile in grids[1].tiles) == 1
    np.testing.assert_array_equal(kept_tree(grids[1]).tree, kept_tree(cm.Grid(grids[1].cells == 1, 0.1)).tree)
