"""Plans: trajectories that bodies follow, in place of what their last states say, for as long as they stay near them.

The reference motion of such a body is the piece of its plan that holds now. Its tube is as wide as the body is off its
plan, so that a robot that follows it closely is predicted as exactly as the plan itself. A body that leaves its plan by
more than its tolerance is predicted from its last state from then on.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, inlined, kernel
from collision_monitor.broad_phase.hashed_grid import HashedGrid, put_box
from collision_monitor.errors import InputError, Refusal
from collision_monitor.geometry.vector import dot, magnitude
from collision_monitor.monitor.adaptive_tubes import NARROWEST, widest_tube
from collision_monitor.monitor.refusals import Refusals
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage, check_range
from collision_monitor.monitor.state.timeline import Timeline
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.monitor.tracking import (
    LONGEST_SLACK,
    SHORTEST_SLACK,
    WIDER,
    Uncertainty,
    set_cover,
    uncertainty_of,
)
from collision_monitor.monitor.uncertain_predictions import UncertainPredictions
from collision_monitor.motion.course import ARC, STRAIGHT
from collision_monitor.motion.motion import (
    MOTION,
    position_at,
    quaternion_to_matrix,
    rotation_at,
    set_piece,
    swept_box,
    twist_at,
)
from collision_monitor.motion.plan_deviation import STANDS
from collision_monitor.motion.stated_motion import ACCELERATION, ANGULAR, COURSE, LINEAR, REST
from collision_monitor.motion.trajectory import Tolerance, Trajectory
from collision_monitor.records import PlanFlag
from collision_monitor.uncertainty.spread import surface_spread, swing_radius

PLAN: Final = np.dtype(
    [
        ("apart", np.float64),  # m: how far the body was off its plan at its last state
        ("turned", np.float64),  # rad
        ("lately", np.float64),  # m: how far its surface may have been off since its last states, see FORGOTTEN
        ("drifted", np.float64),  # m/s: how fast it may have drifted off while it was silent, likewise
        ("tube", np.float64),  # m: how far the plan may be off its pieces
        ("across", np.float64),  # of its Tolerance
        ("along", np.float64),
        ("angle", np.float64),
        ("time", np.float64),
        ("ends", np.float64),  # s after the origin: time of the last point
        ("slot", np.int32),  # of the body
        ("first", np.int32),  # index of its first piece
        ("count", np.int32),  # of its pieces
        ("fresh", np.bool_),  # it has not been predicted yet
        ("waits", np.bool_),  # for the first step, after whose stamp all times are
        ("stamp", np.int64),  # ns: its time 0, if it waits; NO_STAMP: the first step
    ]
)
"""A plan in force."""

ROOM: Final = 1.5
"""Width of a tube, in deviations of now. Smaller: a body whose deviation varies is predicted anew more often."""

FORGOTTEN: Final = 0.3
"""Part of a deviation that is forgotten at each state. Larger: narrower bounds, which a noisy body leaves oftener."""

TOO_WIDE: Final = 8.0
"""Width of a tube, in those that the body needs, from which on it is predicted anew with a narrower one."""

NO_STAMP: Final = -(2**63)

ENDED: Final = "object {id}: expected a plan that is not over, got one that ended {late:.3f} s ago"

FOLLOWS, LEFT, OVER = range(3)
"""What becomes of a plan in a step."""

ROOMY: Final = 10_000
"""Pieces of all plans up to which there is room for two new plans in place of each."""

MOST_PIECES: Final = 10_000_000
"""Pieces of all plans together, 3 GB."""

Slots = NDArray[np.int32]


NOBODY: Final[Slots] = np.zeros(0, np.int32)


class Plans(Stage):
    """The plans in force, one of a body at most."""

    SAVED = ("_rows", "_pieces", "_left")

    def __init__(self) -> None:
        self._rows: NDArray[np.void] = np.zeros(0, PLAN)
        self._pieces: NDArray[np.void] = np.zeros(0, MOTION)
        self._left: NDArray[np.uint32] = np.zeros(0, np.uint32)  # ids of the bodies that left the last plan they had

    @property
    def slots(self) -> Slots:
        """Slots of the bodies that follow a plan."""
        return np.ascontiguousarray(self._rows["slot"])

    @property
    def left_ids(self) -> list[int]:
        """Ids of the bodies that left the last plan they had, ascending."""
        return list(map(int, self._left))

    # ------------------------------------------------------------------ plans

    def follow(
        self, roster: Roster, i: int, plan: Trajectory, tolerance: Tolerance, zero: float | None, stamp_ns: int | None
    ) -> None:
        """Let body i follow a plan. zero: its time 0 (s after the origin); None: there was no step, and no origin.

        stamp_ns: that time as a stamp; None: the first step. Raises InputError if there are MOST_PIECES already.
        """
        count, start, known = len(plan.numbers), zero or 0.0, np.flatnonzero(self._rows["slot"] == i)
        if not len(known):
            self._rows = np.concatenate([self._rows, np.zeros(1, PLAN)])
            known = np.array([len(self._rows) - 1])
        row, room = self._rows[known[0]], self._rows["count"][known[0]]
        row["count"] = 0
        first = row["first"] if count <= room else self._place(roster, count)
        write_pieces(self._pieces, int(first), plan.numbers, plan.begins, start, float(plan.times[0]))
        roster.bodies.motion["until"][i] = inf
        for name in ("lately", "drifted", "apart", "turned"):
            row[name] = 0.0
        row["tube"], row["ends"] = plan.tubes.max(), plan.times[-1] + start
        row["slot"], row["first"], row["count"] = i, first, count
        row["fresh"], row["waits"] = True, zero is None
        row["stamp"] = NO_STAMP if stamp_ns is None else stamp_ns
        for name, value in tolerance._asdict().items():
            row[name] = value
        roster.bodies.planned[i] = True
        if len(self._left):
            self._left = np.setdiff1d(self._left, roster.bodies.id[i : i + 1])

    def _place(self, roster: Roster, count: int) -> int:
        """Index of the first of `count` free pieces behind all others. If there is no room, the unused ones go."""
        rows = self._rows
        end = int((rows["first"] + rows["count"]).max(initial=0))
        if end + count <= len(self._pieces):
            return end
        needed = int(rows["count"].sum()) + count
        if needed > MOST_PIECES:
            raise InputError(f"trajectory: expected at most {MOST_PIECES} pieces of all plans together, got {needed}")
        kept = np.zeros(2 * needed + min(needed, ROOMY), MOTION)
        end = _move(rows, self._pieces, kept, roster.bodies.motion)
        self._pieces = kept
        roster.bodies = roster.bodies._replace(pieces=kept)
        return end

    def drop(self, roster: Roster, slots: Slots) -> None:
        """Let bodies go on as their last states say."""
        gone = np.isin(self._rows["slot"], slots)
        bodies = roster.bodies
        for i in self._rows["slot"][gone]:
            bodies.planned[i], bodies.motion["until"][i] = False, inf
            roster.renewed.add(int(i))
        self._rows = self._rows[~gone]
        if len(self._left):
            self._left = np.setdiff1d(self._left, roster.bodies.id[slots])

    def forget(self, roster: Roster) -> None:
        """Drop all plans."""
        self.drop(roster, self.slots)
        self._left = self._left[:0]

    # ------------------------------------------------------------------ the step

    def judge(self, step: StepContext, timeline: Timeline, refusals: Refusals) -> Slots:
        """Advance each plan to the piece that holds now, drop those that end, and return the slots that left theirs.

        A plan that was over before the first step is refused.
        """
        if not len(self._rows):
            return NOBODY
        roster = step.roster
        if self._rows["waits"].any():
            self._begin(timeline, roster, refusals)
        verdicts = np.empty(len(self._rows), np.uint8)
        judge_plans(roster.bodies, self._rows, step.now, verdicts)
        slots = self.slots
        left: Slots = slots[verdicts == LEFT]
        self.drop(roster, slots[verdicts != FOLLOWS])
        self._left = np.union1d(self._left, roster.bodies.id[left])
        renewed = np.isin(self._rows["slot"], list(roster.renewed))
        self._rows["fresh"] |= renewed
        roster.renewed.difference_update(self._rows["slot"][renewed].tolist())
        return left

    def _begin(self, timeline: Timeline, roster: Roster, refusals: Refusals) -> None:
        """Let the plans begin that waited for the first step, or refuse them."""
        for row in self._rows:
            if not row["waits"]:
                continue
            zero = timeline.now if row["stamp"] == NO_STAMP else timeline.seconds(int(row["stamp"]))
            pieces = self._pieces[row["first"] : row["first"] + row["count"]]
            for name in ("time", "until", "rest"):
                pieces[name] += zero
            row["ends"] += zero
            row["waits"] = False
            if (late := timeline.now - row["ends"]) > 0.0:
                refusals.add(Refusal.MALFORMED, ENDED.format(id=roster.bodies.id[row["slot"]], late=late))

    def renew(
        self, step: StepContext, inside: Callable[[Slots], Slots], grid: HashedGrid,
        uncertain: UncertainPredictions,
    ) -> tuple[Slots, Slots]:  # fmt: skip
        """Make plans the reference motions of the bodies to predict anew, and update their boxes in the grid.

        inside: leaves out the slots of bodies outside of the region. Returns the slots of those bodies, and of those
        to predict further; see `Tracking.find`.
        """
        if not len(self._rows):
            return NOBODY, NOBODY
        found, rows = np.empty((2, len(self._rows)), np.int32), self._rows
        which = np.flatnonzero(np.isin(rows["slot"], inside(self.slots)))
        seconds, settings = (step.now, step.horizons), step.settings.motion
        uncertainty = uncertainty_of(uncertain, step)
        n, m = renew_plans(step.roster.bodies, uncertainty, rows, which, grid, seconds, settings, found)
        return found[0, :n], found[1, :m]

    def mark(self, roster: Roster, predictions: NDArray[np.void]) -> None:
        """Write to predictions (records.PREDICTION) which of their bodies follow plans, and which left theirs."""
        for ids, flag in ((roster.bodies.id[self.slots], PlanFlag.FOLLOWS_A), (self._left, PlanFlag.LEFT_A)):
            if len(ids):
                of_a, of_b = (np.isin(predictions[name], ids) for name in ("id_a", "id_b"))
                predictions["plans"] |= (flag * of_a + 2 * flag * of_b).astype(np.uint8)

    # ------------------------------------------------------------------ snapshots

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage. The pieces are saved one plan after the other."""
        rows = self._rows.copy()
        kept = np.zeros(int(rows["count"].sum()), MOTION)
        _move(rows, self._pieces, kept, None)
        snapshot.arrays.update({"plans.rows": rows, "plans.pieces": kept, "plans.left": self._left})

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage. `attach` lets the bodies follow them."""
        self._rows = snapshot.array("plans.rows", np.zeros(0, PLAN))
        self._pieces = snapshot.array("plans.pieces", np.zeros(0, MOTION))
        self._left = snapshot.array("plans.left", np.zeros(0, np.uint32))
        rows, pieces = self._rows, self._pieces
        check_range("plans.rows", rows["slot"], 0, len(snapshot.arrays["bodies.used"]))
        check_range("plans.rows", rows["count"], 1, len(pieces) + 1)
        follow_each_other = np.append(0, np.cumsum(rows["count"]))
        check_range("plans.pieces", pieces["course"], STRAIGHT, ARC + 1)
        used = snapshot.arrays["bodies.used"] & ~snapshot.arrays["bodies.static"]
        if (
            follow_each_other[-1] != len(pieces)
            or not used[rows["slot"]].all()
            or len(np.unique(rows["slot"])) < len(rows)
        ):
            raise InputError("snapshot, plans.rows: expected plans of moving bodies, one after the other, got others")
        rows["first"], pieces["piece"] = follow_each_other[:-1], np.arange(len(pieces))
        for first, count in zip(rows["first"], rows["count"], strict=True):
            until = pieces["until"][first : first + count]
            if not (np.diff(until) > 0.0).all() or until[-1] != inf:
                raise InputError("snapshot, plans.pieces: expected pieces that follow each other for ever, got others")

    def attach(self, roster: Roster, now: float) -> None:
        """Let the restored bodies follow their restored plans from where they were, at `now` (s)."""
        bodies = roster.bodies = roster.bodies._replace(pieces=self._pieces)
        for row in self._rows:
            i, first, count = int(row["slot"]), int(row["first"]), int(row["count"])
            bodies.planned[i] = True
            if not row["fresh"]:
                until = self._pieces["until"][first : first + count]
                k = first + int(np.searchsorted(until, now, side="right"))
                bodies.motion["until"][i], bodies.motion["piece"][i] = self._pieces["until"][k], k


def _move(rows: Any, pieces: Any, kept: Any, motion: Any) -> int:
    """Copy the pieces of plans, one plan after the other, and change the rows; motion: of all bodies, or None.

    Returns the number of pieces.
    """
    at = 0
    for row in rows:
        slot, old, size = int(row["slot"]), int(row["first"]), int(row["count"])
        kept[at : at + size] = pieces[old : old + size]
        kept["piece"][at : at + size] += at - old
        if motion is not None and old <= motion["piece"][slot] < old + size:
            motion["piece"][slot] += at - old
        row["first"], at = at, at + size
    return at


@kernel
def write_pieces(pieces: Any, first: int, numbers: Any, begins: Any, start: float, first_time: float) -> None:
    """Write a plan of motions (M, NUMBERS) from begins (M,) on into pieces (first …) MOTION.

    start: time 0 of the plan (s). first_time: of its first point, until which the body stands.
    """
    for k in range(len(begins)):
        row, piece = numbers[k], pieces[first + k]
        piece.x, piece.y, piece.z = row[0], row[1], row[2]
        piece.vx, piece.vy, piece.vz = row[LINEAR], row[LINEAR + 1], row[LINEAR + 2]
        piece.wx, piece.wy, piece.wz = row[ANGULAR], row[ANGULAR + 1], row[ANGULAR + 2]
        piece.ax, piece.ay, piece.az = row[ACCELERATION], row[ACCELERATION + 1], row[ACCELERATION + 2]
        quaternion_to_matrix(numbers[:, 3:7], k, piece.rotation)
        piece.time = (begins[k] if k else first_time) + start
        piece.course, piece.rest = int(row[COURSE]), piece.time + row[REST]
        piece.until = begins[k + 1] + start if k + 1 < len(begins) else inf
        piece.piece = first + k


@inlined
def _piece_at(bodies: Any, row: Any, t: float) -> Any:
    """The piece of a plan that holds at time t, by bisection."""
    low, high = row.first, row.first + row.count - 1
    while low < high:
        middle = (low + high) // 2
        if bodies.pieces[middle].until <= t:
            low = middle + 1
        else:
            high = middle
    return bodies.pieces[low]


@allocating_kernel
def judge_plans(bodies: Any, rows: Any, now: float, verdicts: Any) -> None:
    """Write how far the last states are off the plans to rows (P,), and FOLLOWS, LEFT or OVER to verdicts (P,).

    The reference motion of each body becomes the piece that holds now. A plan is over once its last point has passed by
    more than its tolerance.
    """
    own, planned = np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(rows)):
        row = rows[k]
        i = row.slot
        verdicts[k] = OVER if now > row.ends + row.time else FOLLOWS
        if not bodies.seen[i] or verdicts[k] == OVER:
            continue
        m = bodies.motion[i]
        if not row.fresh and m.until <= now:
            set_piece(_piece_at(bodies, row, now), m)
        t = bodies.time[i]
        piece = _piece_at(bodies, row, t)
        x, y, z = position_at(piece, t)
        d = (bodies.position[i, 0] - x, bodies.position[i, 1] - y, bodies.position[i, 2] - z)
        quaternion_to_matrix(bodies.quaternion, i, own)
        rotation_at(piece, t, planned)
        chord = 0.0
        for r in range(3):
            for c in range(3):
                chord += (own[r, c] - planned[r, c]) ** 2
        row.apart, row.turned = magnitude(d), 2.0 * np.arcsin(min(sqrt(chord / 8.0), 1.0))
        v = twist_at(piece, t).velocity
        speed = magnitude(v)
        along, most = 0.0, row.across
        if speed > STANDS:
            along = dot(d, v) / speed
        else:
            most = max(row.across, row.along)
        across = sqrt(max(row.apart * row.apart - along * along, 0.0))
        if across > most or abs(along) > row.along + speed * row.time or row.turned > row.angle:
            verdicts[k] = LEFT


@inlined
def _deviation(bodies: Any, row: Any) -> float:
    """How far (m) the surface of a body was from the pieces of its plan at its last state."""
    r = bodies.spin_radius[row.slot]
    off: float = row.apart + (r * row.turned if 0.0 < r < inf else 0.0)
    return off


@inlined
def _narrow_tube(bodies: Any, i: int, settings: Any) -> tuple[float, float]:
    """Deviation (m) and drift (m/s) of a body that follows its plan exactly."""
    tube_0, tube_1 = widest_tube(bodies, i, settings)
    part = NARROWEST if settings.adaptive else 1.0
    return part * tube_0, part * tube_1


@inlined
def _uncertain_width(bodies: Any, uncertainty: Uncertainty, i: int, age: float, stale_acceleration: float) -> float:
    """Width (m) by which the errors of body i, which follows a plan, widen its box, see `planned_impacts.py`."""
    spread, sigmas = uncertainty
    if sigmas == 0.0:
        return 0.0
    off: float = surface_spread(bodies, spread, i, swing_radius(bodies, spread, i), age, 0.0, stale_acceleration)[0]
    return sigmas * off


@allocating_kernel
def renew_plans(
    bodies: Any, uncertainty: Uncertainty, rows: Any, which: Any, grid: HashedGrid, seconds: Any, settings: Any,
    found: Any,
) -> tuple[int, int]:  # fmt: skip
    """`find_moved` and `restart_motion` of the bodies that follow the plans rows[which], with their plans as motions.

    Writes the slots of those that were predicted anew to found[0], and of those that end too soon to found[1]; returns
    both numbers. seconds: now, and the horizon of each body (N,).
    """
    now, horizons = seconds
    n = n_ending = 0
    for k in which:
        row = rows[k]
        i = row.slot
        if not bodies.seen[i]:
            continue
        m, horizon, age = bodies.motion[i], horizons[i], now - bodies.time[i]
        off, needed = _deviation(bodies, row), _narrow_tube(bodies, i, settings)
        drift = settings.stale_acceleration * age
        apart, kept = off + 0.5 * drift * age, 1.0 if age > 0.0 else 1.0 - FORGOTTEN
        row.lately, row.drifted = max(apart, kept * row.lately), max(drift, kept * row.drifted)
        width = m.tube_0 - row.tube  # what is left for the body
        spread = _uncertain_width(bodies, uncertainty, i, age, settings.stale_acceleration)
        is_off = not (apart <= width and drift <= m.tube_1 and spread <= m.spread_0)
        is_wide = width > TOO_WIDE * max(needed[0], row.lately) or m.tube_1 > TOO_WIDE * max(needed[1], row.drifted)
        if row.fresh or is_off or is_wide:
            if bodies.slack[i] > 0.0:  # 0: the body is new
                bodies.slack[i] = max(0.5 * bodies.slack[i], SHORTEST_SLACK * horizon)
            set_piece(_piece_at(bodies, row, now), m)
            row.fresh = False
            bodies.version[i] += np.uint32(1)
            m.tube_time, m.anew, m.covered = now, now, -inf
            m.tube_0 = row.tube + max(needed[0], ROOM * row.lately, off + 2.0 * drift * age)
            m.tube_1 = needed[1] + 2.0 * row.drifted
            m.spread_0, m.spread_1 = WIDER * spread, 0.0
            set_cover(bodies, i, now, horizon)
            put_box(grid, i, swept_box(bodies, i, now, settings.margin))
            found[0, n] = i
            n += 1
        elif m.cover < now + horizon:
            bodies.slack[i] = min(2.0 * bodies.slack[i], LONGEST_SLACK * horizon)
            found[1, n_ending] = i
            n_ending += 1
    return n, n_ending
