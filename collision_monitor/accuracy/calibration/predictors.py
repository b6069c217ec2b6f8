"""Predictors: models of motion, what a state says of the time after it, and how far the object is off that later."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.calibration.tracks import WINDOWS, Track
from collision_monitor.motion.moved_states import States, along_body, in_world, moved_states
from collision_monitor.records import StateFlag

Array = NDArray[np.float64]

LARGEST_GAP: Final = 0.5
"""Part of a look-ahead by which two states may be apart for a position between them to count as known."""

_VALID, _STOPS = np.uint32(StateFlag.ACCELERATION_VALID), np.uint32(StateFlag.STOPS)
_UNKNOWN: Final = int(StateFlag.TWIST_UNKNOWN)


class Predictor(NamedTuple):
    """motion: as in a sources file, or "rest". window: s of the positions that give the velocity; 0: the stated one."""

    motion: str
    window: float = 0.0

    def __str__(self) -> str:
        """The name in a table."""
        return self.motion if self.window == 0.0 else f"{self.motion}, over {self.window:g} s"


REST: Final = Predictor("rest")
"""For comparison: how far the objects go."""

PREDICTORS: Final = (
    REST,
    *(Predictor(motion, window) for window in (0.0, *WINDOWS) for motion in ("people", "arc")),
    Predictor("straight"),
    Predictor("stops"),
)
"""`people`: constant velocity. `arc`: constant twist along the body's own axes. `straight`: with the stated
acceleration; `stops`: likewise, until the body stands."""


def fits(model: Predictor, tracks: list[Track]) -> bool:
    """Whether states say what a model needs: `straight` and `stops` are `people` without an acceleration."""
    return model.motion not in ("straight", "stops") or any((each.states["flags"] & _VALID).any() for each in tracks)


def errors(track: Track, model: Predictor, lag: float) -> Array:
    """Deviations (M, 3) of the positions from the predicted ones, `lag` s after each state that is followed so long.

    m, in the world's axes. A position between two states is that on the line between them.
    """
    t, states = track.times, track.states if model.window == 0.0 else track.estimated[model.window]
    later = t + lag
    after = np.clip(np.searchsorted(t, later), 1, len(t) - 1)
    whole = (later <= t[-1]) & (t[after] - t[after - 1] <= LARGEST_GAP * lag) if len(t) > 1 else np.zeros(len(t), bool)
    known = np.flatnonzero(whole & ((states["flags"] & _UNKNOWN) == 0))
    if len(known) == 0:
        return np.empty((0, 3))
    predicted = moved_states(_as_stated(states[known], model.motion), lag)["position"]
    k, there = after[known], later[known]
    share = ((there - t[k - 1]) / (t[k] - t[k - 1]))[:, None]
    position = track.states["position"]
    found: Array = position[k - 1] + share * (position[k] - position[k - 1]) - predicted
    return found


def _as_stated(states: States, motion: str) -> States:
    """States (N,) that move on as a model says."""
    states = in_world(states)
    if motion == "rest":
        for name in ("linear", "angular"):
            states[name] = 0.0
    if motion not in ("straight", "stops"):
        states["flags"] &= ~(_VALID | _STOPS)
    elif motion == "stops":
        states["flags"] |= _STOPS
    else:
        states["flags"] &= ~_STOPS
    if motion == "arc":
        along_body(states, np.ones(len(states), np.bool_))
    return states
