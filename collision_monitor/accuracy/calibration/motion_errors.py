"""Errors of motion models on recorded tracks: where a state leads to after some seconds, and where the object was."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.motion.moved_states import along_body, in_world, moved_states
from collision_monitor.records import StateFlag
from collision_monitor.session.history.object_tracks import ObjectTrack
from collision_monitor.sources.ground.motion_models import OTHERS, MotionChoice, MotionModels

Floats = NDArray[np.float64]

LONGEST_GAP: Final = 0.5
"""s between two states from which the position between them is interpolated. Longer: the object may have turned."""

MOST_STATES: Final = 2000
"""States of an object that are used, evenly spread."""


class MotionCandidate(NamedTuple):
    """A motion model and what becomes of measured accelerations, as the keys of a sources file name them."""

    motion: str
    acceleration: str

    def __str__(self) -> str:
        """Return both as in a sources file."""
        return self.motion if self.acceleration == "measured" else f"{self.motion}, acceleration {self.acceleration}"


CANDIDATES: Final = (
    MotionCandidate("people", "measured"),
    MotionCandidate("arc", "off"),
    MotionCandidate("arc", "damped"),
    MotionCandidate("stops", "damped"),
    MotionCandidate("arc", "measured"),
    MotionCandidate("stops", "measured"),
    MotionCandidate("straight", "measured"),
    MotionCandidate("free_fall", "measured"),
)
"""From the simplest one on."""


class TrackErrors(NamedTuple):
    """Errors (n, 3) in m of predictions of one object, and from when they were made (n,) s."""

    time: Floats
    error: Floats


def errors_of(track: ObjectTrack, candidate: MotionCandidate, lead: float, horizon: float) -> TrackErrors:
    """Errors of a model on a track, `lead` s ahead. horizon: s, for damped accelerations.

    States without a known twist, or with none within LONGEST_GAP around the later time, are left out.
    """
    known = (track.states["flags"] & np.uint32(StateFlag.TWIST_UNKNOWN)) == 0
    first = np.flatnonzero(known)
    first = first[:: -(-len(first) // MOST_STATES) or 1]
    target = track.time[first] + lead
    after = np.searchsorted(track.time, target, side="left")
    inside = after < len(track.time)
    first, target, after = first[inside], target[inside], after[inside]
    before = np.maximum(after - 1, 0)
    span = track.time[after] - track.time[before]
    jumps = np.cumsum(track.jump)
    usable = (span <= LONGEST_GAP) & (jumps[after] == jumps[first])
    first, target, after, before, span = (each[usable] for each in (first, target, after, before, span))
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.where(span > 0.0, (target - track.time[before]) / np.where(span > 0.0, span, 1.0), 0.0)[:, None]
    position = track.states["position"]
    there = position[before] + part * (position[after] - position[before])
    predicted = _predicted(track.states[first], candidate, lead, horizon)
    return TrackErrors(track.time[first], predicted - there)


def _predicted(states: Any, candidate: MotionCandidate, lead: float, horizon: float) -> Floats:
    """Positions (n, 3) after `lead` s, as a monitor would predict them from these states with the model."""
    rows = in_world(states)
    choice = MotionChoice({OTHERS: candidate.motion}, candidate.acceleration)
    turns = MotionModels("", choice, candidate.motion).apply(rows, ("",) * len(rows), horizon)
    along_body(rows, turns)
    return np.asarray(moved_states(rows, lead)["position"])
