"""Tests of `model_error`: a profile's model replaces an object only if it does not exceed it too far."""

from __future__ import annotations

import pytest

from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.registry import Box, Mesh


def bracket() -> Mesh:
    """An L of two boxes of 1 m, 0.2 m thick, whose hull exceeds it by about half of the open square."""
    corners = [(0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 1), (0, 1)]
    vertices = [(x, y, z) for z in (0.0, 0.3) for x, y in corners]
    ends = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    faces = [tuple(reversed(end)) for end in ends] + [tuple(k + 6 for k in end) for end in ends]
    for k in range(6):
        n = (k + 1) % 6
        faces += [(k, n, n + 6), (k, n + 6, k + 6)]
    return Mesh(vertices, faces)


def model_in(monitor: Monitor, object_id: int) -> Model:
    return Model(monitor.roster.bodies.model[monitor.roster.slot(object_id)])


@pytest.mark.parametrize(("error", "expected"), [(0.1, Model.EXACT), (2.0, Model.CONVEX_HULL)])
def test_a_hull_replaces_a_mesh_only_if_it_is_close(error: float, expected: Model) -> None:
    monitor = Monitor(Profile(model_mesh="convex_hull", model_error=error))
    monitor.add(1, bracket())
    assert model_in(monitor, 1) is expected


def test_an_object_with_a_model_of_its_own_keeps_it() -> None:
    monitor = Monitor(Profile(model_primitive="sphere", model_error=0.001))
    monitor.describe(ObjectDescription(1, Box((1, 1, 1)), model="sphere"))
    monitor.add(2, Box((1, 1, 1)))
    assert [model_in(monitor, i) for i in (1, 2)] == [Model.SPHERE, Model.EXACT]
