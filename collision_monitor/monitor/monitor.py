"""The monitor: contacts now and predicted collisions, step by step. `Monitor.take_step` is the list of the stages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final, Self, cast

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import InputError, Refusal
from collision_monitor.monitor.answers import mark_overtaken, step_status
from collision_monitor.monitor.budget import PairBudget
from collision_monitor.monitor.crowding import leave_out_crowds
from collision_monitor.monitor.event_list import NO_EVENTS, Events, both
from collision_monitor.monitor.given_plan import checked_plan
from collision_monitor.monitor.intake import Observation
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.stages import Stages
from collision_monitor.monitor.state.object_names import ids_named
from collision_monitor.monitor.state.snapshot import Snapshot, restore_stages
from collision_monitor.monitor.state.timeline import Progress
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.motion.trajectory import Tolerance, Trajectory
from collision_monitor.objects.chosen_model import chosen_model, model_within_error
from collision_monitor.objects.description import ALL_GROUPS, ObjectDescription
from collision_monitor.objects.models import Modelled
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile

MOST_SECONDS: Final = 9e9
"""Largest `stamp` (s); in ns it is near the largest number of 64 bits."""


class Monitor(Stages):
    """Keeps objects, follows their states, and reports contacts and predicted collisions at every step.

    The answers are a function of the profile, the descriptions and the states in the order in which they were given.
    They use no clock and no random numbers, and are the same bytes on every run. A profile with `budget_ms` adds the
    clock, which decides only how many pairs a step examines: a monitor with timed=False and that number as
    `pairs_per_step` (`StepResult.cut`) gives the same answers again.

    >>> import collision_monitor as cm
    >>> monitor = cm.Monitor()
    >>> monitor.add("wall", cm.Box((1, 1, 1)), static=True, pose=(0, 0, 0))
    1
    >>> monitor.add("ball", cm.Sphere(0.5))
    2
    >>> monitor.step(stamp=0.0, ids=["ball"], poses=[(2.5, 0, 0, 0, 0, 0, 1)], twists=[(-1, 0, 0, 0, 0, 0)])
    StepResult(step 1 at 0 ns: 0 contacts, 0 ended, 1 predictions)
      prediction: wall and ball in 1... to 1.5... s
    >>> monitor.nearest("wall").name, monitor.distance("wall", "ball")
    ('ball', 1.5)
    """

    def __init__(self, profile: str | Profile = "balanced", *, timed: bool = True, warns: bool = True) -> None:
        """Make a monitor without objects. warns: whether the first refusal of each kind is a RefusalWarning too."""
        super().__init__(profile if isinstance(profile, Profile) else Profile.named(profile), timed=timed, warns=warns)
        self._prepare_for_budget()

    def __repr__(self) -> str:
        """The profile, the objects and the last step."""
        last = f"step {self.last.step} at {self.last.stamp_ns} ns" if self.last is not None else "no step yet"
        return f"Monitor({self.profile.name!r}, {len(self.ids)} objects, {last})"

    # ------------------------------------------------------------------ objects

    def add(
        self,
        object_id: int | str,
        shape: Any,
        *,
        name: str = "",
        static: bool = False,
        pose: Any = None,
        group: int = 1,
        mask: int = ALL_GROUPS,
        padding: float = 0.0,
        model: Model | str = Model.AUTO,
        allowed: Iterable[int | str] = (),
        max_linear_acceleration: float = 0.0,
        max_angular_acceleration: float = 0.0,
        replace: bool = False,
    ) -> int:
        """Add an object of one shape, or of several with their poses in its frame. Return its id.

        object_id: a number, or a name alone, for which the next free id is taken. shape: a shape, an object of trimesh,
        or a list of (shape, pose). static: it stands at `pose`: a Pose, (x, y, z), 7 numbers or a matrix (4, 4).
        allowed: ids or names of the objects that it may touch. padding: m; accelerations: m/s^2 and rad/s^2. The fields
        are those of `ObjectDescription`. replace: describe a known object anew; it keeps its state.
        Raises InputError for a known id without replace and for the pose of an object that is not static, and the
        errors of `describe`.
        """
        if isinstance(object_id, str):
            name = name or object_id
            object_id = self.id_of(object_id) if replace else max(self.ids, default=0) + 1
        is_list = isinstance(allowed, Iterable) and not isinstance(allowed, str)
        description = ObjectDescription(
            *(object_id, shape, name, static, pose, group, mask, padding),
            model=cast(Model, model),  # or its name
            allowed=tuple(map(self.id_of, allowed)) if is_list else cast(Any, allowed),
            max_linear_acceleration=max_linear_acceleration,
            max_angular_acceleration=max_angular_acceleration,
        )
        if description.pose is not None and not description.static:
            raise InputError(
                f"object {object_id}: expected pose= of a static object only, got one of an object that moves; "
                "write static=True, or pass the pose to step"
            )
        if not replace and description.object_id in self._roster:
            raise InputError(
                f"object {object_id}: expected a new id, got that of {self.name(object_id)!r}; "
                "write replace=True to describe it anew, or remove it first"
            )
        self.describe(description)
        return description.object_id

    def describe(self, description: ObjectDescription, prepared: Modelled | None = None) -> None:
        """Add a new object, or replace the description of a known one and keep its state.

        prepared: what represents the object, if it is known already.
        Raises InputError, ShapeError; UnsupportedError for an unsupported shape or model.
        """
        if not isinstance(description, ObjectDescription):
            raise InputError(f"describe: expected an ObjectDescription, got {description!r:.99}; or use add(id, shape)")
        model, modelled = model_within_error(description, self._profile, prepared)
        i = self._roster.describe(description, model, modelled)
        if description.static:
            self._plans.drop(self._roster, np.array([i], np.int32))
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
        return chosen_model(description, self._profile)

    def remove(self, object_id: int | str) -> None:
        """Forget an object, given by id or name; its contacts end. Raises InputError for an unknown one."""
        object_id = self.id_of(object_id)
        i = self._roster.slot(object_id)
        self._active_pairs.end(self._active_pairs.of_body(i))
        self._candidates.forget(np.array([i], np.int32))
        self._uncertain.forget(i)
        self._plans.drop(self._roster, np.array([i], np.int32))
        self._roster.remove(object_id)

    def follow(
        self,
        object_id: int | str,
        plan: Trajectory | None,
        *,
        stamp_ns: int | None = None,
        tolerance: Tolerance = Tolerance(),  # noqa: B008  (a tuple of numbers)
    ) -> None:
        """Predict an object along a plan, in place of its last state, for as long as it is within the tolerance of it.

        A new plan replaces the one before; None ends it. stamp_ns: time 0 of the plan; by default the last step, or the
        first one if there was none. A body that leaves its plan, which `StepResult.left` says, goes on as its last
        state says, and so does one whose plan is over. Its contacts are those of its states. While it follows a plan,
        declared bounds on its acceleration do not count, nor does the error of its velocity; its tube does, which is as
        wide as it is off its plan.
        Raises InputError for an unknown or static object, a plan that is over or unknown after its end, and a tolerance
        that is no Tolerance of numbers from 0.
        """
        object_id = self.id_of(object_id)
        i = self._roster.slot(object_id)
        if plan is None:
            self._plans.drop(self._roster, np.array([i], np.int32))
        else:
            given = checked_plan(self._roster, self._timeline, object_id, plan, stamp_ns, tolerance)
            self._plans.follow(self._roster, i, *given, stamp_ns)

    def refuse(self, reason: Refusal, text: str, count: int = 1) -> None:
        """Count refused inputs, also those that the caller refuses."""
        self._refusals.add(reason, text, count)

    def _make_room(self) -> None:
        self._candidates.enlarge(self._roster.capacity)
        self._uncertain.enlarge(self._roster.capacity)

    # ------------------------------------------------------------------ steps

    def step(
        self,
        stamp_ns: int | None = None,
        ids: Any = (),
        poses: Any = None,
        twists: Any = None,
        covariance: Any = None,
        *,
        stamp: float | None = None,
        now_ns: int | None = None,
    ) -> StepResult:
        """Observe the states of some objects at a time and report on all objects at the latest time so far.

        stamp_ns: the time in ns, an integer; or `stamp`, in s. Pass either ids (N,), or names, with poses (N, 7:
        position, quaternion xyzw; also matrices (N, 4, 4) or a list of Pose) and twists (N, 6: linear, angular), or a
        structured array of records.STATE as `ids`. World frame, SI units. Without twists, the velocity of each object
        is estimated from its last pose and this one, and is 0 in its first state.
        covariance (N, 12): upper triangles, row by row, of the covariances of position and linear velocity. They
        replace the standard deviations in the states.
        now_ns: when the answers will be there, by the clock of the stamps. A predicted collision that begins before
        then is UNRESOLVED, because the prediction is older than what it predicts. None: not known.
        Unusable rows and stamps that jump are refused: the result lists them (`refused`), they raise nothing, and the
        first of each kind is a RefusalWarning. Raises InputError for arrays of another shape and for unknown names.
        """
        if (stamp_ns is None) == (stamp is None):
            got = "neither" if stamp is None else f"both: {stamp_ns!r:.40} and {stamp!r:.40}"
            raise InputError(f"step: expected stamp_ns (nanoseconds) or stamp (s), got {got}")
        if stamp is not None:
            stamp_ns = round(1e9 * checked_number(stamp, "stamp", "s", least=-MOST_SECONDS, most=MOST_SECONDS))
        with self.clock:
            given = Observation(cast(int, stamp_ns), self._numbered(ids), poses, twists, covariance, now_ns)
            result = self.take_step(given)
        self._refusals.warn(result.refused)
        return result

    def _numbered(self, ids: Any) -> Any:
        """The ids of names; ids as they are. Raises InputError for a name that not exactly one object has."""
        are_names = isinstance(ids, list | tuple | np.ndarray) and len(ids) > 0 and isinstance(ids[0], str)
        return ids_named(self._roster.names, map(str, ids)) if are_names else ids

    def take_step(self, given: Observation) -> StepResult:
        """As `step`, for a caller that has entered `clock` and does more in it. Refusals are no warnings here."""
        p, roster, timeline, refusals = self._profile, self._roster, self._timeline, self._refusals
        seen = self._intake.checked(given)  # 1
        refusals.begin_step()
        match self._intake.advance(seen, timeline, roster, p, refusals):
            case Progress.REFUSED:
                return self._answers.none(refusals.of_step)
            case Progress.RESTARTS:
                self._restart()
        self._intake.take(seen, timeline.seconds(seen.stamp_ns), roster, self._uncertain, p.rate_by_name, refusals)
        step = StepContext(roster, p, self._settings, timeline.now, self._answers.step_count + 1)
        budget = self._time_critical.budget(p)
        left = self._plans.judge(step, timeline, refusals)
        new = self._predict_moved(step, bounds_only=budget is not None)  # 2 to 4
        self._examine_due(step, new, budget)  # 5 and 6
        contacts = self._answers.contacts(step, self._active_pairs)  # 7
        predictions = self._predictions(step, budget)
        age = timeline.age(seen.now_ns, p.max_time_step)
        overtaken = mark_overtaken(predictions, age) if age > 0.0 else 0
        status = step_status(step, self._active_pairs, self._events, contacts, predictions)
        result = StepResult(
            *(timeline.now_ns, step.number, contacts, predictions, status),
            cut=self._time_critical.end_step(step, budget),
            refused=refusals.of_step,
            overtaken=overtaken,
            samples=step.samples,
            left=tuple(sorted(roster.bodies.id[left].tolist())),
            roster=roster,
        )
        return self._answers.finish(result)

    def _restart(self) -> None:
        self._active_pairs.end_all()
        self._events.clear()
        self._plans.forget(self._roster)
        self._roster.forget_states()
        self._candidates.forget(np.arange(self._roster.top, dtype=np.int32))

    def _predict_moved(self, step: StepContext, *, bounds_only: bool) -> Events:
        """Stages 2 to 4: return first impacts (IMPACT) of bodies whose predictions no longer hold or end too soon."""
        active, events, candidates = self._active_pairs, self._events, self._candidates
        outside = self._tracking.apply_region(step, candidates.grid)
        if outside is not None:
            active.end_of(outside)
        moved, ending = self._tracking.find(step, self._uncertain)
        replanned, lasting = self._plans.renew(step, self._tracking.inside, candidates.grid, self._uncertain)
        step.work.objects_moved += len(replanned)
        ending = np.concatenate([ending, lasting])
        which = np.concatenate([moved, replanned, ending])
        if len(which) == 0:
            return NO_EVENTS
        self._tracking.restart(step, moved, ending, self._uncertain, candidates.grid)
        pairs = candidates.find(step, which)
        pairs = leave_out_crowds(step, pairs, active, events, candidates, self._refusals)
        self._uncertain.add_pairs(step, pairs)
        new = NO_EVENTS
        if len(pairs):
            new = self._first_impacts.bound(step, pairs) if bounds_only else self._first_impacts.predict(step, pairs)
            new = events.first_of_pairs(new, step.roster.bodies, active.pairs)
        self._tracking.remember_cover(step, which)
        return new

    def _examine_due(self, step: StepContext, new: Events, budget: PairBudget | None) -> None:
        """Stages 5 and 6: examine the pairs that touch or are due; keep the other new impacts as events."""
        version = step.roster.bodies.version
        due, pending = self._events.take_due_with(new, version, step.now)
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
        predictions = self._answers.filtered(step, predictions)
        self._plans.mark(step.roster, predictions)
        return predictions

    # ------------------------------------------------------------------ snapshots

    @classmethod
    def restored(cls, profile: Profile | str, snapshot: Snapshot, *, warns: bool = True) -> Self:
        """Return a monitor without a clock that continues from a snapshot with the same answers.

        warns: as in the constructor.
        Raises InputError if the snapshot is damaged, or was written by a program that saves other state.
        """
        monitor = cls(profile, timed=False, warns=warns)
        restore_stages(monitor.stages, snapshot)
        monitor._plans.attach(monitor._roster, monitor._timeline.now if monitor._timeline.has_begun else 0.0)
        monitor._make_room()
        return monitor
