"""The scene plan: which tests and which grid cells the objects that are described require, and what nothing requires.

`Monitor.plan` makes it from what is described at that moment, so it follows every change; `print` shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.hashed_grid import GRID_LEVELS, LEVEL_OFFSET, HashedGrid
from collision_monitor.monitor.roster import Roster
from collision_monitor.narrow_phase.dispatch import KIND_NAMES, TEST_METHODS, pair_test


@dataclass(frozen=True)
class ScenePlan:
    """What a step works with."""

    shapes: dict[str, int]
    """How many of each kind are described; the parts of a compound count one by one."""
    moving: int
    static: int
    turning: int
    """Moving objects whose rotation matters: all but single spheres at their frame's origin."""
    tests: dict[tuple[str, str], str]
    """The narrow phase test, a file of `narrow_phase/`, for each two kinds that can meet."""
    cells: dict[float, int]
    """Objects in the grid by cell width (m): swept boxes, so both size and speed count."""
    groups: int
    """How many pairs of (group, mask) there are; with one, nothing is told apart by group."""
    never_meet: int
    """Pairs of objects, not both static, whose groups ignore each other."""
    planar: bool
    """The scene is one of the x-y plane."""
    modelled: int
    """Objects for which a larger model stands, meshes among them."""
    uncertain: bool
    """States declare how uncertain they are, and it is wanted to know."""
    outside: int
    """Objects outside of the region of interest."""

    def __str__(self) -> str:
        lines = [f"objects   {self.moving} moving, {self.static} static"]
        lines.append("shapes    " + (", ".join(f"{count} {name}" for name, count in self.shapes.items()) or "none"))
        for (a, b), test in self.tests.items():
            lines.append(f"test      {a} – {b}: {test} ({TEST_METHODS[test]})")
        for width, count in self.cells.items():
            lines.append(f"grid      cells of {width:g} m: {count}")
        unneeded = self.unneeded
        lines.append("not used  " + ("; ".join(unneeded) if unneeded else "nothing: the scene requires all of it"))
        return "\n".join(lines)

    @property
    def unneeded(self) -> list[str]:
        """What is left out because nothing in the scene requires it."""
        used = set(self.tests.values())
        reasons = (
            ("box_box" not in used, "SAT: no two boxes can meet"),
            (not used & {"convex_convex", "cylinder_cylinder"}, "GJK and EPA: no pair needs them"),
            (self.turning == 0, "rotation: a sphere looks the same turned"),
            (self.planar, "the third dimension: all are shapes of the plane"),
            (self.modelled == 0, "models: every object is tested as it is"),
            (not self.uncertain, "uncertainty: no state declares it, or it is switched off"),
            (self.static > 1, f"{self.static * (self.static - 1) // 2} pairs of static objects: never visited"),
            (self.groups <= 1, "groups and masks: all are the same"),
            (self.never_meet > 0, f"{self.never_meet} pairs of groups that never meet: found and dropped"),
            (self.outside > 0, f"{self.outside} objects outside of the region: at rest"),
        )
        return [reason for applies, reason in reasons if applies]


def scene_plan(roster: Roster, grid: HashedGrid, *, uncertain: bool, outside: int) -> ScenePlan:
    """The plan for what is described now."""
    table, parts, bodies = roster.multibody
    used = np.flatnonzero(bodies.used)
    static = bodies.static[used]
    kinds: dict[bool, list[int]] = {False: [], True: []}
    for i, fixed in zip(used.tolist(), static.tolist(), strict=True):
        slot = int(bodies.first_shape[i])
        while slot >= 0:
            kinds[fixed].append(int(table.kind[slot]))
            slot = int(parts.next[slot])
    moving, fixed_kinds = set(kinds[False]), set(kinds[True])
    pairs = [*combinations_with_replacement(sorted(moving), 2)]
    if int(np.count_nonzero(~static)) == 1:
        pairs = []  # one object does not meet itself
    pairs += [(min(a, b), max(a, b)) for a in moving for b in fixed_kinds]
    counts = {kind: (kinds[False] + kinds[True]).count(kind) for kind in sorted(moving | fixed_kinds)}
    moving_bodies = used[~static]
    of_groups = [
        np.unique(np.stack([bodies.group[each], bodies.mask[each]], axis=1), axis=0, return_counts=True)
        for each in (used, used[static])
    ]
    filters = of_groups[0][0]
    return ScenePlan(
        shapes={KIND_NAMES[kind]: count for kind, count in counts.items()},
        moving=len(moving_bodies),
        static=int(np.count_nonzero(static)),
        turning=int(np.count_nonzero(bodies.spin_radius[moving_bodies] > 0.0)),
        tests={(KIND_NAMES[a], KIND_NAMES[b]): pair_test(a, b) for a, b in sorted(set(pairs))},
        cells={2.0 ** (k - LEVEL_OFFSET): int(grid.level_count[k]) for k in range(GRID_LEVELS) if grid.level_count[k]},
        groups=len(filters),
        never_meet=_ignoring(*of_groups[0]) - _ignoring(*of_groups[1]),
        planar=roster.planar,
        modelled=int(np.count_nonzero(bodies.excess[used])),
        uncertain=uncertain,
        outside=outside,
    )


def _ignoring(filters: NDArray[np.uint32], counts: NDArray[np.int64]) -> int:
    """How many pairs ignore each other, of objects of which counts (n,) have the (group, mask) of filters (n, 2)."""
    group, mask = filters.T
    meets = (group[:, None] & mask) != 0
    ignoring = ~(meets & meets.T)
    pairs = counts[:, None] * counts - np.diag(counts)
    return int((pairs * ignoring).sum()) // 2
