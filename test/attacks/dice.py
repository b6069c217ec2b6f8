"""Seeded choices of a fuzzer: tame values that a careful publisher sends, and hostile ones that nobody should send."""

from __future__ import annotations

import math
import struct
from random import Random
from typing import Final

SPECIAL: Final = (
    *(math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1.0, 1e-9, -1e-9, 1e18, -1e18),
    *(1.0000001e18, 1e150, -1e150, 1e200, 1e300, 1.7976931348623157e308, 1e-12, 1e-30),
)
"""Numbers that break formulas: not finite, zero, negative, at and beyond the largest input, overflowing as squares."""

TINY: Final = (5e-324, -5e-324, 1e-310, 2.2250738585072014e-308, 1e-200, 1e-100)
"""Denormal numbers, and numbers with a square of zero."""

WORDS: Final = (
    *("", "world", "map", "World", "world/", "größe 物体", "x" * 255),
    *("a\tb\nc", "../../etc", "\x1b[31m", "%s{0}"),
)
"""Texts that a careless reader confuses with another, formats, prints or opens."""

LONGEST_NAME: Final = 256
"""Bytes of a name that the monitor has to accept."""


class Dice:
    """Choices of one message, which (seed, index) determines. wild: share of the numbers that are hostile."""

    def __init__(self, seed: int, index: int) -> None:
        self.random = Random(seed * 1_000_000_007 + index)
        self.wild = 0.0 if self.random.random() < 0.55 else self.random.choice((0.02, 0.1, 0.4))

    def chance(self, probability: float) -> bool:
        """Return True with this probability."""
        return self.random.random() < probability

    @property
    def is_hostile(self) -> bool:
        """Whether the next value is hostile."""
        return self.wild > 0.0 and self.random.random() < self.wild

    def hostile(self) -> float:
        """Return a number that should not be there."""
        kind = self.random.random()
        if kind < 0.6:
            return self.random.choice(SPECIAL)
        if kind < 0.75:
            return self.random.choice(TINY)
        if kind < 0.85:
            value: float = struct.unpack("<d", self.random.randbytes(8))[0]  # any float at all
            return value
        return math.copysign(10.0 ** self.random.uniform(-60, 40), self.random.random() - 0.5)

    def number(self, low: float, high: float) -> float:
        """Return a number from low to high, or a hostile one."""
        return self.hostile() if self.is_hostile else self.random.uniform(low, high)

    def numbers(self, count: int, low: float, high: float) -> list[float]:
        """Return such numbers."""
        return [self.number(low, high) for _ in range(count)]

    def quaternion(self) -> list[float]:
        """Return a unit quaternion, or one that is zero, of another length or not finite."""
        if self.is_hostile:
            return self.random.choice(([0.0] * 4, [0.0, 0.0, 0.0, 1.002], self.numbers(4, -1, 1), [self.hostile()] * 4))
        q = [self.random.gauss(0, 1) for _ in range(4)]
        norm = math.sqrt(sum(c * c for c in q))
        return [c / norm for c in q] if norm > 1e-6 and self.chance(0.7) else [0.0, 0.0, 0.0, 1.0]

    def pose(self, reach: float) -> list[float]:
        """Return x, y, z up to `reach` (m) and a quaternion x, y, z, w."""
        return self.numbers(3, -reach, reach) + self.quaternion()

    def text(self) -> str:
        """Return a name."""
        if self.is_hostile:
            if self.chance(0.1):
                return "n" * self.random.choice((LONGEST_NAME, LONGEST_NAME + 1, 10_000, 300_000))
            return self.random.choice(WORDS)
        return f"attacker {self.random.randrange(100)}"

    def word(self, bits: int = 32) -> int:
        """Return a whole number of that many bits, mostly one at an edge."""
        return self.random.choice((0, 1, 2, (1 << bits) - 1, 1 << bits - 1, self.random.getrandbits(bits)))
