"""Where a pair test writes its answer, and how much scratch memory it needs.

Every test works relative to A's origin, in world axes, with the normal from A to B:
separation -> out[0:3] unit direction; contact -> out[0:15]:

    0 signed distance (m)   1:4 normal   4:7 witness on A   7:10 witness on B = witness on A + distance * normal
    10 error bound (m)      11, 12 feature type and index on A   13, 14 the same on B (types of Contact.msg)
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined

CONTACT_SIZE: Final = 15

UNKNOWN: Final = 0.0
VERTEX: Final = 1.0
EDGE: Final = 2.0
FACE: Final = 3.0
SURFACE: Final = 4.0

MAX_VERTICES: Final = 512
"""Support points that EPA may take; 64 already settle a pair of 32-vertex hulls."""

MAX_FACES: Final = 2 * MAX_VERTICES
"""A closed triangle surface has fewer than twice as many faces as vertices."""

SIMPLEX: Final = 24
"""Start of the points (rows of 8: B - A, point on A, index on A, index on B); 0:12 hold the pose of B in A's frame."""

FACES: Final = SIMPLEX + 8 * MAX_VERTICES
"""Start of EPA's faces: MAX_FACES each of normal x, y, z, distance and three vertices."""

EDGES: Final = FACES + 7 * MAX_FACES
"""Start of EPA's horizon: two rows of 3 * MAX_FACES."""

WORK_SIZE: Final = EDGES + 6 * MAX_FACES


def work_array() -> NDArray[np.float64]:
    """Scratch memory for one thread; its content never carries over from one call to the next."""
    return np.zeros(WORK_SIZE)


@inlined
def write(
    out: Any, distance: float, nx: float, ny: float, nz: float, ax: float, ay: float, az: float, bound: float
) -> None:
    """Distance, normal, witness points and error bound; the features stay unknown."""
    out[0] = distance
    out[1] = nx
    out[2] = ny
    out[3] = nz
    out[4] = ax
    out[5] = ay
    out[6] = az
    out[7] = ax + distance * nx
    out[8] = ay + distance * ny
    out[9] = az + distance * nz
    out[10] = bound
    for i in range(11, 15):
        out[i] = UNKNOWN
