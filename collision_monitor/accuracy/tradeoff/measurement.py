"""Time and errors of one profile, or of one model of the shapes, on one scene."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Errors:
    """Median, 99th percentile and largest absolute error of answers, in their unit. NaN: no answers."""

    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, values: ArrayLike) -> Errors:
        """Return the statistics of these errors."""
        found = np.abs(np.asarray(values, np.float64))
        if not len(found):
            return cls(np.nan, np.nan, np.nan)
        return cls(float(np.median(found)), float(np.percentile(found, 99)), float(found.max()))


@dataclass(frozen=True)
class Measurement:
    """Result of one profile, or one model of the shapes, on one scene."""

    scene: str
    profile: str
    model: str
    objects: int
    steps: int
    step_ms: float
    """Median time of a step (ms)."""
    step_ms_p99: float
    """99th percentile of the time of a step (ms)."""
    pair_us: float
    """Total time divided by the number of pairs that were examined or predicted (µs)."""
    alarms: int
    """Pairs in contact or predicted, summed over all steps."""
    false_alarms: int
    """Alarms without a contact of the pair within the horizon (`session.history.alarms`)."""
    misses: int
    """Pairs of the exact answers without an alarm, summed over all steps. Impacts close to the horizon do not count."""
    distance_error_m: float
    """Largest error of the distance (m), over the contacts that both have."""
    ttc_error_s: Errors
    """Errors of the time to collision (s), over the predictions that both have and whose exact status is HIT."""
    compared: int
    """Answers that both have and that state a bound: predictions, or distances for models."""
    outside_bound: int
    """Compared answers whose bound does not hold: the interval or the distance excludes the exact value."""
    open_alarms: int = 0
    """Alarms that neither a contact nor the end of the horizon has decided when the scene ends."""
    late: int = 0
    """True predictions whose interval begins after the contact."""
    early: int = 0
    """True predictions whose interval ends before the contact."""
    beyond_exact: int = 0
    """Alarms that the exact answers do not have at that step: near misses within the tolerances."""
    distance_error_p99_m: float = np.nan
    """99th percentile of the errors of the distance (m)."""
    distance_error_part: float = np.nan
    """Largest error of the distance of models, divided by the size of the smaller object."""
    noise: float = 0.0
    """Noise of the scene's states (m, rad, m/s and rad/s), see `world.measured`."""
    fixed_us: float = np.nan
    """Median time (µs) of the part of the scene's steps that no profile changes (`front.fixed_part`)."""

    @property
    def label(self) -> str:
        """Name of the scene with its noise."""
        return f"{self.scene} ± {self.noise:g}" if self.noise else self.scene

    @property
    def within_bound(self) -> float:
        """Fraction of the compared answers whose bound holds. NaN: no answers."""
        return 1.0 - self.outside_bound / self.compared if self.compared else np.nan

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, with null for NaN."""
        return _without_nan(asdict(self) | {"within_bound": self.within_bound})


def labels_of_models(rows: Iterable[Measurement]) -> set[str]:
    """Labels of the scenes whose rows are models and not profiles."""
    return {row.label for row in rows if row.model != "exact"}


def _without_nan(values: dict[str, Any]) -> dict[str, Any]:
    return {
        name: _without_nan(value)
        if isinstance(value, dict)
        else None
        if isinstance(value, float) and np.isnan(value)
        else value
        for name, value in values.items()
    }
