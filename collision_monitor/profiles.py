"""The settings that trade speed for accuracy, each with its unit, range and meaning.

ROS parameters, the command line's help and the recorded sessions are all generated from these fields.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from collision_monitor.errors import ProfileError


def _setting(default: float | int, minimum: float | int, maximum: float | int, unit: str, description: str) -> Any:
    metadata = {"minimum": minimum, "maximum": maximum, "unit": unit, "description": description}
    return field(default=default, metadata=metadata)


_KINDS: dict[type, str] = {int: "a whole number", float: "a number"}


def _in(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


@dataclass(frozen=True)
class Setting:
    """One field of a profile, as parameter declarations and help texts need it."""

    name: str
    type: type
    default: float | int
    minimum: float | int
    maximum: float | int
    unit: str
    description: str


@dataclass(frozen=True)
class Profile:
    """How far the monitor looks and how exact it is. Raises ProfileError for a value out of range."""

    name: str = "balanced"
    horizon: float = _setting(2.0, 0.0, 1e6, "s", "How far ahead collisions are predicted; 0: contacts only.")
    contact_margin: float = _setting(0.0, 0.0, 1e6, "m", "Pairs up to this far apart count as touching.")
    impact_tolerance: float = _setting(1e-4, 1e-12, 1.0, "m", "Gap at which a predicted impact is settled.")
    impact_iterations: int = _setting(
        64, 1, 100000, "1", "Most distance computations for one predicted impact; past it the pair is UNRESOLVED."
    )
    position_tolerance: float = _setting(
        1e-3, 0.0, 1e3, "m", "An object this close to its predicted position needs no new prediction."
    )
    orientation_tolerance: float = _setting(1e-3, 0.0, math.pi, "rad", "The same for its predicted orientation.")
    velocity_tolerance: float = _setting(1e-3, 0.0, 1e3, "m/s", "The same for its linear velocity.")
    angular_velocity_tolerance: float = _setting(1e-3, 0.0, 1e3, "rad/s", "The same for its angular velocity.")
    stale_after: float = _setting(0.5, 0.0, 1e6, "s", "Age of an object's last state from which answers are flagged.")
    stale_acceleration: float = _setting(
        1.0, 0.0, 1e4, "m/s^2", "How hard an object may accelerate while it is not heard of: widens its bounds."
    )
    uncertainty_samples: int = _setting(
        256, 16, 4096, "1", "Samples of what is uncertain, for each pair that may meet, where states declare it."
    )
    confidence: float = _setting(0.95, 0.5, 0.9999, "1", "At which the earliest and latest times are stated.")
    min_probability: float = _setting(
        0.01, 1e-6, 1.0, "1", "From which on pairs are told that would meet only because of what is uncertain."
    )
    max_time_step: float = _setting(
        10.0, 1e-3, 1e9, "s", "A stamp that jumps by more is refused unless the next agrees."
    )
    threads: int = _setting(1, 1, 64, "1", "Threads of the kernels; the answers are the same bytes for any number.")

    def __post_init__(self) -> None:
        for setting in self.fields():
            value = getattr(self, setting.name)
            wanted = (int,) if setting.type is int else (int, float)
            if isinstance(value, bool) or not isinstance(value, wanted):
                raise ProfileError(f"{setting.name}: expected {_KINDS[setting.type]}{_in(setting.unit)}, got {value!r}")
            if not setting.minimum <= value <= setting.maximum:
                wanted_range = f"{setting.minimum:g} to {setting.maximum:g}{_in(setting.unit)}"
                raise ProfileError(f"{setting.name}: expected {wanted_range}, got {value:g}")
            object.__setattr__(self, setting.name, setting.type(value))

    @classmethod
    def fields(cls) -> list[Setting]:
        """The settings in order, without the profile's name."""
        return [
            Setting(name=f.name, type=type(f.default), default=f.default, **f.metadata)  # type: ignore[arg-type]
            for f in dataclasses.fields(cls)
            if f.metadata
        ]

    @staticmethod
    def names() -> list[str]:
        """The profiles that come with the package."""
        return sorted(_NAMED)

    @classmethod
    def named(cls, name: str) -> Profile:
        """A profile by its name. Raises ProfileError."""
        if name not in _NAMED:
            raise ProfileError(f"profile: expected one of {', '.join(cls.names())}, got {name!r}")
        return cls(name=name, **_NAMED[name])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON and YAML."""
        return dataclasses.asdict(self)

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


_EXACT_MOTION = {
    "position_tolerance": 1e-9,
    "orientation_tolerance": 1e-9,
    "velocity_tolerance": 1e-9,
    "angular_velocity_tolerance": 1e-9,
}
_NAMED: dict[str, dict[str, Any]] = {
    "balanced": {},
    "fast": {
        "impact_tolerance": 1e-3,
        "uncertainty_samples": 64,
        "position_tolerance": 1e-2,
        "orientation_tolerance": 1e-2,
        "velocity_tolerance": 2e-2,
        "angular_velocity_tolerance": 2e-2,
    },
    "exact": {"impact_tolerance": 1e-6, "impact_iterations": 256, "uncertainty_samples": 1024, **_EXACT_MOTION},
}
