"""ObjectDescriptionArray: the descriptions of the objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from collision_monitor.codec.cdr import Buffer, Floats, Ids, Reader, Writer, write_header
from collision_monitor.codec.shape_fields import LEAST_SHAPE, RawShape, make_shape, read_shape, write_shape
from collision_monitor.errors import InputError, ShapeError, reason_of
from collision_monitor.objects.description import MOST_SHAPES, ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere

_ADD, _REMOVE = 0, 1
_IDENTITY = Pose()
_IDENTITY_BYTES = np.concatenate([_IDENTITY.position, _IDENTITY.quaternion]).astype("<f8").tobytes()


@dataclass(frozen=True)
class Removal:
    """An ObjectDescription whose operation is REMOVE."""

    object_id: int


Change = ObjectDescription | Removal


@dataclass(frozen=True, eq=False)
class ObjectDescriptionArray:
    """The changes that are possible, in order; and the id of each refused one, with the reason.

    model_at: offset of the byte in the message that holds the model, for each of the objects.
    """

    stamp_ns: int
    frame_id: str
    snapshot: bool
    objects: tuple[Change, ...]
    refused: tuple[tuple[int, str], ...] = ()
    model_at: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Fields:
    """The fields of an ObjectDescription in the message, before they are checked."""

    object_id: int
    operation: int
    name: str
    shapes: list[RawShape]
    shape_poses: Floats
    static: bool
    pose: Floats
    group: int
    mask: int
    allowed: Ids
    padding: float
    model_at: int
    model: int
    max_linear_acceleration: float
    max_angular_acceleration: float


_POSE = ("<f8", 7)
_LEAST_DESCRIPTION = 111
"""Bytes of the smallest ObjectDescription that can be written."""


def decode_descriptions(data: Buffer) -> ObjectDescriptionArray:
    """Decode an ObjectDescriptionArray. Raises MessageError. An impossible object is only listed as refused."""
    reader = Reader(data, "ObjectDescriptionArray")
    stamp_ns, frame_id = reader.stamp_ns(), reader.string("header.frame_id")
    snapshot = reader.boolean("snapshot")
    raw = [_read_description(reader) for _ in range(reader.count(_LEAST_DESCRIPTION, "objects"))]
    reader.finish()

    objects: list[Change] = []
    refused: list[tuple[int, str]] = []
    model_at: list[int] = []
    for each in raw:
        try:
            objects.append(_change(each))
            model_at.append(each.model_at)
        except Exception as error:  # see `reason_of`
            what = f"object {each.object_id}"
            text = reason_of(error)
            refused.append((each.object_id, text if text.startswith(what) else f"{what}: {text}"))
    return ObjectDescriptionArray(stamp_ns, frame_id, snapshot, tuple(objects), tuple(refused), tuple(model_at))


def _read_description(reader: Reader) -> _Fields:
    return _Fields(
        object_id=reader.scalar("u4", "id"),
        operation=reader.scalar("u1", "operation"),
        name=reader.string("name"),
        shapes=[read_shape(reader) for _ in range(reader.count(LEAST_SHAPE, "shapes"))],
        shape_poses=reader.sequence(_POSE, 8, "shape_poses"),
        static=reader.boolean("is_static"),
        pose=reader.floats(7, "pose"),
        group=reader.scalar("u4", "group"),
        mask=reader.scalar("u4", "mask"),
        allowed=reader.sequence("<u4", 4, "allowed"),
        padding=reader.scalar("f8", "padding"),
        model_at=reader.at,
        model=reader.scalar("u1", "model"),
        max_linear_acceleration=reader.scalar("f8", "max_linear_acceleration"),
        max_angular_acceleration=reader.scalar("f8", "max_angular_acceleration"),
    )


def _change(it: _Fields) -> Change:
    """Return the change that the fields describe. Raises ShapeError, PoseError or InputError."""
    if it.operation == _REMOVE:
        return Removal(it.object_id)
    if it.operation != _ADD:
        raise InputError(f"operation: expected 0 (ADD) or 1 (REMOVE), got {it.operation}")
    if len(it.shapes) > MOST_SHAPES:  # before they are made
        raise ShapeError(f"shapes: expected at most {MOST_SHAPES}, got {len(it.shapes)}; use a Mesh or a hull")
    if len(it.shape_poses) not in (0, len(it.shapes)):
        raise ShapeError(f"shape_poses: expected none or {len(it.shapes)}, as shapes, got {len(it.shape_poses)}")
    poses = [_pose(row) for row in it.shape_poses] or [_IDENTITY] * len(it.shapes)
    return ObjectDescription(
        object_id=it.object_id,
        shapes=[(make_shape(shape), pose) for shape, pose in zip(it.shapes, poses, strict=True)],
        name=it.name,
        static=it.static,
        pose=_pose(it.pose) if it.static else None,
        group=it.group,
        mask=it.mask,
        allowed=tuple(it.allowed.tolist()),
        padding=it.padding,
        model=it.model,  # type: ignore[arg-type]  # ObjectDescription checks it
        max_linear_acceleration=it.max_linear_acceleration,
        max_angular_acceleration=it.max_angular_acceleration,
    )


def _pose(row: Floats) -> Pose:
    if row.tobytes() == _IDENTITY_BYTES:  # most shapes lie in their object's origin and share this pose
        return _IDENTITY
    return Pose(row[:3], row[3:])


def encode_descriptions(stamp_ns: int, frame_id: str, objects: Sequence[Change], *, snapshot: bool = False) -> bytes:
    """Encode an ObjectDescriptionArray. Raises MessageError."""
    writer = Writer("ObjectDescriptionArray")
    write_header(writer, stamp_ns, frame_id)
    writer.scalar("u1", snapshot, "snapshot")
    writer.scalar("u4", len(objects), "objects")
    for each in objects:
        if isinstance(each, Removal):
            it = ObjectDescription(each.object_id, Sphere(1.0))  # receivers read only its id
            _write_description(writer, it, _REMOVE)
        else:
            _write_description(writer, each, _ADD)
    return writer.finish()


def _write_description(writer: Writer, it: ObjectDescription, operation: int) -> None:
    writer.scalar("u4", it.object_id, "id")
    writer.scalar("u1", operation, "operation")
    writer.string(it.name, "name")
    writer.scalar("u4", len(it.shapes), "shapes")
    for shape, _ in it.shapes:
        write_shape(writer, shape)
    writer.scalar("u4", len(it.shapes), "shape_poses")
    for _, pose in it.shapes:
        _write_pose(writer, pose)
    writer.scalar("u1", it.static, "is_static")
    _write_pose(writer, it.pose or Pose())
    writer.scalar("u4", it.group, "group")
    writer.scalar("u4", it.mask, "mask")
    writer.sequence(np.array(it.allowed, dtype="<u4"), "<u4", 4)
    writer.scalar("f8", it.padding, "padding")
    writer.scalar("u1", it.model, "model")
    writer.scalar("f8", it.max_linear_acceleration, "max_linear_acceleration")
    writer.scalar("f8", it.max_angular_acceleration, "max_angular_acceleration")


def _write_pose(writer: Writer, pose: Pose) -> None:
    writer.raw(np.concatenate([pose.position, pose.quaternion]).astype("<f8").tobytes(), 8)
