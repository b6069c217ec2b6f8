"""Arrays of the monitor's input and output: structured dtypes with exactly the layout of the messages.

An array of these dtypes has the bytes of the message's sequence in little-endian CDR, so it is published and
recorded without conversion. `collision_monitor_msgs/msg/*.msg` documents units, frames and signs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

STATE = np.dtype(
    [
        ("position", "<f8", 3),
        ("quaternion", "<f8", 4),
        ("linear", "<f8", 3),
        ("angular", "<f8", 3),
        ("acceleration", "<f8", 3),
        ("position_stddev", "<f8"),
        ("orientation_stddev", "<f8"),
        ("velocity_stddev", "<f8"),
        ("angular_velocity_stddev", "<f8"),
        ("id", "<u4"),
        ("flags", "<u4"),
    ]
)

CONTACT = np.dtype(
    [
        ("signed_distance", "<f8"),
        ("error_bound", "<f8"),
        ("point_a", "<f8", 3),
        ("point_b", "<f8", 3),
        ("normal", "<f8", 3),
        ("closing_speed", "<f8"),
        ("duration", "<f8"),
        ("id_a", "<u4"),
        ("id_b", "<u4"),
        ("shape_a", "<u4"),
        ("shape_b", "<u4"),
        ("feature_index_a", "<u4"),
        ("feature_index_b", "<u4"),
        ("phase", "u1"),
        ("status", "u1"),
        ("model_a", "u1"),
        ("model_b", "u1"),
        ("feature_type_a", "u1"),
        ("feature_type_b", "u1"),
        ("point_index", "u1"),
        ("point_count", "u1"),
    ]
)

PREDICTION = np.dtype(
    [
        ("lower", "<f8"),
        ("upper", "<f8"),
        ("earliest", "<f8"),
        ("most_likely", "<f8"),
        ("latest", "<f8"),
        ("probability", "<f8"),
        ("point", "<f8", 3),
        ("normal", "<f8", 3),
        ("closing_speed", "<f8"),
        ("id_a", "<u4"),
        ("id_b", "<u4"),
        ("shape_a", "<u4"),
        ("shape_b", "<u4"),
        ("status", "u1"),
        ("method", "u1"),
        ("model_a", "u1"),
        ("model_b", "u1"),
        ("stale", "u1"),
        ("plans", "u1"),
        ("reserved", "u1", 2),
    ]
)


HELD_BACK = np.dtype(
    [
        ("time_to_collision", "<f8"),
        ("distance", "<f8"),
        ("closing_speed", "<f8"),
        ("point_a", "<f8", 3),
        ("point_b", "<f8", 3),
        ("id_a", "<u4"),
        ("id_b", "<u4"),
        ("rule", "<u4"),
        ("level", "<u4"),
    ]
)


MOST_POINTS = 4
"""Largest number of rows of one contact in a ContactArray: the corners that represent a contact patch."""


class StateFlag(IntFlag):
    """`ObjectState.flags`."""

    TWIST_UNKNOWN = 1
    ACCELERATION_VALID = 2
    DISCONTINUITY = 4
    YAW_ONLY = 8
    BODY_TWIST = 16
    STOPS = 32


class Phase(IntEnum):
    """`Contact.phase`."""

    PERSIST = 0
    BEGIN = 1
    END = 2


class ContactStatus(IntEnum):
    """`Contact.status`."""

    TOUCHING = 0
    UNRESOLVED = 1


class PredictionStatus(IntEnum):
    """`PredictedCollision.status`."""

    HIT = 0
    UNRESOLVED = 1
    POSSIBLE = 2


class PlanFlag(IntFlag):
    """Bits of `PredictedCollision.plans`: which of the two follows its plan, and which left the last one it had."""

    FOLLOWS_A = 1
    FOLLOWS_B = 2
    LEFT_A = 4
    LEFT_B = 8


class Method(IntEnum):
    """`PredictedCollision.method`."""

    CLOSED_FORM = 1
    CONSERVATIVE_ADVANCEMENT = 2
    SWEPT_SAT = 3
    BISECTION = 4
    BOUND = 5
    SAMPLING = 6


class Model(IntEnum):
    """`ObjectDescription.model` and the `model_*` fields of contacts and predictions.

    >>> Model.OBB.name
    'OBB'
    """

    AUTO = 0
    EXACT = 1
    SPHERE = 2
    AABB = 3
    OBB = 4
    KDOP6 = 5
    KDOP14 = 6
    KDOP18 = 7
    KDOP26 = 8
    CONVEX_HULL = 9
    CONVEX_DECOMPOSITION = 10


class ShapeType(IntEnum):
    """`Shape.type`; also the shape kinds of the kernels."""

    SPHERE = 1
    BOX = 2
    CAPSULE = 3
    CYLINDER = 4
    CONE = 5
    CONVEX_HULL = 6
    MESH = 7
    HALF_SPACE = 8
    CIRCLE = 9
    POLYGON = 10
    ELLIPSOID = 11
    POINTS = 12
    ROUNDED_BOX = 13
    TRUNCATED_CONE = 14
    GRID = 15
    VOXELS = 16
    HEIGHT_FIELD = 17


Rows = NDArray[np.void]


def joined(parts: Sequence[Rows]) -> Rows:
    """Concatenate arrays of one structured dtype."""
    kind = parts[0].dtype
    return np.concatenate([part.view(f"V{kind.itemsize}") for part in parts]).view(kind)


def data_frame(columns: NDArray[np.void] | Mapping[str, NDArray[Any]]) -> Any:
    """Return a pandas.DataFrame of a structured array or of arrays by name; a vector of three has columns _x, _y, _z.

    Raises ImportError without pandas.
    """
    try:
        from pandas import DataFrame
    except ImportError:
        raise ImportError("expected pandas, which this package does not require: pip install pandas") from None
    names = columns.dtype.names or () if isinstance(columns, np.ndarray) else tuple(columns)
    frame = {}
    for name in names:
        values = columns[name]
        if values.ndim == 1:
            frame[name] = values
        else:
            axes = "xyz" if values.shape[1] == 3 else [str(k) for k in range(values.shape[1])]
            frame |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate(axes)}
    return DataFrame(frame)
