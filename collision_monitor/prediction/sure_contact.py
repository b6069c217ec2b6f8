"""Certificate that two uncertain bodies meet: at one time they overlap by more than their errors can undo."""

from __future__ import annotations

from collision_monitor._jit import device
from collision_monitor.narrow_phase.contact_row import BOUND
from collision_monitor.prediction.bodies import next_pair
from collision_monitor.prediction.body_impact import ShapePair, contact_at
from collision_monitor.prediction.screening import FURTHEST


@device
def surely_meet(multibody, i, j, tube, t, margin, work):
    """Whether bodies i and j, which move as in work.motion, meet until time t with a probability above 0.9998.

    Two of their shapes overlap at t. To separate them, the error of their relative position must be longer than the
    overlap. It exceeds FURTHEST standard deviations along each axis (Tube) with a probability of 1.5e-4.
    """
    table, parts, bodies = multibody
    least = -FURTHEST * (tube.start + tube.growth * t)
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        pair = ShapePair(work.motion[0], work.motion[1], a, b)
        if contact_at(table, parts, pair, t, work.scratch) + work.scratch.out[BOUND] - margin < least:
            return True
        a, b = next_pair(parts, first_b, a, b)
    return False
