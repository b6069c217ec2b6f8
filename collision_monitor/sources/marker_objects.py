"""Markers as objects: the object that a marker represents, and its shape."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.shapes import Box, Cylinder, Shape, Sphere
from collision_monitor.sources.mapping import Source

DELETE, DELETE_ALL = 2, 3

_CUBE, _SPHERE, _CYLINDER = 1, 2, 3
_ROUND: Final = 1e-6
"""Relative difference up to which two diameters count as equal, because markers are often made from float32."""


@dataclass
class MarkerObject:
    """An object that a marker represents. described: its last description, None before the first."""

    object_id: int
    name: str
    described: object = None


class MarkerTable:
    """The markers that are shown now. Those of a whole namespace get ids from `next_id` on, as they appear."""

    def __init__(self, next_id: int) -> None:
        self._next_id = next_id
        self._objects: dict[tuple[str, str, int], MarkerObject] = {}

    def object_of(self, source: Source, marker: Any) -> MarkerObject:
        """Return the object that this marker represents."""
        key = (source.topic, marker.ns, marker.id)
        if key not in self._objects:
            if source.marker == (marker.ns, marker.id):
                self._objects[key] = MarkerObject(source.object_id, source.name)
            else:
                self._objects[key] = MarkerObject(self._next_id, f"{source.name}_{marker.id}")
                self._next_id += 1
        return self._objects[key]

    def delete(self, topic: str, marker: Any) -> list[int]:
        """Forget the markers of a DELETE or DELETEALL. Return the ids of those that were described."""
        gone = [
            key
            for key in self._objects
            if key[0] == topic and (marker.action == DELETE_ALL or key[1:] == (marker.ns, marker.id))
        ]
        objects = [self._objects.pop(key) for key in gone]
        return [each.object_id for each in objects if each.described is not None]


def source_of(sources: Iterable[Source], marker: Any) -> Source | None:
    """Return the first source that selects this marker; None if there is none."""
    wanted = ((marker.ns, marker.id), (marker.ns, None))
    return next((source for source in sources if source.marker in wanted), None)


def marker_shape(marker: Any) -> Shape:
    """Return the shape that the marker shows. Raises UnsupportedError for an unknown one, ShapeError."""
    x, y, z = marker.scale.x, marker.scale.y, marker.scale.z
    is_round = abs(x - y) <= _ROUND * abs(x)
    if marker.type == _CUBE:
        return Box((x, y, z))
    if marker.type == _SPHERE and is_round and abs(x - z) <= _ROUND * abs(x):
        return Sphere(x / 2)
    if marker.type == _CYLINDER and is_round:
        return Cylinder(x / 2, z)
    raise UnsupportedError(
        f"expected a marker CUBE (1), SPHERE (2) or CYLINDER (3), these with equal diameters, got type {marker.type}; "
        "a `shape` in the mapping takes its place"
    )
