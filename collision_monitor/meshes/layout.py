"""Layout of a tree: one array (n, ROWS, WIDTH) of float64, in blocks of WIDTH boxes or WIDTH triangles.

A kernel computes with all members of a block at once, because equal numbers of the members lie side by side.
Block 0 holds only the box of the whole tree. All lengths are in m, in the mesh's frame. A block of boxes, block 0 too,
is followed by two blocks with the supports of its boxes.
"""

from __future__ import annotations

from typing import Final

WIDTH: Final = 8
"""Number of boxes or triangles in a block: one vector of the processor, or two."""

ROWS: Final = 16

# rows of a block of boxes
AXES: Final = 0
"""Rows 0 to 8: rotation of the box, row by row; its columns are the box's axes."""
CENTER: Final = 9
HALF: Final = 12
"""Half extents along the box's axes. They include the radii of the triangles, and round-off."""
CHILD: Final = 15
"""Block of the box's content relative to block 0: > 0 boxes, < 0 triangles (its negative), 0: the member is unused."""

BOXES: Final = 3
"""Number of blocks that boxes take, with those of their supports."""

EDGES: Final = 1
"""Distance of the block, behind that of the boxes, whose rows hold how far the content of a box reaches from its centre
along the sums of two of its axes: x y, x z, y z, each with the signs + +, + -, - +, - -. Of its 16 rows 12 are used."""
CORNERS_OF_BOX: Final = 2
"""Distance of the block with the same along the sums of all three axes: + + +, + + -, ..., - - -. 8 rows are used."""

# rows of a block of triangles; unused members repeat the last triangle
CORNERS: Final = 0
"""Rows 0 to 8: the corners x, y, z, one after another. A point is a triangle with three equal corners."""
FACE: Final = 9
"""Index of the triangle in the user's faces."""
RADIUS: Final = 10
"""Radius of the sphere by which the triangle is enlarged."""

# facts about the whole tree, in the second member of block 0
CLOSED: Final = 0
"""1: the surface bounds a solid."""
REACH: Final = 1
"""Distance of the farthest point from the mesh's origin."""
PARTS: Final = 2
"""Number of connected parts; a block behind the others holds a point x, y, z of each."""
FIRST_PART: Final = 3
"""The first of these blocks, relative to block 0."""
MOST_PARTS: Final = 64
"""Most parts with a point in the tree. More: a soup of a million triangles would take a million rays."""
COUNT: Final = 6
"""Number of points of a cloud; 0 for triangles."""
TILES: Final = 7
"""Number of tiles of a map, each with a tree of its own below the boxes over them; 0 for other surfaces."""
KEY: Final = 4
"""Digest of what a tree of triangles is made of, 16 bytes in this row and the next; so equal trees have equal ones."""
