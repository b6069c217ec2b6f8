"""Fillings of the holes in open meshes: boxes in which the missing part of a surface is assumed to lie.

A mesh that does not close is the surface of an unknown solid. Its missing part begins and ends at the open edges, so it
is assumed to lie in the convex hull of these edges, and here in a box around them. A distance from the solid is then at
least the smaller of the distances from the mesh and from the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.geometry.oriented_boxes import obb_minimum_volume
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Shape
from collision_monitor.shapes.shape import array_bytes
from collision_monitor.tolerances import ROUNDED_UP

LEAST_THICKNESS: Final = 1e-6
"""Least thickness of a box, as part of its length: a box without one has no faces that trees and hulls can use."""

REMEMBERED_FILLINGS: Final = 64 << 20
"""Bytes of meshes with boxes that are remembered. Less: the box around an irregular hole is computed again, 0.1 s."""

FILLING_BYTES: Final = 1000
"""Memory of a box and its pose."""


def fillings(shapes: Sequence[tuple[Shape, Pose]]) -> list[tuple[Shape, Pose]]:
    """Boxes around the holes of the open meshes of an object, with poses in its frame; closed meshes have none."""
    return [(box, pose @ at) for shape, pose in shapes if isinstance(shape, Mesh) for box, at in _filling(shape)]


def _memory(found: tuple[Any, ...], mesh: Mesh) -> int:
    return FILLING_BYTES * len(found) + array_bytes(mesh)


@bounded_cache(REMEMBERED_FILLINGS, _memory)
def _filling(mesh: Mesh) -> tuple[tuple[Box, Pose], ...]:
    if not len(mesh.surface.hole):
        return ()
    from scipy.spatial.transform import Rotation

    box = obb_minimum_volume(mesh.surface.hole)
    size = 2.0 * np.asarray(box.half_extents)
    size = np.maximum(size, LEAST_THICKNESS * size.max())
    pose = Pose(box.center, Rotation.from_matrix(box.rotation).as_quat())
    return ((Box(size + ROUNDED_UP * size.max()), pose),)


class FilledBox(NamedTuple):
    """The box around the hole of a mesh as a hull in the mesh's frame, and whether it contains the whole mesh."""

    hull: ConvexHull
    contains: bool


def filled_box(mesh: Mesh) -> FilledBox | None:
    """Box around the hole of a mesh, kept with the mesh as its tree is; None for a closed one."""
    known: FilledBox | None
    try:
        known = mesh.__dict__["filled_box"]
    except KeyError:
        known = mesh.__dict__["filled_box"] = _filled_box(mesh) if len(mesh.surface.hole) else None
    return known


def _filled_box(mesh: Mesh) -> FilledBox:
    ((box, pose),) = _filling(mesh)
    own = np.abs((mesh.vertices - pose.position) @ pose.rotation)
    hull = ConvexHull(box.corners @ pose.rotation.T + pose.position)
    return FilledBox(hull, bool((own <= 0.5 * np.asarray(box.size)).all()))
