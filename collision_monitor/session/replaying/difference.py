"""Finds the first difference of two answers and describes it in words: pair, field, both values."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import MonitorStatus, decode_alert, decode_contacts, decode_predictions, decode_status
from collision_monitor.codec.status import LIVE_FIELDS
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.preparation import STAYS

_DECODERS: Final[dict[str, tuple[Callable[[bytes], Any], str]]] = {
    "ContactArray": (decode_contacts, "contacts"),
    "PredictedCollisionArray": (decode_predictions, "predictions"),
}
_NOT_COMPARED: Final = {*LIVE_FIELDS, "version", "objects_stale"}


@dataclass(frozen=True)
class Difference:
    """The first difference of a replay."""

    step: int
    topic: str
    element: str
    field: str
    recorded: str
    replayed: str
    pair: tuple[int, int] | None = None

    def __str__(self) -> str:
        where = f"step {self.step}, {self.topic}, {self.element}"
        return f"{where}: {self.field}: recorded {self.recorded}, replayed {self.replayed}"


def compare_answers(kind: str, topic: str, step: int, recorded: bytes, replayed: bytes) -> Difference | None:
    """Return the first difference of two messages of type `kind`; None if all bytes are equal."""
    if recorded == replayed:
        return None
    rows = _DECODERS[kind][1]
    decoded = _decoded(kind, topic, step, recorded, replayed)
    if isinstance(decoded, Difference):
        return decoded
    theirs, ours = decoded
    return (
        _row_difference(rows, topic, step, theirs, ours)
        or _field_difference(topic, step, theirs, ours, rows)
        or Difference(step, topic, "the message", "padding", f"{len(recorded)} bytes", f"{len(replayed)} bytes")
    )


def _decoded(kind: str, topic: str, step: int, recorded: bytes, replayed: bytes) -> tuple[Any, Any] | Difference:
    """Return both messages, or a Difference if the recorded one cannot be read."""
    decode, _ = _DECODERS[kind]
    ours = decode(replayed)
    try:
        return decode(recorded), ours
    except MessageError as error:
        return Difference(step, topic, "the message", "bytes", str(error), f"{len(replayed)} bytes that can be read")


_WITHIN: Final = {"contacts": ("signed_distance",), "predictions": ("lower", "upper")}
"""The numbers (m, s) that are compared across versions. Points are not: those of flat faces may lie anywhere on
them."""


def compare_within(
    kind: str, topic: str, step: int, recorded: bytes, replayed: bytes, tolerance: float
) -> Difference | None:
    """Return the first difference of two messages, pair by pair, that exceeds the tolerance (m, s).

    One message may lack a contact of a depth, or a prediction of a distance from the horizon, within the tolerance.
    """
    rows = _DECODERS[kind][1]
    decoded = _decoded(kind, topic, step, recorded, replayed)
    if isinstance(decoded, Difference):
        return decoded
    theirs, ours = decoded
    there, here = ({_ids(row): row for row in getattr(message, rows)} for message in (theirs, ours))
    horizon = getattr(theirs, "horizon", 0.0)
    for ids in sorted(there.keys() | here.keys()):
        element = _pair(theirs, there[ids]) if ids in there else _pair(ours, here[ids])
        if ids not in there or ids not in here:
            row = there[ids] if ids in there else here[ids]
            slight = horizon - row["lower"] if rows == "predictions" else abs(row["signed_distance"])
            if not slight <= tolerance:  # NaN: a contact that ended
                recorded_is, replayed_is = ("there" if ids in each else "nothing" for each in (there, here))
                return Difference(step, topic, element, "presence", recorded_is, replayed_is, ids)
            continue
        a, b = there[ids], here[ids]
        for name in _WITHIN[rows]:
            x, y = float(a[name]), float(b[name])
            if not (x == y or abs(x - y) <= tolerance or (x != x and y != y)):
                return Difference(step, topic, element, name, repr(x), repr(y), ids)
    return None


def compare_status(topic: str, step: int, recorded: bytes, replayed: bytes) -> Difference | None:
    """Return the first difference of two MonitorStatus in the fields that depend on the inputs alone."""
    ours = decode_status(replayed)
    try:
        theirs = decode_status(recorded)
    except MessageError as error:
        return Difference(step, topic, "the message", "bytes", str(error), "a status")
    for field in dataclasses.fields(MonitorStatus):
        a, b = getattr(theirs, field.name), getattr(ours, field.name)
        if field.name == "last_refusal" and STAYS in a:
            continue  # the clock decided about that object, and its description is recorded
        if field.name not in _NOT_COMPARED and a != b:
            return Difference(step, topic, "the status", field.name, repr(a), repr(b))
    # Without states, the watchdog counts every moving object as stale. That depends on the clock.
    silent = theirs.objects - theirs.objects_static - theirs.objects_unseen
    if theirs.objects_stale not in (ours.objects_stale, silent):
        return Difference(
            step, topic, "the status", "objects_stale", repr(theirs.objects_stale), repr(ours.objects_stale)
        )
    return None


def compare_alerts(topic: str, step: int, recorded: bytes, replayed: bytes) -> Difference | None:
    """Return the first difference of two CollisionAlert; None if all bytes are equal."""
    if recorded == replayed:
        return None
    ours = decode_alert(replayed)
    try:
        theirs = decode_alert(recorded)
    except MessageError as error:
        return Difference(step, topic, "the message", "bytes", str(error), "an alert")
    pair = ours.id_a, ours.id_b
    element = f"alert {ours.rule!r} of {ours.name_a} and {ours.name_b}"
    for field in dataclasses.fields(ours):
        a, b = getattr(theirs, field.name), getattr(ours, field.name)
        if repr(a) != repr(b):
            return Difference(step, topic, element, field.name, repr(a), repr(b), pair)
    return Difference(step, topic, element, "padding", f"{len(recorded)} bytes", f"{len(replayed)} bytes", pair)


def _row_difference(rows: str, topic: str, step: int, theirs: Any, ours: Any) -> Difference | None:
    a, b = getattr(theirs, rows), getattr(ours, rows)
    common = min(len(a), len(b))
    unequal = np.flatnonzero(_as_bytes(a[:common]) != _as_bytes(b[:common]))
    if unequal.size:
        at = int(unequal[0])
        element = f"{rows}[{at}] {_pair(theirs, a[at])}"
        for name in a.dtype.names:
            if a[at][name].tobytes() != b[at][name].tobytes():
                return Difference(step, topic, element, name, _text(a[at][name]), _text(b[at][name]), _ids(a[at]))
    if len(a) != len(b):
        longer, side = (theirs, "only recorded") if len(a) > len(b) else (ours, "only replayed")
        row = getattr(longer, rows)[common]
        element = f"{rows}[{common}] {_pair(longer, row)}, {side}"
        return Difference(step, topic, element, "number", str(len(a)), str(len(b)), _ids(row))
    return None


def _field_difference(topic: str, step: int, theirs: Any, ours: Any, rows: str) -> Difference | None:
    for field in dataclasses.fields(ours):
        a, b = getattr(theirs, field.name), getattr(ours, field.name)
        if field.name != rows and not np.array_equal(a, b):
            return Difference(step, topic, "the message", field.name, _text(a), _text(b))
    return None


def _as_bytes(rows: NDArray[Any]) -> NDArray[Any]:
    """Return each row as one opaque value, so that NaN equals NaN and 0.0 differs from -0.0."""
    return np.ascontiguousarray(rows).view(f"V{rows.dtype.itemsize}")


def _pair(message: Any, row: Any) -> str:
    names = dict(zip(message.ids.tolist(), message.names, strict=False))
    a, b = int(row["id_a"]), int(row["id_b"])
    return f"pair ({a} {names.get(a, '')!r}, {b} {names.get(b, '')!r})"


def _ids(row: Any) -> tuple[int, int]:
    return int(row["id_a"]), int(row["id_b"])


def _text(value: Any) -> str:
    return repr(value.tolist() if isinstance(value, np.ndarray | np.generic) else value)
