"""Tolerances of the geometry and of the narrow phase: the unit of each, the reason for its value, the cost of another.

The tolerances that several modules share stand here, and all those of SAT, GJK and EPA, which depend on each other.
A constant of one algorithm (a size, a number of tries, a threshold of its own) stands beside its use.

All tolerances are relative (to the sizes or the speeds involved) unless the name ends in a unit.
"""

from __future__ import annotations

from typing import Final

EPSILON: Final = 2.220446049250313e-16
"""Spacing of float64 at 1: the unit in which round-off bounds below are counted."""

UNIT_QUATERNION: Final = 1e-3
"""|norm - 1| of a quaternion that is normalised; beyond it the input is refused.
Larger: garbage passes as a rotation. Smaller: honest float32 sources are refused."""

LARGEST_INPUT: Final = 1e18
"""Largest position, velocity or angular velocity (m, m/s, rad/s) that a state may hold: squares stay finite and the
hash grid's cells stay in range. Larger: products overflow and a pair could be lost."""

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
Larger: visible corners vanish. Smaller: round-off keeps points that lie in a face, and each costs time."""

ROUNDED_UP: Final = 1e-12
"""Bounding spheres and models are larger by this part of their size, so that they hold their content whatever was
rounded."""

OPPOSED: Final = 8 * EPSILON
"""Two half-spaces face each other where their normals add up to at most this: what turning both by one pose leaves.
Larger: planes that meet far away count as parallel. Smaller: a floor and a ceiling overlap without end."""

FEATURE_TIE: Final = 1e-9
"""An edge or face counts as touching as a whole when its ends differ by less than this part of the size in depth.
Larger: witness points leave the surface visibly. Smaller: resting faces are reported as a vertex that jumps about."""

SEGMENT_PARALLEL_SIN2: Final = 1e-20
"""sin^2 below which two segments count as parallel when their closest points are sought.
The distance is then wrong by at most sin * length = 1e-10 of the size. Unlike in SAT the formula holds far below
PARALLEL_SIN2: where it loses the place, the distance hardly depends on the place."""

TOUCHING: Final = 1e-10
"""GJK hands a pair over to EPA when the cores are closer than this part of their size:
below it the direction of the difference vector is round-off, and a face normal is exact."""

GJK_RELATIVE: Final = 1e-10
"""GJK ends when the certified lower bound is within this part of the distance.
Larger: error bounds grow. Smaller: curved shapes take more iterations for nothing anyone can measure."""

EPA_POLYTOPE: Final = 1e-12
"""EPA ends when the depth is certified to this part of the size: polytopes reach it exactly, in finitely many steps."""

EPA_CURVED: Final = 1e-6
"""The same for pairs with a cylinder or a cone, whose surface EPA approaches by flat faces:
each further factor of 4 costs about 3 iterations. The bound reached is reported."""

EPA_CURVED_POINTS: Final = 512
"""Support points after which EPA settles for the bound it has with a cylinder or a cone. Far fewer do but where a whole
circle of directions ties (a capsule along a cone's axis): there the bound is then 3e-5 of the size, after 1 ms or two.
More than the scratch memory holds (MAX_VERTICES) is not possible. Smaller: the bound grows with the inverse square."""

FLAT: Final = 1e-12
"""A simplex thinner than this part of the size counts as flat: which side of it the origin is on would be noise."""

SLIVER_SIN2: Final = 1e-20
"""sin^2 between two edges of an EPA face below which the face is a sliver: it closes the surface but has no normal."""

THIN_SIN2: Final = 1e-8
"""sin^2 between two edges of a GJK triangle below which its plane is not used for the closest point's direction.
The plane's normal is wrong by EPSILON / sin = 2e-12 at the limit."""
