"""The worst of the steps between two reports, because a report that looks at the last step only misses the others."""

from __future__ import annotations

from collision_monitor.monitor.result import StepStatus


class StepPeaks:
    """Largest numbers of deferred and of unresolved pairs in one step."""

    def __init__(self) -> None:
        self._deferred = self._unresolved = 0

    def add(self, status: StepStatus) -> None:
        """Take a step into account."""
        self._deferred = max(self._deferred, status.deferred)
        self._unresolved = max(self._unresolved, status.unresolved)

    def take(self) -> tuple[int, int]:
        """Return the largest numbers of deferred and of unresolved pairs since the last call."""
        peaks = self._deferred, self._unresolved
        self._deferred = self._unresolved = 0
        return peaks
