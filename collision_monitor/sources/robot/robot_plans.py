"""Plans of the bodies that a robot's links carry, while its joints keep their rates: when they are due, and which."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.trajectories import Between, ObjectTrajectory, Then
from collision_monitor.motion.stated_motion import set_courses, straight_motions
from collision_monitor.motion.trajectory import FASTEST
from collision_monitor.robots.constant_rates import constant_rates
from collision_monitor.robots.kinematic_tree import KinematicTree, with_fixed_rows
from collision_monitor.robots.link_pieces import Wanted
from collision_monitor.robots.link_plans import TUBE, link_plans, radius_of
from collision_monitor.sources.robot.carried_bodies import Body
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LONGER: Final = 1.25
"""Length of a plan, in horizons. Larger: more pieces. Smaller: joints that keep their rates get new plans oftener."""

CHANGED: Final = 0.5 * TUBE
"""m by which a point of the robot may be off its plans, within the horizon, until they are made anew."""

NANOSECOND: Final = 1e-9

_NONE: Final = np.zeros((0, 7))
_NO_TWISTS: Final = np.zeros((0, 6))
_DEFAULT: Final = np.zeros(4)


class RobotPlans:
    """The plans of the bodies (N) that move with a robot's links.

    A body that one joint alone moves, or none, needs no plan: it is on the arc of its state. After a restart the first
    step has no plans, because the monitor forgets them with that step.
    """

    def __init__(
        self,
        tree: KinematicTree,
        bodies: Sequence[Body],
        padding: float,
        scales: Mapping[str, float],
        before: RobotPlans | None,
    ) -> None:
        """Plan for these bodies from now on. padding (m): of the shapes, at most. scales: of them, by link.

        before: the plans that are in force.
        """
        self._ids = [body.object_id for body in bodies]
        rows = np.array([tree.links.index(body.link) for body in bodies], np.intp)
        offsets = np.array([body.offset.numbers for body in bodies]).reshape(-1, 7)
        self._tree = with_fixed_rows(tree, rows, offsets)
        sizes = [scales.get(body.link, 1.0) * radius_of(body.shapes) + padding for body in bodies]
        self._wanted = Wanted(len(tree.links) + np.arange(len(bodies)), np.array(sizes))
        lengths = np.linalg.norm(tree.table.position, axis=1).sum() + np.linalg.norm(offsets[:, :3], axis=1).max(
            initial=0
        )
        self._reach = max(float(lengths + max(sizes, default=0.0)), 1.0)
        known = set() if before is None else {it for it, has in zip(before._ids, before._has_plan, strict=True) if has}
        self._has_plan: Mask = np.array([each in known for each in self._ids], np.bool_)
        self._made: tuple[int, float, Floats, Floats] | None = None  # when, how long, of which joints and base
        self._waits: bool = before is not None and before._waits

    def restart(self) -> None:
        """Forget what the monitor forgets when time jumps."""
        self._has_plan[:], self._made, self._waits = False, None, True

    def due(
        self, now_ns: int, joints: Floats, base: Floats, usable: Mask, horizon: float
    ) -> list[ObjectTrajectory]:  # fmt: skip
        """Return the new plans from now on, and the ends of those that are not needed any more.

        joints (J, 2): positions and rates. base (13,): motion of the base link. usable (N,): bodies whose joints are
        known. horizon (s): of the monitor. Raises InputError for a robot whose joints stop one after the other.
        """
        if self._waits:
            self._waits = False
            return []
        usable = usable & np.isfinite(self._wanted.radii)
        if not self._reach * np.abs(joints[:, 1]).sum() < FASTEST or horizon <= 0.0:
            usable = np.zeros_like(usable)
        if self._keeps(now_ns, joints, base, horizon) and not (self._has_plan & ~usable).any():
            return []
        which = np.flatnonzero(usable)
        wanted = Wanted(self._wanted.rows[which], self._wanted.radii[which])
        row = straight_motions(base[None])
        set_courses(row, False, True, False)
        plans = link_plans(self._tree, wanted, constant_rates(self._tree, joints, LONGER * horizon), row[0])
        found, has_plan = [], np.zeros_like(usable)
        for b, (k, tube) in enumerate(zip(which.tolist(), plans.pieces.tubes.tolist(), strict=True)):
            if plans.pieces.counts[b] > 2 and tube <= LARGEST_INPUT:
                times, poses = plans.points(b)
                has_plan[k] = True
                found.append(self._trajectory(k, times, poses, tube))
        ended = np.flatnonzero(self._has_plan & ~has_plan)
        self._has_plan, self._made = has_plan, (now_ns, LONGER * horizon, joints.copy(), base.copy())
        return [*(self._trajectory(k, np.zeros(0), _NONE, 0.0) for k in ended.tolist()), *found]

    def _trajectory(self, k: int, times: Floats, poses: Floats, tube: float) -> ObjectTrajectory:
        return ObjectTrajectory(times, poses, _NO_TWISTS, _DEFAULT, self._ids[k], Between.ARC, Then.GO_ON, tube)

    def _keeps(self, now_ns: int, joints: Floats, base: Floats, horizon: float) -> bool:
        """Whether the last plans still say where the robot goes: it stands on a base at rest, and its rates stay."""
        if self._made is None:
            return False
        made_ns, length, then, at = self._made
        age = (now_ns - made_ns) * NANOSECOND
        if not 0.0 <= age <= length - horizon or base[7:].any() or not np.array_equal(base, at):
            return False
        off = np.abs(joints[:, 0] - then[:, 0] - age * then[:, 1]) + horizon * np.abs(joints[:, 1] - then[:, 1])
        return bool(self._reach * off.sum() <= CHANGED)
