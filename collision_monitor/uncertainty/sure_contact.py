"""Certificate that two uncertain bodies meet: at one time they overlap by more than their errors can undo."""

from __future__ import annotations

from math import sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.impact.body_impact import ShapePair, contact_at
from collision_monitor.motion.bodies import next_pair
from collision_monitor.narrow_phase.contact_row import BOUND
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST


@device
def surely_meet(
    table: Any, parts: Any, pair: ShapePair, joint: Any, swing: Any, t: float, margin: float, scratch: Any
) -> bool:
    """Whether bodies with these first shapes (ShapePair) meet until time t with a probability above 0.9998.

    Two of their shapes overlap at t. To separate them, the errors of their relative position, joint (6, 6) at t, and of
    their orientation, which move their surfaces by swing (m, m), one standard deviation, must be longer than the
    overlap. They are longer than FURTHEST standard deviations along the worst axis with a probability of 1.5e-4.
    """
    variance = 0.0
    for r in range(3):  # no eigenvalue is larger than the largest sum of a row (Gershgorin)
        row = joint[r, r]
        for c in range(3):
            row += abs(joint[min(r, c), max(r, c)]) if c != r else 0.0
        variance = max(variance, row)
    least = -FURTHEST * sqrt(variance + swing[0] * swing[0] + swing[1] * swing[1])
    a, b = pair.a, pair.b
    while a >= 0:
        some = ShapePair(pair.A, pair.B, a, b)
        if contact_at(table, parts, some, t, scratch) + scratch.out[BOUND] - margin < least:
            return True
        a, b = next_pair(parts, pair.b, a, b)
    return False
