"""The plans of objects as ribbons on their ways."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.view.bodies import Floats
from collision_monitor.view.moment import Moment

POINTS: Final = 96
"""Points of a ribbon."""

MOST_RIBBONS: Final = 200
"""Ribbons of a picture, those of the lowest ids."""

WIDTH: Final = 0.5
"""Half of a ribbon's width, in half diagonals of the box about its object."""


def ribbons(moment: Moment, origin: Floats) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return one mesh of what is left of all plans in force: vertices (v, 3) in m from `origin`, faces (f, 3)."""
    strips = []
    rows = moment.rows_of(np.array(sorted(moment.plans)[:MOST_RIBBONS], np.uint32))
    for row in rows[rows >= 0].tolist():
        plan = moment.plans[int(moment.ids[row])]
        now = plan.seconds(moment.stamp_ns)
        times = np.linspace(now, max(float(plan.path.times[-1]), now), POINTS)
        points = plan.path.rows(times)[:, :3] - origin
        along = np.gradient(points, axis=0)
        side = np.column_stack([-along[:, 1], along[:, 0], np.zeros(POINTS)])
        length = np.linalg.norm(side, axis=1, keepdims=True)
        if not (length > 0.0).any():  # it stands, or only rises
            continue
        moves = np.flatnonzero(length[:, 0] > 0.0)
        nearest = moves[np.clip(np.searchsorted(moves, np.arange(POINTS)), 0, len(moves) - 1)]
        half = WIDTH * float(moment.bodies.reach[moment.body[row]]) * side[nearest] / length[nearest]
        strips.append(np.stack([points - half, points + half], axis=1).reshape(-1, 3))
    if not strips:
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)
    k = 2 * np.arange(POINTS - 1)[:, None]
    faces = np.concatenate([k + np.array(corners) for corners in ((0, 2, 1), (1, 2, 3))])
    first = 2 * POINTS * np.arange(len(strips))[:, None, None]
    return np.concatenate(strips).astype(np.float32), (faces + first).reshape(-1, 3).astype(np.uint32)
