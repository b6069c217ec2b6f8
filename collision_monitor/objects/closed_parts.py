"""The closed parts of a mesh and its sheets, each as a mesh of its own: only closed parts have an inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.shapes import Mesh


def separated(mesh: Mesh) -> tuple[Mesh, ...]:
    """The closed parts and the sheets of a mesh that has both, such as houses on a ground plane; else the mesh itself.

    The parity of the faces that a ray crosses tells what is inside of closed parts alone.
    """
    surface = mesh.surface
    if not surface.sheet or surface.certain:
        return (mesh,)
    is_open = surface.in_open_part
    return _part(mesh, surface.faces[~is_open]), _part(mesh, surface.faces[is_open])


def _part(mesh: Mesh, faces: NDArray[np.int64]) -> Mesh:
    """The mesh of some faces (m, 3), with their vertices only."""
    used, place = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], place.reshape(faces.shape))
