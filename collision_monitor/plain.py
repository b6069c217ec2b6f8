"""The slow obvious monitor: every prediction is computed anew at every step. What the event list is tested against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.monitor import Monitor
from collision_monitor.profiles import Profile


class PlainMonitor(Monitor):
    """A Monitor that trusts no earlier prediction and allows no body to be off its stated motion."""

    def __init__(self, profile: str | Profile = "balanced") -> None:
        super().__init__(profile)
        self.profile = self.profile.replace(
            name="plain",
            position_tolerance=0.0,
            orientation_tolerance=0.0,
            velocity_tolerance=0.0,
            angular_velocity_tolerance=0.0,
        )

    def _moved(self, now: float) -> NDArray[np.int32]:
        bodies, top = self._bodies, self._top
        return np.flatnonzero(bodies.used[:top] & bodies.seen[:top] & ~bodies.static[:top]).astype(np.int32)
