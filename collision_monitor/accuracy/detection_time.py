"""Time of full contact detection, with new poses in every frame."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from collision_monitor._version import VERSION

if TYPE_CHECKING:
    from collision_monitor.world.moving_bodies import MovingBodies

WARM_UP_FRAMES: Final = 2
"""Frames at the start that do not count."""
CHECKED_FRAME: Final = 4
"""Frame whose number of pairs is reported. The answers of other systems are compared at this frame."""


def time_detection(
    scene: MovingBodies, threads: int, frames: int | None = None, broad_phase: str = "grid"
) -> dict[str, Any]:
    """Return median, 99th percentile and minimum (ms) of the time per frame, with the settings of the measurement.

    Raises InputError for an unknown broad phase.
    """
    from collision_monitor.detection.detector import (
        Detector,  # imported here because it loads the compiler, which would slow --help down
    )

    detector = Detector(scene.shapes, threads=threads, broad_phase=broad_phase)
    detector.detect(scene.positions[0], scene.quaternions[0])  # compiles the kernels if they are not cached
    count = min(frames or len(scene.positions), len(scene.positions))
    warm_up = min(WARM_UP_FRAMES, count - 1)
    milliseconds, pairs = [], 0
    for frame in range(count):
        begin = time.perf_counter_ns()
        contacts = detector.detect(scene.positions[frame], scene.quaternions[frame])
        _ = contacts.pairs, contacts.signed_distance, contacts.normal, contacts.point
        milliseconds.append((time.perf_counter_ns() - begin) / 1e6)
        if frame <= CHECKED_FRAME:
            pairs = len(contacts)
    counted = np.array(milliseconds[warm_up:])
    return {
        "scene": scene.name,
        "n": len(scene.shapes),
        "seed": scene.seed,
        "threads": threads,
        "frames": len(counted),
        "median_ms": float(np.median(counted)),
        "p99_ms": float(np.percentile(counted, 99)),
        "min_ms": float(counted.min()),
        "pairs": pairs,
        "version": VERSION,
    }
