"""The library: all shapes that queries were asked about, in one shape table that the kernels read.

A shape gets its slots at its first query and keeps them as long as it lives, so that later queries name it by a number.
To lay it out in a table of its own at each query takes 100 times as long.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from typing import Any, Final

from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.motion.bodies import enlarge, make_parts
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Mesh, Points, Shape
from collision_monitor.shapes.shape_table import TREE, ShapeTableBuilder

FIRST_CAPACITY: Final = 256
"""Slots of the library before it grows."""

WITH_TREE: Final = (Mesh, Points)
"""Shapes that are a tree of their surface in the table."""


class Slots:
    """Slots of the library, a chain of parts. They are free for other shapes when this object is collected."""

    __slots__ = ("_free", "first", "numbers")

    def __init__(self, numbers: list[int], free: deque[list[int]]) -> None:
        self.first, self.numbers, self._free = numbers[0], numbers, free

    def __del__(self) -> None:
        self._free.append(self.numbers)  # at any time in any thread; the next `lay_out` takes them


class Library:
    """Slots for shapes. Safe in several threads: a kernel reads the arrays of its call, to which others only add.

    tuples: the ShapeTable and Parts. arrays: theirs, one after the other, as the kernels of single queries take them.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._builder = ShapeTableBuilder(FIRST_CAPACITY)
        self._parts = make_parts(FIRST_CAPACITY)
        self._freed: deque[list[int]] = deque()
        self._show()

    def _show(self) -> None:
        """Make the parts as long as the table, and show both to the kernels."""
        table = self._builder.table
        if len(self._parts.next) < len(table.kind):
            larger = make_parts(len(table.kind))
            enlarge(self._parts, larger)
            self._parts = larger
        self.tuples = table, self._parts
        self.arrays: tuple[Any, ...] = (*table, *self._parts)

    def lay_out(self, pieces: Sequence[tuple[Shape, Pose | None]]) -> Slots:
        """Give slots to the pieces of an object, each at its pose in the object's frame; None: at its origin.

        Raises UnsupportedError, ShapeError as `ShapeTableBuilder.append` does.
        """
        # the shapes keep them: no other thread waits for one
        trees = [shape_tree(shape) if isinstance(shape, WITH_TREE) else None for shape, _ in pieces]
        builder = self._builder
        with self._lock:
            while self._freed:  # terminates: what is freed meanwhile is what is no longer asked about
                self._free(self._freed.popleft())
            numbers: list[int] = []
            try:
                for (shape, pose), tree in zip(pieces, trees, strict=True):
                    numbers.append(builder.append(shape, pose, tree=tree))
            except BaseException:
                self._free(numbers)
                raise
            if builder.table is not self.tuples[0]:
                self._show()
            if len(numbers) > 1 or numbers[0] in builder.posed:
                self._join(numbers)
            return Slots(numbers, self._freed)

    def _join(self, numbers: list[int]) -> None:
        """Make these slots one chain; a free slot is a chain of its own, at its origin."""
        parts, after = self._parts, -1
        for slot in reversed(numbers):
            parts.next[slot], parts.placed[slot] = after, slot in self._builder.posed
            after = slot

    def _free(self, numbers: list[int]) -> None:
        """Make these slots free for other shapes."""
        for slot in numbers:
            self._builder.remove(slot)
        if len(numbers) > 1 or (numbers and numbers[0] in self._builder.posed):
            self._parts.next[numbers], self._parts.placed[numbers] = -1, False

    def plant(self, pieces: Sequence[tuple[Shape, Pose | None]], slots: Slots) -> None:
        """Give the convex pieces of an object the trees that their pairs with meshes need, where they have one."""
        for (shape, _), slot in zip(pieces, slots.numbers, strict=True):
            tree = shape_tree(shape)
            with self._lock:
                if tree is not None and self._builder.table.size[slot, TREE] == 0.0:
                    self._builder.plant(slot, tree)
                    self._show()


LIBRARY: Final = Library()
"""That of the process."""
