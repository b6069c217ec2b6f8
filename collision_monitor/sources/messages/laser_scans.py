"""sensor_msgs/LaserScan: which beams met something, which met nothing, and which measured nothing.

By REP-117, +inf means that nothing is within range, -inf that something is too near to measure, and NaN that the
measurement failed. A number below range_min is no measurement either: many drivers write 0 for it. A beam that failed
says nothing about what is there, so what it met last stays until it measures again.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.sources.ground.frames import FrameMotion

SCAN: Final = "sensor_msgs/msg/LaserScan"

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_BEAMS: Final = 1_000_000
"""Beams of a message. A scanner has 360 to 8,000."""

_LARGEST_ANGLE: Final = 8.0 * np.pi
"""rad: of the first beam, and between two; larger ones are no angles."""


class Beams(NamedTuple):
    """The N beams of a scan: points (N, 3) in its frame (m); whether something is there; whether nothing is known."""

    points: Floats
    met: Mask
    failed: Mask


def read_beams(scan: Any, *, nan_is_free: bool = False) -> Beams:
    """Return the beams of a LaserScan. nan_is_free: whether those that failed met nothing, as some drivers mean it.

    Raises InputError if its angles or its range are none, or if no beam measured anything.
    """
    ranges = np.asarray(scan.ranges, np.float64)
    low, high, start, step = (
        float(each) for each in (scan.range_min, scan.range_max, scan.angle_min, scan.angle_increment)
    )
    if not low < high:
        raise InputError(f"range_min, range_max: expected a range, got {low:g} to {high:g}")
    if not (abs(start) <= _LARGEST_ANGLE and abs(step) <= _LARGEST_ANGLE and (step or len(ranges) < 2)):
        raise InputError(f"angle_min, angle_increment: expected angles, got {start:g} and {step:g}")
    if len(ranges) > MOST_BEAMS:
        raise InputError(f"ranges: expected at most {MOST_BEAMS}, got {len(ranges)}")
    near = ranges == -np.inf
    met = ((ranges >= low) & (ranges <= high)) | near
    failed = np.zeros(len(met), np.bool_) if nan_is_free else ~met & ~(ranges > high)  # NaN, or below range_min
    if failed.all():
        raise InputError(f"ranges: expected measurements, got none in {len(ranges)} beams; what was there stays")
    distance = np.where(met, np.where(near, max(low, 0.0), ranges), 0.0)
    angle = start + step * np.arange(len(ranges))
    return Beams(np.column_stack([distance * np.cos(angle), distance * np.sin(angle), 0.0 * angle]), met, failed)


def scan_points(scan: Any) -> tuple[Floats, int]:
    """Return the points (N, 3) in m of a LaserScan in its frame, and the number of NaN; beams may meet nothing."""
    beams = read_beams(scan)
    return beams.points[beams.met], int(np.count_nonzero(np.isnan(scan.ranges)))


class BeamMemory:
    """What each beam of a scanner met last, in the monitor's frame."""

    def __init__(self) -> None:
        self._layout: tuple[Any, ...] = ()
        self._points = np.zeros((0, 3))
        self._met = np.zeros(0, np.bool_)

    def stays(self, beams: Beams, layout: tuple[Any, ...], frame: FrameMotion, used: Mask) -> Floats:
        """Take over what the beams meet; return the points (K, 3), in the scan's frame, of those that failed.

        layout: what tells the beams, such as their angles; others are other beams. used (N,): which points count.
        """
        if layout != self._layout:
            self._layout = layout
            self._points, self._met = np.zeros_like(beams.points), np.zeros(len(beams.met), np.bool_)
        R = rotation_matrix(frame.quaternion)
        measured = ~beams.failed
        self._points[measured] = beams.points[measured] @ R.T + frame.position
        self._met[measured] = (beams.met & used)[measured]
        held = beams.failed & self._met
        return np.asarray((self._points[held] - frame.position) @ R)
