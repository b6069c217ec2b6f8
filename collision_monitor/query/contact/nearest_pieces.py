"""Nearest pair of convex pieces of two objects, found by their bounding spheres, or by two trees of spheres if there
are many pieces.

(Slides "Bounding volume hierarchies"; Ericson, Real-Time Collision Detection, 6.3)
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.broad_phase.boxes import concatenated_ranges
from collision_monitor.narrow_phase.contact_row import CONTACT_SIZE, DISTANCE
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.query.piece_table import PieceTable
from collision_monitor.shapes.shape_table import ShapeTable, join

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FIRST_BATCH: Final = 64
"""Number of pairs of pieces in the first batch; each further batch is twice as large."""

ALL_PAIRS: Final = 2048
"""Number of pairs of pieces up to which all bounding spheres are compared, as fast as one descent of the trees."""

PAIRS_AT_ONCE: Final = 1024
"""Number of pairs of spheres that descend the trees together. Larger: more descend before a near pair is known."""


class NearestPieces:
    """Search for the nearest or deepest pieces, with its result: their contact row `best` and their indices `pair`.

    table, position, rotation: the pieces of both, A's first, relative to one origin in the same axes. looked_at: all
    tested pairs (m, 2), in batches with their contacts (m, CONTACT_SIZE), among them all that are as near as `best`.
    """

    def __init__(self, a: PieceTable, X_A: tuple[Array, Array], b: PieceTable, X_B: tuple[Array, Array]) -> None:
        """Search; X_A, X_B: rotation (3, 3) and position (3,) of each object."""
        self.table: ShapeTable = join([a.table, b.table])
        self.position = np.concatenate([a.position @ X_A[0].T + X_A[1], b.position @ X_B[0].T + X_B[1]])
        self.rotation = np.concatenate([X_A[0] @ a.rotation, X_B[0] @ b.rotation])
        self.looked_at: list[tuple[NDArray[np.int32], Array]] = []
        self.best = np.full(CONTACT_SIZE, np.inf)
        self.pair = np.zeros(2, np.int32)
        self._first_of_b = len(a)
        if len(a) * len(b) <= ALL_PAIRS:
            self._look_at(np.repeat(np.arange(len(a)), len(b)), np.tile(np.arange(len(b)), len(a)))
        else:
            self._descend(a, X_A, b, X_B)

    def _look_at(self, i: Indices, j: Indices) -> None:
        """Test the pieces i of A with j of B in the order of their spheres' distances, while they can be nearest."""
        j = self._first_of_b + j
        radius = self.table.radius
        lower = np.linalg.norm(self.position[j] - self.position[i], axis=1) - (radius[i] + radius[j])
        order = np.argsort(lower, kind="stable")
        begin, size = 0, FIRST_BATCH
        while begin < len(order) and lower[order[begin]] <= self.best[DISTANCE]:
            some = order[begin : begin + size]
            pairs = np.stack([i[some], j[some]], axis=1).astype(np.int32)
            rows = contact_batch(self.table, self.position, self.rotation, pairs)
            self.looked_at.append((pairs, rows))
            k = int(rows[:, DISTANCE].argmin())
            if rows[k, DISTANCE] < self.best[DISTANCE]:
                self.best, self.pair = rows[k].copy(), pairs[k]
            begin, size = begin + size, 2 * size

    def _descend(self, a: PieceTable, X_A: tuple[Array, Array], b: PieceTable, X_B: tuple[Array, Array]) -> None:
        """Descend from both objects to their halves, nearest first, and skip pairs farther than the nearest found."""
        trees = a.spheres, b.spheres
        centers = [[c @ R.T + p for c in tree.center] for tree, (R, p) in zip(trees, (X_A, X_B), strict=True)]
        last = len(a.spheres.center) - 1, len(b.spheres.center) - 1
        stack = [((0, 0), np.zeros((2, 1), np.int64), np.full(1, -np.inf))]
        farthest = np.inf  # some pair is at most this far apart
        while stack:
            level, nodes, lower = stack.pop()
            farthest = min(farthest, self.best[DISTANCE])
            nodes = nodes[:, lower <= farthest]
            if level == last:
                self._look_at(*_leaves(trees, nodes))
                continue
            for side in range(2):
                if level[side] < last[side]:
                    nodes = np.concatenate([nodes, nodes], axis=1)
                    nodes[side] *= 2
                    nodes[side, nodes.shape[1] // 2 :] += 1
            k, m = level = min(level[0] + 1, last[0]), min(level[1] + 1, last[1])
            i, j = nodes
            apart = np.linalg.norm(centers[1][m][j] - centers[0][k][i], axis=1)
            radii = trees[0].radius[k][i] + trees[1].radius[m][j]
            lower = apart - radii
            farthest = min(farthest, float((apart + radii).min(initial=np.inf)))
            order = np.argsort(lower, kind="stable")
            for begin in reversed(range(0, len(order), PAIRS_AT_ONCE)):
                some = order[begin : begin + PAIRS_AT_ONCE]
                stack.append((level, nodes[:, some], lower[some]))


def _leaves(trees: Any, nodes: Indices) -> tuple[Indices, Indices]:
    """Every pair of a piece of A and a piece of B in the pairs of spheres (2, n) of the last levels."""
    i, owner = concatenated_ranges(trees[0].first[nodes[0]], np.diff(trees[0].first)[nodes[0]])
    j = nodes[1, owner]
    j, again = concatenated_ranges(trees[1].first[j], np.diff(trees[1].first)[j])
    return trees[0].order[i[again]], trees[1].order[j]
