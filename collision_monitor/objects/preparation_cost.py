"""Estimated time to make the model of an object, from its numbers of vertices, faces and shapes.

Exact times are not needed and a clock is not used: the same message must get the same models live and in a replay. The
figures (ms) are those of one 2024 core, rounded up, with the worst input of each kind that was found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import inf
from typing import Final

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.orientation import exact_limit
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.records import Model
from collision_monitor.shapes.cells.tiled_solid import TiledSolid
from collision_monitor.shapes.convex_pieces import is_convex_mesh
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, HalfSpace, Mesh, Points, Polygon, Shape, kind_of

MESSAGE_MS: Final = 80.0
"""Estimated time (ms) for which the objects of one message may hold the thread that answers states. Larger: answers
come late. Smaller: even one ordinary concave mesh gets its own model a second later."""

BOXES_MS: Final = 40.0
"""The same for the objects of a message with the model AABB. Others have a box with a wider bound of its excess."""

SMALL_MS: Final = 2.0
"""Objects below this estimate (ms) are never put off, however many a message has: 0.1 to 2 ms each, as stated."""

LEAST_EXACT: Final = 100
"""Determinants in integers that any object may need, 2 ms. A small convex polygon needs one for each corner."""

_SIMPLE: Final = 0.05  # a shape with dimensions
_HULL: Final = (0.3, 3e-3, 5e-6)  # a hull: in all, for each point, for each two points
_HEIGHT: Final = 2e-5  # a vertex above the plane of a face, in the test for convexity
_CONCAVE: Final = (30.0, 0.12)  # the excess around a concave object: in all, for each face
_TREE: Final = (0.1, 5e-3)  # the surface and the tree of an exact concave mesh: in all, for each face
_POINT: Final = 1.5e-4  # a point of a cloud, in its tree
_EXACT: Final = 0.02  # a determinant in integers
_PIECE: Final = 10.0  # the excess around several pieces: for each piece
_TRIANGLE: Final = 3.0  # the excess around a concave mesh beside other shapes, also convex meshes: for each face
_POLYGON: Final = 0.012  # two corners of a concave polygon

_MODELS: Final = {
    Model.SPHERE: (2.0, 0.02),
    Model.OBB: (60.0, 0.05),
    Model.CONVEX_HULL: (1.0, 3e-3),
}
"""In all, and for each vertex, beyond the model EXACT."""


def is_quick(shapes: Sequence[tuple[Shape, Pose]]) -> bool:
    """Whether an object is one shape with dimensions. All of its models take less than SMALL_MS."""
    return len(shapes) == 1 and kind_of(shapes[0][0]).simple


class Budget:
    """Time (ms, estimated) that is left for the objects of one message."""

    def __init__(self, left: float = MESSAGE_MS) -> None:
        self.left = left

    def fits(self, shapes: Sequence[tuple[Shape, Pose]], model: Model) -> bool:
        """Whether the model of an object of these shapes can be made at once. If so, its time is taken off.

        The time to find out is taken off in any case.
        """
        coarse = model not in (Model.AUTO, Model.EXACT)
        if coarse and any(isinstance(shape, HalfSpace) for shape, _ in shapes):
            return True  # it is refused at once, with the same text as in a replay
        cost = _PIECE * len(shapes) if coarse and len(shapes) > 1 else 0.0
        for shape, _ in shapes:
            cost += self._estimate(shape, model)
            if cost > max(self.left, SMALL_MS):
                return False
        concave = [shape for shape, _ in shapes if isinstance(shape, Mesh) and not is_convex_mesh(shape)]
        if coarse and len(concave) < len(shapes):
            cost += _TRIANGLE * sum(len(each.faces) for each in concave)
        if cost > max(self.left, SMALL_MS):
            return False
        if cost > SMALL_MS:
            self.left -= cost
        return True

    @contextmanager
    def exact(self) -> Iterator[None]:
        """Limit the exact arithmetic within the context to the time that is left. Raises TooCostlyError."""
        most = max(int(self.left / _EXACT), 0) + LEAST_EXACT
        with exact_limit(most) as left:
            try:
                yield
            finally:
                used = (most - left[0]) * _EXACT
                if used > SMALL_MS:
                    self.left -= used

    def _estimate(self, shape: Shape, model: Model) -> float:
        """Return the time for one shape of an object that has no others."""
        fixed, each = _MODELS.get(model, (0.0, 0.0))
        match shape:
            case ConvexHull():
                n = len(shape.points)
                return _of_hull(n) + (fixed if n > 8 else 0.1 * fixed) + each * n
            case TiledSolid() if model in (Model.AUTO, Model.EXACT):
                return 0.0  # its box would take as long, and 4,000,000 cells take 0.2 s once
            case Mesh():
                n, m = len(shape.vertices), len(shape.faces)
                looking = _HEIGHT * n * m
                if looking > max(0.3 * self.left, 0.1 * SMALL_MS):  # too large even for the question if it is convex
                    return inf
                if looking > 0.1 * SMALL_MS:
                    self.left -= looking
                if model in (Model.AUTO, Model.EXACT) and not is_convex_mesh(shape):
                    if shape.surface.certain:
                        return _TREE[0] + _TREE[1] * m
                    fixed, each = _MODELS[Model.CONVEX_HULL]  # see `monitored_model`
                own = _of_hull(n) + (fixed if n > 8 else 0.1 * fixed) + each * n
                if is_convex_mesh(shape):
                    return own
                if model is Model.CONVEX_DECOMPOSITION:
                    return inf
                return own + _CONCAVE[0] + _CONCAVE[1] * m
            case Points():
                return _POINT * len(shape.points) if model in (Model.AUTO, Model.EXACT) else inf
            case Polygon():
                n = len(shape.points)
                try:
                    return 1e-3 * n if is_convex(shape.points) else _POLYGON * n * n
                except ShapeError:
                    return 1e-3 * n  # it will be refused
        return _SIMPLE


def _of_hull(n: int) -> float:
    fixed, each, squared = _HULL
    return fixed + each * n + squared * n * n
