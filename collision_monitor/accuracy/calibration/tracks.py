"""The tracks of the objects of recordings, by class, with the velocities that follow from their positions."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.motion.moved_states import States
from collision_monitor.records import StateFlag
from collision_monitor.sources.ground.twist_estimate import TwistEstimator

WINDOWS: Final = (0.2, 0.5, 1.0)
"""s over which velocities are estimated from positions, as `estimate_over` of a source."""

_NUMBER: Final = re.compile(r"[\W_]*(\d+|[0-9a-f]{8,}[0-9a-f-]*)$", re.IGNORECASE)
"""What makes a name of one object out of that of a class: `person_12`, `car 3`, `track-6ec0b7…`."""

_UNKNOWN, _BODY = np.uint32(StateFlag.TWIST_UNKNOWN), np.uint32(StateFlag.BODY_TWIST)
_JUMPS: Final = int(StateFlag.DISCONTINUITY)


class Track(NamedTuple):
    """One object from one jump to the next.

    times (K,): s. states (K,): as they were received. estimated: for each window, with twists from the positions.
    """

    name: str
    times: NDArray[np.float64]
    states: States
    estimated: dict[float, States]


def tracks_by_class(works: Iterable[Workload], patterns: Sequence[str] = ()) -> dict[str, list[Track]]:
    """Return the tracks of all objects that move, by class.

    patterns: names of objects with `*` and `?`, each of them a class, the first that fits counts; without any, the
    class of an object is its name without the number at its end.
    """
    found: dict[str, list[Track]] = defaultdict(list)
    for work in works:
        names = {each.object_id: each.name or f"object {each.object_id}" for each in work.descriptions}
        for track in _tracks(work, names):
            word = class_of(track.name, patterns)
            if word is not None:
                found[word].append(track)
    return dict(sorted(found.items()))


def class_of(name: str, patterns: Sequence[str]) -> str | None:
    """Return the class of an object: the pattern that fits it, or its name without a number; None: no pattern fits."""
    if patterns:
        return next((each for each in patterns if fnmatchcase(name, each)), None)
    return _NUMBER.sub("", name.rsplit("/", 1)[-1]) or name


def _tracks(work: Workload, names: Mapping[int, str]) -> list[Track]:
    slots = {object_id: k for k, object_id in enumerate(names)}
    estimators = {window: TwistEstimator() for window in WINDOWS}
    for each in estimators.values():
        each.grow(len(slots))
    stamps: list[int] = []
    rows: list[Any] = []
    last = -1
    for stamp_ns, states in work.steps:
        states = states[np.isin(states["id"], list(slots)) & np.isfinite(states["position"]).all(axis=1)]
        if len(states) == 0 or stamp_ns <= last:
            continue
        last = stamp_ns
        stamps += [stamp_ns] * len(states)
        others = (estimated_states(states, slots, stamp_ns, window, each) for window, each in estimators.items())
        rows.append(np.stack([states, *others]))
    if not rows:
        return []
    table, time = np.concatenate(rows, axis=1), np.array(stamps)
    found = []
    for object_id in np.unique(table["id"][0]).tolist():
        own = np.flatnonzero(table["id"][0] == object_id)
        jumps = np.flatnonzero(table["flags"][0, own] & _JUMPS)
        for part in np.split(own, jumps[jumps > 0]):
            seconds = (time[part] - time[0]) * 1e-9
            windows = {window: table[1 + k, part] for k, window in enumerate(WINDOWS)}
            found.append(Track(names[object_id], seconds, table[0, part], windows))
    return found


def estimated_states(
    states: States, slots: Mapping[int, int], stamp_ns: int, window: float, estimator: TwistEstimator
) -> States:  # fmt: skip
    """The states with twists from their positions over a window (s); those that have none yet stay TWIST_UNKNOWN.

    slots: of the estimator, by id. It gets the states of each stamp once, in order.
    """
    own = np.array([slots[i] for i in states["id"].tolist()], np.int64)
    for slot in own[(states["flags"] & _JUMPS) != 0].tolist():
        estimator.forget(slot)
    unknown = states.copy()
    unknown["flags"] = (unknown["flags"] | _UNKNOWN) & ~_BODY
    estimator.completed(unknown, own, stamp_ns, window)
    estimator.write(unknown, own, everywhere=True)
    return unknown
