"""Predicted paths of tracked objects: the likeliest one as their plan, with a tube that holds the others.

A monitor follows one plan of an object. What lies within the tube cannot be excluded, so an object that another
prediction of the tracker meets is reported as UNRESOLVED, from the likeliest path's point of view.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.motion.trajectory import Tolerance
from collision_monitor.sources.plans.headings import headings_along

Floats = NDArray[np.float64]

ALL, LIKELIEST, IGNORED = PATHS = ("all", "likeliest", "ignored")
"""Values of the key `paths`."""

TOLERANCE: Final = Tolerance(across=0.5, along=1.0, angle=0.5, time=0.5)
"""Of predicted paths. Smaller: tracks that jitter leave them between two messages."""

LONGER: Final = 1.5
"""How far ahead the tube holds the other paths, in horizons: until the next message."""

MOST_POSES: Final = 1000
"""Poses of a path. Autoware has 20 to 100."""

LEAST_CONFIDENCE: Final = 1e-3
"""Paths that are less likely do not count."""


class PredictedPath(NamedTuple):
    """A path: poses (n, 7) at the multiples of time_step (s), from the stamp of the message on."""

    confidence: float
    time_step: float
    poses: Floats

    @property
    def times(self) -> Floats:
        """Times (n,) of the poses (s)."""
        return np.arange(len(self.poses), dtype=np.float64) * self.time_step


class PathPlan(NamedTuple):
    """The plan of an object: times (n,) s, poses (n, 7), and the tube (m) that holds the other paths."""

    times: Floats
    poses: Floats
    tube: float


def plan_of_paths(paths: Sequence[PredictedPath], horizon: float, radius: float, *, alone: bool) -> PathPlan | None:
    """Return the plan on the likeliest path; None without a path of at least two poses.

    radius: of the object about its origin (m). alone: leave out the other paths. The tube holds each other path until
    LONGER horizons, as far as it goes, with the turn of the object between both. Raises InputError.
    """
    usable = []
    for path in paths:
        if not path.time_step > 0.0 or len(path.poses) > MOST_POSES:
            raise InputError(
                f"predicted path: expected up to {MOST_POSES} poses and a time step above 0 s, got {len(path.poses)} "
                f"and {path.time_step:g} s"
            )
        if len(path.poses) > 1:
            usable.append(path)
    if not usable:
        return None
    likeliest = max(usable, key=lambda path: path.confidence if path.confidence >= 0.0 else -1.0)
    best = likeliest._replace(poses=_oriented(likeliest.poses))
    tube = 0.0
    for path in usable:
        if path is not likeliest and not alone and not path.confidence < LEAST_CONFIDENCE:
            tube = max(tube, _apart(*_side_by_side(best, path, LONGER * horizon), radius))
    return PathPlan(best.times, best.poses, tube)


def _oriented(poses: Floats) -> Floats:
    """Poses (n, 7), with headings along the path where all orientations are zeros."""
    if poses[:, 3:].any():
        return poses
    return np.concatenate([poses[:, :3], headings_along(poses[:, :3])], axis=1)


def _side_by_side(one: PredictedPath, other: PredictedPath, until: float) -> tuple[Floats, Floats]:
    """Poses (m, 7) of both paths at all times at which either has a pose, up to `until` (s) or the end of one."""
    other = other._replace(poses=_oriented(other.poses))
    if one.time_step == other.time_step:
        count = min(len(one.poses), len(other.poses), int(until / one.time_step) + 2)
        return one.poses[:count], other.poses[:count]
    end = min(one.times[-1], other.times[-1], until)
    nodes = np.union1d(np.concatenate([one.times, other.times]).clip(max=end), [0.0, end])
    first, second = (
        np.column_stack([np.interp(nodes, path.times, column) for column in _continuous(path.poses).T])
        for path in (one, other)
    )
    return first, second


def _apart(one: Floats, other: Floats, radius: float) -> float:
    """Largest distance (m) of points within `radius` of the origins at poses (m, 7) of two polylines in time.

    Between two points of either, the distance of the origins is convex in time, so that it is largest at a point.
    """
    cosine = np.abs((one[:, 3:] * other[:, 3:]).sum(axis=1))
    size = np.sqrt((one[:, 3:] ** 2).sum(axis=1) * (other[:, 3:] ** 2).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        chord = 2.0 * np.sqrt(np.maximum(1.0 - np.nan_to_num(cosine / size) ** 2, 0.0))
    return float((np.sqrt(((one[:, :3] - other[:, :3]) ** 2).sum(axis=1)) + radius * chord).max())


def _continuous(poses: Floats) -> Floats:
    """Poses with quaternions of alike signs, so that they can be interpolated."""
    found = poses.copy()
    flips = (found[1:, 3:] * found[:-1, 3:]).sum(axis=1) < 0.0
    found[1:, 3:][np.cumsum(flips) % 2 == 1] *= -1.0
    return found
