"""`kdop`: the k-DOP of an object with directions of your own, as an ordinary shape."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from collision_monitor.objects.models import containing_kdop
from collision_monitor.shapes.compound import Compound, shape_pairs
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape


class Enclosure(NamedTuple):
    """pieces: shapes with their poses in the object's frame. excess: how far they exceed the object at most (m).

    >>> import collision_monitor as cm
    >>> round(cm.kdop(cm.Sphere(1.0), [(1, 0, 0), (0, 1, 0), (0, 0, 1)]).excess, 2)  # at the corners of a cube
    0.73
    """

    pieces: list[tuple[Shape, Pose]]
    excess: float


def kdop(shape: Compound, directions: ArrayLike) -> Enclosure:
    """Bounding slabs with normals `directions` (k/2, 3), of any length but zero, around a shape or a compound.

    The pieces are a convex polytope that every query and `Monitor.add` take, and that messages and sessions carry.
    Distances to the object are greater by 0 to `excess`. (Slide "Bounding Slabs") Raises ShapeError, InputError for
    directions in one plane, which leave a slab without an end, UnsupportedError for a plane shape and a HalfSpace.

    >>> import collision_monitor as cm
    >>> slabs = cm.kdop(cm.Cylinder(1.0, 2.0), [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0)])
    >>> round(slabs.excess, 2), len(slabs.pieces)
    (0.08, 1)
    """
    found = containing_kdop(shape_pairs(shape, "shape"), directions)
    return Enclosure(list(found.pieces), found.excess)
