"""The first impact of two bodies that follow trajectories, piece after piece (`PairPieces`)."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from collision_monitor.meshes.trees.shape_trees import CERTAIN
from collision_monitor.motion.stated_motion import LINEAR, Motion, motion_of
from collision_monitor.motion.trajectory import PairPieces, Trajectory, carried, pair_pieces
from collision_monitor.query.body import QueryBody
from collision_monitor.query.contact.contact import check_kinds, plant_bodies
from collision_monitor.query.impact.impact_kernel import TOUCHES, first_impact_of_pieces
from collision_monitor.query.impact.impact_of_motions import impact_of_motions
from collision_monitor.query.impact.impact_query import MotionQuery
from collision_monitor.query.impact.moving_body import MovingBody, check_bounded, planned_body
from collision_monitor.shapes.compound import Compound
from collision_monitor.shapes.pose import Pose


class PlannedPair(NamedTuple):
    """Two bodies that are checked, and their motions in pieces."""

    a: QueryBody
    b: QueryBody
    pieces: PairPieces

    def piece(self, time: float) -> int:
        """Index of the piece that holds at a time (s)."""
        return int(np.searchsorted(self.pieces.borders[1:-1], time, side="right"))

    def moving(self, k: int) -> tuple[MovingBody, MovingBody]:
        """The bodies as they move in piece k, whose times begin with it."""
        rows = self.pieces.a[k], self.pieces.b[k]
        motions = [motion_of(Pose.of_numbers(row[:LINEAR].tolist()), row) for row in rows]
        return MovingBody(self.a, motions[0]), MovingBody(self.b, motions[1])

    def rest_of_piece(self, begin: float) -> PlannedPair:
        """The pair from a time (s) on to the end of the piece that holds then."""
        k = self.piece(begin)
        borders, a, b, tubes = self.pieces
        age = np.array([begin - borders[k]])
        a, b = (carried(each[k : k + 1], age) for each in (a, b))
        return self._replace(pieces=PairPieces(np.array([begin, borders[k + 1]]), a, b, tubes[k : k + 1]))

    def query(self, k: int, query: MotionQuery, wider: float = 0.0) -> MotionQuery:
        """A query within piece k alone, with a separation that is wider by some of its tubes."""
        borders, tubes = self.pieces.borders, self.pieces.tubes
        separation = query.separation + wider * float(tubes[k].sum())
        return query._replace(horizon=float(borders[k + 1] - borders[k]), separation=separation)


Side = tuple[Compound, "Motion | Trajectory"]


def planned_pair(a: Side, b: Side, horizon: float) -> PlannedPair:
    """Check two bodies and their motions, and cut these into pieces. Raises as `time_of_impact`."""
    (body_a, motion_a), (body_b, motion_b) = planned_body(*a, "A"), planned_body(*b, "B")
    check_bounded(body_a, body_b)
    check_kinds(body_a, motion_a.pose, body_b, motion_b.pose)
    plant_bodies(body_a, body_b)
    return PlannedPair(body_a, body_b, pair_pieces(motion_a, motion_b, horizon))


def planned_impact(a: Side, b: Side, query: MotionQuery) -> tuple[float, float]:
    """Lower and upper (s) of the first impact of two bodies, infinite for none. Raises as `time_of_impact`.

    Where one of the motions is unknown before the horizon, an impact from then on is unresolved.
    """
    pair = planned_pair(a, b, query.horizon)
    lower, upper = next_planned_impact(pair, query, 0.0)
    until = float(pair.pieces.borders[-1])
    return (until, inf) if lower == inf and until < query.horizon else (lower, upper)


def next_planned_impact(pair: PlannedPair, query: MotionQuery, begin: float) -> tuple[float, float]:
    """Lower and upper (s) of the first impact from `begin` (s) on, where the bodies are apart; infinite for none."""
    k, earliest = pair.piece(begin), inf
    if begin > pair.pieces.borders[k]:
        earliest, upper = _impact_from_piece(pair.rest_of_piece(begin), query, 0)
        if upper < inf:
            return earliest, upper
        k += 1
    lower, upper = _impact_from_piece(pair, query, k)
    return min(earliest, lower), upper


def _impact_from_piece(pair: PlannedPair, query: MotionQuery, k: int) -> tuple[float, float]:
    """Lower and upper (s) of the first impact from the begin of piece k on; infinite for none."""
    earliest = inf
    chains, borders = (pair.a.slots.first, pair.b.slots.first), pair.pieces.borders
    is_certain = pair.a.inside == pair.b.inside == CERTAIN and all(side.certain is side for side in pair[:2])
    lower, upper, code = inf, inf, TOUCHES
    while k < len(borders) - 1:
        if is_certain:
            k, lower, upper, code = first_impact_of_pieces(chains, pair.pieces, k, query)
            if lower == inf:
                break
        if code == TOUCHES:
            lower, upper, _ = impact_of_motions(*pair.moving(k), pair.query(k, query, 1.0))
            if upper < inf and pair.pieces.tubes[k].any():
                upper = impact_of_motions(*pair.moving(k), pair.query(k, query, -1.0))[1]
        start = float(borders[k])
        earliest = min(earliest, start + lower)
        if upper < inf:
            return earliest, start + upper
        k += 1
    return earliest, inf
