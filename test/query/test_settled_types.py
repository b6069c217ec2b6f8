"""Kernels that look at the types of their first arguments only: every shape, pose and motion gives the same types."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
import trimesh
from numba import typeof

import collision_monitor as cm
from collision_monitor._jit.settled import SettledFunction
from collision_monitor.query.contact.contact_kernel import contact_of_chains, overlap_of_chains
from collision_monitor.query.impact.impact_kernel import impact_of_chains

TORUS = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=8)
SOUP = np.random.default_rng(1).normal(size=(60, 3))
SHAPES: list[cm.Shape] = [
    cm.Sphere(0.5),
    cm.Box((1.0, 0.5, 0.2)),
    cm.Capsule(0.3, 1.0),
    cm.Cylinder(0.3, 1.0),
    cm.Cone(0.3, 1.0),
    cm.Ellipsoid((0.5, 0.3, 0.2)),
    cm.ConvexHull(SOUP[:20]),
    cm.Points(np.asfortranarray(SOUP), 0.01),
    cm.Mesh(TORUS.vertices, TORUS.faces),
    cm.Mesh(np.asfortranarray(TORUS.vertices[::-1]), np.asfortranarray(len(TORUS.vertices) - 1 - TORUS.faces)),
    cm.Mesh(SOUP.astype(np.float32), np.arange(60, dtype=np.int32).reshape(20, 3)),
    cm.Mesh(TORUS.vertices, TORUS.faces[:-30]),
]
KERNELS = (contact_of_chains, overlap_of_chains, impact_of_chains)


class Seen:
    """An entry that records the types of its arguments."""

    def __init__(self, function: SettledFunction) -> None:
        self.function, self.types = function, set[tuple[Any, ...]]()

    def __call__(self, *args: Any) -> Any:
        self.types.add(tuple(str(typeof(each)).replace("readonly", "mutable") for each in args))
        return self.function.dispatcher(*args)


def test_all_shapes_poses_and_motions_give_the_same_types(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = [Seen(function) for function in KERNELS]
    for each in seen:
        monkeypatch.setitem(each.function.__dict__, "entry", each)
    turned = cm.Pose.from_matrix(np.asfortranarray(cm.Pose.from_euler(0.1, 0.2, 0.3).matrix))
    away = cm.Pose(np.array([2.5, 0.1, 0.3], np.float32), [0, 0, 0, 1])
    for a, b in product(SHAPES, [*SHAPES, cm.HalfSpace((0.0, 0.0, 1.0))]):
        for far in (turned, away):
            cm.contact(a, cm.Pose(), b, far)
            cm.overlap(a, cm.Pose(), b, far)
            cm.time_of_impact(a, cm.Motion(cm.Pose(), (0, 0, 0), [0, 0, 1]), b, cm.Motion(far, np.array([-1, 0, 0])))
    assert [len(each.types) for each in seen] == [1] * len(seen), [sorted(each.types) for each in seen]
