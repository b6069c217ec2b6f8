"""moveit_msgs/CollisionObject: shapes and poses of the objects of a planning scene."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape
from collision_monitor.sources.ground.frames import LONGEST_FRAME_NAME, frame_name
from collision_monitor.sources.ground.solid_shapes import mesh_shape, plane_shape, primitive_shapes
from collision_monitor.sources.ground.tracks import LONGEST_KEY

ADD, REMOVE, APPEND, MOVE = 0, 1, 2, 3

Parts = tuple[tuple[Shape, Pose], ...]

_MOST_PARTS: Final = 1024
"""Shapes of one object, as in `ObjectDescription`."""


@dataclass(frozen=True, eq=False)
class CollisionObject:
    """An object of a planning scene: shapes in its own frame, and its pose in `frame`, a frame of tf or a link."""

    name: str
    shapes: Parts
    frame: str
    pose: Pose

    @cached_property
    def shape_digest(self) -> bytes:
        """Equal for two objects with the same shapes at the same poses."""
        return shape_digest(self.shapes)

    @property
    def fingerprint(self) -> Any:
        """Equal for two objects with the same shapes, poses and frame."""
        return self.name, self.frame, pose_bytes(self.pose), self.shape_digest


def shape_digest(shapes: Parts) -> bytes:
    """Return what is equal for equal shapes at equal poses."""
    digest = hashlib.blake2b(digest_size=16)
    for shape, at in shapes:
        digest.update(type(shape).__name__.encode())
        for value in shape.__getstate__().values():
            digest.update(np.ascontiguousarray(value).tobytes())
        digest.update(at.position.tobytes() + at.quaternion.tobytes())
    return digest.digest()


def pose_bytes(pose: Pose) -> tuple[bytes, bytes]:
    """Return what is equal for equal poses."""
    return pose.position.tobytes(), pose.quaternion.tobytes()


def operation_of(message: Any) -> int:
    """Return the operation of a CollisionObject. Raises InputError."""
    given = message.operation
    operation = given[0] if isinstance(given, bytes) else int(given)
    if operation not in (ADD, REMOVE, APPEND, MOVE):
        raise InputError(f"operation: expected 0 (ADD) to 3 (MOVE), got {operation}")
    return int(operation)


def collision_object(message: Any, before: CollisionObject | None = None) -> CollisionObject:
    """Return the object after a CollisionObject of ADD, APPEND or MOVE. before: as it was.

    APPEND to an object that is not there adds it. MOVE keeps the shapes, and takes their poses from the message if it
    has some. Source: MoveIt, planning_scene.cpp, processCollisionObjectAdd and processCollisionObjectMove.

    Raises InputError, ShapeError, PoseError.
    """
    operation = operation_of(message)
    if operation == MOVE:
        if before is None:
            raise InputError("expected an object that was added before")
        moved = [*message.primitive_poses, *message.mesh_poses, *message.plane_poses]
        if moved and len(moved) != len(before.shapes):
            raise InputError(f"expected poses of {len(before.shapes)} shapes, got {len(moved)}")
        places = map(message_pose, moved) if moved else (place for _, place in before.shapes)
        shapes = tuple((shape, place) for (shape, _), place in zip(before.shapes, places, strict=True))
        return CollisionObject(before.name, shapes, _frame(message), message_pose(message.pose))
    shapes = _solids(message)
    if not shapes:
        raise InputError("expected at least one shape, got none")
    if operation == APPEND and before is not None:
        if len(before.shapes) + len(shapes) > _MOST_PARTS:
            raise InputError(f"expected at most {_MOST_PARTS} shapes, got more")
        return CollisionObject(before.name, (*before.shapes, *shapes), before.frame, before.pose)
    if len(message.id) > LONGEST_KEY:
        raise InputError(f"id: expected at most {LONGEST_KEY} characters, got {len(message.id)}")
    return CollisionObject(str(message.id), shapes, _frame(message), message_pose(message.pose))


def _frame(message: Any) -> str:
    """Return the frame of a CollisionObject. Raises InputError."""
    name = frame_name(message.header.frame_id)
    if len(name) > LONGEST_FRAME_NAME:
        raise InputError(f"frame_id: expected at most {LONGEST_FRAME_NAME} characters, got {len(name)}")
    return name


def with_solids(message: Any) -> Any:
    """Return a CollisionObject or a PlanningScene with the shapes of its objects made: what takes long in a message."""
    objects = [message] if not hasattr(message, "world") else message.world.collision_objects
    attached = [] if objects == [message] else message.robot_state.attached_collision_objects
    for each in (*objects, *(it.object for it in attached)):
        try:
            each.solids = tuple(_shapes(each))
        except Exception as error:  # raised again where the object is guarded
            each.solids = error
    return message


def _solids(message: Any) -> Parts:
    found = getattr(message, "solids", None)
    if isinstance(found, Exception):
        raise found
    return tuple(_shapes(message)) if found is None else found


def has_pose(message: Any) -> bool:
    """Whether a geometry_msgs/Pose says something: it is not that of a new message."""
    p, q = message.position, message.orientation
    return any((p.x, p.y, p.z, q.x, q.y, q.z)) or q.w not in (0.0, 1.0)


def _shapes(message: Any) -> Iterator[tuple[Shape, Pose]]:
    kinds = (
        (message.primitives, message.primitive_poses, primitive_shapes),
        (message.meshes, message.mesh_poses, lambda mesh: [mesh_shape(mesh)]),
        (message.planes, message.plane_poses, lambda plane: [plane_shape(plane)]),
    )
    if sum(len(solids) for solids, _, _ in kinds) > _MOST_PARTS:
        raise InputError(f"expected at most {_MOST_PARTS} shapes, got more")
    for solids, poses, make in kinds:
        if len(poses) > len(solids):
            raise InputError(f"expected a pose of each of {len(solids)} shapes, got {len(poses)}")
        for k, solid in enumerate(solids):
            place = message_pose(poses[k]) if k < len(poses) else Pose()  # as in MoveIt
            yield from ((shape, place) for shape in make(solid))


def message_pose(message: Any) -> Pose:
    """Return the pose of a geometry_msgs/Pose. As in MoveIt, a quaternion of zeros is none, and others have no length.

    Source: MoveIt, planning_scene.cpp, poseMsgToEigen.
    """
    p, q = message.position, message.orientation
    quaternion = np.array([q.x, q.y, q.z, q.w])
    largest = float(np.abs(quaternion).max())  # divided by first, so that no square is too large or too small
    if largest == 0.0:
        return Pose((p.x, p.y, p.z))
    if largest < np.inf:
        quaternion = quaternion / largest
        quaternion /= np.linalg.norm(quaternion)
    return Pose((p.x, p.y, p.z), quaternion)
