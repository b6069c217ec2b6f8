"""Times and probabilities of impact of pairs of body slots, by planes, by samples or along plans, on one thread."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.settings.profile import Profile
from collision_monitor.uncertainty.impact_distribution import PROBABILITY
from collision_monitor.uncertainty.plane_memory import PlaneMemory, make_plane_memory
from collision_monitor.uncertainty.plane_probability import LEFT, plane_probabilities
from collision_monitor.uncertainty.planned_impacts import planned_probabilities
from collision_monitor.uncertainty.sampled_impacts import (
    COSTLY_PARTS,
    SPINNING_PARTS,
    Sampling,
    find_divisors,
    impact_probabilities,
)
from collision_monitor.uncertainty.samples.error_samples import Workspace, make_workspace
from collision_monitor.uncertainty.samples.normal_samples import normal_samples, sample_columns
from collision_monitor.uncertainty.spread import Spread

Slots = NDArray[np.int32]

ANSWERS: Final = ("earliest", "most_likely", "latest", "probability")

FINEST_WITH_PLANES: Final = 1e-5
"""Smallest `impact_tolerance` (m) with which probabilities come from cutting planes. Below it, as in the profile
`exact`, each sample is followed to its impact."""

FEWEST_SAMPLES: Final = 16
"""Fewest samples of a pair that has only a part of `uncertainty_samples`."""


class Workspaces(NamedTuple):
    """Scratch memory of one thread."""

    exact: Workspace
    planes: PlaneMemory


def make_workspaces(samples: int) -> Workspaces:
    """Make the scratch memory of one thread."""
    return Workspaces(make_workspace(), make_plane_memory(samples))


def with_plans(bodies: Any, slots: Slots) -> NDArray[np.bool_]:
    """Mask (n,) of the pairs of body slots (n, 2) of which one body follows a plan, at least."""
    mask: NDArray[np.bool_] = bodies.planned[slots].any(axis=1)
    return mask


def pair_probabilities(
    multibody: Any, spread: Spread, slots: Slots, now: float, sampling: Sampling, profile: Profile, work: Workspaces
) -> tuple[NDArray[np.float64], int]:
    """Return the ANSWERS (n, 4) of pairs of body slots (n, 2), NaN for those left out, and the number of samples."""
    answers, followed = np.full((len(slots), len(ANSWERS)), LEFT), 0

    def follow(kernel: Any, some: NDArray[np.bool_], divisor: int) -> int:
        """Follow a part of the samples exactly for some of the pairs. Return the number of samples."""
        if not some.any():
            return 0
        fewer = normal_samples(max(profile.uncertainty_samples // divisor, FEWEST_SAMPLES))
        found = np.empty((np.count_nonzero(some), len(ANSWERS)))
        samples = sampling._replace(**fewer._asdict())
        count = kernel(multibody, spread, slots[some], now, samples, work.exact, found)
        answers[some] = found
        return int(count)

    if profile.impact_tolerance >= FINEST_WITH_PLANES:
        columns = sample_columns(profile.uncertainty_samples)
        followed = plane_probabilities(
            multibody, spread, slots, now, sampling, columns, work.planes, work.exact, answers
        )  # fmt: skip
    left, planned = answers[:, PROBABILITY] == LEFT, with_plans(multibody.bodies, slots)
    followed += follow(planned_probabilities, left & planned, 1)
    left &= ~planned
    if left.any():
        divisors = np.empty(len(slots), np.uint8)
        find_divisors(multibody, slots, profile.horizon, divisors)
        for divisor in (COSTLY_PARTS, SPINNING_PARTS, 1):
            followed += follow(impact_probabilities, left & (divisors == divisor), divisor)
    return answers, followed
