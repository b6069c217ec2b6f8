"""PredictedCollisionArray: the collisions that are predicted after one step."""

from __future__ import annotations

from dataclasses import dataclass

from collision_monitor import records
from collision_monitor.codec.cdr import Buffer, Ids, Reader, Records, Writer, write_header


@dataclass(frozen=True, eq=False)
class PredictedCollisionArray:
    """A PredictedCollisionArray message. predictions (n,) of records.PREDICTION, a read-only view."""

    stamp_ns: int
    frame_id: str
    step: int
    horizon: float
    predictions: Records
    ids: Ids
    names: list[str]


def decode_predictions(data: Buffer) -> PredictedCollisionArray:
    """Decode a PredictedCollisionArray. Raises MessageError."""
    reader = Reader(data, "PredictedCollisionArray")
    result = PredictedCollisionArray(
        stamp_ns=reader.stamp_ns(),
        frame_id=reader.string("header.frame_id"),
        step=reader.scalar("u8", "step"),
        horizon=reader.scalar("f8", "horizon"),
        predictions=reader.sequence(records.PREDICTION, 8, "predictions"),
        ids=reader.sequence("<u4", 4, "ids"),
        names=reader.strings("names"),
    )
    reader.finish()
    return result


def encode_predictions(
    stamp_ns: int, frame_id: str, step: int, horizon: float, predictions: Records, ids: Ids, names: list[str]
) -> bytes:
    """Encode a PredictedCollisionArray. Raises MessageError."""
    writer = Writer("PredictedCollisionArray")
    write_header(writer, stamp_ns, frame_id)
    writer.scalar("u8", step, "step")
    writer.scalar("f8", horizon, "horizon")
    writer.sequence(predictions, records.PREDICTION, 8)
    writer.sequence(ids, "<u4", 4)
    writer.strings(names, "names")
    return writer.finish()
