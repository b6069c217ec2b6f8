"""Speed and correctness of the event-driven simulation of hard spheres: collisions per second, energy, pressure."""

from __future__ import annotations

import time
from typing import Any, Final

import numpy as np

from collision_monitor._version import VERSION

PACKING: Final = 0.45
"""Packing without another choice. One of the two at which the peers are compared; the other is 0.25."""
BLOCKS: Final = 10
COLLISIONS: Final = 2_000_000
"""Collisions to measure, about, in all blocks."""
PILOT: Final = 1.0
"""Simulated time (s) that tells how long the blocks have to be; it also loads the kernels."""
LONGEST_BLOCK: Final = 1000.0
"""Simulated time of a block (s) if collisions are rare."""


def measure_collision_rate(count: int, packing: float, seed: int) -> dict[str, Any]:
    """Simulate about COLLISIONS collisions between periodic walls, and return the figures. Raises InputError.

    collisions_per_s: collisions of two spheres by the time on the clock, and best: of the fastest block; per_cpu_s: by
    the time of the processor, which other programs change less. energy_drift: relative. pressure: Pa, which equals
    P d^3 / kT, as the spheres have a diameter d of 1 m, a mass of 1 kg and a temperature kT of 1 J.
    """
    from collision_monitor.world.hard_spheres.simulation import HardSpheres, carnahan_starling

    spheres = HardSpheres(count, packing, seed, walls="periodic")
    spheres.run(PILOT)
    block = min(PILOT * COLLISIONS / BLOCKS / max(spheres.collisions, 1), LONGEST_BLOCK)
    energy, before = spheres.energy, spheres.collisions
    rates, pressures = [], []
    began, cpu_began = time.perf_counter(), time.thread_time()
    for _ in range(BLOCKS):
        begin, collisions = time.perf_counter(), spheres.collisions
        spheres.run(block)
        rates.append((spheres.collisions - collisions) / (time.perf_counter() - begin))
        pressures.append(spheres.pressure)
    seconds, cpu_seconds = time.perf_counter() - began, time.thread_time() - cpu_began
    pressure = float(np.mean(pressures))
    scale = float((spheres.masses * np.linalg.norm(spheres.velocities, axis=1)).sum())
    return {
        "scene": "hard-spheres",
        "n": count,
        "packing": packing,
        "seed": seed,
        "collisions": spheres.collisions - before,
        "collisions_per_s": (spheres.collisions - before) / seconds,
        "best_collisions_per_s": max(rates),
        "collisions_per_cpu_s": (spheres.collisions - before) / cpu_seconds,
        "energy_drift": spheres.energy / energy - 1.0,
        "momentum_drift": float(np.linalg.norm(spheres.momentum)) / scale,
        "pressure": pressure,
        "compressibility": pressure * spheres.side**3 * 3.0 / (2.0 * spheres.energy),
        "carnahan_starling": carnahan_starling(packing),
        "version": VERSION,
    }
