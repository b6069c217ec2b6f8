"""Time and errors of the ways to find a time of impact, on the pairs of a scene or a session."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.motion.stated_motion import Motion
from collision_monitor.query.impact.impact import Impact
from collision_monitor.query.impact.impact_by_method import NUMBERS
from collision_monitor.query.impact.time_of_impact import time_of_impact
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import HalfSpace, Shape

METHODS: Final = ("conservative_advancement", *NUMBERS)
HORIZON: Final = 2.0
"""Horizon (s)."""
TRUTH: Final = 1e-10
"""Tolerance (m) of the times that count as true."""
MOMENTS: Final = 10
"""Steps of the input whose pairs are examined."""
MOST_PAIRS: Final = 100
"""Most pairs of each of these steps, the nearest ones."""

Moving = tuple[Shape, Motion]


@dataclass(frozen=True)
class ImpactMeasurement:
    """Result of one method on one scene."""

    scene: str
    method: str
    pairs: int
    """Pairs that the method takes; it refuses the others."""
    call_us: float
    """Median time of a call from Python (µs)."""
    hits: int
    missed: int
    """Pairs that meet, and that the method does not report as a hit; it reports them as unresolved."""
    late_s: float
    """Latest upper end after the true time (s)."""
    early_s: float
    """Earliest lower end of a hit before the true time (s)."""

    def to_dict(self) -> dict[str, Any]:
        """Fields by name, for JSON and CSV."""
        return asdict(self)


def impact_tradeoff(work: Workload, progress: Callable[[int], None]) -> list[ImpactMeasurement]:
    """Measure all methods on the pairs of single convex shapes of MOMENTS steps. progress: called after each method."""
    pairs = [pair for moment in _moments(work) for pair in _near_pairs(moment)]
    truths = [_impact(pair, "conservative_advancement", TRUTH)[0] for pair in pairs]
    rows = []
    for method in METHODS:
        rows.append(_measure(work.name, method, pairs, truths))
        progress(1)
    return rows


def _moments(work: Workload) -> Iterator[list[Moving]]:
    """Shapes with their motions at some steps, spread over the input."""
    described = {it.object_id: it for it in work.descriptions if len(it.shapes) == 1}
    still = [
        (it.shapes[0][0], Motion(it.pose @ it.shapes[0][1]))
        for it in described.values()
        if it.static and it.pose is not None
    ]
    chosen = np.unique(np.linspace(0, len(work.steps) - 1, MOMENTS).astype(int))
    for _, states in (work.steps[k] for k in chosen):
        moving = []
        for state in states:
            it = described.get(int(state["id"]))
            if it is not None and not it.static and not it.shapes[0][1].position.any():
                pose = Pose(state["position"], state["quaternion"]) @ it.shapes[0][1]
                moving.append((it.shapes[0][0], Motion(pose, state["linear"], state["angular"])))
        yield [*moving, *still]


def _near_pairs(objects: Sequence[Moving]) -> list[tuple[Moving, Moving]]:
    """Pairs whose bounding spheres could meet within the horizon, nearest first."""
    bounded = [each for each in objects if not isinstance(each[0], HalfSpace)]
    if len(bounded) < 2:
        return []
    directions = np.concatenate([sign * np.array(KDOP_DIRECTIONS[26], float) for sign in (1, -1)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radius = np.array([1.2 * reach([(shape, Pose())], directions).max() for shape, _ in bounded])
    position = np.array([motion.pose.position for _, motion in bounded])
    velocity = np.array([motion.linear for _, motion in bounded])
    i, j = np.triu_indices(len(bounded), 1)
    gap = np.linalg.norm(position[i] - position[j], axis=1) - radius[i] - radius[j]
    speed = np.linalg.norm(velocity[i] - velocity[j], axis=1)
    near = np.flatnonzero((gap > 0.0) & (gap < speed * HORIZON))
    near = near[np.argsort(gap[near], kind="stable")][:MOST_PAIRS]
    return [(bounded[i[k]], bounded[j[k]]) for k in near]


def _impact(pair: tuple[Moving, Moving], method: str, tolerance: float) -> tuple[Impact, float]:
    """Impact, and the time of the call (s). Raises UnsupportedError."""
    (shape_a, motion_a), (shape_b, motion_b) = pair
    begin = time.perf_counter()
    found = time_of_impact(shape_a, motion_a, shape_b, motion_b, HORIZON, tolerance, method=method)
    return found, time.perf_counter() - begin


def _measure(
    scene: str, method: str, pairs: Sequence[tuple[Moving, Moving]], truths: Sequence[Impact]
) -> ImpactMeasurement:
    seconds, late, early, hits, missed = [], 0.0, 0.0, 0, 0
    for pair, truth in zip(pairs, truths, strict=True):
        try:
            found, took = _impact(pair, method, 1e-6)
        except UnsupportedError:
            continue
        seconds.append(took)
        hits += found.status == "hit"
        missed += truth.status == "hit" and found.status != "hit"
        if truth.status == found.status == "hit":
            late, early = max(late, found.upper - truth.lower), max(early, truth.upper - found.lower)
    microseconds = 1e6 * float(np.median(seconds)) if seconds else np.nan
    return ImpactMeasurement(scene, method, len(seconds), microseconds, hits, missed, late, early)
