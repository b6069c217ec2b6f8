"""Differences between two histories: collisions, how early they were predicted, false warnings, and the cost."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

import numpy as np

from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.records import Phase
from collision_monitor.session.history.alarms import Alarms, alarms_of
from collision_monitor.session.history.alerts import AlertOutcome, alerts_of
from collision_monitor.session.history.history import History, Pair

WITHIN: Final = 0.5
"""s: two collisions of a pair whose begins are further apart are two events, not one shifted event."""

EXACT: Final = 1e-9
"""s: tolerance of times, which are differences of whole nanoseconds."""

PairNames = tuple[str, str]


@dataclass(frozen=True)
class Event:
    """A collision, or a warning that no collision followed. Times in s from A's first step.

    end: None if it lasts to the end or to a gap. warned: s before the begin; None if the session begins with the
    collision, and for warnings. certain: false if the collision only could not be excluded.
    """

    what: str
    pair: PairNames
    begin: float
    end: float | None
    warned: float | None
    certain: bool


@dataclass(frozen=True)
class EventChange:
    """An event of A, of B, or of both. fields: the fields of Event in which they differ."""

    a: Event | None
    b: Event | None
    fields: tuple[str, ...] = ()

    @property
    def event(self) -> Event:
        """The event of A, or that of B if A has none."""
        event = self.a or self.b
        assert event is not None
        return event


@dataclass(frozen=True)
class SessionSummary:
    """Figures of one session. contacts, predictions: pairs, counted at each step. Step times in s, NaN if unknown.

    alarms: judged by what followed, see `alarms`.
    """

    session: str
    profile: str
    version: str
    replayed: bool
    steps: int
    duration: float
    objects: int
    collisions: int
    alarms: Alarms
    contacts: int
    predictions: int
    step_median: float
    step_p99: float
    problems: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Changes:
    """The two sides and their changes, collisions first. by_stamps: false if B's times count from B's first step."""

    a: SessionSummary
    b: SessionSummary
    changes: list[EventChange]
    by_stamps: bool

    @property
    def known(self) -> bool:
        """Whether both histories are complete, so that no change in the list means that there is none."""
        return not (self.a.problems or self.b.problems)


def changes(a: History, b: History, tolerance: float = 0.0) -> Changes:
    """Return the changes from a to b. Times that differ by at most the tolerance (s) count as equal."""
    shift = (b.begin_ns - a.begin_ns) * NANOSECOND
    by_stamps = -b.duration <= shift <= a.duration  # sessions of different times are compared from their starts
    names = _naming(a, b)
    found: list[EventChange] = []
    events_a, warnings_a = _events(a, 0.0, names)
    events_b, warnings_b = _events(b, shift if by_stamps else 0.0, names)
    for ours, theirs in ((events_a, events_b), (warnings_a, warnings_b)):
        for pair in sorted({each.pair for each in (*ours, *theirs)}):
            mine, other = ([each for each in events if each.pair == pair] for events in (ours, theirs))
            for one, two in _matched(mine, other, lambda event: event.begin):
                fields = _differing(one, two, tolerance + EXACT) if one and two else ()
                if fields or one is None or two is None:
                    found.append(EventChange(one, two, fields))
    found.sort(key=lambda change: (change.event.what, change.event.begin, change.event.pair))
    return Changes(_summary(a), _summary(b), found, by_stamps)


def _naming(a: History, b: History) -> Callable[[History, Pair], PairNames]:
    """Return a function that names the objects of a pair: by name if names are unique in both, else with their ids."""
    unique = all(len({o.name for o in h.objects.values()}) == len(h.objects) for h in (a, b))

    def names(history: History, pair: Pair) -> PairNames:
        first, second = (
            history.name_of(i) if unique and i in history.objects else f"{history.name_of(i)} ({i})" for i in pair
        )
        return (first, second) if first <= second else (second, first)

    return names


def _events(
    history: History, shift: float, names: Callable[[History, Pair], PairNames]
) -> tuple[list[Event], list[Event]]:
    """Return the collisions, and the warnings that no collision followed, sorted by begin."""
    collisions = [
        Event(
            what="collision",
            pair=names(history, each.pair),
            begin=each.begin + shift,
            end=None if each.end is None else each.end + shift,
            warned=None if math.isnan(each.warned) else each.warned,
            certain=each.certain,
        )
        for each in history.collisions
    ]
    warnings = [
        Event(
            what="warning",
            pair=names(history, each.pair),
            begin=each.begin + shift,
            end=None if each.outcome is AlertOutcome.OPEN else float(each.time[-1]) + shift,
            warned=None,
            certain=True,
        )
        for each in alerts_of(history)
        if each.certain and each.outcome is not AlertOutcome.CONTACT
    ]
    return collisions, warnings


_T = TypeVar("_T")


def _matched(a: Sequence[_T], b: Sequence[_T], begin: Callable[[_T], float]) -> Iterable[tuple[_T | None, _T | None]]:
    """Yield the events of one pair in A and B, side by side if they begin within WITHIN of each other."""
    i = j = 0
    while i < len(a) or j < len(b):
        if i == len(a) or (j < len(b) and begin(b[j]) < begin(a[i]) - WITHIN):
            yield None, b[j]
            j += 1
        elif j == len(b) or begin(a[i]) < begin(b[j]) - WITHIN:
            yield a[i], None
            i += 1
        else:
            yield a[i], b[j]
            i, j = i + 1, j + 1


def _differing(a: Event, b: Event, tolerance: float) -> tuple[str, ...]:
    def same(x: Any, y: Any) -> bool:
        return x == y or (isinstance(x, float) and isinstance(y, float) and abs(x - y) <= tolerance)

    return tuple(name for name in ("begin", "end", "warned", "certain") if not same(getattr(a, name), getattr(b, name)))


def _summary(history: History) -> SessionSummary:
    problems = list(history.problems)
    if history.status is not None and history.status.recording_dropped:
        problems.append(f"{history.status.recording_dropped} messages could not be recorded")
    # The first step of a replay compiles the kernels or loads them.
    durations = history.durations[1:] if history.replayed else history.durations
    return SessionSummary(
        session=history.name,
        profile=history.profile.name,
        version=history.metadata.get("version", ""),
        replayed=history.replayed,
        steps=len(history.times),
        duration=history.duration,
        objects=len(history.objects),
        collisions=len(history.collisions),
        alarms=alarms_of(history),
        contacts=int(np.count_nonzero(history.contacts["phase"] != Phase.END)),
        predictions=len(history.predictions),
        step_median=float(np.median(durations)) if len(durations) else math.nan,
        step_p99=float(np.quantile(durations, 0.99)) if len(durations) else math.nan,
        problems=problems,
    )
