"""Largest distance by which a model exceeds the object that it contains.

Around a concave object it is found by sampling: the distance from the object changes by at most half a cell's diagonal
within a cell. It changes as slowly between the cells of a block, so that most blocks are left out after one distance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.inside import locate_in_welded_surface
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.qhull import QhullResult
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Shape, Sphere, Triangle, kind_of
from collision_monitor.shapes.shape_table import ShapeTableBuilder, take

Array = NDArray[np.float64]
PosedShapes = list[tuple[Shape, Pose]]

BLOCK: Final = 4
"""Cells of a block along each axis."""

BLOCKS: Final = 6
"""Blocks along each axis. The stated excess is up to 2 / (BLOCK * BLOCKS) of the size too large.
The time grows at least with the square of BLOCKS."""

AT_ONCE: Final = 16
"""Blocks that are searched first. The next search takes twice as many, and so on."""

FARTHEST_FIRST: Final = 256
"""Cells that are first tested for the inside of a mesh, which takes longest. The next test takes 8 times as many."""


MANY_FACES: Final = 1000
"""Faces from which a concave mesh is one set of vertices here, not a list of triangles, which take 60 µs each. Its
model is then tested by the planes of its faces, which lets a few more cells count. Smaller: nothing is gained."""


PLANES_ROUND_OFF: Final = 1e-6
"""By this part of half a cell's diagonal, the planes of a hull may be inside of its corners. Larger: a few cells more
count. Smaller: that is not certain, because Qhull merges faces that are nearly coplanar."""


def excess_of_large(mesh: Mesh, at: Pose, vertices: Array, model: Shape, pose: Pose, hull: QhullResult | None) -> float:
    """`excess_of` a concave mesh at a pose, with its vertices (n, 3) in the object's frame.

    hull: that of the model, if this is a convex hull with many corners; a cell counts if no plane of it keeps it out.
    """
    near_model = None if hull is None else lambda points, most: ~hull.beyond(points, most * (1.0 + PLANES_ROUND_OFF))
    certain = [] if len(mesh.surface.hole) else [(mesh, at)]  # a surface with a hole has no certain inside
    return _excess_around_concave(certain, _DistanceTo.vertices(vertices), model, pose, near_model)


def excess_of(shapes: Sequence[tuple[Shape, Pose]], pieces: PosedShapes, model: Shape, pose: Pose) -> float:
    """Largest distance (m) by which the model exceeds the object, rounded up. pieces: the object's convex pieces."""
    if len(pieces) == 1 and model is pieces[0][0]:
        return 0.0
    if len(pieces) > 1:
        return _excess_around_concave(shapes, _DistanceTo.pieces(pieces), model, pose)
    # the distance to a convex object is greatest at a corner of the model
    if isinstance(model, Sphere):
        return max(float(_distances(pose.position[None], pieces)[0]) + model.radius, 0.0)
    return max(float(_distances(enclosing_points([(model, pose)]), pieces).max()), 0.0)


def enclosing_points(pieces: PosedShapes) -> Array:
    """Points with a hull that contains the pieces: vertices of polytopes, corners of boxes around round shapes."""
    found = []
    for shape, pose in pieces:
        corners = kind_of(shape).corners
        if corners is not None:
            points = corners(shape)
        else:
            low, high = -reach([(shape, Pose())], -np.eye(3)), reach([(shape, Pose())], np.eye(3))
            points = np.array(list(product(*zip(low, high, strict=True))))
        found.append(points @ pose.rotation.T + pose.position)
    return np.concatenate(found)


def _excess_around_concave(
    shapes: Sequence[tuple[Shape, Pose]],
    distance: _DistanceTo,
    model: Shape,
    pose: Pose,
    near_model: Callable[[Array, float], NDArray[np.bool_]] | None = None,
) -> float:
    """Excess at the farthest cell of a grid around the model that is in the model and not inside of the object.

    shapes: those that may have an inside. near_model: whether points may be within a distance (m) of the model.
    """
    low, high = -reach([(model, pose)], -np.eye(3)), reach([(model, pose)], np.eye(3))
    cell = (high - low) / (BLOCK * BLOCKS)
    diagonal = float(np.linalg.norm(cell))
    slack = diagonal / 2
    # a point in a hull takes longer than its nearest vertex, and than a point in a mesh, so it is asked last
    is_asked_last = distance.is_to_vertices and isinstance(model, ConvexHull)

    def in_model(points: Array) -> NDArray[np.bool_]:
        if isinstance(model, Box) or not len(points):
            return np.full(len(points), True)
        if near_model is not None:
            return near_model(points, slack)
        return _distances(points, [(model, pose)]) <= slack

    def counts(points: Array) -> NDArray[np.bool_]:
        found = ~_inside_of_meshes(points, shapes)
        if is_asked_last:
            found[found] = in_model(points[found])
        return found

    block = _grid(BLOCKS)
    bound = distance((block + 0.5) * (BLOCK * cell) + low) + diagonal * (BLOCK - 1) / 2
    order = np.argsort(-bound)
    farthest = -slack  # the model nowhere exceeds a cell that is deeper in the object
    begin = 0
    while begin < len(order) and bound[order[begin]] > farthest:
        some = order[begin : 2 * begin + AT_ONCE]
        begin += len(some)
        some = some[bound[some] > farthest]
        index = (block[some, None] * BLOCK + _grid(BLOCK)).reshape(-1, 3)
        centres = (index + 0.5) * cell + low
        if not is_asked_last:
            centres = centres[in_model(centres)]
        farthest = max(farthest, _farthest(centres, distance(centres), farthest, counts))
    return slack + (farthest if farthest > -slack else 0.0)


def _grid(count: int) -> NDArray[np.intp]:
    """Indices (count^3, 3) of the cells of a cube."""
    return np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), -1).reshape(-1, 3)


def _farthest(points: Array, distance: Array, beyond: float, counts: Callable[[Array], NDArray[np.bool_]]) -> float:
    """Largest distance (n,) of a point (n, 3) that is above `beyond` (m) and counts; -inf if none is."""
    order = np.argsort(-distance)
    order = order[distance[order] > beyond]
    begin = 0
    while begin < len(order):
        some = order[begin : 8 * begin + FARTHEST_FIRST]
        found = counts(points[some])
        if found.any():
            return float(distance[some[np.argmax(found)]])
        begin += len(some)
    return -np.inf


def _inside_of_meshes(points: Array, shapes: Sequence[tuple[Shape, Pose]]) -> NDArray[np.bool_]:
    """Whether each of the points (n, 3) is certainly inside of a mesh, or on it."""
    inside = np.zeros(len(points), bool)
    for shape, offset in shapes:
        if isinstance(shape, Mesh):
            own = (points - offset.position) @ offset.rotation
            location = locate_in_welded_surface(own, shape.surface)
            inside |= (location == Location.INSIDE) | (location == Location.BOUNDARY)
    return inside


class _DistanceTo:
    """Distance (n,) in m of points (n, 3) from the nearest piece, rounded up."""

    def __init__(self, pieces: PosedShapes, vertices: Array | None) -> None:
        self._pieces = pieces
        self._tree = None
        if vertices is not None:
            from scipy.spatial import cKDTree

            # the distance to the nearest vertex bounds that to the nearest face and is much faster to compute
            self._tree = cKDTree(vertices)

    @classmethod
    def pieces(cls, pieces: PosedShapes) -> _DistanceTo:
        """Distance from pieces; from their vertices if all are triangles."""
        return cls(
            pieces, enclosing_points(pieces) if all(isinstance(shape, Triangle) for shape, _ in pieces) else None
        )

    @classmethod
    def vertices(cls, vertices: Array) -> _DistanceTo:
        """Distance from the vertices (n, 3) of a mesh."""
        return cls([], vertices)

    @property
    def is_to_vertices(self) -> bool:
        """Whether the nearest vertex stands for the nearest piece."""
        return self._tree is not None

    def __call__(self, points: Array) -> Array:
        if self._tree is not None:
            return np.asarray(self._tree.query(points)[0])
        return _distances(points, self._pieces)


def _distances(points: Array, pieces: PosedShapes) -> Array:
    """Signed distances (n,) in m of points (n, 3) from the nearest piece, rounded up."""
    builder = ShapeTableBuilder(slots=1 + len(pieces))
    size = float(max(np.abs(reach(pieces, np.concatenate([np.eye(3), -np.eye(3)])))))
    probe = Sphere(max(1e-9 * size, 1e-300))
    builder.append(probe)
    for shape, _ in pieces:
        builder.append(shape)
    best = np.full(len(points), np.inf)
    count = len(points)
    pairs = np.stack([np.zeros(count), np.arange(1, count + 1)], axis=1).astype(np.int32)
    rotation = np.tile(np.eye(3), (1 + count, 1, 1))
    for k, (_, pose) in enumerate(pieces, start=1):
        # the piece is in slot 0, and the probe at each point around it
        table = take(builder.table, np.r_[k, np.zeros(count, int)])
        rotation[0] = pose.rotation
        rows = contact_batch(table, np.concatenate([np.zeros((1, 3)), points - pose.position]), rotation, pairs)
        best = np.minimum(best, rows[:, 0] + rows[:, 10] + probe.radius)
    return best
