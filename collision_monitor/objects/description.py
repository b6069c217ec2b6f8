"""Description of an object as one checked record: input of the monitor, the codec and the scenes."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import InputError, ShapeError
from collision_monitor.records import Model
from collision_monitor.shapes.compound import shape_pairs
from collision_monitor.shapes.pose import Pose, as_pose
from collision_monitor.tolerances import LARGEST_INPUT

ALL_GROUPS = 0xFFFFFFFF

MOST_SHAPES = 1024
"""Shapes of one object. Two such objects have a million pairs of shapes to test, which take 0.1 to 1 s."""

_UINT32_MAX = 0xFFFFFFFF

MOST_NAME_BYTES: Final = 256
"""Largest size of a name (bytes of UTF-8). A name is for people, and every answer that mentions its object repeats it.
Longer names are refused, because cutting them could make two of them equal."""


def _uint32(value: Any, what: str) -> int:
    try:
        number = -1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = -1
    if not 0 <= number <= _UINT32_MAX:
        name = "; a text goes into name=" if isinstance(value, str) else ""
        raise InputError(f"{what}: expected an integer from 0 to {_UINT32_MAX}, got {value!r:.100}{name}")
    return number


def _ids(value: Any, what: str) -> Iterable[Any]:
    if not isinstance(value, Iterable) or isinstance(value, str | bytes):
        raise InputError(f"{what}: expected a list of ids, got {value!r:.100}")
    return value


def _name(value: Any, what: str) -> str:
    name = str(value)
    try:
        encoded = name.encode("utf-8")
    except UnicodeEncodeError:
        encoded = b"\0"
    if 0 in encoded:
        raise InputError(f"{what}, name: expected text that UTF-8 can hold, without zero bytes, got {name[:40]!r}")
    if len(encoded) > MOST_NAME_BYTES:
        raise InputError(
            f"{what}, name: expected at most {MOST_NAME_BYTES} bytes of UTF-8, got {len(encoded)} bytes: "
            f"{name[:40]!r}…; use a shorter name"
        )
    return name


@dataclass(frozen=True, eq=False)
class ObjectDescription:
    """One object, as in `ObjectDescription.msg`; lengths in m, accelerations in m/s^2 and rad/s^2.

    `shapes` may be given as one shape and is stored as a tuple of (shape, pose in the object's frame). `pose` is the
    pose of a static object in the world frame (also x y z, 7 numbers or a matrix), None otherwise. `name` has at most
    MOST_NAME_BYTES of UTF-8. Values that the message may omit get their defaults here: an empty name, a group or mask
    of 0, an acceleration of NaN.
    Raises InputError; ShapeError for the shapes, PoseError for the pose.

    >>> from collision_monitor.shapes.registry import Sphere
    >>> ObjectDescription(7, Sphere(0.5), name="ball").name
    'ball'
    """

    object_id: int
    shapes: Any
    name: str = ""
    static: bool = False
    pose: Pose | None = None
    group: int = 1
    mask: int = ALL_GROUPS
    padding: float = 0.0
    model: Model = Model.AUTO
    allowed: tuple[int, ...] = ()
    max_linear_acceleration: float = 0.0
    max_angular_acceleration: float = 0.0

    def __post_init__(self) -> None:
        object_id = _uint32(self.object_id, "object id")
        what = f"object {object_id}"
        given: Any = self.model  # a Model, its number or its name
        try:
            model = Model[given.upper()] if isinstance(given, str) else Model(given)
        except (ValueError, KeyError):
            choices = ", ".join(f"{m.name} ({m.value})" for m in Model)
            raise InputError(f"{what}, model: expected one of {choices}, got {self.model!r}") from None
        shapes = shape_pairs(self.shapes, what)
        if len(shapes) > MOST_SHAPES:
            raise ShapeError(f"{what}: expected at most {MOST_SHAPES} shapes, got {len(shapes)}; use a Mesh or a hull")
        if self.static and self.pose is None:
            raise InputError(f"{what}: a static object needs the pose where it stands, got None")
        checked = {
            "object_id": object_id,
            "shapes": shapes,
            "name": _name(self.name, what) or f"object_{object_id}",
            "static": bool(self.static),
            "pose": None if self.pose is None else as_pose(self.pose, f"{what}, pose"),
            "group": _uint32(self.group, f"{what}, group") or 1,
            "mask": _uint32(self.mask, f"{what}, mask") or ALL_GROUPS,
            "padding": checked_number(self.padding, f"{what}, padding", "metres", least=0.0, most=LARGEST_INPUT),
            "model": model,
            "allowed": tuple(_uint32(other, f"{what}, allowed") for other in _ids(self.allowed, f"{what}, allowed")),
        }
        for field, unit in (("max_linear_acceleration", "m/s^2"), ("max_angular_acceleration", "rad/s^2")):
            value = getattr(self, field)
            unknown = isinstance(value, float) and math.isnan(value)
            name = f"{what}, {field}"
            checked[field] = 0.0 if unknown else checked_number(value, name, unit, least=0.0, most=LARGEST_INPUT)
        for field, value in checked.items():
            object.__setattr__(self, field, value)
