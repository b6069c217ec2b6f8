"""Stage 2, tracking: find the bodies that left their predicted motion, and apply the region of interest.

A body that left its reference motion starts anew from its last state. A body that keeps its motion does not: its
predictions are continued before they end. A stale object widens its bounds here, in `find_moved` and
`restart_motion`; its contacts widen theirs in `impact.body_contact.widening`.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.broad_phase.hashed_grid import HashedGrid, put_box, remove_boxes
from collision_monitor.geometry.vector import magnitude, minus, scaled
from collision_monitor.monitor import filters
from collision_monitor.monitor.adaptive_tubes import FUTILE_STEPS, NARROWEST, PATIENCE, Unrest, fit_width, widest_tube
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.step_context import StepContext
from collision_monitor.monitor.uncertain_predictions import UncertainPredictions
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.last_state import age_of, set_reference, twist_now
from collision_monitor.motion.motion import swept_box, twist_at
from collision_monitor.motion.turning import BLOCK, COLUMNS, make_columns, turned_away
from collision_monitor.uncertainty.spread import surface_spread, swing_radius

FIRST_SLACK: Final = 0.5
SHORTEST_SLACK: Final = 0.0625
LONGEST_SLACK: Final = 1.0
"""Slack: how far beyond the horizon a body is predicted, in horizons; initial, smallest and largest value."""

WIDER: Final = 1.1
"""Factor on the spread of a box, because standard deviations vary a little from state to state."""

GOLDEN_RATIO: Final = 0.6180339887498949
PLASTIC_RATIO: Final = 0.7548776662466927
"""Multiples of these, modulo 1, fill the unit interval evenly."""

Slots = NDArray[np.int32]


class Uncertainty(NamedTuple):
    """The declared uncertainties, which widen the boxes of bodies."""

    spread: Any  # prediction.spread.Spread
    sigmas: float  # standard deviations by which boxes are widened; 0: nothing is uncertain


def uncertainty_of(uncertain: UncertainPredictions, step: StepContext) -> Uncertainty:
    """Return the uncertainties that widen boxes in a step."""
    return Uncertainty(uncertain.spread, uncertain.sigmas(step.profile))


class Tracking(Stage):
    """Compares the bodies' states with their predicted motions, and starts the bodies anew that left them."""

    SAVED = ("_outside", "_width", "_before", "_unrest")
    CACHES = ("_columns", "_are_narrow")

    def __init__(self) -> None:
        self._outside: NDArray[np.bool_] = np.zeros(0, np.bool_)  # by slot: outside of the region
        self._width: NDArray[np.float64] = np.zeros(0)  # by slot: part of the tolerances that the body uses
        self._before = 0.0  # time of the step before (s)
        self._unrest = Unrest()
        self._are_narrow = False  # whether all adaptive tolerances are NARROWEST in this step
        self._columns = make_columns()

    @property
    def outside(self) -> int:
        """Number of bodies outside of the region of interest."""
        return int(np.count_nonzero(self._outside))

    def apply_region(self, step: StepContext, grid: HashedGrid) -> NDArray[np.bool_] | None:
        """Exclude the bodies outside of the region, and mark those that came in to be predicted anew.

        An excluded body leaves the grid, and its pairs leave the event list, because its version changes. Returns the
        mask (top,) of the bodies outside, or None if there is no region.
        """
        p, roster = step.profile, step.roster
        top, bodies = roster.top, roster.bodies
        bounded = filters.is_bounded(p.region_min, p.region_max)
        if not bounded and not len(self._outside):
            return None
        was = np.zeros(top, np.bool_)
        was[: len(self._outside)] = self._outside
        outside = np.zeros(top, np.bool_)
        if bounded:
            inside = filters.bodies_in(bodies, top, step.now, p.region_min, p.region_max, p.stale_acceleration)
            outside = bodies.used[:top] & ~inside
        roster.renewed.update(np.flatnonzero(was & ~outside & bodies.used[:top]).tolist())
        remove_boxes(grid, np.flatnonzero(outside).astype(np.int32))
        bodies.version[:top][outside & ~was] += 1
        self._outside = outside if bounded else outside[:0]
        return outside

    def find(self, step: StepContext, uncertain: UncertainPredictions) -> tuple[Slots, Slots]:
        """Find the slots of the bodies to predict anew, and of those to predict further."""
        roster = step.roster
        moved, ending = self._moved(step, uncertain)
        if roster.renewed:
            renewed = np.array([i for i in roster.renewed if roster.bodies.seen[i]], np.int32)
            moved, ending = np.union1d(moved, renewed).astype(np.int32), np.setdiff1d(ending, renewed)
            roster.renewed.difference_update(renewed.tolist())
        step.work.objects_moved = len(moved := self.inside(moved))
        return moved, self.inside(ending)

    def inside(self, slots: Slots) -> Slots:
        """Those of some slots whose bodies are inside the region of interest."""
        return slots[~self._outside[slots]] if len(self._outside) else slots

    def _moved(self, step: StepContext, uncertain: UncertainPredictions) -> tuple[Slots, Slots]:
        """Find the slots of bodies that left their predicted motion, and of those whose prediction ends too soon."""
        roster = step.roster
        found = np.empty((2, roster.top), np.int32)
        uncertainty = uncertainty_of(uncertain, step)
        settings, columns = step.settings.motion, self._columns
        seconds = step.now, step.horizons
        n, m, moving = find_moved(roster.bodies, uncertainty, roster.top, seconds, settings, columns, found)
        step.period, self._before = step.now - self._before, step.now
        self._are_narrow = self._unrest.keeps_narrow(n, moving)
        return found[0, :n], found[1, :m]

    def _make_room(self, capacity: int) -> None:
        if len(self._width) < capacity:
            self._width = np.append(self._width, np.full(capacity - len(self._width), NARROWEST))

    def restart(
        self, step: StepContext, moved: Slots, ending: Slots, uncertain: UncertainPredictions, grid: HashedGrid
    ) -> None:
        """Start `moved` anew from their last states, and predict `ending` further. Update their boxes in the grid."""
        bodies, settings = step.roster.bodies, step.settings.motion
        uncertainty = uncertainty_of(uncertain, step)
        self._make_room(step.roster.capacity)
        limits = FUTILE_STEPS * step.period, self._are_narrow
        seconds = step.now, step.horizons
        renew_motions(bodies, uncertainty, grid, moved, ending, seconds, limits, settings, self._width)

    def remember_cover(self, step: StepContext, which: Slots) -> None:
        """Record that the bodies `which` have been predicted until their cover times."""
        remember_cover(step.roster.bodies.motion, which)

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        snapshot.arrays["outside"] = self._outside.copy()
        snapshot.arrays["width"] = self._width.copy()
        facts["before"], facts["unrest"] = self._before, [self._unrest.share, self._unrest.left]

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self._outside = snapshot.array("outside", np.zeros(0, np.bool_))[: len(snapshot.arrays["bodies.used"])]
        self._width = np.clip(snapshot.array("width", np.zeros(0)), -PATIENCE, 1.0)
        self._before = float(facts["before"])
        share, left = facts["unrest"]
        self._unrest = Unrest(float(share), int(left))


@device
def _turned_away(bodies: Any, start: int, count: int, columns: Any, angles: Any) -> None:
    """`turned_away`, skipped if rotation moves none of the bodies."""
    turns = False
    for i in range(start, start + count):
        turns |= bodies.spin_radius[i] > 0.0
    if turns:
        turned_away(bodies, start, count, columns, angles)


@settled
@kernel
def find_moved(
    bodies: Any, uncertainty: Uncertainty, count: int, seconds: Any, settings: Any, columns: Any, found: Any
) -> tuple[int, int, int]:
    """Find the bodies among the first `count` slots whose predictions no longer hold at `now`, or end too soon.

    Those that follow plans are left out: see `plans.py`.

    The slots of the former are written into found[0], those of the latter, which end within the horizon, into found[1];
    returns both numbers, and that of all bodies that move. A prediction holds while the body's surface is within tube_0
    (m) of its reference motion and drifts from it by at most tube_1 (m/s), and while its uncertainty fits into its box.
    A stale object widens its bounds here: deviation and drift include what it may have accelerated since its last
    state.
    The slack of a body is halved when it leaves its motion, and doubled when the motion held to the end: a body that
    often changes its motion is not predicted far. seconds: now, and the horizon of each body (N,). columns: scratch, of
    `make_columns`.
    """
    now, horizons = seconds
    stale_acceleration = settings.stale_acceleration
    moved, ending = found[0], found[1]
    n = n_ending = moving = 0
    angles = columns[COLUMNS]
    for i in range(count):
        if i % BLOCK == 0:
            _turned_away(bodies, i, min(BLOCK, count - i), columns, angles)
        if not bodies.used[i] or not bodies.seen[i] or bodies.static[i] or bodies.planned[i]:
            continue
        moving += 1
        m, horizon = bodies.motion[i], horizons[i]
        age = now - bodies.time[i]
        apart, drift = _deviation(bodies, i, now, horizon, stale_acceleration, angles[i % BLOCK])
        if not (apart <= m.tube_0 and drift <= m.tube_1):
            if bodies.slack[i] > 0.0:  # 0: the body is new
                bodies.slack[i] = max(0.5 * bodies.slack[i], SHORTEST_SLACK * horizon)
            moved[n] = i
            n += 1
        elif _is_wide_without_need(bodies, i, age, settings) or (
            uncertainty.sigmas > 0.0 and not _is_covered(bodies, uncertainty, i, now, horizon, stale_acceleration)
        ):
            moved[n] = i
            n += 1
        elif m.cover < now + horizon:
            bodies.slack[i] = min(2.0 * bodies.slack[i], LONGEST_SLACK * horizon)
            ending[n_ending] = i
            n_ending += 1
    return n, n_ending, moving


@inlined
def _deviation(
    bodies: Any, i: int, now: float, horizon: float, stale_acceleration: float, angle: float
) -> tuple[float, float]:
    """How far (m) the surface of body i is from its reference motion, and how fast (m/s) it drifts from it, at most.

    angle: by which the body's last orientation is turned from that of its reference motion (rad). If the origin alone
    has left the motion, its surface is not computed.
    """
    m = bodies.motion[i]
    age, since = now - bodies.time[i], now - m.time
    if m.course != STRAIGHT or bodies.course[i] != STRAIGHT:
        return _course_deviation(bodies, i, now, horizon, stale_acceleration, angle)
    dx = bodies.position[i, 0] - m.x + (bodies.linear[i, 0] * age - m.vx * since)
    dy = bodies.position[i, 1] - m.y + (bodies.linear[i, 1] * age - m.vy * since)
    dz = bodies.position[i, 2] - m.z + (bodies.linear[i, 2] * age - m.vz * since)
    ux, uy, uz = bodies.linear[i, 0] - m.vx, bodies.linear[i, 1] - m.vy, bodies.linear[i, 2] - m.vz
    ax, ay, az = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
    harder = 0.0
    if ax != 0.0 or ay != 0.0 or az != 0.0 or m.ax != 0.0 or m.ay != 0.0 or m.az != 0.0:
        dx += 0.5 * (ax * age * age - m.ax * since * since)
        dy += 0.5 * (ay * age * age - m.ay * since * since)
        dz += 0.5 * (az * age * age - m.az * since * since)
        ux, uy, uz = ux + (ax * age - m.ax * since), uy + (ay * age - m.ay * since), uz + (az * age - m.az * since)
        harder = sqrt((ax - m.ax) ** 2 + (ay - m.ay) ** 2 + (az - m.az) ** 2)
    apart = sqrt(dx * dx + dy * dy + dz * dz)
    # half the difference of accelerations, over two horizons: a body is predicted at most that far
    drift = sqrt(ux * ux + uy * uy + uz * uz) + harder * horizon
    if age > 0.0:
        apart += 0.5 * stale_acceleration * age * age
        drift += stale_acceleration * age
    r = bodies.spin_radius[i]
    if r > 0.0 and apart <= m.tube_0 and drift <= m.tube_1:
        dx, dy, dz = bodies.angular[i, 0] - m.wx, bodies.angular[i, 1] - m.wy, bodies.angular[i, 2] - m.wz
        off = sqrt(dx * dx + dy * dy + dz * dz)
        drift += r * off
        # the angle is of the last state's time; from then to now it grows at most by the difference of the rates
        apart += r * (angle + off * age)
    return apart, drift


@device
def _course_deviation(
    bodies: Any, i: int, now: float, horizon: float, stale_acceleration: float, angle: float
) -> tuple[float, float]:
    """`_deviation` of a body that brakes or goes along an arc, in its last state or in its reference motion.

    T seconds from now, two velocities differ by at most what they do now, T times what their changes of speed do, and
    the speed times the angle between both headings, T times the difference of the rates of turn and T^2 / 2 times that
    of their changes. A body is predicted at most two horizons far.
    """
    m = bodies.motion[i]
    age = now - bodies.time[i]
    if m.course != bodies.course[i] or (m.rest < inf) != (bodies.rest[i] < inf):
        return inf, inf
    own, other = twist_now(bodies, i, age), twist_at(m, now)
    p, x, y, z = bodies.position, other.moved[0] + m.x, other.moved[1] + m.y, other.moved[2] + m.z
    apart = magnitude((p[i, 0] - x + own.moved[0], p[i, 1] - y + own.moved[1], p[i, 2] - z + own.moved[2]))
    off = magnitude(minus(own.angular, other.angular))
    slower = bend = 0.0
    if own.change != 0.0 or other.change != 0.0:
        slower = magnitude(minus(scaled(own.velocity, own.change), scaled(other.velocity, other.change)))
        bend = magnitude(minus(scaled(own.angular, own.change), scaled(other.angular, other.change)))
    fastest = max(magnitude(own.velocity), magnitude(other.velocity))
    if m.rest == inf:  # it may speed up, or go backwards
        fastest *= max(1.0, abs(1.0 + 2.0 * horizon * own.change), abs(1.0 + 2.0 * horizon * other.change))
    drift = magnitude(minus(own.velocity, other.velocity))
    drift += horizon * (slower + fastest * (off + 2.0 / 3.0 * horizon * bend))
    apart += 0.5 * stale_acceleration * age * age
    drift += stale_acceleration * age
    r = bodies.spin_radius[i]
    if r > 0.0:
        drift += r * (off + horizon * bend)
        apart += r * (angle + (off + 0.5 * bend * age) * age)
    return apart, drift


@device
def _is_wide_without_need(bodies: Any, i: int, age: float, settings: Any) -> bool:
    """Whether body i was stale when its motion started, and is not stale now.

    A tube as wide as a long silence required would hold for ever, and with it UNRESOLVED pairs. Tubes of shorter
    silences are kept, because objects of a slow publisher would otherwise be predicted anew at each of their states.
    """
    narrow = settings.velocity_tolerance + bodies.spin_radius[i] * settings.angular_velocity_tolerance
    widest = narrow + 2.0 * settings.stale_acceleration * settings.stale_after
    return age <= settings.stale_after and bodies.motion[i].tube_1 > widest


@settled
@kernel
def remember_cover(motion: Any, which: Any) -> None:
    """Record that the bodies `which` (M,) have been predicted until their cover times, by this motion (MOTION)."""
    for i in which:
        motion[i].covered = motion[i].cover


@device
def _is_covered(
    bodies: Any, uncertainty: Uncertainty, i: int, now: float, horizon: float, stale_acceleration: float
) -> bool:
    """Whether the box of body i is wide enough for its uncertainty."""
    spread, sigmas = uncertainty
    m = bodies.motion[i]
    age = now - bodies.time[i]
    radius = bodies.spin_radius[i]
    off, growth = surface_spread(bodies, spread, i, radius, age, horizon, stale_acceleration)
    return sigmas * off <= m.spread_0 + m.spread_1 * (now - m.tube_time) and sigmas * growth <= m.spread_1


@device
def _cover_spread(
    bodies: Any, uncertainty: Uncertainty, i: int, now: float, most: Any, stale_acceleration: float
) -> None:
    """Widen the box of body i for its uncertainty from now until its cover time, by at most most[0] + most[1] t (m).

    This suffices until the age of its last state has doubled, and for states that are a little less certain.
    """
    spread, sigmas = uncertainty
    m = bodies.motion[i]
    m.spread_0 = m.spread_1 = 0.0
    if sigmas > 0.0 and not bodies.static[i]:
        age = 2.0 * (now - bodies.time[i])
        radius = swing_radius(bodies, spread, i)
        off, growth = surface_spread(bodies, spread, i, radius, age, m.cover - now, stale_acceleration)
        m.spread_0, m.spread_1 = min(WIDER * sigmas * off, most[0]), min(WIDER * sigmas * growth, most[1])


@device
def set_cover(bodies: Any, i: int, now: float, horizon: float) -> None:
    """Set the cover time of body i: the end of the horizon and a share of its slack.

    The later stages predict only what lies after `covered`. The share depends on the body's slot and the time, so that
    the predictions of bodies do not end together. It lies in the upper half of the slack, and for a new body anywhere
    in it, because most bodies begin in the same step.
    """
    m = bodies.motion[i]
    if bodies.static[i]:
        m.cover = np.inf
        return
    periods = now / horizon if horizon > 0.0 else 0.0  # 0: the profile requests only present contacts
    share = (i * GOLDEN_RATIO + periods * PLASTIC_RATIO) % 1.0
    if bodies.slack[i] == 0.0:
        bodies.slack[i] = FIRST_SLACK * horizon
    else:
        share = 0.5 + 0.5 * share
    m.cover = now + horizon + bodies.slack[i] * share


@settled
@kernel
def renew_motions(
    bodies: Any, uncertainty: Uncertainty, grid: HashedGrid, moved: Any, ending: Any, seconds: Any, limits: Any,
    settings: Any, width: Any,
) -> None:  # fmt: skip
    """`restart_motion` of the bodies `moved` (M,), then `continue_motion` of those in `ending`.

    seconds: now, and the horizon of each body (N,).
    """
    restart_motion(bodies, uncertainty, grid, moved, seconds, limits, settings, width)
    continue_motion(bodies, uncertainty, grid, ending, seconds, settings, width)


@device
def restart_motion(
    bodies: Any, uncertainty: Uncertainty, grid: HashedGrid, which: Any, seconds: Any, limits: Any, settings: Any,
    width: Any,
) -> None:  # fmt: skip
    """Make the last state of each body in `which` (M,) its reference motion, and put its swept box into the grid.

    The version of the body changes, so that its pairs leave the event list. A stale object widens its bounds here: its
    tube grows by what it may deviate, at stale_acceleration, until the age of its last state has doubled.
    width (N,): part of the tolerances that a body uses if they are adaptive. limits: see `fit_width`.
    """
    now, horizons = seconds
    stale_acceleration = settings.stale_acceleration
    for k in range(which.size):
        i = which[k]
        part = 1.0
        if settings.adaptive:
            fit_width(bodies, i, now, limits, settings, width)
            part = max(width[i], NARROWEST)
        m = bodies.motion[i]
        bodies.version[i] += np.uint32(1)
        age = age_of(bodies, i, now)
        set_reference(bodies, i, age, now, bodies.ref_quaternion, i, m)
        m.tube_time = m.anew = now
        m.covered = -np.inf
        m.tube_0 = m.tube_1 = 0.0
        set_cover(bodies, i, now, horizons[i])
        if not bodies.static[i]:
            tube_0, tube_1 = widest_tube(bodies, i, settings)
            m.tube_0, m.tube_1 = part * tube_0, part * tube_1
            if age > 0.0:
                m.tube_0 += 2.0 * stale_acceleration * age * age
                m.tube_1 += 2.0 * stale_acceleration * age
        _cover_spread(bodies, uncertainty, i, now, (np.inf, np.inf), stale_acceleration)
        put_box(grid, i, swept_box(bodies, i, now, settings.margin))


@device
def continue_motion(
    bodies: Any, uncertainty: Uncertainty, grid: HashedGrid, which: Any, seconds: Any, settings: Any, width: Any
) -> None:
    """Predict each body in `which` (M,), which kept its reference motion, further; put its swept box into the grid.

    The body is known to be within tube_0 of its reference at `now`, so its tube widens from `now` on. Its next motion
    may need narrower tolerances: its width (N,) is halved.
    """
    now, horizons = seconds
    for k in range(which.size):
        i = which[k]
        width[i] = max(0.5 * width[i], NARROWEST)  # also that of a body that was given up
        m = bodies.motion[i]
        allowed = (m.spread_0 + m.spread_1 * (now - m.tube_time), m.spread_1)
        m.tube_time = now
        m.covered = m.cover
        set_cover(bodies, i, now, horizons[i])
        # no wider than before, because the candidates until `covered` were found with that width
        _cover_spread(bodies, uncertainty, i, now, allowed, settings.stale_acceleration)
        put_box(grid, i, swept_box(bodies, i, now, settings.margin))
