"""What every stage of a step reads: the objects, the settings and the time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Self

from collision_monitor.monitor.result import Work
from collision_monitor.monitor.roster import Roster
from collision_monitor.prediction.body_contact import ContactQuery
from collision_monitor.prediction.body_impact import ImpactQuery
from collision_monitor.settings.profile import Profile


class MotionSettings(NamedTuple):
    """How far bodies are predicted, and how far off their predicted motion they may be."""

    horizon: float  # s
    margin: float  # m
    stale_acceleration: float  # m/s^2
    position_tolerance: float  # m
    orientation_tolerance: float  # rad
    velocity_tolerance: float  # m/s
    angular_velocity_tolerance: float  # rad/s


@dataclass(frozen=True, slots=True)
class StepContext:
    """One step. impact, contact, motion: the profile's settings as the kernels read them."""

    roster: Roster
    profile: Profile
    now: float  # s after the timeline's origin
    number: int  # of the step, from 1
    impact: ImpactQuery
    contact: ContactQuery
    motion: MotionSettings
    work: Work = field(default_factory=Work)

    @classmethod
    def of(cls, roster: Roster, profile: Profile, now: float, number: int) -> Self:
        """The step of this number at `now` (s)."""
        p = profile
        return cls(
            roster,
            p,
            now,
            number,
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
            ),
        )
