"""Joints at constant rates, each until it meets its limit: spans of time within which no rate changes."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, inf, log2, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.robots.kinematic_tree import KinematicTree

Floats = NDArray[np.float64]

REACH: Final = 0.5
"""m: length of a chain whose shortest piece is as long as its tube needs, if all joints turn one way. Smaller: wider
tubes of fast links. Larger: more poses to compute, 0.1 µs for each link."""

MOST_PIECES: Final = 64
"""Pieces of a link between two changes of a rate. A link that needs more has a wider tube."""

NODES: Final = 4
"""Nodes of a shortest piece: where its error is measured."""

APART: Final = 1e-9
"""s between two changes of rates. Nearer ones are one."""


class JointSpans(NamedTuple):
    """Joints at N times, the nodes, which are evenly spaced within each of S spans."""

    times: Any  # (N,): s from now on, rising, with both ends of each span
    joints: Any  # (N, J, 2): positions (rad or m) and rates of the span (rad/s or m/s)
    first: Any  # (S + 1,) int64: the first node of each span, and N


def constant_rates(
    tree: KinematicTree, joints: Floats, horizon: float, tolerance: float, base_turn: float
) -> JointSpans:  # fmt: skip
    """Move joints (J, 2), positions and rates, at these rates for `horizon` (s).

    A joint stops at its limit. One that is at its limit already, or beyond it, and moves outwards shows that this
    limit does not hold, and goes on. tolerance: width of the tubes that the nodes are for (m). base_turn: angular speed
    of the base link (rad/s).
    """
    piece_turn = 4.0 * sqrt(tolerance / REACH)  # two joints of rate w: off by w^2 h^2 REACH / 16 at most, between poses
    q, rate = joints[:, 0], joints[:, 1]
    lower, upper = tree.limits[:, 0], tree.limits[:, 1]
    limit = np.where(rate > 0.0, upper, lower)
    ends = ((rate > 0.0) & (q < upper)) | ((rate < 0.0) & (q > lower))
    with np.errstate(all="ignore"):
        stops = np.where(ends, (limit - q) / np.where(rate != 0.0, rate, 1.0), inf)
    within = np.sort(stops[(stops > APART) & (stops < horizon - APART)])
    edges = [0.0, *within[np.diff(within, prepend=0.0) > APART].tolist(), horizon]
    times, positions, rates, first = [], [], [], [0]
    for begin, end in pairwise(edges):
        moving = np.where(stops > begin + APART, rate, 0.0)
        turn = (base_turn + float((tree.turns @ np.abs(moving)).max(initial=0.0))) * (end - begin)
        pieces = 2 ** ceil(log2(min(max(turn / piece_turn, 1.0), MOST_PIECES)))
        t = np.linspace(begin, end, NODES * pieces + 1)
        gone = np.minimum(t[:, None], stops)
        times.append(t)
        positions.append(np.where(t[:, None] < stops, q + rate * gone, limit))
        rates.append(np.broadcast_to(moving, (len(t), len(q))))
        first.append(first[-1] + len(t))
    both = np.stack([np.concatenate(positions), np.concatenate(rates)], axis=2)
    return JointSpans(np.concatenate(times), both, np.array(first))
