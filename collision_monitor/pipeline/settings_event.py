"""Settings in a session: a ParameterEvent with the parameters that changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.codec import decode_parameter_event, encode_parameter_event

PROFILE: Final = "profile"
"""The parameter that names the profile; the field of `Profile` is called `name`."""

LIMIT: Final = "pairs_per_step"
"""The setting with which a replay does as much in a step as the clock allowed."""

NOW: Final = "now_ns"
"""Time of the answers to the states that follow, if it made a prediction UNRESOLVED. It is no field of `Profile`."""

RULES: Final = "rules"
"""The parameter with the rules of the alerts: in a session always as YAML text. It is no field of `Profile`."""

_PARAMETER: Final = {"name": PROFILE}
_FIELD: Final = {PROFILE: "name"}


@dataclass(frozen=True)
class SettingsChange:
    """Complete CDR messages that a session needs if settings change, in this order.

    settings: the ParameterEvent. shapes: an ObjectDescriptionArray of the objects that have another model from now on;
    None if there are none.
    """

    settings: bytes
    shapes: bytes | None


def encode_settings(stamp_ns: int, node: str, changes: Mapping[str, Any]) -> bytes:
    """Encode changed settings. changes: fields of a profile and their new values. Raises MessageError."""
    named = {_PARAMETER.get(field, field): value for field, value in changes.items()}
    return encode_parameter_event(stamp_ns, node, named)


def decode_settings(data: bytes) -> dict[str, Any]:
    """Return the changed settings: fields of a profile and their new values. Raises MessageError."""
    changed = decode_parameter_event(data).changed
    return {_FIELD.get(parameter, parameter): value for parameter, value in changed.items()}
