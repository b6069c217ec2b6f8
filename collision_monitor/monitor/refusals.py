"""Refused inputs: how many for each reason, the texts of the last ones, and those of the running step."""

from __future__ import annotations

import warnings
from typing import Any, Final

from numpy.typing import NDArray

from collision_monitor.errors import Refusal, RefusalWarning
from collision_monitor.monitor.result import Refused
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage

MOST_REFUSAL_TEXT: Final = 1000
"""Longest text of a refusal that is kept (characters), because a text may quote a string of a message, and every status
repeats the last one."""

NAMED: Final = 3
"""Objects that the text of a refusal names."""


class Refusals(Stage):
    """Counts refused inputs by reason, and keeps the texts of the last ones.

    warns: whether the first refusal of each kind is a RefusalWarning too. texts: of the last refusal for each reason;
    empty: there was none. last: text of the last refusal.
    """

    SAVED = ("counts", "texts", "last")
    CACHES = ("_of_step", "_unwarned")

    def __init__(self, *, warns: bool) -> None:
        self.counts: dict[Refusal, int] = dict.fromkeys(Refusal, 0)
        self.texts: dict[Refusal, str] = dict.fromkeys(Refusal, "")
        self.last = ""
        self._of_step: dict[Refusal, Refused] = {}
        self._unwarned = set(Refusal) if warns else set()

    def begin_step(self) -> None:
        """Count the refusals of a new step."""
        self._of_step = {}

    def add(self, reason: Refusal, text: str, count: int = 1) -> None:
        """Count refused inputs; `text` describes the last of these."""
        self.counts[reason] += count
        self.last = text if len(text) <= MOST_REFUSAL_TEXT else f"{text[: MOST_REFUSAL_TEXT - 1]}…"
        self.texts[reason] = self.last
        before = self._of_step[reason].count if reason in self._of_step else 0
        self._of_step[reason] = Refused(reason, before + count, self.last)

    @property
    def of_step(self) -> tuple[Refused, ...]:
        """The refusals since the step began, by reason."""
        return tuple(self._of_step.values())

    def warn(self, refused: tuple[Refused, ...]) -> None:
        """Warn of those for which it is the first time, at the line that called the caller of this."""
        for each in refused:
            if each.reason in self._unwarned:
                self._unwarned.discard(each.reason)
                warnings.warn(f"{each.text} (later ones: see StepResult.refused)", RefusalWarning, stacklevel=3)

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        facts["refused"] = {reason.value: count for reason, count in self.counts.items()}
        facts["refusals"] = {reason.value: text for reason, text in self.texts.items()}
        facts["last_refusal"] = self.last

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self.counts = {reason: facts["refused"][reason.value] for reason in Refusal}
        self.texts = {reason: facts["refusals"][reason.value] for reason in Refusal}
        self.last = facts["last_refusal"]


def some_ids(ids: NDArray[Any]) -> str:
    """Return the first NAMED of these ids (n,), for a text."""
    return ", ".join(map(str, ids[:NAMED].tolist())) + (", …" if len(ids) > NAMED else "")
