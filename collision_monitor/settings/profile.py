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
from collision_monitor.settings.by_name import classes_of
from collision_monitor.settings.named_profiles import NAMED_PROFILES, profile_changes
from collision_monitor.settings.setting import (
    EVERYWHERE,
    Setting,
    by_name,
    choice,
    number_setting,
    settings_of,
    switch,
    vector_setting,
)

NO_BUDGET: Final = 1e6
"""ms, a quarter of an hour: with this value a step has no time limit and does not read the clock."""

MOST_NAME: Final = 4096
"""Longest name of a profile (characters), that of a path on Linux. The name may be a path; each status repeats it."""

NO_LIMIT: Final = 1_000_000_000
"""Pairs in a step: more than fit into memory, so no limit."""

_BEFORE: Final[dict[str, Any]] = {"adaptive_tolerances": False}
"""What a program did that did not have the setting yet, where the default is another. Its sessions do not name it."""

_MODELS: Final = [model.name.lower() for model in Model if model is not Model.EXACT]


@dataclass(frozen=True)
class Profile:
    """The settings of a monitor, immutable. Raises ProfileError for a wrong value or a wrong combination of values.

    >>> Profile.named("fast").replace(horizon=1.0).horizon
    1.0
    """

    name: str = "balanced"
    horizon: float = number_setting(
        2.0,
        0.0,
        1e6,
        "s",
        "Time ahead for which collisions are predicted. With 0, only contacts are reported.",
        predictions=True,
    )
    horizon_by_name: str = by_name(
        0.0,
        1e6,
        "s",
        "Shorter horizons of classes of objects, such as 'pallet*=1, box_?=0.5'. That of a pair is the shorter one.",
        predictions=True,
    )
    rate_by_name: str = by_name(
        1e-3,
        1e6,
        "Hz",
        "Largest rate at which states of classes of objects are used, such as 'pallet*=2'. The others are left out.",
    )
    contact_margin: float = number_setting(
        0.0, 0.0, 1e6, "m", "Gap up to which a pair counts as touching.", predictions=True
    )
    contact_points: int = number_setting(
        1,
        1,
        MOST_POINTS,
        "1",
        "Largest number of points of one contact. Above 1, touching faces have a row for each corner.",
    )
    contact_details: bool = switch(
        True,
        "Whether to compute witness points, features and closing speeds of contacts. Without, they are NaN or UNKNOWN.",
    )
    distance_tolerance: float = number_setting(
        0.0,
        0.0,
        1.0,
        "m",
        "Largest error of the distance of meshes that overlap, and of a contact that is not computed anew. 0: none.",
    )
    impact_tolerance: float = number_setting(
        1e-4,
        1e-12,
        1.0,
        "m",
        "Largest gap that may remain at a predicted impact. A smaller one gives tighter times and takes longer.",
        predictions=True,
    )
    mesh_impact_tolerance: float = number_setting(
        0.0,
        0.0,
        1e3,
        "m",
        "Gap up to which a predicted impact of a mesh is only bounded, until it is due. With 0, impact_tolerance.",
        predictions=True,
    )
    impact_iterations: int = number_setting(
        64,
        1,
        100000,
        "1",
        "Largest number of distance computations for one predicted impact. A pair that needs more is UNRESOLVED.",
        predictions=True,
    )
    position_tolerance: float = number_setting(
        1e-3,
        0.0,
        1e3,
        "m",
        "Largest distance from its predicted position at which an object keeps its predictions.",
        predictions=True,
    )
    orientation_tolerance: float = number_setting(
        1e-3,
        0.0,
        math.pi,
        "rad",
        "Largest angle from its predicted orientation at which an object keeps its predictions.",
        predictions=True,
    )
    velocity_tolerance: float = number_setting(
        1e-3,
        0.0,
        1e3,
        "m/s",
        "Largest difference from its predicted linear velocity at which an object keeps its predictions.",
        predictions=True,
    )
    angular_velocity_tolerance: float = number_setting(
        1e-3,
        0.0,
        1e3,
        "rad/s",
        "Largest difference from its predicted angular velocity at which an object keeps its predictions.",
        predictions=True,
    )
    adaptive_tolerances: bool = switch(
        True,
        "Whether the tolerances of an object follow how far it leaves its motion; the set ones are then the widest.",
        predictions=True,
    )
    stale_after: float = number_setting(
        0.5,
        0.0,
        1e6,
        "s",
        "Age of the last state of an object beyond which it is stale and its predictions are flagged.",
    )
    stale_acceleration: float = number_setting(
        1.0,
        0.0,
        1e4,
        "m/s^2",
        "Acceleration that an object may have had since its last state. The bounds of its answers widen by it.",
    )
    uncertainty: bool = switch(
        True, "Whether to compute when and how likely pairs meet, if states declare an uncertainty.", predictions=True
    )
    uncertainty_samples: int = number_setting(
        1024, 16, 4096, "1", "Number of samples of the declared uncertainty for each pair that may meet."
    )
    confidence: float = number_setting(
        0.95,
        0.5,
        0.9999,
        "1",
        "Confidence level of the earliest and latest time of a collision, if states declare an uncertainty.",
        predictions=True,
    )
    min_probability: float = number_setting(
        0.01,
        1e-6,
        1.0,
        "1",
        "Smallest probability at which a pair is reported that may meet only because of its uncertainty.",
        predictions=True,
    )
    max_time_step: float = number_setting(
        10.0,
        1e-3,
        1e9,
        "s",
        "Largest jump of a stamp. A stamp that jumps further is refused unless the next message confirms it.",
    )
    threads: int = number_setting(
        1, 1, 64, "1", "Number of threads of a step. The answers are the same bytes for any number."
    )
    budget_ms: float = number_setting(
        NO_BUDGET,
        0.05,
        NO_BUDGET,
        "ms",
        "Time that a step may take. The most urgent pairs come first, and the others are UNRESOLVED.",
    )
    pairs_per_step: int = number_setting(
        NO_LIMIT,
        1,
        NO_LIMIT,
        "1",
        "Largest number of pairs that a step examines, the most urgent first. It depends on no clock.",
    )
    model_primitive: str = choice(
        _MODELS, "Model that represents boxes, capsules, cylinders and cones, if their description chooses none."
    )
    model_hull: str = choice(_MODELS, "Model that represents convex hulls, if their description chooses none.")
    model_mesh: str = choice(
        _MODELS,
        "Model that represents meshes, if their description chooses none. With auto, they are exact.",
    )
    model_compound: str = choice(
        _MODELS, "Model that represents objects of several shapes, if their description chooses none."
    )
    model_error: float = number_setting(
        1e6,
        0.0,
        1e6,
        "m",
        "Largest distance by which a model that these settings choose may exceed its object, which else is exact.",
    )
    region_min: tuple[float, float, float] = vector_setting(
        (-EVERYWHERE, -EVERYWHERE, -EVERYWHERE),
        EVERYWHERE,
        "m",
        "Lower corner of the region of interest. Objects that are wholly outside the region are ignored.",
    )
    region_max: tuple[float, float, float] = vector_setting(
        (EVERYWHERE, EVERYWHERE, EVERYWHERE),
        EVERYWHERE,
        "m",
        "Upper corner of the region of interest. Objects that are wholly outside the region are ignored.",
    )
    min_closing_speed: float = number_setting(
        0.0,
        0.0,
        1e6,
        "m/s",
        "Smallest closing speed of a reported prediction. Predictions with an unknown speed are reported.",
    )
    ignore_separating: bool = switch(
        False, "Whether to leave out predictions of pairs with origins that move apart now."
    )

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ProfileError(f"profile, name: expected a text, got {self.name!r}")
        if len(self.name) > MOST_NAME:
            raise ProfileError(f"profile, name: expected at most {MOST_NAME} characters, got {len(self.name)}")
        for setting in self.fields():
            object.__setattr__(self, setting.name, setting.checked(getattr(self, setting.name)))
        for pattern, value in classes_of("horizon_by_name", self.horizon_by_name):
            if value > self.horizon:
                raise ProfileError(
                    f"horizon_by_name, {pattern}: expected at most the horizon, {self.horizon:g} s, got {value:g}; "
                    "raise the horizon, and name the classes with a shorter one"
                )
        if self.contact_points > 1 and not self.contact_details:
            raise ProfileError(
                f"contact_points, contact_details: expected contact_points 1 or contact_details true, got "
                f"{self.contact_points} and false; the points of a contact are details"
            )
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
        """Return the profile of `to_dict`, with values for missing settings. Raises ProfileError for unknown ones.

        These are the defaults, or for sessions that are older than a setting what the program did then.
        """
        if not isinstance(values, Mapping):
            raise ProfileError(f"profile: expected settings by name, got {values!r:.100}")
        known = {f.name for f in dataclasses.fields(cls)}
        for name in values:
            if name not in known:
                raise ProfileError(f"profile: expected settings among {', '.join(sorted(known))}, got {name!r}")
        return cls(**(_BEFORE | dict(values)))

    def replace(self, **changes: Any) -> Profile:
        """Return a copy with some settings changed. Raises ProfileError."""
        return self.from_dict({**self.to_dict(), **changes})

    def differences(self, other: Profile) -> dict[str, Any]:
        """Return the fields that differ in `other`, with its values; the name counts as a field."""
        mine, theirs = self.to_dict(), other.to_dict()
        return {name: value for name, value in theirs.items() if value != mine[name]}
