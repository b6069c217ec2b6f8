"""Collision of two particles on straight paths: both must be near the paths' closest points at the same time.

(Slides "Particle-Particle Collision in 2D" and "in 3D".) This is the lecture's test for points; the prediction of
shapes with certified times is in `impact/`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_array
from collision_monitor.geometry.coordinates import Array, Booleans, coordinates
from collision_monitor.geometry.lecture.closest_points import closest_points
from collision_monitor.geometry.lines import LineKind
from collision_monitor.tolerances import EPSILON

ROUND_OFF = 8 * EPSILON
"""Distances that differ by less than this part of the particles' offset are equal: the round-off of both."""


class ParticleEncounter(NamedTuple):
    """collides (...); distance (m) of the paths; times alpha, beta (s) when A and B pass their closest points."""

    collides: Booleans
    distance: Array
    alpha: Array
    beta: Array


def particle_particle(
    p_a: ArrayLike,
    v_a: ArrayLike,
    p_b: ArrayLike,
    v_b: ArrayLike,
    distance_threshold: float,
    time_threshold: float,
) -> ParticleEncounter:
    """Whether particles at p (m) with velocities v (m/s), all (..., 2 or 3), are near each other at the same time.

    min over alpha, beta >= 0 of |p_A + alpha v_A - (p_B + beta v_B)| <= distance_threshold and
    |alpha - beta| <= time_threshold. For parallel paths, many alpha and beta are minimal. The time of closest approach
    is used for both if it is minimal; otherwise two particles head-on would pass through each other.
    """
    position_a, velocity_a = _in_space(p_a, "p_a"), _in_space(v_a, "v_a")
    position_b, velocity_b = _in_space(p_b, "p_b"), _in_space(v_b, "v_b")
    offset = position_b - position_a  # seen from A, so that distance from the origin costs no accuracy
    nearest = closest_points(np.zeros(3), velocity_a, offset, velocity_b, LineKind.RAY, LineKind.RAY)
    time, distance = closest_approach(p_a, v_a, p_b, v_b)
    at_once = distance <= nearest.distance + ROUND_OFF * np.linalg.norm(offset, axis=-1)
    alpha, beta = np.where(at_once, time, nearest.alpha), np.where(at_once, time, nearest.beta)
    near = nearest.distance <= checked_array(distance_threshold, "distance_threshold", least=0.0)
    together = np.abs(alpha - beta) <= checked_array(time_threshold, "time_threshold", least=0.0)
    return ParticleEncounter(np.asarray(near & together), nearest.distance, alpha, beta)


def closest_approach(p_a: ArrayLike, v_a: ArrayLike, p_b: ArrayLike, v_b: ArrayLike) -> tuple[Array, Array]:
    """Time t >= 0 (s) at which two particles are closest, and their distance (m) then; p, v as in particle_particle.

    The lecture's test approximates this. One time for both particles needs no time threshold.
    """
    offset = coordinates(p_b, "p_b") - coordinates(p_a, "p_a")
    velocity = coordinates(v_b, "v_b") - coordinates(v_a, "v_a")
    speed2 = (velocity * velocity).sum(axis=-1)
    closing = -(offset * velocity).sum(axis=-1)
    time = np.maximum(np.where(speed2 > 0.0, closing / np.where(speed2 > 0.0, speed2, 1.0), 0.0), 0.0)
    return time, np.asarray(np.linalg.norm(offset + time[..., None] * velocity, axis=-1))


def _in_space(value: ArrayLike, what: str) -> Array:
    array = coordinates(value, what)
    return array if array.shape[-1] == 3 else np.concatenate([array, np.zeros((*array.shape[:-1], 1))], axis=-1)
