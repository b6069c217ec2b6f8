"""The time of impact of two shapes, as an interval, and their contact then."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.query.contact.contact import Contact, contact
from collision_monitor.records import Method
from collision_monitor.shapes.registry import Sphere


@dataclass(frozen=True, eq=False, repr=False)
class Impact:
    """First time at which two shapes are within the separation, in s from the given poses.

    "hit": it lies within [lower, upper]. "clear": there is none within the horizon; lower and upper are infinite.
    "unresolved": there is none before lower, but the shapes come so near that round-off or the budget leaves open
    whether they meet, or the inside of a mesh is uncertain; upper is infinite. Treat it as a hit.
    contact: the contact at upper, or at lower if upper is infinite; None if clear. method: what found the interval.

    >>> import collision_monitor as cm
    >>> still, aside = cm.Motion(cm.Pose()), cm.Motion(cm.Pose((0, 5, 0)), linear=(1, 0, 0))
    >>> cm.time_of_impact(cm.Box((1, 1, 1)), still, cm.Box((1, 1, 1)), aside).status
    'clear'
    """

    status: Literal["hit", "clear", "unresolved"]
    lower: float
    upper: float
    contact: Contact | None
    method: Method = Method.CONSERVATIVE_ADVANCEMENT

    def __repr__(self) -> str:
        """Return status and times for a person."""
        if self.status == "clear":
            return "Impact(clear)"
        return f"Impact({self.status} in {self.lower:.6g} to {self.upper:.6g} s)"

    @property
    def segment(self) -> tuple[int | None, int | None]:
        """Where A and B are on their plans at lower: the index of the last point before; None without a Trajectory.

        -1: before the first point. A clear impact has no such place.
        """
        given = vars(self).get("_arguments", ())[1::2]
        places = [
            int(np.searchsorted(each.times, self.lower, side="right")) - 1 if isinstance(each, Trajectory) else None
            for each in given
        ]
        return (places[0], places[1]) if places else (None, None)

    def __getattr__(self, name: str) -> Any:
        """Compute the contact when it is first read: it takes as long as the search for the time."""
        if name != "contact" or "_arguments" not in vars(self):
            raise AttributeError(name)
        shape_a, motion_a, shape_b, motion_b = vars(self)["_arguments"]
        at = self.upper if self.upper < math.inf else self.lower
        found = contact(shape_a, motion_a.at(at), shape_b, motion_b.at(at))
        vars(self)["contact"] = found
        return found


CLEAR_IMPACT: Final = Impact("clear", math.inf, math.inf, None)


def impact_of_times(times: tuple[float, float], arguments: tuple[Any, Any, Any, Any]) -> Impact:
    """Impact of two convex solids or meshes that come together within these times (s); infinite: never."""
    lower, upper = times
    if lower == math.inf:  # most pairs: they need no method
        return CLEAR_IMPACT
    shape_a, motion_a, shape_b, motion_b = arguments
    used = Method.CONSERVATIVE_ADVANCEMENT
    are_spheres = type(shape_a) is type(shape_b) is Sphere
    are_straight = motion_a.is_straight and motion_b.is_straight
    if lower > 0.0 and are_spheres and are_straight and (motion_a.acceleration == motion_b.acceleration).all():
        used = Method.CLOSED_FORM
    return timed_impact(lower, upper, used, arguments)


def timed_impact(lower: float, upper: float, method: Method, arguments: tuple[Any, Any, Any, Any]) -> Impact:
    """Return an impact that computes its contact when that is read; the clear one for an infinite lower end."""
    if lower == math.inf:
        return CLEAR_IMPACT
    made = object.__new__(Impact)
    status = "hit" if upper < math.inf else "unresolved"
    made.__dict__.update(status=status, lower=lower, upper=upper, method=method, _arguments=arguments)
    return made
