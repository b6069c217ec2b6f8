"""First impacts of moving objects of the library, in one call of a kernel: `chains_impact`, as the monitor's."""

from __future__ import annotations

import threading
from math import inf, isfinite
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined, kernel, outlined
from collision_monitor._jit.settled import settled
from collision_monitor.impact.body_contact import RESULT, chains_contact
from collision_monitor.impact.body_impact import (
    NO_PLACES,
    BodyPair,
    ImpactQuery,
    Scratch,
    ShapePair,
    Tube,
    Window,
    chains_impact,
    first_overlap,
    make_scratch,
    shape_impact,
)
from collision_monitor.impact.impact_record import CLEAR, HIT, IMPACT
from collision_monitor.impact.mesh_pair import SURFACES
from collision_monitor.impact.overlap_time import overlap_time
from collision_monitor.impact.touching_impact import DEEPENS, RESTS, touching_impact
from collision_monitor.meshes.distance.nearest import PLACE_A, PLACE_B
from collision_monitor.motion.bodies import Parts, chain_radius, next_pair
from collision_monitor.motion.motion import MOTION, quaternion_to_matrix
from collision_monitor.motion.stated_motion import COURSE, REST, Motion
from collision_monitor.motion.trajectory import PairPieces
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.query.impact.impact_query import MotionQuery
from collision_monitor.query.kernel_arguments import set_rotation, tables_of
from collision_monitor.query.library import LIBRARY, Slots
from collision_monitor.shapes.registry import BALL
from collision_monitor.shapes.shape_table import ShapeTable
from collision_monitor.tolerances import GJK_TOUCHING

DECIDED, TOUCHES = range(2)
"""What a kernel says of its times: they are final; or the objects touch at the start and have to be followed."""

STILL: Final = Tube(0.0, 0.0)
"""A query knows the motions exactly."""


class ImpactMemory(threading.local):
    """Scratch memory, two motions, the found impact and a contact row of each thread.

    arrays: all of them, one after the other.
    """

    def __init__(self) -> None:
        self.scratch, self.motion = make_scratch(), np.zeros(2, MOTION)
        self.moving = self.motion, np.zeros(1, IMPACT), np.zeros(RESULT)
        self.arrays = (*self.scratch, *self.moving)


MEMORY: Final = ImpactMemory()


@inlined
def _set_chain(table: Any, parts: Any, first: int, motion: Any, horizon: float) -> float:
    """Set the radius of a motion to that of a chain about its origin; return its spin radius (m)."""
    motion.radius, motion.cover = chain_radius(table, parts, first), horizon
    is_ball = parts.next[first] < 0 and not parts.placed[first] and BALL[table.kind[first]]
    return 0.0 if is_ball else motion.radius


@inlined
def _round_off(A: Any, B: Any) -> float:
    """Depth (m) of two objects up to which they only touch."""
    size = (A.radius if isfinite(A.radius) else 0.0) + (B.radius if isfinite(B.radius) else 0.0)
    return GJK_TOUCHING * size


@outlined
def first_impact_in(table: Any, parts: Any, chains: Any, window: Any, search: Any, scratch: Any, moving: Any) -> Any:
    """First impact of two chains (first slots) in a window: lower, upper (s), infinite for none, and a code."""
    motion, event, row = moving
    A, B = motion[0], motion[1]
    spin_a = _set_chain(table, parts, chains[0], A, window.end)
    spin_b = _set_chain(table, parts, chains[1], B, window.end)
    if window.begin == 0.0:
        p = B.x - A.x, B.y - A.y, B.z - A.z
        reach = A.radius + B.radius + search.margin
        wanted = search.margin - max(_round_off(A, B), A.tube_0 + B.tube_0)
        if p[0] * p[0] + p[1] * p[1] + p[2] * p[2] <= reach * reach:
            pose = PairPose(A.rotation, B.rotation, p)
            start, _ = chains_contact(table, parts, chains[0], chains[1], pose, wanted, SURFACES, scratch, row)
            if start < wanted:
                return 0.0, 0.0, DECIDED
    pair = BodyPair(A, B, chains[0], chains[1], spin_a, spin_b)
    chains_impact(table, parts, pair, window, search, scratch, event[0])
    if event[0].status == CLEAR:
        return inf, inf, DECIDED
    upper = event[0].upper if event[0].status == HIT and event[0].upper <= window.end else inf
    return event[0].lower, upper, TOUCHES if event[0].lower <= 0.0 else DECIDED


@inlined
def set_motion(m: Any, numbers: Any, k: int) -> None:
    """Set a motion (MOTION) to numbers[k] (NUMBERS,) of a Motion."""
    m.x, m.y, m.z = numbers[k, 0], numbers[k, 1], numbers[k, 2]
    m.vx, m.vy, m.vz = numbers[k, 7], numbers[k, 8], numbers[k, 9]
    m.wx, m.wy, m.wz = numbers[k, 10], numbers[k, 11], numbers[k, 12]
    m.ax, m.ay, m.az = numbers[k, 13], numbers[k, 14], numbers[k, 15]
    m.course, m.rest = int(numbers[k, COURSE]), numbers[k, REST]
    quaternion_to_matrix(numbers[:, 3:7], k, m.rotation)


@settled
@kernel
def impact_of_chains(
    kind: Any, size: Any, margin: Any, radius: Any, vertex_start: Any, vertex_count: Any, vertices: Any,
    vertex_index: Any, local_position: Any, local_rotation: Any, blocks: Any, next_part: Any, index: Any, placed: Any,
    rotation: Any, quaternion: Any, out: Any, work: Any, tree: Any, answer: Any, triangle: Any, piece: Any, motion: Any,
    event: Any, row: Any, a: int, ax: float, ay: float, az: float, ai: float, aj: float, ak: float, aw: float,
    avx: float, avy: float, avz: float, awx: float, awy: float, awz: float, aax: float, aay: float, aaz: float,
    course_a: float, rest_a: float, b: int, bx: float, by: float, bz: float, bi: float, bj: float, bk: float, bw: float,
    bvx: float, bvy: float, bvz: float, bwx: float, bwy: float, bwz: float, bax: float, bay: float, baz: float,
    course_b: float, rest_b: float, horizon: float, tolerance: float, separation: float, iterations: int, begin: float,
) -> tuple[float, float, int]:  # fmt: skip
    """First impact of two moving chains of slots: lower, upper (s), infinite for none; DECIDED or TOUCHES.

    A motion has the numbers of a pose and of a Motion. begin: time (s) before which there is none.
    """
    table, parts, scratch = tables_of(
        kind, size, margin, radius, vertex_start, vertex_count, vertices, vertex_index, local_position, local_rotation,
        blocks, next_part, index, placed, rotation, quaternion, out, work, tree, answer, triangle, piece,
    )  # fmt: skip
    A, B = motion[0], motion[1]
    A.x, A.y, A.z, A.vx, A.vy, A.vz, A.wx, A.wy, A.wz = ax, ay, az, avx, avy, avz, awx, awy, awz
    B.x, B.y, B.z, B.vx, B.vy, B.vz, B.wx, B.wy, B.wz = bx, by, bz, bvx, bvy, bvz, bwx, bwy, bwz
    A.ax, A.ay, A.az, B.ax, B.ay, B.az = aax, aay, aaz, bax, bay, baz
    A.course, A.rest, B.course, B.rest = int(course_a), rest_a, int(course_b), rest_b
    set_rotation(scratch, ai, aj, ak, aw, A.rotation)
    set_rotation(scratch, bi, bj, bk, bw, B.rotation)
    search, chains = ImpactQuery(separation, tolerance, iterations), (np.int32(a), np.int32(b))
    return first_impact_in(table, parts, chains, Window(begin, horizon), search, scratch, (motion, event, row))


@inlined
def set_pair(table: Any, parts: Any, chains: Any, motion: Any, motions_a: Any, i: int, motions_b: Any, j: int) -> None:
    """Set two motions of chains to the rows i and j of motions (N, NUMBERS), without an end."""
    set_motion(motion[0], motions_a, i)
    set_motion(motion[1], motions_b, j)
    _set_chain(table, parts, chains[0], motion[0], inf)
    _set_chain(table, parts, chains[1], motion[1], inf)


@kernel
def impacts_of_chains(
    table: ShapeTable, parts: Parts, scratch: Scratch, moving: Any, firsts_a: Any, motions_a: Any, firsts_b: Any,
    motions_b: Any, query: Any, rows: Any,
) -> None:  # fmt: skip
    """Write lower, upper (s) and code of N pairs to rows (N, 3).

    firsts (N,) or (1,): slots; a negative one leaves its pair out. motions (N, NUMBERS) or (1, NUMBERS). query (4,): of
    MotionQuery. moving: motions, event and row, as for one pair.
    """
    search, window = ImpactQuery(query[2], query[1], int(query[3])), Window(0.0, query[0])
    for k in range(len(rows)):
        chains = firsts_a[min(k, len(firsts_a) - 1)], firsts_b[min(k, len(firsts_b) - 1)]
        if chains[0] >= 0 and chains[1] >= 0:
            set_motion(moving[0][0], motions_a, min(k, len(motions_a) - 1))
            set_motion(moving[0][1], motions_b, min(k, len(motions_b) - 1))
            rows[k, 0], rows[k, 1], rows[k, 2] = first_impact_in(table, parts, chains, window, search, scratch, moving)


@kernel
def impact_of_pieces(
    table: ShapeTable, parts: Parts, scratch: Scratch, moving: Any, chains: Any, pieces: Any, first: int, query: Any
) -> tuple[int, float, float, int]:
    """The first of the PairPieces, from `first` on, within which two chains meet, with lower, upper (s) and code.

    Times are from its begin on; the piece is that after the last if they never meet. query (4,): as above.
    """
    borders, numbers_a, numbers_b, tubes = pieces
    search, motion = ImpactQuery(query[2], query[1], int(query[3])), moving[0]
    found, k = (inf, inf, DECIDED), first
    while k < len(numbers_a):
        set_motion(motion[0], numbers_a, k)
        set_motion(motion[1], numbers_b, k)
        motion[0].tube_0, motion[1].tube_0 = tubes[k, 0], tubes[k, 1]
        found = first_impact_in(table, parts, chains, Window(0.0, borders[k + 1] - borders[k]), search, scratch, moving)
        if found[0] < inf:
            break
        k += 1
    motion[0].tube_0 = motion[1].tube_0 = 0.0
    return k, found[0], found[1], found[2]


@kernel
def touching_chains(
    table: ShapeTable, parts: Parts, scratch: Scratch, motion: Any, chains: Any, numbers: Any, slots: Any, query: Any
) -> tuple[float, float]:
    """First impact of all pairs of slots of two objects that touch at the start: lower, upper (s), infinite for none.

    chains: their own first slots. numbers (2, NUMBERS): their motions. slots: those of their pieces (n,) and (m,).
    query: as above.
    """
    A, B, window = motion[0], motion[1], Window(0.0, query[0])
    set_pair(table, parts, chains, motion, numbers, 0, numbers, 1)
    skin = 2.0 * _round_off(A, B)
    search = ImpactQuery(query[2], query[1], int(query[3]))
    deeper = ImpactQuery(search.margin - skin, search.tolerance, search.iterations)
    lower = upper = inf
    for a in slots[0]:
        for b in slots[1]:
            pair, wanted, left = ShapePair(A, B, a, b), search, Window(0.0, min(window.end, lower))
            scratch.answer[PLACE_A] = -1.0
            status, t, _, guess = shape_impact(table, parts, pair, left, STILL, search, scratch)
            if status == CLEAR:
                continue
            if t <= 0.0:
                apart = 2.0 * search.tolerance
                what, t = touching_impact(table, parts, pair, left, skin, apart, search.margin, scratch)
                if what == RESTS:
                    continue
                if what == DEEPENS:
                    wanted, guess = deeper, 0.0
                else:
                    left = Window(t, left.end)
                    status, t, _, guess = shape_impact(table, parts, pair, left, STILL, search, scratch)
                    if status == CLEAR:
                        continue
            lower = min(lower, t)
            places = NO_PLACES
            if wanted.margin == search.margin:
                places = int(scratch.answer[PLACE_A]), int(scratch.answer[PLACE_B])
            near = status, t, guess, places
            sure, _ = first_overlap(table, parts, pair, near, window, STILL, wanted, scratch)
            upper = min(upper, sure)
    return lower, upper if upper <= window.end else inf


@kernel
def certain_overlap_of_chains(
    table: ShapeTable, parts: Parts, scratch: Scratch, motion: Any, chains: Any, numbers: Any, query: Any
) -> float:
    """Least `overlap_time` (s) within the horizon of the pairs of two chains; infinite: none found.

    Arguments: as above. Only for meshes; it finds overlaps where no triangles cross because they lie in one plane.
    """
    window = Window(0.0, query[0])
    set_pair(table, parts, chains, motion, numbers, 0, numbers, 1)
    A, B = motion[0], motion[1]
    deeper = ImpactQuery(query[2] - 2.0 * _round_off(A, B), query[1], int(query[3]))
    a, first_b = chains[0], chains[1]
    b, best = first_b, inf
    while a >= 0:
        pair = ShapePair(A, B, a, b)
        best = overlap_time(table, parts, pair, (0.0, best), window, STILL, deeper, scratch)
        a, b = next_pair(parts, first_b, a, b)
    return best


def first_impact(
    a: int, motion_a: Motion, b: int, motion_b: Motion, query: MotionQuery, begin: float = 0.0
) -> tuple[float, float, int]:
    """Lower, upper (s) and code of two chains of the library."""
    found: tuple[float, float, int] = impact_of_chains.entry(
        *LIBRARY.arrays, *MEMORY.arrays, a, *motion_a.pose.numbers, *motion_a.numbers,
        b, *motion_b.pose.numbers, *motion_b.numbers, *query, begin,
    )  # fmt: skip
    return found


def first_impact_of_pieces(
    chains: tuple[int, int], pieces: PairPieces, first: int, query: MotionQuery
) -> tuple[int, float, float, int]:
    """Index of the first piece, from `first` on, within which two chains of the library meet; lower, upper and code."""
    of_library, of_thread, numbers = LIBRARY.tuples, (MEMORY.scratch, MEMORY.moving), np.array(query, np.float64)
    return impact_of_pieces(*of_library, *of_thread, _chains(chains), tuple(pieces), first, numbers)


def first_impact_of_touching(
    chains: tuple[int, int], motions: tuple[Motion, Motion], pieces: tuple[Slots, Slots], query: MotionQuery
) -> tuple[float, float]:
    """Lower and upper (s) of two chains of the library that touch at the start, by their pieces."""
    slots = tuple(np.array(each.numbers, np.int32) for each in pieces)
    given = _chains(chains), _motions(motions), slots, np.array(query, np.float64)
    found: tuple[float, float] = touching_chains(*LIBRARY.tuples, MEMORY.scratch, MEMORY.motion, *given)
    return found


def first_certain_overlap(chains: tuple[int, int], motions: tuple[Motion, Motion], query: MotionQuery) -> float:
    """A time (s) at which two chains of the library certainly overlap although they only touch before."""
    given = _chains(chains), _motions(motions), np.array(query, np.float64)
    return float(certain_overlap_of_chains(*LIBRARY.tuples, MEMORY.scratch, MEMORY.motion, *given))


def _chains(chains: tuple[int, int]) -> tuple[np.int32, np.int32]:
    return np.int32(chains[0]), np.int32(chains[1])


def _motions(motions: tuple[Motion, Motion]) -> NDArray[np.float64]:
    return np.array([[*each.pose.numbers, *each.numbers] for each in motions])
