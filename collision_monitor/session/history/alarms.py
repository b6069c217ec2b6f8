"""The one definition of false, missed, late and early alarms, for measurements, comparisons and reports.

A pair is alarmed at a step if it is reported to touch, or predicted to collide. A prediction that is POSSIBLE only
through the uncertainty of the states is no alarm. The unit is one pair at one step, so an alarm that flickers is not
counted more often than one that lasts. An alarm is judged by the contacts that followed:

- true: the pair touches at the step, or within the horizon after it.
- false: it does not. open: it does not, but the record ends, or has a gap, before the predicted interval has passed,
  or before the horizon has passed if the prediction has no end.
- late, early: a true prediction whose interval lies wholly after, or before, the first contact.

A collision is missed if it begins while its pair is not alarmed in the step before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.impact_record import pair_keys
from collision_monitor.records import ContactStatus, Phase, PredictionStatus
from collision_monitor.session.history.history import History

Floats = NDArray[np.float64]
Steps = NDArray[np.int64]
Rows = NDArray[np.void]


@dataclass(frozen=True)
class Alarms:
    """Counts of pairs × steps; collisions and missed count collisions."""

    alarms: int = 0
    false_alarms: int = 0
    open_alarms: int = 0
    late: int = 0
    early: int = 0
    collisions: int = 0
    missed: int = 0

    def __add__(self, other: Alarms) -> Alarms:
        """Sum of the counts."""
        return Alarms(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


@dataclass(frozen=True, eq=False)
class CertainContacts:
    """The certain contacts of a record, which judge its alarms.

    times (S,): s of each step, never falling. horizon: s. known_until (S,): s, the end of the steps without a gap that
    a step belongs to. codes (n,): key of the pair and step of each contact, sorted; see `_codes`.
    """

    times: Floats
    horizon: float
    known_until: Floats
    keys: NDArray[np.uint64]
    codes: Steps

    @classmethod
    def of(cls, times: Floats, rows: Rows, steps: Steps, horizon: float, longest_step: float = np.inf) -> Self:
        """Gather the contacts rows (n,) records.CONTACT at the steps (n,). longest_step: s, a longer one is a gap."""
        certain = (rows["phase"] != Phase.END) & (rows["status"] == ContactStatus.TOUCHING)
        pairs = pair_keys(rows["id_a"][certain], rows["id_b"][certain])
        keys = np.unique(pairs)
        ends = np.flatnonzero(np.append(np.diff(times) > longest_step, True))
        known_until = times[ends[np.searchsorted(ends, np.arange(len(times)))]] if len(times) else times
        return cls(times, horizon, known_until, keys, np.unique(_codes(keys, pairs, steps[certain], len(times))))

    def judge(self, contacts: Rows, contact_steps: Steps, predictions: Rows, prediction_steps: Steps) -> Alarms:
        """Judge the alarms of the reported contacts and predictions (records) at their steps."""
        begun = contacts["phase"] != Phase.END
        stated = predictions["status"] != PredictionStatus.POSSIBLE
        contacts, contact_steps = contacts[begun], contact_steps[begun]
        predictions, prediction_steps = predictions[stated], prediction_steps[stated]
        step = np.concatenate([contact_steps, prediction_steps])
        rows = (contacts, predictions)
        pairs = np.concatenate([pair_keys(each["id_a"], each["id_b"]) for each in rows])
        wait = self._wait(pairs, step)
        period = np.diff(self.times, prepend=self.times[:1])  # a contact begins within the period before its step
        is_true = wait <= self.horizon + self._period
        due = np.full(len(step), self.horizon)
        due[len(contacts) :] = np.minimum(predictions["upper"], self.horizon)
        is_open = ~is_true & (self.known_until[step] < self.times[step] + due)
        touching = len(contacts)
        true, waited = is_true[touching:], wait[touching:]
        late = true & (predictions["lower"] > waited)
        reached = np.searchsorted(self.times, self.times[prediction_steps] + waited - 1e-9)
        before = waited - period[np.minimum(reached, len(period) - 1)] if len(period) else waited
        early = true & (predictions["upper"] < before)
        begins = self._begins()
        alarmed = _codes(self.keys, pairs, step, len(self.times))
        return Alarms(
            alarms=len(step),
            false_alarms=int(np.count_nonzero(~is_true & ~is_open)),
            open_alarms=int(np.count_nonzero(is_open)),
            late=int(np.count_nonzero(late)),
            early=int(np.count_nonzero(early)),
            collisions=len(begins),
            missed=int(np.count_nonzero(~np.isin(begins - 1, alarmed))),
        )

    @property
    def _period(self) -> float:
        """Median time from one step to the next (s)."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0

    def _wait(self, pairs: NDArray[np.uint64], steps: Steps) -> Floats:
        """Time (s) from each step until its pair touches next, (n,); infinite if it never does."""
        wait = np.full(len(pairs), np.inf)
        if not len(self.codes):
            return wait
        count = len(self.times)
        codes = _codes(self.keys, pairs, steps, count)
        at = np.minimum(np.searchsorted(self.codes, codes), len(self.codes) - 1)
        follows = (codes >= 0) & (self.codes[at] >= codes) & (self.codes[at] // count == codes // count)
        wait[follows] = self.times[self.codes[at] % count][follows] - self.times[steps][follows]
        return wait

    def _begins(self) -> Steps:
        """Codes of the first steps of contacts, without those at the first step of the record or after a gap."""
        first = self.codes[~np.isin(self.codes - 1, self.codes)]
        step = first % max(len(self.times), 1)
        first, step = first[step > 0], step[step > 0]
        begins: Steps = first[self.known_until[step - 1] == self.known_until[step]]
        return begins


def _codes(keys: NDArray[np.uint64], pairs: NDArray[np.uint64], steps: Steps, count: int) -> Steps:
    """Place of each pair among the sorted keys, times the number of steps, plus its step; -1 for other pairs."""
    if not len(keys):
        return np.full(len(pairs), -1, np.int64)
    at = np.minimum(np.searchsorted(keys, pairs), len(keys) - 1)
    return np.where(keys[at] == pairs, at * count + steps, -1)


def alarms_of(history: History) -> Alarms:
    """Judge the alarms of a session by its own certain contacts."""
    h = history
    contacts = CertainContacts.of(h.times, h.contacts, h.contact_step, h.profile.horizon, h.longest_step)
    return contacts.judge(h.contacts, h.contact_step, h.predictions, h.prediction_step)
