"""Which bodies of a fleet come near each other, and when: boxes that are swept through one span of time at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.box_pairs import box_pairs
from collision_monitor.errors import TooCostlyError
from collision_monitor.query.conflicts.encounter_kernel import one_swept, sweep_boxes
from collision_monitor.query.conflicts.fleet import PlannedFleet
from collision_monitor.tolerances import EPSILON

Array = NDArray[np.float64]
Keys = NDArray[np.int64]

MOST_SPANS: Final = 10_000
"""Spans of time. More: boxes of faster bodies are smaller; each takes 0.1 ms and 0.3 µs a body."""

FARTHEST: Final = 1.0
"""How far a body of mean speed moves in a span, in its radii. Larger: fewer spans, and larger boxes."""

MOST_ENCOUNTERS: Final = 20_000_000
"""Pairs and spans of time in which they are near each other, 32 bytes each."""


class Encounters(NamedTuple):
    """Pairs of bodies, and when their swept boxes meet. At the begin they are apart, unless it is 0."""

    pairs: NDArray[np.int64]  # (W, 2)
    windows: Array  # (W, 2): s
    parts: NDArray[np.bool_]  # (W,): whether they are apart at the end


def encounters(fleet: PlannedFleet, horizon: float, reach: float, ignored: Keys) -> Encounters:
    """The encounters between 0 and the horizon (s), in the order of their ends. Raises TooCostlyError.

    reach (m): the gap up to which a pair counts. ignored (K,): keys i * N + j of pairs, i < j, that do not count.
    """
    spans, open_keys, open_begins = _spans(fleet, horizon), np.zeros(0, np.int64), np.zeros(0)
    keys, begins, ends, total = [open_keys], [open_begins], [open_begins], 0
    times = np.linspace(0.0, horizon, spans + 1)
    for k, found in enumerate(_near_pairs(fleet, times, reach)):
        now = found if not len(ignored) else found[~np.isin(found, ignored)]
        stays = np.isin(open_keys, now, assume_unique=True)
        left = open_keys[~stays]
        if len(left):
            keys.append(left)
            begins.append(open_begins[~stays])
            ends.append(np.full(len(left), times[k]))
        open_keys, open_begins = open_keys[stays], open_begins[stays]
        fresh = now[~np.isin(now, open_keys, assume_unique=True)] if len(open_keys) else now
        total += len(fresh)
        if total > MOST_ENCOUNTERS:
            raise TooCostlyError(
                f"expected at most {MOST_ENCOUNTERS} encounters, got more by {times[k]:.3f} s; give fewer objects, or "
                "a shorter horizon"
            )
        open_keys = np.concatenate([open_keys, fresh])
        open_begins = np.concatenate([open_begins, np.full(len(fresh), times[k])])
    keys.append(open_keys)
    begins.append(open_begins)
    ends.append(np.full(len(open_keys), horizon))
    key, until = np.concatenate(keys), fleet.pieces.until
    pairs = np.stack(np.divmod(key, len(fleet)), axis=1)
    windows = np.stack([np.concatenate(begins), np.concatenate(ends)], axis=1)
    known = np.minimum(until[pairs].min(axis=1), horizon)
    parts = windows[:, 1] < known
    windows[:, 1] = np.minimum(windows[:, 1], known)
    return Encounters(pairs, windows, parts)


def _spans(fleet: PlannedFleet, horizon: float) -> int:
    """Number of the spans of time: in one, a body of mean speed moves by a part of its radius."""
    pieces, n = fleet.pieces, int(fleet.pieces.first[fleet.moving])
    begins, position = pieces.begins[:n], pieces.numbers[:n, :3]
    is_within = (begins[1:] > 0.0) & (begins[1:] < horizon)
    is_within[pieces.first[1 : fleet.moving] - 1] = False  # from the end of a plan to the next one
    way = float(np.linalg.norm(np.diff(position, axis=0), axis=1)[is_within].sum())
    size = float(pieces.radius[: fleet.moving].sum())
    return int(np.clip(way / (FARTHEST * size) if size > 0.0 else 1.0, 1, MOST_SPANS))


def _near_pairs(fleet: PlannedFleet, times: Array, reach: float) -> Iterator[Keys]:
    """Rising keys i * N + j, i < j, of the pairs whose boxes meet in each span of time; one of both has a plan."""
    pieces, count, moving = fleet.pieces, len(fleet), fleet.moving
    far = np.array([np.abs(pieces.numbers[pieces.first[i] : pieces.first[i + 1], :3]).max() for i in range(moving)])
    margins = 0.5 * reach + 16.0 * EPSILON * (far + pieces.radius[:moving])
    centre, half = np.zeros((2, count, 3))
    centre[moving:], half[moving:] = fleet.standing_boxes()
    half[moving:] += 0.5 * reach + 16.0 * EPSILON * (np.abs(centre[moving:]) + half[moving:])
    starts, one = np.arange(count) < moving, one_swept()
    for begin, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
        sweep_boxes(pieces, moving, begin, end, margins, one, centre, half)
        found = box_pairs(centre, half, starts).astype(np.int64)
        yield found[:, 0] * count + found[:, 1]
