"""Record of one predicted impact of two bodies: its key, its status, and the versions of the motions it rests on."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined
from collision_monitor.records import Method, PredictionStatus

HIT: Final = int(PredictionStatus.HIT)
UNRESOLVED: Final = int(PredictionStatus.UNRESOLVED)
CLEAR: Final = 254
"""No impact. It is never published, and differs from every PredictionStatus."""

CLOSED_FORM: Final = int(Method.CLOSED_FORM)
CONSERVATIVE_ADVANCEMENT: Final = int(Method.CONSERVATIVE_ADVANCEMENT)
BOUND_ONLY: Final = int(Method.BOUND)
TREE_BOUND: Final = 255
"""A bound by the bodies' sphere trees; BOUND_ONLY events have not used them yet. Published as BOUND too."""

IMPACT = np.dtype(
    [
        ("lower", np.float64),  # s after the monitor's origin, like all times here
        ("upper", np.float64),
        ("point_x", np.float64),
        ("point_y", np.float64),
        ("point_z", np.float64),
        ("normal_x", np.float64),
        ("normal_y", np.float64),
        ("normal_z", np.float64),
        ("closing_speed", np.float64),
        ("key", np.uint64),  # pair_key of the ids
        ("i", np.int32),  # body slots; body i has the smaller id
        ("j", np.int32),
        ("version_i", np.uint32),
        ("version_j", np.uint32),
        ("shape_i", np.int32),  # slots in the shape table
        ("shape_j", np.int32),
        ("status", np.uint8),
        ("method", np.uint8),
    ]
)
"""One predicted impact. The versions show whether the motions that it rests on still hold."""


@inlined
def pair_key(id_a: Any, id_b: Any) -> Any:
    """Key of a pair: (smaller id << 32) | larger id. Pairs sorted by key are sorted by their ids."""
    return (np.uint64(min(id_a, id_b)) << np.uint64(32)) | np.uint64(max(id_a, id_b))


def pair_keys(id_a: NDArray[np.uint32], id_b: NDArray[np.uint32]) -> NDArray[np.uint64]:
    """`pair_key` for arrays of ids (n,) with id_a < id_b."""
    keys: NDArray[np.uint64] = (id_a.astype(np.uint64) << np.uint64(32)) | id_b
    return keys


@inlined
def ids_of(key: Any) -> Any:
    """The smaller and the larger id of a pair."""
    return key >> np.uint64(32), key & np.uint64(0xFFFFFFFF)


def ids_of_keys(keys: NDArray[np.uint64]) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """`ids_of` for an array of keys (n,)."""
    return keys >> np.uint64(32), keys & np.uint64(0xFFFFFFFF)


@inlined
def write_pair(bodies: Any, i: int, j: int, record: Any) -> None:
    """Write key, slots and versions of the pair of bodies i and j into a record (IMPACT, or one with these fields).

    Body i must have the smaller id.
    """
    record.key = pair_key(bodies.id[i], bodies.id[j])
    record.i, record.j = i, j
    record.version_i, record.version_j = bodies.version[i], bodies.version[j]


@inlined
def holds(version: Any, record: Any) -> bool:
    """Whether the motions that the record rests on are unchanged. version (N,): the bodies' current versions."""
    return version[record.i] == record.version_i and version[record.j] == record.version_j
