"""Shapes of a link: the collision geometries of its URDF as shapes of the monitor."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from collision_monitor.robots.mesh_location import FileLocator
from collision_monitor.robots.urdf import Link
from collision_monitor.robots.xml_tree import Element

LARGEST_MESH: Final = 256 << 20
"""Bytes of a mesh file. Collision meshes have 10 kB to 10 MB."""

_UNIT: Final = re.compile(rb"""<unit\b[^>]*\bmeter\s*=\s*["']([^"']*)""")
"""Length of COLLADA's unit in m, which trimesh does not apply."""


def link_shapes(link: Link, files: FileLocator) -> tuple[list[tuple[Shape, Pose]], list[str]]:
    """Return the shapes of a link with their poses in its frame, and a text for each geometry that is left out."""
    shapes: list[tuple[Shape, Pose]] = []
    problems: list[str] = []
    for collision in link.collisions:
        try:
            shapes.append((_shape(collision.geometry, files), collision.pose))
        except CollisionMonitorError as error:
            place, text = f"{collision.geometry.where}, ", str(error)
            problems.append(f"{place}link {link.name}: {text.removeprefix(place)}")
    return shapes, problems


def _shape(geometry: Element, files: FileLocator) -> Shape:
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
            return _mesh(files.find(geometry.text("filename")), geometry.vector("scale", 3, np.ones(3)))
    raise InputError(f"expected <box>, <sphere>, <cylinder>, <capsule> or <mesh>, got <{geometry.tag}>")


def _mesh(path: Path, scale: NDArray[np.float64]) -> Mesh:
    """Return the mesh of a file, in m. If the scale mirrors it, its faces are turned to point outwards again."""
    if not scale.all():
        raise InputError(f"{path.name}: expected a scale without zeros, got {scale.tolist()}")
    vertices, faces = _read_mesh(path)
    return Mesh(vertices * scale, faces if scale.prod() > 0.0 else faces[:, ::-1])


def _read_mesh(path: Path) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Return vertices (n, 3) and faces (m, 3). COLLADA's unit counts and its up axis does not, as in RViz."""
    try:
        import trimesh
    except ImportError:
        raise InputError(f"{path.name}: reading meshes needs trimesh: pip install trimesh") from None
    if path.stat().st_size > LARGEST_MESH:
        raise InputError(f"{path}: expected a mesh of at most {LARGEST_MESH >> 20} MiB, got more")
    try:
        mesh = trimesh.load_mesh(path)
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
        if path.suffix.lower() == ".dae" and (unit := _UNIT.search(path.read_bytes())):
            vertices = vertices * float(unit[1])
    except Exception as error:  # trimesh and its readers raise many kinds of errors
        reason = str(error) or type(error).__name__
        raise InputError(f"{path}: expected a mesh, cannot be read: {reason:.200}") from None
    if not len(faces):
        raise InputError(f"{path}: expected a mesh with faces, got none")
    return vertices, faces
