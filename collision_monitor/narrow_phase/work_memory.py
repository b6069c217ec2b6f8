"""Scratch memory of the pair tests: one array for each thread, divided into named sections.

The sections below are those of GJK and EPA, which work in A's frame. box_box, manifold and dispatch divide the same
memory into sections of their own. No test reads what an earlier one left.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

MAX_VERTICES: Final = 512
"""Largest number of support points of EPA; 64 are enough for a pair of 32-vertex hulls."""

MAX_FACES: Final = 2 * MAX_VERTICES
"""A closed triangle surface has fewer than twice as many faces as vertices."""

SIMPLEX_ROW: Final = 8
"""Width of a row of the simplex: a point of B - A, the point on A at ON_A, and two unused numbers."""

ON_A: Final = 3

_SECTIONS: Final = {
    "R_AB": 9,  # rotation of B in A's frame, row by row
    "P_AB": 3,  # position of B in A's frame
    "weights": 4,  # of the simplex points in the closest point
    "new_weights": 4,  # those of the next simplex, until it proves to be nearer
    "unused": 4,  # rows of the simplex begin at multiples of eight
    "simplex": SIMPLEX_ROW * MAX_VERTICES,
    "faces": 7 * MAX_FACES,  # normal x, y, z, distance and three vertices: MAX_FACES numbers each
    "edges": 2 * 3 * MAX_FACES,  # EPA's horizon: start and end of each edge
}
_BEGIN: Final = dict(zip(_SECTIONS, accumulate(_SECTIONS.values(), initial=0), strict=False))

R_AB: Final = _BEGIN["R_AB"]
P_AB: Final = _BEGIN["P_AB"]
WEIGHTS: Final = _BEGIN["weights"]
NEW_WEIGHTS: Final = _BEGIN["new_weights"]
SIMPLEX: Final = _BEGIN["simplex"]
FACES: Final = _BEGIN["faces"]
EDGES: Final = _BEGIN["edges"]
WORK_SIZE: Final = sum(_SECTIONS.values())

SPARE: Final = SIMPLEX + 4 * SIMPLEX_ROW
"""Row behind those of a tetrahedron, for a candidate that may be rejected."""


def work_array() -> NDArray[np.float64]:
    """Allocate the scratch memory of one thread."""
    return np.zeros(WORK_SIZE)
