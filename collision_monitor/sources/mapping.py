"""The mapping file: for each object, the topic of a bag that holds its pose, and its shape.

frame: map                               # frame of the session; the bag's tf transforms poses from other frames
stamps: header                           # or `received`: the time at which the bag received the message
objects:
  cart:     {topic: /cart/odom, shape: {box: [1.2, 0.8, 0.5], at: [0, 0, 0.25]}}
  person_1: {topic: /tf, frame: person_1, shape: {capsule: [0.3, 1.1]}}
  crate:    {topic: /markers, marker: {ns: crates, id: 7}}      # the marker's own shape
  walls:    {topic: /markers, marker: {ns: walls}, static: true}   # all markers of the namespace: walls_0, walls_1 …
  floor:    {static: true, shape: {half_space: [0, 0, 1, 0]}}
"""

from __future__ import annotations

import difflib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from collision_monitor.codec.shape_fields import make_shape
from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shapes import Shape
from collision_monitor.records import ShapeType
from collision_monitor.settings.yaml_file import read_yaml

HEADER, RECEIVED = "header", "received"

_TOP: Final = ("frame", "stamps", "objects")
_OBJECT: Final = (
    *("topic", "frame", "marker", "shape", "shapes", "static", "pose", "id", "padding", "group", "mask", "allowed"),
)
_BY_VERTICES: Final = ("convex_hull", "polygon")
_SHAPES: Final = tuple(kind.name.lower() for kind in ShapeType if kind is not ShapeType.MESH)


@dataclass(frozen=True)
class Source:
    """An object, and the source of its pose in the bag.

    marker: namespace and id of its marker; id None: all markers of the namespace. shapes: empty if the marker holds
    them. pose: of a static object, in `frame` (empty: the session's).
    """

    name: str
    object_id: int
    topic: str = ""
    frame: str = ""
    marker: tuple[str, int | None] | None = None
    shapes: tuple[tuple[Shape, Pose], ...] = ()
    static: bool = False
    pose: Pose | None = None
    padding: float = 0.0
    group: int = 1
    mask: int = 0
    allowed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Mapping:
    """The content of a mapping file. stamps: HEADER or RECEIVED."""

    frame: str
    sources: tuple[Source, ...]
    stamps: str = HEADER

    @property
    def topics(self) -> dict[str, list[Source]]:
        """The sources of each topic."""
        found: dict[str, list[Source]] = {}
        for source in self.sources:
            if source.topic:
                found.setdefault(source.topic, []).append(source)
        return found


def load_mapping(path: Path) -> Mapping:
    """Read a mapping file. Raises InputError, with the object and the key, if it cannot be used."""
    content = read_yaml(path)
    try:
        return make_mapping(content)
    except CollisionMonitorError as error:
        raise InputError(f"{path}: {error}") from None


def make_mapping(content: Any) -> Mapping:
    """Return the mapping of a file's content. Raises InputError."""
    top = _table(content, "the file", _TOP)
    frame = top.get("frame")
    if not isinstance(frame, str) or not frame:
        raise InputError(f"frame: expected the name of the frame of the session, such as map, got {frame!r}")
    stamps = top.get("stamps", HEADER)
    if stamps not in (HEADER, RECEIVED):
        raise InputError(f"stamps: expected {HEADER} or {RECEIVED}, got {stamps!r}")
    objects = top.get("objects")
    if not isinstance(objects, dict) or not objects:
        raise InputError(f"objects: expected a table of names, got {objects!r}")
    tables = {str(name): _table(value, str(name), _OBJECT) for name, value in objects.items()}
    ids = _ids(tables)
    sources = tuple(_source(name, table, ids[name]) for name, table in tables.items())
    single = [source.name for source in sources if source.marker is None or source.marker[1] is not None]
    for source in sources:
        for other in source.allowed:
            _known(other, single, f"{source.name}, allowed")
    return Mapping(frame.removeprefix("/"), sources, stamps)


def _ids(tables: dict[str, dict[str, Any]]) -> dict[str, int]:
    """Return the given ids, and the lowest free ones from 1 for the other objects."""
    given: dict[str, int] = {}
    for name, table in tables.items():
        if "id" in table:
            value = table["id"]
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 32:
                raise InputError(f"{name}, id: expected a whole number from 0 to 4294967295, got {value!r}")
            if value in given.values():
                raise InputError(f"{name}, id: expected one that no other object has, got {value}")
            given[name] = value
    free = (i for i in range(1, len(tables) + len(given) + 1) if i not in given.values())
    return {name: given[name] if name in given else next(free) for name in tables}


def _source(name: str, table: dict[str, Any], object_id: int) -> Source:
    topic, frame, static = table.get("topic", ""), table.get("frame", ""), table.get("static", False)
    for key, value, kind in (("topic", topic, str), ("frame", frame, str), ("static", static, bool)):
        if not isinstance(value, kind):
            raise InputError(f"{name}, {key}: expected {'a text' if kind is str else 'true or false'}, got {value!r}")
    marker = _marker(name, table["marker"]) if "marker" in table else None
    pose = _pose(table["pose"], f"{name}, pose") if "pose" in table else None
    if marker is not None and not topic:
        raise InputError(f"{name}, topic: expected the topic of the markers, got none")
    if static and marker is None:
        if topic:
            raise InputError(f"{name}: a static object stands at its `pose` in its `frame`; expected no topic")
    elif not topic:
        raise InputError(f"{name}, topic: expected the topic that tells where it is, or `static: true`, got none")
    elif pose is not None:
        raise InputError(f"{name}, pose: expected one of static objects only; `at` places a shape in its object")
    if "shape" in table and "shapes" in table:
        raise InputError(f"{name}: expected `shape` or `shapes`, got both")
    given = table.get("shapes", [table["shape"]] if "shape" in table else [])
    if not isinstance(given, list) or not (given or marker):
        raise InputError(f"{name}, shape: expected one of {', '.join(_SHAPES)}, got none; only markers bring their own")
    allowed = table.get("allowed", [])
    if not isinstance(allowed, list):
        raise InputError(f"{name}, allowed: expected a list of names, got {allowed!r}")
    return Source(
        name=name,
        object_id=object_id,
        topic=topic,
        frame=frame.removeprefix("/"),
        marker=marker,
        shapes=tuple(_shape(each, name) for each in given),
        static=static,
        pose=pose,
        padding=table.get("padding", 0.0),
        group=table.get("group", 1),
        mask=table.get("mask", 0),
        allowed=tuple(map(str, allowed)),
    )


def _marker(name: str, value: Any) -> tuple[str, int | None]:
    table = _table(value, f"{name}, marker", ("ns", "id"))
    namespace, number = table.get("ns", ""), table.get("id")
    if not isinstance(namespace, str) or isinstance(number, bool) or not (number is None or isinstance(number, int)):
        raise InputError(f"{name}, marker: expected ns: a text, and id: a whole number, got {value!r}")
    return namespace, number


def _shape(value: Any, name: str) -> tuple[Shape, Pose]:
    table = _table(value, f"{name}, shape", (*_SHAPES, "at"))
    kinds = [key for key in table if key != "at"]
    if len(kinds) != 1:
        raise InputError(f"{name}, shape: expected one of {', '.join(_SHAPES)}, got {', '.join(kinds) or 'none'}")
    (kind,) = kinds
    what = f"{name}, {kind}"
    by_vertices = kind in _BY_VERTICES
    numbers = _numbers(table[kind], what)
    if by_vertices:
        columns = 2 if kind == "polygon" else 3
        if numbers.ndim != 2 or numbers.shape[1] != columns:
            raise InputError(f"{what}: expected points of {columns} numbers, got {table[kind]!r}")
        numbers = np.column_stack([numbers, np.zeros((len(numbers), 3 - columns))])
    elif numbers.ndim > 1:
        raise InputError(f"{what}: expected a number or a list of numbers, got {table[kind]!r}")
    none = np.zeros(0)
    dimensions, vertices = (none, numbers) if by_vertices else (np.atleast_1d(numbers), none)
    try:
        shape = make_shape(ShapeType[kind.upper()], dimensions, vertices, np.zeros(0, np.uint32))
    except CollisionMonitorError as error:
        raise InputError(f"{name}, shape: {error}") from None
    return shape, _pose(table["at"], f"{name}, at") if "at" in table else Pose()


def _pose(value: Any, what: str) -> Pose:
    """Return the pose of three numbers, a position, or of seven, with a quaternion."""
    numbers = _numbers(value, what)
    if numbers.shape not in ((3,), (7,)):
        raise InputError(f"{what}: expected [x, y, z] or [x, y, z, qx, qy, qz, qw], got {value!r}")
    try:
        return Pose(numbers[:3], numbers[3:]) if len(numbers) == 7 else Pose(numbers)
    except CollisionMonitorError as error:
        raise InputError(f"{what}: {error}") from None


def _numbers(value: Any, what: str) -> Any:
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected numbers, got {value!r}") from None


def _table(value: Any, what: str, keys: Collection[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{what}: expected a table with {', '.join(keys)}, got {value!r}")
    for key in value:
        _known(str(key), keys, what)
    return {str(key): each for key, each in value.items()}


def _known(key: str, keys: Collection[str], what: str) -> None:
    if key not in keys:
        near = difflib.get_close_matches(key, keys, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(keys)}"
        raise InputError(f"{what}: {key!r} is unknown: {hint}")
