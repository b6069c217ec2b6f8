"""Less effort while the node cannot keep up: fewer samples for each probability, and one point for each contact."""

from __future__ import annotations

from typing import Final

from collision_monitor.settings.profile import Profile

TOO_MUCH: Final = 0.9
"""Load above which the effort is reduced. The load is the part of the last second that the steps took."""

LITTLE: Final = 0.2
"""Load below which the effort may grow again. One level costs at most four times as much as the next."""

PATIENCE: Final = 10
"""Looks in a row with little load until the effort grows by one level."""

LEVELS: Final = 2
"""The samples are divided by 4 and by 16."""

FEWEST_SAMPLES: Final = 64
"""With fewer samples a probability is off by more than 0.05."""


class Effort:
    """The level to which the effort is reduced: 0 for the profile as it was chosen, at most LEVELS."""

    def __init__(self) -> None:
        self.level = 0
        self._quiet = 0  # looks in a row with little load

    def look(self, load: float) -> bool:
        """Take the load of the last second; call this once a second. Returns whether the level has changed."""
        level = self.level
        self._quiet = self._quiet + 1 if load < LITTLE else 0
        if load > TOO_MUCH:
            self.level = min(level + 1, LEVELS)
        elif self._quiet >= PATIENCE:
            self.level, self._quiet = max(level - 1, 0), 0
        return self.level != level

    def reduced(self, profile: Profile) -> Profile:
        """Return the profile with the effort of this level. Its name says so, and each status repeats the name."""
        if not self.level:
            return profile
        samples = max(profile.uncertainty_samples >> 2 * self.level, FEWEST_SAMPLES)
        changes = {"uncertainty_samples": min(samples, profile.uncertainty_samples), "contact_points": 1}
        if not profile.differences(profile.replace(**changes)):
            return profile
        return profile.replace(name=f"{profile.name}, reduced to {changes['uncertainty_samples']} samples", **changes)
