"""What a node does that cannot keep up: more threads, which change no answer; then fewer samples and contact points."""

from __future__ import annotations

import os
from typing import Final

from collision_monitor.settings.profile import MOST_NAME, Profile

TOO_MUCH: Final = 0.9
"""Load above which the effort is reduced. The load is the part of the last second that the steps took."""

BEHIND: Final = 0.6
"""The same if states were left out in that second: the rest of it went to reading and recording messages."""

LITTLE: Final = 0.2
"""Load below which the effort may grow again. One level costs at most four times as much as the next."""

PATIENCE: Final = 10
"""Looks in a row with little load until the effort grows by one level."""

LEVELS: Final = 2
"""The samples are divided by 4 and by 16, after a level with more threads where there are cores."""

LONG: Final = 0.5
"""Mean duration of a step (s) above which more threads are not enough: the first two levels come at once."""

MOST_THREADS: Final = 4
"""Threads of the first level, at most: the others stay free for other programs."""

LONGEST_WORDS: Final = 64
"""Room for the words that follow the name of a profile (characters)."""

FEWEST_SAMPLES: Final = 64
"""With fewer samples a probability is off by more than 0.05."""


class Effort:
    """The level of what is done to keep up: 0 for the profile as it was chosen, at most LEVELS, or one more with cores.

    cores: number of cores that this process may use; None: ask the system.
    """

    def __init__(self, cores: int | None = None) -> None:
        self.level = 0
        self._threads = min(cores or len(os.sched_getaffinity(0)), MOST_THREADS)
        self._most = LEVELS + (self._threads > 1)
        self._quiet = 0  # looks in a row with little load

    def look(self, load: float, step: float = 0.0, *, is_behind: bool = False) -> bool:
        """Take the load of the last second; call this once a second. Returns whether the level has changed.

        step: mean duration of a step (s). is_behind: whether states were left out in that second.
        """
        level = self.level
        self._quiet = self._quiet + 1 if load < LITTLE else 0
        if load > (BEHIND if is_behind else TOO_MUCH):
            self.level = min(level + (2 if level == 0 and step > LONG else 1), self._most)
        elif self._quiet >= PATIENCE:
            self.level, self._quiet = max(level - 1, 0), 0
        return self.level != level

    def reduced(self, profile: Profile) -> Profile:
        """Return the profile of this level. Its name says what differs, and each status repeats the name."""
        if not self.level:
            return profile
        name, faster, divisions = profile.name[: MOST_NAME - LONGEST_WORDS], profile, self.level
        if self._threads > profile.threads:
            name = f"{name}, on {self._threads} threads"
            faster, divisions = profile.replace(name=name, threads=self._threads), self.level - 1
        if not divisions:
            return faster
        samples = max(profile.uncertainty_samples >> 2 * min(divisions, LEVELS), FEWEST_SAMPLES)
        changes = {"uncertainty_samples": min(samples, profile.uncertainty_samples), "contact_points": 1}
        if not profile.differences(profile.replace(**changes)):
            return faster
        return faster.replace(name=f"{name}, reduced to {changes['uncertainty_samples']} samples", **changes)
