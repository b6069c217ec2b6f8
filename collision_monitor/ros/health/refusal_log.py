"""Refused input in the node's log: a line when a kind of refusal first happens, then at most one every 10 s."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Final

from collision_monitor.errors import Refusal
from collision_monitor.pipeline.pipeline import Pipeline

PERIOD: Final = 10_000_000_000
"""ns between two lines about the same problem: a flood of wrong messages must not become a flood of lines."""

FIRST_LOOKS: Final = 10
"""Looks of `report_unseen`, twice a second, before the log says that no state arrived at all."""

NAMED: Final = 5
"""Objects that a line names."""


@dataclass
class _Problem:
    """What happened since the last line about a problem. text: that of the last time."""

    text: str = ""
    count: int = 0
    last_line: int | None = None  # ns


class RefusalLog:
    """Warns of refused input, of restarts of the timeline and of stale objects. All times in ns of a steady clock."""

    def __init__(self, pipeline: Pipeline, warn: Callable[[str], object]) -> None:
        self._pipeline = pipeline
        self._warn = warn
        self._refused = dict(pipeline.refused)
        self._restarts = pipeline.restarts
        self._problems: dict[tuple[str, str], _Problem] = {}  # by topic and kind
        self._unseen: set[int] = set()  # at the last look
        self._looks = 0

    def report(self, topic: str, now: int) -> None:
        """Log what was refused in a message of this topic, and whether the message restarted the timeline."""
        pipeline = self._pipeline
        if pipeline.restarts != self._restarts:
            self._restarts = pipeline.restarts
            self.note(topic, "restart", pipeline.refusal_texts[Refusal.TIME], 1, now)
        if pipeline.refused == self._refused:
            return
        for reason, count in pipeline.refused.items():
            new = count - self._refused[reason]
            if new:
                self.note(topic, reason.value, pipeline.refusal_texts[reason], new, now)
        self._refused = dict(pipeline.refused)

    def report_stale(self, topic: str, now: int) -> None:
        """Log which objects are stale while others get new states."""
        stale = self._pipeline.stale()
        if not stale:
            return
        self._remind(topic, "stale", f"no usable new state of object {named(stale)}: stale", now)

    def report_unseen(self, topic: str, now: int) -> None:
        """Log that no state arrived so far, or which objects have none: at the second look, then every 10 s."""
        unseen = self._pipeline.unseen()
        lasting = {object_id: name for object_id, name in unseen.items() if object_id in self._unseen}
        self._unseen = set(unseen)
        if not self._pipeline.has_begun and self._looks >= FIRST_LOOKS:
            self._remind(topic, "none", "no state arrived so far, neither here nor from a sources file", now)
        elif lasting:
            self._remind(topic, "unseen", f"no state so far of object {named(lasting)}: nothing is known about it", now)
        self._looks += 1

    def _remind(self, topic: str, kind: str, text: str, now: int) -> None:
        """Log a state that lasts: at once and every 10 s, without a count."""
        self._problems.setdefault((topic, kind), _Problem()).count = 0
        self.note(topic, kind, text, 1, now)

    def catch_up(self, now: int) -> None:
        """Log what has waited for its line. Call it regularly."""
        for (topic, _), problem in self._problems.items():
            self._log_if_due(topic, problem, now)

    def note(self, topic: str, kind: str, text: str, count: int, now: int) -> None:
        """Log that a kind of problem happened on a topic, now or when its next line is due."""
        problem = self._problems.setdefault((topic, kind), _Problem())
        problem.text = text
        problem.count += count
        self._log_if_due(topic, problem, now)

    def _log_if_due(self, topic: str, problem: _Problem, now: int) -> None:
        last = problem.last_line
        if problem.count == 0 or (last is not None and now - last < PERIOD):
            return
        since = "" if last is None else " since the last line"
        times = f" ({problem.count} times{since})" if problem.count > 1 else ""
        problem.last_line, problem.count = now, 0
        self._warn(_printable(f"{topic}: {problem.text}{times}"))


def named(objects: Mapping[int, str]) -> str:
    """Return the first NAMED of these objects with their names, and the number of the others."""
    more = f" and {len(objects) - NAMED} more" if len(objects) > NAMED else ""
    return ", ".join(f"{object_id} ({name!r})" for object_id, name in islice(objects.items(), NAMED)) + more


def _printable(text: str) -> str:
    """Return the text as one line that a terminal shows as it is; a text may quote the input."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
