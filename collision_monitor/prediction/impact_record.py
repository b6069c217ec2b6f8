"""One predicted impact of two bodies as a record, and whether the motions it rests on still hold."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.records import Method, PredictionStatus

HIT: Final = int(PredictionStatus.HIT)


UNRESOLVED: Final = int(PredictionStatus.UNRESOLVED)


CLEAR: Final = 2


CLOSED_FORM: Final = int(Method.CLOSED_FORM)


CONSERVATIVE_ADVANCEMENT: Final = int(Method.CONSERVATIVE_ADVANCEMENT)


BOUND_ONLY: Final = int(Method.BOUND)


TREE_BOUND: Final = 255
"""The same of a pair whose sphere trees were looked at; told as BOUND too."""


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
        ("key", np.uint64),  # (smaller id << 32) | larger id
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
"""One predicted impact. The versions tell whether the motions it rests on still hold."""


@device
def has_changed(bodies, event):
    """Does the event rest on a motion that no longer holds?"""
    return bodies.version[event.i] != event.version_i or bodies.version[event.j] != event.version_j


@inlined
def holds(version, event):
    """Does the event rest on motions that have not changed since?"""
    return version[event.i] == event.version_i and version[event.j] == event.version_j
