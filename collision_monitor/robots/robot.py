"""A robot: its links as objects with shapes, their motions from the joints, and the pairs that are allowed to touch."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.robots.kinematic_tree import KinematicTree, kinematic_tree
from collision_monitor.robots.link_motions import link_motions
from collision_monitor.robots.link_shapes import Meshes, link_shapes
from collision_monitor.robots.mesh_location import FileLocator
from collision_monitor.robots.srdf import Pair, disabled_pairs
from collision_monitor.robots.touching_links import touching_links
from collision_monitor.robots.urdf import parse_urdf
from collision_monitor.settings.regular_file import read_regular
from collision_monitor.settings.xml_tree import LARGEST_TEXT
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape

Floats = NDArray[np.float64]

_SHOWN: Final = 5

QUICK_TEXT: Final = 300_000
"""Bytes of a URDF or SRDF that is read in less than 0.05 s. That of a humanoid with 100 links has 0.2 MB."""

QUICK_PARTS: Final = 400
"""Joints and geometries that take less than 0.05 s."""

QUICK_MESHES: Final = 200_000
"""Bytes of mesh files that are read in less than 0.05 s: 4,000 triangles of binary STL."""


@dataclass(frozen=True)
class Description:
    """The text of a URDF or SRDF. name: of its file or topic, for errors. folder: for relative paths in it."""

    text: str | bytes
    name: str
    folder: Path = Path()

    @classmethod
    def read(cls, path: Path) -> Description:
        """Read a file. Raises InputError."""
        return cls(read_regular(path, most=LARGEST_TEXT), str(path), path.parent)


@dataclass(frozen=True, eq=False)
class Robot:
    """Links with shapes, in the order of `rows`.

    rows (S,): rows of these links in the tree. shapes: of each link, with their poses in its frame. touching, disabled:
    pairs of links whose contact is expected, by construction and by the SRDF. known_joints: names of all joints, with
    the fixed and mimic ones. left_out: name of the link, or nothing, and a text for each part of the files that is left
    out.
    """

    tree: KinematicTree
    rows: NDArray[np.intp]
    shapes: tuple[tuple[tuple[Shape, Pose], ...], ...]
    touching: frozenset[Pair]
    disabled: frozenset[Pair]
    known_joints: frozenset[str]
    left_out: tuple[tuple[str, str], ...]

    @property
    def problems(self) -> list[str]:
        """The texts of `left_out`."""
        return [text for _, text in self.left_out]

    @property
    def links(self) -> list[str]:
        """Names of the links with shapes, (S)."""
        return [self.tree.links[row] for row in self.rows]

    def motions(self, joints: Floats, base: Floats) -> tuple[Floats, Floats]:
        """Return poses (L, 7) and twists (L, 6) of all links of the tree, in the frame of the base's pose.

        joints (J, 2): position and velocity of each joint of `tree.joints`. base (13,): position, quaternion, linear
        and angular velocity of the base link.
        """
        poses, twists = link_motions(self.tree.table, joints[None], base[None])
        return poses[0], twists[0]


def takes_long(
    urdf: Description, srdf: Description | None = None, packages: Mapping[str, Path] | None = None
) -> bool:
    """Return whether `make_robot` may take longer than 0.1 s for these texts, or for the meshes that they name.

    Raises InputError for a text that is no URDF.
    """
    if max(len(urdf.text), 0 if srdf is None else len(srdf.text)) > QUICK_TEXT:
        return True
    model = parse_urdf(urdf.text, urdf.name)
    geometries = [each.geometry for link in model.links.values() for each in link.collisions]
    if len(model.joints) + len(geometries) > QUICK_PARTS:
        return True
    files, size = FileLocator(urdf.folder, packages), 0
    for address in {each.attributes.get("filename", "") for each in geometries if each.tag == "mesh"}:
        with suppress(InputError, OSError):  # what is not there takes no time
            size += files.find(address).stat().st_size
    return size > QUICK_MESHES


def make_robot(urdf: Description, srdf: Description | None = None, packages: Mapping[str, Path] | None = None) -> Robot:
    """Return the robot of a URDF, and of an SRDF if there is one. packages: folders of ROS packages by name.

    A geometry that cannot be used is left out, and `problems` names it. Raises InputError if nothing is left, and for
    files that are no URDF or SRDF.
    """
    model = parse_urdf(urdf.text, urdf.name)
    tree = kinematic_tree(model)
    files = FileLocator(urdf.folder, packages)
    left_out: list[tuple[str, str]] = []
    meshes: Meshes = {}
    shapes: dict[str, tuple[tuple[Shape, Pose], ...]] = {}
    for name in tree.links:
        found, texts = link_shapes(model.links[name], files, meshes)
        left_out += [(name, text) for text in texts]
        if found:
            shapes[name] = tuple(found)
    if not shapes:
        reason = f": {left_out[0][1]}" if left_out else ", only <visual> or nothing"
        raise InputError(f"{urdf.name}: expected a link with a <collision> that can be used, got none{reason}")
    disabled: set[Pair] = set()
    if srdf is not None:
        disabled = disabled_pairs(srdf.text, srdf.name, tree.links)
        unknown = sorted({name for pair in disabled for name in pair} - set(model.links))
        if unknown:
            more = "" if len(unknown) <= _SHOWN else f" and {len(unknown) - _SHOWN} more"
            text = f"{srdf.name}: expected links of {urdf.name}, got {', '.join(unknown[:_SHOWN])}{more}"
            left_out.append(("", text))
    rows = np.array([row for row, name in enumerate(tree.links) if name in shapes])
    return Robot(
        tree,
        rows,
        tuple(shapes.values()),
        frozenset(touching_links(tree, shapes)),
        frozenset(pair for pair in disabled if pair[0] in shapes and pair[1] in shapes),
        frozenset(model.joints),
        tuple(left_out),
    )
