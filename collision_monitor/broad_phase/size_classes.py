"""Size classes of bodies: bodies of similar size share the cells of one class.

A body searches for partners in its own class and the coarser ones, so that each pair is found once, by its smaller
body.
"""

from __future__ import annotations

from math import frexp
from typing import Any, Final

from collision_monitor._jit import device

MAX_CLASSES: Final = 32
"""Number of size classes; the last class also takes all smaller bodies."""

CROWDING: Final = 8.0
"""Sizes share a class while cells fitted to the largest hold at most this many times the candidates of cells fitted
to each body. Larger: small bodies among large ones are compared with too many. Smaller: more classes."""

LARGEST_BODY: Final = 2.0**200
"""Bodies with a larger half extent or coordinate (m) are compared with all, so that products of cells stay finite."""

STARTING: Final = MAX_CLASSES + 1
"""Number of classes of bodies that start a search: class 0 for unbounded bodies, then from large to small."""

CLASSES: Final = 2 * STARTING
"""Number of all classes: those of bodies that start a search, then those of bodies that do not, in the same order."""

ABSENT: Final = CLASSES
"""Class of the bodies that meet nothing."""

OCTAVES: Final = 512
"""Powers of two of the sizes that are counted."""


@device
def classify(size: Any, starts: Any, octave: Any, cubes: Any, grid: Any) -> None:
    """Assign bodies with half extent `size` (N,) m to classes; NaN: absent, beyond LARGEST_BODY: unbounded.

    octave (OCTAVES, 2): scratch for counts and classes; cubes (OCTAVES, 2): scratch for the sum and the maximum of
    the cubed sizes in an octave, relative to the octave's size. Overwrites grid.bucket.
    """
    octave[:] = 0
    cubes[:] = 0.0
    for i in range(size.size):
        if size[i] <= LARGEST_BODY:
            mantissa, exponent = frexp(size[i])
            k = min(max(exponent + OCTAVES // 2, 0), OCTAVES - 1)
            grid.bucket[i] = k
            octave[k, 0] += 1
            cubes[k, 0] += mantissa * mantissa * mantissa
            cubes[k, 1] = max(cubes[k, 1], mantissa * mantissa * mantissa)
    number = 0
    count, cube = 0, 0.0
    top = -1
    for k in range(OCTAVES - 1, -1, -1):
        if octave[k, 0] == 0:
            continue
        shrink = 0.5 ** (3 * min(max(top - k, 0), 100))
        fitted = cube + shrink * cubes[k, 0]
        if top < 0 or (number < MAX_CLASSES and (count + octave[k, 0]) * cubes[top, 1] > CROWDING * fitted):
            number += 1
            top, count, cube = k, 0, 0.0
            shrink = 1.0
        count += octave[k, 0]
        cube += shrink * cubes[k, 0]
        octave[k, 1] = number
    for i in range(size.size):
        rest = 0 if starts[i] else STARTING
        if size[i] <= LARGEST_BODY:
            grid.klass[i] = rest + octave[grid.bucket[i], 1]
        elif size[i] > LARGEST_BODY:
            grid.klass[i] = rest
        else:
            grid.klass[i] = ABSENT
