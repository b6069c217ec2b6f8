"""Stage 6, active pairs: examine in every step the pairs that touch and those whose certified time has run out."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor._jit.settled import settled
from collision_monitor.errors import InputError
from collision_monitor.impact.body_contact import RESULT, body_contact
from collision_monitor.impact.body_impact import Scratch, Window
from collision_monitor.impact.coarse_impact import coarse_impact, has_bounds
from collision_monitor.impact.impact_record import BOUND_ONLY, CLEAR, HIT, IMPACT, holds, ids_of_keys, pair_key
from collision_monitor.impact.pair_impacts import cover_of
from collision_monitor.impact.piecewise_impact import body_impact
from collision_monitor.monitor.candidates import is_checked
from collision_monitor.monitor.contacts.carried_contacts import (
    CARRIED,
    Carrying,
    carry_contact,
    has_answer,
    keep,
    no_answers,
    saved,
)
from collision_monitor.monitor.contacts.carried_triangles import APART, NONE, overlap_of_trees
from collision_monitor.monitor.contacts.contact_details import complete_contact
from collision_monitor.monitor.contacts.plain_contacts import plain_contact
from collision_monitor.monitor.contacts.solid_overlap import overlap_of_solid
from collision_monitor.monitor.event_list import NO_EVENTS
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage, whole_fact
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.narrow_phase.contact_row import DISTANCE
from collision_monitor.records import Model, Phase

PAIR = np.dtype(
    [
        ("key", np.uint64),  # (smaller id << 32) | larger id; the set is sorted by it
        ("i", np.int32),  # body slots; body i has the smaller id
        ("j", np.int32),
        ("since", np.float64),  # s after the monitor's origin: begin of the contact; NaN before
        ("touching", np.uint8),
        ("touched", np.uint8),  # the same, in the step before
        ("leaving", np.uint8),  # the next step drops it: it is certified apart for a while, or was reported as END
    ]
)


PREFETCH_AHEAD: Final = 2
"""How many pairs ahead the bodies are prefetched."""

UNITE_AHEAD: Final = 16
"""The same in `_unite`, which does little with each pair."""

SOON: Final = 5.0
WAIT: Final = 4.0
"""Steps for which a pair of bounded meshes that certainly meets, or that a search found to be near, is only tested. A
test takes a fifth of a search."""

Rows = NDArray[np.void]

_FIRST: Final = np.zeros(1, np.intp)
"""Order of a single event."""

_NO_CONTACTS: Final = np.zeros(0, records.CONTACT)


class Active(NamedTuple):
    """The active pairs (n,). The data of one pair have the same index in all columns."""

    pairs: Any  # PAIR
    events: Any  # IMPACT: its last predicted impact
    results: Any  # (n, RESULT): its contact in this step
    carried: Any  # (n, CARRIED): its last answer; (0, CARRIED) without a `distance_tolerance`


class ActivePairs(Stage):
    """The pairs that every step examines, and the contacts whose pair was removed since the last step."""

    SAVED = ("pairs", "events", "_orphans", "_carried")
    CACHES = ("results",)

    def __init__(self) -> None:
        self.pairs: Rows = np.zeros(0, PAIR)
        self.events: Rows = np.zeros(0, IMPACT)
        self.results = np.empty((0, RESULT))
        self._orphans: list[tuple[int, float]] = []  # contacts (key, since) of removed pairs
        self._carried = no_answers()

    @property
    def active(self) -> Active:
        """The pairs as the kernels read them."""
        return Active(self.pairs, self.events, self.results, self._carried)

    @property
    def touching_keys(self) -> NDArray[np.uint64]:
        """Keys of the pairs that touch."""
        keys: NDArray[np.uint64] = self.pairs["key"][self.pairs["touching"] == 1]
        return keys

    # ------------------------------------------------------------------ leaving

    def of_body(self, i: int) -> NDArray[np.intp]:
        """Indices of the pairs of the body in slot i."""
        return np.flatnonzero((self.pairs["i"] == i) | (self.pairs["j"] == i))

    def end(self, indices: NDArray[np.intp]) -> None:
        """Remove pairs. The next step reports the contacts among them as END."""
        for pair in self.pairs[indices]:
            if pair["touching"]:
                self._orphans.append((int(pair["key"]), float(pair["since"])))
        self.pairs = np.delete(self.pairs, indices)
        self.events = np.delete(self.events, indices)
        if len(self._carried):
            self._carried = np.delete(self._carried, indices, axis=0)

    def end_unchecked(self, roster: Roster, i: int) -> None:
        """Remove the pairs of body i, which was described, that are no longer checked."""
        of_body = self.of_body(i)
        if len(of_body):
            if len(self._carried):
                self._carried[of_body] = np.nan  # of the shapes before
            pairs = self.pairs[of_body]
            others = np.where(pairs["i"] == i, pairs["j"], pairs["i"])
            self.end(of_body[~is_checked(roster, i, others)])

    def end_of(self, is_out: NDArray[np.bool_]) -> None:
        """Remove the pairs of the marked bodies. is_out (N,): by slot."""
        self.end(np.flatnonzero(is_out[self.pairs["i"]] | is_out[self.pairs["j"]]))

    def end_all(self) -> None:
        """Remove every pair. Their contacts end with an unknown duration, because the timeline restarts."""
        self.pairs["since"] = np.nan
        self.end(np.arange(len(self.pairs)))

    def forget_answers(self) -> None:
        """Answer every contact anew in the next step, because carried answers may lack details that it needs."""
        self._carried[:] = np.nan

    # ------------------------------------------------------------------ the step

    def unite(self, step: StepContext, due: Rows) -> None:
        """Add the pairs of the events (IMPACT) that are due. Drop the pairs that ended, or whose motion changed."""
        room = len(self.pairs) + len(due)
        if not room:
            self.results, self._carried = self.results[:0], no_answers()
            return
        pairs, events = np.empty(room, PAIR), np.empty(room, IMPACT)
        order = np.argsort(due["key"], kind="stable") if len(due) > 1 else _FIRST[: len(due)]
        b = step.roster.bodies
        columns = b.id, b.used, b.version
        carried = np.empty((room if step.profile.distance_tolerance else 0, CARRIED))
        n = _unite(*columns, self.pairs, self.events, self._carried, due, order, pairs, events, carried)
        self.pairs, self.events, self.results = pairs[:n], events[:n], np.empty((n, RESULT))
        self._carried = carried[:n]

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Keep the marked pairs and drop the others. kept (n,)."""
        self.pairs, self.events = self.pairs.compress(kept), self.events.compress(kept)
        self.results = self.results[: len(self.pairs)]
        if len(self._carried):
            self._carried = self._carried.compress(kept, axis=0)

    def examine_all(self, step: StepContext, scratch: Scratch) -> Rows:
        """Examine every pair. Return the events (IMPACT) of pairs that are certified apart for a while."""
        if not len(self.pairs):
            return NO_EVENTS
        later = np.empty(len(self.pairs), IMPACT)
        return later[: self.examine(step, np.arange(len(self.pairs)), scratch, later)]

    def examine(self, step: StepContext, which: NDArray[np.intp], scratch: Scratch, later: Rows) -> int:
        """Examine the pairs `which` (M,). Write the events of pairs certified apart to `later`; return how many."""
        carrying = Carrying(step.profile.distance_tolerance, step.period)
        queries = step.settings.impact, step.settings.contact, carrying, step.profile.contact_details, step.coarse
        n, tests, made = _examine(step.roster.multibody, self.active, which, step.now, queries, scratch, later)
        step.work.narrow_phase_tests += tests
        step.work.impact_queries += made
        return int(n)

    def take_orphans(self, now: float) -> Rows:
        """Return and forget the END (records.CONTACT) of each contact whose pair was removed."""
        ended = np.zeros(len(self._orphans), records.CONTACT) if self._orphans else _NO_CONTACTS
        if len(ended):
            keys, since = zip(*self._orphans, strict=True)
            for name in ("signed_distance", "error_bound", "point_a", "point_b", "normal", "closing_speed"):
                ended[name] = np.nan
            ended["id_a"], ended["id_b"] = ids_of_keys(np.array(keys, np.uint64))
            ended["duration"] = now - np.array(since)
            ended["phase"], ended["point_count"] = Phase.END, 1
            ended["model_a"] = ended["model_b"] = Model.EXACT
            self._orphans.clear()
        return ended

    # ------------------------------------------------------------------ snapshots

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        snapshot.arrays.update(pairs=self.pairs.copy(), pair_events=self.events.copy())
        snapshot.arrays["carried"] = saved(self._carried)
        facts["orphans"] = list(self._orphans)

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self.pairs = snapshot.array("pairs", np.empty(0, PAIR))
        self.events = snapshot.array("pair_events", np.empty(0, IMPACT), len(self.pairs))
        snapshot.check_slots("pairs", self.pairs)
        snapshot.check_slots("pair_events", self.events)
        self._carried = snapshot.array("carried", no_answers())
        if len(self._carried) not in (0, len(self.pairs)):
            raise InputError(f"snapshot, carried: expected {len(self.pairs)} rows or none, got {len(self._carried)}")
        self._orphans = [(whole_fact(key, "orphans"), float(since)) for key, since in facts["orphans"]]


@settled
@kernel
def _unite(
    ids: Any, used: Any, version: Any, pairs: Any, events: Any, carried: Any, due: Any, order: Any, new_pairs: Any,
    new_events: Any, new_carried: Any,
) -> int:  # fmt: skip
    """Merge the active pairs with those of the due events, by key, into new_pairs; their events into new_events.

    Those that touched take their carried rows along into new_carried, if both arrays have rows.

    A pair leaves the active pairs here if it is marked as leaving, if one of its bodies was removed, or if it does not
    touch and its motion changed (then it was predicted anew). order (D,): sorts `due` by key. ids, used, version:
    columns of Bodies. Returns the number of pairs.
    """
    n = k = m = 0
    while k < pairs.size or m < order.size:
        if k < pairs.size:
            ahead = pairs[min(k + UNITE_AHEAD, pairs.size - 1)]
            prefetch(version, np.intp(ahead.i))
            prefetch(version, np.intp(ahead.j))
            prefetch(ids, np.intp(ahead.j))
            i, j = pairs[k].i, pairs[k].j
            gone = not (used[i] and used[j]) or pair_key(ids[i], ids[j]) != pairs[k].key
            changed = not holds(version, events[k])
            if gone or pairs[k].leaving == 1 or (changed and pairs[k].touching == 0):
                k += 1
                continue
        if new_carried.shape[0] > 0:
            new_carried[n, DISTANCE] = np.nan
        if k < pairs.size and (m >= order.size or pairs[k].key <= due[order[m]].key):
            may_carry = pairs[k].touching == 1 and carried.shape[0] > 0 and new_carried.shape[0] > 0
            if may_carry and has_answer(carried[k]):
                for c in range(CARRIED):
                    new_carried[n, c] = carried[k, c]
            new_pairs[n] = pairs[k]
            new_pairs[n].touched = pairs[k].touching
            new_events[n] = events[k]
            if m < order.size and pairs[k].key == due[order[m]].key:
                new_events[n] = due[order[m]]
                m += 1
            k += 1
        else:
            event = due[order[m]]
            new_events[n] = event
            new_pairs[n].key, new_pairs[n].i, new_pairs[n].j = event.key, event.i, event.j
            new_pairs[n].touched = new_pairs[n].touching = new_pairs[n].leaving = 0
            new_pairs[n].since = np.nan
            m += 1
        n += 1
    return n


@inlined
def _ask_for_body(table: Any, parts: Any, bodies: Any, i: int) -> None:
    row, shape = np.intp(i), np.intp(bodies.first_shape[i])
    prefetch(bodies.position, row)
    prefetch(bodies.angular, row)  # the other half of LAST_STATE
    prefetch(bodies.time, row)
    prefetch(table.size, shape)
    if bodies.plain[i] == 0:
        prefetch(bodies.excess, row)
        prefetch(table.margin, shape)
        prefetch(table.kind, shape)
        prefetch(parts.next, shape)
        prefetch(parts.placed, shape)


@inlined
def _ask_for(multibody: Any, pairs: Any, which: Any, at: int) -> None:
    """Prefetch the data of the pairs that `_examine` visits after the pair at index `at` of `which`."""
    table, parts, bodies = multibody
    if at + 2 * PREFETCH_AHEAD < which.size:
        far = pairs[which[at + 2 * PREFETCH_AHEAD]]
        prefetch(bodies.first_shape, np.intp(far.i))
        prefetch(bodies.first_shape, np.intp(far.j))
    if at + PREFETCH_AHEAD < which.size:
        near = pairs[which[at + PREFETCH_AHEAD]]
        _ask_for_body(table, parts, bodies, near.i)
        _ask_for_body(table, parts, bodies, near.j)
        if near.touched == 0:  # unless it touches, its next impact is searched for
            prefetch(bodies.motion, np.intp(near.i))
            prefetch(bodies.motion, np.intp(near.j))


@settled
@kernel
def _examine(
    multibody: Any, active: Active, which: Any, now: float, queries: Any, scratch: Scratch, later: Any
) -> tuple[int, int, int]:
    """Examine the active pairs `which` (M,) at `now`: write contacts into the results, predict the other pairs further.

    The pairs keep their indices. A pair that does not touch and is certified apart for a while returns to the event
    list: it is marked as leaving, and its event goes into `later` (IMPACT). A pair without a further impact, or one
    that this step predicted anew, is marked as leaving too. queries: ImpactQuery, ContactQuery, Carrying,
    whether contacts have details, and Nearness.
    Returns (number of events in `later`, narrow-phase tests, impact queries).
    """
    bodies = multibody.bodies
    pairs, events, results, carried = active
    impact, contact, carrying, has_details, coarse = queries
    n_later = tests = made = 0
    for at in range(which.size):
        _ask_for(multibody, pairs, which, at)
        k = which[at]
        pair, event = pairs[k], events[k]
        i, j = pair.i, pair.j
        may_carry = carrying.tolerance > 0.0 and pair.touched == 1
        if may_carry and carry_contact(
            multibody, i, j, now, contact, carrying.tolerance, scratch, carried[k], results[k]
        ):
            pair.touching, pair.leaving = 1, 0
            continue
        is_complete = plain_contact(multibody, i, j, now, contact, has_details, scratch, results[k])
        touching, count, found = True, 1, NONE
        if not is_complete and carrying.tolerance > 0.0:
            found = overlap_of_trees(multibody, i, j, now, contact, carrying, scratch, results[k])
            if found == NONE:
                found = overlap_of_solid(multibody, i, j, now, contact, carrying.tolerance, scratch, results[k])
            is_complete, touching = is_complete or found >= 0.0, found != APART
        if touching and not is_complete:
            touching, count = body_contact(multibody, i, j, now, contact, scratch, results[k])
        tests += count
        stays = touching
        bounded = not touching and coarse.tolerance > 0.0 and has_bounds(multibody, i, j)
        if bounded and _can_wait(bodies, event, now, carrying.period):
            stays = True
        elif not touching and not is_predicted_anew(bodies, i, j, now, event):
            window = Window(now, cover_of(bodies, i, j))
            if not (bounded and coarse_impact(multibody, i, j, window, impact, coarse, scratch, event)):
                made += body_impact(multibody, i, j, window, impact, scratch, event)
            if event.status != CLEAR:
                if event.lower > now:
                    later[n_later] = event
                    n_later += 1
                else:
                    stays = True
        if touching and not is_complete:
            complete_contact(multibody, i, j, now, scratch, results[k])
        if carrying.tolerance > 0.0:
            keep(multibody, i, j, touching, now, contact, carrying, scratch, results[k], carried[k], max(found, 0.0))
        if touching and pair.touched == 0:
            pair.since = now
        pair.touching = 1 if touching else 0
        pair.leaving = 0 if stays else 1
    return n_later, tests, made


@inlined
def _can_wait(bodies: Any, event: Any, now: float, period: float) -> bool:
    """Whether a pair of bounded meshes is only tested: it certainly meets soon, or was found to be near just before."""
    if not holds(bodies.version, event):
        return False
    if event.status == HIT and now < event.upper:
        return event.upper <= now + SOON * period
    return event.method == BOUND_ONLY and now - WAIT * period < event.lower < now - 0.5 * period


@inlined
def is_predicted_anew(bodies: Any, i: int, j: int, now: float, event: Any) -> bool:
    """Whether this step predicted the pair anew already, because a body left the motion that the event rests on."""
    is_new = bodies.motion[i].anew == now or bodies.motion[j].anew == now
    return is_new and not holds(bodies.version, event)
