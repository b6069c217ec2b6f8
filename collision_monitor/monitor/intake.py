"""Stage 1, intake: convert the arguments of a step to states, advance the time, and store or refuse each state."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor import records
from collision_monitor._jit import device, inlined, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.checks.numbers import as_numbers, hides_some
from collision_monitor.errors import InputError, Refusal
from collision_monitor.geometry.vector import Vector, cross, dot, magnitude
from collision_monitor.monitor.refusals import Refusals, some_ids
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.monitor.state.timeline import NANOSECOND, Order, Progress, Timeline
from collision_monitor.monitor.state_rows import states_of
from collision_monitor.monitor.uncertain_predictions import UncertainPredictions
from collision_monitor.motion.course import ARC, STRAIGHT, course_of, place_on
from collision_monitor.motion.trigonometry import sin_cos
from collision_monitor.records import StateFlag
from collision_monitor.settings.by_name import classes_of
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.planar import flat_states
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION
from collision_monitor.uncertainty.spread import worst_stddevs

ACCEPTED: Final = 0
UNKNOWN_ID: Final = 1
NON_FINITE: Final = 2
QUATERNION: Final = 3
OLD: Final = 4
LEFT_OUT: Final = 5

MOST_NANOSECONDS: Final = 2**63
"""A stamp is below it, and from its negative on; the stamps of messages and sessions are of 64 bits."""

STATE_NUMBERS: Final = 20
"""float64 numbers at the front of a records.STATE; id and flags follow."""

EARLY: Final = 0.999
"""Part of the period of a class after which its next state is used, since the stamps of a publisher vary a little."""

_POSITION_STDDEV: Final = 16
_ORIENTATION_STDDEV: Final = 17
"""Indices among the numbers of a records.STATE. Those of velocity and angular velocity are larger by two."""

_TWIST_UNKNOWN: Final = int(StateFlag.TWIST_UNKNOWN)
_DISCONTINUITY: Final = int(StateFlag.DISCONTINUITY)
_ACCELERATION_VALID: Final = int(StateFlag.ACCELERATION_VALID)
_BODY_TWIST: Final = int(StateFlag.BODY_TWIST)
_STOPS: Final = int(StateFlag.STOPS)

_VERDICTS: Final = {
    UNKNOWN_ID: (Refusal.UNKNOWN_ID, "expected the id of an object that was described, got {id}"),
    NON_FINITE: (
        Refusal.NON_FINITE,
        "object {id}: expected finite numbers up to 1e18 in pose and twist, standard deviations >= 0 and covariances "
        "that are positive semi-definite (a negative one here is minus the root of a negative eigenvalue), "
        "got {unusable}",
    ),
    QUATERNION: (Refusal.QUATERNION, "object {id}: expected a unit quaternion within 1e-3, got {quaternion}"),
    OLD: (
        Refusal.OLD,
        "object {id}: expected one state a message, newer than its last one, and none of a static object; {age}",
    ),
}

States = NDArray[np.void]


class Observation(NamedTuple):
    """The arguments of `Monitor.step`, as they were given."""

    stamp_ns: int
    ids: Any
    poses: Any = None
    twists: Any = None
    covariance: Any = None
    now_ns: int | None = None


class Observed(NamedTuple):
    """What a step observes: the arguments of a step, checked."""

    stamp_ns: int
    now_ns: int | None
    states: States  # (N,) records.STATE
    covariances: NDArray[np.float64]  # (N, 12), or (0, 12): none


class Intake(Stage):
    """Stores states in the roster. Keeps no state but the memory in which it aligns those of messages."""

    CACHES = ("_buffer",)

    def __init__(self) -> None:
        self._buffer = np.empty(64, records.STATE)

    def checked(self, given: Observation) -> Observed:
        """Check the arguments of a step, and convert them. The caller's arrays are not changed. Raises InputError."""
        stamp_ns = checked_nanoseconds(given.stamp_ns, "stamp_ns")
        now_ns = None if given.now_ns is None else checked_nanoseconds(given.now_ns, "now_ns")
        return Observed(stamp_ns, now_ns, *self._states(*given[1:5]))

    def _states(self, ids: ArrayLike, poses: Any, twists: Any, covariance: Any) -> tuple[States, NDArray[np.float64]]:
        """Return the states (N,) records.STATE and the covariances (N, 12), or (0, 12). Raises InputError.

        With covariances, the states get the standard deviations along their worst axes.
        """
        try:
            given = np.asarray(ids)
            if hides_some(ids):
                raise ValueError
        except ValueError:
            raise InputError(f"ids: expected one dimension of integers, got {ids!r}") from None
        if given.size == 0:
            states = np.zeros(0, records.STATE)
        elif given.dtype == records.STATE:
            states = self._own(given, is_written=covariance is not None)
        else:
            states = states_of(given, poses, twists)
        if covariance is None:
            return states, np.empty((0, 12))
        covariances = as_numbers(covariance, "covariance", "an array of numbers")
        if covariances.shape != (len(states), 12):
            raise InputError(f"covariance: expected shape ({len(states)}, 12), got {covariances.shape}")
        known, stddevs = worst_stddevs(covariances)
        states["position_stddev"], states["velocity_stddev"] = stddevs.T
        return states, known

    def _own(self, given: States, *, is_written: bool) -> States:
        """Return the states themselves if the kernels can read them and nothing writes to them, else a copy."""
        if given.ndim != 1:
            raise InputError(f"states: expected one dimension, got shape {given.shape}")
        unknown = given["flags"] & _TWIST_UNKNOWN  # the kernel writes their standard deviations
        if given.flags.carray and not is_written and not np.count_nonzero(unknown):
            return given
        if len(given) > len(self._buffer):
            self._buffer = np.empty(len(given), records.STATE)
        states = self._buffer[: len(given)]
        states.view(np.uint8)[:] = np.ascontiguousarray(given).view(np.uint8)  # message bytes need not be aligned
        return states

    def advance(
        self, seen: Observed, timeline: Timeline, roster: Roster, profile: Profile, refusals: Refusals
    ) -> Progress:
        """Move the timeline to the stamp of the states, or refuse the stamp. A restart is noted as a refusal too."""
        stamp_ns, states, p = seen.stamp_ns, seen.states, profile
        seconds = (stamp_ns - timeline.now_ns) * NANOSECOND
        order = Order.IN_ORDER
        if timeline.is_behind(stamp_ns):
            order = _order(states, timeline.seconds(stamp_ns), -seconds > p.stale_after, roster)
        progress = timeline.advance(stamp_ns, order, p.max_time_step, p.stale_after)
        if progress is Progress.RESTARTS:
            refusals.add(
                Refusal.TIME,
                f"time jumped by {seconds:+.3f} s, as a second message confirmed: the timeline restarts there, and "
                "every moving object is unseen until its next state",
                count=0,
            )
        elif progress is Progress.REFUSED:
            about = f" of object {some_ids(states['id'])}" if len(states) else ""
            refusals.add(
                Refusal.TIME,
                f"stamp{about}: expected within {p.max_time_step:g} s of the last one, got "
                f"{seconds:+.3f} s; the next message restarts the clock there if it agrees",
            )
        return progress

    def take(
        self,
        seen: Observed,
        time: float,
        roster: Roster,
        uncertain: UncertainPredictions,
        rate_by_name: str,
        refusals: Refusals,
    ) -> None:
        """Store usable states as their bodies' last ones at `time` (s), with their uncertainties. Refuse the others.

        rate_by_name: the setting. States of a class that come sooner are left out, without a refusal.
        """
        states = seen.states
        if len(states) == 0:
            return
        slots = roster.slots_of(states["id"])
        used = flat_states(states) if roster.planar else states
        numbers = used.view(np.float64).reshape(len(states), -1)
        verdicts = np.empty(len(states), np.uint8)
        flags = np.ascontiguousarray(states["flags"])
        rates = roster.values_by_name(classes_of("rate_by_name", rate_by_name), np.inf)
        accepted, is_uncertain = take_states(roster.bodies, slots, numbers, flags, time, rates, verdicts)
        if is_uncertain or uncertain.active:
            taken = np.where(verdicts == ACCEPTED, slots, np.int32(-1))
            uncertain.take(taken, numbers, flags, seen.covariances, roster.planar)
        if accepted == len(states):
            return
        for verdict, (reason, text) in _VERDICTS.items():
            rows = np.flatnonzero(verdicts == verdict)
            if len(rows):
                row = states[rows[0]]
                values = {"id": int(row["id"]), "quaternion": row["quaternion"].tolist(), "unusable": _unusable(row)}
                values["age"] = _age_text(roster, int(slots[rows[0]]), time) if verdict == OLD else ""
                refusals.add(reason, text.format(**values), len(rows))

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage: there is nothing to save."""

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage: there is nothing to restore."""


def checked_nanoseconds(value: Any, name: str) -> int:
    """Return a time as int. Raises InputError."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        got = f"got {value!r:.100}; of seconds t write round(1e9 * t){', or stamp=t' if name == 'stamp_ns' else ''}"
        raise InputError(f"{name}: expected an integer number of nanoseconds, {got}")
    if not -MOST_NANOSECONDS <= value < MOST_NANOSECONDS:
        raise InputError(f"{name}: expected nanoseconds that 64 bits can hold, got {value}")
    return int(value)


def _order(states: States, time: float, late: bool, roster: Roster) -> Order:
    """Return how a message of these states stands to what the roster has. late: its `time` (s) is stale already."""
    bodies, slots = roster.bodies, roster.slots_of(states["id"])
    slots = slots[slots >= 0]
    moving = slots[~bodies.static[slots]]
    if (bodies.seen[moving] & (bodies.time[moving] > time)).any():
        return Order.OLD
    return Order.LATE if late and len(moving) else Order.IN_ORDER


def _unusable(row: np.void) -> str:
    """Return the fields of a NON_FINITE state that are not as expected."""
    named = {name: row[name].tolist() for name in row.dtype.names or () if name not in ("id", "flags")}
    bad = {
        name: value
        for name, value in named.items()
        if not (np.abs(value) <= LARGEST_INPUT).all() or (name.endswith("_stddev") and value < 0.0)
    }
    return ", ".join(f"{name} {value}" for name, value in (bad or named).items())


def _age_text(roster: Roster, slot: int, time: float) -> str:
    """Return what is wrong with an OLD state at `time` (s) of the body in this slot."""
    if roster.bodies.static[slot]:
        return "it is static"
    age = float(roster.bodies.time[slot]) - time
    return f"got one that is {age:.3f} s older" if age > 0.0 else "got another one with the same stamp"


@settled
@kernel
def take_states(
    bodies: Any, slots: Any, numbers: Any, flags: Any, time: float, rates: Any, verdicts: Any
) -> tuple[int, bool]:
    """Store states as the bodies' last ones.

    slots (M,) int32, -1: unknown id. numbers (M, 21) float64: the rows of records.STATE; where the twist is estimated,
    its standard deviations are written into them. flags (M,) uint32. time: of all states (s). rates (N,): largest rate
    (Hz) at which states of a body are used; after a discontinuity, the next one always is.
    verdicts (M,) uint8, written: ACCEPTED, LEFT_OUT or the reason of the refusal.
    Returns (number of accepted states, whether any of them is uncertain).
    """
    accepted = 0
    uncertain = False
    for k in range(slots.size):
        i = slots[k]
        verdicts[k] = _verdict(bodies, i, numbers, k, flags[k], time, rates)
        if verdicts[k] != ACCEPTED:
            continue
        _store(bodies, i, numbers, k, flags[k], time)
        accepted += 1
        for c in range(16, STATE_NUMBERS):
            uncertain |= numbers[k, c] > 0.0
    return accepted, uncertain


@inlined
def _norm(numbers: Any, k: int) -> float:
    """Length of the quaternion in row k."""
    x, y, z, w = numbers[k, 3], numbers[k, 4], numbers[k, 5], numbers[k, 6]
    return sqrt(x * x + y * y + z * z + w * w)


@inlined
def _verdict(bodies: Any, i: int, numbers: Any, k: int, flags: int, time: float, rates: Any) -> int:
    """What becomes of the state in row k, of body i: ACCEPTED, LEFT_OUT or the reason of the refusal."""
    if i < 0:
        return UNKNOWN_ID
    usable = True
    for c in range(13 if (flags & _TWIST_UNKNOWN) == 0 else 7):
        usable &= abs(numbers[k, c]) <= LARGEST_INPUT
    for c in range(13, 16 if (flags & _ACCELERATION_VALID) != 0 else 13):
        usable &= abs(numbers[k, c]) <= LARGEST_INPUT
    for c in range(16, STATE_NUMBERS):  # standard deviations; NaN: unknown
        usable &= not (numbers[k, c] < 0.0 or numbers[k, c] > LARGEST_INPUT)
    if not usable:
        return NON_FINITE
    if not abs(_norm(numbers, k) - 1.0) <= UNIT_QUATERNION:
        return QUATERNION
    if bodies.static[i] or (bodies.seen[i] and time <= bodies.time[i]):
        return OLD
    is_soon = bodies.seen[i] and (time - bodies.time[i]) * rates[i] < EARLY and rates[i] < inf
    return LEFT_OUT if is_soon and (flags & _DISCONTINUITY) == 0 else ACCEPTED


@inlined
def _store(bodies: Any, i: int, numbers: Any, k: int, flags: int, time: float) -> None:
    """Make the state in row k the last one of body i."""
    accelerates = (flags & _ACCELERATION_VALID) != 0
    norm = _norm(numbers, k)
    x, y, z, w = numbers[k, 3] / norm, numbers[k, 4] / norm, numbers[k, 5] / norm, numbers[k, 6] / norm
    if (flags & _TWIST_UNKNOWN) == 0:
        for c in range(3):
            bodies.linear[i, c] = numbers[k, 7 + c]
            bodies.angular[i, c] = numbers[k, 10 + c]
    elif bodies.seen[i] and (flags & _DISCONTINUITY) == 0:
        _estimate_twist(bodies, i, numbers[k, :3], (x, y, z, w), time - bodies.time[i])
        if (flags & _BODY_TWIST) != 0:
            _bend_twist(bodies, i, time - bodies.time[i])
        for c in range(3 if accelerates and (flags & _BODY_TWIST) == 0 else 0):
            # the estimate is the mean velocity since the last state, which the body had half-way
            bodies.linear[i, c] += 0.5 * numbers[k, 13 + c] * (time - bodies.time[i])
        for c in (_POSITION_STDDEV, _ORIENTATION_STDDEV):
            if numbers[k, c] > 0.0 and not numbers[k, c + 2] > 0.0:
                # of the difference of two poses; assumes that the last one was as uncertain as this one
                numbers[k, c + 2] = sqrt(2.0) * numbers[k, c] / (time - bodies.time[i])
    else:
        bodies.linear[i] = 0.0
        bodies.angular[i] = 0.0
    for c in range(3):
        bodies.acceleration[i, c] = numbers[k, 13 + c] if accelerates else 0.0
        bodies.position[i, c] = numbers[k, c]
    bodies.quaternion[i, 0], bodies.quaternion[i, 1] = x, y
    bodies.quaternion[i, 2], bodies.quaternion[i, 3] = z, w
    bodies.course[i] = STRAIGHT
    if (flags & (_BODY_TWIST | _STOPS)) != 0:
        is_estimated = (flags & _TWIST_UNKNOWN) != 0 and bodies.seen[i] and (flags & _DISCONTINUITY) == 0
        _set_course(bodies, i, flags, time - bodies.time[i] if is_estimated else 0.0)
    bodies.time[i] = time
    bodies.seen[i] = True


@inlined
def _turned(q: Any, i: int, v: Any) -> Vector:
    """Vector v[i] along the axes of a body with orientation q[i], in world axes."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    a = v[i, 0], v[i, 1], v[i, 2]
    half = cross((x, y, z), a)
    double = cross((x, y, z), (half[0] + w * a[0], half[1] + w * a[1], half[2] + w * a[2]))
    return a[0] + 2.0 * double[0], a[1] + 2.0 * double[1], a[2] + 2.0 * double[2]


@device
def _set_course(bodies: Any, i: int, flags: int, elapsed: float) -> None:
    """Set the course of body i, whose state has a twist along its own axes (BODY_TWIST) or ends at rest (STOPS).

    elapsed: s over which its velocity is estimated as a mean, which the body had half-way; else 0.
    """
    turns, q = (flags & _BODY_TWIST) != 0, bodies.quaternion
    v, w = bodies.linear, bodies.angular
    if turns and (flags & _TWIST_UNKNOWN) == 0:
        v[i, 0], v[i, 1], v[i, 2] = _turned(q, i, v)
        w[i, 0], w[i, 1], w[i, 2] = _turned(q, i, w)
    a = bodies.acceleration
    if turns:
        a[i, 0], a[i, 1], a[i, 2] = _turned(q, i, a)
        for c in range(3):
            v[i, c] += 0.5 * a[i, c] * elapsed
    course = course_of(
        (v[i, 0], v[i, 1], v[i, 2]), (w[i, 0], w[i, 1], w[i, 2]), (a[i, 0], a[i, 1], a[i, 2]), turns,
        (flags & _STOPS) != 0,
    )  # fmt: skip
    bodies.course[i], bodies.rest[i] = course.kind, course.rest
    a[i, 0], a[i, 1], a[i, 2] = course.acceleration


@device
def _estimate_twist(bodies: Any, i: int, position: Any, quaternion: Any, elapsed: float) -> None:
    """Estimate the twist from the last pose: difference of positions, logarithm of the relative rotation."""
    x, y, z, w = quaternion
    for c in range(3):
        bodies.linear[i, c] = (position[c] - bodies.position[i, c]) / elapsed
    px, py, pz = -bodies.quaternion[i, 0], -bodies.quaternion[i, 1], -bodies.quaternion[i, 2]
    pw = bodies.quaternion[i, 3]
    rx = w * px + x * pw + y * pz - z * py
    ry = w * py - x * pz + y * pw + z * px
    rz = w * pz + x * py - y * px + z * pw
    rw = w * pw - x * px - y * py - z * pz
    s = sqrt(rx * rx + ry * ry + rz * rz)
    rate = 0.0
    if s > 0.0:
        sign = 1.0 if rw >= 0.0 else -1.0
        rate = 2.0 * sign * np.arctan2(s, abs(rw)) / (s * elapsed)
    bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2] = rate * rx, rate * ry, rate * rz


@device
def _bend_twist(bodies: Any, i: int, elapsed: float) -> None:
    """Change the estimate of body i's velocity from the mean one, along the chord of its arc, to the last one.

    The mean velocity has the direction of half-way; across the axis of the rotation, the arc is longer than the chord.
    """
    v = bodies.linear[i, 0], bodies.linear[i, 1], bodies.linear[i, 2]
    w = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    half = 0.5 * elapsed * magnitude(w)
    if not (half > 0.0 and dot(w, w) > 0.0):
        return
    along, longer = dot(w, v) / dot(w, w), half / sin_cos(half)[0]
    v = (
        along * w[0] + longer * (v[0] - along * w[0]),
        along * w[1] + longer * (v[1] - along * w[1]),
        along * w[2] + longer * (v[2] - along * w[2]),
    )
    last = place_on(ARC, v, w, (0.0, 0.0, 0.0), 0.5 * elapsed, inf).velocity
    bodies.linear[i, 0], bodies.linear[i, 1], bodies.linear[i, 2] = last
