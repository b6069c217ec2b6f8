"""The joints of a robot as arrays, each link after its parent: what the forward kinematics reads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.robots.urdf import Joint, JointType, Urdf
from collision_monitor.tolerances import LARGEST_INPUT

FIXED: Final = 0
TURNING: Final = 1
SLIDING: Final = 2

_KINDS: Final = {
    JointType.FIXED: FIXED,
    JointType.REVOLUTE: TURNING,
    JointType.CONTINUOUS: TURNING,
    JointType.PRISMATIC: SLIDING,
}


class LinkTable(NamedTuple):
    """Rows of L links, each link after its parent; row 0 is the base link.

    parent (L,): row of the parent, -1 for the base. kind (L,): of the joint to the parent. position (L, 3) in m and
    quaternion (L, 4): X_PC, the link in its parent at position 0. axis (L, 3): in the link's frame. variable (L,): the
    column of the joint in the positions, -1 if it is fixed. The joint is at multiplier (L,) * position + offset (L,).
    """

    parent: NDArray[np.int32]
    kind: NDArray[np.int32]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    axis: NDArray[np.float64]
    variable: NDArray[np.int32]
    multiplier: NDArray[np.float64]
    offset: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class KinematicTree:
    """links: names, by row of the table. joints: names of the variables, by column.

    wraps (J,): whether the position of a joint may jump by a turn, as that of a continuous one. needs (L, J): whether
    the pose of a link in the base link depends on a joint. turns (L, J): rad by which the link turns at most for each
    rad or m of a joint. limits (J, 2): smallest and largest position (rad or m).
    """

    links: tuple[str, ...]
    joints: tuple[str, ...]
    table: LinkTable
    wraps: NDArray[np.bool_]
    needs: NDArray[np.bool_]
    turns: NDArray[np.float64]
    limits: NDArray[np.float64]


def kinematic_tree(urdf: Urdf) -> KinematicTree:
    """Return the tree of a URDF. Raises InputError if its joints do not form a tree of supported joints.

    A planar or floating joint between the root link and the only other link attached to it is left out, because
    odometry or tf states the pose of a base that moves freely. The tree then begins at that link.
    """
    by_child: dict[str, Joint] = {}
    children: dict[str, list[Joint]] = {name: [] for name in urdf.links}
    for joint in urdf.joints.values():
        for end in (joint.parent, joint.child):
            if end not in urdf.links:
                raise joint.element.error(f"expected links that the file has, got {end!r:.80}")
        if joint.child in by_child:
            raise joint.element.error(f"expected a child without a parent, but {joint.child!r} has two joints to one")
        by_child[joint.child] = joint
        children[joint.parent].append(joint)
    roots = [name for name in urdf.links if name not in by_child]
    if len(roots) != 1:
        loop = next(iter(urdf.joints.values())) if urdf.joints else next(iter(urdf.links.values()))
        found = ", ".join(roots[:5]) or "none, because the joints form a loop"
        raise loop.element.error(f"expected one link without a parent in the file, got {found}")
    order = _downward(_base(urdf, roots[0], children), children)
    if len(order) + (order[0] != roots[0]) != len(urdf.links):
        lost = next(name for name in urdf.links if name not in {*order, roots[0]})
        raise urdf.links[lost].element.error("expected joints that connect it to the base, got a loop")
    return _tree(order, by_child, urdf)


def _base(urdf: Urdf, root: str, children: dict[str, list[Joint]]) -> str:
    for joint in urdf.joints.values():
        if joint.type in (JointType.PLANAR, JointType.FLOATING):
            if joint.parent != root or len(children[root]) > 1 or urdf.links[root].collisions:
                raise joint.element.error(
                    f"expected a {joint.type} joint only between a root link without shapes and its one child"
                )
            return joint.child
    return root


def _downward(base: str, children: dict[str, list[Joint]]) -> list[str]:
    """Return the links from the base on, in depth-first order."""
    order, stack = [], [base]
    while stack:
        order.append(stack.pop())
        stack += [joint.child for joint in reversed(children[order[-1]])]
    return order


def _tree(order: list[str], by_child: dict[str, Joint], urdf: Urdf) -> KinematicTree:
    row = {name: i for i, name in enumerate(order)}
    moving = [by_child[name] for name in order[1:] if _KINDS[by_child[name].type] != FIXED]
    free = [joint for joint in moving if joint.mimic is None]
    column = {joint.name: j for j, joint in enumerate(free)}
    count = len(order)
    table = LinkTable(
        np.full(count, -1, np.int32),
        np.zeros(count, np.int32),
        np.zeros((count, 3)),
        np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        np.zeros((count, 3)),
        np.full(count, -1, np.int32),
        np.ones(count),
        np.zeros(count),
    )
    needs, turns = np.zeros((count, len(column)), np.bool_), np.zeros((count, len(column)))
    leaders: dict[str, tuple[str, float, float]] = {}
    for i, name in enumerate(order[1:], start=1):
        joint = by_child[name]
        table.parent[i], table.kind[i] = row[joint.parent], _KINDS[joint.type]
        table.position[i], table.quaternion[i] = joint.origin.position, joint.origin.quaternion
        table.axis[i] = joint.axis
        needs[i], turns[i] = needs[table.parent[i]], turns[table.parent[i]]
        if table.kind[i] != FIXED:
            source, table.multiplier[i], table.offset[i] = _leader(joint, urdf, leaders)
            table.variable[i] = column[source]
            needs[i, column[source]] = True
            turns[i, column[source]] += abs(table.multiplier[i]) if table.kind[i] == TURNING else 0.0
    wraps = np.array([joint.type is JointType.CONTINUOUS for joint in free], np.bool_)
    limits = np.array([joint.limits for joint in free]).reshape(-1, 2)
    return KinematicTree(tuple(order), tuple(column), table, wraps, needs, turns, limits)


def with_fixed_rows(tree: KinematicTree, rows: NDArray[np.intp], poses: NDArray[np.float64]) -> KinematicTree:
    """Return a tree with further frames (K), fixed to the links `rows` (K,) at poses (K, 7) in their frames."""
    count, table = len(rows), tree.table
    more = LinkTable(
        rows.astype(np.int32),
        np.full(count, FIXED, np.int32),
        poses[:, :3],
        poses[:, 3:],
        np.zeros((count, 3)),
        np.full(count, -1, np.int32),
        np.ones(count),
        np.zeros(count),
    )
    grown = LinkTable(*(np.concatenate([old, new]) for old, new in zip(table, more, strict=True)))
    needs, turns = (np.concatenate([each, each[rows]]) for each in (tree.needs, tree.turns))
    return replace(tree, links=(*tree.links, *[""] * count), table=grown, needs=needs, turns=turns)


def _leader(joint: Joint, urdf: Urdf, known: dict[str, tuple[str, float, float]]) -> tuple[str, float, float]:
    """Return the joint that this one follows in the end, and multiplier and offset of its position.

    known: the same for the joints so far, so that a chain of mimics is walked once.
    """
    chain, at = [], joint
    seen = set()
    while at.mimic is not None and at.name not in known:
        chain.append(at)
        seen.add(at.name)
        leader = urdf.joints.get(at.mimic.joint)
        if leader is None or leader.type not in _KINDS or leader.type is JointType.FIXED or leader.name in seen:
            raise at.element.error(f"mimic: expected a moving joint, and no loop, got {at.mimic.joint!r:.80}")
        at = leader
    name, multiplier, offset = known.get(at.name, (at.name, 1.0, 0.0))
    for each in reversed(chain):
        assert each.mimic is not None
        multiplier, offset = each.mimic.multiplier * multiplier, each.mimic.multiplier * offset + each.mimic.offset
        if not (abs(multiplier) <= LARGEST_INPUT and abs(offset) <= LARGEST_INPUT):
            raise each.element.error(f"mimic: expected a position up to {LARGEST_INPUT:g}, got a larger one")
        known[each.name] = name, multiplier, offset
    return name, multiplier, offset
