"""A bound on the pairs that are monitored at once: n objects in one place are n * (n - 1) / 2 pairs.

Beyond the bound, the objects with the most pairs are left out, and nothing is known about them until they part. They
count as unseen, so that their silence is never read as "clear", and all other objects are monitored as before.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import Refusal
from collision_monitor.monitor.active_pairs import ActivePairs
from collision_monitor.monitor.candidates import Candidates
from collision_monitor.monitor.event_list import EventList
from collision_monitor.monitor.refusals import Refusals, some_ids
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.motion.bodies import BodyTable

MOST_PAIRS: Final = 1_000_000
"""Pairs that may meet. Each needs about 560 bytes in the monitor and its answers, and 1 to 20 µs in a step. Larger: a
crowd of hostile objects fills the memory. Smaller: a real crowd of objects is left out."""


def crowded(
    bodies: BodyTable, pairs: NDArray[np.int32], pending: tuple[NDArray[np.void], ...], top: int
) -> NDArray[np.int32]:
    """Return the slots of the bodies to leave out, ascending; none while there are at most MOST_PAIRS pairs.

    pairs (P, 2): slots of the pairs that a step found. pending: records with slots `i` and `j` of the known pairs.
    top: number of slots. A static body is never left out, because no later state would bring it back.
    """
    if len(pairs) <= MOST_PAIRS and sum(map(len, pending)) <= MOST_PAIRS:
        return np.zeros(0, np.int32)
    counts = np.zeros(top, np.intp)
    for i, j in ((pairs[:, 0], pairs[:, 1]), *((records["i"], records["j"]) for records in pending)):
        counts += np.bincount(i, minlength=top) + np.bincount(j, minlength=top)
    counts[bodies.static[:top]] = 0
    # bodies of equally many pairs are left out together, so that their order decides nothing
    ascending = np.sort(counts)
    first_out = ascending[np.argmax(np.cumsum(ascending) > MOST_PAIRS)]
    return np.flatnonzero(counts >= max(first_out, 1)).astype(np.int32)


def leave_out_crowds(
    step: StepContext,
    pairs: NDArray[np.int32],
    active: ActivePairs,
    events: EventList,
    candidates: Candidates,
    refusals: Refusals,
) -> NDArray[np.int32]:
    """Return the pairs (P, 2) without those of the bodies beyond MOST_PAIRS, which become unseen until they part."""
    roster = step.roster
    out = crowded(roster.bodies, pairs, (active.pairs, events.events), roster.top)
    if not len(out):
        return pairs
    is_out = np.zeros(roster.top, np.bool_)
    is_out[out] = True
    refusals.add(
        Refusal.MALFORMED,
        f"expected at most {MOST_PAIRS:,} pairs of objects that may meet, got {len(pairs):,}: the {len(out):,} "
        f"objects with the most pairs (ids {some_ids(roster.bodies.id[out])}) are unseen until they part",
        len(out),
    )
    roster.forget_states(out)
    candidates.forget(out)
    active.end_of(is_out)
    return pairs.compress(~is_out[pairs].any(axis=1), axis=0)
