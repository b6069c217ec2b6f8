"""Plans of the bodies that a robot's links carry: when they are due, and which.

They go along a plan of the joints while there is one that the joints follow, else along the rates of the joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.trajectories import Between, ObjectTrajectory, Then
from collision_monitor.motion.stated_motion import set_courses, straight_motions
from collision_monitor.motion.trajectory import FASTEST, Tolerance
from collision_monitor.robots.constant_rates import constant_rates
from collision_monitor.robots.kinematic_tree import KinematicTree, with_fixed_rows
from collision_monitor.robots.link_pieces import Wanted
from collision_monitor.robots.link_plans import TUBE, link_plans, radius_of
from collision_monitor.sources.robot.carried_bodies import Body
from collision_monitor.sources.robot.joint_plan import JointPlan
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LONGER: Final = 1.25
"""Length of a plan, in horizons. Larger: more pieces. Smaller: joints that keep their rates get new plans oftener."""

CHANGED: Final = 0.5 * TUBE
"""m by which a point of the robot may be off its plans, within the horizon, until they are made anew."""

NANOSECOND: Final = 1e-9

OVER: Final = "over"
"""Why a plan of the joints is not followed any more that has come to its end."""

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
        self._planned: JointPlan | None = None  # what the last plans go along
        self._waits: bool = before is not None and before._waits

    def restart(self) -> None:
        """Forget what the monitor forgets when time jumps."""
        self._has_plan[:], self._made, self._waits = False, None, True

    def due(
        self, now_ns: int, joints: Floats, base: Floats, usable: Mask, horizon: float, planned: JointPlan | None = None
    ) -> list[ObjectTrajectory]:  # fmt: skip
        """Return the new plans from now on, and the ends of those that are not needed any more.

        joints (J, 2): positions and rates. base (13,): motion of the base link. usable (N,): bodies whose joints are
        known. horizon (s): of the monitor. planned: what the joints follow; None: they keep their rates. Raises
        InputError for a robot whose joints stop one after the other, and for a plan that is too long.
        """
        if self._waits:
            self._waits = False
            return []
        usable = usable & np.isfinite(self._wanted.radii)
        if not self._reach * np.abs(joints[:, 1]).sum() < FASTEST or horizon <= 0.0:
            usable = np.zeros_like(usable)
        keeps = self._keeps(now_ns, joints, base, horizon) if planned is None else self._stays(base)
        if keeps and planned is self._planned and not (self._has_plan & ~usable).any():
            return []
        which = np.flatnonzero(usable)
        wanted = Wanted(self._wanted.rows[which], self._wanted.radii[which])
        row = straight_motions(base[None])
        set_courses(row, False, True, False)
        rates = constant_rates(self._tree, joints, LONGER * horizon) if planned is None else planned.at(now_ns)
        plans = link_plans(self._tree, wanted, rates, row[0])
        found, has_plan = [], np.zeros_like(usable)
        for b, (k, tube) in enumerate(zip(which.tolist(), plans.pieces.tubes.tolist(), strict=True)):
            times, poses = plans.points(b)
            if (len(times) > 2 or (planned is not None and (poses[0] != poses[1]).any())) and tube <= LARGEST_INPUT:
                has_plan[k] = True
                then = Then.GO_ON if planned is None else Then.REST
                found.append(self._trajectory(k, times, poses, tube, then))
        ended = np.flatnonzero(self._has_plan & ~has_plan)
        self._has_plan, self._made = has_plan, (now_ns, LONGER * horizon, joints.copy(), base.copy())
        self._planned = planned
        return [*(self._trajectory(k, np.zeros(0), _NONE, 0.0) for k in ended.tolist()), *found]

    def leaves(self, planned: JointPlan, now_ns: int, joints: Floats) -> str:
        """Return why a plan of the joints (J, 2) is not followed any more; empty: it is."""
        if planned.is_over(now_ns, Tolerance().time):
            return OVER
        off = planned.off(now_ns, joints, Tolerance())
        if self._reach * float(off.sum()) <= Tolerance().along:
            return ""
        j = int(off.argmax())
        return f"the joints left the plan: {self._tree.joints[j]} is {off[j]:.3f} rad or m off"

    def _trajectory(
        self, k: int, times: Floats, poses: Floats, tube: float, then: Then = Then.GO_ON
    ) -> ObjectTrajectory:  # fmt: skip
        return ObjectTrajectory(times, poses, _NO_TWISTS, _DEFAULT, self._ids[k], Between.ARC, then, tube)

    def _stays(self, base: Floats) -> bool:
        """Whether the base rests where it was for the last plans."""
        return self._made is not None and not base[7:].any() and np.array_equal(base, self._made[3])

    def _keeps(self, now_ns: int, joints: Floats, base: Floats, horizon: float) -> bool:
        """Whether the last plans still say where the robot goes: it stands on a base at rest, and its rates stay."""
        if self._made is None:
            return False
        made_ns, length, then, _ = self._made
        age = (now_ns - made_ns) * NANOSECOND
        if not 0.0 <= age <= length - horizon or not self._stays(base):
            return False
        off = np.abs(joints[:, 0] - then[:, 0] - age * then[:, 1]) + horizon * np.abs(joints[:, 1] - then[:, 1])
        return bool(self._reach * off.sum() <= CHANGED)
