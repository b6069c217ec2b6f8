"""The closest approach of pairs that go on as they move: when it is (TCPA), and how near they come (DCPA).

The distance at one time bounds the distances before and after it: it changes at most as fast as points of both bodies
approach each other. For two convex bodies the bound is tighter: the gap along the normal changes with their relative
velocity along it, and beyond that only by what they turn. The interval with the lowest bound is divided where its two
bounds meet (Piyavskii, An algorithm for finding the absolute extremum of a function, 1972).
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.alerts.measures import Array, Slots
from collision_monitor.alerts.monitored_bodies import MonitoredBodies
from collision_monitor.impact.body_contact import RESULT, ContactQuery, body_contact
from collision_monitor.narrow_phase.contact_row import BOUND, DISTANCE, NORMAL
from collision_monitor.uncertainty.sampled_impacts import body_has_mesh

MOST: Final = 65
"""Most distances of a pair."""

TOLERANCE: Final = 1e-3
"""Gap between the bound and the smallest distance that was found, in parts of the longest relative path."""

INSIDE: Final = 0.02
"""A new time is at least this part of the interval away from its ends, because the meeting of two bounds may not be."""

TIME, LEAST, SLOPE = range(3)
"""Rows of `samples`: times (s from now), lower bounds of the distance there (m), and their rates of change (m/s)."""


def sphere_approach(scene: MonitoredBodies, i: Slots, j: Slots, horizon: float) -> Array:
    """Return a lower bound (n,) of the distance (m) within the horizon (s), by the bounding spheres."""
    p = scene.position[j] - scene.position[i]
    v = scene.velocity[j] - scene.velocity[i]
    speed2 = (v**2).sum(axis=1)
    along = -(p * v).sum(axis=1)
    t = np.clip(np.divide(along, speed2, out=np.zeros(len(p)), where=speed2 > 0.0), 0.0, horizon)
    bend = 0.5 * scene.relative_acceleration(i, j) * horizon**2
    reach = scene.radius[i] + scene.radius[j] + scene.doubt[i] + scene.doubt[j] + bend
    return np.asarray(np.sqrt(((p + t[:, None] * v) ** 2).sum(axis=1)) - reach)


def closest_approaches(
    scene: MonitoredBodies, i: Slots, j: Slots, horizon: float, enough: float = inf
) -> tuple[Array, Array]:
    """Return TCPA (s from now) and DCPA (m, the smallest that its error allows) within the horizon (s), each (n,).

    enough: m; a pair that is found to stay farther apart is not searched any further, and its DCPA is a lower bound.
    """
    velocity = scene.velocity[j] - scene.velocity[i]
    rate = scene.turning[i] + scene.turning[j] + scene.relative_acceleration(i, j) * horizon
    doubt = scene.doubt[i] + scene.doubt[j]
    found, samples = np.empty((2, len(i))), np.empty((3, MOST))
    window = scene.now, horizon
    _search(
        *(scene.roster.multibody, i, j, velocity, rate, window, enough + doubt),
        *(scene.scratch, np.empty(RESULT), samples, found),
    )
    return found[0], found[1] - doubt


@kernel
def _search(
    multibody: Any,
    first: Any,
    second: Any,
    velocity: Any,
    rate: Any,
    window: Any,
    enough: Any,
    scratch: Any,
    row: Any,
    samples: Any,
    found: Any,
) -> int:
    """Write the time and the lower bound of the smallest distance of each pair into found (2, n).

    velocity (n, 3): of the second body relative to the first. rate (n,): how fast the gap along a fixed direction may
    change beyond it (m/s). window: the time now and the horizon (s). enough (n,): see `closest_approaches`.
    """
    horizon = window[1]
    for k in range(first.size):
        v = (velocity[k, 0], velocity[k, 1], velocity[k, 2])
        i, j = first[k], second[k]
        speed = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        is_convex = _is_convex(multibody, i) and _is_convex(multibody, j)
        beyond = rate[k] if is_convex else rate[k] + speed
        tolerance = TOLERANCE * (speed + rate[k]) * horizon
        for n, t in enumerate((0.0, horizon)):
            _sample(multibody, i, j, window, t, v, is_convex, scratch, row, samples, n)
        count = 2
        while True:
            at, t, bound = _lowest(samples, count, beyond)
            best = samples[LEAST, _nearest(samples, count)]
            if count == MOST or bound > enough[k] or bound >= best - tolerance:
                break
            for n in range(count, at + 1, -1):
                for each in range(3):
                    samples[each, n] = samples[each, n - 1]
            _sample(multibody, i, j, window, t, v, is_convex, scratch, row, samples, at + 1)
            count += 1
        found[0, k] = samples[TIME, _nearest(samples, count)]
        found[1, k] = min(bound, best)
    return 0


@inlined
def _is_convex(multibody: Any, i: Any) -> Any:
    """Whether a body is one convex shape."""
    table, parts, bodies = multibody
    shape = bodies.first_shape[i]
    return parts.next[shape] < 0 and not bodies.concave[i] and not body_has_mesh(table, parts, shape)


@device
def _sample(
    multibody: Any,
    i: Any,
    j: Any,
    window: Any,
    t: Any,
    v: Any,
    is_convex: Any,
    scratch: Any,
    row: Any,
    samples: Any,
    n: Any,
) -> None:
    """Compute the distance of a pair at a time t (s from now) and write it as sample n."""
    body_contact(multibody, i, j, window[0] + t, ContactQuery(inf, 0.0), scratch, row)
    slope = row[NORMAL] * v[0] + row[NORMAL + 1] * v[1] + row[NORMAL + 2] * v[2]
    samples[TIME, n], samples[LEAST, n] = t, row[DISTANCE] - row[BOUND]
    samples[SLOPE, n] = slope if is_convex and isfinite(slope) else 0.0


@inlined
def _nearest(samples: Any, count: Any) -> Any:
    """Return the sample with the smallest distance."""
    at = 0
    for n in range(1, count):
        if samples[LEAST, n] < samples[LEAST, at]:
            at = n
    return at


@device
def _lowest(samples: Any, count: Any, beyond: Any) -> Any:
    """Return the interval with the lowest bound, the time at which to divide it, and the bound.

    beyond: m/s by which the rate of change may differ from a sample's slope.
    """
    at, when, lowest = 0, 0.0, inf
    for n in range(count - 1):
        t, span = samples[TIME, n], samples[TIME, n + 1] - samples[TIME, n]
        left, right = samples[LEAST, n], samples[LEAST, n + 1]
        down, up = samples[SLOPE, n] - beyond, samples[SLOPE, n + 1] + beyond  # of the lines from both ends
        x = 0.0 if down >= 0.0 else span
        bound = left if down >= 0.0 else right
        if down < 0.0 < up:
            x = min(max((right - left - up * span) / (down - up), 0.0), span)
            bound = min(left, right, max(left + down * x, right - up * (span - x)))
        if bound < lowest:
            at, lowest = n, bound
            when = t + min(max(x, INSIDE * span), (1.0 - INSIDE) * span)
    return at, when, lowest
