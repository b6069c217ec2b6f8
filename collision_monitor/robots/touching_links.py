"""Pairs of links that touch by construction: rigidly joined ones, and the two ends of a joint."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations
from typing import Final

from collision_monitor.errors import InputError
from collision_monitor.robots.kinematic_tree import FIXED, KinematicTree
from collision_monitor.robots.srdf import Pair, ordered

MOST_PAIRS: Final = 100_000
"""Pairs of links that touch by construction: those of 450 links that are rigid with each other. A humanoid has 300."""


def touching_links(tree: KinematicTree, solid: Collection[str]) -> set[Pair]:
    """Return the pairs of `solid` links, those with shapes, that touch by construction.

    Links joined by fixed joints form one rigid body, and their pairs never change. At a moving joint the two links that
    it joins touch; instead of a link without a shape, the solid links of its rigid body; if there are none, the next
    body towards the base. Other pairs, such as the ends of a bent arm, stay checked.

    Raises InputError beyond MOST_PAIRS.
    """
    table = tree.table
    top = list(range(len(tree.links)))  # row of the topmost link of the rigid body
    for i in range(1, len(top)):
        if table.kind[i] == FIXED:
            top[i] = top[table.parent[i]]
    bodies: dict[int, list[str]] = {}
    for name, row in zip(tree.links, top, strict=True):
        if name in solid:
            bodies.setdefault(row, []).append(name)
    if (count := sum(len(links) * (len(links) - 1) // 2 for links in bodies.values())) > MOST_PAIRS:
        raise InputError(
            f"expected at most {MOST_PAIRS} pairs of links with shapes that fixed joints connect, got {count}: "
            "give the shapes of such links to one of them"
        )
    pairs = {ordered(a, b) for links in bodies.values() for a, b in combinations(links, 2)}

    def at(row: int) -> list[str]:
        return [tree.links[row]] if tree.links[row] in solid else bodies.get(top[row], [])

    for i in bodies:
        row = int(table.parent[i])
        while row >= 0 and not at(row):
            row = int(table.parent[top[row]])
        if row >= 0:
            pairs |= {ordered(a, b) for a in at(i) for b in at(row)}
            if len(pairs) > 2 * MOST_PAIRS:
                raise InputError(f"expected at most {2 * MOST_PAIRS} pairs of links that joints connect, got more")
    return pairs
