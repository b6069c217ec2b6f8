"""What happened in a session, gathered: who touched whom and when, what was predicted before, how long it took.

The one view of a session that checks, reports and comparisons are made from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.codec import MonitorStatus
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.settings.profile import Profile

Floats = NDArray[np.float64]
Records = NDArray[np.void]
Pair = tuple[int, int]

NANOSECOND: Final = 1e-9

STEPS_MISSING: Final = 5.0
"""Steps of the usual length without one that are a gap, where that is longer than the profile's stale_after."""

ANY: Final = "any"
"""In place of names: every pair."""


@dataclass(frozen=True)
class CollisionEvent:
    """Two objects in contact without a break. Times in s from the session's first step; step: index of the begin.

    end: None where it went on to the end of the session or to a gap; last: the last step in contact. deepest: least
    signed distance (m). certain: they were known to touch at some time, not only not known to be apart. warned: how
    long before the begin (s) the predictions of it began that were not interrupted any more; 0 where there was none,
    NaN where the session begins with the contact.
    """

    pair: Pair
    begin: float
    end: float | None
    last: float
    step: int
    deepest: float
    certain: bool
    warned: float


@dataclass
class History:
    """A session, from its first step to its last.

    times (n,): s of each step from the first, never falling: where the clock was set back (restarts: how often) they
    go on from where they were. contacts, predictions: of all steps, records.CONTACT (of several points the first) and
    records.PREDICTION, and the step (index) of each row. states: of all messages, records.STATE, and the time (s).
    objects: as they were described last; names: all that they had, and the ids of each. profile: of the start;
    settings: what changed of it, and the time (s) of the first step that went by it. durations: s that steps took, as
    far as they were reported or measured. status: the last one, or the replay's. problems: why some of it may be
    unknown.
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
    status: MonitorStatus | None = None
    problems: list[str] = field(default_factory=list)
    collisions: list[CollisionEvent] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """s from the first step to the last."""
        return float(self.times[-1]) if len(self.times) else 0.0

    @property
    def period(self) -> float:
        """s from one step to the next, the median; 0 where there are less than two."""
        apart = np.diff(self.times)
        return float(np.median(apart[apart > 0.0])) if (apart > 0.0).any() else 0.0

    @property
    def longest_step(self) -> float:
        """s: what is longer from one step to the next is a gap of which nothing is known."""
        return max(self.profile.stale_after, STEPS_MISSING * self.period)

    def name_of(self, object_id: int) -> str:
        """The name of an object, or what stands for one that was never described."""
        return self.objects[object_id].name if object_id in self.objects else f"object_{object_id}"

    def ids_of(self, name: str | int) -> set[int]:
        """The objects that have, or had, that name, with wildcards: `person_*`; or that id. Raises InputError."""
        if isinstance(name, int):
            found = {name} & set(self.objects)
        else:
            found = set().union(*(ids for each, ids in self.names.items() if fnmatchcase(each, name)))
        if not found:
            known = ", ".join(sorted(self.names)) or "none"
            raise InputError(f"expected the name or id of an object of the session, one of {known}; got {name!r}")
        return found

    def pairs_of(self, names: str | Iterable[str | int]) -> Callable[[Pair], bool]:
        """Whether a pair is one of those named: ANY, or two names, with wildcards. Raises InputError."""
        if names == ANY:
            return lambda pair: True
        a, b = (self.ids_of(name) for name in names)
        return lambda pair: (pair[0] in a and pair[1] in b) or (pair[0] in b and pair[1] in a)

    def collisions_of(self, names: str | Iterable[str | int] = ANY) -> list[CollisionEvent]:
        """The collisions of the named pairs, by their begin. Raises InputError."""
        wanted = self.pairs_of(names)
        return [each for each in self.collisions if wanted(each.pair)]
