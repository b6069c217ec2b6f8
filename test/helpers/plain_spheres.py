"""A plain event-driven simulation: at each event, the times of all pairs and walls again. The oracle of the tests."""

from __future__ import annotations

import itertools

import numpy as np


def simulate(positions, velocities, radii, side, *, periodic, restitution, collisions):
    """Return the first collisions as (time, a, b); a wall is -1 - 2 * axis, or one less for the upper wall."""
    at, moving = np.array(positions, float), np.array(velocities, float)
    masses, time, happened = (2 * radii) ** 3, 0.0, []
    images = list(itertools.product((-1, 0, 1), repeat=3)) if periodic else [(0, 0, 0)]
    first, second = np.triu_indices(len(at), 1)
    contact = (radii[first] + radii[second])[:, None]
    while len(happened) < collisions:
        if periodic:
            at = np.mod(at, side)
        offset = (at[second] - at[first])[:, None] + side * np.array(images)[None]
        times = contact_times(offset, (moving[second] - moving[first])[:, None], contact)
        pair, image = np.unravel_index(times.argmin(), times.shape)
        best = (times[pair, image], first[pair], second[pair], images[image])
        if not periodic:
            for a, axis in itertools.product(range(len(at)), range(3)):
                speed = moving[a, axis]
                if speed:
                    wall = side - radii[a] if speed > 0 else radii[a]
                    when = (wall - at[a, axis]) / speed
                    if when < best[0]:
                        best = (when, a, -1 - 2 * axis - (speed > 0), None)
        longest = side / 4 / np.abs(moving).max()  # further images are not looked at
        if best[0] > longest:
            at += longest * moving
            time += longest
            continue
        step, a, b, image = best
        at += step * moving
        time += step
        happened.append((time, a, b))
        if b < 0:
            moving[a, (-1 - b) // 2] *= -restitution
        else:
            offset = at[b] - at[a] + side * np.array(image)
            normal = offset / np.linalg.norm(offset)
            impulse = (1 + restitution) * ((moving[b] - moving[a]) @ normal) / (1 / masses[a] + 1 / masses[b])
            moving[a] += impulse / masses[a] * normal
            moving[b] -= impulse / masses[b] * normal
    return happened


def contact_times(offset, velocity, contact):
    """Times at which spheres touch first; infinite if they separate or miss each other."""
    a, b, c = (velocity**2).sum(-1), (offset * velocity).sum(-1), (offset**2).sum(-1) - contact**2
    inside = b * b - a * c
    meets = (b < 0) & (inside > 0)
    root = (-b - np.sqrt(np.where(meets, inside, 0))) / np.where(meets, a, 1)
    return np.where(meets, np.maximum(root, 0), np.inf)
