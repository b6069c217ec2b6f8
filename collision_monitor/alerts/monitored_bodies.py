"""The bodies of the monitor after a step, as the measures read them: one array for each quantity, by slot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from collision_monitor.alerts.measures import Array, Slots
from collision_monitor.impact.body_impact import Scratch, make_scratch
from collision_monitor.monitor.filters import bodies_in, is_bounded
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.motion.extrapolated import extrapolated
from collision_monitor.settings.profile import Profile


class MonitoredBodies:
    """The bodies at `now` (s after the monitor's origin), in the world frame; N slots.

    present (N,): the body is described and has a state, and lies in the region of interest. position, velocity, angular
    (N, 3): extrapolated from the last states. acceleration (N, 3): constant from now on, 0 for a body that brakes or
    goes along an arc; bending (N,): a bound on that of such a body until the horizon, else 0. radius (N,): of the
    sphere about the origin that holds the body (m); may be infinite. turning (N,): bound on the speed of its points
    about the origin until the horizon (m/s); speed (N,): on any now. doubt (N,): how far it may have left its path
    since its last state (m). stale (N,): the last state is too old, or there is none. off_plan: ids of those that left
    their last plan. scratch: memory for the kernels,
    of one thread; None: its own.
    """

    def __init__(
        self, roster: Roster, profile: Profile, now: float, scratch: Scratch | None = None,
        off_plan: Sequence[int] = (),
    ) -> None:  # fmt: skip
        b, top = roster.bodies, roster.top
        self.roster, self.profile, self.now, self.off_plan = roster, profile, now, off_plan
        self.scratch = make_scratch() if scratch is None else scratch
        there = extrapolated(b, np.arange(top), now, profile.horizon)
        age = there.age
        turning = there.turning
        self.radius: Array = b.motion["radius"][:top]
        self.position, self.velocity, self.angular = there.position, there.velocity, there.angular
        self.acceleration, self.bending = there.acceleration, there.bending
        self.doubt: Array = 0.5 * profile.stale_acceleration * age**2
        reach = np.where(turning > 0.0, b.spin_radius[:top], 0.0)
        self.turning: Array = turning * reach
        self.speed: Array = np.sqrt((self.velocity**2).sum(axis=1)) + self.turning
        self.stale: NDArray[np.bool_] = (age > profile.stale_after) | ~(b.seen[:top] | b.static[:top])
        self.present: NDArray[np.bool_] = b.used[:top] & (b.seen[:top] | b.static[:top])
        if is_bounded(profile.region_min, profile.region_max):
            low, high = profile.region_min, profile.region_max
            self.present &= bodies_in(b, top, now, low, high, profile.stale_acceleration)

    def speed_within(self, horizon: float) -> Array:
        """Return a bound (N,) on the speed (m/s) of any point until `horizon` (s) from now, as the states declare."""
        later = self.velocity + self.acceleration * horizon
        bound = np.sqrt((later**2).sum(axis=1)) + self.turning
        return np.asarray(np.maximum(self.speed, bound) + self.bending * horizon)

    def relative_acceleration(self, i: Slots, j: Slots) -> Array:
        """Bound (n,) on the acceleration (m/s^2) of bodies j relative to bodies i until the horizon."""
        constant = np.sqrt(((self.acceleration[j] - self.acceleration[i]) ** 2).sum(axis=1))
        return np.asarray(constant + self.bending[i] + self.bending[j])

    def velocity_at(self, slots: Slots, points: Array) -> Array:
        """Velocity (m/s) of points (n, 3) of these bodies."""
        return np.asarray(self.velocity[slots] + np.cross(self.angular[slots], points - self.position[slots]))
