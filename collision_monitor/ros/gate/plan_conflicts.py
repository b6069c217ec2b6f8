"""The conflicts of a robot's plan with the world as it moves now."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf, isfinite
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.motion.stated_motion import Motion
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.query.conflicts.conflicts import Conflict, conflicts
from collision_monitor.query.contact.contact import contact
from collision_monitor.ros.gate.gated_world import GatedWorld
from collision_monitor.ros.guard.speed_limit import STANDS
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, HalfSpace, Sphere

Floats = NDArray[np.float64]

NEARER: Final = 0.002
"""m by which the gap of a pair that is too near already may become smaller: less is round-off and noise of states."""

LOOK_EVERY: Final = 0.05
"""s between two looks at the gap of such a pair."""

LOOKS: Final = (24, 400)
"""Fewest and most of these looks."""

MOST_INTERVALS: Final = 20
"""Conflicts of a pair that are told apart."""


class PlanConflict(NamedTuple):
    """An object of the robot and another one that come too near, with bounds on begin and end (s from now on).

    gap: m between both at the begin. point: where, m in the world.
    """

    part: str
    other: str
    entry: tuple[float, float]
    exit: tuple[float, float]
    gap: float
    point: tuple[float, float, float]


class Sight(NamedTuple):
    """What of the world counts. clearance: m to keep. ahead: s for which the motions of moving objects are relied on.

    An object that hardly moves is relied on for as long as the plan lasts. parts: whether two that are too near already
    may part; else they conflict at once.
    """

    clearance: float
    ahead: float
    parts: bool = True


def plan_conflicts(
    world: GatedWorld, plans: Mapping[int, Trajectory], now_ns: int, until: float, sight: Sight
) -> list[PlanConflict]:
    """Return the conflicts of the robot's objects, soonest first, with plans by their ids from now on, `until` (s).

    Pairs that are allowed, or in groups that do not meet, do not count. Two that are too near already conflict once
    they come nearer: they may part, and slide along each other. Raises the errors of `cm.conflicts`.
    """
    if not plans:
        return []
    found = []
    wide = max(world.described[each].padding for each in plans)
    for padding, others in _by_padding(_near(world, plans, now_ns, sight, wide)).items():
        separation = sight.clearance + padding + wide
        found += _conflicts(world, plans, others, until, separation, sight)
    return sorted(found, key=lambda each: each.entry[0])


def load_plan_conflicts() -> None:
    """Compile the kernels of convex shapes, or load them from the cache, before a plan arrives."""
    way = Trajectory([0.0, 1.0, 2.0], [(0, 0, 0), (1, 0, 0), (1, 1, 0, 0, 0, 1, 0)], between="arc", tube=1e-3)
    box, ball = [(Box((0.1, 0.1, 0.1)), Pose())], Sphere(0.1)
    plans = {"a": way, "b": Motion((0.5, -1, 0), (0, 1, 0))}
    for static in ((ball, Pose((0.8, 0, 0))), (HalfSpace((0, 0, 1), 0.0), Pose())):
        found = conflicts({"a": box, "b": ball}, plans, {"static": static}, 2.0, separation=0.05)
        assert found[0].contact is not None


def self_conflicts(world: GatedWorld, plans: Mapping[int, Trajectory], until: float) -> list[PlanConflict]:
    """Return where objects of the robot meet each other along their plans, unless they touch at the start."""
    own = {each: world.described[each] for each in plans}
    ignored = [(a, b) for a in own for b in own if a < b and not _meets(own[a], own[b])]
    shapes = {each: it.shapes for each, it in own.items()}
    found = conflicts(shapes, dict(plans), (), until, most=1, ignore=ignored)
    return [_told(world, each) for each in found if each.b is not None and each.entry[1] > 0.0]


def _conflicts(
    world: GatedWorld, plans: Mapping[int, Trajectory], others: Mapping[int, Motion], until: float, separation: float,
    sight: Sight,
) -> list[PlanConflict]:  # fmt: skip
    moving = {each: motion for each, motion in others.items() if _moves(motion)}
    shapes = {each: world.described[each].shapes for each in (*plans, *others)}
    static = {each: (list(shapes[each]), motion.pose) for each, motion in others.items() if each not in moving}
    objects = {each: shapes[each] for each in (*plans, *moving)}
    found = conflicts(
        objects, {**plans, **moving}, static, until, separation=separation, most=MOST_INTERVALS,
        ignore=_ignored(world, plans, moving, static),
    )  # fmt: skip
    near = {(each.a, each.b): each for each in found if each.b is not None and each.entry[0] <= 0.0}
    kept = []
    for each in found:
        b = each.b if each.a in plans else each.a
        relied = each.entry[0] <= sight.ahead or b not in moving or np.linalg.norm(moving[b].linear) <= STANDS
        # what follows a pair that is too near at once is not told from its tube, unless it is certain
        if (
            each.b is not None
            and relied
            and ((each.a, each.b) not in near or 0.0 < each.entry[0] <= each.entry[1] < inf)
        ):
            kept.append(_told(world, each))
    for each in near.values():
        begin = _comes_nearer(each, until, separation) if sight.parts else 0.0
        if begin is not None:
            kept.append(_told(world, Conflict(each.a, each.b, (begin, begin), (begin, inf), each.sides)))
    return kept


def _comes_nearer(pair: Conflict, end: float, separation: float) -> float | None:
    """When (s) two that are too near already come nearer than they were, and too near; None: they do not."""
    shape_a, motion_a, shape_b, motion_b = pair.sides
    widest = -inf
    for t in np.linspace(0.0, end, int(np.clip(end / LOOK_EVERY, *LOOKS))).tolist():
        gap = contact(shape_a, motion_a.at(t), shape_b, motion_b.at(t)).signed_distance
        widest = max(widest, gap)
        if gap < min(widest, separation) - NEARER:
            return float(t)
    return None


def _told(world: GatedWorld, found: Conflict) -> PlanConflict:
    a, b = found.a, found.b
    at = found.contact
    assert isinstance(a, int) and isinstance(b, int) and at is not None
    is_a = a in world.robot.names
    part, other = (a, b) if is_a else (b, a)
    point = tuple((at.point_a if is_a else at.point_b).tolist())
    names = world.described[part].name, world.described[other].name
    return PlanConflict(*names, found.entry, found.exit, float(at.signed_distance), point)


def _meets(a: ObjectDescription, b: ObjectDescription) -> bool:
    """Whether contacts of two objects count: by their groups and by what they are allowed to touch."""
    grouped = a.group & b.mask and b.group & a.mask
    return bool(grouped) and a.object_id not in b.allowed and b.object_id not in a.allowed


def _ignored(
    world: GatedWorld, plans: Iterable[int], moving: Iterable[int], static: Iterable[int]
) -> list[tuple[int, int]]:
    """Pairs that do not count: of two of the robot, of two others, and those that `_meets` leaves out."""
    own, other = list(plans), list(moving)
    still, know = list(static), world.described
    found = [(a, b) for k, a in enumerate(own) for b in own[k + 1 :]]
    found += [(a, b) for k, a in enumerate(other) for b in (*other[k + 1 :], *still)]
    return found + [(a, b) for a in own for b in (*other, *still) if not _meets(know[a], know[b])]


def _near(
    world: GatedWorld, plans: Mapping[int, Trajectory], now_ns: int, sight: Sight, wide: float
) -> dict[int, tuple[Motion, float]]:
    """Motions and paddings of the other objects that the robot may come near to, by spheres about the origins."""
    low, high, reaches = np.full(3, inf), np.full(3, -inf), world.reaches
    for each, plan in plans.items():
        size = reaches[each] + float(plan.tubes.max())
        low = np.minimum(low, plan.numbers[:, :3].min(axis=0) - size)
        high = np.maximum(high, plan.numbers[:, :3].max(axis=0) + size)
        curve = float(np.linalg.norm(np.diff(plan.poses[:, :3], axis=0), axis=1).max())
        low, high = low - curve, high + curve  # an arc bulges by less than its chord
    found = {}
    for each, it in world.others.items():
        motion = world.motion(each, now_ns)
        if motion is None:
            continue
        size = reaches[each] + it.padding + wide + sight.clearance
        size += sight.ahead * float(
            np.linalg.norm(motion.linear) + 0.5 * sight.ahead * np.linalg.norm(motion.acceleration)
        )
        place = np.array(motion.pose.numbers[:3])
        if not isfinite(size) or ((place + size >= low) & (place - size <= high)).all():
            found[each] = motion, it.padding
    return found


def _by_padding(near: Mapping[int, tuple[Motion, float]]) -> dict[float, dict[int, Motion]]:
    found: dict[float, dict[int, Motion]] = {}
    for each, (motion, padding) in near.items():
        found.setdefault(padding, {})[each] = motion
    return found


def _moves(motion: Motion) -> bool:
    return bool(motion.linear.any() or motion.angular.any() or motion.acceleration.any())
