"""sensor_msgs/LaserScan: which beams met something, which met nothing, and which measured nothing.

By REP-117, +inf means that nothing is within range, -inf that something is too near to measure, and NaN that the
measurement failed. A number below range_min, or 0, is no measurement either: many drivers write 0 for it. A beam that
failed, or that met what is too near to count, says nothing about what is behind, so what it met last stays until it
measures again.
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

MOST_HELD: Final = 100_000
"""Points of beams that failed. A scanner that never sees what is behind it holds 1,000 on a straight way."""

_LARGEST_ANGLE: Final = 8.0 * np.pi
"""rad: of the first beam, and between two; larger ones are no angles."""

_LEAST_STEP: Final = 1e-6
"""rad between two beams. The finest scanners have 1e-3; with much less, all beams are one, and all of the scan is
behind the first."""


class Beams(NamedTuple):
    """The N beams of a scan: points (N, 3) in its frame (m); whether something is there; whether nothing is known.

    start, step: rad, the direction of the first beam, and to the next one. reach: m, how far the scanner sees.
    """

    points: Floats
    met: Mask
    failed: Mask
    start: float
    step: float
    reach: float

    def nearest_to(self, angles: Floats) -> NDArray[np.intp]:
        """Return the row of the beam nearest to each direction; -1 for a direction outside of the scan."""
        width = abs(self.step) if len(self.met) > 1 else 2.0 * np.pi
        turn = np.mod((angles - self.start) * (1.0 if self.step >= 0.0 else -1.0) + 0.5 * width, 2.0 * np.pi)
        beam = np.floor(turn / width).astype(np.intp)
        return np.where(beam < len(self.met), beam, -1)


def read_beams(scan: Any, *, nan_is_free: bool = False, nearest: float = 0.0) -> Beams:
    """Return the beams of a LaserScan. nan_is_free: whether NaN means that nothing is there, as some drivers mean it.

    nearest: m, below which a beam counts as failed. Raises InputError if its angles or its range are none, or if no
    beam measured anything.
    """
    ranges = np.asarray(scan.ranges, np.float64)
    low, high, start, step = (
        float(each) for each in (scan.range_min, scan.range_max, scan.angle_min, scan.angle_increment)
    )
    low = max(low, 0.0) if low == low else low
    if not low < high:
        raise InputError(f"range_min, range_max: expected a range, got {scan.range_min:g} to {high:g}")
    if not (abs(start) <= _LARGEST_ANGLE and (_LEAST_STEP <= abs(step) <= _LARGEST_ANGLE or len(ranges) < 2)):
        raise InputError(f"angle_min, angle_increment: expected angles, got {start:g} and {step:g}")
    if len(ranges) > MOST_BEAMS:
        raise InputError(f"ranges: expected at most {MOST_BEAMS}, got {len(ranges)}")
    distance = np.where(ranges == -np.inf, low, np.where((ranges >= low) & (ranges > 0.0), ranges, np.nan))
    met = (distance <= high) & (distance >= nearest)
    failed = ~met & ~(ranges > high)  # NaN, below range_min, or too near to count
    if nan_is_free:
        failed &= ~np.isnan(ranges)
    if failed.all() and not (nan_is_free and not len(ranges)):
        raise InputError(f"ranges: expected measurements, got none in {len(ranges)} beams; what was there stays")
    distance[~met] = 0.0
    angle = start + step * np.arange(len(ranges))
    points = np.column_stack([distance * np.cos(angle), distance * np.sin(angle), 0.0 * angle])
    return Beams(points, met, failed, start, step, high)


class BeamMemory:
    """What the beams of a scanner met last, in the monitor's frame.

    The scanner moves on, and a later scan may have other angles, or another number of beams: a point belongs to the
    beam nearest to its direction from where the scanner is now. Points in directions that a scan does not have, or
    beyond its reach, are forgotten: no beam of it would meet them.
    """

    def __init__(self) -> None:
        self._frame = ""
        self._points = np.zeros((0, 3))

    def restart(self) -> None:
        """Forget all points."""
        self._points = np.zeros((0, 3))

    def stays(self, beams: Beams, name: str, frame: FrameMotion, used: Mask) -> tuple[Floats, int]:
        """Take over what the beams meet; return the points (K, 3), in the scan's frame, of those that failed.

        name: of the scan's frame; another frame is another scanner. used (N,): which points count. Returned second is
        the number of points that were forgotten, the farthest ones, because there are too many.
        """
        R = rotation_matrix(frame.quaternion)
        if name != self._frame:
            self._frame, self._points = name, np.zeros((0, 3))
        held = (self._points - frame.position) @ R
        beam = beams.nearest_to(np.arctan2(held[:, 1], held[:, 0]))
        stays = (beam >= 0) & beams.failed[beam] if len(beams.failed) else beam >= 0
        distance = np.sqrt((held**2).sum(1))
        kept = np.flatnonzero(stays & (distance <= beams.reach))
        forgotten = max(len(kept) - MOST_HELD, 0)
        if forgotten:
            kept = kept[np.sort(np.argsort(distance[kept], kind="stable")[:MOST_HELD])]
        self._points = np.concatenate([beams.points[beams.met & used] @ R.T + frame.position, self._points[kept]])
        return np.asarray(held[kept]), forgotten
