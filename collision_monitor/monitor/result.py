"""The result of a step: its answers and its status."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import Refusal
from collision_monitor.records import Phase, data_frame

if TYPE_CHECKING:
    from collision_monitor.monitor.state.roster import Roster


@dataclass
class Work:
    """Counters of a step's work, filled by its stages; the fields are those of StepStatus."""

    objects_moved: int = 0
    candidate_pairs: int = 0
    narrow_phase_tests: int = 0
    impact_queries: int = 0
    events_due: int = 0
    deferred: int = 0


@dataclass(frozen=True)
class StepStatus:
    """Counts of objects, answers and work in a step; the fields are those of MonitorStatus.msg.

    >>> import collision_monitor as cm
    >>> cm.Monitor().step(0, []).status.objects
    0
    """

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


SHOWN: Final = 5
"""Rows of each kind that the text of a result shows."""


@dataclass(frozen=True, slots=True)
class Refused:
    """Inputs that a step refused for one reason."""

    reason: Refusal
    count: int
    text: str  # of the last of these: what was expected, and what was there


@dataclass(frozen=True, eq=False)
class StepResult:
    """The answers of one step: `contacts` (records.CONTACT) by ids, `predictions` (records.PREDICTION) soonest first.

    If the profile's `contact_points` is larger than 1, a contact has `point_count` rows, numbered by `point_index`.

    contact_rows: `contacts` and `ended` together, as the message has them. refused: what the step refused, by reason.
    accepted: False if the step was refused because of its stamp; there are no answers then, and stamp_ns, step and
    status are those of the last accepted step. cut: number of pairs that were examined before the budget ran out;
    None: all pairs were examined. overtaken: number of predictions that are UNRESOLVED because of the states' age.
    samples: number of samples of uncertain states that were followed for the times and probabilities of all pairs.
    left: ids of the objects that left their plans in this step, see `Monitor.follow`. roster: knows their names.

    >>> import collision_monitor as cm
    >>> monitor = cm.Monitor()
    >>> monitor.add("ball", cm.Sphere(0.5))
    1
    >>> monitor.step(0, [1], [(0, 0, 0, 0, 0, 0, 1)]).contacts.shape
    (0,)
    """

    stamp_ns: int
    step: int
    contact_rows: NDArray[np.void]
    predictions: NDArray[np.void]
    status: StepStatus
    accepted: bool = True
    cut: int | None = None
    refused: tuple[Refused, ...] = ()
    overtaken: int = 0
    samples: int = 0
    left: tuple[int, ...] = ()
    roster: Roster | None = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles hold the answers alone."""
        return self.__dict__ | {"roster": None}

    def name(self, object_id: int) -> str:
        """Name of an object, as the monitor knows it by now; its id in words if it is gone."""
        return self.roster.name(object_id) if self.roster and object_id in self.roster else f"object {object_id}"

    @cached_property
    def contacts(self) -> NDArray[np.void]:
        """The contacts (records.CONTACT) that begin or last, by ids."""
        return self.contact_rows.compress(self.contact_rows["phase"] != Phase.END)

    @cached_property
    def ended(self) -> NDArray[np.void]:
        """The contacts (records.CONTACT) that have ended since the last step; only ids and duration are known."""
        return self.contact_rows.compress(self.contact_rows["phase"] == Phase.END)

    def __repr__(self) -> str:
        """Return the answers as lines for a person, with the names of the objects; refusals first."""

        def pair(row: np.void) -> str:
            return f"{self.name(int(row['id_a']))} and {self.name(int(row['id_b']))}"

        lines = [f"refused: {each.text}" + f" ({each.count} of these)" * (each.count > 1) for each in self.refused]
        lines += [f"left its plan: {self.name(object_id)}" for object_id in self.left[:SHOWN]]
        lines += [
            f"contact: {pair(c)}, {c['signed_distance']:.4g} m ± {c['error_bound']:.1g}" for c in self.contacts[:SHOWN]
        ]
        lines += [f"ended: {pair(c)}" for c in self.ended[:SHOWN]]
        lines += [f"prediction: {pair(p)} in {p['lower']:.4g} to {p['upper']:.4g} s" for p in self.predictions[:SHOWN]]
        what = "" if self.accepted else ", refused"
        counts = f"{len(self.contacts)} contacts, {len(self.ended)} ended, {len(self.predictions)} predictions"
        return "\n  ".join([f"StepResult(step {self.step} at {self.stamp_ns} ns{what}: {counts})", *lines])

    def to_pandas(self, which: str = "contacts") -> Any:
        """Return "contacts", "ended" or "predictions" as a pandas.DataFrame; a vector has three columns.

        Raises ImportError without pandas.
        """
        return data_frame(getattr(self, which))
