"""Adaptive tolerances: the part of its tolerances that a body uses, by how it left its motions before.

A wide tube saves predictions of a body that is noisy, and leaves near misses UNRESOLVED. So a body that keeps its
motion, turns or accelerates gets the narrowest one.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.motion import position_at, twist_at

NARROWEST: Final = 2.0**-26
ONCE: Final = 2.0**-25
ROOM: Final = 2.0
"""Width: the part of the tolerances that a body uses. Smallest value; that of a body which left
its motion within FUTILE_STEPS steps once; and its ratio to the last deviation, if that was within the tolerances,
because the next deviation of a noisy state may be larger."""

FUTILE_STEPS: Final = 4.0
PATIENCE: Final = 512.0
"""A body with half of the tolerances or more that leaves its motion within FUTILE_STEPS steps turns or accelerates. Its
tolerances are NARROWEST for its next PATIENCE motions; its width is minus the number of those that are left. A body
with the NARROWEST tolerances has noise only if it leaves its motion so soon twice in a row; one that bounces has none.
"""

FEW_BODIES: Final = 32
"""Up to this number of moving bodies keep the NARROWEST adaptive tolerances, because to predict them anew takes less
time than to examine the pairs that wider tolerances leave UNRESOLVED."""

RESTLESS: Final = 0.9
AVERAGED_STEPS: Final = 16
REST: Final = 512
"""If this share of the moving bodies starts anew, on average over about so many steps, all bodies keep the NARROWEST
tolerances for the next REST steps. A wide tube saves predictions only with bodies that keep their motions too."""

WIDEST: Final = 0.4
"""Widest adaptive tube at the end of the horizon, in radii of its body. Larger: it meets more pairs than it saves."""


@dataclass
class Unrest:
    """Average share of the moving bodies that start anew, and the steps for which all tolerances are NARROWEST."""

    share: float = 0.0
    left: int = 0

    def keeps_narrow(self, moved: int, moving: int) -> bool:
        """Note that `moved` of `moving` bodies start anew. Return whether all tolerances are NARROWEST in this step."""
        if moving <= FEW_BODIES:
            return True
        if self.left:
            self.left -= 1
            return True
        self.share += (moved / moving - self.share) / AVERAGED_STEPS
        if self.share > RESTLESS:
            self.share, self.left = 0.0, REST
        return False


@inlined
def widest_tube(bodies: Any, i: int, settings: Any) -> tuple[Any, Any]:
    """Deviation (m) and drift (m/s) that the tolerances allow body i. Adaptive ones depend on its size."""
    r, radius = bodies.spin_radius[i], bodies.motion[i].radius
    tube_0 = settings.position_tolerance + r * settings.orientation_tolerance
    tube_1 = settings.velocity_tolerance + r * settings.angular_velocity_tolerance
    if settings.adaptive:
        tube_1 = min(tube_1, WIDEST * radius / max(settings.horizon, 1e-9))
    return tube_0, tube_1


@device
def fit_width(bodies: Any, i: int, now: float, limits: tuple[float, bool], settings: Any, width: Any) -> None:
    """Fit the width (N,) of body i, which leaves its motion.

    A body that deviates within the tolerances is noisy: its next tube has ROOM for more than this deviation. One that
    deviates further has changed its motion, and halves its width. limits: duration of FUTILE_STEPS steps (s), and
    whether all tolerances are NARROWEST.
    """
    futile, are_narrow = limits
    m = bodies.motion[i]
    w, since = width[i], now - m.time
    if are_narrow or bodies.slack[i] == 0.0:  # 0: the body is new
        width[i] = NARROWEST
        return
    if w < 0.0:
        width[i] = w + 1.0 if w < -1.0 else NARROWEST
        return
    if w >= 0.5 and since <= futile:
        width[i] = -PATIENCE
        return
    if w <= NARROWEST or (w <= ONCE and since > futile):
        width[i] = ONCE if since <= futile else NARROWEST
        return
    r = bodies.spin_radius[i]
    tube_0, tube_1 = widest_tube(bodies, i, settings)
    apart = drift = off = 0.0
    p = (m.x + m.vx * since, m.y + m.vy * since, m.z + m.vz * since)
    v, w_m = (m.vx, m.vy, m.vz), (m.wx, m.wy, m.wz)
    if m.course != STRAIGHT:
        p, there = position_at(m, now), twist_at(m, now)
        v, w_m = there.velocity, there.angular
    for c in range(3):
        apart += (bodies.position[i, c] - p[c]) ** 2
        drift += (bodies.linear[i, c] - v[c]) ** 2
        off += (bodies.angular[i, c] - w_m[c]) ** 2
    used = max(sqrt(apart) / max(tube_0, 1e-300), (sqrt(drift) + r * sqrt(off)) / max(tube_1, 1e-300))
    width[i] = min(max(ROOM * used, w * ROOM), 1.0) if used <= 1.0 else max(0.5 * w, NARROWEST)
