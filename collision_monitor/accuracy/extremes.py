"""Numerical stability: the largest errors over sweeps of sizes, ratios, distances, gaps, speeds, angles and times."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from collision_monitor.accuracy.exact_comparison import Configuration, Sample, samples_of, stamp_samples


@dataclass
class WorstCase:
    """Largest errors of one quantity over one sweep.

    at: value of the sweep with the largest error. curve: largest error by value. error, ratio: see Sample.
    """

    sweep: str
    quantity: str
    samples: int = 0
    error: float = 0.0
    ratio: float = 0.0
    not_finite: int = 0
    at: float = math.nan
    curve: dict[float, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Whether every answer is finite and every exact answer is within its bound."""
        return self.not_finite == 0 and self.ratio <= 1.0


SWEEPS: Final[dict[str, tuple[str, list[float], Callable[[float], Configuration]]]] = {
    "size": ("m", [10.0**k for k in range(-9, 10)], lambda x: Configuration(size=x, speed=x)),
    "size ratio": ("", [10.0**k for k in range(13)], lambda x: Configuration(ratio=x)),
    "from the origin": ("sizes", [0.0, *(10.0**k for k in range(10))], lambda x: Configuration(origin=x)),
    "gap": ("sizes", [10.0**k for k in range(-15, 1)], lambda x: Configuration(gap=x)),
    "speed": ("m/s", [10.0**k for k in range(-12, 9)], lambda x: Configuration(speed=x, horizon=10.0 / x)),
    "horizon": ("s", [10.0**k for k in range(-9, 7)], lambda x: Configuration(horizon=x, speed=5.0 / x)),
    "spin": ("rad/s", [0.0, *(10.0**k for k in range(-6, 7))], lambda x: Configuration(spin=x)),
    "angle of the axes": ("rad", [10.0**k for k in range(-16, 1)], lambda x: Configuration(angle=x)),
    "thickness": ("sizes", [10.0**k for k in range(-9, 1)], lambda x: Configuration(thickness=x)),
    "near zero": ("m", [10.0**k for k in range(-150, -9, 20)], lambda x: Configuration(size=x, speed=x)),
}
"""Unit, values, and function from a value to its configuration, by the name of the sweep."""


def run(samples: int = 12, seed: int = 1, progress: Callable[[int], None] = lambda done: None) -> list[WorstCase]:
    """Return a row for each sweep and quantity.

    samples: of each quantity at each value. progress: called with 1 after each value.
    """
    rows: dict[tuple[str, str], WorstCase] = {}
    for name, (_, values, configuration_of) in SWEEPS.items():
        for value in values:
            rng = np.random.default_rng(seed)
            for _ in range(samples):
                for sample in samples_of(configuration_of(value), rng):
                    row = rows.setdefault((name, sample.quantity), WorstCase(name, sample.quantity))
                    _add(row, sample, value)
            progress(1)
    for sample in stamp_samples():
        _add(rows.setdefault(("stamp", sample.quantity), WorstCase("stamp", sample.quantity)), sample, 2.0**63)
    return list(rows.values())


def steps() -> int:
    """Number of values for which `run` calls `progress`."""
    return sum(len(values) for _, values, _ in SWEEPS.values())


def _add(row: WorstCase, sample: Sample, value: float) -> None:
    row.samples += 1
    row.not_finite += not sample.finite
    row.ratio = max(row.ratio, sample.ratio)
    row.curve[value] = max(row.curve.get(value, 0.0), sample.error)
    if sample.error >= row.error:
        row.error, row.at = sample.error, value
