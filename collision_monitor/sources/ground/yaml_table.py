"""Checks of the values in a sources file. Each raises InputError with the key, what was expected and what was there."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import as_numbers, checked_yaml_number
from collision_monitor.codec.shape_fields import RawShape, make_shape
from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.records import ShapeType
from collision_monitor.settings.names import nearest_name
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import KINDS, Mesh, Shape

BY_VERTICES = ("convex_hull", "polygon")
SHAPES = tuple(
    kind.name.lower() for kind in ShapeType if kind != ShapeType.POINTS and not issubclass(KINDS[kind - 1].shape, Mesh)
)


def table(value: Any, what: str, keys: Collection[str]) -> dict[str, Any]:
    """Return a table with these keys only."""
    if not isinstance(value, dict):
        raise InputError(f"{what}: expected a table with {', '.join(keys)}, got {value!r:.200}")
    for key in value:
        known(str(key), keys, what)
    return {str(key): each for key, each in value.items()}


def known(key: str, keys: Collection[str], what: str) -> None:
    """Check that a key is one of these."""
    if key not in keys:
        raise InputError(f"{what}: {key!r} is unknown: {nearest_name(key, keys)}")


def text(value: Any, what: str) -> str:
    """Return a text."""
    if not isinstance(value, str):
        raise InputError(f"{what}: expected a text, got {value!r}")
    return value


def truth(value: Any, what: str) -> bool:
    """Return true or false."""
    if not isinstance(value, bool):
        raise InputError(f"{what}: expected true or false, got {value!r}")
    return value


def number(value: Any, what: str, unit: str, *, least: float = 0.0, most: float = 1e9) -> float:
    """Return a number in a range."""
    return checked_yaml_number(value, what, unit, least=least, most=most)


def numbers(value: Any, what: str) -> NDArray[np.float64]:
    """Return an array of numbers."""
    return as_numbers(value, what)


def pose(value: Any, what: str) -> Pose:
    """Return the pose of three numbers, a position, or of seven, with a quaternion."""
    given = numbers(value, what)
    if given.shape not in ((3,), (7,)):
        raise InputError(f"{what}: expected [x, y, z] or [x, y, z, qx, qy, qz, qw], got {value!r}")
    try:
        return Pose(given[:3], given[3:]) if len(given) == 7 else Pose(given)
    except CollisionMonitorError as error:
        raise InputError(f"{what}: {error}") from None


def shape(value: Any, name: str) -> tuple[Shape, Pose]:
    """Return a shape and its pose in the object, such as of `{box: [1, 2, 3], at: [0, 0, 1]}`."""
    content = table(value, f"{name}, shape", (*SHAPES, "at"))
    kinds = [key for key in content if key != "at"]
    if len(kinds) != 1:
        raise InputError(f"{name}, shape: expected one of {', '.join(SHAPES)}, got {', '.join(kinds) or 'none'}")
    (kind,) = kinds
    what = f"{name}, {kind}"
    by_vertices = kind in BY_VERTICES
    given = numbers(content[kind], what)
    if by_vertices:
        columns = 2 if kind == "polygon" else 3
        if given.ndim != 2 or given.shape[1] != columns:
            raise InputError(f"{what}: expected points of {columns} numbers, got {content[kind]!r}")
        given = np.column_stack([given, np.zeros((len(given), 3 - columns))])
    elif given.ndim > 1:
        raise InputError(f"{what}: expected a number or a list of numbers, got {content[kind]!r}")
    none = np.zeros(0)
    dimensions, vertices = (none, given) if by_vertices else (np.atleast_1d(given), none)
    try:
        made = make_shape(RawShape(ShapeType[kind.upper()], dimensions, vertices))
    except CollisionMonitorError as error:
        raise InputError(f"{name}, shape: {error}") from None
    return made, pose(content["at"], f"{name}, at") if "at" in content else Pose()
