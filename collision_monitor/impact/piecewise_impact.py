"""Time of impact of two bodies of a monitor: along the pieces of their plans, if they follow some."""

from __future__ import annotations

from math import inf
from typing import Any

from collision_monitor._jit import device
from collision_monitor.impact.apart import clear_until
from collision_monitor.impact.body_impact import (
    BodyPair,
    ImpactQuery,
    Scratch,
    Window,
    chains_impact,
    tube_of,
)
from collision_monitor.impact.impact_record import CLEAR, HIT, UNRESOLVED, write_pair
from collision_monitor.motion.motion import set_piece


@device
def body_impact(
    multibody: Any, i: int, j: int, window: Window, query: ImpactQuery, scratch: Scratch, event: Any
) -> int:
    """Write the first impact of bodies i and j in the window into the IMPACT record `event`.

    event.status = CLEAR if there is none. Bodies that overlap, or are within query.margin, at the begin have their
    impact there. The reference motions and their tubes are those in `bodies`; in the record, i is the body with the
    smaller id. Bodies that follow plans are searched piece by piece. Returns the number of distance queries.
    """
    table, parts, bodies = multibody
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    a, b, spin_a, spin_b = bodies.first_shape[i], bodies.first_shape[j], bodies.spin_radius[i], bodies.spin_radius[j]
    begin, end = window
    queries, unresolved, is_near = 0, inf, False
    while True:
        if A.until <= begin:
            A = scratch.piece[0]
            _set_piece_at(bodies, i, begin, A)
        if B.until <= begin:
            B = scratch.piece[1]
            _set_piece_at(bodies, j, begin, B)
        pair = BodyPair(A, B, a, b, spin_a, spin_b)
        if min(A.until, B.until) < end and not is_near:
            least, tube = query.margin + query.tolerance, tube_of(A, B, begin)
            apart, n = clear_until(multibody, pair, (begin, end), least, tube, scratch)
            queries, is_near, begin = queries + n, apart == begin, apart
            if not begin < end:
                event.status = CLEAR
                break
            continue
        stop, is_near = min(end, A.until, B.until), False
        queries += chains_impact(table, parts, pair, Window(begin, stop), query, scratch, event)
        if event.status != CLEAR:
            unresolved = min(unresolved, event.lower)
        if event.status == HIT or not stop < end:  # also where the end is no number
            break
        begin = stop
    if unresolved < inf:  # what is open in one piece may be certain in the next
        event.lower = unresolved
        if event.status == CLEAR:
            event.status, event.upper = UNRESOLVED, inf
    if event.status != CLEAR:
        write_pair(bodies, i, j, event)
    return queries


@device
def _set_piece_at(bodies: Any, i: int, t: float, piece: Any) -> None:
    """Write the piece of body i's plan that holds from time t on into `piece` (MOTION), with the body's tube."""
    m = bodies.motion[i]
    k = m.piece
    while bodies.pieces[k].until <= t:
        k += 1
    set_piece(bodies.pieces[k], piece)
    piece.radius, piece.cover, piece.covered = m.radius, m.cover, m.covered
    piece.tube_0, piece.tube_1, piece.tube_time = m.tube_0, m.tube_1, m.tube_time
