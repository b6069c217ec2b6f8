"""A fleet: objects with their plans, and the static world, checked, and as the kernels read them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.motion.stated_motion import NUMBERS, Motion
from collision_monitor.motion.trajectory import Trajectory, known_until
from collision_monitor.query.body import QueryBody
from collision_monitor.query.contact.contact import check_kinds
from collision_monitor.query.impact.contact_intervals import arm_of
from collision_monitor.query.impact.moving_body import planned_body
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Pose, as_pose
from collision_monitor.shapes.reach import reach

Array = NDArray[np.float64]
Name = Hashable

MOST_BODIES: Final = 100_000
"""Objects with plans and static ones together."""

_AXES: Final = np.concatenate([np.eye(3), -np.eye(3)])


class FleetPieces(NamedTuple):
    """The motions of N bodies in pieces, those of a body one after the other. SI units, world axes."""

    numbers: Any  # (P, NUMBERS): the motion of each piece from its begin on
    begins: Any  # (P,): s
    tubes: Any  # (P,): m by which the body may be off each piece
    first: Any  # (N + 1,) int64: index of the first piece of each body
    until: Any  # (N,): s from which on its motion is unknown; infinite: never
    chain: Any  # (N,) int32: its first slot in the library
    radius: Any  # (N,): m about its origin; infinite for a half-space
    arm: Any  # (N,): the same; 0 for a half-space


@dataclass(frozen=True, eq=False)
class PlannedFleet:
    """Objects with plans, and after them the static ones."""

    names: Sequence[Name]
    bodies: Sequence[QueryBody]
    motions: Sequence[Motion | Trajectory]
    moving: int
    pieces: FleetPieces

    def __len__(self) -> int:
        return len(self.names)

    @property
    def ends(self) -> Array:
        """Last time (s) of each plan; -inf for a Motion, which has none."""
        plans = self.motions[: self.moving]
        return np.array([each.times[-1] if isinstance(each, Trajectory) else -inf for each in plans], np.float64)

    def standing_boxes(self) -> tuple[Array, Array]:
        """Centres and half extents (S, 3) in m of the static bodies; infinite along what has no end."""
        boxes = np.zeros((2, len(self) - self.moving, 3))
        for k, (body, motion) in enumerate(zip(self.bodies[self.moving :], self.motions[self.moving :], strict=True)):
            far = reach([(shape, motion.pose @ at) for shape, at in body.pieces], _AXES)
            low, high = -far[3:], far[:3]
            is_bounded = np.isfinite(low) & np.isfinite(high)
            boxes[0, k, is_bounded] = 0.5 * (low[is_bounded] + high[is_bounded])
            boxes[1, k] = inf
            boxes[1, k, is_bounded] = 0.5 * (high[is_bounded] - low[is_bounded])
        return boxes[0], boxes[1]


def make_fleet(objects: Any, trajectories: Any, static: Any) -> PlannedFleet:
    """Check the objects, their plans and the static world. Raises InputError, ShapeError, PoseError, UnsupportedError.

    The arguments are those of `conflicts`.
    """
    shapes, plans, world = _named(objects, "objects"), _named(trajectories, "trajectories"), _named(static, "static")
    for missing, what in ((shapes.keys() - plans.keys(), "trajectory"), (plans.keys() - shapes.keys(), "shape")):
        if missing:
            raise InputError(f"objects, trajectories: expected a {what} for each object, got none for {_some(missing)}")
    if isinstance(static, Mapping):
        if both := world.keys() & shapes.keys():
            raise InputError(f"static: expected names that no object has, got {_some(both)}")
    else:
        world = {f"static {k}": each for k, each in world.items()}
    if (count := len(shapes) + len(world)) > MOST_BODIES:
        raise InputError(f"objects: expected at most {MOST_BODIES} with the static ones, got {count}")
    placed = {name: _placed(each, name) for name, each in world.items()}
    given = {**{name: (shape, plans[name]) for name, shape in shapes.items()}, **placed}
    found = [planned_body(shape, motion, repr(name)) for name, (shape, motion) in given.items()]
    bodies, motions = [body for body, _ in found], [motion for _, motion in found]
    names = list(given)
    for name, body in zip(names[: len(shapes)], bodies, strict=False):
        if not body.radius < inf:
            raise UnsupportedError(f"{name!r}: a HalfSpace with a plan is not supported; give a Box, or a static one")
    planar = [body.is_planar for body in bodies]
    if any(planar):
        check_kinds(bodies[planar.index(True)], Pose(), bodies[planar.index(False) if not all(planar) else 0], Pose())
    if any(body.has_mesh for body in bodies):
        for body in bodies:
            body.plant()
    return PlannedFleet(names, bodies, motions, len(shapes), _pieces(bodies, motions))


def _named(given: Any, what: str) -> dict[Name, Any]:
    """The elements of a mapping by their names, those of a sequence by their numbers."""
    if isinstance(given, Mapping):
        return dict(given)
    if isinstance(given, Sequence) and not isinstance(given, str):
        return dict(enumerate(given))
    raise InputError(f"{what}: expected a mapping from names, or a list, got {type(given).__name__}")


def _some(names: Any) -> str:
    shown = sorted(map(repr, names))
    return ", ".join(shown[:5]) + (f" and {len(shown) - 5} more" if len(shown) > 5 else "")


def _placed(given: Any, name: Name) -> tuple[Compound, Motion]:
    """A static object, and where it stands."""
    if isinstance(given, tuple) and len(given) == 2 and not isinstance(given[0], tuple):
        return given[0], Motion(as_pose(given[1], f"static, {name!r}"))
    return given, Motion(Pose())


def _pieces(bodies: Sequence[QueryBody], motions: Sequence[Motion | Trajectory]) -> FleetPieces:
    numbers, begins, tubes = [np.zeros((0, NUMBERS))], [np.zeros(0)], [np.zeros(0)]
    for each in motions:
        if isinstance(each, Trajectory):
            numbers.append(each.numbers)
            begins.append(each.begins)
            tubes.append(each.tubes)
        else:
            numbers.append(np.array([[*each.pose.numbers, *each.numbers]]))
            begins.append(np.zeros(1))
            tubes.append(np.zeros(1))
    counts = [len(each) for each in begins[1:]]
    return FleetPieces(
        np.concatenate(numbers),
        np.concatenate(begins),
        np.concatenate(tubes),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.array([known_until(each) for each in motions]),
        np.array([body.slots.first for body in bodies], np.int32),
        np.array([body.radius for body in bodies]),
        np.array([arm_of(body) for body in bodies]),
    )
