"""Check `cm.conflicts` against samples: poses by SciPy, overlaps by FCL, for all pairs of random fleets.

    nice python benchmarks/conflict_oracle.py                 # 300 fleets
    nice python benchmarks/conflict_oracle.py --fleets 20     # a quick look

Each fleet has ten bodies of all kinds on random plans and four that stand, close together or spread. A pair that
overlaps by more than 1e-6 m at a sampled time is missed if it has no conflict, late if the time is before all of its
conflicts, and lost if the time is in none. A conflict is false if the bodies, larger by 4e-6 m and by how far curves
are off their pieces, are apart at a time within it. The fleet in reverse order has to have the same conflicts. The
widths of the bounds on entries and exits are those of pairs on lines and arcs whose gap is more than 1e-5 m 1e-4 s
before and after. Exit code 1: an answer is wrong.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from itertools import combinations
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from plan_oracle import (
    DEEP,
    KINDS,
    UNIT,
    Body,
    Plan,
    is_within_ring,
    overlap,
    random_body,
    random_plan,
)

import collision_monitor as cm
from collision_monitor.cli.output.progress import progress_bar

Array = NDArray[np.float64]
WRONG = ("missed", "late", "lost", "false", "swapped")
SAMPLES = 120
HORIZON = 3.0
MOVING = tuple(kind for kind in KINDS if kind != "half-space")


class Member(NamedTuple):
    """A body with its plan; a static one has one of zero speed."""

    body: Body
    plan: Plan

    def at(self, t: Array) -> Any:
        """Positions and rotations at times."""
        return self.plan.poses(t)


def random_fleet(rng: np.random.Generator) -> list[Member]:
    """Ten bodies that move, and four that stand."""
    wide = float(rng.choice([1.0, 3.0]))
    fleet = []
    for k in range(14):
        stands = k >= 10
        kind = str(rng.choice(KINDS if k == 13 else MOVING))
        plan = random_plan(rng, kind != "half-space", stands or rng.random() < 0.15)
        shift = rng.normal(0.0, wide, 3)
        plan.position = plan.position + (shift if kind != "half-space" else -shift)
        if stands:
            plan.between, plan.change, plan.stops = "world", 0.0, False
            plan.velocity, plan.turning = 0.0 * plan.velocity, 0.0 * plan.turning
        plan.change = min(plan.change, 1.0)
        fleet.append(Member(random_body(rng, kind, 1.0), plan))
    return fleet


def answers(fleet: list[Member], order: list[int]) -> list[cm.Conflict]:
    """The conflicts of the fleet, given in an order."""
    motions = {k: fleet[k].plan.motion(1.0, 1.0) for k in order}
    moving = [k for k in order if k < 10]
    world = {k: (fleet[k].body.shape, motions[k].pose) for k in order if k >= 10}
    return cm.conflicts({k: fleet[k].body.shape for k in moving}, {k: motions[k] for k in moving}, world, HORIZON)


def check(fleet: list[Member], rng: np.random.Generator, widths: list[tuple[float, float]]) -> Counter[str]:
    """Compare the conflicts of a fleet with samples of each pair."""
    counts: Counter[str] = Counter(fleets=1)
    found = answers(fleet, list(range(14)))
    of_pair: dict[tuple[int, int], list[cm.Conflict]] = {}
    for each in found:
        counts[each.status] += 1
        if each.b is not None:
            of_pair.setdefault((min(each.a, each.b), max(each.a, each.b)), []).append(each)  # type: ignore[type-var]
    back: dict[tuple[int, int], list[cm.Conflict]] = {}
    for each in answers(fleet, list(range(9, -1, -1)) + list(range(13, 9, -1))):
        if each.b is not None:
            back.setdefault((min(each.a, each.b), max(each.a, each.b)), []).append(each)  # type: ignore[type-var]
    for i, j in combinations(range(14), 2):
        if i >= 10:
            continue
        own, until = of_pair.get((i, j), []), min(HORIZON, fleet[i].plan.until, fleet[j].plan.until)
        counts["pairs"] += 1
        _compare(fleet, (i, j), own, until, rng, counts)
        counts["swapped"] += not _agree(own, back.get((i, j), []))
        tubes = _tubes(fleet, i, j)
        if tubes == 0.0:
            widths += [
                (each.entry[1] - each.entry[0], each.exit[1] - each.exit[0]) for each in own if _is_transversal(each)
            ]
    return counts


def _compare(
    fleet: list[Member], pair: tuple[int, int], own: list[cm.Conflict], until: float, rng: Any, counts: Counter[str]
) -> None:
    (a, plan_a), (b, plan_b) = fleet[pair[0]], fleet[pair[1]]
    ends = [t for each in own for t in (each.entry[0], each.exit[1]) if 0.0 < t < inf]
    near = [t + sign * part for t in ends for part in 0.5 ** np.arange(3, 21, 3) for sign in (-1, 1)]
    t = np.unique(np.concatenate([np.linspace(0.0, max(until, 0.0), SAMPLES), near]))
    t = t[(t >= 0.0) & (t < until)]
    (p_a, r_a), (p_b, r_b) = plan_a.poses(t), plan_b.poses(t)
    deep = [t[k] for k in range(len(t)) if overlap(a, b, (p_a[k], r_a[k], p_b[k], r_b[k]), -DEEP)]
    counts["overlaps"] += len(deep)
    for each in deep:
        if not any(one.entry[0] - 1e-9 <= each <= one.exit[1] + 1e-9 for one in own):
            counts["missed" if not own else "late" if each < min(one.entry[0] for one in own) else "lost"] += 1
    for one in own:
        if one.status == "hit":
            for part in (0.0, *rng.random(2), 1.0):
                time = np.array([one.entry[1] + part * (min(one.exit[0], HORIZON) - one.entry[1])])
                (q_a, s_a), (q_b, s_b) = plan_a.poses(time), plan_b.poses(time)
                poses = (q_a[0], s_a[0], q_b[0], s_b[0])
                grown = 4.0 * DEEP + 2.0 * _tubes(fleet, *pair)
                counts["false"] += not (overlap(a, b, poses, grown) or is_within_ring(a, b, poses))


def _tubes(fleet: list[Member], i: int, j: int) -> float:
    plans = (fleet[k].plan.motion(1.0, 1.0, UNIT) for k in (i, j))
    return sum(float(each.tubes.max()) for each in plans if isinstance(each, cm.Trajectory))


def _is_transversal(each: cm.Conflict) -> bool:
    """Whether the two close, and part, at 0.1 m/s or more."""
    if each.status != "hit" or each.exit[1] == inf or each.entry[0] == 0.0:
        return False
    shape_a, one, shape_b, other = each.sides
    gaps = [
        cm.contact(shape_a, one.at(t), shape_b, other.at(t)).signed_distance
        for t in (each.entry[0] - 1e-4, each.exit[1] + 1e-4)
    ]
    return min(gaps) > 1e-5


def _agree(own: list[cm.Conflict], other: list[cm.Conflict]) -> bool:
    """Whether two answers can be about the same contacts."""
    for some, others in ((own, other), (other, own)):
        for each in some:
            if each.status == "hit":
                middle = each.entry[1]
                if not any(one.entry[0] - 1e-9 <= middle <= one.exit[1] + 1e-9 for one in others):
                    return False
    return True


def main() -> int:
    """Print the counts; return 1 if an answer is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fleets", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    os.environ["NUMBA_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    total: Counter[str] = Counter()
    widths: list[tuple[float, float]] = []
    with progress_bar("conflict oracle", args.fleets) as done:
        for number in range(args.fleets):
            rng = np.random.default_rng((args.seed, number))
            counts = check(random_fleet(rng), rng, widths)
            total += counts
            for name in WRONG:
                if counts[name]:
                    print(f"fleet {number}: {counts[name]} {name}", file=sys.stderr)
            done(1)
    names = ("fleets", "pairs", "hit", "unresolved", "overlaps", *WRONG)
    print(", ".join(f"{name} {total[name]}" for name in names))
    if widths:
        entry, leaving = np.array(widths).T
        print(
            f"{len(widths)} conflicts on lines and arcs: bounds on the entry at most {entry.max():.1e} s wide "
            f"(median {np.median(entry):.1e}), on the exit {leaving.max():.1e} s (median {np.median(leaving):.1e})"
        )
    return int(any(total[name] for name in WRONG))


if __name__ == "__main__":
    sys.exit(main())
