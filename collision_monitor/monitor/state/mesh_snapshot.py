"""The meshes and clouds of a snapshot, from which `restore` builds their trees again, equal to the bit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.meshes.trees.cloud_tree import cloud_tree, tree_points
from collision_monitor.meshes.trees.slot_trees import plant_trees
from collision_monitor.meshes.trees.tree_surface import TreeSurface, surface_of
from collision_monitor.monitor.state.snapshot import Snapshot, check_range
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.points import MOST_CLOUD_POINTS, POINTS
from collision_monitor.shapes.shape_table import TREE, ShapeTable, ShapeTableBuilder
from collision_monitor.tolerances import LARGEST_INPUT


def mesh_arrays(table: ShapeTable) -> dict[str, NDArray[Any]]:
    """Arrays that describe the meshes of a table; none if it has none. Equal meshes are saved once.

    meshes.of: the mesh of each slot with one. By mesh: numbers of triangles, of parts and of tiles, and whether it is
    closed. meshes.tiles: numbers of triangles of the tiles of all meshes.
    meshes.corners (m, 3, 3) and meshes.points (k, 3): those of all meshes, one after another.
    clouds.of: the cloud of each slot with one. clouds.count: the number of points of each cloud. clouds.points (n, 3).
    """
    return {**_triangles(table), **_points(table)}


def _points(table: ShapeTable) -> dict[str, NDArray[Any]]:
    slots = np.flatnonzero(table.kind == POINTS)
    if not len(slots):
        return {}
    roots, of = np.unique(table.size[slots, TREE].astype(np.int64) - 1, return_inverse=True)
    found = [tree_points(table.blocks, int(root)) for root in roots]
    return {
        "clouds.of": of.astype(np.int32),
        "clouds.count": np.array([len(each) for each in found], np.int32),
        "clouds.points": np.concatenate(found),
    }


def _triangles(table: ShapeTable) -> dict[str, NDArray[Any]]:
    slots = np.flatnonzero(table.kind == MESH)
    if not len(slots):
        return {}
    roots, of = np.unique(table.size[slots, TREE].astype(np.int64) - 1, return_inverse=True)
    found = [surface_of(table.blocks, int(root)) for root in roots]
    return {
        "meshes.of": of.astype(np.int32),
        "meshes.triangles": np.array([len(each.corners) for each in found], np.int32),
        "meshes.parts": np.array([len(each.parts) for each in found], np.int32),
        "meshes.tile_counts": np.array([len(each.tiles) for each in found], np.int32),
        "meshes.tiles": np.concatenate([each.tiles for each in found]).astype(np.int32),
        "meshes.closed": np.array([each.closed for each in found], np.bool_),
        "meshes.corners": np.concatenate([each.corners for each in found]),
        "meshes.points": np.concatenate([each.parts for each in found]),
    }


def plant_meshes(builder: ShapeTableBuilder, snapshot: Snapshot) -> None:
    """Give the meshes and clouds of a restored table their trees, and the other shapes those that their pairs need.

    Raises InputError if the arrays do not describe them.
    """
    _plant_triangles(builder, snapshot)
    _plant_points(builder, snapshot)
    plant_trees(builder)


def _plant_points(builder: ShapeTableBuilder, snapshot: Snapshot) -> None:
    slots = np.flatnonzero(builder.table.kind == POINTS)
    if not len(slots):
        return
    of = snapshot.array("clouds.of", np.zeros(0, np.int32), len(slots))
    counts = snapshot.array("clouds.count", np.zeros(0, np.int32))
    check_range("clouds.of", of, 0, len(counts))
    check_range("clouds.count", counts, 1, MOST_CLOUD_POINTS + 1)
    points = snapshot.array("clouds.points", np.zeros((0, 3)), int(counts.sum()))
    if not (np.abs(points) <= LARGEST_INPUT).all():
        raise InputError(f"snapshot, clouds: expected finite coordinates up to {LARGEST_INPUT:g}, got others")
    trees = [cloud_tree(each) for each in np.split(points, np.cumsum(counts)[:-1])]
    for slot, cloud in zip(slots.tolist(), of.tolist(), strict=True):
        builder.plant(slot, trees[cloud])


def _plant_triangles(builder: ShapeTableBuilder, snapshot: Snapshot) -> None:
    slots = np.flatnonzero(builder.table.kind == MESH)
    if not len(slots):
        return
    of = snapshot.array("meshes.of", np.zeros(0, np.int32), len(slots))
    triangles = snapshot.array("meshes.triangles", np.zeros(0, np.int32))
    parts = snapshot.array("meshes.parts", np.zeros(0, np.int32), len(triangles))
    closed = snapshot.array("meshes.closed", np.zeros(0, np.bool_), len(triangles))
    check_range("meshes.of", of, 0, len(triangles))
    tile_counts = snapshot.array("meshes.tile_counts", np.zeros(len(triangles), np.int32), len(triangles))
    check_range("meshes.tile_counts", tile_counts, 0, 1 << 31)
    tiles = snapshot.array("meshes.tiles", np.zeros(0, np.int32), int(tile_counts.sum()))
    check_range("meshes.tiles", tiles, 1, 1 << 31)
    of_mesh = np.split(tiles.astype(np.int64), np.cumsum(tile_counts)[:-1])
    check_range("meshes.triangles", triangles, 1, 1 << 31)
    check_range("meshes.parts", parts, 0, 1 << 31)
    if any(len(own) and own.sum() != count for own, count in zip(of_mesh, triangles.tolist(), strict=True)):
        raise InputError("snapshot, meshes.tiles: expected the triangles of each mesh, got other numbers")
    if (parts[tile_counts == 0] < 1).any():
        raise InputError("snapshot, meshes.parts: expected at least one of each mesh without tiles, got none")
    corners = snapshot.array("meshes.corners", np.zeros((0, 3, 3)), int(triangles.sum()))
    points = snapshot.array("meshes.points", np.zeros((0, 3)), int(parts.sum()))
    if not ((np.abs(corners) <= LARGEST_INPUT).all() and (np.abs(points) <= LARGEST_INPUT).all()):
        raise InputError(f"snapshot, meshes: expected finite coordinates up to {LARGEST_INPUT:g}, got others")
    ends, last = np.cumsum(triangles), np.cumsum(parts)
    trees = [
        TreeSurface(
            corners[ends[k] - triangles[k] : ends[k]],
            bool(closed[k]),
            points[last[k] - parts[k] : last[k]],
            of_mesh[k],
        ).tree
        for k in range(len(triangles))
    ]
    for slot, mesh in zip(slots.tolist(), of.tolist(), strict=True):
        builder.plant(slot, trees[mesh])
