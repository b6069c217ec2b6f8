"""A robot: its links as objects with shapes, their motions from the joints, and the pairs that are allowed to touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import as_numbers
from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Then, Trajectory
from collision_monitor.robots.constant_rates import constant_rates
from collision_monitor.robots.joint_motion import JointMotion
from collision_monitor.robots.joint_trajectory import joint_trajectory
from collision_monitor.robots.kinematic_tree import KinematicTree, kinematic_tree
from collision_monitor.robots.link_motions import link_motions
from collision_monitor.robots.link_pieces import Wanted
from collision_monitor.robots.link_plans import TUBE, checked_horizon, joint_values, planned_links, radius_of
from collision_monitor.robots.link_shapes import Meshes, link_shapes
from collision_monitor.robots.mesh_location import FileLocator
from collision_monitor.robots.srdf import Pair, disabled_pairs
from collision_monitor.robots.touching_links import touching_links
from collision_monitor.robots.urdf import Urdf, parse_urdf
from collision_monitor.robots.xacro_file import ENDING, expand_xacro
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
    def read(
        cls, path: Path, arguments: Mapping[str, str] | None = None, packages: Mapping[str, Path] | None = None
    ) -> Description:
        """Read a file; one that ends in .xacro as `expand_xacro` does. Raises InputError."""
        if path.suffix == ENDING:
            text = expand_xacro(path, arguments or {}, packages or {})
        elif arguments:
            raise InputError(f"{path}: expected a xacro file, which takes arguments, got another one")
        else:
            text = read_regular(path, most=LARGEST_TEXT)
        return cls(text, str(path), path.parent)


_Source = Description | str | PathLike[str]
"""A URDF or an SRDF: its text, or the path of its file."""


class Robot:
    """A robot of a URDF, and of an SRDF if there is one: links with shapes, and how its joints move them.

    urdf, srdf: paths of the files. packages: folders of ROS packages by name. arguments: of a URDF that is a xacro
    file, whose name ends in .xacro. A geometry that cannot be used is left
    out, and `problems` names it. Raises InputError if nothing is left, and for files that are no URDF or SRDF.

    tree: its joints. rows (S,): rows of the links with shapes in the tree. shapes: of each of these links, with their
    poses in its frame. touching, disabled: pairs of links whose contact is expected, by construction and by the SRDF.
    known_joints: names of all joints, with the fixed and mimic ones. left_out: name of the link, or nothing, and a text
    for each part of the files that is left out.
    """

    tree: KinematicTree
    rows: NDArray[np.intp]
    shapes: tuple[tuple[tuple[Shape, Pose], ...], ...]
    touching: frozenset[Pair]
    disabled: frozenset[Pair]
    known_joints: frozenset[str]
    left_out: tuple[tuple[str, str], ...]

    def __init__(
        self,
        urdf: _Source,
        srdf: _Source | None = None,
        packages: Mapping[str, Path] | None = None,
        arguments: Mapping[str, str] | None = None,
    ) -> None:
        description = _description(urdf, arguments, packages)
        model = parse_urdf(description.text, description.name)
        self.tree = kinematic_tree(model)
        files = FileLocator(description.folder, packages)
        left_out: list[tuple[str, str]] = []
        meshes: Meshes = {}
        shapes: dict[str, tuple[tuple[Shape, Pose], ...]] = {}
        for name in self.tree.links:
            found, texts = link_shapes(model.links[name], files, meshes)
            left_out += [(name, text) for text in texts]
            if found:
                shapes[name] = tuple(found)
        if not shapes:
            reason = f": {left_out[0][1]}" if left_out else ", only <visual> or nothing"
            raise InputError(
                f"{description.name}: expected a link with a <collision> that can be used, got none{reason}"
            )
        self.rows = np.array([row for row, name in enumerate(self.tree.links) if name in shapes])
        self.shapes = tuple(shapes.values())
        self.touching = frozenset(touching_links(self.tree, shapes))
        disabled, unknown = _disabled(srdf, self.tree.links, model, description.name)
        self.disabled = frozenset(pair for pair in disabled if pair[0] in shapes and pair[1] in shapes)
        self.known_joints = frozenset(model.joints)
        self.left_out = (*left_out, *unknown)

    def __repr__(self) -> str:
        """Return how much of it there is."""
        return f"{type(self).__name__}({len(self.rows)} links with shapes, {len(self.joints)} joints)"

    @property
    def problems(self) -> list[str]:
        """The texts of `left_out`."""
        return [text for _, text in self.left_out]

    @property
    def links(self) -> list[str]:
        """Names of the links with shapes, (S)."""
        return [self.tree.links[row] for row in self.rows]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move by themselves, (J): without fixed and mimic ones."""
        return self.tree.joints

    def states(self, joints: Floats, base: Floats) -> tuple[Floats, Floats]:
        """Return poses (L, 7) and twists (L, 6) of all links of the tree, in the frame of the base's pose.

        joints (J, 2): position and velocity of each joint of `tree.joints`. base (13,): position, quaternion, linear
        and angular velocity of the base link.
        """
        poses, twists = link_motions(self.tree.table, joints[None], base[None])
        return poses[0], twists[0]

    def motions(
        self,
        q: Any,
        qd: Any,
        horizon: float,
        *,
        base: Any = (0.0, 0.0, 0.0),
        tolerance: float = TUBE,
        then: Then = "unknown",
    ) -> dict[str, Trajectory]:
        """Return the motion of each link with shapes, by its name, while all joints keep their rates.

        q, qd: positions (rad or m) and rates (rad/s or m/s) of the joints, as numbers (J,) in the order of `joints`, or
        by their names. A joint that reaches its limit stops there. horizon (s): how far ahead. base: where the base
        link is, a pose, or how it moves, a Motion without an acceleration. tolerance (m): width of the tubes, within
        which all points of a link are for certain; a link that one joint moves needs none. then: what holds after the
        horizon; see Trajectory. Raises InputError and PoseError for anything else.

        >>> arm = Robot("examples/arm/arm.urdf")
        >>> moves = arm.motions([0, 0.2, 0, -2, 0, 2.2, 0.8, 0.03], [0.5, 0, 0, 0.3, 0, 0, 0, 0], horizon=2.0)
        >>> moves["hand"].at(1.0).position.round(3)
        array([0.57 , 0.311, 0.504])
        """
        motion = constant_rates(self.tree, joint_values(self.joints, q, qd), checked_horizon(horizon))
        return self._plans(motion, base, tolerance, then)

    def follow(
        self,
        times: Any,
        positions: Any,
        velocities: Any = None,
        accelerations: Any = None,
        *,
        joints: Sequence[str] | None = None,
        q: Any = None,
        qd: Any = None,
        base: Any = (0.0, 0.0, 0.0),
        tolerance: float = TUBE,
        then: Then = "rest",
    ) -> dict[str, Trajectory]:
        """Return the plan of each link with shapes, by its name, along a joint trajectory.

        times (N,): s from now on, rising. positions (N, K): rad or m of the joints named by `joints`, by default all,
        in the order of `joints`. velocities, accelerations (N, K): rad/s, rad/s^2 or m/s, m/s^2. Between two points the
        joints move on lines with positions alone, on cubic polynomials with velocities too, and on quintic ones with
        accelerations too, as with ros2_control's joint_trajectory_controller. q, qd: positions and rates of all joints
        now, as for `motions`: the trajectory begins there if its first point is in the future, and joints without a
        trajectory rest there. Without q all joints need a trajectory, and the links rest at its first point before it.
        base, tolerance: as for `motions`. then: what holds after the last point. Raises InputError and PoseError.

        >>> arm = Robot("examples/arm/arm.urdf")
        >>> plan = arm.follow([0, 2], [[0, 0.2, 0, -2, 0, 2.2, 0.8, 0.03], [1, 0.2, 0, -2, 0, 2.2, 0.8, 0.03]])
        >>> plan["hand"].at(1.0).position.round(3)
        array([0.518, 0.283, 0.36 ])
        """
        names = self.joints if joints is None else joints
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise InputError(f"joints: expected names of joints, got {names!r:.200}")
        start = self._start(names, positions, q, qd)
        motion = joint_trajectory(self.tree, names, times, (positions, velocities, accelerations), start, q is not None)
        return self._plans(motion, base, tolerance, then)

    def _start(self, names: Sequence[str], positions: Any, q: Any, qd: Any) -> Floats:
        """Positions and rates (J, 2) of the joints now; without q those of the first point."""
        if q is not None:
            return joint_values(self.joints, q, np.zeros(len(self.joints)) if qd is None else qd)
        if missing := [name for name in self.joints if name not in names]:
            raise InputError(f"q: expected the positions of all joints now, got no plan for {', '.join(missing)}")
        rows = as_numbers(positions, "positions", "numbers (N, K)")
        if rows.ndim != 2 or not len(rows) or rows.shape[1] != len(names):
            raise InputError(f"positions: expected shape (N, {len(names)}), got {rows.shape}")
        first = dict(zip(names, rows[0].tolist(), strict=True))
        return joint_values(self.joints, first, np.zeros(len(self.joints)))

    def _plans(self, motion: JointMotion, base: Any, tolerance: Any, then: Then) -> dict[str, Trajectory]:
        made = planned_links(self.tree, Wanted(self.rows, self.radii), motion, base, tolerance, then)
        return dict(zip(self.links, made, strict=True))

    @cached_property
    def radii(self) -> Floats:
        """Radii (S,) of spheres about the origins of the links that hold their shapes (m)."""
        return np.array([radius_of(shapes) for shapes in self.shapes])


def _description(
    given: _Source, arguments: Mapping[str, str] | None = None, packages: Mapping[str, Path] | None = None
) -> Description:  # fmt: skip
    return given if isinstance(given, Description) else Description.read(Path(given), arguments, packages)


def _disabled(
    srdf: _Source | None, links: Sequence[str], model: Urdf, name: str
) -> tuple[set[Pair], list[tuple[str, str]]]:  # fmt: skip
    """Return the pairs that an SRDF disables, and a text about links that the robot lacks."""
    if srdf is None:
        return set(), []
    description = _description(srdf)
    pairs = disabled_pairs(description.text, description.name, links)
    unknown = sorted({link for pair in pairs for link in pair} - set(model.links))
    if not unknown:
        return pairs, []
    more = "" if len(unknown) <= _SHOWN else f" and {len(unknown) - _SHOWN} more"
    return pairs, [("", f"{description.name}: expected links of {name}, got {', '.join(unknown[:_SHOWN])}{more}")]


def takes_long(urdf: Description, srdf: Description | None = None, packages: Mapping[str, Path] | None = None) -> bool:
    """Return whether `Robot` may take longer than 0.1 s for these texts, or for the meshes that they name.

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
