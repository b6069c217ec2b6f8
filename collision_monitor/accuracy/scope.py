"""Settings of a profile that say which answers a user wants; the others trade accuracy for speed."""

from __future__ import annotations

from typing import Any, Final

from collision_monitor.settings.by_name import classes_of
from collision_monitor.settings.profile import Profile

_COMPARED: Final = ("horizon", "horizon_by_name", "contact_margin", "region_min", "region_max")
_FILTERS: Final = ("min_closing_speed", "ignore_separating")
"""They only remove answers that are computed anyway, so that every profile is measured without them."""
_OTHERS: Final = (
    "contact_points",
    "contact_details",
    "rate_by_name",
    "stale_after",
    "stale_acceleration",
    "confidence",
    "min_probability",
    "max_time_step",
    "threads",
)


def compared(profile: Profile) -> dict[str, Any]:
    """Return the settings that the exact answers share with a profile which is compared with them."""
    return {name: getattr(profile, name) for name in _COMPARED}


def wanted(profile: Profile) -> dict[str, Any]:
    """Return all settings that a search for a better profile keeps."""
    return {name: getattr(profile, name) for name in (*_COMPARED, *_FILTERS, *_OTHERS)}


def unfiltered(profile: Profile) -> Profile:
    """Return the profile without its filters."""
    return profile.replace(min_closing_speed=0.0, ignore_separating=False)


def with_horizon(profile: Profile, horizon: float) -> dict[str, Any]:
    """Return the settings that shorten the horizon (s) of a profile, also that of its classes of objects."""
    classes = classes_of("horizon_by_name", profile.horizon_by_name)
    if all(value <= horizon for _, value in classes):
        return {"horizon": horizon}
    shorter = ", ".join(f"{pattern}={min(value, horizon):g}" for pattern, value in classes)
    return {"horizon": horizon, "horizon_by_name": shorter}
