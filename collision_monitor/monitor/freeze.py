"""A monitor's whole state into a snapshot, and a monitor out of it that goes on as the first one does.

Of one mind with monitor.py: it takes and sets what Monitor keeps to itself. Left out is what only saves time: the
slots of the last message's ids, scratch, room to grow, and the order of the boxes within the grid's cells.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor._jit.vectors import LANES
from collision_monitor.broad_phase.hashed_grid import regridded
from collision_monitor.errors import InputError, Refusal
from collision_monitor.geometry.shape_table import POLYGON, ShapeTable, ShapeTableBuilder
from collision_monitor.monitor import active_pairs
from collision_monitor.monitor.monitor import Monitor, StepResult, StepStatus
from collision_monitor.monitor.snapshot import Snapshot, check_range
from collision_monitor.monitor.uncertain_predictions import ENTRY
from collision_monitor.prediction.impact_record import IMPACT
from collision_monitor.prediction.motion import Bodies, Parts, enlarge, make_bodies, make_parts
from collision_monitor.prediction.spread import Spread
from collision_monitor.records import ShapeType
from collision_monitor.settings.profile import Profile

MONITOR = "monitor"
"""Whose facts these are."""


def freeze(monitor: Monitor) -> Snapshot:
    """Copies of all that the monitor's later answers depend on."""
    m, top, shapes, last = monitor, monitor._top, monitor._shapes.used, monitor._last
    free_shapes, free_blocks = m._shapes.free
    arrays = {
        **{f"bodies.{name}": column[:top].copy() for name, column in m._bodies._asdict().items()},
        **{f"spread.{name}": column[:top].copy() for name, column in m._uncertain.spread._asdict().items()},
        **{f"parts.{name}": column[: len(shapes.kind)].copy() for name, column in m._parts._asdict().items()},
        **{f"shapes.{name}": column.copy() for name, column in shapes._asdict().items()},
        "shapes.vertices": shapes.vertices.T.copy(),
        "boxes": m._grid.box[:top].copy(),
        "events": m._events.events.copy(),
        "possible": m._uncertain.entries.copy(),
        "pairs": m._pairs.copy(),
        "pair_events": m._pair_events.copy(),
        "outside": m._outside.copy(),
    }
    if last is not None:
        arrays |= {"contacts": last.contacts, "predictions": last.predictions}  # made anew in every step
    facts = {
        "step": m._step,
        "digest": m.digest,
        "refused": {reason.value: count for reason, count in m.refused.items()},
        "last_refusal": m.last_refusal,
        "names": {str(object_id): name for object_id, name in m._names.items()},
        "allowed": {str(object_id): sorted(others) for object_id, others in m._allowed.items()},
        "planar": m._planar,
        "uncertain": m._uncertain.active,
        "origin_ns": m._origin_ns,
        "now_ns": m._now_ns,
        "jump_ns": m._jump_ns,
        "renewed": sorted(m._renewed),
        "deferred": m._deferred,
        "orphans": list(m._orphans),
        "free": list(m._free),
        "free_shapes": free_shapes,
        "free_blocks": list(free_blocks.items()),
        "last": None if last is None else [last.stamp_ns, last.step, dataclasses.asdict(last.status)],
    }
    return Snapshot(arrays, {MONITOR: facts})


def thaw(profile: Profile | str, snapshot: Snapshot) -> Monitor:
    """The monitor again. Raises InputError where the snapshot is damaged, or of a program that keeps other things."""
    m = Monitor(profile, timed=False)
    try:
        facts = snapshot.facts[MONITOR]
        used = snapshot.array("bodies.used", m._bodies.used)
        _thaw_shapes(m, snapshot, facts)
        _thaw_bodies(m, snapshot, facts, len(used))
        _thaw_pairs(m, snapshot)
        m._step, m.digest, m._planar = facts["step"], facts["digest"], facts["planar"]
        m._uncertain.active = facts["uncertain"]
        m.refused = {reason: facts["refused"][reason.value] for reason in Refusal}
        m.last_refusal = facts["last_refusal"]
        m._deferred = int(facts["deferred"])
        m._origin_ns, m._now_ns, m._jump_ns = facts["origin_ns"], facts["now_ns"], facts["jump_ns"]
        m._orphans = [(key, since) for key, since in facts["orphans"]]
        if facts["last"] is not None:
            stamp_ns, step, status = facts["last"]
            contacts = snapshot.array("contacts", np.empty(0, records.CONTACT))
            predictions = snapshot.array("predictions", np.empty(0, records.PREDICTION))
            m._last = StepResult(stamp_ns, step, contacts, predictions, StepStatus(**status))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"snapshot: expected the state of a monitor of this version, got: {error!r}") from None
    return m


def _thaw_shapes(m: Monitor, snapshot: Snapshot, facts: dict[str, Any]) -> None:
    like = m._shapes.table
    kind = snapshot.array("shapes.kind", like.kind)
    vertices = snapshot.array("shapes.vertices", like.vertices.T).T
    index = snapshot.array("shapes.vertex_index", like.vertex_index, vertices.shape[1])
    rows = {
        name: snapshot.array(f"shapes.{name}", column, len(kind))
        for name, column in like._asdict().items()
        if name not in ("vertices", "vertex_index")
    }
    table = ShapeTable(**rows, vertices=vertices, vertex_index=index)
    check_range("shapes.kind", table.kind, 0, max(ShapeType) + 1)
    check_range("shapes.vertex_start", table.vertex_start, 0, len(index) + 1)
    check_range("shapes.vertex_count", table.vertex_count, 0, len(index) + 1)
    check_range("shapes.vertex_start", table.vertex_start + table.vertex_count, 0, len(index) + 1)
    hulls = np.isin(table.kind, (ShapeType.CONVEX_HULL, POLYGON))
    if (table.vertex_count[hulls] % LANES).any() or not table.vertex_count[hulls].all():
        raise InputError(f"snapshot, shapes.vertex_count: expected multiples of {LANES}, got others")
    corners = table.size[table.kind == POLYGON, 0]
    if not ((corners >= 1) & (corners <= table.vertex_count[table.kind == POLYGON])).all():
        raise InputError(f"snapshot, shapes.size: expected as many corners as there are, got {corners.tolist()}")
    free_blocks = {count: list(starts) for count, starts in facts["free_blocks"]}
    m._shapes = ShapeTableBuilder.restored(table, list(facts["free_shapes"]), free_blocks)


def _thaw_bodies(m: Monitor, snapshot: Snapshot, facts: dict[str, Any], top: int) -> None:
    count, capacity = len(m._shapes.used.kind), len(m._bodies.used)
    while capacity < top:
        capacity *= 2
    bodies = {name: snapshot.array(f"bodies.{name}", column, top) for name, column in m._bodies._asdict().items()}
    parts = {name: snapshot.array(f"parts.{name}", column, count) for name, column in m._parts._asdict().items()}
    _check_chains(Bodies(**bodies), Parts(**parts), m._shapes.used.kind)
    m._top, m._bodies, m._parts = top, make_bodies(capacity), make_parts(len(m._shapes.table.kind))
    enlarge(Bodies(**bodies), m._bodies)
    enlarge(Parts(**parts), m._parts)
    m._uncertain.enlarge(capacity)
    like = m._uncertain.spread._asdict()
    spread = {name: snapshot.array(f"spread.{name}", column, top) for name, column in like.items()}
    enlarge(Spread(**spread), m._uncertain.spread)
    m._grid = regridded(snapshot.array("boxes", m._grid.box, top), capacity)
    used = np.flatnonzero(bodies["used"])
    m._slots = dict(zip(bodies["id"][used].tolist(), used.tolist(), strict=True))
    m._names = {object_id: facts["names"][str(object_id)] for object_id in m._slots}
    for object_id, others in facts["allowed"].items():
        m._allow(int(object_id), frozenset(others))
    m._outside = snapshot.array("outside", np.zeros(0, np.bool_))[:top]
    m._free, m._renewed = list(facts["free"]), set(facts["renewed"])
    if sorted([*m._free, *used.tolist()]) != list(range(top)) or not m._renewed <= set(used.tolist()):
        raise InputError("snapshot: expected every slot of a body to be either used or free, got others")


def _check_chains(bodies: Bodies, parts: Parts, kind: NDArray[Any]) -> None:
    """Every body in use has shapes, and no chain of them leads round in a circle."""
    check_range("bodies.first_shape", bodies.first_shape, -1, len(kind))
    check_range("parts.next", parts.next, -1, len(kind))
    following, left = parts.next.tolist(), len(kind)
    for slot in bodies.first_shape[bodies.used].tolist():
        if slot < 0:
            raise InputError("snapshot, bodies.first_shape: expected a shape of each body, got none")
        while slot >= 0:
            left -= 1
            if left < 0 or not kind[slot]:
                raise InputError("snapshot, parts.next: expected chains of shapes, each of one body, got others")
            slot = following[slot]


def _thaw_pairs(m: Monitor, snapshot: Snapshot) -> None:
    events = snapshot.array("events", np.empty(0, IMPACT))
    pairs = snapshot.array("pairs", np.empty(0, active_pairs.PAIR))
    of_pairs = snapshot.array("pair_events", np.empty(0, IMPACT), len(pairs))
    possible = snapshot.array("possible", np.empty(0, ENTRY))
    for name, rows in (("events", events), ("pairs", pairs), ("pair_events", of_pairs), ("possible", possible)):
        check_range(name, rows["i"], 0, m._top)
        check_range(name, rows["j"], 0, m._top)
    for rows in (events, of_pairs):
        for shape in ("shape_i", "shape_j"):  # never read where the pair does not meet, and then anything
            np.clip(rows[shape], 0, max(len(m._parts.next) - 1, 0), out=rows[shape])
    m._events.events, m._pairs, m._pair_events = events, pairs, of_pairs
    m._uncertain.entries = possible
