"""The context of a step that every stage reads: the objects, the settings and the time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.body_contact import ContactQuery
from collision_monitor.impact.body_impact import ImpactQuery
from collision_monitor.impact.tree_impact import SearchEnd
from collision_monitor.monitor.result import Work
from collision_monitor.monitor.state.roster import Roster
from collision_monitor.settings.by_name import classes_of
from collision_monitor.settings.profile import Profile


class MotionSettings(NamedTuple):
    """How far ahead bodies are predicted, and how far they may deviate from their predicted motion."""

    horizon: float  # s
    margin: float  # m
    stale_acceleration: float  # m/s^2
    position_tolerance: float  # m
    orientation_tolerance: float  # rad
    velocity_tolerance: float  # m/s
    angular_velocity_tolerance: float  # rad/s
    stale_after: float  # s
    adaptive: bool  # whether the tolerances of a body follow its deviations


class KernelSettings(NamedTuple):
    """A profile's settings as the kernels read them."""

    impact: ImpactQuery
    contact: ContactQuery
    motion: MotionSettings

    @classmethod
    def of(cls, p: Profile) -> Self:
        """Extract the settings from a profile."""
        return cls(
            ImpactQuery(p.contact_margin, p.impact_tolerance, p.impact_iterations),
            ContactQuery(p.contact_margin, p.stale_acceleration),
            MotionSettings(
                p.horizon,
                p.contact_margin,
                p.stale_acceleration,
                p.position_tolerance,
                p.orientation_tolerance,
                p.velocity_tolerance,
                p.angular_velocity_tolerance,
                p.stale_after,
                p.adaptive_tolerances,
            ),
        )


@dataclass(slots=True)
class StepContext:
    """One step: the objects, the settings, the time, and the counters of its work."""

    roster: Roster
    profile: Profile
    settings: KernelSettings
    now: float  # s after the timeline's origin
    number: int  # of the step, from 1
    period: float = 0.0  # s since the step before; known after stage 2
    work: Work = field(default_factory=Work)
    samples: int = 0  # of the states of uncertain pairs, see StepResult

    @property
    def coarse(self) -> SearchEnd:
        """Gap to which impacts of meshes are only bounded. 0: all are exact, as those of uncertain states are."""
        p = self.profile
        exact = p.uncertainty or not self.roster.has_trees
        return SearchEnd(0.0 if exact else p.mesh_impact_tolerance, self.period, self.now)

    @property
    def horizons(self) -> NDArray[np.float64]:
        """Horizon of each body (N,), by slot (s)."""
        p = self.profile
        return self.roster.values_by_name(classes_of("horizon_by_name", p.horizon_by_name), p.horizon)
