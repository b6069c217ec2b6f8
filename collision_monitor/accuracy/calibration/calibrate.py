"""Which model of motion predicts the objects of a class best, and how far they are off it.

The settings are those of all tracks. What they promise is judged by cross-validation: each half of the tracks by what
the other half says (Stone, Cross-validatory choice and assessment of statistical predictions, 1974).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.calibration.deviation import LAGS, Growth, growth_of
from collision_monitor.accuracy.calibration.predictors import PREDICTORS, REST, Predictor, errors, fits
from collision_monitor.accuracy.calibration.tracks import Track

Array = NDArray[np.float64]

SHOWN: Final = (0.5, 1.0, 2.0)
"""s: look-aheads for which a model is chosen."""

FEWEST: Final = 30
"""Deviations at a look-ahead, in each half, from which on it counts: the standard error of an RMS is then 13 %."""

FEW_TRACKS: Final = 10
"""Tracks below which one more may change the standard deviations by a third or more."""

GAIN: Final = 0.95
"""A model is chosen over a simpler one if its deviation is at most so much of it: less is within the error of a fit."""

FLAT: Final = 1e-6
"""Part of the largest variance below which objects do not move along an axis."""


class Coverage(NamedTuple):
    """Parts of the deviations along an axis within 1 and 2 standard deviations: 0.68 and 0.95 if these are right."""

    one: float
    two: float


@dataclass(frozen=True)
class Calibration:
    """What the tracks of a class say.

    rms: of each model at LAGS (L,), in m; NaN where there are too few. chosen: the model with the least deviation.
    best: that at each look-ahead of SHOWN. choices: of each half alone. growth: of all tracks. coverage: of each half
    by the growth of the other. stated: medians of the standard deviations in the states (m, m/s).
    """

    name: str
    tracks: int
    states: int
    rms: Mapping[Predictor, Array]
    chosen: Predictor
    best: Mapping[float, Predictor]
    choices: tuple[Predictor, Predictor]
    growth: Growth
    coverage: Mapping[float, Coverage]
    stated: tuple[float, float]

    def as_json(self) -> dict[str, Any]:
        """Numbers for JSON, without NaN."""
        return {
            "class": self.name,
            "tracks": self.tracks,
            "states": self.states,
            "lags_s": list(LAGS),
            "rms_m": {str(m): [None if x != x else x for x in rms.tolist()] for m, rms in self.rms.items()},
            "chosen": {"motion": self.chosen.motion, "estimate_over_s": self.chosen.window},
            "chosen_by_half": [str(model) for model in self.choices],
            "best": {f"{lag:g}": str(model) for lag, model in self.best.items()},
            "position_stddev": self.growth.position,
            "velocity_stddev": self.growth.velocity,
            "max_linear_acceleration": self.growth.most_acceleration,
            "within": {f"{lag:g}": each._asdict() for lag, each in self.coverage.items()},
            "stated": {"position_stddev": self.stated[0], "velocity_stddev": self.stated[1]},
        }


def calibrate(
    classes: Mapping[str, list[Track]], note: Callable[[int], None] = lambda done: None
) -> tuple[list[Calibration], list[str]]:
    """Return what the tracks of each class say, and one sentence for each class that says nothing.

    note: called with 1 after each class.
    """
    found, left_out = [], []
    for name, tracks in classes.items():
        one = _calibrated(name, tracks)
        if one is None:
            left_out.append(
                f"{name}: expected at least {FEWEST} states in each half of the tracks that are followed for "
                f"{SHOWN[0]:g} s, got fewer"
            )
        else:
            found.append(one)
        note(1)
    return found, left_out


def _calibrated(name: str, tracks: list[Track]) -> Calibration | None:
    models = [model for model in PREDICTORS if fits(model, tracks)]
    halves = halves_of(tracks)
    off = [{model: [_stacked(half, model, lag) for lag in LAGS] for model in models} for half in halves]
    enough = [min(len(half[models[0]][k]) for half in off) >= FEWEST for k in range(len(LAGS))]
    shown = [lag for lag in SHOWN if enough[LAGS.index(lag)]]
    if not shown:
        return None
    used = np.flatnonzero(enough)
    both = {model: [np.concatenate([half[model][k] for half in off]) for k in range(len(LAGS))] for model in models}
    rms = {model: np.where(enough, _rms(each), np.nan) for model, each in both.items()}
    best = {lag: _least({model: float(each[LAGS.index(lag)]) for model, each in rms.items()}) for lag in shown}
    chosen, *choices = (
        _over(shown, each) for each in (rms, *({model: _rms(half[model]) for model in models} for half in off))
    )
    growths = [_growth([half[chosen][k] for k in used], used) for half in off]
    coverage = {
        lag: _coverage([half[chosen][LAGS.index(lag)] for half in off], [each.at(lag) for each in growths[::-1]])
        for lag in shown
    }
    growth = _growth([both[chosen][k] for k in used], used)
    states = np.concatenate([each.states for each in tracks])
    stated = float(np.median(states["position_stddev"])), float(np.median(states["velocity_stddev"]))
    return Calibration(
        name, len(tracks), len(states), rms, chosen, best, (choices[0], choices[1]), growth, coverage, stated
    )


def _over(lags: list[float], rms: Mapping[Predictor, Array]) -> Predictor:
    """The model with the least geometric mean of the deviations at some look-aheads."""
    columns = [LAGS.index(lag) for lag in lags]
    with np.errstate(divide="ignore"):  # what is predicted exactly
        return _least({model: float(np.exp(np.log(each[columns]).mean())) for model, each in rms.items()})


def _growth(off: list[Array], used: NDArray[np.int64]) -> Growth:
    return growth_of(np.array([_variance(each) for each in off]), np.array(LAGS)[used])


def halves_of(tracks: list[Track]) -> tuple[list[Track], list[Track]]:
    """Two halves of the tracks: every other one, or the earlier and the later half of a single one."""
    if len(tracks) > 1:
        longest = sorted(tracks, key=lambda each: (-len(each.times), each.name))
        return longest[::2], longest[1::2]
    (one,) = tracks
    middle = len(one.times) // 2
    cuts = slice(None, middle), slice(middle, None)
    first, last = (
        Track(one.name, one.times[cut], one.states[cut], {w: states[cut] for w, states in one.estimated.items()})
        for cut in cuts
    )
    return [first], [last]


def _stacked(tracks: list[Track], model: Predictor, lag: float) -> Array:
    return np.concatenate([np.empty((0, 3)), *(errors(track, model, lag) for track in tracks)])


def _rms(off: list[Array]) -> Array:
    return np.array([np.sqrt((each**2).sum(axis=1).mean()) if len(each) else np.nan for each in off])


def _moving_axes(off: Array) -> NDArray[np.int64]:
    variance = (off**2).mean(axis=0)
    return np.flatnonzero(variance > FLAT * variance.max())


def _variance(off: Array) -> float:
    axes = _moving_axes(off)
    return float((off[:, axes] ** 2).mean()) if len(axes) else 0.0


def _coverage(halves: list[Array], stddevs: list[float]) -> Coverage:
    sizes = [np.abs(off[:, _moving_axes(off)]) / max(s, 1e-12) for off, s in zip(halves, stddevs, strict=True)]
    ratios = np.concatenate([each.ravel() for each in sizes])
    return Coverage(*(float((ratios <= n).mean()) if len(ratios) else 1.0 for n in (1.0, 2.0)))


def _least(values: Mapping[Predictor, float]) -> Predictor:
    """The first model that no later one undercuts by more than what a fit is uncertain by. REST is no choice."""
    moving = {model: value for model, value in values.items() if model != REST}
    chosen = next(model for model, value in moving.items() if np.isfinite(value))
    for model, value in moving.items():
        if value < GAIN * values[chosen]:
            chosen = model
    return chosen
