"""The profiles that come with the package, and custom profiles in YAML files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from collision_monitor.errors import InputError, ProfileError
from collision_monitor.settings.parameter_file import (
    PARAMETER_SECTION,
    is_other_parameter,
    reaches_monitor,
    sections_of,
)
from collision_monitor.settings.yaml_file import read_yaml

BASED_ON: Final = "based_on"
"""Key in the file of a custom profile: the named profile that it starts from."""

_PROFILE: Final = "profile"
"""The same in a parameter file of the node, which may serve as a profile: the other parameters are left out."""

_VALUES: Final = 5000
"""Values in the file of a profile. There are 60 settings, and a running monitor is silent while it reads the file."""

_TOLERANCES: Final = ("position_tolerance", "orientation_tolerance", "velocity_tolerance", "angular_velocity_tolerance")

_EVERYTHING_EXACT: Final[dict[str, Any]] = {
    "distance_tolerance": 0.0,
    "mesh_impact_tolerance": 0.0,
    "model_mesh": "auto",
    "model_error": 1e6,
}

NAMED_PROFILES: Final[dict[str, dict[str, Any]]] = {
    "balanced": {
        "impact_tolerance": 1e-4,
        "impact_iterations": 64,
        "uncertainty": True,
        "uncertainty_samples": 1024,
        **dict.fromkeys(_TOLERANCES, 1e-3),
        "adaptive_tolerances": True,  # wider tubes than needed leave near misses open, which every step examines
        **_EVERYTHING_EXACT,
    },
    "fast": {
        "impact_tolerance": 1e-4,
        "impact_iterations": 64,
        "uncertainty": False,  # sampling takes by far the longest of all parts of a step
        "uncertainty_samples": 128,
        "position_tolerance": 5e-2,
        "orientation_tolerance": 5e-2,
        "velocity_tolerance": 0.2,
        "angular_velocity_tolerance": 0.2,
        "adaptive_tolerances": True,
        "distance_tolerance": 5e-2,
        "mesh_impact_tolerance": 0.1,
        "model_mesh": "auto",  # by its tree a mesh is faster than its hull
        "model_error": 1e6,
    },
    "exact": {
        "impact_tolerance": 1e-6,
        "impact_iterations": 256,
        "uncertainty": True,
        "uncertainty_samples": 2048,
        **dict.fromkeys(_TOLERANCES, 1e-9),
        "adaptive_tolerances": False,
        **_EVERYTHING_EXACT,
    },
}
"""All profiles name the same settings, so that a switch leaves no setting of the previous profile."""


def profile_changes(name: str) -> dict[str, Any]:
    """Return the settings that a profile names, given its name or the path of its YAML file. Raises ProfileError.

    It does not check the values of a file.
    """
    if isinstance(name, str) and name in NAMED_PROFILES:
        return {"name": name, **NAMED_PROFILES[name]}
    if isinstance(name, str) and Path(name).suffix in (".yaml", ".yml"):
        return _read(Path(name))
    raise ProfileError(f"profile: expected one of {_names()}, or a .yaml file, got {name!r}")


def _read(path: Path) -> dict[str, Any]:
    try:
        content = read_yaml(path, nodes=_VALUES)
    except InputError as error:
        raise ProfileError(f"profile {error}") from None
    if not isinstance(content, dict) or not content:
        raise ProfileError(f"profile {path}: expected settings, as `horizon: 3.0`, got {content!r:.80}")
    sections = sections_of(content)
    key = _PROFILE if sections else BASED_ON
    if sections:
        content = _of_parameters(path, sections)
    base = content.pop(key, "balanced")
    if not isinstance(base, str) or base not in NAMED_PROFILES:
        raise ProfileError(f"profile {path}, {key}: expected one of {_names()}, got {base!r:.80}")
    return {**NAMED_PROFILES[base], "name": path.stem, **content}


def _of_parameters(path: Path, sections: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the settings and the profile in a parameter file of the node. Raises ProfileError."""
    mine = {name: values for name, values in sections.items() if reaches_monitor(name)}
    if not mine:
        raise ProfileError(
            f"profile {path}: expected settings, or parameters under {PARAMETER_SECTION}, got those of "
            f"{', '.join(sections):.100}"
        )
    return {
        name: value for values in mine.values() for name, value in values.items() if not is_other_parameter(str(name))
    }


def _names() -> str:
    return ", ".join(sorted(NAMED_PROFILES))
