"""The closed parts of a mesh and its sheets, each as a mesh of its own: only closed parts have an inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.surface import first_equal
from collision_monitor.shapes.registry import Mesh


def separated(mesh: Mesh) -> tuple[Mesh, ...]:
    """The closed parts and the sheets of a mesh that has both, such as houses on a ground plane; else the mesh itself.

    The number of the faces that a ray crosses tells what is inside of closed parts alone. The part with more faces
    keeps the numbers of all, with the others as points on its surface; the other one numbers its own.
    """
    surface = mesh.surface
    if not surface.sheet or surface.certain:
        return (mesh,)
    faces = first_equal(mesh.vertices)[mesh.faces]
    is_open = surface.in_open_part
    return tuple(_part(mesh, faces, surface.faces[some]) for some in (~is_open, is_open))


def _part(mesh: Mesh, faces: NDArray[np.int64], chosen: NDArray[np.int64]) -> Mesh:
    """The part of a mesh that has the vertices of the chosen faces (k, 3); faces (m, 3): all, welded."""
    used = np.unique(chosen)
    place = np.full(len(mesh.vertices), -1)
    place[used] = np.arange(len(used))
    own = place[faces]
    is_own = (own >= 0).all(axis=1)
    kept = is_own if 2 * is_own.sum() < len(faces) else np.ones(len(faces), np.bool_)
    own[~is_own] = place[chosen[0, 0]]
    return Mesh(mesh.vertices[used], own[kept])
