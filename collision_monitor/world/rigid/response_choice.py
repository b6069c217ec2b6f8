"""What a user chooses of the response in a scene: restitution, gravity and method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

from collision_monitor.errors import InputError

METHODS: Final = ("impulse", "penalty", "damped", "stick")
"""Names of the methods, which world/rigid/responses.py implements."""

EARTH: Final = 9.81
"""Usual gravity (m/s²)."""

STRONGEST_GRAVITY: Final = 1000.0
"""Strongest gravity (m/s²); a stronger one would need steps shorter than these scenes take."""


@dataclass(frozen=True)
class ResponseOptions:
    """restitution from 0 to 1; gravity (m/s²) along -z; response: a name of METHODS. Raises InputError."""

    restitution: float
    gravity: float
    response: str = "impulse"

    def __post_init__(self) -> None:
        if not (isinstance(self.restitution, int | float) and 0.0 <= self.restitution <= 1.0):
            raise InputError(f"restitution: expected 0 (no bounce) to 1 (elastic), got {self.restitution!r}")
        strength = self.gravity if isinstance(self.gravity, int | float) else math.nan
        if not 0.0 <= strength <= STRONGEST_GRAVITY:
            raise InputError(f"gravity: expected 0 to {STRONGEST_GRAVITY:g} m/s², got {self.gravity!r}")
        if self.response not in METHODS:
            raise InputError(f"response: expected one of {', '.join(METHODS)}, got {self.response!r}")


class ResponseChoice(NamedTuple):
    """What a user chose of `ResponseOptions`; None: as usual in the scene."""

    restitution: float | None = None
    gravity: float | None = None
    response: str | None = None

    def options(self, usual_restitution: float) -> ResponseOptions:
        """The options, with this restitution, the gravity of the Earth and impulses as usual. Raises InputError."""
        restitution = usual_restitution if self.restitution is None else self.restitution
        return ResponseOptions(restitution, EARTH if self.gravity is None else self.gravity, self.response or "impulse")


AS_USUAL: Final = ResponseChoice()
