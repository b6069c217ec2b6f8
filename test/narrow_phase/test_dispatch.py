"""The test that the table names is the one that answers, for every pair of kinds, in both orders."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest

from collision_monitor.narrow_phase import dispatch
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE
from collision_monitor.narrow_phase.dispatch import PAIR_TESTS, TEST_METHODS, pair_test
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.work_memory import work_array
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.capsule import CAPSULE
from collision_monitor.shapes.kinds.circle import CIRCLE
from collision_monitor.shapes.kinds.cone import CONE
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.ellipsoid import ELLIPSOID
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.shapes.registry import (
    KIND_NAMES,
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Polygon,
    Sphere,
)
from collision_monitor.shapes.shape_table import ShapeTableBuilder

SHAPES = {
    SPHERE: Sphere(0.5),
    BOX: Box((1, 1, 1)),
    CAPSULE: Capsule(0.2, 1.0),
    CYLINDER: Cylinder(0.5, 1.0),
    CONE: Cone(0.5, 1.0),
    CONVEX_HULL: ConvexHull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    HALF_SPACE: HalfSpace((0, 0, 1), 0.0),
    CIRCLE: Circle(0.5),
    POLYGON: Polygon([(0, 0), (1, 0), (0, 1)]),
    ELLIPSOID: Ellipsoid((1.0, 0.5, 0.25)),
}


def answering(monkeypatch: pytest.MonkeyPatch, kinds: tuple[int, int], ask: str, parallel: bool) -> list[str]:
    """The files of the tests that answer when `contact_within` or `separation` is asked about a pair of shapes."""
    answered: list[str] = []

    def recorder(file: str) -> Callable[..., float]:
        def record(*_: Any) -> float:
            answered.append(file)
            return 1.0

        return record

    for name, value in list(vars(dispatch).items()):
        if hasattr(value, "py_func"):
            file = value.py_func.__module__.rpartition(".")[2]
            monkeypatch.setattr(dispatch, name, recorder(file) if file in TEST_METHODS else value.py_func)
    monkeypatch.setattr(dispatch, "is_parallel", lambda *_: parallel)
    builder = ShapeTableBuilder(slots=2)
    for kind in kinds:
        builder.append(SHAPES[kind])
    pose = PairPose(np.eye(3), np.eye(3), (0.5, 0.0, 0.0))
    limit = (np.inf,) if ask == "contact_within" else ()
    getattr(dispatch, ask)(builder.table, 0, 1, pose, *limit, np.zeros(CONTACT_SIZE), work_array())
    return answered


def test_every_two_kinds_that_can_meet_stand_in_the_table_once() -> None:
    planar = {CIRCLE, POLYGON}
    assert set(SHAPES) == set(KIND_NAMES)
    ordered = sorted(SHAPES, key=lambda kind: (kind == HALF_SPACE, kind))
    met = [pair for pair in combinations_with_replacement(ordered, 2) if len({kind in planar for kind in pair}) == 1]
    assert sorted(PAIR_TESTS) == sorted(met)


@pytest.mark.parametrize("ask", ["contact_within", "separation"])
@pytest.mark.parametrize("kinds", PAIR_TESTS, ids=lambda kinds: "-".join(KIND_NAMES[kind] for kind in kinds))
def test_the_test_in_the_table_answers(monkeypatch: pytest.MonkeyPatch, kinds: tuple[int, int], ask: str) -> None:
    file = pair_test(*kinds)
    for pair in {kinds, kinds[::-1]}:
        with monkeypatch.context() as patch:
            assert answering(patch, pair, ask, True) == [file]
        with monkeypatch.context() as patch:
            turned = "convex_convex" if file == "cylinder_cylinder" else file
            assert answering(patch, pair, ask, False) == [turned]
