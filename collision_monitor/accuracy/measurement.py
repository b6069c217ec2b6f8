"""The cost and the errors of one profile, or of one model of the shapes, on one scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Errors:
    """Of a number of answers, in their unit; NaN where there was none."""

    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Errors:
        """Of these absolute values."""
        if not values:
            return cls(np.nan, np.nan, np.nan)
        found = np.abs(values)
        return cls(float(np.median(found)), float(np.percentile(found, 99)), float(found.max()))


@dataclass(frozen=True)
class Measurement:
    """One profile, or one model of the shapes, on one scene."""

    scene: str
    profile: str
    model: str
    objects: int
    steps: int
    step_ms: float
    """Median time of a step."""
    step_ms_p99: float
    pair_us: float
    """Time of all steps by the pairs that were examined or predicted in them."""
    alarms: int
    """Contacts and predictions of all steps, a pair counted at each step."""
    false_alarms: int
    """Of these, the ones that the truth does not have at that step."""
    misses: int
    """Pairs and steps of the truth with neither contact nor prediction, but for impacts at the very horizon."""
    distance_error_m: float
    """Worst, over the contacts that both have."""
    ttc_error_s: Errors
    """Over the predictions that both have, and of which the truth is that they hit."""
    compared: int
    """Answers that both have and that state a bound: predictions, or of models distances."""
    outside_bound: int
    """Of these, intervals that the true time is not in; of models, distances that are off by more than stated."""
    distance_error_part: float = np.nan
    """Of models: the worst distance error as part of the size of the smaller of the two."""
    noise: float = 0.0
    """Of the scene's states (m, rad, m/s and rad/s), see `world.measured`."""

    @property
    def label(self) -> str:
        """The scene, for people."""
        return f"{self.scene} ± {self.noise:g}" if self.noise else self.scene

    @property
    def within_bound(self) -> float:
        """Part of the compared answers whose bound holds; NaN where there was none."""
        return 1.0 - self.outside_bound / self.compared if self.compared else np.nan

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; what there is none of is null."""
        return _without_nan(asdict(self) | {"within_bound": self.within_bound})


def labels_of_models(rows: Iterable[Measurement]) -> set[str]:
    """Labels of the scenes whose rows are models, in place of profiles."""
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
