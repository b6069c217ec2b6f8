"""Sine and cosine from additions and multiplications alone, equal on every processor.

The C library's results differ in the last bit between processors. These are the same bytes everywhere, which a replay
on another machine needs, and both together cost as much as one of the C library's.
"""

from __future__ import annotations

from math import cos, sin
from typing import Final

import numpy as np

from collision_monitor._jit import inlined

TWO_OVER_PI: Final = 0.6366197723675814

# pi / 2 in three parts of 33 bits, 33 bits and the rest: a multiple below 2^20 of the first two is exact
HALF_PI_1: Final = 1.5707963267341256
HALF_PI_2: Final = 6.077100506303966e-11
HALF_PI_3: Final = 2.0222662487959506e-21

LARGEST: Final = 1e6
"""rad. Beyond it the parts of pi / 2 are too short, and the C library is used."""


@inlined
def sin_cos(x: float) -> tuple[float, float]:
    """Sine and cosine of x (rad), within 2 units in the last place of 1.

    Reduced to |r| <= pi / 4 by Cody and Waite's method, then Taylor's series up to r^18: its rest is below 1e-19.
    """
    if not abs(x) < LARGEST:
        return sin(x), cos(x)
    return sin_cos_within(x)


@inlined
def sin_cos_within(x: float) -> tuple[float, float]:
    """`sin_cos` for |x| < LARGEST, without branches, so that a compiler can vectorise a loop over many x."""
    k = np.rint(x * TWO_OVER_PI)
    r = ((x - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3
    z = r * r
    s = -1.0 / 121645100408832000.0
    s = 1.0 / 355687428096000.0 + z * s
    s = -1.0 / 1307674368000.0 + z * s
    s = 1.0 / 6227020800.0 + z * s
    s = -1.0 / 39916800.0 + z * s
    s = 1.0 / 362880.0 + z * s
    s = -1.0 / 5040.0 + z * s
    s = 1.0 / 120.0 + z * s
    s = -1.0 / 6.0 + z * s
    s = r + r * (z * s)
    c = -1.0 / 6402373705728000.0
    c = 1.0 / 20922789888000.0 + z * c
    c = -1.0 / 87178291200.0 + z * c
    c = 1.0 / 479001600.0 + z * c
    c = -1.0 / 3628800.0 + z * c
    c = 1.0 / 40320.0 + z * c
    c = -1.0 / 720.0 + z * c
    c = 1.0 / 24.0 + z * c
    c = 1.0 - (0.5 * z - z * z * c)
    quadrant = k - 4.0 * np.floor(0.25 * k)
    is_swapped = (quadrant == 1.0) | (quadrant == 3.0)
    sine, cosine = (c, s) if is_swapped else (s, c)
    sine = -sine if quadrant >= 2.0 else sine
    cosine = -cosine if (quadrant == 1.0) | (quadrant == 2.0) else cosine
    return sine, cosine
