"""Stage 7, answers: convert active pairs and pending events to the published records, and compute the status."""

from __future__ import annotations

import dataclasses
from math import inf, nan
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor._jit.settled import settled
from collision_monitor.impact.body_contact import SHAPE_I, SHAPE_J, STATUS, UNSETTLED
from collision_monitor.impact.body_impact import CLOSING
from collision_monitor.impact.impact_record import BOUND_ONLY, HIT, TREE_BOUND, UNRESOLVED, ids_of
from collision_monitor.monitor import filters
from collision_monitor.monitor.active_pairs import ActivePairs
from collision_monitor.monitor.contacts.mesh_faces import name_mesh_features
from collision_monitor.monitor.contacts.patches import with_patches
from collision_monitor.monitor.event_list import EventList
from collision_monitor.monitor.result import Refused, StepResult, StepStatus
from collision_monitor.monitor.state.roster import count_bodies
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage, whole_fact
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.motion.last_state import age_of
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    DISTANCE,
    FEATURE_INDEX_A,
    FEATURE_INDEX_B,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
)
from collision_monitor.records import Phase, joined

PREFETCH_AHEAD: Final = 8
"""How many predictions ahead the bodies are prefetched."""

PERSIST: Final = int(Phase.PERSIST)
BEGIN: Final = int(Phase.BEGIN)
END: Final = int(Phase.END)

Rows = NDArray[np.void]


class Answers(Stage):
    """The answers of the last step, and a digest of all answers so far."""

    SAVED = ("digest", "last", "step_count")

    def __init__(self) -> None:
        self.digest = 0
        self.step_count = 0
        self.last: StepResult | None = None

    def contacts(self, step: StepContext, active: ActivePairs) -> Rows:
        """Contacts (records.CONTACT) of the active pairs, sorted by ids, with the END of contacts of removed pairs."""
        multibody = step.roster.multibody
        contacts = np.empty(len(active.pairs), records.CONTACT)
        if len(contacts):
            p = step.profile
            limits = StaleLimits(step.now, p.stale_after, p.stale_acceleration, p.contact_margin)
            details, faces = step.profile.contact_details, step.roster.mesh_faces
            if details and len(faces):
                table = faces.table(len(multibody.table.kind))
                scratch = np.empty((1, 4)), np.empty((2, 3, 3))
                name_mesh_features(multibody, active.pairs, active.results, step.now, table, scratch)
            _doubt_contacts(step.roster.unsure, active)
            index, bodies = multibody.parts.index, step.roster.bodies
            n = write_contacts(active.pairs, active.results, bodies, index, limits, details, contacts)
            contacts = contacts[:n]
        if step.profile.contact_points > 1:
            contacts = with_patches(contacts, multibody, active.active, step.now, step.profile.contact_points)
        ended = active.take_orphans(step.now)
        if not len(ended):
            return contacts
        both = joined([contacts, ended])
        begins = both["phase"] != Phase.END  # a pair's END comes before its next BEGIN
        return both[np.lexsort((begins, both["id_b"], both["id_a"]))]

    def predictions(self, step: StepContext, active: ActivePairs, events: EventList) -> tuple[Rows, NDArray[np.int32]]:
        """Predictions (records.PREDICTION) of the stated motions within the horizon, and their body slots (n, 2)."""
        p, roster = step.profile, step.roster
        pending = events.until(step.now + p.horizon)
        predictions = np.empty(len(pending) + len(active.pairs), records.PREDICTION)
        slots = np.empty((len(predictions), 2), np.int32)
        if not len(predictions):
            return predictions, slots
        predicted = Predicted(active.pairs, *(_doubted(roster.unsure, each) for each in (active.events, pending)))
        times = Times(step.now, p.horizon, p.stale_after)
        n = write_predictions(predicted, roster.bodies, roster.parts.index, times, predictions, slots)
        return predictions[:n], slots[:n]

    def filtered(self, step: StepContext, predictions: Rows) -> Rows:
        """Drop the predictions that the profile's filters exclude."""
        p = step.profile
        if not (p.min_closing_speed > 0.0 or p.ignore_separating or p.horizon_by_name):
            return predictions
        kept = np.ones(len(predictions), np.bool_)
        if p.min_closing_speed > 0.0:
            kept &= filters.closes_fast(predictions, p.min_closing_speed)
        if p.ignore_separating or p.horizon_by_name:
            i, j = (step.roster.find_slots(predictions[name]) for name in ("id_a", "id_b"))
        if p.ignore_separating:
            kept &= filters.approaches(step.roster.bodies, i, j, step.now)
        if p.horizon_by_name:
            kept &= predictions["lower"] <= np.minimum(step.horizons[i], step.horizons[j])
        return predictions[kept]

    def finish(self, result: StepResult) -> StepResult:
        """Store this as the last result and add it to the digest. Return it."""
        for part in (result.contact_rows, result.predictions):
            self.digest = int(chain_digest(np.uint64(self.digest), part.view(np.uint64)))
        self.last, self.step_count = result, result.step
        return result

    def none(self, refused: tuple[Refused, ...]) -> StepResult:
        """Return the result of a refused step, without answers: those of the last step would be of another time."""
        last = self.last
        assert last is not None, "the first stamp is always accepted"
        empty = last.contact_rows[:0], last.predictions[:0]
        return StepResult(last.stamp_ns, last.step, *empty, last.status, accepted=False, refused=refused)

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        last = self.last
        facts |= {"step": self.step_count, "digest": self.digest, "last": None}
        if last is not None:
            # every step makes new arrays
            snapshot.arrays.update(contacts=last.contact_rows, predictions=last.predictions)
            facts["last"] = [last.stamp_ns, last.step, dataclasses.asdict(last.status)]

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self.step_count, self.digest = whole_fact(facts["step"], "step"), whole_fact(facts["digest"], "digest")
        if facts["last"] is not None:
            stamp_ns, step, status = facts["last"]
            contacts = snapshot.array("contacts", np.empty(0, records.CONTACT))
            predictions = snapshot.array("predictions", np.empty(0, records.PREDICTION))
            self.last = StepResult(stamp_ns, step, contacts, predictions, StepStatus(**status))


def _doubt_contacts(unsure: set[int], active: ActivePairs) -> None:
    """Make the contacts with shapes that may not be there UNRESOLVED. unsure: their slots."""
    if not unsure:
        return
    shapes = active.results[:, [SHAPE_I, SHAPE_J]]
    may_be = np.isin(shapes, list(unsure)).any(axis=1) & (active.pairs["touching"] == 1)
    active.results[may_be, STATUS] = UNSETTLED


def _doubted(unsure: set[int], events: Rows) -> Rows:
    """The events (IMPACT), of which those with shapes that may not be there are UNRESOLVED. unsure: their slots."""
    if not unsure:
        return events
    slots = list(unsure)
    may_be = np.isin(events["shape_i"], slots) | np.isin(events["shape_j"], slots)
    events = events.copy()
    events["status"][may_be], events["upper"][may_be] = UNRESOLVED, inf
    return events


def step_status(
    step: StepContext, active: ActivePairs, events: EventList, contacts: Rows, predictions: Rows
) -> StepStatus:
    """Count objects, answers and work of the step."""
    roster, b = step.roster, step.roster.bodies
    columns = b.used, b.static, b.seen, b.time
    static, unseen, stale = count_bodies(*columns, roster.top, step.now, step.profile.stale_after)
    touching, unresolved = count_answers(active.pairs, contacts, predictions)
    return StepStatus(
        objects=len(roster),
        objects_static=int(static),
        objects_unseen=int(unseen),
        objects_stale=int(stale),
        contacts=touching,
        predictions=len(predictions),
        unresolved=unresolved,
        events_pending=len(events),
        **vars(step.work),
    )


@kernel
def mark_overtaken(predictions: Any, age: float) -> int:
    """Make the certain predictions UNRESOLVED whose collisions have begun by now, if the states are `age` (s) old.

    Returns their number.
    """
    n = 0
    for k in range(predictions.size):
        if predictions[k].status == HIT and predictions[k].upper < age:
            predictions[k].status = UNRESOLVED
            n += 1
    return n


@settled
@kernel
def count_answers(pairs: Any, contacts: Any, predictions: Any) -> tuple[int, int]:
    """Count the pairs (PAIR) that touch, and the contacts and predictions that are UNRESOLVED."""
    touching = unresolved = 0
    for k in range(pairs.size):
        touching += pairs[k].touching
    for k in range(contacts.size):
        unresolved += contacts[k].status == UNSETTLED
    for k in range(predictions.size):
        unresolved += predictions[k].status == UNRESOLVED
    return touching, unresolved


@inlined
def _leave_out_details(contact: Any) -> None:
    for c in range(3):
        contact.point_a[c] = contact.point_b[c] = nan
    contact.closing_speed = nan
    contact.feature_type_a = contact.feature_index_a = contact.feature_type_b = contact.feature_index_b = 0


class StaleLimits(NamedTuple):
    """When a body is stale, and how far it may have left its last motion by then."""

    now: float  # s
    stale_after: float  # s
    acceleration: float  # m/s^2
    margin: float  # m: pairs up to this far apart touch


@inlined
def _is_in_doubt(bodies: Any, i: int, j: int, distance: float, limits: StaleLimits) -> bool:
    """Whether a pair may be farther apart than the margin, because one of its bodies is stale."""
    age_i, age_j = age_of(bodies, i, limits.now), age_of(bodies, j, limits.now)
    if not (age_i > limits.stale_after or age_j > limits.stale_after):
        return False
    widened = 0.5 * limits.acceleration * (age_i * age_i + age_j * age_j)
    return distance + widened + bodies.excess[i] + bodies.excess[j] > limits.margin


@settled
@kernel
def write_contacts(
    pairs: Any, results: Any, bodies: Any, shape_index: Any, limits: StaleLimits, has_details: bool, contacts: Any
) -> int:
    """Write the contacts (records.CONTACT) of the pairs that touch or have just ended; return their number.

    results (n, RESULT): of the pairs. shape_index (S,): a shape's place in its object's description. limits:
    StaleLimits. has_details: whether there are witness points, features and closing speeds.
    """
    now, n = limits.now, 0
    for k in range(pairs.size):
        pair, row = pairs[k], results[k]
        if pair.touching == 0 and pair.touched == 0:
            continue
        contact = contacts[n]
        contact.id_a, contact.id_b = ids_of(pair.key)
        contact.duration = now - pair.since
        contact.model_a, contact.model_b = bodies.model[pair.i], bodies.model[pair.j]
        contact.point_index, contact.point_count = 0, 1
        if pair.touching == 1:
            contact.signed_distance = row[DISTANCE]
            contact.error_bound = row[BOUND]
            for c in range(3):
                contact.point_a[c], contact.point_b[c] = row[POINT_A + c], row[POINT_B + c]
                contact.normal[c] = row[NORMAL + c]
            contact.closing_speed = row[CLOSING]
            contact.shape_a = shape_index[int(row[SHAPE_I])]
            contact.shape_b = shape_index[int(row[SHAPE_J])]
            contact.feature_type_a, contact.feature_index_a = int(row[FEATURE_TYPE_A]), int(row[FEATURE_INDEX_A])
            contact.feature_type_b, contact.feature_index_b = int(row[FEATURE_TYPE_B]), int(row[FEATURE_INDEX_B])
            contact.phase = PERSIST if pair.touched == 1 else BEGIN
            contact.status = int(row[STATUS])
            if _is_in_doubt(bodies, pair.i, pair.j, row[DISTANCE], limits):
                contact.status = UNSETTLED
            if not has_details:
                _leave_out_details(contact)
        else:
            contact.signed_distance = contact.error_bound = contact.closing_speed = nan
            for c in range(3):
                contact.point_a[c] = contact.point_b[c] = contact.normal[c] = nan
            contact.shape_a = contact.shape_b = 0
            contact.feature_type_a = contact.feature_index_a = contact.feature_type_b = contact.feature_index_b = 0
            contact.phase, contact.status = END, 0
        n += 1
    return n


class Predicted(NamedTuple):
    """The sources of the predictions."""

    pairs: Any  # (n,) PAIR: active pairs
    active: Any  # (n,) IMPACT: their events
    pending: Any  # IMPACT, sorted: events within the horizon


class Times(NamedTuple):
    """The time of the predictions (s), their horizon (s), and the age from which a state is stale (s)."""

    now: float
    horizon: float
    stale_after: float


@settled
@kernel
def write_predictions(
    predicted: Predicted, bodies: Any, shape_index: Any, times: Times, predictions: Any, slots: Any
) -> int:
    """Write the predictions (records.PREDICTION) of the active pairs that do not touch, then of the pending events.

    shape_index (S,): a shape's place in its object's description. slots (n, 2), written: body slots of each prediction.
    Returns the number of predictions.
    """
    pairs, active, pending = predicted
    now, horizon, stale_after = times
    n = 0
    for k in range(pairs.size + pending.size):
        if k < pairs.size:
            if pairs[k].touching == 1 or pairs[k].leaving == 1:
                continue
            event = active[k]
        else:
            event = pending[k - pairs.size]
            if event.lower > now + horizon:
                break
            ahead = pending[min(k - pairs.size + PREFETCH_AHEAD, pending.size - 1)]
            prefetch(bodies.time, np.intp(ahead.i))
            prefetch(bodies.time, np.intp(ahead.j))
            prefetch(bodies.excess, np.intp(ahead.i))
            prefetch(bodies.excess, np.intp(ahead.j))
            prefetch(shape_index, np.intp(ahead.shape_i))
            prefetch(shape_index, np.intp(ahead.shape_j))
        i, j = event.i, event.j
        slots[n, 0], slots[n, 1] = i, j
        row = predictions[n]
        row.lower = max(event.lower - now, 0.0)
        row.upper = max(event.upper - now, 0.0) if event.upper < inf else inf
        row.earliest = row.most_likely = row.latest = row.probability = nan
        row.point[0], row.point[1], row.point[2] = event.point_x, event.point_y, event.point_z
        row.normal[0], row.normal[1], row.normal[2] = event.normal_x, event.normal_y, event.normal_z
        row.closing_speed = event.closing_speed
        row.id_a, row.id_b = ids_of(event.key)
        row.shape_a, row.shape_b = shape_index[event.shape_i], shape_index[event.shape_j]
        row.status = event.status
        if bodies.excess[i] + bodies.excess[j] > 0.0:
            # the models meet; it is unknown whether and when the objects do
            row.status = UNRESOLVED
            row.upper = inf
        row.method = BOUND_ONLY if event.method == TREE_BOUND else event.method
        row.model_a, row.model_b = bodies.model[i], bodies.model[j]
        stale_i = not bodies.static[i] and now - bodies.time[i] > stale_after
        stale_j = not bodies.static[j] and now - bodies.time[j] > stale_after
        row.stale = 1 if stale_i or stale_j else 0
        row.plans = row.reserved[0] = row.reserved[1] = 0
        n += 1
    return n


@settled
@kernel
def chain_digest(digest: Any, words: Any) -> Any:
    """64-bit digest of `digest` followed by words (n,) uint64; four independent lanes, mixed at the end.

    It distinguishes equal answers from unequal ones. It is not meant to resist forgery.
    """
    prime = np.uint64(0x9E3779B97F4A7C15)
    shift = np.uint64(31)
    a = digest ^ np.uint64(0x243F6A8885A308D3)
    b = digest ^ np.uint64(0x13198A2E03707344)
    c = digest ^ np.uint64(0xA4093822299F31D0)
    d = digest ^ np.uint64(0x082EFA98EC4E6C89)
    n = words.size - words.size % 4
    for k in range(0, n, 4):
        a = (a ^ words[k]) * prime
        b = (b ^ words[k + 1]) * prime
        c = (c ^ words[k + 2]) * prime
        d = (d ^ words[k + 3]) * prime
        a ^= a >> shift
        b ^= b >> shift
        c ^= c >> shift
        d ^= d >> shift
    for k in range(n, words.size):
        a = (a ^ words[k]) * prime
        a ^= a >> shift
    for lane in (b, c, d, np.uint64(words.size)):
        a = (a ^ lane) * prime
        a ^= a >> shift
    return a
