"""The settings that trade speed for accuracy, each with its unit, range and meaning.

ROS parameters, the command line's help and the recorded sessions are all generated from these fields.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from collision_monitor.errors import ProfileError
from collision_monitor.records import MOST_POINTS, Model
from collision_monitor.settings.named_profiles import NAMED_PROFILES, profile_changes
from collision_monitor.settings.setting import EVERYWHERE, Setting, choice, number, settings_of, switch, vector

NO_BUDGET: Final = 1e6
"""ms, a quarter of an hour: a step has as long as it takes, and no clock is looked at."""

NO_LIMIT: Final = 1_000_000_000
"""Pairs in a step: more than fit into memory."""

_MODELS: Final = [model.name.lower() for model in Model if model is not Model.EXACT]


@dataclass(frozen=True)
class Profile:
    """How far the monitor looks and how exact it is. Raises ProfileError for values that are, or go together, wrong."""

    name: str = "balanced"
    horizon: float = number(
        2.0, 0.0, 1e6, "s", "How far ahead collisions are predicted; 0: contacts only.", predictions=True
    )
    contact_margin: float = number(
        0.0, 0.0, 1e6, "m", "Pairs up to this far apart count as touching.", predictions=True
    )
    contact_points: int = number(
        1, 1, MOST_POINTS, "1", "Most points of a contact; past 1, a row for each corner of faces that touch."
    )
    impact_tolerance: float = number(
        1e-4, 1e-12, 1.0, "m", "Gap at which a predicted impact is settled.", predictions=True
    )
    impact_iterations: int = number(
        64,
        1,
        100000,
        "1",
        "Most distance computations for one predicted impact; past it the pair is UNRESOLVED.",
        predictions=True,
    )
    position_tolerance: float = number(
        1e-3,
        0.0,
        1e3,
        "m",
        "An object this close to its predicted position needs no new prediction.",
        predictions=True,
    )
    orientation_tolerance: float = number(
        1e-3, 0.0, math.pi, "rad", "The same for its predicted orientation.", predictions=True
    )
    velocity_tolerance: float = number(1e-3, 0.0, 1e3, "m/s", "The same for its linear velocity.", predictions=True)
    angular_velocity_tolerance: float = number(
        1e-3, 0.0, 1e3, "rad/s", "The same for its angular velocity.", predictions=True
    )
    stale_after: float = number(0.5, 0.0, 1e6, "s", "Age of an object's last state from which answers are flagged.")
    stale_acceleration: float = number(
        1.0, 0.0, 1e4, "m/s^2", "How hard an object may accelerate while it is not heard of: widens its bounds."
    )
    uncertainty: bool = switch(
        True, "Whether it is told when and how likely pairs meet, where states declare it.", predictions=True
    )
    uncertainty_samples: int = number(
        1024, 16, 4096, "1", "Samples of what is uncertain, for each pair that may meet, where states declare it."
    )
    confidence: float = number(
        0.95, 0.5, 0.9999, "1", "At which the earliest and latest times are stated.", predictions=True
    )
    min_probability: float = number(
        0.01,
        1e-6,
        1.0,
        "1",
        "From which on pairs are told that would meet only because of what is uncertain.",
        predictions=True,
    )
    max_time_step: float = number(10.0, 1e-3, 1e9, "s", "A stamp that jumps by more is refused unless the next agrees.")
    threads: int = number(1, 1, 64, "1", "Threads of the kernels; the answers are the same bytes for any number.")
    budget_ms: float = number(
        NO_BUDGET, 0.05, NO_BUDGET, "ms", "Time for a step: the most urgent pairs first, the others are UNRESOLVED."
    )
    pairs_per_step: int = number(
        NO_LIMIT, 1, NO_LIMIT, "1", "Pairs for a step, the same way: answers that depend on no clock."
    )
    model_primitive: str = choice(_MODELS, "For boxes, capsules, cylinders and cones that choose none.")
    model_hull: str = choice(_MODELS, "The same for convex hulls.")
    model_mesh: str = choice(_MODELS, "The same for meshes; auto: the convex hull of concave ones.")
    model_compound: str = choice(_MODELS, "The same for objects of several shapes.")
    region_min: tuple[float, float, float] = vector(
        (-EVERYWHERE, -EVERYWHERE, -EVERYWHERE), EVERYWHERE, "m", "Objects wholly outside of this box are left out."
    )
    region_max: tuple[float, float, float] = vector(
        (EVERYWHERE, EVERYWHERE, EVERYWHERE), EVERYWHERE, "m", "The other corner of that box."
    )
    min_closing_speed: float = number(0.0, 0.0, 1e6, "m/s", "Predictions that close slower than this are left out.")
    ignore_separating: bool = switch(False, "Predictions of pairs whose origins move apart now are left out.")

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ProfileError(f"profile, name: expected a text, got {self.name!r}")
        for setting in self.fields():
            object.__setattr__(self, setting.name, setting.checked(getattr(self, setting.name)))
        for axis, low, high in zip("xyz", self.region_min, self.region_max, strict=True):
            if not low <= high:
                raise ProfileError(
                    f"region_min, region_max: expected a region with min <= max, got {low:g} > {high:g} along {axis}"
                )

    @classmethod
    @cache
    def fields(cls) -> tuple[Setting, ...]:
        """The settings in order, without the profile's name."""
        return tuple(settings_of(cls))

    @classmethod
    def changes_predictions(cls, changed: Collection[str]) -> bool:
        """Whether predictions rest on one of the `changed` settings: then all predictions are made anew."""
        return any(setting.predictions for setting in cls.fields() if setting.name in changed)

    @staticmethod
    def names() -> list[str]:
        """The profiles that come with the package."""
        return sorted(NAMED_PROFILES)

    @classmethod
    def named(cls, name: str) -> Profile:
        """A profile by its name, or from the YAML file of that path. Raises ProfileError."""
        return cls().switched(name)

    def switched(self, name: str) -> Profile:
        """The profile of that name, or of the YAML file of that path, on top of this one.

        Settings that it does not name stay as they are. Raises ProfileError.
        """
        changes = profile_changes(name)
        try:
            return self.replace(**changes)
        except (ProfileError, TypeError) as error:
            raise ProfileError(f"{Path(name)}: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON and YAML."""
        values = dataclasses.asdict(self)
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Profile:
        """From `to_dict`; missing settings take the defaults. Raises ProfileError for an unknown name."""
        known = {f.name for f in dataclasses.fields(cls)}
        for name in values:
            if name not in known:
                raise ProfileError(f"profile: expected settings among {', '.join(sorted(known))}, got {name!r}")
        return cls(**values)

    def replace(self, **changes: Any) -> Profile:
        """A copy with some settings changed. Raises ProfileError."""
        return self.from_dict({**self.to_dict(), **changes})

    def differences(self, other: Profile) -> dict[str, Any]:
        """The fields in which `other` is not the same, with its values; the name is one of them."""
        mine, theirs = self.to_dict(), other.to_dict()
        return {name: value for name, value in theirs.items() if value != mine[name]}
