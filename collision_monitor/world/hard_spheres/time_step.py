"""One time step of spheres between walls: all contacts in it at their exact times, found anew in each step.

Slides "Detect collision, and back up time to find the exact time of collision". An overlap at the end of a step does
not show a sphere that grazed another and left it, so the contacts are found from the paths.
"""

from __future__ import annotations

import numpy as np

from collision_monitor.world.hard_spheres.event_loop import DONE, EVENTS_PER_CALL, ROWS_FULL, run_events, start
from collision_monitor.world.hard_spheres.state import VELOCITY, Floats, make_state, positions_at, with_wider_rows


def step_spheres(
    positions: Floats, velocities: Floats, radii: Floats, masses: Floats, side: float, dt: float, restitution: float
) -> tuple[Floats, Floats]:
    """Return positions and velocities (N, 3) of spheres in a cube from 0 to `side` (m), `dt` seconds later."""
    state = make_state(
        positions, velocities, radii, masses, side=side, periodic=False, restitution=restitution, duration=dt
    )
    while not start(state):
        state = with_wider_rows(state)
    no_log = np.zeros(0), np.zeros((0, 2), np.int32)
    while (reason := run_events(state, dt, EVENTS_PER_CALL, *no_log)) != DONE:
        if reason == ROWS_FULL:
            state = with_wider_rows(state)
    inside = np.clip(positions_at(state, dt), radii[:, None], side - radii[:, None])  # but for round-off
    return inside, state.spheres[:, VELOCITY : VELOCITY + 3].copy()
