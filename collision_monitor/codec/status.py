"""MonitorStatus: counters of what the monitor did and what it refused."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any, get_args, get_type_hints

from collision_monitor.codec.cdr import Buffer, Reader, Writer, write_header

U8 = Annotated[int, "u1"]
U32 = Annotated[int, "u4"]
U64 = Annotated[int, "u8"]
F64 = Annotated[float, "f8"]
Text = Annotated[str, "string"]


@dataclass(frozen=True)
class MonitorStatus:
    """The fields of the message in their order; the annotations are the wire types."""

    stamp_ns: int = 0
    frame_id: str = ""
    step: U64 = 0
    digest: U64 = 0
    version: Text = ""
    profile: Text = ""
    objects: U32 = 0
    objects_static: U32 = 0
    objects_unseen: U32 = 0
    objects_stale: U32 = 0
    contacts: U32 = 0
    predictions: U32 = 0
    unresolved: U32 = 0
    objects_moved: U32 = 0
    candidate_pairs: U32 = 0
    narrow_phase_tests: U32 = 0
    impact_queries: U32 = 0
    events_due: U32 = 0
    events_pending: U32 = 0
    deferred: U32 = 0
    refused_malformed: U64 = 0
    refused_frame: U64 = 0
    refused_time: U64 = 0
    refused_unknown_id: U64 = 0
    refused_non_finite: U64 = 0
    refused_quaternion: U64 = 0
    refused_old: U64 = 0
    refused_shape: U64 = 0
    last_refusal: Text = ""
    messages_lost: U64 = 0
    step_duration: F64 = float("nan")
    step_duration_p99: F64 = float("nan")
    latency: F64 = float("nan")
    rate: F64 = float("nan")
    recording: U8 = 0
    recorded_messages: U64 = 0
    recorded_bytes: U64 = 0
    recording_dropped: U64 = 0
    recording_path: Text = ""
    recording_error: Text = ""


LIVE_FIELDS = tuple(f.name for f in dataclasses.fields(MonitorStatus))[-10:]
"""The fields of `MonitorStatus` that depend on the clock and the disk; the others depend on the inputs alone."""

_WIRE = {
    name: get_args(hint)[1]
    for name, hint in get_type_hints(MonitorStatus, include_extras=True).items()
    if len(get_args(hint)) == 2
}


def decode_status(data: Buffer) -> MonitorStatus:
    """Decode a MonitorStatus. Raises MessageError."""
    reader = Reader(data, "MonitorStatus")
    values: dict[str, Any] = {"stamp_ns": reader.stamp_ns(), "frame_id": reader.string("header.frame_id")}
    for name, kind in _WIRE.items():
        values[name] = reader.string(name) if kind == "string" else reader.scalar(kind, name)
    reader.finish()
    return MonitorStatus(**values)


def encode_status(status: MonitorStatus) -> bytes:
    """Encode a MonitorStatus. Raises MessageError."""
    writer = Writer("MonitorStatus")
    write_header(writer, status.stamp_ns, status.frame_id)
    for name, kind in _WIRE.items():
        value = getattr(status, name)
        if kind == "string":
            writer.string(value, name)
        else:
            writer.scalar(kind, value, name)
    return writer.finish()
