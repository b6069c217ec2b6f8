"""Search for the cheapest tolerances that meet a user's demands on a recording.

The candidates are `fast`, `exact`, and `balanced` with looser and tighter tolerances. Each is measured on the recording
against exact answers. The cheapest that meets every demand is chosen, or the tightest of those that cost the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import yaml

from collision_monitor.accuracy.measurement import Measurement
from collision_monitor.accuracy.playback import Step
from collision_monitor.accuracy.profile_tradeoff import profile_tradeoff
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import PARAMETER_SECTION
from collision_monitor.settings.profile import Profile

FACTORS: Final = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.01)
"""Factors of the tolerances of `balanced`, from loose to tight. `fast` is tried before them and `exact` after them."""

TIMING_NOISE: Final = 1.05
"""Times that differ by less than this factor count as equal."""

TOLERANCES: Final = (
    "impact_tolerance",
    "position_tolerance",
    "orientation_tolerance",
    "velocity_tolerance",
    "angular_velocity_tolerance",
)


@dataclass(frozen=True)
class Demands:
    """Upper limits that a user sets. None: no limit.

    distance_error: m, of the worst contact. ttc_error: s, of 99 % of the predictions. budget_ms: ms, of 99 % of the
    steps.
    """

    distance_error: float | None = None
    ttc_error: float | None = None
    budget_ms: float | None = None

    def failures(self, row: Measurement) -> list[str]:
        """Return a sentence for each demand that a row does not meet, with the measured value and the limit."""
        found = []
        if row.misses:
            found.append(f"{row.misses} collisions missed")
        if row.outside_bound:
            found.append(f"{row.outside_bound} predictions outside of their bound")
        for name, most, value, unit in (
            ("distance error", self.distance_error, row.distance_error_m, "m"),
            ("TTC error", self.ttc_error, row.ttc_error_s.p99, "s"),
            ("step time", self.budget_ms, row.step_ms_p99, "ms"),
        ):
            if most is not None and value > most:  # NaN (no answers) meets the demand
                found.append(f"{name} {value:.3g} {unit}, {value / most:.3g} times the {most:g} {unit} allowed")
        return found


@dataclass(frozen=True)
class Trial:
    """Measurement of one profile on the recording. failures: demands that it does not meet."""

    profile: Profile
    measurement: Measurement
    failures: list[str]


def candidates(horizon: float, contact_margin: float) -> list[Profile]:
    """Return the profiles to try: `fast`, which ignores uncertainty, then the others from loose to tight."""
    base = Profile.named("balanced").replace(horizon=horizon, contact_margin=contact_margin)
    loose = [
        base.replace(
            name=f"balanced × {factor:g}", **{name: _scaled(name, getattr(base, name) * factor) for name in TOLERANCES}
        )
        for factor in FACTORS
    ]
    named = [Profile.named(name).replace(horizon=horizon, contact_margin=contact_margin) for name in ("fast", "exact")]
    return [named[0], *loose, named[1]]


def _scaled(name: str, value: float) -> float:
    """Clip a value to the range of its setting."""
    setting = next(each for each in Profile.fields() if each.name == name)
    return float(f"{min(max(value, setting.minimum), setting.maximum):.6g}")


def tune(
    scene: str,
    descriptions: list[ObjectDescription],
    steps: list[Step],
    demands: Demands,
    *,
    horizon: float = 2.0,
    contact_margin: float = 0.0,
    progress: Callable[[int], None] = lambda done: None,
) -> tuple[Profile | None, list[Trial]]:
    """Return the chosen profile, or None if none meets the demands, and all trials from loose to tight.

    progress: called with the number of steps just done; the total is len(steps) * 2 * len(candidates(…)).
    Raises InputError.
    """
    for name, value in vars(demands).items():
        if value is not None and not value > 0.0:
            raise InputError(f"{name}: expected a number above 0, got {value!r}")
    profiles = candidates(horizon, contact_margin)
    rows = profile_tradeoff(scene, descriptions, steps, profiles, progress)
    trials = [Trial(profile, row, demands.failures(row)) for profile, row in zip(profiles, rows, strict=True)]
    good = [trial for trial in trials if not trial.failures]
    # profiles that differ only by timing noise cost the same: take the tightest
    least = min((trial.measurement.step_ms for trial in good), default=0.0)
    cheap = [trial for trial in good if trial.measurement.step_ms <= TIMING_NOISE * least]
    return (cheap[-1].profile if cheap else None), trials


def parameter_file(profile: Profile, notes: list[str]) -> str:
    """Return a profile as a parameter file for the node, with notes as comments."""
    settings: dict[str, float | int | str] = {"profile": "balanced"}
    base = Profile.named("balanced")
    settings |= {
        each.name: getattr(profile, each.name)
        for each in Profile.fields()
        if getattr(profile, each.name) != getattr(base, each.name)
    }
    text = yaml.safe_dump({PARAMETER_SECTION: {"ros__parameters": settings}}, sort_keys=False)
    return "".join(f"# {note}\n" for note in _lines(notes)) + text


def _lines(notes: list[str]) -> Iterator[str]:
    for note in notes:
        yield from note.splitlines()
