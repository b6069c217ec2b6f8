"""An example of every kind of shape, which the tests of kinds and pairs go through. A new kind has its line here."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Final

import numpy as np

import collision_monitor as cm
from collision_monitor.records import ShapeType
from collision_monitor.shapes.registry import Shape, kind_with

EXAMPLES: Final[dict[ShapeType, Shape]] = {
    ShapeType.SPHERE: cm.Sphere(0.5),
    ShapeType.BOX: cm.Box((1.0, 0.6, 0.8)),
    ShapeType.CAPSULE: cm.Capsule(0.2, 1.0),
    ShapeType.CYLINDER: cm.Cylinder(0.5, 1.0),
    ShapeType.CONE: cm.Cone(0.5, 1.0),
    ShapeType.CONVEX_HULL: cm.ConvexHull(np.random.default_rng(1).normal(0.0, 0.4, (14, 3))),
    ShapeType.MESH: cm.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]),
    ShapeType.HALF_SPACE: cm.HalfSpace((0.0, 0.6, 0.8), 0.1),
    ShapeType.CIRCLE: cm.Circle(0.5),
    ShapeType.POLYGON: cm.Polygon([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]),
    ShapeType.ELLIPSOID: cm.Ellipsoid((0.7, 0.5, 0.25)),
    ShapeType.POINTS: cm.Points(np.random.default_rng(2).uniform(-0.5, 0.5, (20, 3)), 0.05),
    ShapeType.ROUNDED_BOX: cm.RoundedBox((1.0, 0.8, 0.6), 0.15),
    ShapeType.TRUNCATED_CONE: cm.TruncatedCone(0.5, 0.2, 1.0),
    ShapeType.GRID: cm.Grid([[True, True, False], [True, False, False], [True, False, True]], 0.3, height=0.8),
    ShapeType.VOXELS: cm.Voxels([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 2, -1)], 0.25, edges=[2, 1, 1, 1]),
    ShapeType.HEIGHT_FIELD: cm.HeightField([[0.0, 0.3, 0.1], [0.2, 0.5, 0.0], [0.1, 0.2, 0.4]], 0.4, base=-0.3),
}

WITH_TREES: Final = (ShapeType.MESH, ShapeType.POINTS, ShapeType.GRID, ShapeType.VOXELS, ShapeType.HEIGHT_FIELD)
"""Those whose surface a tree represents."""

CONVEX_SOLIDS: Final = {
    number: shape
    for number, shape in EXAMPLES.items()
    if number not in (*WITH_TREES, ShapeType.HALF_SPACE, ShapeType.CIRCLE, ShapeType.POLYGON)
}
"""Those with a bounded volume, which a slot of the shape table represents."""


def is_planar(number: int) -> bool:
    """Whether shapes of a kind lie in the x-y plane."""
    kind = kind_with(number)
    return kind is not None and kind.planar


SLOT_PAIRS: Final = [
    pair
    for pair in combinations_with_replacement(
        [*CONVEX_SOLIDS, ShapeType.CIRCLE, ShapeType.POLYGON, ShapeType.HALF_SPACE], 2
    )
    if is_planar(pair[0]) == is_planar(pair[1])
]
"""Pairs of kinds that a pair test answers: plane shapes never meet solids. A half-space comes last."""
