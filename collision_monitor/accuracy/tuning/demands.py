"""The demands of a user on the answers and their cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Final

from collision_monitor.accuracy.tradeoff.measurement import Measurement
from collision_monitor.errors import InputError
from collision_monitor.settings.profile import Profile

_UNITS: Final = {"distance_error": "m", "ttc_error": "s", "budget_ms": "ms", "probability_error": "1", "horizon": "s"}

_OPTIONS: Final = {
    "distance_error": "--max-distance-error",
    "ttc_error": "--max-ttc-error",
    "budget_ms": "--budget-ms",
    "probability_error": "--max-probability-error",
    "horizon": "--min-horizon",
}
"""The options of `tune`, which errors name."""

_REASONS: Final = {
    "distance error": "it is that of the shapes, or of models that the descriptions demand",
    "TTC error": "the states of the recording are not more exact: a finer setting cannot know what they do not say",
    "step time": "so many objects take that long on this machine; a shorter horizon or a smaller region takes less",
}
"""What is left if no setting meets a demand."""

MOST_SAMPLES: Final = 4096
"""Largest value of uncertainty_samples."""


@dataclass(frozen=True)
class Demands:
    """Upper limits that a user sets, and the shortest horizon. None: no limit; the horizon of the recording.

    distance_error: m, of the worst contact. ttc_error: s, of 99 % of the predictions. budget_ms: ms, of 99 % of the
    steps. probability_error: of a probability, one standard error. horizon: s. Raises InputError for a limit that is
    not above 0 and for limits that contradict each other.
    """

    distance_error: float | None = None
    ttc_error: float | None = None
    budget_ms: float | None = None
    probability_error: float | None = None
    horizon: float | None = None

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not value > 0.0:
                raise InputError(f"{_OPTIONS[name]}: expected a number above 0, got {value!r}")
        most, least = self.probability_error, 0.5 / MOST_SAMPLES**0.5
        if most is not None and not least <= most <= 0.5:
            raise InputError(
                f"{_OPTIONS['probability_error']}: expected {least:.4g}, with {MOST_SAMPLES} samples, to 0.5, "
                f"got {most:g}"
            )

    def check(self, recorded: Profile, *, uncertain: bool) -> None:
        """Check the demands against a recording and its profile. Raises InputError for demands that contradict it."""
        horizon = recorded.horizon if self.horizon is None else self.horizon
        if horizon > recorded.horizon:
            raise InputError(
                f"{_OPTIONS['horizon']}: expected at most that of the recording, {recorded.horizon:g} s, got "
                f"{horizon:g} s; a longer one is not searched, because it only costs more"
            )
        if self.ttc_error is not None and self.ttc_error >= horizon > 0.0:
            raise InputError(
                f"{_OPTIONS['ttc_error']}: expected an error below the horizon of {horizon:g} s, got "
                f"{self.ttc_error:g} s, which every prediction meets; leave it out"
            )
        if self.probability_error is not None and not uncertain:
            raise InputError(
                f"{_OPTIONS['probability_error']}: expected states that declare an uncertainty, got none; leave it "
                "out, or record states with standard deviations"
            )

    def failures(self, row: Measurement, *, median: bool = False) -> list[str]:
        """Return a sentence for each demand that a row does not meet, with the measured value and the limit.

        median: judge the median step time, because the slowest steps were measured while all cores were at work.
        """
        found = []
        if row.misses:
            found.append(f"{row.misses} collisions missed")
        if row.outside_bound:
            found.append(f"{row.outside_bound} answers outside of their bound")
        for name, value, most, unit in self._measured(row, median):
            if value > most:  # NaN (no answers) meets the demand
                found.append(f"{name} {value:.3g} {unit}, {value / most:.3g} times the {most:g} {unit} allowed")
        return found

    def untested(self, row: Measurement) -> list[str]:
        """Return a sentence for each demand that a row cannot test, because the session has no answers of its kind."""
        lacking = {
            "distance error": ("distance_error", "contact"),
            "TTC error": ("ttc_error", "certain prediction"),
            "step time": ("budget_ms", "step to be timed"),
        }
        found = [lacking[name] for name, value, _, _ in self._measured(row, median=True) if value != value]
        return [f"{_OPTIONS[name]}: the session has no {what}, so that it could not be tested" for name, what in found]

    def hopeless(self, rows: Sequence[Measurement]) -> list[str]:
        """Return a sentence for each demand that none of the rows meets alone, with the least value and its reason."""
        found = []
        for name, _, most, unit in self._measured(rows[0], median=True):
            values = [value for row in rows for each, value, _, _ in self._measured(row, median=True) if each == name]
            if all(value > most for value in values):
                found.append(f"{name} of {most:g} {unit}: the least was {min(values):.3g} {unit}; {_REASONS[name]}")
        return found

    def excess(self, row: Measurement) -> float:
        """Return the largest factor by which a row exceeds a demand; infinite with a miss or a wrong bound."""
        if row.misses or row.outside_bound:
            return inf
        measured = self._measured(row, median=True)
        return max((value / most for _, value, most, _ in measured if value == value), default=0.0)

    def _measured(self, row: Measurement, median: bool) -> list[tuple[str, float, float, str]]:
        """Name, measured value, limit and unit of each limited quantity."""
        step = row.step_ms if median else row.step_ms_p99
        quantities = (
            ("distance error", row.distance_error_m, self.distance_error, "m"),
            ("TTC error", row.ttc_error_s.p99, self.ttc_error, "s"),
            ("step time", step, self.budget_ms, "ms"),
        )
        return [(name, value, most, unit) for name, value, most, unit in quantities if most is not None]

    def __str__(self) -> str:
        """The demands as a list for a person."""
        given = {name: value for name, value in vars(self).items() if value is not None}
        units = {name: "" if _UNITS[name] == "1" else f" {_UNITS[name]}" for name in given}
        return ", ".join(f"{name} {value:g}{units[name]}" for name, value in given.items()) or "nothing"
