"""`load_mesh`: a triangle mesh from a file, in metres."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.surface import first_equal
from collision_monitor.settings.regular_file import read_regular
from collision_monitor.shapes.mesh_formats.dae import read_dae
from collision_monitor.shapes.mesh_formats.glb import read_glb
from collision_monitor.shapes.mesh_formats.obj import read_obj
from collision_monitor.shapes.mesh_formats.ply import read_ply
from collision_monitor.shapes.mesh_formats.raw_mesh import RawMesh
from collision_monitor.shapes.mesh_formats.stl import read_stl
from collision_monitor.shapes.registry import Mesh
from collision_monitor.tolerances import LARGEST_INPUT

Array = NDArray[np.float64]

READERS: Final[dict[str, Callable[[bytes], RawMesh]]] = {
    "stl": read_stl,
    "obj": read_obj,
    "ply": read_ply,
    "dae": read_dae,
    "glb": read_glb,
}
"""By the suffix of the file."""

FORMATS: Final = tuple(READERS)

LARGEST_FILE: Final = 1 << 30
"""Bytes of the largest file, about 20 million faces. Larger: reading takes ten times that memory."""

LARGEST_MESH: Final = 1000.0
"""Size (m) above which the unit is doubtful: a part of 1 m in millimetres has the size 1000."""

WELD: Final = 1e-6
"""Distance, as part of the size, within which the vertices of a surface that does not close are welded. Files with
float32 coordinates differ by 1e-7. Larger: thin walls and small features close up. Smaller: cracks stay open."""


def load_mesh(path: str | os.PathLike[str], scale: float = 1.0) -> Mesh:
    """Load a mesh from an STL, OBJ, PLY, DAE or GLB file; all parts of a scene make one mesh in the scene's frame.

    scale: length in metres of 1 in the file, 0.001 for millimetres; a unit that the file states (DAE) applies besides.
    The axes are those of the file. Equal vertices are one point, and if the surface does not close, so are vertices
    within 1e-6 of its size. `print(mesh)` shows whether it is closed. A size above 1 km raises a warning.
    Raises ShapeError for a file that is missing, too large (1 GiB), of another format, or without valid faces.

    >>> load_mesh("part.stl", scale=0.001)
    Traceback (most recent call last):
        ...
    collision_monitor.errors.ShapeError: part.stl: expected a mesh file, got nothing there
    """
    try:
        file = Path(path)
    except TypeError:
        raise ShapeError(f"load_mesh: expected the path of a file, got {path!r:.100}") from None
    try:
        factor = float(scale)
    except (TypeError, ValueError):
        factor = 0.0
    if not 0.0 < factor <= LARGEST_INPUT:
        expected = f"a positive number of metres up to {LARGEST_INPUT:g}"
        raise ShapeError(f"load_mesh, scale: expected {expected}, got {scale!r}")
    vertices, faces, unit = _read(file)
    try:
        mesh = Mesh(vertices * (unit * factor), faces)
    except ShapeError as error:
        raise ShapeError(f"{file}: {error}") from None
    mesh = _weld_cracks(mesh)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    if size > LARGEST_MESH:
        text = f"{file}: the mesh is {size:g} m large; if the file is in millimetres, use scale={factor / 1000:g}"
        warnings.warn(text, stacklevel=2)
    return mesh


def _read(file: Path) -> RawMesh:
    """Return vertices and faces as in the file. Raises ShapeError."""
    kind = file.suffix.lower().lstrip(".")
    if kind not in READERS:
        raise ShapeError(f"{file}: expected a mesh file ({', '.join(FORMATS).upper()}), got the suffix {file.suffix!r}")
    data = read_regular(file, "a mesh file", most=LARGEST_FILE, refused=ShapeError)
    if not data:
        raise ShapeError(f"{file}: expected a mesh in {kind.upper()} format, got an empty file")
    try:
        with np.errstate(all="ignore"):  # numbers that are none: they are refused below
            mesh = READERS[kind](data)
    except ShapeError as error:
        raise ShapeError(f"{file}: expected a mesh in {kind.upper()} format: {error}") from None
    except Exception as error:  # a description of other types than those of its format, such as a text as an index
        reason = f"{type(error).__name__}: {error}"[:200]
        raise ShapeError(f"{file}: expected a mesh in {kind.upper()} format, got damage: {reason}") from None
    if not len(mesh.faces):
        raise ShapeError(f"{file}: expected at least one face, got none")
    return mesh


def _weld_cracks(mesh: Mesh) -> Mesh:
    """Weld the vertices of the open edges with the first other one within WELD, where that closes edges."""
    from scipy.spatial import cKDTree

    tolerance = WELD * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    corners = np.unique(mesh.surface.open_edges)
    if not (tolerance > 0.0 and len(corners)):
        return mesh
    # of the vertices in a cell with the tolerance as its diagonal one is enough, so that a cluster has few pairs
    cell = np.floor(mesh.vertices[corners] * (np.sqrt(3.0) / tolerance))
    first = first_equal(cell)
    kept = np.unique(first)
    place = np.arange(len(mesh.vertices))
    place[corners] = corners[first]
    stays = np.ones(len(place), bool)
    pairs = corners[kept[cKDTree(mesh.vertices[corners[kept]]).query_pairs(tolerance, output_type="ndarray")]]
    for low, high in pairs[np.lexsort(pairs.T)].tolist():
        if stays[low] and stays[high]:
            place[high], stays[high] = low, False
    welded = Mesh(mesh.vertices[place[place]], mesh.faces)
    return welded if len(welded.surface.open_edges) < len(mesh.surface.open_edges) else mesh
