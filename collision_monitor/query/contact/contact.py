"""`contact`: the contact of two shapes of any kind at two poses, with error bound and witness points."""

from __future__ import annotations

from functools import cached_property
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import UnsupportedError
from collision_monitor.impact.mesh_pair import SOLIDS
from collision_monitor.meshes.trees.shape_trees import CERTAIN, UNCERTAIN
from collision_monitor.narrow_phase.contact_row import DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.query.body import KeptSlots, QueryBody, check_in_plane, kept_slots, plant, query_body
from collision_monitor.query.contact.contact_kernel import contact_row
from collision_monitor.query.contact.contact_text import contact_text
from collision_monitor.query.contact.open_gap import INSIDE, UNKNOWN, least_gap, location_of
from collision_monitor.query.contact.parting import parting_translation
from collision_monitor.query.contact.patch import patch_of
from collision_monitor.records import Model
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Frozen, Pose, as_pose
from collision_monitor.shapes.registry import KINDS, kind_of

Array = NDArray[np.float64]
Arguments = tuple[Compound, Pose, Compound, Pose]

_COLUMNS: Final = {"normal": NORMAL, "point_a": POINT_A, "point_b": POINT_B}
_FIELDS: Final = ("signed_distance", "error_bound", "normal", "point_a", "point_b", "model_a", "model_b")


class Contact(Frozen):
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
    arguments: Arguments
    """The two shapes with their poses, as they were given to `contact`."""

    def __init__(self, distance: float, bound: float | None, row: Array, arguments: Arguments) -> None:
        """Not for users. bound: None if it takes so long that it is computed when it is read."""
        known = self.__dict__
        known["signed_distance"], known["_row"], known["arguments"] = distance, row, arguments
        if bound is not None:
            known["error_bound"] = bound

    def __getattr__(self, name: str) -> Any:
        """Make a field when it is first read; a query that reads the distance alone does not wait for the others."""
        known = self.__dict__
        if name in _COLUMNS:
            value: Any = known["_row"][_COLUMNS[name] : _COLUMNS[name] + 3]
        elif name in ("model_a", "model_b"):
            value = Model.EXACT
        elif name == "error_bound":
            value = _completed(self.arguments, "exact").error_bound
        else:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        known[name] = value
        return value

    def __repr__(self) -> str:
        """Return the distance with its error and the features that are nearest, for a person."""
        points = self.point_a, self.point_b
        return contact_text(self.arguments, points, self.normal, self.signed_distance, self.error_bound)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold all fields."""
        return _restored, (self.arguments, {name: getattr(self, name) for name in _FIELDS}, self.__dict__["_row"])

    @property
    def overlaps(self) -> bool:
        """Whether they overlap or touch; uncertain if |signed_distance| <= error_bound."""
        return self.signed_distance <= 0.0

    @cached_property
    def points_a(self) -> Array:
        """Corners (k, 3) of the patch where a face or an edge of a polytope lies on that of the other, at most four.

        Otherwise `point_a` alone. Computed on first access.
        """
        shape_a, pose_a, shape_b, pose_b = self.arguments
        if self.signed_distance == -inf:
            return self.point_a[None]
        known = self.__dict__.get("_bodies")
        a, b = known or (query_body(shape_a, Model.EXACT, "shape A"), query_body(shape_b, Model.EXACT, "shape B"))
        found = patch_of(a, pose_a, b, pose_b, self.__dict__["_row"])
        return self.point_a[None] if found is None else found

    @cached_property
    def points_b(self) -> Array:
        """The same points on B: those on A plus the signed distance along the normal."""
        return self.point_b[None] if len(self.points_a) == 1 else self.points_a + self.signed_distance * self.normal


def _restored(arguments: Arguments, fields: dict[str, Any], row: Array) -> Contact:
    made = Contact(fields["signed_distance"], fields["error_bound"], row, arguments)
    made.__dict__.update(fields)
    return made


def contact(
    shape_a: Compound, pose_a: Any, shape_b: Compound, pose_b: Any, model: Model | str | ArrayLike = "exact"
) -> Contact:
    """Contact of two shapes, or compounds given as lists of (shape, pose), at two poses.

    A pose is a Pose, a position (x, y, z), 7 numbers x y z qx qy qz qw, or a matrix (4, 4).
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
    pose_a = pose_a if type(pose_a) is Pose else as_pose(pose_a, "pose A")
    pose_b = pose_b if type(pose_b) is Pose else as_pose(pose_b, "pose B")
    known = None
    if model == "exact" if isinstance(model, str) else model is Model.EXACT:
        a, b = kept_slots(shape_a), kept_slots(shape_b)
        if a is not None and b is not None and a.inside != UNCERTAIN and b.inside != UNCERTAIN:
            plant_for_meshes(a, shape_a, b, shape_b)
            known = distance, bound, row = contact_row(a.first, pose_a, b.first, pose_b, SOLIDS)
            if distance > 0.0 or (a.is_convex and b.is_convex):
                is_certain = a.inside == b.inside == CERTAIN
                return Contact(distance, bound if is_certain else None, row, (shape_a, pose_a, shape_b, pose_b))
    return _completed((shape_a, pose_a, shape_b, pose_b), model, known)


def plant_for_meshes(a: KeptSlots, shape_a: Any, b: KeptSlots, shape_b: Any) -> None:
    """Give the pieces of a shape the trees that they need beside a mesh."""
    if a.has_mesh and not b.is_planted:
        plant(b, shape_b)
    if b.has_mesh and not a.is_planted:
        plant(a, shape_a)


def _completed(
    arguments: Arguments, model: Model | str | ArrayLike, known: tuple[float, float, Array] | None = None
) -> Contact:
    """`contact` of any shapes and models: the kernel's answer, with what concave and open ones add to its bound.

    known: the kernel's answer, if it is known already.
    """
    shape_a, pose_a, shape_b, pose_b = arguments
    a, b = query_body(shape_a, model, "shape A"), query_body(shape_b, model, "shape B")
    if known is None:
        check_kinds(a, pose_a, b, pose_b)
        plant_bodies(a, b)
        known = contact_row(a.slots.first, pose_a, b.slots.first, pose_b, SOLIDS)
    distance, bound, row = known
    if distance > 0.0 and not a.inside == b.inside == CERTAIN:
        places = location_of(a, pose_a, b, pose_b)
        if INSIDE in places:
            distance = -distance  # one solid is in the other: at least this deep, and no surfaces meet
            row[DISTANCE], row[NORMAL : NORMAL + 3] = distance, -row[NORMAL : NORMAL + 3]
        else:
            least = -inf if UNKNOWN in places else least_gap(a, pose_a, b, pose_b)
            # the solids that the surfaces may belong to are at least this far apart, or can be parted
            if least < distance:
                parted = least if least > 0.0 else -parting_translation(a, pose_a, b, pose_b, row[NORMAL : NORMAL + 3])
                bound = max(bound, distance - parted)
    unbounded = distance == -inf  # exact: no length is involved that could be wrong
    if distance <= 0.0 and (a.is_concave or b.is_concave) and not unbounded:
        bound += max(parting_translation(a, pose_a, b, pose_b, row[NORMAL : NORMAL + 3]) + distance, 0.0)
    excess = a.excess + b.excess
    if distance <= 0.0 and excess > 0.0 and (a.stands_for_concave or b.stands_for_concave):
        bound -= distance  # the models may overlap deeply although the concave objects are apart
    bound = max(bound, _certain_distance(a, pose_a, b, pose_b) - distance)
    found = Contact(distance, bound + excess, row, arguments)
    found.__dict__.update(model_a=a.model, model_b=b.model, _bodies=(a, b))
    return found


def _certain_distance(a: QueryBody, pose_a: Pose, b: QueryBody, pose_b: Pose) -> float:
    """Distance (m) of what is certainly there of two objects; -inf if that is all of them."""
    sure_a, sure_b = a.certain, b.certain
    if sure_a is a and sure_b is b:
        return -inf
    if sure_a is None or sure_b is None:
        return inf
    plant_bodies(sure_a, sure_b)
    return contact_row(sure_a.slots.first, pose_a, sure_b.slots.first, pose_b, SOLIDS)[0]


def plant_bodies(a: QueryBody, b: QueryBody) -> None:
    """Give the pieces of two objects the trees that they need beside a mesh."""
    if a.has_mesh or b.has_mesh:
        a.plant()
        b.plant()


def check_kinds(a: QueryBody, pose_a: Pose, b: QueryBody, pose_b: Pose) -> None:
    """Raise UnsupportedError for a plane shape with a solid one, PoseError for a plane shape that is tilted."""
    planes = {kind_of(shape).planar for side in (a, b) for shape, _ in side.shapes}
    if len(planes) > 1:
        kinds = sorted({type(shape).__name__ for side in (a, b) for shape, _ in side.shapes})
        plane, solid = ([kind.shape.__name__ for kind in KINDS if kind.planar is it] for it in (True, False))
        raise UnsupportedError(
            f"{' and '.join(plane)} meet each other only; supported are pairs of {', '.join(plane)}, or of "
            f"{', '.join(solid)}; got {', '.join(kinds)}"
        )
    if planes == {True}:
        check_in_plane(pose_a)
        check_in_plane(pose_b)
