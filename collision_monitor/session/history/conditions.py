"""The conditions that an expectation can state. Each returns whether a history meets it, and what was found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict

import numpy as np

from collision_monitor.session.history.history import ANY, History, Pair

Condition = Callable[[History, Callable[[], str]], tuple[bool, str]]
"""Takes a history and a function that replays the session and returns the verdict. Returns whether the condition holds,
and what the history holds."""

PairSelector = str | list[str | int]
"""ANY, or two names or ids."""


def _problems(history: History) -> str:
    """Return why something may be missing; empty if nothing is."""
    if not history.problems:
        return ""
    more = len(history.problems) - 1
    return f"not known: {history.problems[0]}" + (f", and {more} more" if more else "")


def _pair(history: History, pair: Pair) -> str:
    return f"{history.name_of(pair[0])} and {history.name_of(pair[1])}"


def first_contact_within(names: PairSelector, low: float, high: float) -> Condition:
    """Require that the first certain contact of these objects begins in this window (s)."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        collisions = [each for each in history.collisions_of(names) if each.certain]
        if not collisions:
            return False, _problems(history) or "no contact"
        first = collisions[0]
        return low <= first.begin <= high, f"first contact at {first.begin:.3f} s, {_pair(history, first.pair)}"

    return check


def no_contact(names: PairSelector) -> Condition:
    """Require that these objects have no contact, not even a possible one."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        for each in history.collisions_of(names):
            kind = "contact" if each.certain else "possible contact"
            return (
                False,
                f"{kind} at {each.begin:.3f} s, {_pair(history, each.pair)}, depth {max(-each.deepest, 0):.3g} m",
            )
        unseen = _unseen(history, names)
        if unseen:
            return False, f"not known: no state of {', '.join(unseen)}"
        return not history.problems, _problems(history) or "no contact"

    return check


def _unseen(history: History, names: PairSelector) -> list[str]:
    """Return the names of the selected objects that move and have no states."""
    ids = set(history.objects) if names == ANY else history.ids_of(names[0]) | history.ids_of(names[1])
    seen = set(history.states["id"].tolist())
    return sorted(history.name_of(i) for i in ids if i not in seen and not history.objects[i].static)


def no_prediction_under(names: PairSelector, under: float) -> Condition:
    """Require that no collision of these objects is predicted to begin in less than `under` s."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        wanted = history.pairs_of(names)
        rows = history.predictions
        for k in np.flatnonzero(rows["lower"] < under):
            pair = (int(rows["id_a"][k]), int(rows["id_b"][k]))
            if wanted(pair):
                at = history.times[history.prediction_step[k]]
                return False, f"due in {rows['lower'][k]:.3f} s at {at:.3f} s, {_pair(history, pair)}"
        return not history.problems, _problems(history) or "no such prediction"

    return check


def warned_before(names: PairSelector, before: float) -> Condition:
    """Require that predictions of each collision of these objects begin at least `before` s earlier."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        collisions = history.collisions_of(names)
        least = math.inf
        for each in collisions:
            # NaN passes: a contact at the session's begin could not be predicted
            if each.warned < before:
                lead = f"predicted only {each.warned:.3f} s before" if each.warned > 0.0 else "not predicted"
                return False, f"the contact of {_pair(history, each.pair)} at {each.begin:.3f} s was {lead}"
            least = min(least, each.warned)
        if not collisions:
            return not history.problems, _problems(history) or "no contact"
        found = f"{len(collisions)} contacts, warned {least:.3f} s before or more"
        return not history.problems, _problems(history) or found

    return check


def complete(history: History, _: Callable[[], str]) -> tuple[bool, str]:
    """Require that no input was refused or lost, and no message is missing."""
    if history.problems:
        return False, _problems(history)
    if history.status is None:
        return False, "not known: the session holds no status"
    counters = asdict(history.status)
    names = [name for name in counters if name.startswith("refused_")] + ["messages_lost", "recording_dropped"]
    lost = [f"{name} {counters[name]}" for name in names if counters[name]]
    return not lost, ", ".join(lost) or "nothing is missing"


def step_time_within(limit: float) -> Condition:
    """Require that the 99th percentile of the step times is at most `limit` s."""

    def check(history: History, _: Callable[[], str]) -> tuple[bool, str]:
        if not len(history.durations):
            return False, "not known: the session holds no step times"
        p99 = float(np.quantile(history.durations, 0.99))
        kind = "steps" if history.replayed else "steps that a status reported"
        return p99 <= limit, f"{p99:.6f} s over {len(history.durations)} {kind}"

    return check
