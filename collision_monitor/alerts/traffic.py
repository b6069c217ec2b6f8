"""Measures of traffic conflicts: required deceleration, time headway and post-encroachment time."""

from __future__ import annotations

import numpy as np

from collision_monitor.alerts.measures import Array, Slots
from collision_monitor.alerts.monitored_bodies import MonitoredBodies


def required_deceleration(distance: Array, closing: Array) -> Array:
    """Return the constant deceleration (m/s²) that ends the approach at contact (DRAC): closing² / (2 distance).

    distance (n,) in m, closing (n,) in m/s. 0 for pairs that do not approach; infinite in contact.
    """
    approaches = closing > 0.0
    apart = np.maximum(distance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(approaches, closing**2 / (2.0 * apart), np.where(distance > 0.0, 0.0, np.inf)))


def time_headway(distance: Array, toward_a: Array, toward_b: Array) -> Array:
    """Return the time (s) in which the faster one covers the distance between them, if the other one stands.

    toward_a, toward_b (n,): speeds (m/s) of B toward A and of A toward B. Infinite if neither moves toward the other.
    """
    speed = np.maximum(toward_a, toward_b)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(speed > 0.0, np.maximum(distance, 0.0) / speed, np.inf))


def post_encroachment_time(scene: MonitoredBodies, i: Slots, j: Slots, horizon: float) -> Array:
    """Return the time (s) between one leaving the place where the paths cross and the other's arrival (n,).

    The paths are straight lines along the present velocities, and the bodies count as their bounding spheres, so the
    time is a lower bound. 0: both are there at one time. Infinite: the paths do not cross, are parallel, or the second
    one arrives later than the horizon (s) or has left already.
    (Allen, Shin and Cooper, Analysis of traffic conflicts and collisions, 1978, as predicted from the motions)
    """
    u, v = scene.velocity[i], scene.velocity[j]
    w = scene.position[j] - scene.position[i]
    reach = scene.radius[i] + scene.radius[j] + scene.doubt[i] + scene.doubt[j]
    uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
    across = uu * vv - uv * uv  # (|u| |v| sin)^2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        uw, vw = (u * w).sum(axis=1), (v * w).sum(axis=1)
        at_i, at_j = (uw * vv - vw * uv) / across, (uw * uv - vw * uu) / across
        gap2 = ((w + at_j[:, None] * v - at_i[:, None] * u) ** 2).sum(axis=1)
        width = np.sqrt(np.maximum(reach**2 - gap2, 0.0))
        span_i, span_j = width * np.sqrt(vv / across), width * np.sqrt(uu / across)
        later = np.maximum(at_i - span_i, at_j - span_j)
        earlier = np.minimum(at_i + span_i, at_j + span_j)
        crosses = (across > 1e-12 * uu * vv) & (uu > 0.0) & (vv > 0.0) & (gap2 <= reach**2)
        leaves = np.where(at_i - span_i > at_j - span_j, at_i + span_i, at_j + span_j)
        in_time = (later <= horizon) & (leaves >= 0.0)
        return np.asarray(np.where(crosses & in_time, np.maximum(later - earlier, 0.0), np.inf))
