"""rcl_interfaces/ParameterEvent: changed parameters of a node and their values. Sessions hold new settings in it.

It is written only with the kinds of values that settings have: bool, integer, double, string and an array of doubles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from collision_monitor.codec.cdr import Buffer, Reader, Writer

_BOOL, _INTEGER, _DOUBLE, _STRING, _DOUBLE_ARRAY = 1, 2, 3, 4, 8
"""rcl_interfaces/ParameterType."""

_KINDS: Final = {bool: _BOOL, int: _INTEGER, float: _DOUBLE, str: _STRING, list: _DOUBLE_ARRAY, tuple: _DOUBLE_ARRAY}

_SHORTEST: Final = 40
"""Bytes of the shortest parameter."""


@dataclass(frozen=True)
class ParameterEvent:
    """A ParameterEvent message.

    changed: the parameters that have a new value, by name, in order. New and deleted ones are left out.
    """

    stamp_ns: int
    node: str
    changed: dict[str, Any]


def encode_parameter_event(stamp_ns: int, node: str, changed: Mapping[str, Any]) -> bytes:
    """Encode a ParameterEvent. Raises MessageError for a value of another kind."""
    writer = Writer("ParameterEvent")
    writer.stamp_ns(stamp_ns)
    writer.string(node, "node")
    for parameters in ({}, changed, {}):
        writer.scalar("u4", len(parameters), "length")
        for name, value in parameters.items():
            writer.string(name, "name")
            _write_value(writer, name, value)
    return writer.finish()


def _write_value(writer: Writer, name: str, value: Any) -> None:
    """Write a ParameterValue: the kind, then one field for each kind. Readers use only the field of the kind."""
    kind = _KINDS.get(type(value))
    if kind is None:
        raise writer.error(f"{name}: expected one of {', '.join(k.__name__ for k in _KINDS)}, got {value!r}")
    writer.scalar("u1", kind, name)
    writer.scalar("u1", value if kind == _BOOL else 0, name)
    writer.scalar("i8", value if kind == _INTEGER else 0, name)
    writer.scalar("f8", value if kind == _DOUBLE else 0.0, name)
    writer.string(value if kind == _STRING else "", name)
    for _ in ("byte_array", "bool_array", "integer_array"):
        writer.scalar("u4", 0, name)
    writer.sequence(np.array(value if kind == _DOUBLE_ARRAY else [], "<f8"), "<f8", 8)
    writer.scalar("u4", 0, name)


def decode_parameter_event(data: Buffer) -> ParameterEvent:
    """Decode a ParameterEvent. Raises MessageError."""
    reader = Reader(data, "ParameterEvent")
    stamp_ns, node = reader.stamp_ns(), reader.string("node")
    lists = []
    for what in ("new_parameters", "changed_parameters", "deleted_parameters"):
        count = reader.count(_SHORTEST, what)
        lists.append({reader.string("name"): _read_value(reader) for _ in range(count)})
    reader.finish()
    return ParameterEvent(stamp_ns, node, lists[1])


def _read_value(reader: Reader) -> Any:
    kind = reader.scalar("u1", "type")
    values: list[Any] = [  # by kind, in the order of the fields
        None,
        reader.boolean("bool_value"),
        reader.scalar("i8", "integer_value"),
        reader.scalar("f8", "double_value"),
        reader.string("string_value"),
        reader.sequence("u1", 1, "byte_array_value").tolist(),
        reader.sequence("u1", 1, "bool_array_value").tolist(),
        reader.sequence("<i8", 8, "integer_array_value").tolist(),
        reader.sequence("<f8", 8, "double_array_value").tolist(),
        reader.strings("string_array_value"),
    ]
    if kind >= len(values):
        raise reader.error(f"type: expected 0 to {len(values) - 1}, got {kind}")
    return values[kind]
