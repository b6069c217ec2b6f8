"""`contact`: the contact of two shapes of any kind at two poses, with error bound and witness points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.inside import UNKNOWN
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL, POINT_A, POINT_B, as_contacts
from collision_monitor.narrow_phase.manifold import manifold_batch, outline
from collision_monitor.query.arguments import Compound
from collision_monitor.query.contact.convex_pairs import packed_contact
from collision_monitor.query.contact.mesh_pairs import mesh_contact
from collision_monitor.query.contact.nearest_or_deepest import (
    by_clouds,
    by_pieces,
    by_trees,
    locate_in_meshes,
    nearest_pieces,
    turn_inward,
)
from collision_monitor.query.contact.nearest_pieces import NearestPieces
from collision_monitor.query.contact.open_gap import distance_of_fillings
from collision_monitor.query.contact.parting import parting_translation
from collision_monitor.query.piece_table import exact_piece_table
from collision_monitor.query.posed import check_side_in_plane, posed
from collision_monitor.records import Model
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Mesh
from collision_monitor.tolerances import FEATURE_TIE

Array = NDArray[np.float64]

_COLUMNS: Final = {"normal": NORMAL, "point_a": POINT_A, "point_b": POINT_B}
_new, _set = object.__new__, object.__setattr__


def _missing(contact: object, name: str) -> AttributeError:
    return AttributeError(f"{type(contact).__name__!r} object has no attribute {name!r}", name=name, obj=contact)


def _patch(found: NearestPieces, origin: Array, witness: Array) -> Array:
    """Corners (k, 3) on A of the patch of all pieces that touch in one plane; a floor of triangles is one face.

    origin, witness: A's origin and witness point (m).
    """
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
    return np.asarray(patch + origin)


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
        from collision_monitor.query.contact.contact_text import contact_text

        points = self.point_a, self.point_b
        return contact_text(self.arguments, points, self.normal, self.signed_distance, self.error_bound)

    @property
    def overlaps(self) -> bool:
        """Whether they overlap or touch; uncertain if |signed_distance| <= error_bound."""
        return self.signed_distance <= 0.0

    @cached_property
    def points_a(self) -> Array:
        """Corners (k, 3) of the patch where a face or an edge of a polytope lies on that of the other, at most four.

        Otherwise `point_a` alone. Computed on first access.
        """
        found = None if self._find is None else self._find()
        if found is None or found.best[DISTANCE] > 0.0 >= self.signed_distance:  # one is in the other: no surfaces meet
            return self.point_a[None]
        return _patch(found, self.arguments[1].position, self.point_a)

    @cached_property
    def points_b(self) -> Array:
        """The same points on B: those on A plus the signed distance along the normal."""
        return self.point_b[None] if len(self.points_a) == 1 else self.points_a + self.signed_distance * self.normal


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
        by_kernel = mesh_contact if type(shape_a) is Mesh or type(shape_b) is Mesh else packed_contact
        quick = by_kernel(shape_a, pose_a, shape_b, pose_b)
        if quick is not None:
            return contact_of_row(quick, (shape_a, pose_a, shape_b, pose_b))
    return _contact(shape_a, pose_a, shape_b, pose_b, model)


def _contact(
    shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose, model: Model | str | ArrayLike
) -> Contact:
    """`contact` of any shapes and models."""
    a, b = posed(shape_a, pose_a, model, "A"), posed(shape_b, pose_b, model, "B")
    planes = {is_planar(shape) for shape, _ in (*a.shapes, *b.shapes)}
    if len(planes) > 1:
        kinds = sorted({type(shape).__name__ for shape, _ in (*a.shapes, *b.shapes)})
        raise UnsupportedError(
            "Circle and Polygon meet each other only; supported are pairs of Circle, Polygon, or of "
            "Sphere, Box, Capsule, Cylinder, Cone, Ellipsoid, ConvexHull, Mesh, Points, HalfSpace; "
            f"got {', '.join(kinds)}"
        )
    if planes == {True}:
        check_side_in_plane(a)
        check_side_in_plane(b)
    offset = b.pose.position - a.pose.position
    deepest = by_clouds(a, b, offset) or by_trees(a, b, offset) or by_pieces(a, b, offset)
    row = deepest.row
    least = np.inf
    if row[DISTANCE] > 0.0 and (a.is_uncertain or b.is_uncertain):
        places = locate_in_meshes(a, b, offset), locate_in_meshes(b, a, -offset)
        if Location.INSIDE in places:
            turn_inward(row)
        else:
            least = -np.inf if UNKNOWN in places else min(distance_of_fillings(a, b), distance_of_fillings(b, a))
    distance, bound = float(row[DISTANCE]), float(row[BOUND])
    normal = row[NORMAL : NORMAL + 3].copy()
    point = a.pose.position + row[POINT_A : POINT_A + 3]
    convex = not (a.is_concave or b.is_concave)
    unbounded = distance == -np.inf  # exact: no length is involved that could be wrong
    if distance <= 0.0 and not convex and not unbounded:
        bound += max(parting_translation(a, b, offset, normal) + distance, 0.0)
    if least < distance:
        # the solids that the surfaces may belong to are at least this far apart, or can be parted
        bound = max(bound, distance - (least if least > 0.0 else -parting_translation(a, b, offset, normal)))
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
        _find=None if unbounded else deepest.pieces,
    )
    vars(made)["_arguments"] = shape_a, pose_a, shape_b, pose_b
    return made


def contact_of_row(
    quick: tuple[float, float | None, Array], arguments: tuple[Compound, Pose, Compound, Pose]
) -> Contact:
    """Contact of a row. Its arrays are made when they are read, which takes as long as the kernel.

    So is a bound that is None, because it takes longer than the distance.
    """
    distance, bound, row = quick
    made = _new(Contact)
    known = {"signed_distance": distance, "_row": row, "_arguments": arguments}
    if bound is not None:
        known["error_bound"] = bound
    _set(made, "__dict__", known)
    return made


def _nearest(shape_a: Compound, pose_a: Pose, shape_b: Compound, pose_b: Pose) -> NearestPieces:
    """Search for the nearest pieces of exact shapes, relative to A's origin."""
    a, b = posed(shape_a, pose_a, Model.EXACT, "A"), posed(shape_b, pose_b, Model.EXACT, "B")
    offset = b.pose.position - a.pose.position
    return nearest_pieces(a, b, offset)
