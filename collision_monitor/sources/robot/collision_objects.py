"""moveit_msgs/CollisionObject: shapes and poses of the objects of a planning scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape
from collision_monitor.sources.ground.frames import frame_name
from collision_monitor.sources.ground.solid_shapes import mesh_shape, plane_shape, primitive_shapes

ADD, REMOVE, APPEND, MOVE = 0, 1, 2, 3

Parts = tuple[tuple[Shape, Pose], ...]

_MOST_PARTS: Final = 10_000
"""Shapes of one object."""


@dataclass(frozen=True, eq=False)
class CollisionObject:
    """An object of a planning scene: shapes in its own frame, and its pose in `frame`, a frame of tf or a link."""

    name: str
    shapes: Parts
    frame: str
    pose: Pose

    @cached_property
    def fingerprint(self) -> Any:
        """Equal for two objects with the same shapes, poses and frame."""
        return self.name, self.frame, pose_bytes(self.pose), shape_bytes(self.shapes)


def shape_bytes(shapes: Parts) -> Any:
    """Return what is equal for equal shapes at equal poses."""
    return [(type(shape), *map(_bytes, vars(shape).values()), *pose_bytes(at)) for shape, at in shapes]


def pose_bytes(pose: Pose) -> tuple[bytes, bytes]:
    """Return what is equal for equal poses."""
    return pose.position.tobytes(), pose.quaternion.tobytes()


def _bytes(value: Any) -> Any:
    return value.tobytes() if isinstance(value, np.ndarray) else value


def operation_of(message: Any) -> int:
    """Return the operation of a CollisionObject. Raises InputError."""
    given = message.operation
    operation = given[0] if isinstance(given, bytes) else int(given)
    if operation not in (ADD, REMOVE, APPEND, MOVE):
        raise InputError(f"operation: expected 0 (ADD) to 3 (MOVE), got {operation}")
    return int(operation)


def collision_object(message: Any, before: CollisionObject | None = None) -> CollisionObject:
    """Return the object after a CollisionObject of ADD, APPEND or MOVE. before: as it was.

    MOVE keeps the shapes, and takes their poses from the message if it has some.

    Raises InputError, ShapeError, PoseError.
    """
    operation = operation_of(message)
    shapes = tuple(_shapes(message))
    if operation in (APPEND, MOVE) and before is None:
        raise InputError("expected an object that was added before")
    if operation == APPEND and before is not None:
        if len(before.shapes) + len(shapes) > _MOST_PARTS:
            raise InputError(f"expected at most {_MOST_PARTS} shapes, got more")
        return CollisionObject(before.name, (*before.shapes, *shapes), before.frame, before.pose)
    pose = _pose(message.pose)
    if operation == MOVE and before is not None:
        moved = [*message.primitive_poses, *message.mesh_poses, *message.plane_poses]
        if moved and len(moved) != len(before.shapes):
            raise InputError(f"expected poses of {len(before.shapes)} shapes, got {len(moved)}")
        places = map(_pose, moved) if moved else (place for _, place in before.shapes)
        shapes = tuple((shape, place) for (shape, _), place in zip(before.shapes, places, strict=True))
    return CollisionObject(str(message.id), shapes, frame_name(message.header.frame_id), pose)


def _shapes(message: Any) -> Iterator[tuple[Shape, Pose]]:
    kinds = (
        (message.primitives, message.primitive_poses, primitive_shapes),
        (message.meshes, message.mesh_poses, lambda mesh: [mesh_shape(mesh)]),
        (message.planes, message.plane_poses, lambda plane: [plane_shape(plane)]),
    )
    if sum(len(solids) for solids, _, _ in kinds) > _MOST_PARTS:
        raise InputError(f"expected at most {_MOST_PARTS} shapes, got more")
    for solids, poses, make in kinds:
        if solids and len(poses) not in (0, len(solids)):
            raise InputError(f"expected a pose of each of {len(solids)} shapes, got {len(poses)}")
        for k, solid in enumerate(solids):
            place = _pose(poses[k]) if len(poses) else Pose()
            yield from ((shape, place) for shape in make(solid))


def _pose(message: Any) -> Pose:
    """Return the pose of a geometry_msgs/Pose. As in MoveIt, a quaternion of zeros is none."""
    p, q = message.position, message.orientation
    quaternion = np.array([q.x, q.y, q.z, q.w])
    return Pose((p.x, p.y, p.z), quaternion if quaternion.any() else (0.0, 0.0, 0.0, 1.0))
