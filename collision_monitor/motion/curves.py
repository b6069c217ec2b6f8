"""Curves: polynomials in time up to degree 5, cut into parabolas, each with a bound on how far the curve is from it."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.runs import in_runs

Array = NDArray[np.float64]

CURVE_TOLERANCE: Final = 1e-6
"""m: how far a curve may be from its pieces. Smaller: more pieces, by the root of the third order."""

MOST_PIECES: Final = 1_000_000
"""Pieces of all curves of a trajectory, 150 MB. One that needs more has wider tubes."""

MOST_PARTS: Final = 64
"""Pieces of a curve between two points: a metre from rest to rest in a second needs 46. A curve that needs more has a
wider tube, by the third power of what it lacks. More: wild curves of a few points keep a step for 0.4 s."""

PARABOLA_ERROR: Final = 1.0 / 124.0
"""Largest distance of a curve from the parabola through its ends and its middle, for third derivatives of at most 1 in
a span of 1: sqrt(3) / 216, rounded up (Hildebrand 1974, 2.6: the remainder of interpolation)."""


class Parabolas(NamedTuple):
    """Pieces of curves (M,)."""

    span: NDArray[np.int64]
    """Which span between two points a piece belongs to."""
    age: Array
    """s from the begin of that span to the begin of the piece."""
    position: Array
    """(M, 3) m at the begin."""
    velocity: Array
    """(M, 3) m/s at the begin; the acceleration is constant."""
    acceleration: Array
    """(M, 3) m/s^2."""
    tube: Array
    """m by which the curve may be off the piece."""


def cubic(h: Array, p: Array, v: Array) -> Array:
    """Coefficients (K, 6, 3) of the cubic Hermite splines between points p (K + 1, 3) with velocities v (K + 1, 3).

    h (K,): s from point to point. Coefficient n is that of t^n, for t (s) from the begin of the span.
    """
    c, step = np.zeros((len(h), 6, 3)), h[:, None]
    secant = np.diff(p, axis=0) / step
    c[:, 0], c[:, 1] = p[:-1], v[:-1]
    c[:, 2] = (3.0 * secant - 2.0 * v[:-1] - v[1:]) / step
    c[:, 3] = (v[:-1] + v[1:] - 2.0 * secant) / (step * step)
    return c


def quintic(h: Array, p: Array, v: Array, a: Array) -> Array:
    """Coefficients (K, 6, 3) of the quintic Hermite splines, with accelerations a (K + 1, 3) besides; see `cubic`."""
    c, step = np.zeros((len(h), 6, 3)), h[:, None]
    c[:, 0], c[:, 1], c[:, 2] = p[:-1], v[:-1], a[:-1] / 2.0
    # what a motion with the first acceleration lacks at the end, each in the unit of an acceleration
    far = (np.diff(p, axis=0) / step - v[:-1]) / step - a[:-1] / 2.0
    fast, more = np.diff(v, axis=0) / step - a[:-1], np.diff(a, axis=0)
    c[:, 3] = (10.0 * far - 4.0 * fast + 0.5 * more) / step
    c[:, 4] = (-15.0 * far + 7.0 * fast - more) / step**2
    c[:, 5] = (6.0 * far - 3.0 * fast + 0.5 * more) / step**3
    return c


def parabolas(h: Array, c: Array) -> Parabolas:
    """Cut curves of coefficients c (K, 6, 3) over spans h (K,) into parabolas through ends and middle of each piece."""
    off = _largest_third(c, np.zeros(len(h)), h) * h**3 * PARABOLA_ERROR
    parts = np.clip(np.ceil(np.cbrt(off / CURVE_TOLERANCE)), 1, MOST_PARTS).astype(int)
    if parts.sum() > MOST_PIECES:
        parts = np.maximum(parts * MOST_PIECES // parts.sum(), 1)
    k, nth = in_runs(parts)
    length = (h / parts)[k]
    age = nth * length
    s, d, (c0, c1, c2, c3, c4, c5) = age[:, None], length[:, None], np.moveaxis(c[k], 1, 0)
    position = c0 + (c1 + (c2 + (c3 + (c4 + c5 * s) * s) * s) * s) * s
    velocity = c1 + (2.0 * c2 + (3.0 * c3 + (4.0 * c4 + 5.0 * c5 * s) * s) * s) * s
    acceleration = 2.0 * c2 + (6.0 * c3 + (12.0 * c4 + 20.0 * c5 * s) * s) * s
    third, fourth = c3 + (4.0 * c4 + 10.0 * c5 * s) * s, c4 + 5.0 * c5 * s
    # of t^n, the parabola through 0, d / 2 and d has the velocity (4 / 2^n - 1) d^(n-1) and 4 (1 - 2 / 2^n) d^(n-2)
    velocity = velocity - (third / 2.0 + (0.75 * fourth + 0.875 * c5 * d) * d) * d * d
    acceleration = acceleration + (3.0 * third + (3.5 * fourth + 3.75 * c5 * d) * d) * d
    tube = _largest_third(c[k], age, length) * length**3 * PARABOLA_ERROR
    return Parabolas(k, age, position, velocity, acceleration, tube)


def _largest_third(c: Array, age: Array, length: Array) -> Array:
    """Bounds (M,) on the third derivatives (m/s^3) of curves from `age` on, for `length` (s).

    A third derivative is a parabola, and within the triangle of its Bernstein coefficients (Farin 2002, 5.1).
    """
    s, d = age[:, None], length[:, None]
    first = 6.0 * c[:, 3] + (24.0 * c[:, 4] + 60.0 * c[:, 5] * s) * s
    last = 6.0 * c[:, 3] + (24.0 * c[:, 4] + 60.0 * c[:, 5] * (s + d)) * (s + d)
    middle = first + (12.0 * c[:, 4] + 60.0 * c[:, 5] * s) * d
    largest: Array = np.linalg.norm([first, middle, last], axis=2).max(axis=0)
    return largest
