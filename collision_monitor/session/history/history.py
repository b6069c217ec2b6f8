"""The history of a session: its collisions, the predictions before them, and the step times.

Checks, reports and comparisons all work on it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import CollisionAlert, MonitorStatus
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.settings.profile import Profile

Floats = NDArray[np.float64]
Records = NDArray[np.void]
Pair = tuple[int, int]


STEPS_MISSING: Final = 5.0
"""Number of median periods without a step that make a gap, if that is longer than the profile's stale_after."""

START: Final = 1.0
"""s in which the first messages of all topics may come after the start of a session."""

ANY: Final = "any"
"""Selects every pair, in place of names."""


@dataclass(frozen=True)
class CollisionEvent:
    """Two objects in unbroken contact. Times in s from the session's first step; step: index of the begin.

    end: None if it lasts to the end of the session or to a gap; last: the last step in contact. deepest: least signed
    distance (m). certain: the objects certainly touched at some time; false if they only could not be shown to be
    apart. warned: how long before the begin (s) the unbroken predictions of it began; 0 if there were none, NaN if the
    session begins with the contact.
    """

    pair: Pair
    begin: float
    end: float | None
    last: float
    step: int
    deepest: float
    certain: bool
    warned: float


@dataclass(frozen=True)
class UnmonitoredSpan:
    """What the sources file asked for and was not monitored, from `begin` to `end` (s from the first step).

    begin: negative if it began before the first step. end: None if it lasts to the end. text: for people.
    """

    text: str
    begin: float
    end: float | None

    @property
    def is_lasting(self) -> bool:
        """Whether it was longer than what every start takes."""
        return self.end is None or self.end - self.begin > START


@dataclass
class PlanUse:
    """The plans of one object. count: of them. left (s): when it left one, from the first step; times_left: how often.

    ways: points (n, 3) of the last ones, in m. left_steps: indices of the steps of `left`.
    """

    object_id: int
    count: int = 0
    times_left: int = 0
    ways: list[Floats] = field(default_factory=list)
    left_steps: list[int] = field(default_factory=list)
    left: list[float] = field(default_factory=list)


@dataclass
class History:
    """A session, from its first step to its last.

    times (n,): s of each step from the first, never falling: they continue from the last value when the clock is set
    back (restarts: how often). contacts, predictions: of all steps, records.CONTACT (only the first of several points)
    and records.PREDICTION, with the step (index) of each row. states: of all messages, records.STATE, with the time
    (s). objects: by id, as described last; names: all names that occurred, with their ids. profile: at the start;
    settings: the changed ones, with the time (s) of the first step that used them. alerts: the changes of alerts, with
    their times (s); rules: those at the start, or those that replace them. unmonitored: what was asked for and not
    there, by begin. plans: of the objects that had some, by id. durations: step times (s), as far as they were reported
    or measured. status: the last one, or the replay's. problems: why some of it may be unknown.
    """

    name: str
    profile: Profile
    metadata: dict[str, str]
    replayed: bool
    begin_ns: int = 0
    restarts: int = 0
    times: Floats = field(default_factory=lambda: np.zeros(0))
    contacts: Records = field(default_factory=lambda: np.zeros(0, records.CONTACT))
    contact_step: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    predictions: Records = field(default_factory=lambda: np.zeros(0, records.PREDICTION))
    prediction_step: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    states: Records = field(default_factory=lambda: np.zeros(0, records.STATE))
    state_time: Floats = field(default_factory=lambda: np.zeros(0))
    durations: Floats = field(default_factory=lambda: np.zeros(0))
    objects: dict[int, ObjectDescription] = field(default_factory=dict)
    names: dict[str, set[int]] = field(default_factory=dict)
    settings: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    alerts: list[tuple[float, CollisionAlert]] = field(default_factory=list)
    rules: Rules = field(default_factory=Rules)
    unmonitored: list[UnmonitoredSpan] = field(default_factory=list)
    plans: list[PlanUse] = field(default_factory=list)
    status: MonitorStatus | None = None
    problems: list[str] = field(default_factory=list)
    collisions: list[CollisionEvent] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """Time from the first step to the last (s)."""
        return float(self.times[-1]) if len(self.times) else 0.0

    @property
    def period(self) -> float:
        """Median time from one step to the next (s); 0 if there are less than two steps."""
        apart = np.diff(self.times)
        return float(np.median(apart[apart > 0.0])) if (apart > 0.0).any() else 0.0

    @property
    def longest_step(self) -> float:
        """Longest time between two steps (s) that is not a gap. Nothing is known about a gap."""
        return max(self.profile.stale_after, STEPS_MISSING * self.period)

    def name_of(self, object_id: int) -> str:
        """Return the name of an object, or a substitute if it was never described."""
        return self.objects[object_id].name if object_id in self.objects else f"object_{object_id}"

    def ids_of(self, name: str | int) -> set[int]:
        """Return the objects that have or had that name (wildcards as in `person_*`) or that id. Raises InputError."""
        if isinstance(name, int):
            found = {name} & set(self.objects)
        else:
            found = set().union(*(ids for each, ids in self.names.items() if fnmatchcase(each, name)))
        if not found:
            known = ", ".join(sorted(self.names)) or "none"
            raise InputError(f"expected the name or id of an object of the session, one of {known}; got {name!r}")
        return found

    def pairs_of(self, names: str | Iterable[str | int]) -> Callable[[Pair], bool]:
        """Return a test for the named pairs: ANY, or two names with wildcards. Raises InputError."""
        if names == ANY:
            return lambda pair: True
        a, b = (self.ids_of(name) for name in names)
        return lambda pair: (pair[0] in a and pair[1] in b) or (pair[0] in b and pair[1] in a)

    def collisions_of(self, names: str | Iterable[str | int] = ANY) -> list[CollisionEvent]:
        """Return the collisions of the named pairs, sorted by begin. Raises InputError."""
        wanted = self.pairs_of(names)
        return [each for each in self.collisions if wanted(each.pair)]
