"""Stage 6b, time-critical: examine active pairs within a budget, the most urgent first; bound the others.

Sources: slides "Time-critical collision detection" (from coarse to fine, with an answer whenever time is up); Hubbard,
Approximating polyhedra with spheres for time-critical collision detection, 1996.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor.impact.body_contact import ROUND_OFF, bounded_contact, relative_now, widening
from collision_monitor.impact.body_impact import Window
from collision_monitor.impact.impact_record import BOUND_ONLY, CLEAR, IMPACT, TREE_BOUND
from collision_monitor.impact.pair_impacts import bound_impact, cover_of, is_cheap
from collision_monitor.impact.sphere_trees import Tree, Trees, body_tree, joined_trees, tighten
from collision_monitor.monitor.active_pairs import ActivePairs, is_predicted_anew
from collision_monitor.monitor.budget import EXAMINE, HANDFUL, REFINE, TREES, PairBudget, StepClock, TimeBudget
from collision_monitor.monitor.event_list import EventList, Events, sort_order
from collision_monitor.monitor.first_impacts import FirstImpacts
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.motion.bodies import BodyTable
from collision_monitor.records import joined
from collision_monitor.settings.profile import NO_BUDGET, NO_LIMIT, Profile

Indices = NDArray[np.intp]


class TimeCritical(Stage):
    """Examines active pairs until the budget of a step is used up.

    clock: measures the steps. timed: whether a budget in time applies; otherwise only the number of pairs does.
    """

    SAVED = ("_deferred",)
    CACHES = ("clock", "_timed", "_tree_of", "_trees")

    def __init__(self, *, timed: bool) -> None:
        self.clock = StepClock()
        self._timed = timed
        self._deferred = 0  # number of pairs that the last step did not examine
        self._tree_of: dict[int, Tree | None] = {}  # by slot; None: the body has no tree
        self._trees: Trees | None = None  # all trees; None after a change

    @staticmethod
    def has_budget(profile: Profile) -> bool:
        """Whether the profile limits the work of a step."""
        return profile.budget_ms < NO_BUDGET or profile.pairs_per_step < NO_LIMIT

    def budget(self, profile: Profile) -> PairBudget | None:
        """The budget of a step; None if there is no limit and the last step deferred nothing."""
        p = profile
        if p.budget_ms < NO_BUDGET and self._timed:
            return TimeBudget(self.clock, 1e-3 * p.budget_ms, p.pairs_per_step)
        return PairBudget(p.pairs_per_step) if self.has_budget(p) or self._deferred else None

    def end_step(self, step: StepContext, budget: PairBudget | None) -> int | None:
        """Store how many pairs the step deferred. Return how many it examined before that; None: it deferred none."""
        self._deferred = step.work.deferred
        return budget.done if budget is not None and self._deferred else None

    def prepare(self, step: StepContext, impacts: FirstImpacts) -> None:
        """Make the trees and load the kernels that steps with a budget may need, so that no step waits for them."""
        none = np.empty(0, IMPACT)
        self._tighten(step, none, impacts)
        impacts.refine(step, none)

    # ------------------------------------------------------------------ sphere trees

    def describe(self, roster: Roster, i: int, profile: Profile) -> None:
        """Drop the sphere tree of body i, which has new shapes. If steps have a budget, make the new tree now."""
        self._tree_of.pop(i, None)
        self._trees = None
        if self.has_budget(profile):
            self._plant(roster, i)

    def _plant(self, roster: Roster, i: int) -> None:
        table, parts, bodies = roster.multibody
        self._tree_of[i] = body_tree(table, parts.next, int(bodies.first_shape[i]))

    def _all_trees(self, roster: Roster) -> Trees:
        """The sphere trees of all bodies, cached. They depend only on the shapes."""
        if self._trees is None or len(self._trees.root) < roster.capacity:
            for i in roster.used().tolist():
                if i not in self._tree_of:
                    self._plant(roster, i)
            self._trees = joined_trees([self._tree_of.get(i) for i in range(roster.top)], roster.capacity)
        return self._trees

    def _can_tighten(self, step: StepContext, events: Events) -> NDArray[np.bool_]:
        """Mask of the events that are bounds by bounding spheres and that a sphere tree may delay."""
        trees = self._all_trees(step.roster)
        if not len(trees.radius):
            return np.zeros(len(events), np.bool_)
        has_tree = trees.root >= 0
        mask: NDArray[np.bool_] = (events["method"] == BOUND_ONLY) & (has_tree[events["i"]] | has_tree[events["j"]])
        return mask

    def _tighten(self, step: StepContext, events: Events, impacts: FirstImpacts) -> None:
        margin, rotation = step.profile.contact_margin, impacts.scratch.rotation
        tighten(step.roster.bodies, self._all_trees(step.roster), events, step.now, margin, rotation)

    def _tightened(
        self, step: StepContext, events: Events, budget: PairBudget, impacts: FirstImpacts
    ) -> tuple[Indices, Events]:
        """Replace bounds by bounding spheres with bounds by sphere trees, soonest first, within the budget.

        Returns the indices of the events that were done, and the new events; CLEAR: the trees do not meet.
        """
        todo = np.flatnonzero(self._can_tighten(step, events))
        todo = todo[np.lexsort((events["key"][todo], events["lower"][todo]))]
        found, at = events.take(todo), 0
        while at < len(todo) and (count := budget.next(-(-(len(todo) - at) // HANDFUL), TREES)):
            end = min(at + count * HANDFUL, len(todo))
            self._tighten(step, found[at:end], impacts)
            at = end
        return todo[:at], found[:at]

    # ------------------------------------------------------------------ the step

    def examine(
        self, step: StepContext, active: ActivePairs, events: EventList, impacts: FirstImpacts, budget: PairBudget
    ) -> None:
        """Examine the active pairs and refine the pending events, the most urgent first, within the budget."""
        version = step.roster.bodies.version
        self._let_pass(step, active, events, impacts, budget)
        later = self._examine_urgent(step, active, impacts, budget)
        which, found = self._tightened(step, events.events, budget, impacts)
        if len(which):
            events.replace(which, found.compress(found["status"] != CLEAR), version)
        which, refined = self._refine(step, events.events, impacts, budget)
        events.replace(which, joined([later, refined]), version)

    def _let_pass(
        self, step: StepContext, active: ActivePairs, events: EventList, impacts: FirstImpacts, budget: PairBudget
    ) -> None:
        """Remove active pairs whose sphere trees do not meet yet. Those that meet later return to the event list."""
        new = np.flatnonzero((active.pairs["touched"] == 0) & self._can_tighten(step, active.events))
        if not len(new):
            return
        which, found = self._tightened(step, active.events.take(new), budget, impacts)
        which = new[which]
        active.events[which] = found
        apart = (found["status"] == CLEAR) | (found["lower"] > step.now)
        if not apart.any():
            return
        events.add(found.compress(apart & (found["status"] != CLEAR)), step.roster.bodies.version)
        kept = np.ones(len(active.pairs), np.bool_)
        kept[which[apart]] = False
        active.keep(kept)

    def _examine_urgent(
        self, step: StepContext, active: ActivePairs, impacts: FirstImpacts, budget: PairBudget
    ) -> Events:
        """Examine active pairs, the most urgent first, within the budget; the others get bounds (`leave`).

        Returns the events of pairs that are certified apart for a while.
        """
        later = np.empty(len(active.pairs), IMPACT)
        order, at = urgency(step.roster.bodies, active.pairs, active.events, step.number)
        n = active.examine(step, order[:at], impacts.scratch, later) if at else 0
        while at < len(order) and (count := budget.next(len(order) - at, EXAMINE)):
            n += active.examine(step, order[at : at + count], impacts.scratch, later[n:])
            at += count
        done, left = order[:at], order[at:]
        active.events["lower"][done[active.pairs["touching"][done] == 1]] = step.now  # time of the last examination
        step.work.deferred += len(left)
        n += int(leave(step.roster.bodies, active.active, left, step.now, step.settings.contact, later[n:]))
        return later[:n]

    def _refine(
        self, step: StepContext, pending: Events, impacts: FirstImpacts, budget: PairBudget
    ) -> tuple[Indices, Events]:
        """Search for the first impacts of the pending events that are only bounds, soonest first, within the budget.

        Returns the indices of the events that were done, and the events that replace them.
        """
        todo = np.flatnonzero((pending["method"] == BOUND_ONLY) | (pending["method"] == TREE_BOUND))
        found = [np.zeros(0, IMPACT)]
        at = 0
        while at < len(todo) and (count := budget.next(len(todo) - at, REFINE)):
            found.append(impacts.refine(step, pending.take(todo[at : at + count])))
            at += count
        step.work.deferred += len(todo) - at
        return todo[:at], joined(found)

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        facts["deferred"] = self._deferred

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self._deferred = int(facts["deferred"])
        self._tree_of, self._trees = {}, None  # `prepare` has made those of a monitor without objects


@kernel
def leave(bodies: BodyTable, active: Any, which: Any, now: float, query: Any, later: Any) -> int:
    """Bound the active pairs `which` (M,) that this step does not examine; counterpart of `ActivePairs.examine`.

    A pair that touched stays a contact, UNRESOLVED, with the distance of the centres and an error bound that holds for
    any shapes within the bounding spheres. A stale object widens its bounds here too. A pair that did not touch may
    meet from now on, UNRESOLVED. If the bounding spheres are apart, the contact ends, and the pair returns to the event
    list or is dropped. query: ContactQuery. Returns the number of events in `later`.
    """
    pairs, events, results, _ = active
    n_later = 0
    for at in range(which.size):
        k = which[at]
        pair, event = pairs[k], events[k]
        i, j = pair.i, pair.j
        there = relative_now(bodies, i, j, now)
        reach = bodies.motion[i].radius + bodies.motion[j].radius + widening(there, query.stale_acceleration)
        distance = sqrt(there.p[0] * there.p[0] + there.p[1] * there.p[1] + there.p[2] * there.p[2])
        touching = pair.touched == 1 and distance <= (reach + query.margin) * ROUND_OFF
        stays = touching
        if not touching and not is_predicted_anew(bodies, i, j, now, event):
            since = event.lower
            bound_impact(bodies, i, j, Window(now, cover_of(bodies, i, j)), query.margin, event)
            if event.status != CLEAR:
                if event.lower > now:
                    later[n_later] = event
                    n_later += 1
                else:
                    event.lower = min(since, now)  # the pair that has waited longest is examined first
                    stays = True
        if touching:
            bounded_contact(bodies, i, j, there, reach, results[k])
        pair.touching = 1 if touching else 0
        pair.leaving = 0 if stays else 1
    return n_later


_WAIT = np.dtype([("lower", np.float64), ("key", np.uint64)])
"""Time since which an active pair waits (s), and the key that breaks ties; sorted as events are."""


@kernel
def _by_turns(bodies: Any, pairs: Any, events: Any, step: Any, waits: Any, order: Any, turns: Any) -> Any:
    """`urgency`, into turns (n,) int64. waits (n,) _WAIT, order (n,) int64: scratch. Returns how many are cheap."""
    for k in range(pairs.size):
        waits[k].lower = events[k].lower
        waits[k].key = ((pairs[k].key ^ step) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)
    sort_order(waits, order, turns)
    n = left = 0
    for k in order:
        if is_cheap(bodies, pairs[k].i, pairs[k].j):
            turns[n] = k
            n += 1
        else:
            order[left] = k
            left += 1
    cheap = n
    apart = touched = 0  # positions in `order` of the next pair of each kind
    while n < pairs.size:
        while apart < left and pairs[order[apart]].touched == 1:
            apart += 1
        if apart < left:
            turns[n] = order[apart]
            n, apart = n + 1, apart + 1
        while touched < left and pairs[order[touched]].touched == 0:
            touched += 1
        if touched < left:
            turns[n] = order[touched]
            n, touched = n + 1, touched + 1
    return cheap


def urgency(
    bodies: BodyTable, pairs: NDArray[np.void], events: NDArray[np.void], step: int
) -> tuple[NDArray[np.int64], int]:
    """Return the order in which to examine active pairs, and the number of cheap ones, which come first.

    Cheap pairs do not count against the budget. The others alternate between pairs that did not touch, ordered by the
    end of their certified time, and pairs that did, ordered by their last examination. Ties are broken differently in
    each step, so that no pair waits forever.
    """
    order, turns = np.empty((2, len(pairs)), np.int64)
    cheap = _by_turns(bodies, pairs, events, np.uint64(step), np.empty(len(pairs), _WAIT), order, turns)
    return turns, int(cheap)
