"""The trees of all meshes in one array, so that the kernels take one argument for them. Equal trees are stored once."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KEY: Final = np.s_[0, 4:6, 1]
REACH: Final = np.s_[0, 1, 1]
"""Where a tree has its digest, and the distance of its farthest point from the origin (see meshes.layout)."""


class Forest:
    """Blocks (N, 16, 8) of trees. `blocks` must be read again after `add`."""

    def __init__(self, blocks: int = 1) -> None:
        self.blocks: Array = np.zeros((blocks, 16, 8))
        self._used = 0
        self._starts: dict[bytes, int] = {}  # digest of a tree -> its first block
        self._trees: dict[int, tuple[bytes, int, int]] = {}  # first block -> digest, number of blocks, number of users
        self._free: dict[int, list[int]] = {}  # number of blocks -> first blocks

    def add(self, tree: Array) -> int:
        """Store a tree (n, 16, 8), or count one more user of an equal one; return its first block."""
        key = tree[KEY].tobytes()
        if key in self._starts:
            start = self._starts[key]
            digest, count, users = self._trees[start]
            self._trees[start] = digest, count, users + 1
            return start
        start = self._room(len(tree))
        self.blocks[start : start + len(tree)] = tree
        self._starts[key] = start
        self._trees[start] = key, len(tree), 1
        return start

    def drop(self, start: int) -> None:
        """Forget one user of the tree at a first block; its room is free after the last."""
        key, count, users = self._trees[start]
        if users > 1:
            self._trees[start] = key, count, users - 1
            return
        del self._trees[start], self._starts[key]
        self._free.setdefault(count, []).append(start)

    def _room(self, count: int) -> int:
        """First of so many unused blocks: those of a dropped tree of this size or larger, else at the end."""
        fitting = [size for size, starts in self._free.items() if starts and size >= count]
        if fitting:
            size = min(fitting)
            start = self._free[size].pop()
            if size > count:
                self._free.setdefault(size - count, []).append(start + count)
            return start
        start = self._used
        if start + count > len(self.blocks):
            larger = np.zeros((max(start + count, start + start // 2), *self.blocks.shape[1:]))
            larger[:start] = self.blocks[:start]
            self.blocks = larger
        self._used = start + count
        return start
