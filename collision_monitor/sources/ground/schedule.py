"""When an object is where, by declaration: a gate, a door, a conveyor. The key `schedule` of an entry.

gate:
  shape: {box: [0.2, 4, 1.2]}
  schedule:
    poses: {closed: [4, 0, 0.6], open: [4, 3.8, 0.6]}         # in `frame`, else in the monitor's
    at: {0: closed, 3: closed, 5: open, 9: open, 11: closed}  # s: where it is then
    moves: smooth                                             # from rest to rest; or `steady`, with one speed
    repeat: 14                                                # s, after which it begins anew
    begin: 1732780800.0                                       # s of the stamps: time 0; else the first step
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.yaml_table import known, number, pose, table, text

Floats = NDArray[np.float64]

MOST_STOPS: Final = 1000
"""Entries of `at`."""

PARTS: Final = 32
"""Pieces of a smooth move. Each has a constant speed, so that the move is off its time law by 0.0007 of its length."""

SHORTEST_REPEAT: Final = 0.1
"""s. Shorter: more plans than steps."""

SAME_TIME: Final = 1e-6
"""s: two entries of `at` that are nearer are one."""

_KEYS: Final = ("poses", "at", "moves", "repeat", "begin", "frame")


class Schedule(NamedTuple):
    """Where an object is when, from time 0 on. cycle: one round of it, or all.

    repeat: s; 0: it ends. closed: whether a round ends where it begins; otherwise the object jumps back, as the load of
    a conveyor. begin: time 0, s of the stamps; None: the first step. frame: of the poses; empty: the monitor's.
    """

    cycle: Trajectory
    repeat: float
    closed: bool
    begin: float | None
    frame: str


def read_schedule(value: Any, name: str) -> Schedule:
    """Return the schedule of an entry. Raises InputError."""
    what = f"{name}, schedule"
    given = table(value, what, _KEYS)
    poses = given.get("poses")
    if not isinstance(poses, dict) or not poses:
        raise InputError(f"{name}, poses: expected a table of names, as `open: [x, y, z]`, got {poses!r:.100}")
    named = {str(key): pose(each, f"{name}, poses, {key}") for key, each in poses.items()}
    known(str(given.get("moves", "smooth")), ("smooth", "steady"), f"{name}, moves")
    repeat = number(given["repeat"], f"{name}, repeat", "s", least=SHORTEST_REPEAT) if "repeat" in given else 0.0
    times, stops = _stops(given.get("at"), name, named, repeat)
    closed = stops[0] is stops[-1] or np.array_equal(stops[0].numbers, stops[-1].numbers)
    if given.get("moves", "smooth") == "smooth":
        times, rows = _smooth(times, stops)
    else:
        rows = np.array([each.numbers for each in stops])
    begin = number(given["begin"], f"{name}, begin", "s", most=1e10) if "begin" in given else None
    try:
        cycle = Trajectory(times, rows, between="arc")
    except CollisionMonitorError as error:
        raise InputError(f"{name}, at: {error}") from None
    return Schedule(cycle, repeat, closed, begin, text(given.get("frame", ""), f"{name}, frame").removeprefix("/"))


def _stops(at: Any, name: str, named: Mapping[str, Pose], repeat: float) -> tuple[Floats, list[Pose]]:
    """Return the rising times of `at` (K,) and the poses then; with `repeat`, up to the end of the round."""
    if not isinstance(at, dict) or not 0 < len(at) <= MOST_STOPS:
        raise InputError(f"{name}, at: expected 1 to {MOST_STOPS} times with poses, as `3.0: open`, got {at!r:.100}")
    times, stops = [], []
    for key, word in at.items():
        times.append(number(key, f"{name}, at", "s"))
        known(str(word), tuple(named), f"{name}, at, {key}")
        stops.append(named[str(word)])
        if len(times) > 1 and not times[-1] - times[-2] > SAME_TIME:
            raise InputError(f"{name}, at: expected rising times, got {times[-2]:g} and then {times[-1]:g}")
    if times[0] > 0.0:  # it stands there from time 0 on
        times, stops = [0.0, *times], [stops[0], *stops]
    if repeat:
        if times[-1] > repeat + SAME_TIME:
            raise InputError(f"{name}, at: expected times up to `repeat`, {repeat:g} s, got {times[-1]:g}")
        if times[-1] < repeat - SAME_TIME:
            times, stops = [*times, repeat], [*stops, stops[0]]
    if len(times) == 1:
        times, stops = [*times, times[0] + 1.0], stops * 2
    return np.array(times), stops


def _smooth(times: Floats, stops: list[Pose]) -> tuple[Floats, Floats]:
    """Return times and poses (M, 7) on the screws between the stops, from rest to rest: 3 u^2 - 2 u^3 of the way."""
    u = np.arange(1, PARTS + 1) / PARTS
    way = u * u * (3.0 - 2.0 * u)
    found_times, rows = [times[:1]], [np.array([stops[0].numbers])]
    for begin, end, one, other in zip(times, times[1:], stops, stops[1:], strict=False):
        if one is other or np.array_equal(one.numbers, other.numbers):
            found_times.append(np.array([end]))
            rows.append(np.array([other.numbers]))
            continue
        screw = Trajectory([0.0, 1.0], [one, other], between="arc").rows(way)[:, :7]
        screw[-1] = other.numbers
        found_times.append(np.append(begin + (end - begin) * u[:-1], end))
        rows.append(screw)
    return np.concatenate(found_times), np.concatenate(rows)
