"""Row to which a pair test writes a contact, with the names of its columns for kernels and for NumPy.

Every test works relative to A's origin, in world axes, with the normal from A to B. CONTACT_ROW is the layout. The
constants below are the first columns of its fields.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector

CONTACT_ROW: Final = np.dtype(
    [
        ("distance", np.float64),  # signed (m)
        ("normal", np.float64, 3),  # unit, from A to B
        ("point_a", np.float64, 3),  # witness on A (m)
        ("point_b", np.float64, 3),  # witness on B: the one on A + distance * normal
        ("bound", np.float64),  # error bound of the distance (m)
        ("feature_type_a", np.float64),  # a type of Contact.msg, see below
        ("feature_index_a", np.float64),
        ("feature_type_b", np.float64),
        ("feature_index_b", np.float64),
    ]
)


def first_column(row: np.dtype[np.void], field: str) -> int:
    """First column of a field in a row of float64."""
    assert row.fields is not None
    return int(row.fields[field][1]) // 8


DISTANCE: Final = first_column(CONTACT_ROW, "distance")
NORMAL: Final = first_column(CONTACT_ROW, "normal")
POINT_A: Final = first_column(CONTACT_ROW, "point_a")
POINT_B: Final = first_column(CONTACT_ROW, "point_b")
BOUND: Final = first_column(CONTACT_ROW, "bound")
FEATURE_TYPE_A: Final = first_column(CONTACT_ROW, "feature_type_a")
FEATURE_INDEX_A: Final = first_column(CONTACT_ROW, "feature_index_a")
FEATURE_TYPE_B: Final = first_column(CONTACT_ROW, "feature_type_b")
FEATURE_INDEX_B: Final = first_column(CONTACT_ROW, "feature_index_b")
CONTACT_SIZE: Final = CONTACT_ROW.itemsize // 8

UNKNOWN: Final = 0.0
VERTEX: Final = 1.0
EDGE: Final = 2.0
FACE: Final = 3.0
SURFACE: Final = 4.0


def as_contacts(rows: NDArray[np.float64]) -> NDArray[np.void]:
    """View rows (..., CONTACT_SIZE) as records (...,) of CONTACT_ROW."""
    return rows.view(CONTACT_ROW)[..., 0]


@inlined
def write(out: Any, distance: float, normal: Vector, point_a: Vector, bound: float) -> None:
    """Write distance, normal, witness points and error bound to a row; its features become UNKNOWN."""
    nx, ny, nz = normal
    ax, ay, az = point_a
    out[DISTANCE] = distance
    out[NORMAL] = nx
    out[NORMAL + 1] = ny
    out[NORMAL + 2] = nz
    out[POINT_A] = ax
    out[POINT_A + 1] = ay
    out[POINT_A + 2] = az
    out[POINT_B] = ax + distance * nx
    out[POINT_B + 1] = ay + distance * ny
    out[POINT_B + 2] = az + distance * nz
    out[BOUND] = bound
    for i in range(FEATURE_TYPE_A, CONTACT_SIZE):
        out[i] = UNKNOWN
