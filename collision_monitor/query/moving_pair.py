"""Two moving compounds as the kernels of the monitor read them, and their first impact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import PoseError, UnsupportedError
from collision_monitor.geometry.compound import shape_pairs
from collision_monitor.geometry.planar import flat_pose, is_planar
from collision_monitor.geometry.pose import Motion, Pose
from collision_monitor.geometry.shape_table import CIRCLE, SPHERE, ShapeTable, ShapeTableBuilder
from collision_monitor.geometry.shapes import HalfSpace, Shape
from collision_monitor.objects.models import PosedShapes, containing_model
from collision_monitor.prediction.bodies import Bodies, Multibody, Parts, make_bodies, make_parts
from collision_monitor.prediction.body_impact import ImpactQuery, make_scratch
from collision_monitor.prediction.impact_record import IMPACT
from collision_monitor.prediction.pair_impacts import predict_pairs
from collision_monitor.query.contact import Compound


class Query(NamedTuple):
    """What is asked for: horizon (s), tolerance (m), separation (m), most distance queries for a pair of pieces."""

    horizon: float
    tolerance: float
    separation: float
    budget: int


class Body(NamedTuple):
    """One of the two: its shapes, and the convex pieces that they are tested as, with poses in its frame."""

    shapes: Sequence[tuple[Shape, Pose]]
    pieces: PosedShapes
    shape_of: list[int]
    motion: Motion


class Scene(NamedTuple):
    """The two as the kernels read them; the pieces of A stand first in the table, then those of B."""

    table: ShapeTable
    parts: Parts
    bodies: Bodies


def make_body(shape: Compound, motion: Motion, name: str) -> Body:
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
    return Body(shapes, modelled.pieces, modelled.shapes, motion)


def make_scene(a: Body, b: Body, horizon: float, apart: bool = False) -> Scene:
    """The two with reference motions from 0 until the horizon; `apart`: each piece as a body of its own."""
    count = len(a.pieces) + len(b.pieces)
    builder = ShapeTableBuilder(slots=count)
    parts, bodies = make_parts(count), make_bodies(count if apart else 2)
    k = 0
    for body in (a, b):
        slots = [builder.append(piece, pose) for piece, pose in body.pieces]
        for slot, shape, (_, pose) in zip(slots, body.shape_of, body.pieces, strict=True):
            parts.index[slot] = shape
            parts.placed[slot] = pose.position.any() or not np.array_equal(pose.rotation, np.eye(3))
        chains = [[slot] for slot in slots] if apart else [slots]
        for chain in chains:
            parts.next[chain[:-1]] = chain[1:]
            _set_motion(bodies, k, body, chain, builder.table, parts, horizon)
            k += 1
    return Scene(builder.table, parts, bodies)


def _set_motion(
    bodies: Bodies, k: int, body: Body, slots: list[int], table: ShapeTable, parts: Parts, horizon: float
) -> None:
    bodies.first_shape[k] = slots[0]
    radius = float((np.linalg.norm(table.local_position[slots], axis=1) + table.radius[slots]).max())
    bodies.id[k] = k
    motion = bodies.motion[k]
    motion["radius"], motion["cover"] = radius, horizon
    motion["x"], motion["y"], motion["z"] = body.motion.pose.position
    motion["vx"], motion["vy"], motion["vz"] = body.motion.linear
    motion["ax"], motion["ay"], motion["az"] = body.motion.acceleration
    motion["wx"], motion["wy"], motion["wz"] = body.motion.angular
    motion["rotation"] = body.motion.pose.rotation
    # only one ball about the origin is never moved by turning
    centred = len(slots) == 1 and not parts.placed[slots[0]] and table.kind[slots[0]] in (SPHERE, CIRCLE)
    bodies.spin_radius[k] = 0.0 if centred else radius


def first_impacts(
    scene: Scene, pairs: NDArray[np.int32], begin: float, query: Query, separation: float | None = None
) -> NDArray[np.void]:
    """First impacts (IMPACT) of the pairs (P, 2) of bodies from `begin` on; pairs without one are left out.

    separation (m): in place of the query's; below 0 for overlaps of a depth.
    """
    events = np.zeros(len(pairs) + 1, IMPACT)
    wanted = query.separation if separation is None else separation
    search = ImpactQuery(wanted, query.tolerance, query.budget)
    found, _ = predict_pairs(Multibody(*scene), pairs, begin, search, events, make_scratch())
    return events[:found]
