"""Errors of a profile's answers against the exact ones, over any part of a recording; parts are added up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.accuracy.reported import Reported, Rows, Steps
from collision_monitor.accuracy.tradeoff.measurement import Errors, Measurement
from collision_monitor.impact.impact_record import pair_keys
from collision_monitor.records import PredictionStatus
from collision_monitor.session.history.alarms import Alarms
from collision_monitor.settings.profile import Profile

ROUND_OFF = 1e-9
"""m: the distance of the same shapes may differ by this much, whatever the bound."""

Floats = NDArray[np.float64]
_NONE: Floats = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts, errors and times of a part of a recording; `+` joins two parts.

    alarms: judged by what followed. beyond_exact, misses: pairs × steps that only the profile, or only the exact
    answers have. distances (m), times (s): errors. seconds: of each step. pairs: examined or predicted.
    """

    steps: int = 0
    alarms: Alarms = field(default_factory=Alarms)
    beyond_exact: int = 0
    misses: int = 0
    compared: int = 0
    outside_bound: int = 0
    distances: Floats = field(default_factory=lambda: _NONE)
    times: Floats = field(default_factory=lambda: _NONE)
    seconds: Floats = field(default_factory=lambda: _NONE)
    pairs: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Join two parts."""
        joined: dict[str, Any] = {
            name: np.append(mine, theirs) if isinstance(mine, np.ndarray) else mine + theirs
            for (name, mine), theirs in zip(vars(self).items(), vars(other).values(), strict=True)
        }
        return Tally(**joined)

    def measurement(self, scene: str, profile: Profile, objects: int, **others: Any) -> Measurement:
        """Summarize as the row of a profile."""
        seconds = self.seconds if len(self.seconds) else np.full(1, np.nan)
        return Measurement(
            scene=scene,
            profile=profile.name,
            model="exact",
            objects=objects,
            steps=self.steps,
            step_ms=1e3 * float(np.median(seconds)),
            step_ms_p99=1e3 * float(np.percentile(seconds, 99)),
            pair_us=1e6 * float(seconds.sum()) / self.pairs if self.pairs else np.nan,
            alarms=self.alarms.alarms,
            false_alarms=self.alarms.false_alarms,
            open_alarms=self.alarms.open_alarms,
            late=self.alarms.late,
            early=self.alarms.early,
            beyond_exact=self.beyond_exact,
            misses=self.misses,
            distance_error_m=Errors.of(self.distances).worst,
            distance_error_p99_m=Errors.of(self.distances).p99,
            ttc_error_s=Errors.of(self.times),
            compared=self.compared,
            outside_bound=self.outside_bound,
            **others,
        )


def compare_reports(mine: Reported, truth: Reported, profile: Profile) -> Tally:
    """Compare the answers of a profile with the exact ones of the same steps; no times and no judged alarms.

    A miss is a pair of the exact answers that the profile does not report at that step. Predictions whose exact
    interval ends within two tolerances of the horizon do not count.
    """
    stated = mine.predictions["status"] != PredictionStatus.POSSIBLE
    predictions, prediction_step = mine.predictions[stated], mine.prediction_step[stated]
    pairs = np.unique(np.concatenate([_pairs(rows) for rows in (*_rows(mine), *_rows(truth))]))
    touching = _coded(pairs, mine.contacts, mine.contact_step)
    expected = _coded(pairs, predictions, prediction_step)
    actual = _coded(pairs, truth.contacts, truth.contact_step)
    coming = _coded(pairs, truth.predictions, truth.prediction_step)
    reported = np.union1d(touching, expected)
    surely = truth.predictions["upper"] < profile.horizon - 2.0 * profile.impact_tolerance
    _, k, m = np.intersect1d(touching, actual, assume_unique=True, return_indices=True)
    off = mine.contacts["signed_distance"][k] - truth.contacts["signed_distance"][m]
    bound = mine.contacts["error_bound"][k] + truth.contacts["error_bound"][m]
    _, i, j = np.intersect1d(expected, coming, assume_unique=True, return_indices=True)
    stated_times, true_times = predictions[i], truth.predictions[j]
    is_hit = true_times["status"] == PredictionStatus.HIT
    beside = (stated_times["lower"] > true_times["upper"]) | (stated_times["upper"] < true_times["lower"])
    return Tally(
        beyond_exact=int(np.count_nonzero(~np.isin(reported, np.union1d(actual, coming)))),
        misses=int(np.count_nonzero(~np.isin(np.union1d(actual, coming[surely]), reported))),
        compared=len(i) + len(k),
        outside_bound=int(np.count_nonzero(beside) + np.count_nonzero(np.abs(off) > bound + ROUND_OFF)),
        distances=np.abs(off),
        times=np.abs(stated_times["lower"] - true_times["lower"])[is_hit],
    )


def _rows(reported: Reported) -> tuple[Rows, Rows]:
    return reported.contacts, reported.predictions


def _pairs(rows: Rows) -> NDArray[np.uint64]:
    return pair_keys(rows["id_a"], rows["id_b"])


def _coded(pairs: NDArray[np.uint64], rows: Rows, steps: Steps) -> Steps:
    """Number of each row's step and pair, (n,), unique because a step has one row of a pair."""
    return steps * len(pairs) + np.searchsorted(pairs, _pairs(rows))
