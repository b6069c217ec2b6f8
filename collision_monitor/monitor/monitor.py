"""The monitor: contacts now and predicted collisions, step by step. `Monitor._take_step` is the list of the stages."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import InputError, Refusal, RefusalWarning
from collision_monitor.monitor.active_pairs import ActivePairs
from collision_monitor.monitor.answers import Answers, mark_overtaken, step_status
from collision_monitor.monitor.budget import PairBudget, StepClock
from collision_monitor.monitor.candidates import Candidates
from collision_monitor.monitor.crowding import MOST_PAIRS, crowded
from collision_monitor.monitor.event_list import NO_EVENTS, EventList, both
from collision_monitor.monitor.first_impacts import FirstImpacts
from collision_monitor.monitor.intake import Intake
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.scene_plan import ScenePlan, scene_plan
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Snapshot, Stage
from collision_monitor.monitor.state.timeline import Order, Progress, Timeline
from collision_monitor.monitor.step_context import KernelSettings, StepContext
from collision_monitor.monitor.time_critical import TimeCritical
from collision_monitor.monitor.tracking import Tracking
from collision_monitor.monitor.uncertain_predictions import UncertainPredictions
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import Modelled, monitored_model, parse_model, shape_class
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Shape

FACTS = "monitor"
"""Key of the monitor's entry in Snapshot.facts."""

MOST_NANOSECONDS = 2**63
"""A stamp is below it, and from its negative on; the stamps of messages and sessions are of 64 bits."""

NAMED = 3
"""Objects that the text of a refused message names."""

Events = NDArray[np.void]


class Monitor:
    """Keeps objects, follows their states, and reports contacts and predicted collisions at every step.

    The answers are a function of the profile, the descriptions and the states in the order in which they were given.
    They use no clock and no random numbers, and are the same bytes on every run. A profile with `budget_ms` adds the
    clock, which decides only how many pairs a step examines: a monitor with timed=False and that number as
    `pairs_per_step` (`StepResult.cut`) gives the same answers again.

    >>> import collision_monitor as cm
    >>> monitor = cm.Monitor()
    >>> monitor.add(1, cm.Box((1, 1, 1)), static=True, pose=cm.Pose())
    >>> monitor.add(2, cm.Sphere(0.5))
    >>> monitor.step(0, [2], [(2.5, 0, 0, 0, 0, 0, 1)], [(-1, 0, 0, 0, 0, 0)])
    StepResult(step 1 at 0 ns: 0 contacts, 0 ended, 1 predictions)
      prediction: 1 and 2 in 1... to 1.5... s
    """

    def __init__(self, profile: str | Profile = "balanced", *, timed: bool = True, warns: bool = True) -> None:
        """Make a monitor without objects. warns: whether the first refusal of each kind is a RefusalWarning too."""
        self._unwarned = set(Refusal) if warns else set()
        self._profile = profile if isinstance(profile, Profile) else Profile.named(profile)
        self._settings = KernelSettings.of(self._profile)
        self._roster = Roster()
        self._timeline = Timeline()
        self._intake = Intake()
        self._tracking = Tracking()
        self._candidates = Candidates()
        self._first_impacts = FirstImpacts(self._profile.threads)
        self._events = EventList()
        self._active_pairs = ActivePairs()
        self._time_critical = TimeCritical(timed=timed)
        self._uncertain = UncertainPredictions(self._roster.capacity)
        self._answers = Answers()
        self._prepare_for_budget()

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages that keep state between two steps, in the order in which they are restored."""
        return (
            *(self._roster, self._timeline, self._intake, self._tracking, self._candidates, self._first_impacts),
            *(self._events, self._active_pairs, self._time_critical, self._uncertain, self._answers),
        )

    # ------------------------------------------------------------------ settings

    @property
    def profile(self) -> Profile:
        """The settings of the next step. They can be set at any time, to a Profile or to its name (`Profile.switched`).

        Contacts persist. If a setting that predictions depend on changes, the next step predicts all objects anew.
        """
        return self._profile

    @profile.setter
    def profile(self, profile: str | Profile) -> None:
        new = profile if isinstance(profile, Profile) else self._profile.switched(profile)
        changed = self._profile.differences(new).keys()
        self._profile, self._settings = new, KernelSettings.of(new)
        if Profile.changes_predictions(changed):
            self._roster.renew_all()
        if changed & {"horizon", "horizon_by_name"}:
            self._roster.bodies.slack[:] = 0.0  # its limits are multiples of the horizon
        if "contact_details" in changed:
            self._active_pairs.forget_answers()
        if "threads" in changed:
            self._first_impacts.use_threads(new.threads)
        self._prepare_for_budget()

    def _prepare_for_budget(self) -> None:
        if TimeCritical.has_budget(self._profile):
            step = StepContext(self._roster, self._profile, self._settings, 0.0, 0)
            self._time_critical.prepare(step, self._first_impacts)

    # ------------------------------------------------------------------ objects

    @property
    def ids(self) -> list[int]:
        """The ids of all described objects, ascending."""
        return self._roster.ids

    def __repr__(self) -> str:
        """The profile, the objects and the last step."""
        last = f"step {self.last.step} at {self.last.stamp_ns} ns" if self.last is not None else "no step yet"
        return f"Monitor({self.profile.name!r}, {len(self.ids)} objects, {last})"

    def __contains__(self, object_id: int) -> bool:
        """Whether the object is described."""
        return object_id in self._roster

    def name(self, object_id: int) -> str:
        """Name of an object, for display. Raises InputError for an unknown id."""
        return self._roster.name(object_id)

    @property
    def plan(self) -> ScenePlan:
        """The tests and grid cells that the objects described now require; `print` shows them."""
        is_uncertain = self._uncertain.counts(self._profile)
        return scene_plan(self._roster, self._candidates.grid, uncertain=is_uncertain, outside=self._tracking.outside)

    def add(
        self, object_id: int, shape: Shape | Sequence[tuple[Shape, Pose]], *, replace: bool = False, **fields: Any
    ) -> None:
        """Add an object of one shape, or of several with their poses in its frame.

        replace: describe a known object anew; it keeps its state. The other fields are those of `ObjectDescription`:
        name, static, pose, group, mask, padding, model, allowed, max_linear_acceleration, max_angular_acceleration.
        Raises InputError for a known id without replace and for the pose of an object that is not static, and the
        errors of `describe`.
        """
        description = ObjectDescription(object_id, shape, **fields)
        if description.pose is not None and not description.static:
            raise InputError(
                f"object {object_id}: expected pose= of a static object only, got one of an object that moves; "
                "write static=True, or pass the pose to step"
            )
        if not replace and object_id in self._roster:
            raise InputError(
                f"object {object_id}: expected a new id, got that of {self.name(object_id)!r}; "
                "write replace=True to describe it anew, or remove it first"
            )
        self.describe(description)

    def describe(self, description: ObjectDescription, prepared: Modelled | None = None) -> None:
        """Add a new object, or replace the description of a known one and keep its state.

        prepared: what represents the object, if it is known already.
        Raises InputError, ShapeError; UnsupportedError for an unsupported shape or model.
        """
        if not isinstance(description, ObjectDescription):
            raise InputError(f"describe: expected an ObjectDescription, got {description!r:.99}; or use add(id, shape)")
        model = self.model_of(description)
        if model is not description.model:
            prepared = prepared or monitored_model(description.shapes, model)
            if prepared.excess > self._profile.model_error:
                model, prepared = description.model, None
        i = self._roster.describe(description, model, prepared)
        self._make_room()
        self._candidates.forget(np.array([i], np.int32))  # the next step inserts its new box
        self._time_critical.describe(self._roster, i, self._profile)
        self._uncertain.describe(i, description)
        self._active_pairs.end_unchecked(self._roster, i)

    def model_of(self, description: ObjectDescription) -> Model:
        """The model that represents an object: its own choice, or else the profile's for its class of shapes.

        `describe` makes the object exact instead if the profile's choice exceeds it by more than `model_error`.
        When the profile's choice changes, a described object keeps its model until it is described again.
        """
        kind = shape_class(description.shapes)
        if description.model is not Model.AUTO or kind is None:
            return description.model
        return parse_model(getattr(self._profile, f"model_{kind}"))

    def remove(self, object_id: int) -> None:
        """Forget an object; its contacts end. Raises InputError for an unknown id."""
        i = self._roster.slot(object_id)
        self._active_pairs.end(self._active_pairs.of_body(i))
        self._candidates.forget(np.array([i], np.int32))
        self._uncertain.forget(i)
        self._roster.remove(object_id)

    def _make_room(self) -> None:
        self._candidates.enlarge(self._roster.capacity)
        self._uncertain.enlarge(self._roster.capacity)

    # ------------------------------------------------------------------ answers

    @property
    def clock(self) -> StepClock:
        """The clock of the steps. A caller that publishes answers enters it, so that the budget includes that time."""
        return self._time_critical.clock

    @property
    def last(self) -> StepResult | None:
        """The answers of the last accepted step; None before the first."""
        return self._answers.last

    @property
    def digest(self) -> int:
        """64-bit digest of all answers so far."""
        return self._answers.digest

    @property
    def refused(self) -> dict[Refusal, int]:
        """Number of refused inputs by reason."""
        return self._intake.refused

    @property
    def last_refusal(self) -> str:
        """Text of the last refusal, or of the last restart of the timeline, whichever came later."""
        return self._intake.last_refusal

    @property
    def refusal_texts(self) -> dict[Refusal, str]:
        """Text of the last refusal by reason; empty: there was none. That of a restart is the one of TIME."""
        return self._intake.texts

    @property
    def restarts(self) -> int:
        """Number of times that the timeline restarted because time jumped."""
        return self._timeline.restarts

    @property
    def roster(self) -> Roster:
        """The objects and their last states, for reading."""
        return self._roster

    @property
    def now(self) -> float:
        """The latest time (s after the first stamp); the states in `roster` have such times."""
        return self._timeline.now

    @property
    def stale_ids(self) -> list[int]:
        """Ids of the objects that are stale at the latest time, ascending."""
        if self._answers.last is None or not self._timeline.has_begun:
            return []
        return self._roster.stale_ids(self._timeline.now, self._profile.stale_after)

    @property
    def unseen_ids(self) -> list[int]:
        """Ids of the moving objects without any state, ascending."""
        bodies, used = self._roster.bodies, self._roster.used()
        return sorted(bodies.id[used[~bodies.seen[used] & ~bodies.static[used]]].tolist())

    def refuse(self, reason: Refusal, text: str, count: int = 1) -> None:
        """Count refused inputs, also those that the caller refuses."""
        self._intake.refuse(reason, text, count)

    # ------------------------------------------------------------------ steps

    def _restart(self) -> None:
        self._active_pairs.end_all()
        self._events.clear()
        self._roster.forget_states()
        self._candidates.forget(np.arange(self._roster.top, dtype=np.int32))

    def step(
        self,
        stamp_ns: int,
        ids: ArrayLike,
        poses: Any = None,
        twists: Any = None,
        covariance: Any = None,
        *,
        now_ns: int | None = None,
    ) -> StepResult:
        """Observe the states of some objects at `stamp_ns` and report on all objects at the latest time so far.

        Pass either ids (N,), poses (N, 7: position, quaternion xyzw) and twists (N, 6: linear, angular; default 0), or
        a structured array of records.STATE as `ids`. World frame, SI units.
        covariance (N, 12): upper triangles, row by row, of the covariances of position and linear velocity. They
        replace the standard deviations in the states.
        now_ns: when the answers will be there, by the clock of the stamps. A predicted collision that begins before
        then is UNRESOLVED, because the prediction is older than what it predicts. None: not known.
        Unusable rows and stamps that jump are refused: the result lists them (`refused`), they raise nothing, and the
        first of each kind is a RefusalWarning. Raises InputError for arrays of another shape.
        """
        stamp_ns = _nanoseconds(stamp_ns, "stamp_ns")
        if now_ns is not None:
            now_ns = _nanoseconds(now_ns, "now_ns")
        states, covariances = self._intake.states(ids, poses, twists, covariance)
        self._intake.of_step = {}
        with self.clock:
            result = self._take_step(stamp_ns, states, covariances, now_ns)
        for each in result.refused:
            if each.reason in self._unwarned:
                self._unwarned.discard(each.reason)
                warnings.warn(f"{each.text} (later ones: see StepResult.refused)", RefusalWarning, stacklevel=2)
        return result

    def _take_step(
        self, stamp_ns: int, states: NDArray[np.void], covariances: NDArray[np.float64], now_ns: int | None
    ) -> StepResult:
        if not self._advance(stamp_ns, states):
            return replace(self._answers.none(), refused=tuple(self._intake.of_step.values()))
        roster, timeline = self._roster, self._timeline
        rates = self._profile.rate_by_name
        self._intake.take(states, covariances, timeline.seconds(stamp_ns), roster, self._uncertain, rates)
        step = StepContext(roster, self._profile, self._settings, timeline.now, self._answers.step_count + 1)
        budget = self._time_critical.budget(self._profile)
        new = self._predict_moved(step, bounds_only=budget is not None)
        self._examine_due(step, new, budget)
        contacts = self._answers.contacts(step, self._active_pairs)
        predictions = self._predictions(step, budget)
        age = self._age(now_ns)
        past = mark_overtaken(predictions, age) if age > 0.0 else 0
        status = step_status(step, self._active_pairs, self._events, contacts, predictions)
        self._time_critical.end_step(step)
        cut = budget.done if budget is not None and step.work.deferred else None
        refused = tuple(self._intake.of_step.values())
        result = StepResult(
            *(timeline.now_ns, step.number, contacts, predictions, status),
            cut=cut,
            refused=refused,
            overtaken=past,
            samples=step.samples,
        )
        return self._answers.finish(result)

    def _age(self, now_ns: int | None) -> float:
        """Return the age (s) of the latest states; 0 if `now_ns` is not known or cannot be of the stamps' clock."""
        age = (now_ns - self._timeline.now_ns) * 1e-9 if now_ns is not None else 0.0
        return age if 0.0 <= age <= self._profile.max_time_step else 0.0

    def _advance(self, stamp_ns: int, states: NDArray[np.void]) -> bool:
        """Move the timeline to the stamp. Return False if the stamp is refused."""
        p, timeline = self._profile, self._timeline
        seconds = (stamp_ns - timeline.now_ns) * 1e-9
        order = Order.IN_ORDER
        if timeline.is_behind(stamp_ns):
            is_late = -seconds > p.stale_after
            order = self._intake.order(states, timeline.seconds(stamp_ns), is_late, self._roster)
        match timeline.advance(stamp_ns, order, p.max_time_step, p.stale_after):
            case Progress.RESTARTS:
                self._restart()
                self.refuse(
                    Refusal.TIME,
                    f"time jumped by {seconds:+.3f} s, as a second message confirmed: the timeline restarts there, and "
                    "every moving object is unseen until its next state",
                    count=0,
                )
            case Progress.REFUSED:
                self.refuse(
                    Refusal.TIME,
                    f"stamp{_of_objects(states)}: expected within {p.max_time_step:g} s of the last one, got "
                    f"{seconds:+.3f} s; the next message restarts the clock there if it agrees",
                )
                return False
        return True

    def _predict_moved(self, step: StepContext, *, bounds_only: bool) -> Events:
        """Stages 2 to 4: return first impacts (IMPACT) of bodies whose predictions no longer hold or end too soon."""
        outside = self._tracking.apply_region(step, self._candidates.grid)
        if outside is not None:
            self._active_pairs.end_of(outside)
        moved, ending = self._tracking.find(step, self._uncertain)
        which = np.concatenate([moved, ending])
        if len(which) == 0:
            return NO_EVENTS
        self._tracking.restart(step, moved, ending, self._uncertain, self._candidates.grid)
        pairs = self._leave_out_crowds(step, self._candidates.find(step, which))
        self._uncertain.add_pairs(step, pairs)
        new = NO_EVENTS
        if len(pairs):
            new = self._first_impacts.bound(step, pairs) if bounds_only else self._first_impacts.predict(step, pairs)
            new = self._events.first_of_pairs(new, step.roster.bodies, self._active_pairs.pairs)
        self._tracking.remember_cover(step, which)
        return new

    def _leave_out_crowds(self, step: StepContext, pairs: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the pairs without those of the bodies beyond MOST_PAIRS, which become unseen until they part."""
        roster = self._roster
        out = crowded(roster.bodies, pairs, (self._active_pairs.pairs, self._events.events), roster.top)
        if not len(out):
            return pairs
        is_out = np.zeros(roster.top, np.bool_)
        is_out[out] = True
        ids = ", ".join(map(str, roster.bodies.id[out[:NAMED]].tolist())) + (", …" if len(out) > NAMED else "")
        self.refuse(
            Refusal.MALFORMED,
            f"expected at most {MOST_PAIRS:,} pairs of objects that may meet, got {len(pairs):,}: the {len(out):,} "
            f"objects with the most pairs (ids {ids}) are unseen until they part",
            len(out),
        )
        roster.forget_states(out)
        self._candidates.forget(out)
        self._active_pairs.end_of(is_out)
        return pairs.compress(~is_out[pairs].any(axis=1), axis=0)

    def _examine_due(self, step: StepContext, new: Events, budget: PairBudget | None) -> None:
        """Stages 5 and 6: examine the pairs that touch or are due; keep the other new impacts as events."""
        version = step.roster.bodies.version
        due, pending = self._events.take_due(version, step.now), new
        if len(new):
            is_due = new["lower"] <= step.now
            due, pending = both(due, new.compress(is_due)), new.compress(~is_due)
        step.work.events_due = len(due)
        self._active_pairs.unite(step, due)
        if budget is None:
            later = self._active_pairs.examine_all(step, self._first_impacts.scratch)
            self._events.add(both(pending, later), version)
        else:
            self._events.add(pending, version)
            self._time_critical.examine(step, self._active_pairs, self._events, self._first_impacts, budget)
            if not self._uncertain.counts(step.profile):
                budget.stop()

    def _predictions(self, step: StepContext, budget: PairBudget | None) -> NDArray[np.void]:
        """Stage 7: return the predictions (records.PREDICTION), with times and probabilities of uncertain states."""
        predictions, slots = self._answers.predictions(step, self._active_pairs, self._events)
        if self._uncertain.active:
            touching, pool = self._active_pairs.touching_keys, self._first_impacts.pool
            predictions = self._uncertain.complete(step, predictions, slots, touching, pool, budget)
        return self._answers.filtered(step, predictions)

    # ------------------------------------------------------------------ snapshots

    def snapshot(self) -> Snapshot:
        """Copy all state that later answers depend on; each stage saves its own."""
        snapshot = Snapshot({}, {FACTS: {}})
        for stage in self.stages:
            stage.save(snapshot, snapshot.facts[FACTS])
        return snapshot

    @classmethod
    def restored(cls, profile: Profile | str, snapshot: Snapshot, *, warns: bool = True) -> Self:
        """Return a monitor without a clock that continues from a snapshot with the same answers.

        warns: as in the constructor.
        Raises InputError if the snapshot is damaged, or was written by a program that saves other state.
        """
        monitor = cls(profile, timed=False, warns=warns)
        try:
            for stage in monitor.stages:
                stage.restore(snapshot, snapshot.facts[FACTS])
            monitor._make_room()
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"snapshot: expected the state of a monitor of this version, got: {error!r}") from None
        return monitor


def _nanoseconds(value: Any, name: str) -> int:
    """Return a time as int. Raises InputError."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        got = f"got {value!r:.100}; of seconds t write round(1e9 * t)"
        raise InputError(f"{name}: expected an integer number of nanoseconds, {got}")
    if not -MOST_NANOSECONDS <= value < MOST_NANOSECONDS:
        raise InputError(f"{name}: expected nanoseconds that 64 bits can hold, got {value}")
    return int(value)


def _of_objects(states: NDArray[np.void]) -> str:
    """Return the ids of the first states of a message, for a text."""
    ids = ", ".join(map(str, states["id"][:NAMED].tolist()))
    return f" of object {ids}" + (", …" if len(states) > NAMED else "") if ids else ""
