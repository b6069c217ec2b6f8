"""For how long the pieces of plans cannot close the gap of two bodies: from where these go, and how far they turn."""

from __future__ import annotations

from typing import Any, NamedTuple

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import Vector, opposite
from collision_monitor.impact.mesh_pair import has_mesh
from collision_monitor.motion.bodies import next_pair
from collision_monitor.motion.motion import acceleration_within, most_turning, position_at
from collision_monitor.motion.placed_pair import place_pair
from collision_monitor.narrow_phase.dispatch import separation


@outlined
def clear_until(
    multibody: Any, pair: Any, window: tuple[float, float], least: float, tube: Any, scratch: Any
) -> tuple[float, int]:  # fmt: skip
    """Time until which two bodies (BodyPair), one of which follows a plan, are farther apart than `least` (m).

    By one distance for each pair of shapes: along its normal, whole pieces bring them nearer by no more than the gap.
    window: the times to search (s). tube: of both from its begin on. Returns that time, the begin of a piece or the
    window's end, and the number of distance queries. Of meshes it knows nothing.
    """
    table, parts, bodies = multibody
    A, B, a, first_b, spin_a, spin_b = pair
    begin, until = window
    b, queries = first_b, 0
    while a >= 0 and until > begin:
        if has_mesh(table, a, b):
            return begin, queries
        placed = place_pair(table, parts, (A, B, a, b), begin, scratch)
        gap = separation(table, a, b, placed.pose, scratch.out, scratch.work) - least - tube.start
        n = (scratch.out[0], scratch.out[1], scratch.out[2])
        until = _apart_until(bodies.pieces, A, B, n, (spin_a, spin_b), gap, tube.growth, begin, until)
        queries += 1
        a, b = next_pair(parts, first_b, a, b)
    return until, queries


@outlined
def _apart_until(
    pieces: Any, A: Any, B: Any, n: Vector, radii: tuple[float, float], gap: float, growth: float, begin: float,
    end: float,
) -> float:  # fmt: skip
    """Begin of the first pieces that may close a gap (m) along n, which is that of two motions at `begin`; else end."""
    t, one, other, until_a, until_b = begin, A.piece, B.piece, A.until, B.until
    m_a, m_b = A, B
    while gap > 0.0:
        stop = min(end, until_a, until_b)
        own, its = _nearing(pieces, m_a, n, t, stop), _nearing(pieces, m_b, opposite(n), t, stop)
        turned = growth * (stop - t)
        turned += own.turning * radii[0] if own.turning > 0.0 else 0.0
        turned += its.turning * radii[1] if its.turning > 0.0 else 0.0
        if not max(own.along, 0.0) + max(its.along, 0.0) + own.bulge + its.bulge + turned < gap:
            return t
        gap, t = gap - own.along - its.along - turned, stop
        if not t < end:
            return end
        if until_a <= t:
            one += 1
            m_a, until_a = pieces[one], pieces[one].until
        if until_b <= t:
            other += 1
            m_b, until_b = pieces[other], pieces[other].until
    return t


class Nearing(NamedTuple):
    """How far a body goes in a direction on a piece."""

    along: Any  # m: of its origin
    turning: Any  # rad: by which it turns at most
    bulge: Any  # m: by which its origin is farther in between


@inlined
def _nearing(pieces: Any, m: Any, n: Vector, begin: float, end: float) -> Nearing:
    """How far the motion m (MOTION) goes along n between two times (s), at the end and in between."""
    h = end - begin
    stands = m.vx == 0.0 and m.vy == 0.0 and m.vz == 0.0 and m.ax == 0.0 and m.ay == 0.0 and m.az == 0.0
    turning = most_turning(m, begin, end) * h
    if stands:
        return Nearing(0.0, turning, 0.0)
    x, y, z = position_at(m, begin)
    if end == m.until:
        k = m.piece + 1
        dx, dy, dz = pieces[k].x - x, pieces[k].y - y, pieces[k].z - z
    else:
        there = position_at(m, end)
        dx, dy, dz = there[0] - x, there[1] - y, there[2] - z
    bulge = 0.125 * acceleration_within(m, begin, end) * h * h
    return Nearing(dx * n[0] + dy * n[1] + dz * n[2], turning, bulge)
