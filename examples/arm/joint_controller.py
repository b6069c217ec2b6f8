"""A simulated controller of joints: from where they are through the points of a trajectory, on time.

As joint_trajectory_controller of ros2_control, without its tolerances.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

Array = NDArray[np.float64]


class JointController:
    """A trajectory takes the place of the one before; one without points lets the joints stand.

    names: of the joints. position: at the start. delay: s until a message counts. pace: of its clock.
    """

    def __init__(self, names: list[str], position: Array, delay: float = 0.02, pace: float = 1.0) -> None:
        self.names, self.delay, self.pace = list(names), delay, pace
        self._spline: Any = None
        self._end = self._begin = 0.0
        self._rest = np.array(position, float)
        self._waiting: list[tuple[float, Any]] = []

    def take(self, message: Any, now: float) -> None:
        """Take a JointTrajectory that arrived now (s)."""
        self._waiting.append((now + self.delay, message))

    def at(self, now: float) -> tuple[Array, Array]:
        """Positions and rates of the joints now (s)."""
        while self._waiting and self._waiting[0][0] <= now:
            self._use(*self._waiting.pop(0))
        return self._state(now)

    def _state(self, now: float) -> tuple[Array, Array]:
        if self._spline is None:
            return self._rest, np.zeros(len(self._rest))
        t = (now - self._begin) * self.pace
        if t >= self._end:
            return self._spline(self._end), np.zeros(len(self._rest))
        return self._spline(t), self._spline(t, 1) * self.pace

    def _use(self, now: float, message: Any) -> None:
        """Go from where the joints are through the points, by the polynomials of the lowest degree."""
        q, qd = self._state(now)
        self._rest, self._spline = q.copy(), None
        if not len(message.points):
            return
        order = [self.names.index(name) for name in message.joint_names]
        times, rows = [0.0], [[q[order], qd[order]]]
        for point in message.points:
            t = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
            row = [np.array(each) for each in (point.positions, point.velocities, point.accelerations) if len(each)]
            if t <= 0.0:
                times, rows = [], []  # a first point that is now
            times.append(t)
            rows.append(row)
        count = min(len(row) for row in rows[1:] or rows)
        full = np.tile(q, (len(times), 1))
        data = [[full[k]] + [np.zeros(len(q)) for _ in range(count - 1)] for k in range(len(times))]
        for k, row in enumerate(rows):
            for d in range(count):
                if d < len(row):
                    data[k][d][order] = row[d]
        self._spline = BPoly.from_derivatives(times, np.array(data))
        self._begin, self._end = now, times[-1]
