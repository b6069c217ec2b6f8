"""URDF: the links of a robot with their collision shapes, and the joints between them.

Format: http://wiki.ros.org/urdf/XML. Inertia, visuals, transmissions and extensions are not read.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.settings.xml_tree import Element, parse_xml
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply

_READ: Final = (
    *("link", "joint", "collision", "geometry", "origin", "box", "sphere", "cylinder", "capsule", "mesh"),
    *("parent", "child", "axis", "mimic"),
)
"""Elements that are read."""

LONGEST_LINK_NAME: Final = 256
"""Characters of the name of a link or a joint."""

MOST_LINKS: Final = 2000
"""Links of a robot. Humanoids with hands have 100."""


class JointType(StrEnum):
    """The joints of URDF."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    PLANAR = "planar"
    FLOATING = "floating"


@dataclass(frozen=True)
class Mimic:
    """A joint follows another: position = multiplier * position of `joint` + offset (rad or m)."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint. origin: X_PC, the child's frame in the parent's at position 0; axis (3,): unit vector in the child's.

    limits: smallest and largest position (rad or m), infinite without one.
    """

    name: str
    type: JointType
    parent: str
    child: str
    origin: Pose
    axis: NDArray[np.float64]
    mimic: Mimic | None
    limits: tuple[float, float]
    element: Element


@dataclass(frozen=True, eq=False)
class Collision:
    """A collision geometry: its element (<box>, <mesh>, …) and its pose in the link's frame."""

    geometry: Element
    pose: Pose


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid link with its collision geometries."""

    name: str
    collisions: tuple[Collision, ...]
    element: Element


@dataclass(frozen=True, eq=False)
class Urdf:
    """A robot: links and joints by name, in the order of the file."""

    name: str
    links: dict[str, Link]
    joints: dict[str, Joint]


def parse_urdf(text: str | bytes, name: str) -> Urdf:
    """Read a URDF. name: of its file or topic, for errors. Raises InputError with file, line and element."""
    robot = parse_xml(text, name)
    if robot.tag != "robot":
        raise robot.error("expected a URDF with <robot> as its outermost element")
    _refuse_xacro(robot)
    links: dict[str, Link] = {}
    for element in robot.all("link"):
        _put(links, _link(element), element)
    if not 0 < len(links) <= MOST_LINKS:
        raise robot.error(f"expected 1 to {MOST_LINKS} links, got {len(links)}")
    joints: dict[str, Joint] = {}
    for element in robot.all("joint"):
        _put(joints, _joint(element), element)
    return Urdf(robot.attributes.get("name", "robot"), links, joints)


def _refuse_xacro(robot: Element) -> None:
    """Raise InputError for macros and expressions that are left: they stand for links, shapes and names."""
    left = [robot]
    while left:
        element = left.pop()
        texts = element.attributes.values()
        if element.tag.startswith("xacro:") or any("${" in text or "$(" in text for text in texts):
            raise element.error("expected a URDF, got a xacro file; convert it with `xacro FILE > ROBOT.urdf`")
        left += reversed([each for each in element.children if each.tag in _READ or each.tag.startswith("xacro:")])


def _put(found: dict[str, Any], each: Any, element: Element) -> None:
    if len(each.name) > LONGEST_LINK_NAME:
        raise element.error(f"name: expected at most {LONGEST_LINK_NAME} characters, got {len(each.name)}")
    if each.name in found:
        raise element.error(f"expected a name of its own, got that of {found[each.name].element.where}")
    found[each.name] = each


def _link(element: Element) -> Link:
    collisions = []
    for collision in element.all("collision"):
        shapes = [shape for geometry in collision.all("geometry") for shape in geometry.children]
        if not shapes:
            raise collision.error("expected <geometry> with a shape in it, got none")
        collisions += [Collision(shape, _origin(collision)) for shape in shapes]  # the format has one; none is left out
    return Link(element.text("name"), tuple(collisions), element)


def _joint(element: Element) -> Joint:
    kind = element.text("type")
    if kind not in list(JointType):
        raise element.error(f"type: expected one of {', '.join(JointType)}, got {kind!r:.80}")
    ends = {}
    for end in ("parent", "child"):
        child = element.first(end)
        if child is None:
            raise element.error(f"expected <{end} link=…>, got none")
        ends[end] = child.text("link")
    axis = element.first("axis") if kind != JointType.FIXED else None  # exporters write <axis xyz="0 0 0"/> there
    mimic = element.first("mimic")
    return Joint(
        element.text("name"),
        JointType(kind),
        ends["parent"],
        ends["child"],
        _origin(element),
        np.array([1.0, 0.0, 0.0]) if axis is None else _unit(axis),
        None if mimic is None else _mimic(mimic),
        _limits(element, kind),
        element,
    )


def _limits(joint: Element, kind: str) -> tuple[float, float]:
    """Return the limits of a joint. What is not there, or is no range of numbers, limits nothing: the joint goes on."""
    limit = joint.first("limit")
    if kind not in (JointType.REVOLUTE, JointType.PRISMATIC) or limit is None:
        return -inf, inf
    if not {"lower", "upper"} & limit.attributes.keys():
        return -inf, inf
    try:
        lower, upper = limit.number("lower", 0.0), limit.number("upper", 0.0)
    except InputError:
        return -inf, inf
    return (lower, upper) if lower <= upper else (-inf, inf)


def _mimic(element: Element) -> Mimic:
    return Mimic(element.text("joint"), element.number("multiplier", 1.0), element.number("offset", 0.0))


def _unit(axis: Element) -> NDArray[np.float64]:
    vector = axis.vector("xyz", 3, (1.0, 0.0, 0.0))
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise axis.error("xyz: expected an axis that is not zero")
    return vector / length


def _origin(element: Element) -> Pose:
    """Return the pose of <origin xyz rpy>: turned about the fixed axes x, y, z in this order."""
    origin = element.first("origin")
    if origin is None:
        return Pose()
    turns = from_rotation_vector(np.diag(origin.vector("rpy", 3, np.zeros(3))))
    quaternion = multiply(turns[2], multiply(turns[1], turns[0]))
    return Pose(origin.vector("xyz", 3, np.zeros(3)), quaternion / np.linalg.norm(quaternion))
