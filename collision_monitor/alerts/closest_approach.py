"""The closest approach of pairs that go on as they move: when it is (TCPA), and how near they come (DCPA).

The distance of two bodies changes at most as fast as their points approach each other. So the distances at two times
bound it in between, and the intervals with the lowest bounds are divided again and again.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.alerts.measures import Array, Slots
from collision_monitor.alerts.nearest import nearest
from collision_monitor.alerts.scene import Scene

BEGIN: Final = 17
"""Times in the horizon, ends included, at which the distance is computed first."""

ROUNDS: Final = 12
DIVIDED: Final = 4
"""How often the intervals with the lowest bounds are halved, and how many at once: 65 distances for each pair."""


def sphere_approach(scene: Scene, i: Slots, j: Slots, horizon: float) -> Array:
    """Return a lower bound (n,) of the distance (m) within the horizon (s), by the bounding spheres."""
    p = scene.position[j] - scene.position[i]
    v = scene.velocity[j] - scene.velocity[i]
    bent = scene.roster.bodies.acceleration
    speed2 = (v**2).sum(axis=1)
    along = -(p * v).sum(axis=1)
    t = np.clip(np.divide(along, speed2, out=np.zeros(len(p)), where=speed2 > 0.0), 0.0, horizon)
    bend = 0.5 * np.sqrt(((bent[j] - bent[i]) ** 2).sum(axis=1)) * horizon**2
    reach = scene.radius[i] + scene.radius[j] + scene.doubt[i] + scene.doubt[j] + bend
    return np.asarray(np.sqrt(((p + t[:, None] * v) ** 2).sum(axis=1)) - reach)


def closest_approach(scene: Scene, i: Slots, j: Slots, horizon: float) -> tuple[Array, Array]:
    """Return TCPA (s from now) and DCPA (m, the smallest that its error allows) within the horizon (s), each (n,)."""
    n = len(i)
    bent = scene.roster.bodies.acceleration
    speed = np.sqrt(((scene.velocity[j] - scene.velocity[i]) ** 2).sum(axis=1)) + scene.turning[i] + scene.turning[j]
    rate = (speed + np.sqrt(((bent[j] - bent[i]) ** 2).sum(axis=1)) * horizon)[:, None]  # m/s

    def bounds(times: Array) -> Array:
        """Lower bounds (n, k) of the distances at these times (n, k)."""
        flat = scene.now + times.ravel()
        pairs = np.repeat(i, times.shape[1]), np.repeat(j, times.shape[1])
        found = nearest(scene, *pairs, flat, np.full(len(flat), np.inf), widen=False)
        return np.asarray((found.distance - found.error).reshape(times.shape))

    times = np.tile(np.linspace(0.0, horizon, BEGIN), (n, 1))
    least = bounds(times)
    rows = np.arange(n)[:, None]
    for _ in range(ROUNDS):
        worst = np.argpartition(_between(times, least, rate), DIVIDED, axis=1)[:, :DIVIDED]
        new = 0.5 * (times[rows, worst] + times[rows, worst + 1])
        times, least = np.hstack([times, new]), np.hstack([least, bounds(new)])
        order = np.argsort(times, axis=1, kind="stable")
        times, least = times[rows, order], least[rows, order]
    at = least.argmin(axis=1)
    distance = np.minimum(_between(times, least, rate).min(axis=1), least.min(axis=1))
    return times[rows[:, 0], at], distance - scene.doubt[i] - scene.doubt[j]


def _between(times: Array, least: Array, rate: Array) -> Array:
    """Lower bounds (n, k - 1) of the distance between each two neighbouring times."""
    return np.asarray(0.5 * (least[:, :-1] + least[:, 1:] - rate * np.diff(times, axis=1)))
