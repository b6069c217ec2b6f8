"""ObjectStateArray: the poses and twists of the objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from collision_monitor import records
from collision_monitor.codec.cdr import Buffer, Floats, Reader, Records, Writer, write_header

COVARIANCE_SIZE = 12
"""Numbers of `ObjectStateArray.covariance` for each state."""


@dataclass(frozen=True, eq=False)
class ObjectStateArray:
    """An ObjectStateArray message. states (n,) of records.STATE and covariance (0,) or (12 n,) are read-only views."""

    stamp_ns: int
    frame_id: str
    sequence: int
    states: Records
    covariance: Floats


def decode_states(data: Buffer) -> ObjectStateArray:
    """Decode an ObjectStateArray. Raises MessageError. The length of `covariance` is not checked against `states`."""
    reader = Reader(data, "ObjectStateArray")
    result = ObjectStateArray(
        stamp_ns=reader.stamp_ns(),
        frame_id=reader.string("header.frame_id"),
        sequence=reader.scalar("u4", "sequence"),
        states=reader.sequence(records.STATE, 8, "states"),
        covariance=reader.sequence("<f8", 8, "covariance"),
    )
    reader.finish()
    return result


def encode_states(
    stamp_ns: int, frame_id: str, sequence: int, states: Records, covariance: Floats | None = None
) -> bytes:
    """Encode an ObjectStateArray. Raises MessageError."""
    writer = Writer("ObjectStateArray")
    write_header(writer, stamp_ns, frame_id)
    writer.scalar("u4", sequence, "sequence")
    writer.sequence(states, records.STATE, 8)
    writer.sequence(np.empty(0) if covariance is None else covariance, "<f8", 8)
    return writer.finish()
