"""Plans of links whose joints are polynomials in time, from what a caller states of the joints and the base."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import InputError
from collision_monitor.motion.course import ARC
from collision_monitor.motion.stated_motion import (
    ACCELERATION,
    ANGULAR,
    COURSE,
    LINEAR,
    NUMBERS,
    REST,
    Motion,
    set_courses,
    straight_motions,
)
from collision_monitor.motion.trajectory import FASTEST, Then, Trajectory, carried
from collision_monitor.robots.joint_motion import JointMotion, joint_spans
from collision_monitor.robots.joint_trajectory import numbers_by_joint
from collision_monitor.robots.kinematic_tree import KinematicTree, kinematic_tree
from collision_monitor.robots.link_pieces import BaseBound, LinkPieces, Wanted, link_pieces
from collision_monitor.robots.urdf import parse_urdf
from collision_monitor.shapes.pose import Pose, as_pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import Shape
from collision_monitor.tolerances import LARGEST_INPUT

Floats = NDArray[np.float64]

TUBE: Final = 1.5e-3
"""m: width of the tubes of links. Larger: fewer pieces, by the root, and impacts that are known less exactly."""

LONGEST: Final = 600.0
"""s for which the motion of a robot is stated."""

_AXES: Final = np.concatenate([np.eye(3), -np.eye(3)])


class LinkPlans(NamedTuple):
    """Plans of B bodies: their pieces, between nodes at some times."""

    times: Floats  # (N,): s from now on
    rows: NDArray[np.intp]  # (B,): of the bodies in the tree
    pieces: LinkPieces

    def points(self, b: int) -> tuple[Floats, Floats]:
        """Return times (n,) and poses (n, 7) of body b, between which it moves along arcs."""
        at = self.pieces.points[b, : self.pieces.counts[b]]
        return self.times[at], self.pieces.poses[at, self.rows[b]]


def link_plans(
    tree: KinematicTree, wanted: Wanted, motion: JointMotion, base: Floats, tolerance: float = TUBE
) -> LinkPlans:
    """Return the plans of bodies that links carry, between the ends of the motion of the joints.

    base: numbers (NUMBERS,) of the motion of the base link from time 0 on. Raises InputError for too long a motion.
    """
    v, w = (float(np.linalg.norm(base[a:b])) for a, b in ((LINEAR, ANGULAR), (ANGULAR, ACCELERATION)))
    is_screw = base[COURSE] == ARC or v == 0.0 or w == 0.0
    bound = BaseBound(v, w, 0.0 if v == w == 0.0 else 1.0 if is_screw else 2.0)
    spans = joint_spans(motion, tree, tolerance, w)
    moves = carried(np.tile(base, (len(spans.times), 1)), spans.times)[:, :ACCELERATION]
    return LinkPlans(spans.times, wanted.rows, link_pieces(tree, wanted, spans, moves, bound, tolerance))


def load_link_plans() -> None:
    """Compile the kernels, or load them from the cache, before messages arrive."""
    joint = '<joint name="{0}" type="continuous"><parent link="{0}"/><child link="{1}"/></joint>'
    links = "".join(f'<link name="{each}"/>' for each in "abc")
    text = f"<robot>{links}{joint.format('a', 'b')}{joint.format('b', 'c')}</robot>"
    tree = kinematic_tree(parse_urdf(text, "warm-up"))
    base = straight_motions(np.eye(1, ACCELERATION, 6))
    set_courses(base, False, True, False)
    motion = JointMotion(np.array([0.0, 1.0]), np.ones((1, 2, 2)))
    link_plans(tree, Wanted(np.array([2]), np.ones(1)), motion, base[0])


def planned_links(
    tree: KinematicTree, wanted: Wanted, motion: JointMotion, base: Any, tolerance: Any, then: Then
) -> list[Trajectory]:
    """Return the plans of links as trajectories, see `Robot.motions`. Raises InputError, PoseError."""
    width = checked_number(tolerance, "tolerance", "m", least=0.0, above=True)
    plans, made = link_plans(tree, wanted, motion, _base_numbers(base), width), []
    for b, tube in enumerate(plans.pieces.tubes.tolist()):
        if not tube <= LARGEST_INPUT:
            seconds = float(motion.edges[-1] - motion.edges[0])
            raise InputError(f"expected rates at which a link can be followed for {seconds:g} s, got faster ones")
        made.append(Trajectory(*plans.points(b), between="arc", then=then, tube=tube))
    return made


def checked_horizon(horizon: Any) -> float:
    """Return how far ahead the motion of a robot is stated (s). Raises InputError."""
    return checked_number(horizon, "horizon", "s", least=0.0, most=LONGEST, above=True)


def joint_values(names: Sequence[str], q: Any, qd: Any) -> Floats:
    """Return positions and rates (J, 2) of joints. Raises InputError."""
    position, rate = numbers_by_joint(names, q, "q"), numbers_by_joint(names, qd, "qd")
    fast = np.flatnonzero(np.abs(rate) > FASTEST)
    if len(fast):
        j = int(fast[0])
        raise InputError(f"qd: expected at most {FASTEST:g} rad/s or m/s, got {rate[j]:g} for {names[j]}")
    return np.stack([position, rate], axis=1)


def _base_numbers(base: Any) -> Floats:
    """Return the numbers (NUMBERS,) of the motion of a base. Raises PoseError, InputError."""
    motion = base if isinstance(base, Motion) else Motion(as_pose(base, "base"))
    numbers = np.array([*motion.pose.numbers, *motion.numbers])
    if numbers[ACCELERATION:COURSE].any() or numbers[REST] < inf:
        raise InputError("base: expected a motion without an acceleration, got one that changes its speed")
    assert len(numbers) == NUMBERS
    return numbers


def radius_of(shapes: Sequence[tuple[Shape, Pose]]) -> float:
    """Radius (m) of a sphere about the origin that holds shapes with their poses; infinite if they are unbounded."""
    most = reach(shapes, _AXES).reshape(2, 3).max(axis=0)
    return float(np.linalg.norm(most))
