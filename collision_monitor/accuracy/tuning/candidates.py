"""The profiles that `tune` and `tradeoff` try: everything that a profile can say, one axis at a time.

The first generation is `fast`, `exact`, and `balanced` with looser and tighter tolerances of motion, each with and
without uncertainty. The second one changes the best of them along each other axis that the recording has.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.accuracy.scope import wanted, with_horizon
from collision_monitor.accuracy.tuning.demands import Demands
from collision_monitor.errors import UnsupportedError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import containing_model, shape_class
from collision_monitor.records import Model
from collision_monitor.settings.profile import NO_BUDGET, Profile

FACTORS: Final = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.01)
"""Factors of the tolerances of `balanced`, from loose to tight."""

TOLERANCES: Final = (
    "impact_tolerance",
    "position_tolerance",
    "orientation_tolerance",
    "velocity_tolerance",
    "angular_velocity_tolerance",
)

SAMPLES: Final = (64, 128, 256, 512, 1024, 2048, 4096)
DISTANCES: Final = (1e-4, 1e-3, 1e-2)
"""Values of distance_tolerance (m)."""

MESH_GAP: Final = 0.1
"""Value of mesh_impact_tolerance (m)."""

MODELS: Final = ("sphere", "obb", "kdop26", "convex_hull")
"""Models from coarse to fine."""

THREADS: Final = (2, 4, 8, 16, 32, 64)

ANY_ERROR: Final = 1e6
"""Value of model_error (m) with which a chosen model is always used."""

BUDGET_PART: Final = 0.8
"""Part of the demanded time that a budget gives to a step, because the step exceeds it by what it cannot defer."""


@dataclass(frozen=True)
class Space:
    """What a recording leaves to choose.

    recorded: its profile. demands: of the user. uncertain: whether its states declare an uncertainty. models: see
    `models_of`.
    """

    recorded: Profile
    demands: Demands
    uncertain: bool
    models: Mapping[str, tuple[str, ...]]

    @property
    def horizon(self) -> float:
        """Shortest horizon that the demands allow (s)."""
        return self.recorded.horizon if self.demands.horizon is None else self.demands.horizon

    @property
    def samples(self) -> tuple[int, ...]:
        """Numbers of samples that meet the demanded error of probabilities: the standard error is at most 0.5/√n."""
        most = self.demands.probability_error or 0.5
        return tuple(n for n in SAMPLES if 0.5 / n**0.5 <= most)

    def first_generation(self) -> list[Profile]:
        """Return `fast`, `balanced` × factor from loose to tight, and `exact`, with and without uncertainty."""
        found = [self._based(name) for name in ("fast", "exact")]
        base = self._based("balanced")
        for factor in FACTORS:
            changes = {name: _within(name, getattr(base, name) * factor) for name in TOLERANCES}
            found.append(base.replace(name=f"balanced × {factor:g}", **changes))
        if self.uncertain:
            found += [_changed(each, uncertainty=not each.uncertainty) for each in found]
        return [each for each in found if self._allows(each)]

    def variations(self, profile: Profile) -> list[Profile]:
        """Return the profile with each other value along every axis that the recording has and its name lacks."""
        changes = [each for each in self._changes(profile) if not any(f", {name} " in profile.name for name in each)]
        found = [_changed(profile, **each) for each in changes]
        return [each for each in found if self._allows(each)]

    def _based(self, name: str) -> Profile:
        profile = Profile.named(name).replace(**wanted(self.recorded))
        if self.uncertain and profile.uncertainty and profile.uncertainty_samples not in self.samples:
            return profile.replace(uncertainty_samples=self.samples[-1])
        return profile

    def _allows(self, profile: Profile) -> bool:
        demands = self.demands
        if demands.distance_error is not None and profile.distance_tolerance > demands.distance_error:
            return False
        if demands.probability_error is None:
            return True
        return profile.uncertainty and profile.uncertainty_samples in self.samples

    def _changes(self, profile: Profile) -> Iterator[dict[str, Any]]:
        yield from ({"distance_tolerance": value} for value in DISTANCES)
        yield from ({f"model_{kind}": model} for kind, models in self.models.items() for model in models)
        yield {"adaptive_tolerances": not profile.adaptive_tolerances}
        yield from ({"impact_tolerance": profile.impact_tolerance * factor} for factor in (10.0, 0.1))
        if "mesh" in self.models and not profile.uncertainty and not profile.mesh_impact_tolerance:
            yield {"mesh_impact_tolerance": MESH_GAP}
        if self.uncertain and profile.uncertainty:
            yield from ({"uncertainty_samples": n} for n in self.samples if n < profile.uncertainty_samples)
        if self.horizon < profile.horizon:
            yield with_horizon(profile, self.horizon)
        if self.demands.budget_ms is not None:
            yield {"budget_ms": min(max(BUDGET_PART * self.demands.budget_ms, 0.05), NO_BUDGET)}


def with_threads(profile: Profile, cores: int) -> list[Profile]:
    """Return the profile with more threads, at most one for each core."""
    return [_changed(profile, threads=n) for n in THREADS if profile.threads < n <= cores]


def models_of(descriptions: Iterable[ObjectDescription]) -> dict[str, tuple[str, ...]]:
    """Return the MODELS of each class of shapes whose objects choose no model themselves, if all of them have it."""
    kinds: dict[str, dict[tuple[type, ...], ObjectDescription]] = {}
    for each in descriptions:
        kind = shape_class(each.shapes)
        if each.model is Model.AUTO and kind is not None:
            kinds.setdefault(kind, {})[tuple(type(shape) for shape, _ in each.shapes)] = each
    return {
        kind: tuple(model for model in MODELS if all(_has(each, model) for each in examples.values()))
        for kind, examples in sorted(kinds.items())
    }


def _has(description: ObjectDescription, model: str) -> bool:
    try:
        containing_model(description.shapes, model)
    except UnsupportedError:
        return False
    return True


def _within(name: str, value: float) -> float:
    """Clip a value to the range of its setting."""
    setting = next(each for each in Profile.fields() if each.name == name)
    return float(f"{min(max(value, setting.minimum), setting.maximum):.6g}")


def _changed(profile: Profile, **changes: Any) -> Profile:
    """Return the profile with changes, which its name lists."""
    text = ", ".join(f"{name} {_text(value)}" for name, value in changes.items())
    kept = {name: _within(name, value) if isinstance(value, float) else value for name, value in changes.items()}
    if any(name.startswith("model_") for name in kept):
        kept["model_error"] = ANY_ERROR
    return profile.replace(name=f"{profile.name}, {text}", **kept)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)[:40]
