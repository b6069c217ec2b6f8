"""Tests of the models of large concave meshes against those made of a list of their triangles."""

from __future__ import annotations

from time import process_time

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import collision_monitor as cm
from collision_monitor.geometry.qhull import QhullResult
from collision_monitor.objects import models
from collision_monitor.objects.excess import BLOCK, BLOCKS
from collision_monitor.objects.models import containing_kdop, containing_model, monitored_model
from collision_monitor.records import Model

AT = cm.Pose((3.0, -1.0, 2.0), (0.1, 0.5, 0.5, 0.7))
COARSE = [Model.SPHERE, Model.AABB, Model.OBB, Model.KDOP14, Model.CONVEX_HULL]


def meshes():
    """A ring with and without a hole, with a face turned over; a soup and a crumpled sheet."""
    rng = np.random.default_rng(2)
    ring = trimesh.creation.torus(1.0, 0.3, 32, 20)
    v, f = np.array(ring.vertices), np.array(ring.faces)
    yield v, f
    yield v, f[1:]
    yield v, f[200:]
    yield v, np.concatenate([f[:1, ::-1], f[1:]])
    yield (
        (rng.uniform(-1, 1, (1200, 1, 3)) + rng.normal(size=(1200, 3, 3)) * 0.1).reshape(-1, 3),
        np.arange(3600).reshape(-1, 3),
    )
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    k = np.arange(870)[np.arange(870) % 30 != 29]
    quads = np.column_stack([k, k + 30, k + 1]), np.column_stack([k + 1, k + 30, k + 31])
    yield np.column_stack([x.ravel(), y.ravel(), rng.normal(size=900) * 3.0]), np.concatenate(quads)


@pytest.mark.parametrize("model", COARSE, ids=lambda m: m.name.lower())
def test_the_model_is_that_of_the_triangles(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    for v, f in meshes():
        mesh = cm.Mesh(v, f)
        large = containing_model([(mesh, AT)], model)
        monkeypatch.setattr(models, "MANY_FACES", 1 << 30)
        plain = containing_model([(mesh, AT)], model)
        monkeypatch.undo()
        (own, place), (other, its) = large.pieces[0], plain.pieces[0]
        size = float(np.ptp(v, axis=0).max())
        if model is Model.OBB:  # another box may be as small
            assert np.prod(own.size) == pytest.approx(np.prod(other.size), rel=1e-3)
            continue
        for d in np.random.default_rng(0).normal(size=(20, 3)):
            reach = [models.reach([(shape, pose)], d[None])[0] for shape, pose in ((own, place), (other, its))]
            assert reach[0] == pytest.approx(reach[1], abs=1e-9 * size)
        assert large.model == plain.model and large.convex == plain.convex
        # as many cells count, or a few more
        assert plain.excess * (1.0 - 1e-9) <= large.excess <= plain.excess + 2.0 / (BLOCK * BLOCKS) * size


def test_no_point_of_the_hull_is_farther_from_the_mesh_than_the_excess() -> None:
    rng = np.random.default_rng(4)
    for v, f in meshes():
        mesh = cm.Mesh(v, f)
        if mesh.surface.certain:
            continue
        used = v[np.unique(f)]
        found = monitored_model([(mesh, cm.Pose())], Model.AUTO)
        assert found.model is Model.CONVEX_HULL and found.corners[0] is not None
        assert np.array_equal(found.pieces[0][0].points, used[QhullResult(used).vertices])
        probes = rng.uniform(v.min(axis=0), v.max(axis=0), (3000, 3))
        probes = probes[~QhullResult(used).beyond(probes, 0.0)]
        weights = rng.dirichlet(np.full(3, 0.5), (30, len(f)))
        surface = np.einsum("ijk,jkl->ijl", weights, v[f]).reshape(-1, 3)
        if not len(mesh.surface.hole):
            continue  # its inside counts as the object where the parity is certain
        away = cKDTree(surface).query(probes)[0]
        assert away.max() <= found.excess
        assert found.excess <= away.max() + 4.0 / (BLOCK * BLOCKS) * np.linalg.norm(np.ptp(v, axis=0))


def test_a_kdop_of_own_directions_is_that_of_the_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    v, f = list(meshes())[1]
    large = containing_kdop([(cm.Mesh(v, f), AT)], np.eye(3))
    monkeypatch.setattr(models, "MANY_FACES", 1 << 30)
    plain = containing_kdop([(cm.Mesh(v, f), AT)], np.eye(3))
    assert large.model == plain.model and large.excess == pytest.approx(plain.excess, rel=0.1)


def test_an_open_mesh_takes_hardly_longer_than_a_closed_one() -> None:
    """A ring of 16,383 faces took 2.9 s, and 0.1 s with its last face."""
    ring = trimesh.creation.torus(1.0, 0.3, 128, 64)
    cm.Monitor().add(1, cm.Mesh(*list(meshes())[1]))
    began = process_time()
    cm.Monitor().add(1, cm.Mesh(ring.vertices, ring.faces[1:]))
    assert process_time() - began < 1.0
