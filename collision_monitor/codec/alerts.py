"""CollisionAlert and CollisionAlertArray: one alert that has changed, and all that are raised."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.alert_coverage import (
    LEAST_COVERAGE,
    LEAST_UNMONITORED,
    RuleCoverage,
    UnmonitoredObject,
    read_coverage,
    read_unmonitored,
    write_coverage,
    write_unmonitored,
)
from collision_monitor.codec.cdr import Buffer, Reader, Writer, write_header
from collision_monitor.records import HELD_BACK

Point = tuple[float, float, float]


def none_held_back() -> NDArray[np.void]:
    """Return no pairs."""
    return np.zeros(0, HELD_BACK)


LEAST_BYTES: Final = 200
"""Bytes of the shortest alert."""


class AlertLevel(IntEnum):
    """`CollisionAlert.level`."""

    NONE = 0
    CAUTION = 1
    WARNING = 2
    CRITICAL = 3


class AlertCause(IntEnum):
    """`CollisionAlert.cause`."""

    CONDITIONS = 0
    UNRESOLVED = 1
    REMOVED = 2


@dataclass(frozen=True)
class CollisionAlert:
    """The fields of the message in their order; stamps in ns."""

    stamp_ns: int
    frame_id: str
    step: int
    number: int
    since_ns: int
    time_to_collision: float
    time_to_collision_upper: float
    probability: float
    distance: float
    distance_error: float
    closing_speed: float
    impact_speed: float
    time_to_closest_approach: float
    distance_at_closest_approach: float
    required_deceleration: float
    time_headway: float
    post_encroachment_time: float
    separation_margin: float
    point_a: Point
    point_b: Point
    id_a: int
    id_b: int
    level: int
    previous_level: int
    cause: int
    rule: str
    name_a: str
    name_b: str
    class_a: str
    class_b: str
    text: str


_NUMBERS: Final = tuple(each.name for each in fields(CollisionAlert) if each.type == "float")
_TEXTS: Final = ("rule", "name_a", "name_b", "class_a", "class_b", "text")


@dataclass(frozen=True)
class CollisionAlertArray:
    """A CollisionAlertArray message. held_back: records.HELD_BACK."""

    stamp_ns: int
    frame_id: str
    step: int
    number: int
    highest: int
    alerts: tuple[CollisionAlert, ...]
    monitor: int = 0
    held_back: NDArray[np.void] = field(default_factory=none_held_back)
    rule_names: tuple[str, ...] = ()
    coverage: tuple[RuleCoverage, ...] = ()
    unmonitored: tuple[UnmonitoredObject, ...] = ()


def decode_alert(data: Buffer) -> CollisionAlert:
    """Decode a CollisionAlert. Raises MessageError."""
    reader = Reader(data, "CollisionAlert")
    alert = _read(reader)
    reader.finish()
    return alert


def encode_alert(alert: CollisionAlert) -> bytes:
    """Encode a CollisionAlert. Raises MessageError."""
    writer = Writer("CollisionAlert")
    _write(writer, alert)
    return writer.finish()


def decode_alerts(data: Buffer) -> CollisionAlertArray:
    """Decode a CollisionAlertArray. Raises MessageError."""
    reader = Reader(data, "CollisionAlertArray")
    head = reader.stamp_ns(), reader.string("header.frame_id")
    numbers = reader.scalar("u8", "step"), reader.scalar("u8", "number"), reader.scalar("u1", "highest")
    alerts = tuple(_read(reader) for _ in range(reader.count(LEAST_BYTES, "alerts")))
    monitor = reader.scalar("u8", "monitor")
    held_back = reader.sequence(HELD_BACK, 8, "held_back")
    names = tuple(reader.strings("rule_names"))
    coverage = tuple(read_coverage(reader) for _ in range(reader.count(LEAST_COVERAGE, "coverage")))
    unmonitored = tuple(read_unmonitored(reader) for _ in range(reader.count(LEAST_UNMONITORED, "unmonitored")))
    reader.finish()
    return CollisionAlertArray(*head, *numbers, alerts, monitor, held_back, names, coverage, unmonitored)


def encode_alerts(array: CollisionAlertArray) -> bytes:
    """Encode a CollisionAlertArray. Raises MessageError."""
    writer = Writer("CollisionAlertArray")
    write_header(writer, array.stamp_ns, array.frame_id)
    writer.scalar("u8", array.step, "step")
    writer.scalar("u8", array.number, "number")
    writer.scalar("u1", array.highest, "highest")
    writer.scalar("u4", len(array.alerts), "alerts")
    for alert in array.alerts:
        _write(writer, alert)
    writer.scalar("u8", array.monitor, "monitor")
    writer.sequence(array.held_back, HELD_BACK, 8)
    writer.strings(list(array.rule_names), "rule_names")
    writer.scalar("u4", len(array.coverage), "coverage")
    for each in array.coverage:
        write_coverage(writer, each)
    writer.scalar("u4", len(array.unmonitored), "unmonitored")
    for one in array.unmonitored:
        write_unmonitored(writer, one)
    return writer.finish()


def _read(reader: Reader) -> CollisionAlert:
    head = reader.stamp_ns(), reader.string("header.frame_id")
    counts = reader.scalar("u8", "step"), reader.scalar("u8", "number")
    since_ns = reader.stamp_ns()
    numbers = reader.floats(len(_NUMBERS) + 6, "numbers").tolist()
    points: Any = tuple(numbers[-6:-3]), tuple(numbers[-3:])
    ids = reader.scalar("u4", "id_a"), reader.scalar("u4", "id_b")
    small = [reader.scalar("u1", name) for name in ("level", "previous_level", "cause")]
    values: list[Any] = [*head, *counts, since_ns, *numbers[:-6], *points, *ids, *small, *map(reader.string, _TEXTS)]
    return CollisionAlert(*values)


def _write(writer: Writer, alert: CollisionAlert) -> None:
    write_header(writer, alert.stamp_ns, alert.frame_id)
    writer.scalar("u8", alert.step, "step")
    writer.scalar("u8", alert.number, "number")
    writer.stamp_ns(alert.since_ns)
    for value in (*(getattr(alert, name) for name in _NUMBERS), *alert.point_a, *alert.point_b):
        writer.scalar("f8", value, "numbers")
    for name in ("id_a", "id_b"):
        writer.scalar("u4", getattr(alert, name), name)
    for name in ("level", "previous_level", "cause"):
        writer.scalar("u1", getattr(alert, name), name)
    for name in _TEXTS:
        writer.string(getattr(alert, name), name)
