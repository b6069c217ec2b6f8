"""Shapes as the fields of a Shape message: valid ones, and degenerate ones of every kind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from dice import Dice
from numpy.typing import NDArray

from collision_monitor.codec.cdr import Writer
from collision_monitor.records import ShapeType

Vertices = NDArray[np.float64]

LARGE: Final = 12_000
"""Vertices of the largest shapes, about 0.3 MB."""

_CORNERS: Final = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_CUBE_SIDES: Final = "013 032 467 475 045 051 237 276 026 064 157 173"
_CUBE: Final = np.array([[int(k) for k in side] for side in _CUBE_SIDES.split()])
_TETRAHEDRON: Final = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
_SIDES: Final = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


class ShapeFields(NamedTuple):
    """The fields of a Shape message."""

    kind: int
    dimensions: list[float]
    vertices: Vertices
    triangles: list[int]

    def write(self, writer: Writer) -> None:
        """Write them without any check."""
        writer.scalar("u1", self.kind, "type")
        writer.sequence(np.array(self.dimensions, "<f8"), "<f8", 8)
        writer.scalar("u4", len(self.vertices), "vertices")
        if len(self.vertices):
            writer.raw(self.vertices.astype("<f8").tobytes(), 8)
        writer.sequence(np.array(self.triangles, "<u4"), "<u4", 4)


_DIMENSIONS: Final = {
    ShapeType.SPHERE: 1,
    ShapeType.BOX: 3,
    ShapeType.CAPSULE: 2,
    ShapeType.CYLINDER: 2,
    ShapeType.CONE: 2,
    ShapeType.HALF_SPACE: 4,
    ShapeType.CIRCLE: 1,
    ShapeType.ELLIPSOID: 3,
    ShapeType.POINTS: 1,
}

_COMMON: Final = (
    *(ShapeType.SPHERE, ShapeType.BOX, ShapeType.CAPSULE, ShapeType.CYLINDER, ShapeType.CONE) * 2,
    *(ShapeType.CONVEX_HULL, ShapeType.MESH) * 2,
    *(ShapeType.HALF_SPACE, ShapeType.CIRCLE, ShapeType.POLYGON, ShapeType.ELLIPSOID, ShapeType.POINTS),
)


def any_shape(dice: Dice) -> ShapeFields:
    """Return a shape of any kind."""
    kind = int(dice.random.choice(_COMMON))
    if dice.is_hostile and dice.chance(0.2):
        kind = dice.word(8)
    none: Vertices = np.empty((0, 3))
    dimensions = dice.numbers(_DIMENSIONS.get(ShapeType(kind), 0), 0.1, 2.0) if kind in _DIMENSIONS else []
    vertices, triangles = none, []
    if kind == ShapeType.MESH:
        vertices, triangles = _mesh(dice)
    elif kind in (ShapeType.CONVEX_HULL, ShapeType.POINTS, ShapeType.POLYGON):
        vertices = _boundary(dice) if kind == ShapeType.POLYGON else _points(dice)
    if kind == ShapeType.POLYGON and dice.chance(0.2):
        dimensions = dice.numbers(1, 0.1, 2.0)
    if dice.is_hostile and dice.chance(0.2):  # fields that do not belong to the kind
        dimensions = dimensions + dice.numbers(dice.random.randrange(5), -1, 1)
        vertices = np.concatenate([vertices, dice.random.choice((none, _CORNERS))])
    for _ in range(dice.random.randrange(1, 4) if len(vertices) and dice.is_hostile else 0):
        vertices = vertices.copy()
        vertices[dice.random.randrange(len(vertices)), dice.random.randrange(3)] = dice.hostile()
    return ShapeFields(kind, dimensions, vertices, triangles)


def _generator(dice: Dice) -> np.random.Generator:
    return np.random.default_rng(dice.random.getrandbits(64))


def _degenerate(dice: Dice, points: Vertices) -> Vertices:
    """Return the points flattened, stretched, moved far away, or coinciding."""
    size = dice.random.choice((0.0, 1e-17, 1e-13, 1e-9, 1e-5, 1e3, 1e9, 1e15))
    kind = dice.random.randrange(6)
    if kind == 0:
        return points * [1.0, 1.0, size]  # flat
    if kind == 1:
        return points * [1.0, size, size]  # a needle
    if kind == 2:
        return points * size
    if kind == 3:
        return points + np.array([size, 0.0, -size])
    if kind == 4:
        return np.repeat(points[:1], len(points), axis=0)
    return np.concatenate([points, points])  # each point twice


def _points(dice: Dice) -> Vertices:
    """Return points for a convex hull."""
    kind = dice.random.random()
    if kind < 0.3:
        points: Vertices = _CORNERS * dice.random.uniform(0.2, 2.0)
    elif kind < 0.6:
        points = _generator(dice).normal(size=(dice.random.randrange(4, 40), 3)) * 0.3
    elif kind < 0.8:  # on a sphere: all are corners
        points = _generator(dice).normal(size=(dice.random.randrange(4, 150), 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    elif kind < 0.95:  # on a lattice: many lie in one face
        points = _generator(dice).integers(0, 3, (dice.random.randrange(4, 60), 3)) * 0.5
    elif kind < 0.99:
        points = np.zeros((dice.random.randrange(4), 3))
    else:
        points = _generator(dice).normal(size=(LARGE, 3))
    return _degenerate(dice, points) if len(points) and dice.is_hostile else points


def _boundary(dice: Dice) -> Vertices:
    """Return the corners of a polygon: round, a star, crossing itself, or too few."""
    count = dice.random.randrange(3, 30)
    if dice.is_hostile and dice.chance(0.3):
        count = dice.random.choice((0, 1, 2, 500, LARGE))
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    radius = np.ones(count)
    if dice.chance(0.5):
        radius[::2] = 0.4
    if dice.is_hostile:
        angle = angle * dice.random.choice((2.0, 3.0, -1.0, 0.0))
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)])
    return _degenerate(dice, points) if count and dice.is_hostile else points


def _mesh(dice: Dice) -> tuple[Vertices, list[int]]:
    """Return vertices and faces of a mesh."""
    kind = dice.random.random()
    if kind < 0.35:
        vertices, faces = _CORNERS.copy(), _CUBE
    elif kind < 0.55:
        vertices, faces = _TETRAHEDRON.copy(), _SIDES
    elif kind < 0.75:
        vertices, faces = _height_field(dice, dice.random.randrange(2, 7))
    elif kind < 0.9:
        vertices, faces = _notched(dice)
    elif kind < 0.995:  # a soup of triangles
        vertices = _generator(dice).normal(size=(dice.random.randrange(3, 30), 3))
        faces = _generator(dice).integers(0, len(vertices), (dice.random.randrange(1, 40), 3))
    else:
        vertices, faces = _height_field(dice, 90)
    if dice.is_hostile:
        vertices = _degenerate(dice, vertices)
    if dice.is_hostile:
        faces = dice.random.choice(_SPOILED)(dice, faces, len(vertices))
    triangles = faces.ravel().tolist()
    if dice.is_hostile and dice.chance(0.2):
        triangles = triangles[: dice.random.randrange(len(triangles) + 1)]  # not three for each face
    return vertices, triangles


def _height_field(dice: Dice, side: int) -> tuple[Vertices, NDArray[np.int64]]:
    """Return an open surface of side x side vertices with random heights."""
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    heights = _generator(dice).normal(size=side * side) * 0.2
    vertices = np.column_stack([x.ravel() / side, y.ravel() / side, heights])
    k = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate([np.column_stack([k, k + side, k + 1]), np.column_stack([k + 1, k + side, k + side + 1])])
    return vertices, faces


def _notched(dice: Dice) -> tuple[Vertices, NDArray[np.int64]]:
    """Return a cube with one corner pushed inside or far out: concave, spiked, or crossing itself."""
    vertices = _CORNERS.copy()
    vertices[7] = dice.random.choice(([-0.2, -0.2, -0.2], [5.0, 0.4, 0.4], [-0.9, -0.9, -0.9], [0.5, 0.5, 0.4999999]))
    return vertices, _CUBE


def _inside_out(dice: Dice, faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return faces[:, ::-1]


def _half_inside_out(dice: Dice, faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return np.concatenate([faces[::2], faces[1::2, ::-1]])


def _open(dice: Dice, faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return faces[dice.random.randrange(len(faces)) :]


def _non_manifold(dice: Dice, faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    return np.concatenate([faces, faces[:2], faces[:1, ::-1]])


def _collapsed(dice: Dice, faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    faces = faces.copy()
    faces[:, 1] = faces[:, 0]
    return faces


def _out_of_range(dice: Dice, faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    faces = faces.copy()
    faces[dice.random.randrange(len(faces)), 1] = dice.random.choice((count, count + 1, 2**31 - 1, 2**31, 2**32 - 1))
    return faces


_SPOILED: Final[tuple[Callable[[Dice, NDArray[np.int64], int], NDArray[np.int64]], ...]] = (
    *(_inside_out, _half_inside_out, _open, _non_manifold, _collapsed, _out_of_range),
)
