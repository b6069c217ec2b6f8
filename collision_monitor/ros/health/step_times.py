"""Duration of the steps, age of their input, and number of steps per second."""

from __future__ import annotations

from collections import deque

import numpy as np

WINDOW = 1000
"""Number of steps for the 99th percentile."""

CLOCK_TOLERANCE = 1e-3
"""s: a stamp up to this far in the future is due to rounding and clock synchronisation, beyond it to another clock."""


class StepTimes:
    """Times of the last steps, in ns: the steady clock for durations and rate, ROS time for the latency.

    latency (s): age of the states of the last step when it ended; NaN: not known. longest (s): duration of the longest
    step so far; NaN before the first one. longest_step: its number, from 1.
    """

    def __init__(self, longest_latency: float) -> None:
        """longest_latency (s): beyond it the stamps come from another clock, not from a slow network."""
        self.longest_latency = longest_latency
        self._durations = np.zeros(WINDOW)
        self._steps = 0
        self._ends: deque[int] = deque()
        self.latency = float("nan")
        self.longest = float("nan")
        self.longest_step = 0

    def __str__(self) -> str:
        """Return the number of steps and the longest one for a person."""
        if not self._steps:
            return "no step"
        return f"{self._steps} steps, the longest took {self.longest * 1e3:.1f} ms (step {self.longest_step})"

    def add(self, began: int, ended: int, latency: int) -> None:
        """Add one step."""
        duration = (ended - began) * 1e-9
        self._durations[self._steps % WINDOW] = duration
        self._steps += 1
        if not duration <= self.longest:
            self.longest, self.longest_step = duration, self._steps
        self._ends.append(ended)
        self._forget(ended)
        seconds = latency * 1e-9
        agree = -CLOCK_TOLERANCE <= seconds <= self.longest_latency
        self.latency = max(seconds, 0.0) if agree else float("nan")

    def summary(self, now: int) -> dict[str, float]:
        """Return the timing fields of MonitorStatus, in s and Hz; NaN before the first step."""
        self._forget(now)
        known = self._durations[: min(self._steps, WINDOW)]
        return {
            "step_duration": float(self._durations[(self._steps - 1) % WINDOW]) if self._steps else float("nan"),
            "step_duration_p99": float(np.percentile(known, 99)) if self._steps else float("nan"),
            "latency": self.latency,
            "rate": float(len(self._ends)),
        }

    def load(self, now: int) -> float:
        """Return the part of the last second that the steps took, 0 to 1."""
        self._forget(now)
        last = np.arange(self._steps - min(len(self._ends), WINDOW), self._steps) % WINDOW
        return min(1.0, float(self._durations[last].sum()))

    def _forget(self, now: int) -> None:
        while self._ends and now - self._ends[0] > 1_000_000_000:
            self._ends.popleft()
