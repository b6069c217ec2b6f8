"""Tolerances of the geometry and of the narrow phase, with units, reasons and the effect of other values.

This file holds the tolerances that several modules share, and all those of SAT, GJK and EPA, which depend on each
other. A constant of one algorithm (a size, a number of tries, a threshold) is defined in that algorithm's module.

All tolerances are relative (to the sizes or the speeds involved) unless the name ends in a unit.
"""

from __future__ import annotations

from typing import Final

EPSILON: Final = 2.220446049250313e-16
"""Spacing of float64 at 1, the unit of the round-off bounds below."""

UNIT_QUATERNION: Final = 1e-3
"""Largest |norm - 1| of a quaternion that is normalised; the input is refused beyond it.
Larger: garbage passes as a rotation. Smaller: valid float32 input is refused."""

NORMALISED: Final = 4.0 * EPSILON
"""Largest |norm - 1| of a quaternion that is left as it is. Smaller: one that was normalised before changes a bit."""

LARGEST_INPUT: Final = 1e18
"""Largest position, velocity or angular velocity (m, m/s, rad/s) of a state, so that squares stay finite and the
hash grid's cells stay in range. Larger: products overflow and a pair could be lost."""

PARALLEL_SIN2: Final = 1e-12
"""sin^2 of the angle between two unit edges below which SAT drops their cross product.
The round-off of a normalised cross product grows as EPSILON / sin; at sin = 1e-6 it is 2e-10 of the size.
The gap that stays undetected without the axis is at most sin * size, and the face axes cover it to sin^2 * size.
Larger: a true edge-edge gap is missed. Smaller: the axis is noise and produces false gaps."""

FACE_PREFERENCE: Final = 1e-9
"""A face axis wins over an edge axis unless the edge's separation is larger by this part of the size, so that
contacts of resting boxes keep one normal instead of switching between equal ones."""

SAT_ROUND_OFF: Final = 64 * EPSILON
"""Relative round-off of one SAT projection: about 30 operations on numbers of the pair's size, doubled."""

HULL_DROP: Final = 1e-14
"""A point outside its hull by less than this part of the hull's size is dropped like the interior points.
Larger: visible corners vanish. Smaller: round-off keeps points that lie in a face, and each costs time."""

ROUNDED_UP: Final = 1e-12
"""Bounding spheres and models are enlarged by this part of their size, so that they contain their content in spite
of round-off."""

OPPOSED: Final = 8 * EPSILON
"""Two half-spaces face each other if their normals add up to at most this, the round-off of turning both by one pose.
Larger: planes that meet far away count as parallel. Smaller: a floor and a ceiling overlap without end."""

FEATURE_TIE: Final = 1e-9
"""An edge or a face touches as a whole if the depths of its ends differ by less than this part of the size.
Larger: witness points leave the surface visibly. Smaller: resting faces are reported as a vertex that jumps about."""

SEGMENT_PARALLEL_SIN2: Final = 1e-20
"""sin^2 below which two segments count as parallel in the search for their closest points.
The distance is then wrong by at most sin * length = 1e-10 of the size. Unlike in SAT, the formula holds far below
PARALLEL_SIN2, because where the position is ill-conditioned, the distance hardly depends on it."""

GJK_TOUCHING: Final = 1e-10
"""GJK passes a pair to EPA if the cores are closer than this part of their size, because
the direction of the difference vector is round-off below it, and a face normal is exact."""

GJK_RELATIVE: Final = 1e-10
"""GJK ends when the certified lower bound is within this part of the distance.
Larger: error bounds grow. Smaller: curved shapes take more iterations for a gain that no one can measure."""

EPA_POLYTOPE: Final = 1e-12
"""EPA ends when the depth is certified to this part of the size. Polytopes reach it exactly, in finitely many steps."""

EPA_CURVED: Final = 1e-6
"""The same for pairs with a cylinder or a cone. EPA approximates their surface by flat faces, so that
each further factor of 4 costs about 3 iterations. The contact reports the bound that EPA reached."""

EPA_CURVED_POINTS: Final = 512
"""Support points after which EPA accepts its current bound for a cylinder or a cone. Only a tie of a whole circle of
directions (a capsule along a cone's axis) needs nearly as many; the bound is then 3e-5 of the size, after 1 to 2 ms.
The scratch memory (MAX_VERTICES) allows no larger value. Smaller: the bound grows with the inverse square."""

FLAT: Final = 1e-12
"""A simplex thinner than this part of the size counts as flat, because the side of the origin would be noise."""

SLIVER_SIN2: Final = 1e-20
"""sin^2 between two edges of an EPA face below which the face is a sliver: it closes the surface but has no normal."""

THIN_SIN2: Final = 1e-8
"""sin^2 between two edges of a GJK triangle below which its plane is not used for the closest point's direction.
The plane's normal is wrong by EPSILON / sin = 2e-12 at the limit."""
