"""The settings that trade speed for accuracy, each with its unit, range and description.

The fields of `Profile` define the ROS parameters, the profiles in YAML files and the settings in recorded sessions.
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
"""ms, a quarter of an hour: with this value a step has no time limit and does not read the clock."""

MOST_NAME: Final = 4096
"""Longest name of a profile (characters), that of a path on Linux. The name may be a path; each status repeats it."""

NO_LIMIT: Final = 1_000_000_000
"""Pairs in a step: more than fit into memory, so no limit."""

_MODELS: Final = [model.name.lower() for model in Model if model is not Model.EXACT]


@dataclass(frozen=True)
class Profile:
    """The settings of a monitor, immutable. Raises ProfileError for a wrong value or a wrong combination of values."""

    name: str = "balanced"
    horizon: float = number(
        2.0, 0.0, 1e6, "s", "How far ahead collisions are predicted; 0: contacts only.", predictions=True
    )
    contact_margin: float = number(
        0.0, 0.0, 1e6, "m", "Pairs up to this far apart count as touching.", predictions=True
    )
    contact_points: int = number(
        1, 1, MOST_POINTS, "1", "Largest number of points of a contact; above 1, touching faces have a row per corner."
    )
    impact_tolerance: float = number(
        1e-4, 1e-12, 1.0, "m", "Gap at which a predicted impact is settled.", predictions=True
    )
    impact_iterations: int = number(
        64,
        1,
        100000,
        "1",
        "Largest number of distance computations for one predicted impact; beyond it the pair is UNRESOLVED.",
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
        1e-3,
        0.0,
        math.pi,
        "rad",
        "An object this close to its predicted orientation needs no new prediction.",
        predictions=True,
    )
    velocity_tolerance: float = number(
        1e-3,
        0.0,
        1e3,
        "m/s",
        "An object this close to its predicted linear velocity needs no new prediction.",
        predictions=True,
    )
    angular_velocity_tolerance: float = number(
        1e-3,
        0.0,
        1e3,
        "rad/s",
        "An object this close to its predicted angular velocity needs no new prediction.",
        predictions=True,
    )
    stale_after: float = number(
        0.5, 0.0, 1e6, "s", "Age of an object's last state beyond which its predictions are flagged as stale."
    )
    stale_acceleration: float = number(
        1.0, 0.0, 1e4, "m/s^2", "Acceleration that an object may have since its last state; widens its bounds."
    )
    uncertainty: bool = switch(
        True, "Whether to compute when and how likely pairs meet, if states declare an uncertainty.", predictions=True
    )
    uncertainty_samples: int = number(
        1024, 16, 4096, "1", "Samples of the declared uncertainty, for each pair that may meet."
    )
    confidence: float = number(0.95, 0.5, 0.9999, "1", "Confidence of the earliest and latest times.", predictions=True)
    min_probability: float = number(
        0.01,
        1e-6,
        1.0,
        "1",
        "Smallest probability at which a pair is reported that may meet only because of its uncertainty.",
        predictions=True,
    )
    max_time_step: float = number(
        10.0, 1e-3, 1e9, "s", "A stamp that jumps by more is refused unless the next message confirms it."
    )
    threads: int = number(1, 1, 64, "1", "Threads of the kernels; the answers are the same bytes for any number.")
    budget_ms: float = number(
        NO_BUDGET, 0.05, NO_BUDGET, "ms", "Time for a step: the most urgent pairs first; the others are UNRESOLVED."
    )
    pairs_per_step: int = number(
        NO_LIMIT, 1, NO_LIMIT, "1", "Largest number of pairs examined in a step; a limit that depends on no clock."
    )
    model_primitive: str = choice(_MODELS, "Model of boxes, capsules, cylinders and cones without one of their own.")
    model_hull: str = choice(_MODELS, "Model of convex hulls without one of their own.")
    model_mesh: str = choice(_MODELS, "Model of meshes without one of their own; auto: exact.")
    model_compound: str = choice(_MODELS, "Model of objects of several shapes without one of their own.")
    region_min: tuple[float, float, float] = vector(
        (-EVERYWHERE, -EVERYWHERE, -EVERYWHERE),
        EVERYWHERE,
        "m",
        "Lower corner of the region of interest; objects wholly outside of it are ignored.",
    )
    region_max: tuple[float, float, float] = vector(
        (EVERYWHERE, EVERYWHERE, EVERYWHERE),
        EVERYWHERE,
        "m",
        "Upper corner of the region of interest; objects wholly outside of it are ignored.",
    )
    min_closing_speed: float = number(0.0, 0.0, 1e6, "m/s", "Predictions with a lower closing speed are left out.")
    ignore_separating: bool = switch(False, "Leave out predictions of pairs with origins that move apart now.")

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ProfileError(f"profile, name: expected a text, got {self.name!r}")
        if len(self.name) > MOST_NAME:
            raise ProfileError(f"profile, name: expected at most {MOST_NAME} characters, got {len(self.name)}")
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
        """Return the settings in order, without the profile's name."""
        return tuple(settings_of(cls))

    @classmethod
    def changes_predictions(cls, changed: Collection[str]) -> bool:
        """Whether predictions depend on one of the `changed` settings, so that all of them are computed anew."""
        return any(setting.predictions for setting in cls.fields() if setting.name in changed)

    @staticmethod
    def names() -> list[str]:
        """Return the names of the profiles that come with the package, sorted."""
        return sorted(NAMED_PROFILES)

    @classmethod
    def named(cls, name: str) -> Profile:
        """Return a profile by its name or by the path of its YAML file. Raises ProfileError."""
        return cls().switched(name)

    def switched(self, name: str) -> Profile:
        """Return this profile with the settings of another one, given by its name or by the path of its YAML file.

        Settings that the other one does not name keep their values. Raises ProfileError.
        """
        changes = profile_changes(name)
        try:
            return self.replace(**changes)
        except (ProfileError, TypeError) as error:
            raise ProfileError(f"{Path(name)}: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values by name, for JSON and YAML."""
        values = dataclasses.asdict(self)
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Profile:
        """Return the profile of `to_dict`, with defaults for missing settings. Raises ProfileError for unknown ones."""
        known = {f.name for f in dataclasses.fields(cls)}
        for name in values:
            if name not in known:
                raise ProfileError(f"profile: expected settings among {', '.join(sorted(known))}, got {name!r}")
        return cls(**values)

    def replace(self, **changes: Any) -> Profile:
        """Return a copy with some settings changed. Raises ProfileError."""
        return self.from_dict({**self.to_dict(), **changes})

    def differences(self, other: Profile) -> dict[str, Any]:
        """Return the fields that differ in `other`, with its values; the name counts as a field."""
        mine, theirs = self.to_dict(), other.to_dict()
        return {name: value for name, value in theirs.items() if value != mine[name]}
