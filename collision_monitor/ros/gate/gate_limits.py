"""What a gate keeps, and how far it relies on what it knows."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GateLimits:
    """clearance: m to keep. reaction: s from a measurement to the brakes. stop_time: s from the full rate to a stop.

    ahead: s for which the motions of moving objects are relied on. tolerance: m by which the robot may be off its plan;
    time_tolerance: s by which it may be late or early. start_tolerance: rad or m between the joints and a first point
    that is now. speed: m/s of a base along a path.
    """

    clearance: float = 0.05
    reaction: float = 0.3
    stop_time: float = 0.5
    ahead: float = 3.0
    tolerance: float = 0.15
    time_tolerance: float = 0.5
    start_tolerance: float = 0.05
    speed: float = 1.0
