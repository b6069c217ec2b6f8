"""`time_of_impact`: when two moving shapes first meet, as an interval that holds the true time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, PoseError, UnsupportedError
from collision_monitor.geometry.pieces import is_planar, shape_pairs
from collision_monitor.geometry.plane import flat_pose
from collision_monitor.geometry.pose import Motion, Pose
from collision_monitor.geometry.reach import reach
from collision_monitor.geometry.shape_table import ShapeTable, ShapeTableBuilder
from collision_monitor.geometry.shapes import HalfSpace, Shape
from collision_monitor.narrow_phase.contact import Compound, Contact, contact
from collision_monitor.narrow_phase.models import Pieces, containing_model
from collision_monitor.prediction.candidates import predict_pairs
from collision_monitor.prediction.motion import Bodies, Parts, make_bodies, make_parts
from collision_monitor.prediction.time_of_impact import HIT, IMPACT, make_scratch
from collision_monitor.tolerances import TOUCHING

Array = NDArray[np.float64]

BUDGET: Final = 1000
"""Distance queries for one pair of pieces; hardly any pair needs more than 20."""

HALVINGS: Final = 80
"""Times that are tried for the parting of shapes that touch: the horizon, half of it, …: down to 1e-24 of it."""


@dataclass(frozen=True, eq=False)
class Impact:
    """When two shapes first come within the wanted separation. Times in s from the poses that were given.

    "hit": they do within [lower, upper]. "clear": they do not within the horizon; both times are infinite.
    "unresolved": not before lower; they come so near that round-off or the budget leave open whether they meet. By
    upper they have, and infinite says that they may pass. To be counted as a hit.
    contact: how they stand to each other at upper, or at lower where that is infinite; None where clear.
    """

    status: Literal["hit", "clear", "unresolved"]
    lower: float
    upper: float
    contact: Contact | None


_CLEAR: Final = Impact("clear", math.inf, math.inf, None)


def time_of_impact(
    shape_a: Compound,
    motion_a: Motion,
    shape_b: Compound,
    motion_b: Motion,
    horizon: float = 2.0,
    tolerance: float = 1e-6,
    separation: float = 0.0,
    iterations: int = BUDGET,
) -> Impact:
    """First time in [0, horizon] (s) at which two shapes or compounds are within `separation` (m) of each other.

    Both move at constant linear and angular velocity. At lower they are within `tolerance` (m) of it and not before: by
    conservative advancement along separating directions (Mirtich, 1996; van den Bergen, 2003, 4.5), in closed form for
    spheres. `iterations`: most distance queries for a pair of convex pieces.
    What overlaps at the start is a hit at 0; what only touches and then parts or slides is none.
    Raises InputError, ShapeError, PoseError; UnsupportedError for a plane shape with a solid one.
    """
    _check(horizon, tolerance, separation, iterations)
    a, b = _body(shape_a, motion_a, "A"), _body(shape_b, motion_b, "B")
    start = contact(a.shapes, a.motion.pose, b.shapes, b.motion.pose)
    scene = _scene(a, b, horizon)
    radii = scene.bodies.motion["radius"]
    round_off = TOUCHING * float(radii[np.isfinite(radii)].sum())
    if start.signed_distance < separation - round_off:
        return Impact("hit", 0.0, 0.0, start)
    event = _first(scene, 0.0, separation, tolerance, iterations)
    if event is not None and event["lower"] <= 0.0:
        # they touch: what matters is whether they go deeper
        gap = start.signed_distance - separation
        parted = _parting(a, b, radii, start.normal, gap, round_off, horizon, 2.0 * tolerance)
        if parted is not None:
            event = _first(scene, parted, separation, tolerance, iterations) if parted < horizon else None
    if event is None:
        return _CLEAR
    lower, upper = float(event["lower"]), float(event["upper"])
    certain = event["status"] == HIT and upper <= horizon
    if not certain:
        upper = math.inf
    at = upper if certain else lower
    meeting = contact(a.shapes, a.motion.at(at), b.shapes, b.motion.at(at))
    return Impact("hit" if certain else "unresolved", lower, upper, meeting)


class _Body(NamedTuple):
    """One of the two."""

    shapes: Sequence[tuple[Shape, Pose]]
    pieces: Pieces
    shape_of: list[int]
    motion: Motion


class _Scene(NamedTuple):
    """The two as the kernels of the monitor read them."""

    table: ShapeTable
    parts: Parts
    bodies: Bodies


def _check(horizon: float, tolerance: float, separation: float, iterations: int) -> None:
    for name, value, least in (("horizon", horizon, 0.0), ("separation", separation, 0.0)):
        if not (math.isfinite(value) and value >= least):
            raise InputError(f"{name}: expected a finite number, at least 0, got {value!r}")
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance: expected a finite number of metres above 0, got {tolerance!r}")
    if iterations < 1:
        raise InputError(f"iterations: expected a whole number from 1, got {iterations!r}")


def _body(shape: Compound, motion: Motion, name: str) -> _Body:
    shapes = shape_pairs(shape, f"shape {name}")
    if not isinstance(motion, Motion):
        raise PoseError(f"motion {name}: expected a Motion, got {type(motion).__name__}")
    if any(isinstance(s, HalfSpace) for s, _ in shapes) and motion.angular.any():
        raise UnsupportedError(f"shape {name}: a HalfSpace has no end and cannot turn")
    if is_planar(shapes[0][0]):
        x, y, _ = motion.linear
        motion = Motion(flat_pose(motion.pose), (x, y, 0.0), (0.0, 0.0, motion.angular[2]))
    modelled = containing_model(shapes, "exact")
    return _Body(shapes, modelled.pieces, modelled.shapes, motion)


def _scene(a: _Body, b: _Body, horizon: float) -> _Scene:
    """Two bodies with reference motions from 0 until the horizon, without tubes."""
    count = len(a.pieces) + len(b.pieces)
    builder = ShapeTableBuilder(slots=count)
    parts, bodies = make_parts(count), make_bodies(2)
    for i, body in enumerate((a, b)):
        slots = [builder.append(piece, pose) for piece, pose in body.pieces]
        bodies.first_shape[i] = slots[0]
        for k, (slot, (_, pose)) in enumerate(zip(slots, body.pieces, strict=True)):
            parts.index[slot] = body.shape_of[k]
            parts.next[slot] = slots[k + 1] if k + 1 < len(slots) else -1
            parts.placed[slot] = pose.position.any() or not np.array_equal(pose.rotation, np.eye(3))
        table = builder.table
        radius = max(float(np.linalg.norm(table.local_position[s]) + table.radius[s]) for s in slots)
        motion = bodies.motion[i]
        motion["id"], motion["radius"], motion["cover"] = i, radius, horizon
        motion["x"], motion["y"], motion["z"] = body.motion.pose.position
        motion["vx"], motion["vy"], motion["vz"] = body.motion.linear
        motion["wx"], motion["wy"], motion["wz"] = body.motion.angular
        motion["rotation"] = body.motion.pose.rotation
        # only one ball about the origin is never moved by turning
        centred = len(slots) == 1 and not parts.placed[slots[0]] and type(body.pieces[0][0]).__name__ in _ROUND
        bodies.spin_radius[i] = 0.0 if centred else radius
    return _Scene(builder.table, parts, bodies)


_ROUND: Final = ("Sphere", "Circle")


def _first(scene: _Scene, begin: float, separation: float, tolerance: float, iterations: int) -> np.void | None:
    """The first impact (IMPACT) from `begin` on, or None."""
    events = np.zeros(2, IMPACT)
    pair = np.array([[0, 1]], np.int32)
    found, _ = predict_pairs(*scene, pair, begin, separation, tolerance, iterations, events, make_scratch())
    return events[0] if found else None


def _parting(
    a: _Body, b: _Body, radii: Array, normal: Array, gap: float, round_off: float, horizon: float, apart: float
) -> float | None:
    """A time until which they do not go deeper than they are; then they are `apart` (m), or it is the horizon.

    None where that is not certain. radii (2,): of the spheres about the bodies' origins that hold them. Along the
    normal the gap is at least a concave function of time, so that in between it is above its values at both ends.
    """
    if len(a.pieces) > 1 or len(b.pieces) > 1:
        return None
    times = horizon * 0.5 ** np.arange(HALVINGS)
    least = gap + times * float(normal @ (b.motion.linear - a.motion.linear))
    for body, radius, n in ((a, radii[0], normal), (b, radii[1], -normal)):
        w = body.motion.angular
        if w.any():
            turned = n + times[:, None] * np.cross(n, w)
            least -= _support(body, turned) - _support(body, n[None]) + 0.5 * (w @ w) * radius * times**2
    clear = np.flatnonzero(least > apart)
    if len(clear):
        return float(times[clear[0]])
    return horizon if least[0] >= -round_off else None


def _support(body: _Body, directions: Array) -> Array:
    """max of d . x (n,) over the body's points x about its origin, for directions (n, 3) of any length."""
    length = np.linalg.norm(directions, axis=1)
    return np.asarray(length * reach(body.pieces, directions / length[:, None] @ body.motion.pose.rotation))
