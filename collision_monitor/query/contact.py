"""`contact`: the contact of two shapes of any kind at two poses, with error bound and witness points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import PoseError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.geometry.compound import shape_pairs
from collision_monitor.geometry.convex_pieces import is_concave_mesh
from collision_monitor.geometry.inside import UNKNOWN, locate_in_surface
from collision_monitor.geometry.planar import is_planar
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.reach import reach
from collision_monitor.geometry.shapes import Capsule, HalfSpace, Mesh, Points, Shape, Sphere
from collision_monitor.meshes.contact import APART, ENCLOSED, OPEN, contact_of_trees, in_root_box, reach_of
from collision_monitor.meshes.extent import extents
from collision_monitor.meshes.nearest import MEMORY, answer_row
from collision_monitor.meshes.shape_trees import shape_tree, trees_of_pair
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    CONTACT_SIZE,
    DISTANCE,
    NORMAL,
    POINT_A,
    POINT_B,
    as_contacts,
)
from collision_monitor.narrow_phase.manifold import manifold_batch, outline
from collision_monitor.objects.models import containing_kdop, containing_model, exact_model, parse_model
from collision_monitor.query.arguments import checked_pose
from collision_monitor.query.cloud_pair import cloud_contact
from collision_monitor.query.convex_pairs import convex_contact
from collision_monitor.query.fillings import fillings
from collision_monitor.query.mesh_pairs import mesh_contact
from collision_monitor.query.nearest_pieces import NearestPieces
from collision_monitor.query.piece_table import PieceTable, exact_piece_table, piece_table
from collision_monitor.records import Model
from collision_monitor.tolerances import FEATURE_TIE, UNIT_QUATERNION

Array = NDArray[np.float64]
Compound = Shape | Sequence[tuple[Shape, Pose]]

_DIRECTIONS: Final = np.array(
    [sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)]
)

_COLUMNS: Final = {"normal": NORMAL, "point_a": POINT_A, "point_b": POINT_B}
_new, _set = object.__new__, object.__setattr__


def _missing(contact: object, name: str) -> AttributeError:
    return AttributeError(f"{type(contact).__name__!r} object has no attribute {name!r}", name=name, obj=contact)


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


@dataclass(frozen=True, eq=False, repr=False)
class Contact:
    """Contact of two shapes in the world frame, lengths in m.

    signed_distance: negative if they overlap; -inf for two half-spaces that do not face each other, which no
    translation parts (both points are then one point inside both). error_bound: largest error of signed_distance.
    normal: unit vector from A to B. point_a, point_b: the nearest points, or the deepest points of an overlap;
    point_b - point_a is signed_distance * normal. model_a, model_b: the models that represent the shapes.

    >>> import collision_monitor as cm
    >>> c = cm.contact(cm.Box((1, 1, 1)), cm.Pose(), cm.Sphere(0.5), cm.Pose((2, 0, 0)))
    >>> c.signed_distance, c.normal, c.point_a
    (1.0, array([ 1., -0., -0.]), array([0.5, 0. , 0. ]))
    """

    signed_distance: float
    error_bound: float
    normal: Array
    point_a: Array
    point_b: Array
    model_a: Model
    model_b: Model
    _find: Callable[[], NearestPieces] | None = field(repr=False)  # source of the patch; None: the two points alone

    def __getattr__(self, name: str) -> Any:
        """Make a field of a contact that was found quickly when it is first read."""
        known = vars(self)
        if "_row" not in known:
            raise _missing(self, name)
        if name == "error_bound":
            value: Any = _contact(*self.arguments, "exact").error_bound
        elif name in _COLUMNS:
            value = known["_row"][_COLUMNS[name] : _COLUMNS[name] + 3]
        elif name in ("model_a", "model_b"):
            value = Model.EXACT
        elif name == "_find":
            arguments = self.arguments
            value = lambda: _nearest(*arguments)  # noqa: E731
        else:
            raise _missing(self, name)
        known[name] = value
        return value

    @property
    def arguments(self) -> tuple[Compound, Pose, Compound, Pose]:
        """The two shapes with their poses, as they were given to `contact`."""
        found: tuple[Compound, Pose, Compound, Pose] = vars(self)["_arguments"]
        return found

    def __repr__(self) -> str:
        """Return the distance with its error and the features that are nearest, for a person."""
        from collision_monitor.query.contact_text import contact_text

        return contact_text(self)

    @property
    def overlaps(self) -> bool:
        """Whether they overlap or touch; uncertain if |signed_distance| <= error_bound."""
        return self.signed_distance <= 0.0

    @cached_property
    def points_a(self) -> Array:
        """Corners (k, 3) of the patch where a face or an edge of a polytope lies on that of the other, at most four.

        Otherwise `point_a` alone. Computed on first access.
        """
        return self.point_a[None] if self._find is None else _patch(self._find(), self.point_a)

    @cached_property
    def points_b(self) -> Array:
        """The same points on B: those on A plus the signed distance along the normal."""
        return self.point_b[None] if self._find is None else self.points_a + self.signed_distance * self.normal


@dataclass(frozen=True, eq=False)
class _Posed:
    """One of the two objects at its pose. outline: shapes that reach as far as its pieces."""

    shapes: Sequence[tuple[Shape, Pose]]
    pose: Pose
    outline: Sequence[tuple[Shape, Pose]]
    model: Model = Model.EXACT
    excess: float = 0.0

    @property
    def rotation(self) -> Array:
        """That of the pose, (3, 3)."""
        return self.pose.rotation

    @cached_property
    def pieces(self) -> PieceTable:
        """Convex pieces that represent it."""
        return exact_piece_table(self.shapes) if self.model is Model.EXACT else piece_table(self.outline)

    @cached_property
    def is_uncertain(self) -> bool:
        """Whether it has a mesh with an uncertain inside (`Surface.certain`)."""
        meshes = [shape for shape, _ in self.shapes if isinstance(shape, Mesh)] if self.model is Model.EXACT else []
        return not all(mesh.surface.certain for mesh in meshes)

    @cached_property
    def is_concave(self) -> bool:
        """Whether it has several pieces."""
        several = len(self.outline) > 1 or isinstance(self.outline[0][0], Points)
        return several or any(is_concave_mesh(shape) for shape, _ in self.outline) or len(self.pieces) > 1

    @property
    def inner(self) -> Array:
        """Points (n, 3) of its pieces, at least one of each connected part, in its frame (m)."""
        clouds = [
            shape.points @ pose.rotation.T + pose.position for shape, pose in self.shapes if isinstance(shape, Points)
        ]
        others = [pair for pair in self.shapes if not isinstance(pair[0], Points)]
        if not clouds:
            return self.pieces.inner
        return np.concatenate(clouds + ([exact_piece_table(others).inner] if others else []))


def contact(
    shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose, model: Model | str | ArrayLike = "exact"
) -> Contact:
    """Contact of two shapes, or compounds given as lists of (shape, pose), at two poses.

    model: model of both, "exact" or one that contains them ("sphere", "aabb", "obb", "kdop14", "convex_hull", …), which
    is coarser; the error bound includes its error. Directions (k/2, 3) in the frame of each object are a k-DOP of your
    own, reported as CONVEX_HULL.
    If one of them is concave and they overlap, the depth is that of the deepest pair of their convex pieces, and the
    bound extends to a translation that certainly parts them. Where a mesh is not closed, the distance is that of its
    surface, and the bound includes the solids that the surface may belong to (see `fillings`).
    Raises ShapeError, PoseError; UnsupportedError for a plane shape with a solid one, or a model that is not available.

    >>> import collision_monitor as cm
    >>> cm.contact(cm.Box((1, 1, 1)), cm.Pose(), cm.Sphere(0.5), cm.Pose((2, 0, 0)))
    Contact(1 m ± ..., box face 0 – sphere surface)
    """
    if (type(model) is str and model == "exact") or (isinstance(model, str | int) and model == Model.EXACT):
        by_kernel = mesh_contact if type(shape_a) is Mesh or type(shape_b) is Mesh else convex_contact
        quick = by_kernel(shape_a, pose_a, shape_b, pose_b)
        if quick is not None:
            return _of_row(quick, (shape_a, pose_a, shape_b, pose_b))
    return _contact(shape_a, pose_a, shape_b, pose_b, model)


def _contact(
    shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose, model: Model | str | ArrayLike
) -> Contact:
    """`contact` of any shapes and models."""
    a, b = _posed(shape_a, pose_a, model, "A"), _posed(shape_b, pose_b, model, "B")
    planes = {is_planar(shape) for shape, _ in (*a.shapes, *b.shapes)}
    if len(planes) > 1:
        kinds = sorted({type(shape).__name__ for shape, _ in (*a.shapes, *b.shapes)})
        raise UnsupportedError(
            "Circle and Polygon meet each other only; supported are pairs of Circle, Polygon, or of "
            "Sphere, Box, Capsule, Cylinder, Cone, Ellipsoid, ConvexHull, Mesh, Points, HalfSpace; "
            f"got {', '.join(kinds)}"
        )
    if planes == {True}:
        _check_in_plane(a)
        _check_in_plane(b)
    offset = b.pose.position - a.pose.position
    deepest = _by_clouds(a, b, offset) or _by_trees(a, b) or _by_pieces(a, b, offset)
    row, enclosed = deepest.row, deepest.enclosed
    least = np.inf
    if row[DISTANCE] > 0.0 and (a.is_uncertain or b.is_uncertain):
        where = _where(a, b, offset), _where(b, a, -offset)
        enclosed = Location.INSIDE in where
        if enclosed:
            _turn_inward(row)
        else:
            least = -np.inf if UNKNOWN in where else min(_distance_of_fillings(a, b), _distance_of_fillings(b, a))
    distance, bound = float(row[DISTANCE]), float(row[BOUND])
    normal = row[NORMAL : NORMAL + 3].copy()
    point = a.pose.position + row[POINT_A : POINT_A + 3]
    convex = not (a.is_concave or b.is_concave)
    unbounded = distance == -np.inf  # exact: no length is involved that could be wrong
    if distance <= 0.0 and not convex and not unbounded:
        bound += max(_parting_translation(a, b, offset, normal) + distance, 0.0)
    if least < distance:
        # the solids that the surfaces may belong to are at least this far apart, or can be parted
        bound = max(bound, distance - (least if least > 0.0 else -_parting_translation(a, b, offset, normal)))
    excess = a.excess + b.excess
    if distance <= 0.0 and excess > 0.0 and not all(len(exact_piece_table(side.shapes)) == 1 for side in (a, b)):
        bound -= distance  # the models may overlap deeply although the concave objects are apart
    made = Contact(
        signed_distance=distance,
        error_bound=bound + excess,
        normal=normal,
        point_a=point,
        point_b=point.copy() if unbounded else point + distance * normal,
        model_a=a.model,
        model_b=b.model,
        _find=None if enclosed or unbounded else deepest.pieces,
    )
    vars(made)["_arguments"] = shape_a, pose_a, shape_b, pose_b
    return made


def _of_row(quick: tuple[float, float | None, Array], arguments: tuple[Compound, Pose, Compound, Pose]) -> Contact:
    """Contact of a row. Its arrays are made when they are read, which takes as long as the kernel.

    So is a bound that is None, because it takes longer than the distance.
    """
    distance, bound, row = quick
    made = _new(Contact)
    known = {"signed_distance": distance, "error_bound": bound, "_row": row, "_arguments": arguments}
    if bound is None:
        del known["error_bound"]
    _set(made, "__dict__", known)
    return made


def _nearest(shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose) -> NearestPieces:
    """Search for the nearest pieces of exact shapes, relative to A's origin."""
    a, b = _posed(shape_a, pose_a, Model.EXACT, "A"), _posed(shape_b, pose_b, Model.EXACT, "B")
    offset = b.pose.position - a.pose.position
    return _nearest_pieces(a, b, offset)


class _Deepest(NamedTuple):
    """The nearest or deepest contact of two objects, about A's origin in world axes.

    pieces: finds the pieces that touch in one plane; None: the contact is one point. enclosed: no surfaces meet, but
    one object is inside the other.
    """

    row: Array
    pieces: Callable[[], NearestPieces] | None
    enclosed: bool


def _nearest_pieces(a: _Posed, b: _Posed, offset: Array) -> NearestPieces:
    return NearestPieces(a.pieces, (a.rotation, np.zeros(3)), b.pieces, (b.rotation, offset))


def _by_pieces(a: _Posed, b: _Posed, offset: Array) -> _Deepest:
    found = _nearest_pieces(a, b, offset)
    row = found.best.copy()
    row[POINT_A : POINT_A + 3] += found.position[found.pair[0]]
    enclosed = bool(row[DISTANCE] > 0.0 and Location.INSIDE in (_where(a, b, offset), _where(b, a, -offset)))
    if enclosed:
        _turn_inward(row)
    return _Deepest(row, lambda: found, enclosed)


def _turn_inward(row: Array) -> None:
    """Make the contact of two surfaces that of a solid inside the other, which is at least this deep."""
    row[DISTANCE] *= -1.0
    row[NORMAL : NORMAL + 3] *= -1.0


def _by_clouds(a: _Posed, b: _Posed, offset: Array) -> _Deepest | None:
    """The contact of two objects, shape by shape, if either has a cloud; None for others."""
    if not any(isinstance(shape, Points) for shape, _ in (*a.outline, *b.outline)):
        return None
    best: _Deepest | None = None
    for pair_a in exact_model(a.outline).pieces:
        for pair_b in exact_model(b.outline).pieces:
            own, other = _Posed([pair_a], a.pose, [pair_a]), _Posed([pair_b], b.pose, [pair_b])
            if isinstance(pair_a[0], Points) or isinstance(pair_b[0], Points):
                X, (R, p) = _place(own), _place(other)
                row = cloud_contact(pair_a[0], X, pair_b[0], (R, p + offset))
                row[POINT_A : POINT_A + 3] += X[1]
            else:
                row = (_by_trees(own, other) or _by_pieces(own, other, offset)).row
            if best is None or row[DISTANCE] < best.row[DISTANCE]:
                best = _Deepest(row, None, False)
    return best


def _contact_of_trees(
    trees: tuple[Array, Array], X: tuple[Array, Array], Y: tuple[Array, Array]
) -> tuple[int, Array]:
    """Return what `contact_of_trees` knows of two trees with these rotations and positions, and the contact row.

    The rotations are copied because numba compiles a kernel once more for each combination of read-only arrays.
    """
    row, answer, work = np.empty(CONTACT_SIZE), answer_row(), np.empty(MEMORY)
    R_a, R_b = X[0].copy(), Y[0].copy()
    return contact_of_trees(trees[0], R_a, X[1], trees[1], R_b, Y[1], np.inf, row, answer, work), row


def _by_trees(a: _Posed, b: _Posed) -> _Deepest | None:
    """The contact of a concave mesh and another single shape through their trees; None for other pairs.

    The pieces also know how deep a triangle is inside a convex solid, so an overlap with one is left to them.
    """
    pair = a.outline[0][0], b.outline[0][0]
    if len(a.outline) > 1 or len(b.outline) > 1 or not any(is_concave_mesh(shape) for shape in pair):
        return None
    trees = shape_tree(pair[0]), shape_tree(pair[1])
    if trees[0] is None or trees[1] is None:
        return None
    (R_a, p_a), (R_b, p_b) = _place(a), _place(b)
    p_b = p_b + (b.pose.position - a.pose.position)
    known, row = _contact_of_trees((trees[0], trees[1]), (R_a, p_a), (R_b, p_b))
    if known != APART and not all(isinstance(shape, Mesh | Sphere | Capsule) for shape in pair):
        return None
    if known == OPEN:
        row[BOUND] += reach_of(trees[0]) + reach_of(trees[1]) + float(np.linalg.norm(p_b - p_a))
    row[POINT_A : POINT_A + 3] += p_a
    offset = b.pose.position - a.pose.position
    return _Deepest(row, lambda: _nearest_pieces(a, b, offset), known == ENCLOSED)


def _place(side: _Posed) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,), about the object's origin, of its only shape, in world axes."""
    own = side.outline[0][1]
    if own.quaternion[3] == 1.0 and not own.position.any():
        return side.rotation, np.zeros(3)
    return side.rotation @ own.rotation, side.rotation @ own.position


def _posed(shape: Compound, pose: Pose, model: Model | str | ArrayLike, name: str) -> _Posed:
    shapes = shape_pairs(shape, f"shape {name}")
    checked_pose(pose, f"pose {name}")
    if isinstance(model, str | int):
        if parse_model(model) in (Model.AUTO, Model.EXACT):
            return _Posed(shapes, pose, shapes)
        modelled = containing_model(shapes, model)
    else:
        modelled = containing_kdop(shapes, model)
    return _Posed(shapes, pose, modelled.pieces, modelled.model, modelled.excess)


def _check_in_plane(side: _Posed) -> None:
    if abs(side.pose.rotation[2, 2]) < 1.0 - UNIT_QUATERNION or side.pose.rotation[2, 2] < 0.0:
        raise PoseError(f"expected a turn about z for a shape of the plane, got the quaternion {side.pose.quaternion}")


def _where(inner: _Posed, outer: _Posed, offset: Array) -> int:
    """Location of `inner` in the meshes of `outer`, at `offset` (m) from it; no surfaces meet."""
    found: int = Location.OUTSIDE
    if outer.model is not Model.EXACT or not outer.is_concave:
        return found
    points = inner.inner @ inner.rotation.T - offset
    for shape, pose in outer.shapes:
        if not isinstance(shape, Mesh):
            continue
        own = (points - outer.rotation @ pose.position) @ (outer.rotation @ pose.rotation)
        tree = shape_tree(shape)
        own = own if tree is None else own[in_root_box(tree, own)]
        if len(own):
            location = locate_in_surface(own, shape.surface)
            if ((location == Location.INSIDE) | (location == Location.BOUNDARY)).any():
                return Location.INSIDE
            if (location == UNKNOWN).any():
                found = UNKNOWN
    return found


def _distance_of_fillings(a: _Posed, b: _Posed) -> float:
    """Lower bound (m) of the distances of A's fillings from B and from its fillings; infinite if A has none."""
    others = [*b.outline, *(fillings(b.shapes) if b.model is Model.EXACT else ())]
    return _least_gap(fillings(a.shapes) if a.model is Model.EXACT else (), a.pose, others, b.pose)


def may_be_inside(inner: Compound, pose: Pose, outer: Compound, outer_pose: Pose) -> bool:
    """Whether one of two objects whose surfaces are apart may be inside a mesh of the other one."""
    a, b = _posed(inner, pose, "exact", "A"), _posed(outer, outer_pose, "exact", "B")
    return _where(a, b, outer_pose.position - pose.position) != Location.OUTSIDE


def least_gap(
    shapes_a: Sequence[tuple[Shape, Pose]], pose_a: Pose, shapes_b: Sequence[tuple[Shape, Pose]], pose_b: Pose
) -> float:
    """Lower bound (m) of the distance of two objects with the fillings of open meshes, below 0 if these overlap.

    It is -inf if one may be inside the other.
    """
    if may_be_inside(shapes_a, pose_a, shapes_b, pose_b) or may_be_inside(shapes_b, pose_b, shapes_a, pose_a):
        return -np.inf
    return _least_gap([*shapes_a, *fillings(shapes_a)], pose_a, [*shapes_b, *fillings(shapes_b)], pose_b)


def _least_gap(
    shapes_a: Sequence[tuple[Shape, Pose]], pose_a: Pose, shapes_b: Sequence[tuple[Shape, Pose]], pose_b: Pose
) -> float:
    """The same of all surfaces and solids, each for itself; infinite without any."""
    offset = pose_b.position - pose_a.position
    least = np.inf
    for pair in product(shapes_a, shapes_b):
        a, b = (_Posed([own], pose, [own]) for own, pose in zip(pair, (pose_a, pose_b), strict=True))
        trees = trees_of_pair(pair[0][0], pair[1][0], surface=True)
        if trees is None:
            row = (_by_clouds(a, b, offset) or _by_trees(a, b) or _by_pieces(a, b, offset)).row
        else:
            place_a, (R_b, p_b) = _place(a), _place(b)
            known, row = _contact_of_trees(trees, place_a, (R_b, p_b + offset))
            if known == OPEN:
                return -np.inf
        least = min(least, float(row[DISTANCE] - row[BOUND]))
    return least


def _parting_translation(a: _Posed, b: _Posed, offset: Array, normal: Array) -> float:
    """Length (m) of the shortest translation that certainly parts the two, along the normal or an axis of either."""
    planes = [
        sign * side.rotation @ pose.rotation @ shape.normal
        for side, sign in ((a, 1.0), (b, -1.0))
        for shape, pose in side.outline
        if isinstance(shape, HalfSpace)
    ]
    axes = [_DIRECTIONS @ side.rotation.T for side in (a, b)]
    directions = np.concatenate([normal[None], *axes, np.reshape(planes, (-1, 3))])
    if is_planar(a.shapes[0][0]):
        directions = directions[directions[:, 2] == 0.0]
    ends = _reach(a, directions @ a.rotation) - directions @ offset
    return float((ends + _reach(b, -directions @ b.rotation)).min())


def _reach(side: _Posed, directions: Array) -> Array:
    """How far an object reaches in directions (n, 3) in its own frame (m)."""
    shape, pose = side.outline[0]
    tree = shape_tree(shape) if len(side.outline) == 1 and isinstance(shape, Mesh | Points) else None
    if tree is None:
        return reach(side.outline, directions)
    radius = shape.radius if isinstance(shape, Points) else 0.0
    return extents(tree, directions @ pose.rotation) + directions @ pose.position + radius
