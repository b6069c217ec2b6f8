"""Every numerical constant of the package: its unit, why it has this value, and what breaks if it changes.

All tolerances are relative (to the sizes or the speeds involved) unless the name ends in a unit.
"""

from __future__ import annotations

from typing import Final

EPSILON: Final = 2.220446049250313e-16
"""Spacing of float64 at 1: the unit in which round-off bounds below are counted."""

UNIT_QUATERNION: Final = 1e-3
"""|norm - 1| of a quaternion that is normalised; beyond it the input is refused.
Larger: garbage passes as a rotation. Smaller: honest float32 sources are refused."""

PARALLEL_SIN2: Final = 1e-12
"""sin^2 of the angle between two unit edges below which SAT drops their cross product.
The round-off of a normalised cross product grows as EPSILON / sin; at sin = 1e-6 it is 2e-10 of the size.
The gap that is left undetected by dropping the axis is at most sin * size, and the face axes cover it to sin^2 * size.
Larger: a true edge-edge gap is missed. Smaller: the axis is noise and invents gaps."""

FACE_PREFERENCE: Final = 1e-9
"""A face axis wins over an edge axis unless the edge's separation is larger by this part of the size:
contacts of resting boxes keep one normal instead of flickering between ties."""

SAT_ROUND_OFF: Final = 64 * EPSILON
"""Relative round-off of one SAT projection: about 30 operations on numbers of the pair's size, doubled."""

HULL_DROP: Final = 1e-14
"""A point that stands out of its hull by less than this part of the hull's size is dropped with the interior ones.
Larger: visible corners vanish. Smaller: round-off keeps points that lie in a face, and each costs time in every test."""
