"""ObjectTrajectoryArray: the plans of objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final

import numpy as np

from collision_monitor.codec.cdr import Buffer, Floats, Reader, Writer, write_header

LEAST: Final = 62
"""Bytes of the shortest trajectory."""


class Between(IntEnum):
    """`ObjectTrajectory.between`."""

    STRAIGHT = 0
    ARC = 1
    CURVE = 2


class Then(IntEnum):
    """`ObjectTrajectory.then`."""

    REST = 0
    GO_ON = 1


@dataclass(frozen=True, eq=False)
class ObjectTrajectory:
    """The fields of the message: times (n,), poses (m, 7), twists (k, 6), accelerations (l, 6); tolerance (4,).

    The numbers of the elements and the values of between and then are not checked.
    """

    times: Floats
    poses: Floats
    twists: Floats
    tolerance: Floats
    object_id: int
    between: int = Between.STRAIGHT
    then: int = Then.REST
    tube: float = 0.0
    accelerations: Floats = field(default_factory=lambda: np.zeros((0, 6)))


@dataclass(frozen=True, eq=False)
class ObjectTrajectoryArray:
    """An ObjectTrajectoryArray message."""

    stamp_ns: int
    frame_id: str
    trajectories: tuple[ObjectTrajectory, ...]


def decode_trajectories(data: Buffer) -> ObjectTrajectoryArray:
    """Decode an ObjectTrajectoryArray. Raises MessageError. The arrays are read-only views."""
    reader = Reader(data, "ObjectTrajectoryArray")
    stamp_ns, frame_id = reader.stamp_ns(), reader.string("header.frame_id")
    count = reader.count(LEAST, "trajectories")
    result = ObjectTrajectoryArray(stamp_ns, frame_id, tuple(_read(reader) for _ in range(count)))
    reader.finish()
    return result


def _read(reader: Reader) -> ObjectTrajectory:
    times = reader.sequence("<f8", 8, "times")
    poses, twists, accelerations = (
        reader.sequence(np.dtype(("<f8", (width,))), 8, name)
        for name, width in (("poses", 7), ("twists", 6), ("accelerations", 6))
    )
    tolerance, tube = reader.floats(4, "across"), reader.scalar("f8", "tube")
    object_id, between, then = reader.scalar("u4", "id"), reader.scalar("u1", "between"), reader.scalar("u1", "then")
    return ObjectTrajectory(times, poses, twists, tolerance, object_id, between, then, tube, accelerations)


def encode_trajectories(stamp_ns: int, frame_id: str, trajectories: Sequence[ObjectTrajectory]) -> bytes:
    """Encode an ObjectTrajectoryArray. Raises MessageError."""
    writer = Writer("ObjectTrajectoryArray")
    write_header(writer, stamp_ns, frame_id)
    writer.scalar("u4", len(trajectories), "trajectories")
    for each in trajectories:
        for array in (each.times, each.poses, each.twists, each.accelerations):
            numbers = np.ascontiguousarray(array, "<f8")
            writer.scalar("u4", len(numbers), "length")
            if numbers.size:
                writer.raw(numbers.tobytes(), 8)
        writer.raw(np.ascontiguousarray(each.tolerance, "<f8").tobytes(), 8)
        writer.scalar("f8", each.tube, "tube")
        writer.scalar("u4", each.object_id, "id")
        writer.scalar("u1", each.between, "between")
        writer.scalar("u1", each.then, "then")
    return writer.finish()
