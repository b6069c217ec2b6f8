"""How far two objects are apart at least if open meshes may belong to solids, see `fillings`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.meshes.distance.contact import OPEN
from collision_monitor.meshes.trees.shape_trees import trees_of_pair
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE
from collision_monitor.query.contact.fillings import fillings
from collision_monitor.query.contact.nearest_or_deepest import (
    by_clouds,
    by_pieces,
    by_trees,
    contact_by_trees,
    locate_in_meshes,
)
from collision_monitor.query.posed import Posed, pose_in_world
from collision_monitor.records import Model
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape


def distance_of_fillings(a: Posed, b: Posed) -> float:
    """Lower bound (m) of the distances of A's fillings from B and from its fillings; infinite if A has none."""
    others = [*b.outline, *(fillings(b.shapes) if b.model is Model.EXACT else ())]
    return _least_gap(fillings(a.shapes) if a.model is Model.EXACT else (), a.pose, others, b.pose)


def may_be_inside(
    inner: Sequence[tuple[Shape, Pose]], pose: Pose, outer: Sequence[tuple[Shape, Pose]], outer_pose: Pose
) -> bool:
    """Whether an object may be inside a mesh of another one, although their surfaces are apart."""
    a, b = Posed(inner, pose, inner), Posed(outer, outer_pose, outer)
    return locate_in_meshes(a, b, outer_pose.position - pose.position) != Location.OUTSIDE


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
        a, b = (Posed([own], pose, [own]) for own, pose in zip(pair, (pose_a, pose_b), strict=True))
        trees = trees_of_pair(pair[0][0], pair[1][0], surface=True)
        if trees is None:
            row = (by_clouds(a, b, offset) or by_trees(a, b, offset) or by_pieces(a, b, offset)).row
        else:
            place_a, (R_b, p_b) = pose_in_world(a), pose_in_world(b)
            known, row = contact_by_trees(trees, place_a, (R_b, p_b + offset))
            if known == OPEN:
                return -np.inf
        least = min(least, float(row[DISTANCE] - row[BOUND]))
    return least
