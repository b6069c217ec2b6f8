"""The player of a recording: where its time line is, and how it moves."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite


@dataclass
class Player:
    """Time (s) from 0 to `end`. speed: s of the recording for each second."""

    end: float
    time: float = 0.0
    speed: float = 1.0
    playing: bool = False

    def advance(self, elapsed: float) -> None:
        """Play for `elapsed` s of a clock. Stops at the end."""
        if self.playing:
            self.seek(self.time + elapsed * self.speed)
            self.playing = self.time < self.end

    def toggle(self) -> None:
        """Play or pause. At the end, play from the begin."""
        self.playing = not self.playing
        if self.playing and self.time >= self.end:
            self.time = 0.0

    def seek(self, time: float) -> None:
        """Go to a time (s). One that is no number changes nothing."""
        if isfinite(time):
            self.time = min(max(time, 0.0), self.end)
