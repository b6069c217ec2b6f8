"""Messages of any type with default values, also of the types in `interfaces/`, and their CDR bytes, without ROS."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

INTERFACES = Path(__file__).parents[2] / "interfaces"
SECOND = 1_000_000_000


@cache
def definitions() -> dict[str, Any]:
    """Fields of the types in `interfaces/`, as `Decoder` takes them."""
    found: dict[str, Any] = {}
    for path in sorted(INTERFACES.glob("*/msg/*.msg")):
        found |= get_types_from_msg(path.read_text(), f"{path.parts[-3]}/msg/{path.stem}")
    return found


@cache
def store() -> Any:
    types = get_typestore(Stores.EMPTY)
    types.register({**get_typestore(Stores.ROS2_JAZZY).fielddefs, **definitions()})
    return types


def message(kind: str, **fields: Any) -> Any:
    """Return a message of a type such as `sensor_msgs/msg/JointState`; fields that are not given have defaults."""
    types = store()
    known = dict(types.fielddefs[kind][1])
    assert fields.keys() <= known.keys(), fields.keys() - known.keys()
    values = [fields[name] if name in fields else _default(*field) for name, field in known.items()]
    return types.types[kind](*values)


def _default(node: Nodetype, detail: Any) -> Any:
    if node == Nodetype.NAME:
        return message(detail)
    if node == Nodetype.BASE:
        return {"string": "", "bool": False}.get(detail[0], 0)
    (element, inner), size = detail
    if element == Nodetype.BASE and inner[0] != "string":
        return np.zeros(size if node == Nodetype.ARRAY else 0, {"byte": "uint8"}.get(inner[0], inner[0]))
    return [_default(element, inner) for _ in range(size if node == Nodetype.ARRAY else 0)]


def header(frame: str = "", stamp: int = 0) -> Any:
    time = message("builtin_interfaces/msg/Time", sec=stamp // SECOND, nanosec=stamp % SECOND)
    return message("std_msgs/msg/Header", stamp=time, frame_id=frame)


def point(x: float, y: float, z: float) -> Any:
    return message("geometry_msgs/msg/Point", x=float(x), y=float(y), z=float(z))


def vector(x: float, y: float, z: float) -> Any:
    return message("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def pose(position: Any = (0, 0, 0), quaternion: Any = (0, 0, 0, 1)) -> Any:
    x, y, z, w = map(float, quaternion)
    turn = message("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    return message("geometry_msgs/msg/Pose", position=point(*position), orientation=turn)


def cdr(kind: str, content: Any) -> bytes:
    return bytes(store().serialize_cdr(content, kind))
