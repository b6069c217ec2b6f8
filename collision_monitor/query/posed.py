"""An object at its pose: its shapes, or the model that represents it, and its convex pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import PoseError
from collision_monitor.objects.models import containing_kdop, containing_model, parse_model
from collision_monitor.query.arguments import checked_pose
from collision_monitor.query.piece_table import PieceTable, exact_piece_table, piece_table
from collision_monitor.records import Model
from collision_monitor.shapes.compound import Compound, shape_pairs
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Mesh, Points, Shape
from collision_monitor.tolerances import UNIT_QUATERNION

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Posed:
    """One of the two objects at its pose. outline: shapes that reach as far as its pieces."""

    shapes: Sequence[tuple[Shape, Pose]]
    pose: Pose
    outline: Sequence[tuple[Shape, Pose]]
    model: Model = Model.EXACT
    excess: float = 0.0

    @property
    def rotation(self) -> Array:
        """That of the pose, (3, 3)."""
        return self.pose.rotation

    @cached_property
    def pieces(self) -> PieceTable:
        """Convex pieces that represent it."""
        return exact_piece_table(self.shapes) if self.model is Model.EXACT else piece_table(self.outline)

    @cached_property
    def is_uncertain(self) -> bool:
        """Whether it has a mesh with an uncertain inside (`Surface.certain`)."""
        meshes = [shape for shape, _ in self.shapes if isinstance(shape, Mesh)] if self.model is Model.EXACT else []
        return not all(mesh.surface.certain for mesh in meshes)

    @cached_property
    def is_concave(self) -> bool:
        """Whether it has several pieces."""
        several = len(self.outline) > 1 or isinstance(self.outline[0][0], Points)
        return several or any(is_concave_mesh(shape) for shape, _ in self.outline) or len(self.pieces) > 1

    @property
    def inner(self) -> Array:
        """Points (n, 3) of its pieces, at least one of each connected part, in its frame (m)."""
        clouds = [
            shape.points @ pose.rotation.T + pose.position for shape, pose in self.shapes if isinstance(shape, Points)
        ]
        others = [pair for pair in self.shapes if not isinstance(pair[0], Points)]
        if not clouds:
            return self.pieces.inner
        return np.concatenate(clouds + ([exact_piece_table(others).inner] if others else []))


def posed(shape: Compound, pose: Pose, model: Model | str | ArrayLike, name: str) -> Posed:
    """Return an object, represented by a model. name: of its arguments, for errors. Raises as `contact` does."""
    shapes = shape_pairs(shape, f"shape {name}")
    checked_pose(pose, f"pose {name}")
    if isinstance(model, str | int):
        if parse_model(model) in (Model.AUTO, Model.EXACT):
            return Posed(shapes, pose, shapes)
        modelled = containing_model(shapes, model)
    else:
        modelled = containing_kdop(shapes, model)
    return Posed(shapes, pose, modelled.pieces, modelled.model, modelled.excess)


def check_side_in_plane(side: Posed) -> None:
    """Check that an object of the x-y plane lies in it. Raises PoseError."""
    if abs(side.pose.rotation[2, 2]) < 1.0 - UNIT_QUATERNION or side.pose.rotation[2, 2] < 0.0:
        raise PoseError(f"expected a turn about z for a shape of the plane, got the quaternion {side.pose.quaternion}")


def pose_in_world(side: Posed) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,), about the object's origin, of its only shape, in world axes."""
    own = side.outline[0][1]
    if own.quaternion[3] == 1.0 and not own.position.any():
        return side.rotation, np.zeros(3)
    return side.rotation @ own.rotation, side.rotation @ own.position
