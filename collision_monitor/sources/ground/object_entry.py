"""An entry of `objects:` in a sources file: an object, or a group of objects from one topic."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.kinds.grid import UNKNOWN_IS
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape
from collision_monitor.sources.ground.motion_models import AS_USUAL, MotionChoice, read_motion
from collision_monitor.sources.ground.schedule import Schedule, read_schedule
from collision_monitor.sources.ground.yaml_table import SHAPES, known, number, pose, shape, table, text, truth

PLACE: Final = ("topic", "type", "frame", "marker", "static", "pose", "schedule")
BODY: Final = ("shape", "shapes", "each", "id", "padding", "group", "mask", "allowed")
NUMBERS: Final = {
    "forget_after": ("s", 1.0),
    "min_existence": ("probability", 0.0),
    "shape_tolerance": ("m", 0.05),
    "position_stddev": ("m", 0.0),
    "estimate_over": ("s", 0.0),
    "gate": ("m", 1.0),
    "height": ("m", 0.0),
    "radius": ("m", 0.05),
    "voxel": ("m", 0.0),
    "min_range": ("m", 0.0),
    "max_range": ("m", 1e9),
    "clearance": ("m", 0.0),
    "threshold": ("value", 0.0),
    "min_height": ("m", 0.0),
    "max_height": ("m", 1e9),
    "ground_slope": ("deg", 0.0),
    "ground_thickness": ("m", 0.1),
}
"""Keys with a number, their units and defaults."""

KEYS: Final = (
    *(*PLACE, *BODY, "covariance", "without", "nan_is_free", "motion", "acceleration", "paths"),
    *("unknown", "updates", "voxels", "layer", *NUMBERS),
)


@dataclass(frozen=True)
class ObjectEntry:
    """An object, or a group of objects, and where its pose comes from.

    type: of the topic's messages, empty if the topic decides. marker: namespace and id of its marker; id None: all
    markers of the namespace. shapes: empty if the messages hold them. each: the shape of each object of a
    group, in place of those in the messages. pose: of a static object, in `frame` (empty: the
    monitor's). covariance: whether covariances in the messages are used. without: names of the objects
    whose points a scan leaves out. nan_is_free: whether its NaN mean that nothing is there. motion: how the objects
    move on from their states. schedule: where the object is when, declared. paths: which predicted paths count.
    unknown: what unknown cells of a map are (UNKNOWN_IS). updates: the topic of its updates, or empty. voxels: whether
    a cloud is cells of the edge `voxel`. layer: of the heights of a GridMap. given: the keys that the file holds. The
    numbers are those of NUMBERS.
    """

    name: str
    object_id: int
    topic: str = ""
    type: str = ""
    frame: str = ""
    marker: tuple[str, int | None] | None = None
    shapes: tuple[tuple[Shape, Pose], ...] = ()
    each: tuple[tuple[Shape, Pose], ...] = ()
    static: bool = False
    pose: Pose | None = None
    padding: float = 0.0
    group: int = 1
    mask: int = 0
    allowed: tuple[str, ...] = ()
    allowed_ids: tuple[int, ...] = ()
    covariance: bool = True
    forget_after: float = 1.0
    min_existence: float = 0.0
    shape_tolerance: float = 0.05
    position_stddev: float = 0.0
    estimate_over: float = 0.0
    gate: float = 1.0
    height: float = 0.0
    radius: float = 0.05
    voxel: float = 0.0
    min_range: float = 0.0
    max_range: float = 1e9
    clearance: float = 0.0
    threshold: float = 0.0
    unknown: str = UNKNOWN_IS[0]
    updates: str = ""
    voxels: bool = False
    layer: str = "elevation"
    min_height: float = 0.0
    max_height: float = 1e9
    ground_slope: float = 0.0
    ground_thickness: float = 0.1
    without: tuple[str, ...] = ()
    nan_is_free: bool = False
    motion: MotionChoice = AS_USUAL
    schedule: Schedule | None = None
    paths: str = "all"
    given: tuple[str, ...] = ()

    def describe(
        self,
        object_id: int | None = None,
        name: str = "",
        shapes: Any = (),
        *,
        at: Pose | None = None,
        extra_padding: float = 0.0,
    ) -> ObjectDescription:
        """Return the description of the object, or of one of the group. Raises InputError with its name.

        at: where it stands, if it is static. extra_padding (m): how far the real shape may exceed this one.
        """
        try:
            return ObjectDescription(
                self.object_id if object_id is None else object_id,
                list(shapes or self.shapes),
                name=name or self.name,
                static=at is not None,
                pose=at,
                padding=self.padding + extra_padding,
                group=self.group,
                mask=self.mask,
                allowed=self.allowed_ids,
            )
        except CollisionMonitorError as error:
            raise InputError(f"{name or self.name}: {error}") from None

    def allow_only(self, keys: Collection[str], message_type: str) -> None:
        """Check that the file holds no key for this entry that its type of messages does not use."""
        for key in self.given:
            if key not in ("topic", "type", "schedule", *(set(BODY) - {"each"}), *keys):
                used = ", ".join(sorted({*keys, "shape", "padding", "group", "mask", "allowed"}))
                raise InputError(f"{self.name}, {key}: {message_type} does not use it; it uses {used}")


def read_entries(content: Any) -> tuple[ObjectEntry, ...]:
    """Return the entries of `objects:`. Raises InputError."""
    tables = {str(name): table(value, str(name), KEYS) for name, value in content.items()}
    ids = _ids(tables)
    entries = [_entry(name, given, ids[name]) for name, given in tables.items()]
    single = [each.name for each in entries if each.marker is None or each.marker[1] is not None]
    for entry in entries:
        for other in entry.allowed:
            known(other, single, f"{entry.name}, allowed")
    return tuple(dataclasses.replace(each, allowed_ids=tuple(ids[other] for other in each.allowed)) for each in entries)


def _ids(tables: dict[str, dict[str, Any]]) -> dict[str, int]:
    """Return the given ids, and the lowest free ones from 1 for the other objects."""
    given: dict[str, int] = {}
    for name, content in tables.items():
        if "id" in content:
            value = content["id"]
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 32:
                raise InputError(f"{name}, id: expected a whole number from 0 to 4294967295, got {value!r}")
            if value in given.values():
                raise InputError(f"{name}, id: expected one that no other object has, got {value}")
            given[name] = value
    free = (i for i in range(1, len(tables) + len(given) + 1) if i not in given.values())
    return {name: given[name] if name in given else next(free) for name in tables}


def _entry(name: str, content: dict[str, Any], object_id: int) -> ObjectEntry:
    topic, frame = text(content.get("topic", ""), f"{name}, topic"), text(content.get("frame", ""), f"{name}, frame")
    static = truth(content.get("static", False), f"{name}, static")
    marker = _marker(name, content["marker"]) if "marker" in content else None
    stands_at = pose(content["pose"], f"{name}, pose") if "pose" in content else None
    if marker is not None and not topic:
        raise InputError(f"{name}, topic: expected the topic of the markers, got none")
    if "schedule" in content and (static or marker is not None or not _shapes_given(name, content)):
        raise InputError(f"{name}, schedule: expected one of a single object with a `shape`, which is not static")
    if static and marker is None:
        if topic:
            raise InputError(f"{name}: a static object stands at its `pose` in its `frame`; expected no topic")
        if not _shapes_given(name, content):
            raise InputError(f"{name}, shape: expected one of {', '.join(SHAPES)}, got none")
    elif not topic and "schedule" not in content:
        raise InputError(f"{name}, topic: expected the topic of its pose, `static: true` or `schedule`, got none")
    elif stands_at is not None:
        raise InputError(f"{name}, pose: expected one of static objects only; `at` places a shape in its object")
    allowed, without = content.get("allowed", []), content.get("without", [])
    for key, names in (("allowed", allowed), ("without", without)):
        if not isinstance(names, list):
            raise InputError(f"{name}, {key}: expected a list of names, got {names!r}")
    unknown = text(content.get("unknown", UNKNOWN_IS[0]), f"{name}, unknown")
    known(unknown, UNKNOWN_IS, f"{name}, unknown")
    values: dict[str, Any] = {
        key: number(content.get(key, default), f"{name}, {key}", unit) for key, (unit, default) in NUMBERS.items()
    }
    return ObjectEntry(
        name=name,
        object_id=object_id,
        topic=topic,
        type=_full_type(text(content.get("type", ""), f"{name}, type")),
        frame=frame.removeprefix("/"),
        marker=marker,
        shapes=tuple(shape(each, name) for each in _shapes_given(name, content)),
        each=(shape(content["each"], f"{name}, each"),) if "each" in content else (),
        static=static,
        pose=stands_at,
        padding=content.get("padding", 0.0),
        group=content.get("group", 1),
        mask=content.get("mask", 0),
        allowed=tuple(map(str, allowed)),
        without=tuple(map(str, without)),
        covariance=truth(content.get("covariance", True), f"{name}, covariance"),
        nan_is_free=truth(content.get("nan_is_free", False), f"{name}, nan_is_free"),
        motion=read_motion(content, name),
        paths=text(content.get("paths", "all"), f"{name}, paths"),
        schedule=read_schedule(content["schedule"], name) if "schedule" in content else None,
        unknown=unknown,
        updates=text(content.get("updates", ""), f"{name}, updates"),
        voxels=truth(content.get("voxels", False), f"{name}, voxels"),
        layer=text(content.get("layer", "elevation"), f"{name}, layer"),
        given=tuple(content),
        **values,
    )


def _shapes_given(name: str, content: dict[str, Any]) -> list[Any]:
    if "shape" in content and "shapes" in content:
        raise InputError(f"{name}: expected `shape` or `shapes`, got both")
    given = content.get("shapes", [content["shape"]] if "shape" in content else [])
    if not isinstance(given, list):
        raise InputError(f"{name}, shapes: expected a list, got {given!r}")
    return given


def _full_type(name: str) -> str:
    """Return `package/msg/Name` of that or of `package/Name`."""
    package, _, last = name.rpartition("/")
    return f"{package}/msg/{last}" if package and "/" not in package else name


def _marker(name: str, value: Any) -> tuple[str, int | None]:
    content = table(value, f"{name}, marker", ("ns", "id"))
    namespace, marker_id = content.get("ns", ""), content.get("id")
    if not isinstance(namespace, str) or isinstance(marker_id, bool) or not isinstance(marker_id, int | None):
        raise InputError(f"{name}, marker: expected ns: a text, and id: a whole number, got {value!r}")
    return namespace, marker_id
