"""`conflicts`: all conflicts of the plans of many objects with each other and with a static world."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from collision_monitor.checks.numbers import checked_number, checked_whole
from collision_monitor.errors import InputError
from collision_monitor.meshes.trees.shape_trees import CERTAIN
from collision_monitor.motion.trajectory import pair_pieces
from collision_monitor.query.conflicts.encounter_kernel import find_entries, find_exits
from collision_monitor.query.conflicts.encounters import Encounters, encounters
from collision_monitor.query.conflicts.fleet import Name, PlannedFleet, make_fleet
from collision_monitor.query.contact.contact import Contact, contact
from collision_monitor.query.impact.contact_intervals import intervals_from
from collision_monitor.query.impact.exit_kernel import exit_memory
from collision_monitor.query.impact.impact_kernel import DECIDED, MEMORY
from collision_monitor.query.impact.impact_query import ITERATIONS, MotionQuery, check_query
from collision_monitor.query.impact.planned_impact import PlannedPair
from collision_monitor.query.library import LIBRARY

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Conflict:
    """Two objects that are in contact for a time: bounds on its begin and on its end (s), see ContactInterval.

    a, b: their names. b is None where the plan of a is unknown from then on: it may meet anything.
    entry: there is no contact before the first, and there is at the second. exit: there is contact until the first, and
    none at the second; infinite: it lasts to the horizon. Of an unresolved conflict the second entry is infinite, and
    the second exit is a time at which the two are apart.

    >>> Conflict("cart", "door", entry=(0.5, 0.5), exit=(0.7, 0.7)).status
    'hit'
    """

    a: Name
    b: Name | None
    entry: tuple[float, float]
    exit: tuple[float, float]
    sides: tuple[Any, ...] = field(default=(), repr=False, compare=False)
    """Shape and motion of a, then of b."""

    @property
    def status(self) -> Literal["hit", "unresolved"]:
        """Whether the contact is certain. Treat what is unresolved as a contact from entry[0] on."""
        return "hit" if self.entry[1] < inf else "unresolved"

    @cached_property
    def contact(self) -> Contact | None:
        """The contact at the begin; None where b is."""
        if not self.sides:
            return None
        t = self.entry[1] if self.entry[1] < inf else self.entry[0]
        shape_a, motion_a, shape_b, motion_b = self.sides
        return contact(shape_a, motion_a.at(t), shape_b, motion_b.at(t))


def conflicts(
    objects: Any,
    trajectories: Any,
    static: Any = (),
    horizon: float | None = None,
    tolerance: float = 3e-8,
    separation: float = 0.0,
    iterations: int = ITERATIONS,
    most: int = 100,
    ignore: Iterable[tuple[Name, Name]] = (),
) -> list[Conflict]:
    """All conflicts between now and the horizon (s) of objects with plans, soonest first.

    objects: shapes or compounds by name, or in a list. trajectories: the Trajectory or Motion of each, by the same
    names. static: what stands, by name or in a list: (shape or compound, pose), or one in world coordinates. horizon:
    by default the end of the last plan. A conflict is a time in which two are within `separation` (m) of each other;
    tolerance (m), iterations: as for `impacts`. most: conflicts of one pair and one encounter; what follows is one that
    is unresolved. ignore: pairs of names that may touch.
    The boxes of all objects are swept through one span of time after the other (sweep and prune in space and time), and
    each pair whose boxes meet is answered as `impacts` does. 1,000 robots with a minute each take a few seconds.
    Raises InputError, ShapeError, PoseError; UnsupportedError for a plane shape with a solid one, or a HalfSpace with a
    plan; TooCostlyError where too many are near each other.

    >>> import collision_monitor as cm
    >>> plans = {"north": cm.Trajectory([0, 10], [(0, -5, 0), (0, 5, 0)]),
    ...          "east": cm.Trajectory([0, 10], [(-5, 0, 0), (5, 0, 0)])}
    >>> found = cm.conflicts(dict.fromkeys(plans, cm.Circle(0.5)), plans, static={"post": (cm.Circle(0.1), (0, 4, 0))})
    >>> [(each.a, each.b, round(each.entry[1], 3), round(each.exit[0], 3)) for each in found]
    [('north', 'east', 4.293, 5.707), ('north', 'post', 8.4, 9.6)]
    """
    fleet, most = make_fleet(objects, trajectories, static), checked_whole(most, "most")
    end = float(fleet.ends.max(initial=-inf)) if horizon is None else checked_number(horizon, "horizon", least=0.0)
    if not fleet.moving:
        return []
    if end == -inf:
        raise InputError("horizon: expected one where no object has a Trajectory, got none")
    if not end > 0.0:
        raise InputError(f"trajectories: expected a plan that ends in the future, got the last end at {end:g} s")
    query = check_query(end, tolerance, separation, iterations)
    met = encounters(fleet, end, separation + 4.0 * tolerance, _ignored(fleet, ignore))
    which, times = _all_intervals(fleet, met, query, most)
    order = np.lexsort((which[:, 1], which[:, 0], times[:, 0]))
    found = [_conflict(fleet, which[k].tolist(), times[k].tolist()) for k in order]
    unknown = [i for i in range(fleet.moving) if fleet.pieces.until[i] < end]
    for i in unknown:
        since = (max(float(fleet.pieces.until[i]), 0.0), inf)
        found.append(Conflict(fleet.names[i], None, since, since))
    return sorted(found, key=lambda each: each.entry[0]) if unknown else found


def _conflict(fleet: PlannedFleet, pair: list[int], times: list[float]) -> Conflict:
    i, j = pair
    sides = fleet.bodies[i].shapes, fleet.motions[i], fleet.bodies[j].shapes, fleet.motions[j]
    return Conflict(fleet.names[i], fleet.names[j], (times[0], times[1]), (times[2], times[3]), sides)


def _ignored(fleet: PlannedFleet, ignore: Iterable[tuple[Name, Name]]) -> NDArray[np.int64]:
    """Keys i * N + j, i < j, of pairs of names. Raises InputError."""
    place = {name: k for k, name in enumerate(fleet.names)}
    found = set()
    for pair in ignore:
        if not (isinstance(pair, tuple) and len(pair) == 2 and pair[0] in place and pair[1] in place):
            raise InputError(f"ignore: expected pairs of names of objects, got {pair!r:.100}")
        i, j = sorted(place[name] for name in pair)
        found.add(i * len(place) + j)
    return np.array(sorted(found), np.int64)


def _all_intervals(
    fleet: PlannedFleet, met: Encounters, query: MotionQuery, most: int
) -> tuple[NDArray[np.int64], Array]:
    """Pairs (C, 2) of bodies in contact, and times (C, 4) of their entries and exits (s)."""
    pairs, ends = met.pairs, met.windows[:, 1]
    has_mesh = _either([body.has_mesh for body in fleet.bodies], pairs)
    is_open = _either([body.inside != CERTAIN for body in fleet.bodies], pairs)
    left, begins = np.flatnonzero(~is_open), met.windows[~is_open, 0]
    which, times = [np.zeros(0, np.int64)], [np.zeros((0, 4))]
    single = [(k, float(met.windows[k, 0])) for k in np.flatnonzero(is_open).tolist()]
    for _ in range(most):
        if not len(left):
            break
        entries = _entries(fleet, pairs[left], np.stack([begins, ends[left]], axis=1), query)
        meets = entries[:, 0] < inf
        by_itself = meets & ((entries[:, 2] != DECIDED) | has_mesh[left])
        single += zip(left[by_itself].tolist(), begins[by_itself].tolist(), strict=True)
        meets &= ~by_itself
        left, entries = left[meets], entries[meets, :2]
        exits, hits = np.stack([entries[:, 0], np.full(len(left), inf)], axis=1), entries[:, 1] < inf
        within = np.stack([entries[hits, 1], ends[left[hits]]], axis=1)
        exits[hits] = _exits(fleet, pairs[left[hits]], within, query)
        which.append(left)
        times.append(np.concatenate([entries, exits], axis=1))
        goes_on = exits[:, 1] < ends[left]
        left, begins = left[goes_on], exits[goes_on, 1]
    which.append(left)
    times.append(np.stack([begins[: len(left)], np.full(len(left), inf)] * 2, axis=1))
    for k, begin in single:
        rows = _single(fleet, pairs[k].tolist(), (begin, float(ends[k])), query, most)
        which.append(np.full(len(rows), k))
        times.append(rows)
    of, rows = np.concatenate(which), np.concatenate(times)
    is_over = (rows[:, 3] == inf) & met.parts[of]
    rows[is_over, 3] = ends[of[is_over]]
    return pairs[of], rows


def _either(flags: list[bool], pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether one of each pair (W, 2) of bodies has its flag."""
    given = np.array(flags, np.bool_)
    return np.asarray(given[pairs[:, 0]] | given[pairs[:, 1]])


def _entries(fleet: PlannedFleet, pairs: NDArray[np.int64], windows: Array, query: MotionQuery) -> Array:
    rows = np.empty((len(pairs), 3))
    find_entries(
        *LIBRARY.tuples, MEMORY.scratch, MEMORY.moving, fleet.pieces, pairs, windows, np.array(query, np.float64),
        exit_memory(), rows,
    )  # fmt: skip
    return rows


def _exits(fleet: PlannedFleet, pairs: NDArray[np.int64], windows: Array, query: MotionQuery) -> Array:
    rows = np.empty((len(pairs), 2))
    find_exits(
        *LIBRARY.tuples, MEMORY.scratch, fleet.pieces, pairs, windows, np.array(query, np.float64), exit_memory(),
        np.zeros(4), rows,
    )  # fmt: skip
    return rows


def _single(fleet: PlannedFleet, pair: list[int], window: tuple[float, float], query: MotionQuery, most: int) -> Array:
    """The intervals (I, 4) of one pair that the kernels leave open; what follows `most` of them is unresolved."""
    i, j = pair
    begin, end = window
    pieces = pair_pieces(fleet.motions[i], fleet.motions[j], end)
    planned = PlannedPair(fleet.bodies[i], fleet.bodies[j], pieces)
    found = intervals_from(planned, query._replace(horizon=end), begin, most)
    rows = [(*each.entry, *each.exit) for each in found]
    if len(found) == most and found[-1].exit[1] < end:
        rows.append((found[-1].exit[1], inf, found[-1].exit[1], inf))
    return np.array(rows).reshape(-1, 4)
