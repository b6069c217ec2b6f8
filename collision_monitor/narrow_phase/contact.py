"""`contact`: two shapes at two poses, whatever they are, with everything that is known about their contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from collision_monitor.errors import PoseError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.geometry.pieces import is_planar, shape_pairs
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import is_closed, locate_in_polyhedron
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.reach import reach
from collision_monitor.geometry.shape_table import ShapeTable, ShapeTableBuilder
from collision_monitor.geometry.shapes import ConvexHull, HalfSpace, Mesh, Shape
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.narrow_phase.manifold import manifold_batch, outline
from collision_monitor.narrow_phase.models import Modelled, containing_model
from collision_monitor.records import Model
from collision_monitor.tolerances import FEATURE_TIE, UNIT_QUATERNION

Array = NDArray[np.float64]
Compound = Shape | Sequence[tuple[Shape, Pose]]

_DIRECTIONS: Final = [sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)]

FIRST_BATCH: Final = 64
"""Pairs of pieces that are looked at first; each further batch is twice as large."""


class _Patch(NamedTuple):
    """What the patch of a contact is found from: the pieces, about A's origin, and all pairs that were looked at."""

    table: ShapeTable
    position: Array
    rotation: Array
    looked_at: list[tuple[NDArray[np.int32], Array]]  # pairs (m, 2) of pieces and their contacts (m, 15)
    best: Array  # the contact (15,) of the nearest or deepest
    pair: NDArray[np.int32]

    def points(self, witness: Array) -> Array:
        """The corners (k, 3) on A, of all pairs that touch in the same plane: a floor of triangles is one face."""
        radius = self.table.radius[self.pair]
        tie = FEATURE_TIE * float(radius[np.isfinite(radius)].sum())
        patches = []
        for pairs, rows in self.looked_at:
            level = (rows[:, 0] <= self.best[0] + tie) & (rows[:, 1:4] @ self.best[1:4] >= 1.0 - FEATURE_TIE)
            count, points = manifold_batch(self.table, self.position, self.rotation, pairs[level], rows[level])
            patches += [points[i, : count[i]] + self.position[pairs[level][i, 0]] for i in range(len(count))]
        patch = patches[0] if len(patches) == 1 else outline(np.concatenate(patches), self.best[1:4], tie)
        if len(patch) == 1:
            return witness[None]
        # where A's origin is in the world
        return np.asarray(patch + (witness - self.best[4:7] - self.position[self.pair[0]]))


@dataclass(frozen=True, eq=False)
class Contact:
    """How two shapes stand to each other, in the world frame, lengths in m.

    signed_distance: negative where they overlap; -inf for two half-spaces that do not face each other, which no
    translation parts (the points are then one that both have). error_bound: the true value is within it. normal: unit,
    from A to B. point_a, point_b: the nearest points, or where they overlap the deepest ones; point_b - point_a is
    signed_distance * normal. model_a, model_b: what answered for the shapes.
    """

    signed_distance: float
    error_bound: float
    normal: Array
    point_a: Array
    point_b: Array
    model_a: Model
    model_b: Model
    _patch: _Patch | None = field(repr=False)  # None: the two points alone

    @property
    def overlaps(self) -> bool:
        """Whether they overlap or touch; where |signed_distance| <= error_bound, nobody can tell."""
        return self.signed_distance <= 0.0

    @cached_property
    def points_a(self) -> Array:
        """The corners (k, 3) of the patch where a face or an edge of polytopes lies on the other's, at most four.

        Else `point_a` alone. Found when first asked for.
        """
        return self.point_a[None] if self._patch is None else self._patch.points(self.point_a)

    @cached_property
    def points_b(self) -> Array:
        """The same points on B: a signed distance along the normal from those on A."""
        return self.point_b[None] if self._patch is None else self.points_a + self.signed_distance * self.normal


class _Side(NamedTuple):
    """One of the two, in world axes about its own origin."""

    shapes: Sequence[tuple[Shape, Pose]]
    modelled: Modelled
    pose: Pose
    rotation: Array  # (n, 3, 3) of the pieces
    position: Array  # (n, 3) of the pieces


def contact(shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose, model: Model | str = "exact") -> Contact:
    """Contact of two shapes, or compounds given as lists of (shape, pose), at two poses.

    model: what stands for both, "exact" or one that contains them ("sphere", "aabb", "obb", "kdop14", "convex_hull",
    …): coarser, and the error bound says by how much the answer may be off.
    Where one of them is concave and they overlap, the depth is that of the deepest pair of their convex pieces, and the
    bound reaches to a translation that certainly parts them.
    Raises ShapeError, PoseError; UnsupportedError for a plane shape with a solid one, or a model that is not offered.
    """
    a, b = _side(shape_a, pose_a, model, "A"), _side(shape_b, pose_b, model, "B")
    planes = {is_planar(shape) for shape, _ in (*a.shapes, *b.shapes)}
    if len(planes) > 1:
        raise UnsupportedError("Circle and Polygon meet each other only; got one of them with a shape of space")
    if planes == {True}:
        _check_in_plane(a)
        _check_in_plane(b)
    offset = b.pose.position - a.pose.position
    patch: _Patch | None
    row, patch = _deepest(a, b, offset)
    distance, bound = float(row[0]), float(row[10])
    enclosed = distance > 0.0 and (_holds(a, b, offset) or _holds(b, a, -offset))
    if enclosed:
        # no faces meet, but one is inside of the other, at least this deep
        distance, row[1:4] = -distance, -row[1:4]
        patch = None
    convex = len(a.position) == len(b.position) == 1
    unbounded = distance == -np.inf  # a fact about the two, with no length to be wrong about
    if distance <= 0.0 and not convex and not unbounded:
        bound += max(_parting(a, b, offset, row[1:4]) + distance, 0.0)
    excess = a.modelled.excess + b.modelled.excess
    if distance <= 0.0 and excess > 0.0 and not (a.modelled.convex and b.modelled.convex):
        bound -= distance  # the models may overlap deeply where the concave objects do not meet at all
    point = a.pose.position + row[4:7]
    return Contact(
        signed_distance=distance,
        error_bound=bound + excess,
        normal=row[1:4],
        point_a=point,
        point_b=point.copy() if unbounded else point + distance * row[1:4],
        model_a=a.modelled.model,
        model_b=b.modelled.model,
        _patch=None if unbounded else patch,
    )


def _side(shape: Compound, pose: Pose, model: Model | str, name: str) -> _Side:
    shapes = shape_pairs(shape, f"shape {name}")
    if not isinstance(pose, Pose):
        raise PoseError(f"pose {name}: expected a Pose, got {type(pose).__name__}")
    modelled = containing_model(shapes, model)
    R = pose.rotation
    return _Side(
        shapes=shapes,
        modelled=modelled,
        pose=pose,
        rotation=np.stack([R @ offset.rotation for _, offset in modelled.pieces]),
        position=np.stack([R @ offset.position for _, offset in modelled.pieces]),
    )


def _check_in_plane(side: _Side) -> None:
    if abs(side.pose.rotation[2, 2]) < 1.0 - UNIT_QUATERNION or side.pose.rotation[2, 2] < 0.0:
        raise PoseError(f"expected a turn about z for a shape of the plane, got the quaternion {side.pose.quaternion}")


def _deepest(a: _Side, b: _Side, offset: Array) -> tuple[Array, _Patch]:
    """The contact (15,) of the nearest or deepest pair of pieces, about A's origin (see answer.py), and its patch.

    Pairs are looked at in the order of their bounding spheres' distances, until no other can be nearer.
    """
    n, m = len(a.position), len(b.position)
    builder = ShapeTableBuilder(slots=n + m)
    for piece, _ in (*a.modelled.pieces, *b.modelled.pieces):
        builder.append(piece)
    radius = builder.table.radius[: n + m]
    position = np.concatenate([a.position, b.position + offset])
    rotation = np.concatenate([a.rotation, b.rotation])
    lower: Array = np.full((n, m), -np.inf)
    finite = np.isfinite(radius[:n])[:, None] & np.isfinite(radius[n:])
    if finite.any():
        apart = cdist(position[:n], position[n:]) - (radius[:n, None] + radius[n:])
        lower[finite] = apart[finite]
    lower = np.ravel(lower)
    order = np.argsort(lower, kind="stable")
    best: Any = None
    looked_at = []
    begin, size = 0, FIRST_BATCH
    while begin < len(order) and (best is None or lower[order[begin]] <= best[0]):
        some = order[begin : begin + size]
        pairs = np.stack([some // m, n + some % m], axis=1).astype(np.int32)
        rows = contact_batch(builder.table, position, rotation, pairs)
        looked_at.append((pairs, rows))
        k = int(rows[:, 0].argmin())
        if best is None or rows[k, 0] < best[0]:
            best, pair = rows[k].copy(), pairs[k]
        begin, size = begin + size, 2 * size
    patch = _Patch(builder.table, position, rotation, looked_at, best.copy(), pair)
    best[4:7] += position[pair[0]]
    return best, patch


def _holds(outer: _Side, inner: _Side, offset: Array) -> bool:
    """Whether a closed mesh of `outer` holds a piece of `inner`, which is `offset` away; no surfaces meet."""
    if outer.modelled.model is not Model.EXACT:
        return False
    for shape, pose in outer.shapes:
        if not isinstance(shape, Mesh) or not is_closed(shape.faces) or len(outer.position) == 1:
            continue
        R = outer.pose.rotation
        points = (offset + _surface(inner) - R @ pose.position) @ (R @ pose.rotation)
        if (locate_in_polyhedron(points, shape.vertices, shape.faces) >= Location.BOUNDARY).any():
            return True
    return False


def _surface(side: _Side) -> Array:
    """A point (n, 3) of each piece, about the object's origin, in world axes."""
    inner = [s.points.mean(axis=0) if isinstance(s, ConvexHull) else np.zeros(3) for s, _ in side.modelled.pieces]
    return np.asarray(side.position + np.einsum("nij,nj->ni", side.rotation, np.array(inner)))


def _parting(a: _Side, b: _Side, offset: Array, normal: Array) -> float:
    """Length (m) of the shortest of some translations that certainly part the two: along axes of either, and normal."""
    axes = [R @ direction for R in (a.pose.rotation, b.pose.rotation) for direction in _DIRECTIONS]
    planes = [
        sign * side.pose.rotation @ pose.rotation @ shape.normal
        for side, sign in ((a, 1.0), (b, -1.0))
        for shape, pose in side.modelled.pieces
        if isinstance(shape, HalfSpace)
    ]
    directions = np.array([normal, *axes, *planes])
    if is_planar(a.shapes[0][0]):
        directions = directions[directions[:, 2] == 0.0]
    ends = reach(a.modelled.pieces, directions @ a.pose.rotation) - directions @ offset
    return float((ends + reach(b.modelled.pieces, -directions @ b.pose.rotation)).min())
