"""Steady levels: an alert rises when its condition has lasted, and falls when it was away, by the steps' stamps."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.thresholds import LEVELS

ENTRY: Final = np.dtype(
    [
        ("key", np.uint64),  # of the pair; the entries of a rule are sorted by it
        ("since", np.int64),  # ns: stamp at which the level rose from 0
        ("begun", np.int64, len(LEVELS)),  # ns: stamp since which each level's condition holds without a break
        ("held", np.int64, len(LEVELS)),  # ns: stamp at which it held last
        ("level", np.uint8),
    ]
)
"""The state of one pair under one rule."""

NEVER: Final = np.iinfo(np.int64).min

Entries = NDArray[np.void]


class Conditions(NamedTuple):
    """The conditions of a step for n pairs. Pairs that are left out pass no threshold.

    keys (n,): ascending. level (n,): the highest whose thresholds the pair passes. uncertain: keys of the pairs whose
    level may not fall, ascending.
    """

    keys: NDArray[np.uint64]
    level: NDArray[np.uint8]
    uncertain: NDArray[np.uint64]


class Delays(NamedTuple):
    """ns for which a condition has to last before the level rises, and to be away before it falls."""

    raise_after: int
    clear_after: int


def advance_entries(
    entries: Entries, conditions: Conditions, now: int, delays: Delays
) -> tuple[Entries, NDArray[np.uint8]]:
    """Return the entries after a step at `now` (ns), and the level of each before it (n,).

    An uncertain pair rises as any other one, and does not fall. Entries at level 0 remain as long as a condition lasts,
    and in the step in which they fall.
    """
    rows = _united(entries, conditions.keys[conditions.level > 0])
    before = rows["level"].copy()
    reached = np.zeros(len(rows), np.uint8)
    known = np.isin(conditions.keys, rows["key"])
    reached[np.searchsorted(rows["key"], conditions.keys[known])] = conditions.level[known]
    uncertain = np.isin(rows["key"], conditions.uncertain)
    level = np.zeros(len(rows), np.uint8)
    for k in range(len(LEVELS)):
        begun, held = rows["begun"][:, k], rows["held"][:, k]
        met = reached > k
        begun[:] = np.where(met, np.where(begun == NEVER, now, begun), NEVER)
        was_up = before > k
        held[met | (uncertain & was_up)] = now
        rises = met & (now - begun >= delays.raise_after)
        stays = was_up & (met | uncertain | (now - held < delays.clear_after))
        level[rises | stays] = k + 1
    rows["since"][(level > 0) & (before == 0)] = now
    rows["level"] = level
    return rows, before


def lasting(entries: Entries) -> Entries:
    """Return the entries that the next step needs."""
    return entries.compress((entries["level"] > 0) | (entries["begun"] != NEVER).any(axis=1))


def restart(entries: Entries, now: int) -> None:
    """Begin all times anew at `now` (ns), because the time was set back. The levels stay."""
    entries["begun"] = NEVER
    entries["since"] = now
    entries["held"] = np.where(entries["level"][:, None] > np.arange(len(LEVELS)), now, NEVER)


def _united(entries: Entries, keys: NDArray[np.uint64]) -> Entries:
    """Return the entries with new ones for the keys that have none, sorted by key."""
    new = np.setdiff1d(keys, entries["key"])
    blank = np.zeros(len(new), ENTRY)
    blank["key"], blank["begun"], blank["held"] = new, NEVER, NEVER
    rows = np.concatenate([entries, blank])
    return rows[np.argsort(rows["key"], kind="stable")]
