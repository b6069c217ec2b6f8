"""Quiet segments: parts of the time in which one plane keeps two uncertain shapes apart, so that no sample meets there.

Along one direction the gap of a sample is linear in time, so that it closes in a segment only if it is closed at one of
its ends. There it is compared with its standard deviation: the separation of the stated motion in the middle of the
segment gives the direction, which is at rest.
"""

from __future__ import annotations

from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.narrow_phase.gjk import Accuracy
from collision_monitor.uncertainty.obstacle_planes import NOT_OFF, separation_at
from collision_monitor.uncertainty.pair_errors import gap_deviation
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST
from collision_monitor.uncertainty.samples.sample_gaps import stated_gap

SLACK: Final = 0.02
"""Part of the standard deviation of the gap by which the plane may be farther from the shapes than one that touches."""


@device
def stay_apart(table: Any, parts: Any, pair: Any, k: int, errors: Any, margin: float, obstacle: Any, work: Any) -> bool:
    """Whether a pair of shapes stays apart in segment k of the obstacle, with errors of FURTHEST standard deviations.

    work.joint: see `gap_deviation`, along work.frame.
    """
    first, last = obstacle.node[k], obstacle.node[k + 1]
    scratch, frame = work.scratch, work.frame
    middle, length = 0.5 * (first.time + last.time), last.time - first.time
    wanted = Accuracy(margin, SLACK * errors.sigma)
    if separation_at(table, parts, pair, middle, NOT_OFF, (NOT_OFF, NOT_OFF), wanted, obstacle, scratch) <= margin:
        return False
    n = (scratch.out[0], scratch.out[1], scratch.out[2])
    along = (
        frame[0, 0] * n[0] + frame[0, 1] * n[1] + frame[0, 2] * n[2],
        frame[1, 0] * n[0] + frame[1, 1] * n[1] + frame[1, 2] * n[2],
        frame[2, 0] * n[0] + frame[2, 1] * n[1] + frame[2, 2] * n[2],
    )
    margin += 0.125 * errors.bend * length * length
    for end in range(2):
        node = last if end else first
        away = FURTHEST * gap_deviation(along, work.joint, errors, node.time)
        if not stated_gap(table, pair, n, node, margin) > away:
            return False
    return True
