"""The monitor: what touches now and what will touch next, step by step. The only stateful class of the core.

A step goes one straight way: states in -> which bodies left their predicted motion -> whom could those meet ->
when -> the event list -> the pairs that are due -> contacts and predictions out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor import records
from collision_monitor.broad_phase.dense_grid import box_pairs
from collision_monitor.broad_phase.hashed_grid import make_hashed_grid, read_boxes, regridded, remove_boxes
from collision_monitor.errors import CollisionMonitorError, InputError, Refusal, UnsupportedError
from collision_monitor.geometry.planar import flat_pose, flat_states, is_planar
from collision_monitor.geometry.pose import Pose
from collision_monitor.geometry.shape_table import CIRCLE, SPHERE, ShapeTableBuilder
from collision_monitor.geometry.shapes import HalfSpace, Shape
from collision_monitor.monitor import active_pairs, answers, candidates, filters, intake, time_critical, tracking
from collision_monitor.monitor.budget import EXAMINE, HANDFUL, REFINE, TREES, PairBudget, StepClock, TimeBudget
from collision_monitor.monitor.event_list import EventList, count_until, keep_first
from collision_monitor.monitor.patches import with_patches
from collision_monitor.monitor.roster import count_bodies
from collision_monitor.monitor.scene_plan import ScenePlan, scene_plan
from collision_monitor.monitor.uncertain_predictions import Scene, UncertainPredictions
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import monitored_model, parse_model, shape_class
from collision_monitor.prediction.body_contact import RESULT
from collision_monitor.prediction.body_impact import Scratch, make_scratch
from collision_monitor.prediction.impact_record import BOUND_ONLY, CLEAR, IMPACT, TREE_BOUND
from collision_monitor.prediction.motion import Bodies, enlarge, make_bodies, make_parts
from collision_monitor.prediction.pairs import bound_pairs, predict_pairs, refine
from collision_monitor.prediction.sphere_trees import Tree, Trees, body_tree, joined_trees, tighten
from collision_monitor.prediction.spread import worst_stddevs
from collision_monitor.prediction.turning import make_columns
from collision_monitor.records import Model, joined
from collision_monitor.settings.profile import NO_BUDGET, NO_LIMIT, Profile

NANOSECOND = 1e-9

MOST_QUERIES = 0.01
"""Part of the bodies up to which each is looked up in the hashed grid; for more, a new grid is built and swept once."""

FEWEST_PAIRS_FOR_THREADS = 500
"""Handing work to a thread costs as much as predicting some 100 pairs."""

_VERDICTS = {
    intake.UNKNOWN_ID: (Refusal.UNKNOWN_ID, "expected the id of an object that was described, got {id}"),
    intake.NON_FINITE: (
        Refusal.NON_FINITE,
        "object {id}: expected finite numbers up to 1e18 in pose and twist, standard deviations >= 0 and covariances "
        "that are positive semi-definite (a negative one here is minus the root of a negative eigenvalue), got {row}",
    ),
    intake.QUATERNION: (Refusal.QUATERNION, "object {id}: expected a unit quaternion within 1e-3, got {quaternion}"),
    intake.OLD: (
        Refusal.OLD,
        "object {id}: expected one state a message, newer than its last one, and none of a static object",
    ),
}


def _covariances(covariance: Any, states: NDArray[np.void]) -> NDArray[np.float64]:
    """Covariances (N, 12), or (0, 12) for none; the states' standard deviations are then set to their worst."""
    if covariance is None:
        return np.empty((0, 12))
    try:
        given = np.asarray(covariance, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("covariance: expected an array of numbers") from None
    if given.shape != (len(states), 12):
        raise InputError(f"covariance: expected shape ({len(states)}, 12), got {given.shape}")
    known, stddevs = worst_stddevs(given)
    states["position_stddev"], states["velocity_stddev"] = stddevs.T
    return known


@dataclass(frozen=True)
class StepStatus:
    """What a step did; the fields are those of MonitorStatus.msg."""

    objects: int
    objects_static: int
    objects_unseen: int
    objects_stale: int
    contacts: int
    predictions: int
    unresolved: int
    objects_moved: int
    candidate_pairs: int
    narrow_phase_tests: int
    impact_queries: int
    events_due: int
    events_pending: int
    deferred: int


@dataclass(frozen=True, eq=False)
class StepResult:
    """The answers of one step: `contacts` (records.CONTACT) by ids, `predictions` (records.PREDICTION) soonest first.

    With a profile of several `contact_points`, a contact has `point_count` rows, and `point_index` counts them.

    accepted is False where the whole step was refused for its stamp; the answers are then those of the last time.
    cut: pairs that were looked at until the budget ran out; None: all were.
    """

    stamp_ns: int
    step: int
    contacts: NDArray[np.void]
    predictions: NDArray[np.void]
    status: StepStatus
    accepted: bool = True
    cut: int | None = None


class Monitor:
    """Keeps objects, follows their states, and tells contacts and predicted collisions at every step.

    The answers are a function of the profile, the descriptions and the states in the order in which they were given:
    no clock, no random numbers, the same bytes on every run. A profile with `budget_ms` adds the clock, which decides
    how many pairs a step looks at, and nothing else: with the same `pairs_per_step` instead (`StepResult.cut`), and
    timed=False, the answers are the same again.
    """

    def __init__(self, profile: str | Profile = "balanced", *, timed: bool = True) -> None:
        self._profile = Profile.named(profile) if isinstance(profile, str) else profile
        self.refused: dict[Refusal, int] = dict.fromkeys(Refusal, 0)
        self.last_refusal = ""
        self.digest = 0
        self._step = 0
        self._slots: dict[int, int] = {}
        self._names: dict[int, str] = {}
        self._free: list[int] = []
        self._top = 0  # slots below have been used
        self._planar = False  # whether the scene is one in the plane
        self._shapes = ShapeTableBuilder()
        self._parts = make_parts(64)
        self._bodies: Bodies = make_bodies(64)
        self._grid = make_hashed_grid(64)
        self._allowed: dict[int, frozenset[int]] = {}
        self._allowed_keys = np.zeros(0, np.uint64)
        self._origin_ns: int | None = None
        self._now_ns = 0
        self._jump_ns: int | None = None  # a refused stamp; the next message may confirm it
        self._renewed: set[int] = set()  # slots whose description changed: predicted anew in the next step
        self._buffer = np.empty(64, records.STATE)
        self._events = EventList()
        self._uncertain = UncertainPredictions(64)
        self._scratch: list[Scratch] = []
        self._pool: ThreadPoolExecutor | None = None
        self._use_threads()
        self.clock = StepClock()
        self._tree_of: dict[int, Tree | None] = {}  # by slot: of those that a step with a budget has to do with
        self._trees: Trees | None = None  # all of them, until one changes
        self._timed = timed
        self._deferred = 0  # pairs that were left in the last step
        self._outside: NDArray[np.bool_] = np.zeros(0, np.bool_)  # bodies outside of the region, which rest
        self._pairs = np.zeros(0, active_pairs.PAIR)
        self._pair_events = np.zeros(0, IMPACT)
        self._orphans: list[tuple[int, float]] = []  # contacts (key, since) that ended because an object was removed
        self._ids = np.zeros(0, np.uint32)
        self._ids_slots = np.zeros(0, np.int32)
        self._candidates = np.zeros((1024, 2), np.int32)
        self._columns = make_columns()
        self._last: StepResult | None = None
        if self._has_budget:
            self._prepare_for_budget()

    # ------------------------------------------------------------------ settings

    @property
    def profile(self) -> Profile:
        """What the next step goes by. May be set at any time, to a Profile or to the name of one (`Profile.switched`).

        Nothing is forgotten: contacts persist, and what the change concerns is predicted anew in the next step.
        """
        return self._profile

    @profile.setter
    def profile(self, profile: str | Profile) -> None:
        new = self._profile.switched(profile) if isinstance(profile, str) else profile
        changed = self._profile.differences(new).keys()
        self._profile = new
        if Profile.changes_predictions(changed):
            self._renewed.update(np.flatnonzero(self._bodies.used[: self._top]).tolist())
        if "horizon" in changed:
            self._bodies.slack[:] = 0.0  # it is counted in horizons
        if "threads" in changed:
            self._use_threads()
        if self._has_budget:
            self._prepare_for_budget()

    def _use_threads(self) -> None:
        if self._pool is not None:
            self._pool.shutdown()
        threads = self._profile.threads
        self._scratch = [make_scratch() for _ in range(threads)]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    # ------------------------------------------------------------------ objects

    @property
    def ids(self) -> list[int]:
        """The ids of all described objects, ascending."""
        return sorted(self._slots)

    def name(self, object_id: int) -> str:
        """The object's name for people. Raises InputError for an unknown id."""
        self._slot(object_id)
        return self._names[object_id]

    @property
    def last(self) -> StepResult | None:
        """The answers of the last step that was accepted; None before the first."""
        return self._last

    @property
    def plan(self) -> ScenePlan:
        """Which tests and grid cells the objects described now require; `print` it."""
        return scene_plan(
            self._shapes.table,
            self._bodies,
            self._parts.next,
            self._grid,
            planar=self._planar,
            uncertain=self._uncertain.counts(self._profile),
            outside=int(np.count_nonzero(self._outside)),
        )

    def _slot(self, object_id: int) -> int:
        if object_id not in self._slots:
            raise InputError(f"expected the id of an object that was described, got {object_id!r}")
        return self._slots[object_id]

    def add(self, object_id: int, shape: Shape | Sequence[tuple[Shape, Pose]], **fields: Any) -> None:
        """Describe an object: one shape, or several with their poses in its frame.

        The further fields are those of `ObjectDescription`: name, static, pose, group, mask, padding, model, allowed,
        max_linear_acceleration, max_angular_acceleration. Raises as `describe` does.
        """
        self.describe(ObjectDescription(object_id, shape, **fields))

    def describe(self, description: ObjectDescription) -> None:
        """Take in a new object, or the new description of a known one, whose state is kept.

        Raises InputError, ShapeError; UnsupportedError for a shape or model that is not offered.
        """
        d = description
        if not d.static and any(isinstance(shape, HalfSpace) for shape, _ in d.shapes):
            raise UnsupportedError(f"object {d.object_id}: a HalfSpace has no end and can only be static")
        planar = self._is_planar(d)
        pose = flat_pose(d.pose) if planar and d.pose is not None else d.pose
        modelled = monitored_model(d.shapes, self.model_of(d))
        slots: list[int] = []
        try:
            for shape, offset in modelled.pieces:
                slots.append(self._shapes.append(shape, flat_pose(offset) if planar else offset, d.padding))
        except CollisionMonitorError:
            for slot in slots:
                self._shapes.remove(slot)
            raise
        i = self._slots.get(d.object_id)
        if i is None:
            i = self._slots[d.object_id] = self._new_body()
        else:
            self._drop_shapes(i)
        self._link_shapes(i, slots, modelled.shapes)
        self._planar = planar
        bodies, table = self._bodies, self._shapes.table
        bodies.used[i] = True
        bodies.id[i] = d.object_id
        bodies.group[i], bodies.mask[i] = d.group, d.mask
        radius = max(float(np.linalg.norm(table.local_position[s]) + table.radius[s]) for s in slots)
        bodies.motion["radius"][i] = radius
        bodies.model[i], bodies.excess[i], bodies.concave[i] = modelled.model, modelled.excess, not modelled.convex
        centred = len(slots) == 1 and table.kind[slots[0]] in (SPHERE, CIRCLE)
        centred = centred and not table.local_position[slots[0]].any()
        bodies.spin_radius[i] = 0.0 if centred else radius
        if d.static:
            assert pose is not None
            bodies.position[i], bodies.quaternion[i] = pose.position, pose.quaternion
            bodies.linear[i] = bodies.angular[i] = bodies.acceleration[i] = 0.0
            bodies.seen[i] = True
        elif bodies.static[i]:
            bodies.seen[i] = False  # it moves now, and where to is not known yet
            remove_boxes(self._grid, np.array([i], np.int32))
        bodies.static[i] = d.static
        bodies.version[i] += 1
        self._tree_of.pop(i, None)
        self._trees = None
        if self._has_budget:
            self._plant_tree(i)  # now, so that the next step need not
        self._uncertain.describe(i, d)
        self._names[d.object_id] = d.name
        self._allow(d.object_id, frozenset(d.allowed))
        self._end_pairs([k for k in self._pairs_of(i) if not self._is_checked(self._pairs[k])])
        self._renewed.add(i)
        self._ids = np.zeros(0, np.uint32)

    def model_of(self, description: ObjectDescription) -> Model:
        """What stands for such an object: the description's own choice, or else the profile's for its class of shapes.

        An object that was described before another choice of the profile keeps its model until it is described again.
        """
        kind = shape_class(description.shapes)
        if description.model is not Model.AUTO or kind is None:
            return description.model
        return parse_model(getattr(self._profile, f"model_{kind}"))

    def _is_planar(self, d: ObjectDescription) -> bool:
        """Whether the object is one of the plane. Raises UnsupportedError where it meets objects of space."""
        kinds = {is_planar(shape) for shape, _ in d.shapes}
        if any(known != d.object_id for known in self._slots):
            kinds.add(self._planar)
        if len(kinds) > 1:
            raise UnsupportedError(
                f"object {d.object_id}: Circle and Polygon meet each other only; expected a scene in the plane or one "
                "in space, got shapes of both"
            )
        return kinds.pop()

    def remove(self, object_id: int) -> None:
        """Forget an object; its contacts end. Raises InputError for an unknown id."""
        i = self._slot(object_id)
        self._end_pairs(self._pairs_of(i))
        remove_boxes(self._grid, np.array([i], np.int32))
        self._drop_shapes(i)
        self._uncertain.forget(i)
        self._bodies.used[i] = self._bodies.seen[i] = self._bodies.static[i] = False
        self._bodies.version[i] += 1
        self._renewed.discard(i)
        self._free.append(i)
        del self._slots[object_id], self._names[object_id]
        self._allow(object_id, frozenset())
        self._ids = np.zeros(0, np.uint32)

    def _pairs_of(self, i: int) -> list[int]:
        """Where the body in slot i is among the active pairs."""
        indices: list[int] = np.flatnonzero((self._pairs["i"] == i) | (self._pairs["j"] == i)).tolist()
        return indices

    def _is_checked(self, pair: np.void) -> bool:
        slots = np.array([[pair["i"], pair["j"]]], np.int32)
        seen = self._bodies.seen[slots].all()
        return bool(seen) and candidates.keep_checked(self._bodies, self._allowed_keys, slots) == 1

    def _end_pairs(self, indices: list[int]) -> None:
        """Take active pairs out; what touches is reported as ended in the next step."""
        for pair in self._pairs[indices]:
            if pair["touching"]:
                self._orphans.append((int(pair["key"]), float(pair["since"])))
        self._pairs = np.delete(self._pairs, indices)
        self._pair_events = np.delete(self._pair_events, indices)

    def _new_body(self) -> int:
        if self._free:
            return self._free.pop()
        if self._top == len(self._bodies.used):
            capacity = 2 * self._top
            bodies = make_bodies(capacity)
            enlarge(self._bodies, bodies)
            self._bodies = bodies
            self._grid = regridded(self._grid.box, capacity)
            self._uncertain.enlarge(capacity)
        self._top += 1
        return self._top - 1

    def _link_shapes(self, i: int, slots: list[int], shapes: list[int]) -> None:
        """Make the table's slots, each part of one of the description's shapes, those of body i."""
        table = self._shapes.table
        if len(self._parts.next) < len(table.kind):
            parts = make_parts(len(table.kind))
            enlarge(self._parts, parts)
            self._parts = parts
        self._bodies.first_shape[i] = slots[0]
        for index, slot in enumerate(slots):
            self._parts.index[slot] = shapes[index]
            self._parts.next[slot] = slots[index + 1] if index + 1 < len(slots) else -1
            turned = not np.array_equal(table.local_rotation[slot], np.eye(3))
            self._parts.placed[slot] = turned or table.local_position[slot].any()

    def _drop_shapes(self, i: int) -> None:
        slot = int(self._bodies.first_shape[i])
        while slot >= 0:
            self._shapes.remove(slot)
            slot, self._parts.next[slot] = int(self._parts.next[slot]), -1
        self._bodies.first_shape[i] = -1

    def _allow(self, object_id: int, others: frozenset[int]) -> None:
        if others == self._allowed.get(object_id, frozenset()):
            return
        self._allowed[object_id] = others
        if not others:
            del self._allowed[object_id]
        keys = {(min(a, b) << 32) | max(a, b) for a, others in self._allowed.items() for b in others}
        self._allowed_keys = np.array(sorted(keys), np.uint64)

    # ------------------------------------------------------------------ steps

    def refuse(self, reason: Refusal, text: str, count: int = 1) -> None:
        """Count a refused input; also for what the layer above finds wrong."""
        self.refused[reason] += count
        self.last_refusal = text

    def reset(self) -> None:
        """Forget all states, events and contacts; the objects stay and are unseen until their next state."""
        self._origin_ns = None
        self._restart_clock()

    def _restart_clock(self) -> None:
        bodies = self._bodies
        self._pairs["since"] = np.nan  # of another clock
        self._end_pairs(list(range(len(self._pairs))))
        self._events.clear()
        bodies.seen[:] = bodies.static & bodies.used
        bodies.version[:] += 1
        remove_boxes(self._grid, np.arange(self._top, dtype=np.int32))
        self._renewed = {i for i in range(self._top) if bodies.used[i]}

    def step(
        self, stamp_ns: int, ids: ArrayLike, poses: Any = None, twists: Any = None, covariance: Any = None
    ) -> StepResult:
        """Take in the states of some objects at `stamp_ns` and answer for all objects at the latest time so far.

        Either ids (N,), poses (N, 7: position, quaternion xyzw), twists (N, 6: linear, angular; default 0), or as
        `ids` a structured array of records.STATE. World frame, SI units.
        covariance (N, 12): of position and of linear velocity, upper triangles row by row, in place of the states'
        standard deviations along one axis, which then tell how large they are at most.
        Single rows that cannot be used are refused and counted (`refused`), never raised. Raises InputError for
        arrays of another shape.
        """
        if not isinstance(stamp_ns, int | np.integer) or isinstance(stamp_ns, bool):
            raise InputError(f"stamp_ns: expected an integer number of nanoseconds, got {stamp_ns!r}")
        states = self._states(ids, poses, twists)
        covariances = _covariances(covariance, states)
        with self.clock:
            return self._take_step(int(stamp_ns), states, covariances)

    def _take_step(self, stamp_ns: int, states: NDArray[np.void], covariances: NDArray[np.float64]) -> StepResult:
        if not self._accept_time(stamp_ns):
            return self._repeat()
        assert self._origin_ns is not None
        now = (self._now_ns - self._origin_ns) * NANOSECOND
        self._take(states, covariances, (stamp_ns - self._origin_ns) * NANOSECOND)
        self._step += 1
        self._apply_region(now)
        work = dict.fromkeys(
            ("objects_moved", "candidate_pairs", "narrow_phase_tests", "impact_queries", "events_due", "deferred"), 0
        )
        budget = self._budget()
        new = self._predict_moved(now, work, bounds_only=budget is not None)
        contacts = self._examine_active(new, now, work, budget)
        predictions = self._predictions(now)
        status = self._status(now, contacts, predictions, work)
        for part in (contacts, predictions):
            self.digest = int(answers.chain_digest(np.uint64(self.digest), part.view(np.uint64)))
        self._deferred = work["deferred"]
        cut = budget.done if budget is not None and self._deferred else None
        self._last = StepResult(self._now_ns, self._step, contacts, predictions, status, cut=cut)
        return self._last

    @property
    def _has_budget(self) -> bool:
        return self._profile.budget_ms < NO_BUDGET or self._profile.pairs_per_step < NO_LIMIT

    def _budget(self) -> PairBudget | None:
        """What this step may do; None: everything, and nothing was left before."""
        p = self._profile
        if p.budget_ms < NO_BUDGET and self._timed:
            return TimeBudget(self.clock, 1e-3 * p.budget_ms, p.pairs_per_step)
        return PairBudget(p.pairs_per_step) if self._has_budget or self._deferred else None

    def _prepare_for_budget(self) -> None:
        """Let no step wait for what only some of those with a budget need: the trees, and kernels from the cache."""
        none, scratch = np.empty(0, IMPACT), self._scratch[0]
        tighten(self._bodies, self._plant_trees(), none, 0.0, 0.0, scratch)
        self._impacts(refine, none, 0.0, scratch)

    def _plant_tree(self, i: int) -> None:
        self._tree_of[i] = body_tree(self._shapes.table, self._parts.next, int(self._bodies.first_shape[i]))

    def _plant_trees(self) -> Trees:
        """The sphere trees of all bodies; they depend on the shapes alone."""
        if self._trees is None or len(self._trees.root) < len(self._bodies.used):
            for i in np.flatnonzero(self._bodies.used[: self._top]).tolist():
                if i not in self._tree_of:
                    self._plant_tree(i)
            self._trees = joined_trees([self._tree_of.get(i) for i in range(self._top)], len(self._bodies.used))
        return self._trees

    def _states(self, ids: ArrayLike, poses: Any, twists: Any) -> NDArray[np.void]:
        try:
            given = np.asarray(ids)
        except ValueError:
            raise InputError(f"ids: expected one dimension of integers, got {ids!r}") from None
        if given.size == 0:
            return np.zeros(0, records.STATE)
        if given.dtype == records.STATE:
            if given.ndim != 1:
                raise InputError(f"states: expected one dimension, got shape {given.shape}")
            unknown = given["flags"] & records.StateFlag.TWIST_UNKNOWN  # whose standard deviations will be written in
            if given.flags.carray and not unknown.any():
                return given
            if len(given) > len(self._buffer):
                self._buffer = np.empty(len(given), records.STATE)
            states = self._buffer[: len(given)]
            states.view(np.uint8)[:] = np.ascontiguousarray(given).view(np.uint8)  # message bytes need not be aligned
            return states
        if given.ndim != 1 or not np.issubdtype(given.dtype, np.integer):
            raise InputError(f"ids: expected one dimension of integers, got {given.dtype} of shape {given.shape}")
        try:
            pose = np.asarray(poses, dtype=np.float64)
            twist = np.zeros((len(given), 6)) if twists is None else np.asarray(twists, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError("poses and twists: expected arrays of numbers") from None
        n = len(given)
        if pose.shape != (n, 7) or twist.shape != (n, 6):
            raise InputError(
                "expected ids (N,), poses (N, 7) and twists (N, 6), "
                f"got shapes {given.shape}, {pose.shape} and {twist.shape}"
            )
        if given.min() < 0 or given.max() >= 2**32:
            raise InputError(f"ids: expected integers from 0 to 4294967295, got {given.min()} to {given.max()}")
        states = np.zeros(n, records.STATE)
        states["id"] = given
        states["position"], states["quaternion"] = pose[:, :3], pose[:, 3:]
        states["linear"], states["angular"] = twist[:, :3], twist[:, 3:]
        return states

    def _accept_time(self, stamp_ns: int) -> bool:
        """Move the clock to the stamp; False: the stamp jumps too far and no second message has confirmed it yet."""
        if self._origin_ns is None:
            self._origin_ns = self._now_ns = stamp_ns
            self._jump_ns = None
            return True
        limit = int(self.profile.max_time_step / NANOSECOND)
        if abs(stamp_ns - self._now_ns) <= limit:
            self._now_ns = max(self._now_ns, stamp_ns)
            self._jump_ns = None
            return True
        if self._jump_ns is not None and abs(stamp_ns - self._jump_ns) <= limit:
            self._restart_clock()
            self._origin_ns = self._now_ns = stamp_ns
            self._jump_ns = None
            return True
        self._jump_ns = stamp_ns
        seconds = (stamp_ns - self._now_ns) * NANOSECOND
        self.refuse(
            Refusal.TIME,
            f"stamp: expected within {self.profile.max_time_step:g} s of the last one, got {seconds:+.3f} s; "
            "the next message restarts the clock there if it agrees",
        )
        return False

    def _repeat(self) -> StepResult:
        if self._last is not None:
            last = self._last
            return StepResult(last.stamp_ns, last.step, last.contacts, last.predictions, last.status, accepted=False)
        raise AssertionError("the first stamp is always accepted")

    def _take(self, states: NDArray[np.void], covariances: NDArray[np.float64], time: float) -> None:
        if len(states) == 0:
            return
        slots = self._slots_of(states["id"])
        used = flat_states(states) if self._planar else states
        numbers = used.view(np.float64).reshape(len(states), -1)
        verdicts = np.empty(len(states), np.uint8)
        flags = np.ascontiguousarray(states["flags"])
        accepted, uncertain = intake.take_states(self._bodies, slots, numbers, flags, time, verdicts)
        if uncertain or self._uncertain.active:
            taken = np.where(verdicts == intake.ACCEPTED, slots, np.int32(-1))
            self._uncertain.take(taken, numbers, covariances, self._planar)
        if accepted == len(states):
            return
        for verdict, (reason, text) in _VERDICTS.items():
            rows = np.flatnonzero(verdicts == verdict)
            if len(rows):
                row = states[rows[0]]
                told = {"id": int(row["id"]), "quaternion": row["quaternion"].tolist()}
                told["row"] = row.item()[:-2]
                self.refuse(reason, text.format(**told), len(rows))

    def _apply_region(self, now: float) -> None:
        """Let bodies rest that are outside of the region: in no grid, no event and no pair; and start who came in."""
        p, top, bodies = self._profile, self._top, self._bodies
        bounded = filters.is_bounded(p.region_min, p.region_max)
        if not bounded and not len(self._outside):
            return
        was = np.zeros(top, np.bool_)
        was[: len(self._outside)] = self._outside
        outside = np.zeros(top, np.bool_)
        if bounded:
            inside = filters.bodies_in(bodies, top, now, p.region_min, p.region_max, p.stale_acceleration)
            outside = bodies.used[:top] & ~inside
        self._renewed.update(np.flatnonzero(was & ~outside & bodies.used[:top]).tolist())
        remove_boxes(self._grid, np.flatnonzero(outside).astype(np.int32))
        bodies.version[:top][outside & ~was] += 1
        self._end_pairs(np.flatnonzero(outside[self._pairs["i"]] | outside[self._pairs["j"]]).tolist())
        self._outside = outside if bounded else outside[:0]

    def _slots_of(self, ids: NDArray[np.uint32]) -> NDArray[np.int32]:
        """Slot of each id, -1 where unknown; messages usually name the same objects as the last one did."""
        if not np.array_equal(ids, self._ids):
            self._ids_slots = self._find_slots(ids)
            self._ids = ids.copy()
        return self._ids_slots

    def _find_slots(self, ids: NDArray[np.uint32]) -> NDArray[np.int32]:
        known = np.fromiter(self._slots, np.uint32, len(self._slots))
        slot_of = np.fromiter(self._slots.values(), np.int32, len(self._slots))
        order = np.argsort(known)
        known, slot_of = known[order], slot_of[order]
        at = np.searchsorted(known, ids)
        at[at == len(known)] = 0
        found = known[at] == ids if len(known) else np.zeros(len(ids), bool)
        return np.where(found, slot_of[at] if len(known) else -1, -1).astype(np.int32)

    def _predict_moved(self, now: float, work: dict[str, int], *, bounds_only: bool) -> NDArray[np.void]:
        """Start the motion of bodies anew whose predictions no longer hold; their first impacts (IMPACT)."""
        p, bodies = self.profile, self._bodies
        moved, ending = self._moved(now)
        if self._renewed:
            renewed = np.array([i for i in self._renewed if bodies.seen[i]], np.int32)
            moved, ending = np.union1d(moved, renewed).astype(np.int32), np.setdiff1d(ending, renewed)
            self._renewed.difference_update(renewed.tolist())
        if len(self._outside):
            moved, ending = moved[~self._outside[moved]], ending[~self._outside[ending]]
        work["objects_moved"] = len(moved)
        which = np.concatenate([moved, ending])
        if len(which) == 0:
            return np.zeros(0, IMPACT)
        spread, sigmas = self._uncertain.spread, self._uncertain.sigmas(p)
        tracking.restart_motion(
            bodies, spread, sigmas, self._grid, moved, now, p.horizon, p.contact_margin, p.stale_acceleration,
            p.position_tolerance, p.velocity_tolerance, p.orientation_tolerance,
            p.angular_velocity_tolerance,
        )  # fmt: skip
        tracking.continue_motion(
            bodies, spread, sigmas, self._grid, ending, now, p.horizon, p.contact_margin, p.stale_acceleration
        )
        pairs = self._partners(which, now)
        pairs = pairs[: candidates.keep_checked(bodies, self._allowed_keys, pairs)]
        work["candidate_pairs"] = len(pairs)
        if self._uncertain.counts(p):
            self._uncertain.add_pairs(pairs, bodies, now)
        if bounds_only:  # what the bounding spheres say, where that is faster
            events, queries = self._impacts(bound_pairs, pairs, now, self._scratch[0])
        else:
            events, queries = self._first_impacts(pairs, now)
        work["impact_queries"] += queries
        events = events[: keep_first(events, bodies, self._events.events, self._pairs)]
        tracking.remember_cover(bodies, which)
        return events

    def _partners(self, which: NDArray[np.int32], now: float) -> NDArray[np.int32]:
        """Pairs (P, 2) of the bodies in `which` with all whose swept boxes meet theirs."""
        margin = self._profile.contact_margin
        is_new = np.zeros(len(self._grid.box), np.bool_)
        is_new[which] = True
        if len(which) > MOST_QUERIES * self._top:
            centre, half = np.empty((2, self._top, 3))
            read_boxes(self._grid.box, centre, half)
            pairs = box_pairs(centre, half, is_new[: self._top])
            return pairs[: candidates.keep_new(self._bodies, self._grid, pairs, is_new, now, margin)]
        found = np.empty(len(self._grid.box), np.int32)
        while True:
            n = candidates.find_partners(
                self._bodies, self._grid, which, is_new, now, margin, found, self._candidates
            )
            if n <= len(self._candidates):
                return self._candidates[:n]
            self._candidates = np.zeros((2 * n, 2), np.int32)

    def _first_impacts(self, pairs: NDArray[np.int32], now: float) -> tuple[NDArray[np.void], int]:
        """First impacts (IMPACT) of pairs (P, 2) in their order, on all threads; and the distance queries made."""
        if self._pool is None or len(pairs) < FEWEST_PAIRS_FOR_THREADS:
            return self._impacts(predict_pairs, pairs, now, self._scratch[0])

        def part(pairs: NDArray[np.int32], scratch: Scratch) -> tuple[NDArray[np.void], int]:
            return self._impacts(predict_pairs, pairs, now, scratch)

        # the kernels hold no lock; the parts are put together in order, so the answer is the same for any number
        parts = list(self._pool.map(part, np.array_split(pairs, len(self._scratch)), self._scratch))
        return joined([events for events, _ in parts]), sum(queries for _, queries in parts)

    def _impacts(
        self, find: Callable[..., tuple[int, int]], pairs: NDArray[Any], now: float, scratch: Scratch
    ) -> tuple[NDArray[np.void], int]:
        """What the kernel `find` says of the pairs: their impacts (IMPACT) in order, and the distance queries made."""
        p = self._profile
        events = np.empty(len(pairs) + 1, IMPACT)
        n, queries = find(
            self._shapes.table, self._parts, self._bodies, pairs, now, p.contact_margin,
            p.impact_tolerance, p.impact_iterations, events, scratch,
        )  # fmt: skip
        return events[:n], queries

    def _moved(self, now: float) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Slots of the bodies that left their predicted motion, and of others that are not predicted far enough."""
        moved, ending = np.empty((2, self._top), np.int32)
        p = self.profile
        n, m = tracking.find_moved(
            self._bodies, self._uncertain.spread, self._uncertain.sigmas(p), self._top, now, p.horizon,
            p.stale_acceleration, self._columns, moved, ending,
        )  # fmt: skip
        return moved[:n], ending[:m]

    def _examine_active(
        self, new: NDArray[np.void], now: float, work: dict[str, int], budget: PairBudget | None
    ) -> NDArray[np.void]:
        """Look at the pairs that are due or touch; the contacts (records.CONTACT). New events go into the list."""
        bodies = self._bodies
        is_due = new["lower"] <= now
        due = joined([self._events.take_due(bodies.version, now), new.compress(is_due)])
        work["events_due"] = len(due)
        room = len(self._pairs) + len(due)
        pairs, events, later = np.empty(room, active_pairs.PAIR), np.empty(room, IMPACT), np.empty(room, IMPACT)
        results = np.empty((room, RESULT))
        order = np.argsort(due["key"], kind="stable")
        n = active_pairs.unite(bodies, self._pairs, self._pair_events, due, order, pairs, events)
        pending = new.compress(~is_due)
        if budget is None:
            later = later[: self._examine(pairs, events, np.arange(n), now, results, later, work)]
            self._events.add(joined([pending, later]), bodies.version)
        else:
            self._events.add(pending, bodies.version)
            n = self._pass_by_trees(pairs[:n], events[:n], now, budget)
            later = later[: self._examine_urgent(pairs[:n], events[:n], now, results, later, work, budget)]
            which, found = self._look_at_trees(self._events.events, now, budget)
            if len(which):
                self._events.replace(which, found.compress(found["status"] != CLEAR), bodies.version)
            which, refined = self._refine(now, work, budget)
            budget.stop()
            self._events.replace(which, joined([later, refined]), bodies.version)
        self._pairs, self._pair_events = pairs[:n], events[:n]
        contacts = np.empty(n, records.CONTACT)
        n = answers.write_contacts(
            self._pairs, results, bodies, self._parts.index, now,
            contacts.view(np.float64).reshape(-1, 17),
            contacts.view(np.uint32).reshape(-1, 34),
            contacts.view(np.uint8).reshape(-1, 136),
        )  # fmt: skip
        contacts = contacts[:n]
        if self._profile.contact_points > 1:
            contacts = with_patches(
                contacts, self._shapes.table, self._parts, bodies, self._pairs, results, now,
                self._profile.contact_points,
            )  # fmt: skip
        return self._with_orphans(contacts, now)

    def _examine(
        self,
        pairs: NDArray[np.void],
        events: NDArray[np.void],
        which: NDArray[np.int64],
        now: float,
        results: NDArray[np.float64],
        later: NDArray[np.void],
        work: dict[str, int],
    ) -> int:
        """Look at these active pairs: their events and results, and events for later; returns how many of the last."""
        p = self._profile
        n_later, tests, queries = active_pairs.examine(
            self._shapes.table, self._parts, self._bodies, pairs, events, which, now, p.contact_margin,
            p.stale_acceleration, p.impact_tolerance, p.impact_iterations, results, later, self._scratch[0],
        )  # fmt: skip
        work["narrow_phase_tests"] += tests
        work["impact_queries"] += queries
        return int(n_later)

    def _examine_urgent(
        self,
        pairs: NDArray[np.void],
        events: NDArray[np.void],
        now: float,
        results: NDArray[np.float64],
        later: NDArray[np.void],
        work: dict[str, int],
        budget: PairBudget,
    ) -> int:
        """As `_examine`, the most urgent first, as long as the budget lasts; of the others, what their bounds say."""
        p = self._profile
        order, at = time_critical.urgency(self._bodies, pairs, events, self._step)
        n = self._examine(pairs, events, order[:at], now, results, later, work) if at else 0
        while at < len(order) and (count := budget.next(len(order) - at, EXAMINE)):
            n += self._examine(pairs, events, order[at : at + count], now, results, later[n:], work)
            at += count
        done, left = order[:at], order[at:]
        events["lower"][done[pairs["touching"][done] == 1]] = now  # since when nobody has looked at it
        work["deferred"] += len(left)
        bounded = time_critical.leave(
            self._bodies, pairs, events, left, now, p.contact_margin, p.stale_acceleration, results, later[n:]
        )
        return n + int(bounded)

    def _pass_by_trees(
        self, pairs: NDArray[np.void], events: NDArray[np.void], now: float, budget: PairBudget
    ) -> int:
        """Let pairs that came due pass whose sphere trees do not meet yet; the others go to the front: how many."""
        new = np.flatnonzero((pairs["touched"] == 0) & self._may_tell_by_trees(events))
        if not len(new):
            return len(pairs)
        which, found = self._look_at_trees(events.take(new), now, budget)
        which = new[which]
        events[which] = found
        apart = (found["status"] == CLEAR) | (found["lower"] > now)
        if not apart.any():
            return len(pairs)
        self._events.add(found.compress(apart & (found["status"] != CLEAR)), self._bodies.version)
        kept = np.ones(len(pairs), np.bool_)
        kept[which[apart]] = False
        n = int(np.count_nonzero(kept))
        pairs[:n], events[:n] = pairs.compress(kept), events.compress(kept)
        return n

    def _may_tell_by_trees(self, events: NDArray[np.void]) -> NDArray[np.bool_]:
        """Of which of the events only the bounding spheres are known, and a sphere tree might tell more."""
        trees = self._plant_trees()
        if not len(trees.radius):
            return np.zeros(len(events), np.bool_)
        has_tree = trees.root >= 0
        may: NDArray[np.bool_] = (events["method"] == BOUND_ONLY) & (has_tree[events["i"]] | has_tree[events["j"]])
        return may

    def _look_at_trees(
        self, events: NDArray[np.void], now: float, budget: PairBudget
    ) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        """When the sphere trees meet, of pairs of which only the bounding spheres are known; soonest first, by budget.

        Returns the places among the events of those that were done, and their events now; CLEAR: they do not meet.
        """
        trees = self._plant_trees()
        todo = np.flatnonzero(self._may_tell_by_trees(events))
        todo = todo[np.lexsort((events["key"][todo], events["lower"][todo]))]
        found, at = events.take(todo), 0
        while at < len(todo) and (count := budget.next(-(-(len(todo) - at) // HANDFUL), TREES)):
            end = min(at + count * HANDFUL, len(todo))
            margin = self._profile.contact_margin
            tighten(self._bodies, trees, found[at:end], now, margin, self._scratch[0])
            at = end
        return todo[:at], found[:at]

    def _refine(
        self, now: float, work: dict[str, int], budget: PairBudget
    ) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        """Seek the first impacts of pending pairs of which only a bound is known, soonest first, as the budget lasts.

        Returns the places in the event list of those that were done, and the events in place of them.
        """
        pending = self._events.events
        todo = np.flatnonzero((pending["method"] == BOUND_ONLY) | (pending["method"] == TREE_BOUND))
        found = [np.zeros(0, IMPACT)]
        at = 0
        while at < len(todo) and (count := budget.next(len(todo) - at, REFINE)):
            bounds = pending.take(todo[at : at + count])
            events, queries = self._impacts(refine, bounds, now, self._scratch[0])
            found.append(events)
            work["impact_queries"] += queries
            at += count
        work["deferred"] += len(todo) - at
        return todo[:at], joined(found)

    def _with_orphans(self, contacts: NDArray[np.void], now: float) -> NDArray[np.void]:
        """Add the END of contacts whose object is gone."""
        if not self._orphans:
            return contacts
        ended = np.zeros(len(self._orphans), records.CONTACT)
        for row, (key, since) in zip(ended, self._orphans, strict=True):
            for name in ("signed_distance", "error_bound", "point_a", "point_b", "normal", "closing_speed"):
                row[name] = np.nan
            row["id_a"], row["id_b"] = key >> 32, key & 0xFFFFFFFF
            row["duration"] = now - since
            row["phase"], row["point_count"] = records.Phase.END, 1
            row["model_a"] = row["model_b"] = Model.EXACT
        self._orphans.clear()
        both = joined([contacts, ended])
        begins = both["phase"] != records.Phase.END  # the END of what was comes before the BEGIN of what is
        return both[np.lexsort((begins, both["id_b"], both["id_a"]))]

    def _predictions(self, now: float) -> NDArray[np.void]:
        p = self.profile
        pending = self._events.events
        within = count_until(pending, now + p.horizon)
        predictions = np.empty(within + len(self._pairs), records.PREDICTION)
        slots = np.empty((len(predictions), 2), np.int32)
        n = answers.write_predictions(
            self._pairs, self._pair_events, pending[:within], self._bodies, self._parts.index, now, p.horizon,
            p.stale_after,
            predictions.view(np.float64).reshape(-1, 16),
            predictions.view(np.uint32).reshape(-1, 32),
            predictions.view(np.uint8).reshape(-1, 128),
            slots,
        )  # fmt: skip
        predictions = predictions[:n]
        if self._uncertain.active and p.horizon > 0.0:
            touching = self._pairs["key"][self._pairs["touching"] == 1]
            scene = Scene(self._shapes.table, self._parts, self._bodies, now, p, self._planar, self._pool)
            with self.clock.aside():  # no budget cuts it: with its time kept free, nothing else would be done
                predictions = self._uncertain.complete(predictions, slots[:n], touching, scene)
        if p.min_closing_speed > 0.0 or p.ignore_separating:
            predictions = self._filtered(predictions, now)
        return predictions

    def _filtered(self, predictions: NDArray[np.void], now: float) -> NDArray[np.void]:
        p = self._profile
        kept = np.ones(len(predictions), np.bool_)
        if p.min_closing_speed > 0.0:
            kept &= filters.closes_fast(predictions, p.min_closing_speed)
        if p.ignore_separating:
            i, j = (self._find_slots(predictions[name]) for name in ("id_a", "id_b"))
            kept &= filters.approaches(self._bodies, i, j, now)
        return predictions[kept]

    def _status(
        self,
        now: float,
        contacts: NDArray[np.void],
        predictions: NDArray[np.void],
        work: dict[str, int],
    ) -> StepStatus:
        unresolved = np.count_nonzero(contacts["status"] == records.ContactStatus.UNRESOLVED)
        unresolved += np.count_nonzero(predictions["status"] == records.PredictionStatus.UNRESOLVED)
        static, unseen, stale = count_bodies(self._bodies, self._top, now, self._profile.stale_after)
        return StepStatus(
            objects=len(self._slots),
            objects_static=int(static),
            objects_unseen=int(unseen),
            objects_stale=int(stale),
            contacts=int(np.count_nonzero(self._pairs["touching"])),
            predictions=len(predictions),
            unresolved=int(unresolved),
            events_pending=len(self._events),
            **work,
        )
