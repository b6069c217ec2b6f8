"""The first impact of two shapes in one call of a kernel, and that of the solids which open meshes may belong to."""

from __future__ import annotations

from itertools import product
from math import dist, inf
from typing import Final

from collision_monitor.meshes.trees.shape_trees import NEVER, have_kernels, kept_tree
from collision_monitor.query.contact.convex_pairs import convex_impact, packed_contact
from collision_monitor.query.contact.fillings import filled_box, filled_mesh
from collision_monitor.query.contact.mesh_pairs import boxes_apart
from collision_monitor.query.contact.open_gap import may_be_inside
from collision_monitor.query.impact.mesh_pair_impact import first_mesh_impact, impact_in_hulls, mesh_impact_of_faces
from collision_monitor.query.impact.moving_pair import MotionQuery
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Motion, Pose
from collision_monitor.shapes.registry import Mesh, Shape
from collision_monitor.tolerances import GJK_TOUCHING

_HERE: Final = Pose()

ALL: Final = 1 << 53
"""More faces than a shape has."""


def single_kernel_impact(
    shape_a: Compound, motion_a: Motion, shape_b: Compound, motion_b: Motion, query: MotionQuery
) -> tuple[float, float] | None:
    """Lower and upper end (s) for two convex solids, or a mesh and a shape with a tree; None for others.

    Of an open mesh it is that of the surface.
    """
    if type(shape_a) is not Mesh and type(shape_b) is not Mesh:
        return convex_impact(shape_a, motion_a, shape_b, motion_b, query)
    if isinstance(shape_a, Shape) and isinstance(shape_b, Shape):
        return first_mesh_impact(shape_a, motion_a, shape_b, motion_b, query)
    return None


def quick_open_impact(
    shape_a: Compound, motion_a: Motion, shape_b: Compound, motion_b: Motion, query: MotionQuery
) -> tuple[float, float] | None:
    """`single_kernel_impact` with an open mesh: lower of the solids that it may belong to, upper of the surface.

    The surfaces are sought from the time on before which the boxes that contain them do not meet.
    """
    if not (isinstance(shape_a, Shape) and isinstance(shape_b, Shape)):
        return None
    if not (isinstance(motion_a, Motion) and isinstance(motion_b, Motion)):
        return None
    if not have_kernels(kept_tree(shape_a), kept_tree(shape_b), NEVER):
        return None
    whole_a, whole_b = _with_filling(shape_a), _with_filling(shape_b)
    possible = None
    if whole_a and whole_b:
        if not isinstance(whole_a, Mesh) and not isinstance(whole_b, Mesh):
            found = impact_in_hulls(whole_a, shape_a, motion_a, whole_b, shape_b, motion_b, query)
            if found is not None:
                return found
        elif boxes_apart(whole_a, motion_a.pose, whole_b, motion_b.pose):  # else one may be in the other
            own = _own_faces(shape_a, whole_a), _own_faces(shape_b, whole_b)
            filled = mesh_impact_of_faces(whole_a, motion_a, whole_b, motion_b, query, own)
            if filled is not None:
                if filled[2]:  # the surfaces meet first
                    return filled[:2]
                possible = filled[0], True
    if possible is None:
        possible = _possible_impact(shape_a, motion_a, shape_b, motion_b, query)
    if possible is None:
        return None
    first, holds_surfaces = possible
    if holds_surfaces and first == inf:
        return inf, inf
    found = first_mesh_impact(shape_a, motion_a, shape_b, motion_b, query, first if holds_surfaces else 0.0)
    return found and (min(first, found[0]), found[1])


def _possible_impact(
    shape_a: Shape, motion_a: Motion, shape_b: Shape, motion_b: Motion, query: MotionQuery
) -> tuple[float, bool] | None:
    """First time (s) at which the boxes that fill an open mesh (fillings.py) may meet the other shape, or its boxes.

    And whether the surfaces do not meet earlier either. None for a pair that kernels do not answer, and if it is not
    certain that the boxes are apart, or overlap, now.
    """
    boxes = [filled_box(shape) if isinstance(shape, Mesh) else None for shape in (shape_a, shape_b)]
    # the solid is in the hull of its surface, so that a box around the surface replaces it
    parts_a, parts_b = (
        [part for part in (box and box.hull, None if box and box.contains else shape) if part is not None]
        for box, shape in zip(boxes, (shape_a, shape_b), strict=True)
    )
    first = inf
    for a, b in product(parts_a, parts_b):
        if a is shape_a and b is shape_b:
            continue
        times = single_kernel_impact(a, motion_a, b, motion_b, query)
        if times is None:
            return (0.0, False) if _overlap(a, motion_a, b, motion_b, query) else None
        first = min(first, times[0])
    pose_a, pose_b = motion_a.pose, motion_b.pose
    own, other = [(shape_a, _HERE)], [(shape_b, _HERE)]
    if dist(pose_a.position, pose_b.position) <= kept_tree(shape_a).reach + kept_tree(shape_b).reach and (
        (shape_b in parts_b and may_be_inside(own, pose_a, other, pose_b))
        or (shape_a in parts_a and may_be_inside(other, pose_b, own, pose_a))
    ):
        return 0.0, False
    return first, shape_a not in parts_a or shape_b not in parts_b


def _with_filling(shape: Shape) -> Shape | None:
    """A shape as one with the box around its hole; None for a mesh that is too large."""
    if not isinstance(shape, Mesh) or (box := filled_box(shape)) is None:
        return shape
    return box.hull if box.contains else filled_mesh(shape)


def _own_faces(shape: Shape, whole: Shape) -> int:
    """Number of the first faces of a shape with its filling that are its own; all of a shape without a filling."""
    if whole is shape:
        return ALL
    return len(shape.faces) if isinstance(shape, Mesh) and isinstance(whole, Mesh) else 0


def _overlap(a: Shape, motion_a: Motion, b: Shape, motion_b: Motion, query: MotionQuery) -> bool:
    """Whether two convex solids certainly are within the separation now."""
    if isinstance(a, Mesh) or isinstance(b, Mesh):
        return False
    found = packed_contact(a, motion_a.pose, b, motion_b.pose)
    touching = GJK_TOUCHING * (kept_tree(a).reach + kept_tree(b).reach)
    return found is not None and found[0] + found[1] < query.separation - touching
