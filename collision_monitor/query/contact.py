"""`contact`: the contact of two shapes of any kind at two poses, with error bound and witness points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import PoseError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.geometry.compound import shape_pairs
from collision_monitor.geometry.inside import UNKNOWN, locate_in_surface
from collision_monitor.geometry.planar import is_planar
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.reach import reach
from collision_monitor.geometry.shapes import HalfSpace, Mesh, Shape
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, as_contacts
from collision_monitor.narrow_phase.manifold import manifold_batch, outline
from collision_monitor.objects.models import containing_model, parse_model
from collision_monitor.query.fillings import fillings
from collision_monitor.query.nearest_pieces import NearestPieces
from collision_monitor.query.piece_table import PieceTable, exact_piece_table, piece_table
from collision_monitor.records import Model
from collision_monitor.tolerances import FEATURE_TIE, UNIT_QUATERNION

Array = NDArray[np.float64]
Compound = Shape | Sequence[tuple[Shape, Pose]]

_DIRECTIONS: Final = [sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)]

def _patch(found: NearestPieces, witness: Array) -> Array:
    """Corners (k, 3) on A of the patch of all pieces that touch in one plane; a floor of triangles is one face."""
    radius = found.table.radius[found.pair]
    tie = FEATURE_TIE * float(radius[np.isfinite(radius)].sum())
    patches = []
    best = as_contacts(found.best)
    for pairs, rows in found.looked_at:
        contacts = as_contacts(rows)
        level = contacts["distance"] <= best["distance"] + tie
        level &= contacts["normal"] @ best["normal"] >= 1.0 - FEATURE_TIE
        count, points = manifold_batch(found.table, found.position, found.rotation, pairs[level], rows[level])
        patches += [points[i, : count[i]] + found.position[pairs[level][i, 0]] for i in range(len(count))]
    patch = patches[0] if len(patches) == 1 else outline(np.concatenate(patches), best["normal"], tie)
    if len(patch) == 1:
        return witness[None]
    # from A's origin to the world
    return np.asarray(patch + (witness - best["point_a"] - found.position[found.pair[0]]))


@dataclass(frozen=True, eq=False)
class Contact:
    """Contact of two shapes in the world frame, lengths in m.

    signed_distance: negative if they overlap; -inf for two half-spaces that do not face each other, which no
    translation parts (both points are then one point inside both). error_bound: largest error of signed_distance.
    normal: unit vector from A to B. point_a, point_b: the nearest points, or the deepest points of an overlap;
    point_b - point_a is signed_distance * normal. model_a, model_b: the models that represent the shapes.
    """

    signed_distance: float
    error_bound: float
    normal: Array
    point_a: Array
    point_b: Array
    model_a: Model
    model_b: Model
    _found: NearestPieces | None = field(repr=False)  # source of the patch; None: the two points alone

    @property
    def overlaps(self) -> bool:
        """Whether they overlap or touch; uncertain if |signed_distance| <= error_bound."""
        return self.signed_distance <= 0.0

    @cached_property
    def points_a(self) -> Array:
        """Corners (k, 3) of the patch where a face or an edge of a polytope lies on that of the other, at most four.

        Otherwise `point_a` alone. Computed on first access.
        """
        return self.point_a[None] if self._found is None else _patch(self._found, self.point_a)

    @cached_property
    def points_b(self) -> Array:
        """The same points on B: those on A plus the signed distance along the normal."""
        return self.point_b[None] if self._found is None else self.points_a + self.signed_distance * self.normal


class _Posed(NamedTuple):
    """One of the two objects at its pose, with the pieces that represent it."""

    shapes: Sequence[tuple[Shape, Pose]]
    pose: Pose
    rotation: Array  # (3, 3), that of the pose
    pieces: PieceTable
    outline: Sequence[tuple[Shape, Pose]]  # shapes that reach as far as the pieces
    model: Model
    excess: float
    fillings: Sequence[tuple[Shape, Pose]]  # boxes around the holes of its meshes


def contact(shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose, model: Model | str = "exact") -> Contact:
    """Contact of two shapes, or compounds given as lists of (shape, pose), at two poses.

    model: model of both, "exact" or one that contains them ("sphere", "aabb", "obb", "kdop14", "convex_hull", …), which
    is coarser; the error bound includes its error.
    If one of them is concave and they overlap, the depth is that of the deepest pair of their convex pieces, and the
    bound extends to a translation that certainly parts them. Where a mesh is not closed, the distance is that of its
    surface, and the bound includes the solids that the surface may belong to (see `fillings`).
    Raises ShapeError, PoseError; UnsupportedError for a plane shape with a solid one, or a model that is not available.
    """
    a, b = _posed(shape_a, pose_a, model, "A"), _posed(shape_b, pose_b, model, "B")
    planes = {is_planar(shape) for shape, _ in (*a.shapes, *b.shapes)}
    if len(planes) > 1:
        kinds = sorted({type(shape).__name__ for shape, _ in (*a.shapes, *b.shapes)})
        raise UnsupportedError(
            "Circle and Polygon meet each other only; supported are pairs of Circle, Polygon, or of "
            f"Sphere, Box, Capsule, Cylinder, Cone, Ellipsoid, ConvexHull, Mesh, HalfSpace; got {', '.join(kinds)}"
        )
    if planes == {True}:
        _check_in_plane(a)
        _check_in_plane(b)
    offset = b.pose.position - a.pose.position
    found = NearestPieces(a.pieces, (a.rotation, np.zeros(3)), b.pieces, (b.rotation, offset))
    row = found.best
    distance, bound = float(row[DISTANCE]), float(row[BOUND])
    normal = row[NORMAL : NORMAL + 3].copy()
    where = {_where(a, b, offset), _where(b, a, -offset)} if distance > 0.0 else set()
    enclosed = Location.INSIDE in where
    if enclosed:
        # no surfaces meet, but one object is inside the other, at least this deep
        distance, normal = -distance, -normal
    point = a.pose.position + (row[POINT_A : POINT_A + 3] + found.position[found.pair[0]])
    convex = len(a.pieces) == len(b.pieces) == 1
    unbounded = distance == -np.inf  # exact: no length is involved that could be wrong
    if distance <= 0.0 and not convex and not unbounded:
        bound += max(_parting_translation(a, b, offset, normal) + distance, 0.0)
    if distance > 0.0 and (UNKNOWN in where or a.fillings or b.fillings):
        least = _least_distance(a, b, offset)
        if UNKNOWN in where or least <= 0.0:
            least = -_parting_translation(a, b, offset, normal)
        bound = max(bound, distance - least)
    excess = a.excess + b.excess
    if distance <= 0.0 and excess > 0.0 and not all(len(exact_piece_table(side.shapes)) == 1 for side in (a, b)):
        bound -= distance  # the models may overlap deeply although the concave objects are apart
    return Contact(
        signed_distance=distance,
        error_bound=bound + excess,
        normal=normal,
        point_a=point,
        point_b=point.copy() if unbounded else point + distance * normal,
        model_a=a.model,
        model_b=b.model,
        _found=None if enclosed or unbounded else found,
    )


def _posed(shape: Compound, pose: Pose, model: Model | str, name: str) -> _Posed:
    shapes = shape_pairs(shape, f"shape {name}")
    if not isinstance(pose, Pose):
        raise PoseError(f"pose {name}: expected a Pose, got {type(pose).__name__}")
    if parse_model(model) in (Model.AUTO, Model.EXACT):
        exact = exact_piece_table(shapes)
        return _Posed(shapes, pose, pose.rotation, exact, shapes, Model.EXACT, 0.0, fillings(shapes))
    modelled = containing_model(shapes, model)
    pieces = piece_table(modelled.pieces)
    return _Posed(shapes, pose, pose.rotation, pieces, modelled.pieces, modelled.model, modelled.excess, ())


def _check_in_plane(side: _Posed) -> None:
    if abs(side.pose.rotation[2, 2]) < 1.0 - UNIT_QUATERNION or side.pose.rotation[2, 2] < 0.0:
        raise PoseError(f"expected a turn about z for a shape of the plane, got the quaternion {side.pose.quaternion}")


def _where(inner: _Posed, outer: _Posed, offset: Array) -> int:
    """Location of `inner` in the meshes of `outer`, at `offset` (m) from it; no surfaces meet."""
    found: int = Location.OUTSIDE
    if outer.model is not Model.EXACT or len(outer.pieces) == 1:
        return found
    points = inner.pieces.inner @ inner.rotation.T - offset
    for shape, pose in outer.shapes:
        if not isinstance(shape, Mesh):
            continue
        own = (points - outer.rotation @ pose.position) @ (outer.rotation @ pose.rotation)
        own = own[((own >= shape.vertices.min(axis=0)) & (own <= shape.vertices.max(axis=0))).all(axis=1)]
        if len(own):
            location = locate_in_surface(own, shape.surface)
            if ((location == Location.INSIDE) | (location == Location.BOUNDARY)).any():
                return Location.INSIDE
            if (location == UNKNOWN).any():
                found = UNKNOWN
    return found


def _least_distance(a: _Posed, b: _Posed, offset: Array) -> float:
    """Lower bound (m) of the distances of each object from the fillings of the other; infinite without fillings."""
    X_A, X_B = (a.rotation, np.zeros(3)), (b.rotation, offset)
    solid_a, solid_b = (piece_table(side.fillings) if side.fillings else None for side in (a, b))
    least = np.inf
    for own, other in ((solid_a, b.pieces), (a.pieces, solid_b), (solid_a, solid_b)):
        if own is not None and other is not None:
            best = NearestPieces(own, X_A, other, X_B).best
            least = min(least, float(best[DISTANCE] - best[BOUND]))
    return least


def _parting_translation(a: _Posed, b: _Posed, offset: Array, normal: Array) -> float:
    """Length (m) of the shortest translation that certainly parts the two, along the normal or an axis of either."""
    axes = [side.rotation @ direction for side in (a, b) for direction in _DIRECTIONS]
    planes = [
        sign * side.rotation @ pose.rotation @ shape.normal
        for side, sign in ((a, 1.0), (b, -1.0))
        for shape, pose in side.outline
        if isinstance(shape, HalfSpace)
    ]
    directions = np.array([normal, *axes, *planes])
    if is_planar(a.shapes[0][0]):
        directions = directions[directions[:, 2] == 0.0]
    ends = reach(a.outline, directions @ a.rotation) - directions @ offset
    return float((ends + reach(b.outline, -directions @ b.rotation)).min())
