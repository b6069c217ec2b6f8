"""Evenly spread points in the unit cube: a scrambled Sobol' sequence, equal on every run and machine.

The first 2^m points, for any m, are evenly spread too. The sequence is that of Sobol' (1967) with the direction numbers
of Joe and Kuo (2008), which make pairs of coordinates even. Owen's scrambling (1995) flips each binary digit or not,
depending on the digits before it, so that the points of a short sequence are not all at the low end of their cells.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

DIRECTIONS: Final[tuple[tuple[int, tuple[int, ...]], ...]] = (
    (0, ()),
    (0, (1,)),
    (1, (1, 3)),
    (1, (1, 3, 1)),
    (2, (1, 1, 1)),
    (1, (1, 1, 3, 3)),
    (4, (1, 3, 5, 13)),
    (2, (1, 1, 5, 5, 17)),
    (4, (1, 1, 5, 5, 5)),
    (7, (1, 1, 7, 11, 19)),
    (11, (1, 1, 5, 1, 1)),
    (13, (1, 1, 1, 3, 11)),
    (14, (1, 3, 5, 5, 31)),
    (1, (1, 3, 3, 9, 7, 49)),
    (13, (1, 1, 1, 15, 21, 21)),
    (16, (1, 3, 1, 13, 27, 49)),
    (19, (1, 1, 1, 15, 7, 5)),
    (22, (1, 3, 1, 15, 13, 25)),
)
"""For each dimension: inner coefficients of a primitive polynomial, as binary digits; the first direction numbers."""


SCRAMBLE: Final = np.uint64(992)
"""Which scrambling to use: of 120, the one whose first 32 to 1024 points give half-spaces their probability best."""


def sobol_digits(count: int, dimensions: int, digits: int) -> NDArray[np.uint64]:
    """First `count` points (count, dimensions) of the Sobol' sequence, as integers of so many binary digits."""
    index = np.arange(count, dtype=np.uint64)
    points = np.zeros((count, dimensions), np.uint64)
    for j in range(dimensions):
        for place, number in enumerate(_direction_numbers(*DIRECTIONS[j], digits)):
            points[:, j] ^= (index >> np.uint64(place) & np.uint64(1)) * np.uint64(number << (digits - 1 - place))
    return points


def _direction_numbers(polynomial: int, first: tuple[int, ...], count: int) -> list[int]:
    """Direction numbers m_1 to m_count, by the recurrence of the primitive polynomial."""
    numbers, degree = list(first), len(first)
    while len(numbers) < count:
        if degree == 0:  # van der Corput's sequence
            numbers.append(1)
            continue
        value = numbers[-degree] ^ numbers[-degree] << degree
        for k in range(1, degree):
            value ^= (polynomial >> (degree - 1 - k) & 1) * (numbers[-k] << k)
        numbers.append(value)
    return numbers[:count]


def scrambled(points: NDArray[np.uint64], digits: int) -> NDArray[np.uint64]:
    """Flip each binary digit of points (n, dimensions) by a hash of the digits before it; their number stays."""
    flipped = points.copy()
    salt = SCRAMBLE + np.arange(points.shape[1], dtype=np.uint64)[None, :] << np.uint64(40)
    for place in range(digits):
        below = np.uint64(digits - 1 - place)
        before = (points >> below >> np.uint64(1)) + (np.uint64(1) << np.uint64(place))  # the 1 tells 0 from 00
        flipped ^= (_hash(before + salt) & np.uint64(1)) << below
    return flipped


def _hash(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Mix the bits of integers (the finalizer of SplitMix64; Steele, Lea and Flood, 2014)."""
    x = x + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ x >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ x >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return np.asarray(x ^ x >> np.uint64(31))
