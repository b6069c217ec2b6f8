"""The patch of a contact: where faces or edges of two objects lie on each other, as the corners of their shared area.

Only pieces that reach the plane of the contact can share an area with it, so the others are left out first; a floor of
triangles is one face.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.narrow_phase.contact_row import DISTANCE, NORMAL, POINT_A, as_contacts
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.narrow_phase.manifold import manifold_batch, outline
from collision_monitor.query.body import QueryBody
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import Mesh, Points, Shape
from collision_monitor.shapes.shape_table import ShapeTable, ShapeTableBuilder, join, triangle_table
from collision_monitor.tolerances import FEATURE_TIE

Array = NDArray[np.float64]

MOST_PAIRS: Final = 100_000
"""Most pairs of pieces at the plane of a contact. More, as of two meshes that coincide, give one point."""


def patch_of(a: QueryBody, pose_a: Pose, b: QueryBody, pose_b: Pose, row: Array) -> Array | None:
    """Corners (k, 3) of the patch on A in the world (m), at most four; None for one point.

    row: the contact, with points in the world.
    """
    n, distance = row[NORMAL : NORMAL + 3], float(row[DISTANCE])
    origin = pose_a.position
    height = float(n @ (row[POINT_A : POINT_A + 3] - origin))
    size = _size(a) + _size(b)
    own = _pieces(a, pose_a, origin, n, height - FEATURE_TIE * size)
    other = _pieces(b, pose_b, origin, -n, -(height + distance) - FEATURE_TIE * size)
    if own is None or other is None:
        return None
    table = join([own[0], other[0]])
    position, rotation = (np.concatenate([x, y]) for x, y in zip(own[1:], other[1:], strict=True))
    radius = table.radius
    i, j = (index.ravel() for index in np.indices((len(own[1]), len(other[1]))))
    j = j + len(own[1])
    near = np.linalg.norm(position[j] - position[i], axis=1) - (radius[i] + radius[j]) <= distance + FEATURE_TIE * size
    pairs = np.stack([i[near], j[near]], axis=1).astype(np.int32)
    if not 0 < len(pairs) <= MOST_PAIRS:
        return None
    rows = contact_batch(table, position, rotation, pairs)
    contacts = as_contacts(rows)
    finite = radius[np.isfinite(radius)]
    tie = FEATURE_TIE * float(finite.max(initial=0.0)) * 2.0
    level = (contacts["distance"] <= distance + tie) & (contacts["normal"] @ n >= 1.0 - FEATURE_TIE)
    if not level.any():
        return None
    count, points = manifold_batch(table, position, rotation, pairs[level], np.ascontiguousarray(rows[level]))
    patches = [points[k, : count[k]] + position[pairs[level][k, 0]] for k in range(len(count))]
    patch = patches[0] if len(patches) == 1 else outline(np.concatenate(patches), n.copy(), tie)
    return None if len(patch) == 1 else np.asarray(patch + origin)


def _size(side: QueryBody) -> float:
    """Sum of the reaches of the bounded pieces along their axes (m)."""
    far = [reach([piece], np.eye(3)).max() for piece in side.pieces]
    return float(sum(each for each in far if np.isfinite(each)))


def _pieces(
    side: QueryBody, pose: Pose, origin: Array, n: Array, height: float
) -> tuple[ShapeTable, Array, Array] | None:
    """Convex pieces that reach a height along n (m), as a table, positions from the origin and rotations."""
    tables, positions, rotations = [], [], []
    for shape, own in side.pieces:
        R, p = pose.rotation @ own.rotation, pose.position - origin + pose.rotation @ own.position
        if isinstance(shape, Points):
            return None
        if isinstance(shape, Mesh):
            corners = shape.vertices[shape.faces] @ R.T + p
            corners = corners[((corners @ n).max(axis=1) >= height)]
            if len(corners):
                centres = corners.mean(axis=1)  # about its own centre, a triangle has a small bounding sphere
                tables.append(triangle_table(corners - centres[:, None]))
                positions.append(centres)
                rotations.append(np.tile(np.eye(3), (len(centres), 1, 1)))
        elif float(n @ p + reach([(shape, Pose())], n @ R)) >= height:
            tables.append(_single(shape))
            positions.append(p[None])
            rotations.append(R[None])
    return (join(tables), np.concatenate(positions), np.concatenate(rotations)) if tables else None


def _single(shape: Shape) -> ShapeTable:
    builder = ShapeTableBuilder(slots=1, vertices=0)
    builder.append(shape)
    return builder.used
