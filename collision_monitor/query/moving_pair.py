"""Two moving compounds as the kernels of the monitor read them, and their first impact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import PoseError, UnsupportedError
from collision_monitor.geometry.pieces import is_planar, shape_pairs
from collision_monitor.geometry.plane import flat_pose
from collision_monitor.geometry.pose import Motion, Pose
from collision_monitor.geometry.shape_table import CIRCLE, SPHERE, ShapeTable, ShapeTableBuilder
from collision_monitor.geometry.shapes import HalfSpace, Shape
from collision_monitor.objects.models import Pieces, containing_model
from collision_monitor.prediction.body_impact import make_scratch
from collision_monitor.prediction.impact_record import IMPACT
from collision_monitor.prediction.motion import Bodies, Parts, make_bodies, make_parts
from collision_monitor.prediction.pairs import predict_pairs
from collision_monitor.query.contact import Compound


class ImpactQuery(NamedTuple):
    """What is asked for: horizon (s), tolerance (m), separation (m), most distance queries for a pair of pieces."""

    horizon: float
    tolerance: float
    separation: float
    iterations: int


class MovingShape(NamedTuple):
    """One of the two: its shapes, and the convex pieces that they are tested as, with poses in its frame."""

    shapes: Sequence[tuple[Shape, Pose]]
    pieces: Pieces
    shape_of: list[int]
    motion: Motion


class Multibody(NamedTuple):
    """Bodies as the kernels read them: the table of their shapes, how these make up bodies, and the bodies."""

    table: ShapeTable
    parts: Parts
    bodies: Bodies


def make_moving_shape(shape: Compound, motion: Motion, name: str) -> MovingShape:
    """Check one of the two; in the plane, motions out of it are left out. Raises ShapeError, PoseError."""
    shapes = shape_pairs(shape, f"shape {name}")
    if not isinstance(motion, Motion):
        raise PoseError(f"motion {name}: expected a Motion, got {type(motion).__name__}")
    if any(isinstance(s, HalfSpace) for s, _ in shapes) and motion.angular.any():
        raise UnsupportedError(f"shape {name}: a HalfSpace has no end and cannot turn")
    if is_planar(shapes[0][0]):
        x, y, _ = motion.linear
        level = (*motion.acceleration[:2], 0.0)
        motion = Motion(flat_pose(motion.pose), (x, y, 0.0), (0.0, 0.0, motion.angular[2]), level)
    modelled = containing_model(shapes, "exact")
    return MovingShape(shapes, modelled.pieces, modelled.shapes, motion)


def lay_out_pair(a: MovingShape, b: MovingShape, horizon: float, apart: bool = False) -> Multibody:
    """The two with reference motions from 0 until the horizon; `apart`: each piece as a body of its own.

    The pieces of A stand first in the table, then those of B.
    """
    count = len(a.pieces) + len(b.pieces)
    builder = ShapeTableBuilder(slots=count)
    slots = [[builder.append(piece, pose) for piece, pose in shape.pieces] for shape in (a, b)]
    multibody = Multibody(builder.table, make_parts(count), make_bodies(count if apart else 2))
    parts = multibody.parts
    k = 0
    for moving, own in zip((a, b), slots, strict=True):
        for slot, shape, (_, pose) in zip(own, moving.shape_of, moving.pieces, strict=True):
            parts.index[slot] = shape
            parts.placed[slot] = pose.position.any() or not np.array_equal(pose.rotation, np.eye(3))
        for chain in [[slot] for slot in own] if apart else [own]:
            parts.next[chain[:-1]] = chain[1:]
            _lay_out_body(multibody, k, chain, moving.motion, horizon)
            k += 1
    return multibody


def _lay_out_body(multibody: Multibody, k: int, slots: list[int], motion: Motion, horizon: float) -> None:
    table, parts, bodies = multibody
    bodies.first_shape[k] = slots[0]
    radius = float((np.linalg.norm(table.local_position[slots], axis=1) + table.radius[slots]).max())
    bodies.id[k] = k
    reference = bodies.motion[k]
    reference["radius"], reference["cover"] = radius, horizon
    reference["x"], reference["y"], reference["z"] = motion.pose.position
    reference["vx"], reference["vy"], reference["vz"] = motion.linear
    reference["ax"], reference["ay"], reference["az"] = motion.acceleration
    reference["wx"], reference["wy"], reference["wz"] = motion.angular
    reference["rotation"] = motion.pose.rotation
    # only one ball about the origin is never moved by turning
    centred = len(slots) == 1 and not parts.placed[slots[0]] and table.kind[slots[0]] in (SPHERE, CIRCLE)
    bodies.spin_radius[k] = 0.0 if centred else radius


def first_impacts(
    multibody: Multibody, pairs: NDArray[np.int32], begin: float, query: ImpactQuery, separation: float | None = None
) -> NDArray[np.void]:
    """First impacts (IMPACT) of the pairs (P, 2) of bodies from `begin` on; pairs without one are left out.

    separation (m): in place of the query's; below 0 for overlaps of a depth.
    """
    events = np.zeros(len(pairs) + 1, IMPACT)
    wanted = query.separation if separation is None else separation
    tolerance, iterations = query.tolerance, query.iterations
    found, _ = predict_pairs(*multibody, pairs, begin, wanted, tolerance, iterations, events, make_scratch())
    return events[:found]
