"""The stages of a monitor: what it keeps between two steps, and what anyone may read of that."""

from __future__ import annotations

import numpy as np

from collision_monitor.errors import InputError, Refusal
from collision_monitor.monitor.active_pairs import ActivePairs
from collision_monitor.monitor.answers import Answers
from collision_monitor.monitor.budget import StepClock
from collision_monitor.monitor.candidates import Candidates
from collision_monitor.monitor.event_list import EventList
from collision_monitor.monitor.first_impacts import FirstImpacts
from collision_monitor.monitor.intake import Intake
from collision_monitor.monitor.nearest_points import Neighbour, nearest_points_at, neighbour_of
from collision_monitor.monitor.plans import Plans
from collision_monitor.monitor.refusals import Refusals
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.scene_plan import ScenePlan, scene_plan
from collision_monitor.monitor.state.object_names import ids_named
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Snapshot, Stage, save_stages
from collision_monitor.monitor.state.timeline import Timeline
from collision_monitor.monitor.step_context import KernelSettings, StepContext
from collision_monitor.monitor.time_critical import TimeCritical
from collision_monitor.monitor.tracking import Tracking
from collision_monitor.monitor.uncertain_predictions import UncertainPredictions
from collision_monitor.settings.profile import Profile


class Stages:
    """The profile and the stages of a `Monitor`, which runs them. Reading changes nothing."""

    def __init__(self, profile: Profile, *, timed: bool, warns: bool) -> None:
        self._profile = profile
        self._settings = KernelSettings.of(profile)
        self._roster = Roster()
        self._timeline = Timeline()
        self._refusals = Refusals(warns=warns)
        self._intake = Intake()
        self._plans = Plans()
        self._tracking = Tracking()
        self._candidates = Candidates()
        self._first_impacts = FirstImpacts(profile.threads)
        self._events = EventList()
        self._active_pairs = ActivePairs()
        self._time_critical = TimeCritical(timed=timed)
        self._uncertain = UncertainPredictions(self._roster.capacity)
        self._answers = Answers()

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages that keep state between two steps, in the order in which they are restored."""
        return (
            *(self._roster, self._timeline, self._refusals, self._intake, self._plans, self._tracking),
            self._candidates,
            *(self._first_impacts, self._events, self._active_pairs, self._time_critical, self._uncertain),
            self._answers,
        )

    def snapshot(self) -> Snapshot:
        """Copy all state that later answers depend on; each stage saves its own."""
        return save_stages(self.stages)

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
        if self._time_critical.has_budget(self._profile):
            step = StepContext(self._roster, self._profile, self._settings, 0.0, 0)
            self._time_critical.prepare(step, self._first_impacts)

    # ------------------------------------------------------------------ objects

    @property
    def roster(self) -> Roster:
        """The objects and their last states, for reading."""
        return self._roster

    @property
    def ids(self) -> list[int]:
        """The ids of all described objects, ascending."""
        return self._roster.ids

    def __contains__(self, object_id: int) -> bool:
        """Whether the object is described."""
        return object_id in self._roster

    def name(self, object_id: int) -> str:
        """Name of an object, for display. Raises InputError for an unknown id."""
        return self._roster.name(object_id)

    def id_of(self, given: int | str) -> int:
        """Id of an object that is given by its id or by its name. Raises InputError for a name that is not of one."""
        return ids_named(self._roster.names, [given])[0] if isinstance(given, str) else given

    # ------------------------------------------------------------------ distances on demand

    def distance(self, a: int | str, b: int | str) -> float:
        """Signed distance (m) of two objects at the latest time, by their last states: negative if they overlap.

        Objects are given by id or name. Raises InputError for an unknown one, and for one without a state.
        """
        i, j = (np.array([self._seen_slot(each)], np.int32) for each in (a, b))
        now, limit = np.array([self._timeline.now]), np.array([np.inf])
        scratch = self._first_impacts.scratch
        return float(nearest_points_at(self._roster.multibody, i, j, now, limit, 0.0, scratch).distance[0])

    def nearest(self, a: int | str) -> Neighbour | None:
        """The object nearest to another one at the latest time, of those that are checked against it; None: none is.

        The object is given by id or name. Raises InputError for an unknown one, and for one without a state.
        """
        slot, scratch = self._seen_slot(a), self._first_impacts.scratch
        return neighbour_of(self._roster, slot, self._timeline.now, self._profile.stale_acceleration, scratch)

    def _seen_slot(self, given: int | str) -> int:
        slot = self._roster.slot(self.id_of(given))
        if not self._roster.bodies.seen[slot]:
            raise InputError(f"{given!r}: expected an object with a state, got one that no step has had; pass its pose")
        return slot

    @property
    def stale_ids(self) -> list[int]:
        """Ids of the objects that are stale at the latest time, ascending."""
        if self._answers.last is None or not self._timeline.has_begun:
            return []
        return self._roster.stale_ids(self._timeline.now, self._profile.stale_after)

    @property
    def unseen_ids(self) -> list[int]:
        """Ids of the moving objects without any state, ascending."""
        return self._roster.unseen_ids()

    @property
    def following(self) -> list[int]:
        """Ids of the objects that follow a plan, ascending; see `Monitor.follow`."""
        return sorted(self._roster.bodies.id[self._plans.slots].tolist())

    @property
    def off_plan(self) -> list[int]:
        """Ids of the objects that left their last plan and have no other one so far, ascending."""
        return self._plans.left_ids

    @property
    def plan(self) -> ScenePlan:
        """The tests and grid cells that the objects described now require; `print` shows them."""
        is_uncertain = self._uncertain.counts(self._profile)
        return scene_plan(self._roster, self._candidates.grid, uncertain=is_uncertain, outside=self._tracking.outside)

    # ------------------------------------------------------------------ time

    @property
    def now(self) -> float:
        """The latest time (s after the first stamp); the states in `roster` have such times."""
        return self._timeline.now

    @property
    def restarts(self) -> int:
        """Number of times that the timeline restarted because time jumped."""
        return self._timeline.restarts

    @property
    def clock(self) -> StepClock:
        """The clock of the steps. To publish answers within the budget, enter it and call `take_step`."""
        return self._time_critical.clock

    # ------------------------------------------------------------------ answers

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
        return self._refusals.counts

    @property
    def last_refusal(self) -> str:
        """Text of the last refusal, or of the last restart of the timeline, whichever came later."""
        return self._refusals.last

    @property
    def refusal_texts(self) -> dict[Refusal, str]:
        """Text of the last refusal by reason; empty: there was none. That of a restart is the one of TIME."""
        return self._refusals.texts
