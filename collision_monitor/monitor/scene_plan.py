"""The scene plan: the tests and grid cells that the described objects require, and the features that they do not.

`Monitor.plan` computes it from the objects that are described at that moment; `print` shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.hashed_grid import GRID_LEVELS, LEVEL_OFFSET, HashedGrid
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.narrow_phase.dispatch import TEST_METHODS, pair_test
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.points import POINTS
from collision_monitor.shapes.registry import KIND_NAMES

_NAMES: Final = {**KIND_NAMES, MESH: "mesh", POINTS: "points"}
_METHODS: Final = {**TEST_METHODS, "meshes": "trees of triangles or points"}


@dataclass(frozen=True)
class ScenePlan:
    """The objects, tests and grid cells of a scene."""

    shapes: dict[str, int]
    """Number of shapes of each kind; each part of a compound counts."""
    moving: int
    static: int
    turning: int
    """Moving objects whose rotation matters: all but single spheres and circles at their frame's origin."""
    tests: dict[tuple[str, str], str]
    """The test for each two kinds that can meet: a file of `narrow_phase/`, or the folder `meshes`."""
    cells: dict[float, int]
    """Objects in the grid by cell width (m). The grid holds swept boxes, so the width depends on size and speed."""
    groups: int
    """Number of different (group, mask) pairs; with one, groups distinguish nothing."""
    never_meet: int
    """Number of pairs of objects, not both static, whose groups ignore each other."""
    planar: bool
    """The scene lies in the x-y plane."""
    modelled: int
    """Objects that a larger model represents, for example meshes."""
    uncertain: bool
    """Some states declare uncertainties, and the profile includes them."""
    outside: int
    """Objects outside of the region of interest."""

    def __str__(self) -> str:
        lines = [f"objects   {self.moving} moving, {self.static} static"]
        lines.append("shapes    " + (", ".join(f"{count} {name}" for name, count in self.shapes.items()) or "none"))
        for (a, b), test in self.tests.items():
            lines.append(f"test      {a} – {b}: {test} ({_METHODS[test]})")
        for width, count in self.cells.items():
            lines.append(f"grid      cells of {width:g} m: {count}")
        unneeded = self.unneeded
        lines.append("not used  " + ("; ".join(unneeded) if unneeded else "nothing: the scene requires all of it"))
        return "\n".join(lines)

    @property
    def unneeded(self) -> list[str]:
        """The features that the scene does not require, each with the reason."""
        used = set(self.tests.values())
        convex = bool(used & {"convex_convex", "cylinder_cylinder"})
        boxes = "box_box" in used  # GJK answers for separated boxes that are nearest elsewhere than along the SAT axis
        reasons = (
            (not boxes, "SAT: no two boxes can meet"),
            (not convex and not boxes, "GJK and EPA: no pair needs them"),
            (not convex and boxes, "EPA: no pair needs it; separated boxes use GJK"),
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
    """Compute the plan for the objects that are described now."""
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
        shapes={_NAMES[kind]: count for kind, count in counts.items()},
        moving=len(moving_bodies),
        static=int(np.count_nonzero(static)),
        turning=int(np.count_nonzero(bodies.spin_radius[moving_bodies] > 0.0)),
        tests={
            (_NAMES[a], _NAMES[b]): "meshes" if {a, b} & {MESH, POINTS} else pair_test(a, b)
            for a, b in sorted(set(pairs))
        },
        cells={2.0 ** (k - LEVEL_OFFSET): int(grid.level_count[k]) for k in range(GRID_LEVELS) if grid.level_count[k]},
        groups=len(filters),
        never_meet=_ignoring(*of_groups[0]) - _ignoring(*of_groups[1]),
        planar=roster.planar,
        modelled=int(np.count_nonzero(bodies.excess[used])),
        uncertain=uncertain,
        outside=outside,
    )


def _ignoring(filters: NDArray[np.uint32], counts: NDArray[np.int64]) -> int:
    """Count the pairs of objects that ignore each other. counts (n,): objects with each row of filters (n, 2)."""
    group, mask = filters.T
    meets = (group[:, None] & mask) != 0
    ignoring = ~(meets & meets.T)
    pairs = counts[:, None] * counts - np.diag(counts)
    return int((pairs * ignoring).sum()) // 2
