"""An object of a query that moves, checked; and its pieces, one by one, where it touches another one at the start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import TooCostlyError, UnsupportedError
from collision_monitor.motion.stated_motion import Motion, flat_motion
from collision_monitor.motion.trajectory import Trajectory, as_motion
from collision_monitor.objects.models import containing_model
from collision_monitor.query.body import PosedShapes, QueryBody, check_in_plane, exact_body
from collision_monitor.query.points.near_points import near_points
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.planar import flat_pose
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Mesh, Points, Shape, Sphere, Triangle

MANY_FACES: Final = 100
"""Faces of a mesh from which on only those near the other object are followed one by one, and the rest as one mesh.
More: open meshes that touch take longer, 0.3 to 0.8 s with 2,000, but 0.03 to 0.4 s with 100."""

MOST_FACES: Final = 10_000
"""Most faces that are followed one by one, 1 s."""

MOST_NEAR: Final = 500
"""Most points of a cloud that touch the other object and are followed one by one, 1 ms each."""


class MovingBody(NamedTuple):
    """One of two moving objects."""

    body: QueryBody
    motion: Motion


def moving_body(shape: Compound, motion: Any, name: str) -> MovingBody:
    """Check one of the two. Motion out of the plane of plane shapes is ignored.

    Raises ShapeError, PoseError; UnsupportedError for a rotating HalfSpace, and for a Trajectory, see `planned_body`.
    """
    body, found = planned_body(shape, motion, name)
    if isinstance(found, Trajectory):
        raise UnsupportedError(f"motion {name}: expected a Motion, as a Trajectory needs conservative_advancement")
    return MovingBody(body, found)


def planned_body(shape: Compound, motion: Any, name: str) -> tuple[QueryBody, Motion | Trajectory]:
    """Check one of the two, which may follow a trajectory. Raises as `moving_body`."""
    body = exact_body(shape, f"shape {name}")
    motion = as_motion(motion, f"motion {name}")
    if any(isinstance(s, HalfSpace) for s, _ in body.shapes) and motion.angular.any():
        raise UnsupportedError(f"shape {name}: a HalfSpace has no end and cannot turn")
    if body.is_planar:
        motion = motion.flat() if isinstance(motion, Trajectory) else flat_motion(motion, flat_pose(motion.pose))
        check_in_plane(motion.pose)
    return body, motion


def check_bounded(a: QueryBody, b: QueryBody) -> None:
    """Raise UnsupportedError if both are unbounded."""
    if all(any(isinstance(shape, HalfSpace) for shape, _ in body.shapes) for body in (a, b)):
        raise UnsupportedError("two HalfSpaces: expected one at most; every other shape meets a HalfSpace")


def touching_pieces(moving: MovingBody, other: MovingBody, near: float) -> PosedShapes:
    """Pieces of an object, with the triangles of a concave mesh and the points of a cloud as pieces of their own.

    Of clouds and of large meshes only those at most `near` (m) from the other object now, which may touch it. Raises
    TooCostlyError for more than MOST_NEAR points or MOST_FACES triangles.
    """
    pieces: list[tuple[Shape, Pose]] = []
    for shape, pose in moving.body.shapes:
        if isinstance(shape, Points):
            own = _near_points(shape, moving.motion.pose @ pose, other, near)
        elif isinstance(shape, Mesh) and len(shape.faces) > MANY_FACES and is_concave_mesh(shape):
            own = _near_faces(shape, moving.motion.pose @ pose, other, near)
        else:
            pieces += containing_model([(shape, pose)], "exact").pieces
            continue
        pieces += [(part, pose @ offset) for part, offset in own]
    return pieces


def _near_points(cloud: Points, pose: Pose, other: MovingBody, near: float) -> Sequence[tuple[Shape, Pose]]:
    """Each point near the other object as a ball, and the cloud of the remaining ones."""
    is_near: NDArray[np.bool_] = near_points(cloud, pose, other.body, other.motion.pose, near)
    if np.count_nonzero(is_near) > MOST_NEAR:
        raise TooCostlyError(f"expected at most {MOST_NEAR} points that touch, got {np.count_nonzero(is_near)}")
    balls: list[tuple[Shape, Pose]] = [
        (Sphere(cloud.radius) if cloud.radius else Triangle(np.zeros((3, 3))), Pose(point))
        for point in cloud.points[is_near]
    ]
    return balls if is_near.all() else [*balls, (Points(cloud.points[~is_near], cloud.radius), Pose())]


def _near_faces(mesh: Mesh, pose: Pose, other: MovingBody, near: float) -> Sequence[tuple[Shape, Pose]]:
    """Each triangle in the box around the other object, and in front of its half-spaces; and the mesh of the others."""
    at, pieces_of_other = other.motion.pose, other.body.pieces
    normals = [own.rotation @ shape.normal for shape, own in pieces_of_other if isinstance(shape, HalfSpace)]
    own = np.concatenate([np.eye(3), -np.eye(3), np.reshape(normals, (-1, 3))])
    directions = own @ at.rotation.T
    far = reach(pieces_of_other, own) + directions @ (at.position - pose.position) + near
    is_near = np.ones(len(mesh.faces), np.bool_)
    for d, end in zip(directions @ pose.rotation, far, strict=True):
        is_near &= (mesh.vertices @ d)[mesh.faces].min(axis=1) <= end
    count = np.count_nonzero(is_near)
    if count > MOST_FACES:
        raise TooCostlyError(f"expected at most {MOST_FACES} triangles that may touch, got {count}")
    corners = mesh.vertices[mesh.faces[is_near]]
    centres = corners.mean(axis=1)
    pieces: list[tuple[Shape, Pose]] = [(Triangle(c - m), Pose(m)) for c, m in zip(corners, centres, strict=True)]
    return pieces if is_near.all() else [*pieces, (Mesh(mesh.vertices, mesh.faces[~is_near]), Pose())]
