"""Joints as polynomials in time, span after span, and at which times their links are computed.

The derivatives of a polynomial are bounded by its Bernstein coefficients (Farouki, 2012).
"""

from __future__ import annotations

from math import comb, perm, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.geometry.runs import in_runs
from collision_monitor.robots.kinematic_tree import KinematicTree

Floats = NDArray[np.float64]

REACH: Final = 0.5
"""m: length of a chain whose shortest piece is as long as its tube needs, if all joints turn one way. Smaller: wider
tubes of fast links. Larger: more poses to compute, 0.1 µs for each link."""

MOST_PIECES: Final = 64
"""Pieces of a link in a span. A link that needs more has a wider tube."""

NODES: Final = 4
"""Nodes of a shortest piece: where its error is measured."""

MOST_PARTS: Final = 64
"""Spans that one span is split into."""

MOST_WORK: Final = 2_000_000
"""Poses of links that one plan of a robot may take, 0.2 s. An arm at 1 rad/s needs 1,000."""

DERIVATIVES: Final = 6
"""Bounds of a joint in a span: on its position, and on its derivatives up to the fifth."""


class JointMotion(NamedTuple):
    """J joints that are polynomials in time in each of S spans.

    edges (S + 1,): s, rising, where the spans begin and end. coefficients (S, J, K), K up to 6: of the powers of the
    time since the begin of the span, from 0 on, for the position (rad or m).
    """

    edges: Floats
    coefficients: Floats

    def at(self, times: Floats) -> Floats:
        """Return positions (rad or m) and rates (T, J, 2) at times (T,) in s, resting before the begin and after the
        end."""
        within = np.clip(times, self.edges[0], self.edges[-1])
        k = np.clip(np.searchsorted(self.edges, within, side="right") - 1, 0, len(self.coefficients) - 1)
        found = _evaluated(self.coefficients, k, within - self.edges[k])
        found[(times < self.edges[0]) | (times > self.edges[-1]), :, 1] = 0.0
        return found


class JointSpans(NamedTuple):
    """Joints at N times, the nodes, which are evenly spaced within each of S spans."""

    times: Any  # (N,): s from now on, rising, with both ends of each span
    joints: Any  # (N, J, 2): positions (rad or m) and rates (rad/s or m/s)
    first: Any  # (S + 1,) int64: the first node of each span, and N
    bounds: Any  # (S, J, DERIVATIVES): largest sizes of the position and of its derivatives in each span


def joint_spans(motion: JointMotion, tree: KinematicTree, tolerance: float, base_turn: float) -> JointSpans:
    """Return the nodes for tubes of a width of `tolerance` (m). base_turn: angular speed of the base link (rad/s).

    Raises InputError beyond MOST_WORK.
    """
    bounds = _bounds(motion)
    wanted = _pieces(motion, bounds, tree, tolerance, base_turn)
    if not (wanted <= MOST_PIECES).all():
        motion = _split(motion, np.ceil(np.clip(wanted / MOST_PIECES, 1.0, MOST_PARTS)).astype(np.int64), tree)
        bounds = _bounds(motion)
        wanted = _pieces(motion, bounds, tree, tolerance, base_turn)
    counts = NODES * 2 ** np.ceil(np.log2(np.clip(wanted, 1.0, MOST_PIECES))).astype(np.int64) + 1
    first = np.append(0, np.cumsum(counts))
    _check_work(int(first[-1]), tree)
    of = np.repeat(np.arange(len(counts)), counts)
    begin, end = motion.edges[:-1], motion.edges[1:]
    times = (np.arange(first[-1]) - first[of]) * ((end - begin) / (counts - 1))[of] + begin[of]
    times[first[1:] - 1] = end
    joints = _evaluated(motion.coefficients, of, times - begin[of])
    return JointSpans(times, joints, first, bounds)


def _split(motion: JointMotion, parts: NDArray[np.int64], tree: KinematicTree) -> JointMotion:
    """Return the same motion with each span in some even parts (S,)."""
    _check_work(NODES * int(parts.sum()), tree)
    of, number = in_runs(parts)
    later = (number * (np.diff(motion.edges) / parts)[of])[:, None]
    given = motion.coefficients[of]
    shifted = np.zeros_like(given)
    for k in range(given.shape[2]):
        for j in range(k, given.shape[2]):
            shifted[:, :, k] += comb(j, k) * given[:, :, j] * later ** (j - k)
    return JointMotion(np.append(motion.edges[of] + later[:, 0], motion.edges[-1]), shifted)


def _check_work(nodes: int, tree: KinematicTree) -> None:
    if (work := nodes * len(tree.links)) > MOST_WORK:
        raise InputError(
            f"expected at most {MOST_WORK} poses of links for one plan, got {work}: too many joints stop, or too many "
            "points of a trajectory"
        )


def _evaluated(coefficients: Floats, k: NDArray[np.int64], age: Floats) -> Floats:
    """Positions and rates (T, J, 2) in spans k (T,) at ages (T,) in s (Horner)."""
    t, degree = age[:, None], coefficients.shape[2] - 1
    given = coefficients if len(coefficients) == 1 else coefficients[k]
    position, rate = given[:, :, degree], np.zeros((1, 1))
    for j in range(degree - 1, -1, -1):
        rate = rate * t + position
        position = position * t + given[:, :, j]
    return np.stack([position, rate], axis=2)


def _bounds(motion: JointMotion) -> Floats:
    """Bounds (S, J, DERIVATIVES) on the sizes of the positions and of their derivatives in each span."""
    coefficients, spans = motion.coefficients, np.diff(motion.edges)[:, None]
    count = coefficients.shape[2]
    bounds = np.zeros((*coefficients.shape[:2], DERIVATIVES))
    for k in range(min(count, DERIVATIVES)):
        degree = count - 1 - k
        scaled = [perm(j + k, k) * coefficients[:, :, j + k] * spans**j for j in range(degree + 1)]
        for i in range(degree + 1):
            value = sum(comb(i, j) / comb(degree, j) * scaled[j] for j in range(i + 1))
            np.maximum(bounds[:, :, k], np.abs(value), out=bounds[:, :, k])
    return bounds


def _pieces(
    motion: JointMotion, bounds: Floats, tree: KinematicTree, tolerance: float, base_turn: float
) -> Floats:  # fmt: skip
    """Pieces (S,) that a chain of the length REACH needs in each span.

    Two joints of rate w are off an arc by w^2 h^2 REACH / 16 at most, between poses; one that speeds up by a, by
    a h^2 REACH / 8.
    """
    slides = (tree.needs & (tree.turns == 0.0)) / REACH
    turn = base_turn + (bounds[:, :, 1] @ tree.turns.T).max(axis=1, initial=0.0)
    speeding = (bounds[:, :, 2] @ (tree.turns + slides).T).max(axis=1, initial=0.0)
    return np.asarray(np.hypot(turn, np.sqrt(2.0 * speeding)) * np.diff(motion.edges) / (4.0 * sqrt(tolerance / REACH)))
