"""Scratch memory of one thread for the samples of a pair and the planes that bound its obstacle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.prediction.impact_histogram import BINS
from collision_monitor.prediction.normal_samples import DIMENSIONS
from collision_monitor.prediction.obstacle_planes import Obstacle, make_obstacle
from collision_monitor.prediction.sample_gaps import APART, SampleRows, make_sample_rows
from collision_monitor.prediction.straight_samples import ERRORS


class ChosenSamples(NamedTuple):
    """Samples of one pair, see chosen_samples.py. Scratch memory of one thread for S samples."""

    points: Any  # (DIMENSIONS, S)
    weights: Any  # (S,)
    sums: Any  # (2, S): sum of the weights up to the last chosen sample, and of their squares; no others


class PlaneMemory(NamedTuple):
    """Scratch memory of one thread for S samples."""

    obstacle: Obstacle
    rows: SampleRows
    off: Any  # (ERRORS, S)
    times: Any  # (S,): s
    alone: Any  # (S,): those of one pair of shapes
    entry: Any  # (S,)
    leave: Any  # (S,)
    checked: Any  # (S,): 0 or infinite
    live: Any  # (S,) int64: see live_samples.py
    kept: Any  # (S,) int64: scratch
    trial: Any  # (2, S)
    bins: Any  # (BINS,)
    chosen: ChosenSamples


def make_plane_memory(samples: int) -> PlaneMemory:
    """Make the scratch memory of one thread."""

    def numbers() -> NDArray[np.float64]:
        return np.zeros(samples)

    return PlaneMemory(
        obstacle=make_obstacle(),
        rows=make_sample_rows(samples),
        off=np.zeros((ERRORS, samples + APART)),
        times=numbers(),
        alone=numbers(),
        entry=numbers(),
        leave=numbers(),
        checked=numbers(),
        live=np.zeros(samples, np.int64),
        kept=np.zeros(samples, np.int64),
        trial=np.zeros((2, samples)),
        bins=np.zeros(BINS),
        chosen=ChosenSamples(np.zeros((DIMENSIONS, samples + APART)), numbers(), np.zeros((2, samples))),
    )
