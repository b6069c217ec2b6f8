"""Scratch memory of one thread for the samples of a pair and the planes that bound its obstacle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.uncertainty.impact_histogram import BINS
from collision_monitor.uncertainty.obstacle_planes import Obstacle, make_obstacle
from collision_monitor.uncertainty.samples.normal_samples import DIMENSIONS
from collision_monitor.uncertainty.samples.sample_gaps import APART, SampleRows, make_sample_rows
from collision_monitor.uncertainty.samples.straight_samples import ERRORS


class ChosenSamples(NamedTuple):
    """Samples of one pair, see chosen_samples.py. Scratch memory of one thread for S samples."""

    points: Any  # (DIMENSIONS, S) float32
    weights: Any  # (S,)
    sums: Any  # (2, S): sum of the weights up to the last chosen sample, and of their squares; no others


class PlaneMemory(NamedTuple):
    """Scratch memory of one thread for S samples. What planes need is in single precision, see sample_gaps.py."""

    obstacle: Obstacle
    rows: SampleRows
    off: Any  # (ERRORS, S) float32
    times: Any  # (S,): s
    alone: Any  # (S,): those of one pair of shapes
    entry: Any  # (S,) float32: share of the segment
    leave: Any  # (S,) float32
    checked: Any  # (S,) float32: 0 or infinite
    live: Any  # (S,) int64: see live_samples.py
    kept: Any  # (S,) int64: scratch
    trial: Any  # (2, S) float32
    spare: Any  # (3, S): scratch
    bins: Any  # (BINS,)
    chosen: ChosenSamples


def make_plane_memory(samples: int) -> PlaneMemory:
    """Make the scratch memory of one thread."""

    def numbers() -> NDArray[np.float64]:
        return np.zeros(samples)

    def singles() -> NDArray[np.float32]:
        return np.zeros(samples, np.float32)

    return PlaneMemory(
        obstacle=make_obstacle(),
        rows=make_sample_rows(samples),
        off=np.zeros((ERRORS, samples + APART), np.float32),
        times=numbers(),
        alone=numbers(),
        entry=singles(),
        leave=singles(),
        checked=singles(),
        live=np.zeros(samples, np.int64),
        kept=np.zeros(samples, np.int64),
        trial=np.zeros((2, samples), np.float32),
        spare=np.zeros((3, samples)),
        bins=np.zeros(BINS),
        chosen=ChosenSamples(np.zeros((DIMENSIONS, samples + APART), np.float32), numbers(), np.zeros((2, samples))),
    )
