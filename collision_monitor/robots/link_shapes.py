"""Shapes of a link: the collision geometries of its URDF as shapes of the monitor."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, reason_of
from collision_monitor.robots.mesh_location import FileLocator
from collision_monitor.robots.urdf import Link
from collision_monitor.settings.xml_tree import Element
from collision_monitor.shapes.mesh_file import load_mesh
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Cylinder, Mesh, Shape, Sphere

MOST_GEOMETRIES: Final = 1024
"""Geometries of a link: as many as an object may have shapes."""

Meshes = dict[tuple[str, bytes], Mesh | str]
"""Meshes by address and scale, or why there is none: many links may have the same one."""


def link_shapes(link: Link, files: FileLocator, meshes: Meshes) -> tuple[list[tuple[Shape, Pose]], list[str]]:
    """Return the shapes of a link with their poses in its frame, and a text for each geometry that is left out.

    meshes: those of the robot so far.
    """
    shapes: list[tuple[Shape, Pose]] = []
    problems: list[str] = []
    if len(link.collisions) > MOST_GEOMETRIES:
        text = f"expected at most {MOST_GEOMETRIES} geometries of a link, got {len(link.collisions)}; use a mesh"
        return [], [f"{link.element.where}, link {link.name}: {text}"]
    for collision in link.collisions:
        try:
            shapes.append((_shape(collision.geometry, files, meshes), collision.pose))
        except Exception as error:  # see `reason_of`: what a library raises for a file is no error of the others
            place, text = f"{collision.geometry.where}, ", reason_of(error)
            problems.append(f"{place}link {link.name}: {text.removeprefix(place)}")
    return shapes, problems


def _shape(geometry: Element, files: FileLocator, meshes: Meshes) -> Shape:
    match geometry.tag:
        case "box":
            return Box(geometry.vector("size", 3))
        case "sphere":
            return Sphere(geometry.number("radius"))
        case "cylinder":
            return Cylinder(geometry.number("radius"), geometry.number("length"))
        case "capsule":
            return Capsule(geometry.number("radius"), geometry.number("length"))
        case "mesh":
            return _loaded(geometry, files, meshes)
    raise InputError(f"expected <box>, <sphere>, <cylinder>, <capsule> or <mesh>, got <{geometry.tag}>")


def _loaded(geometry: Element, files: FileLocator, meshes: Meshes) -> Mesh:
    """Return the mesh of an element, loaded once for each file and scale. Raises InputError."""
    address, scale = geometry.text("filename"), geometry.vector("scale", 3, np.ones(3))
    key = address, scale.tobytes()
    if key not in meshes:
        try:
            meshes[key] = _mesh(files.find(address), scale)
        except Exception as error:  # see `reason_of`
            meshes[key] = reason_of(error)
    found = meshes[key]
    if isinstance(found, str):
        raise InputError(found)
    return found


def _mesh(path: Path, scale: NDArray[np.float64]) -> Mesh:
    """Return the welded mesh of a file, in m. If the scale mirrors it, its faces are turned to point outwards again.

    The unit of a COLLADA file counts and its up axis does not, as in RViz.
    """
    if not scale.all():
        raise InputError(f"{path.name}: expected a scale without zeros, got {scale.tolist()}")
    factor = float(np.abs(scale).max())
    mesh = load_mesh(path, factor)
    used, faces = np.unique(mesh.surface.faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    return Mesh(mesh.vertices[used] * (scale / factor), faces if scale.prod() > 0.0 else faces[:, ::-1])
