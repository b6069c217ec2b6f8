"""The memory that the described objects need, and its limit: else a publisher could fill the machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.cells.tiled_solid import TiledSolid
from collision_monitor.shapes.registry import Mesh, Points
from collision_monitor.shapes.shape import array_bytes

MOST_MEMORY: Final = 512 << 20
"""Memory that all described objects may need together (bytes, as `object_memory` estimates it): 145,000 objects of one
shape, or hulls of 5,000,000 points. Descriptions beyond it are refused."""

OBJECT_BYTES: Final = 2900
SHAPE_BYTES: Final = 700
ALLOWED_BYTES: Final = 150
"""Memory of an object, of each of its shapes without their arrays, and of each id in `allowed` (measured)."""

COPIES: Final = 4
"""How often the arrays of a shape are kept: in the description, in the table of shapes and in the key of its block; and
the table has up to twice the room that it needs."""

TILE_COPIES: Final = 3
"""How often the triangles of a map are kept: in their tiles, in the tree of each tile and in that of the map."""

TREE_BYTES: Final = 330
"""Memory of a triangle or a point in its tree: 150 to 220 bytes, and the array of all trees may have half as much room
again. A face of a convex mesh takes 104 bytes, twice that while the faces are packed, and its hull may have a tree."""


def object_memory(d: ObjectDescription) -> int:
    """Return the memory that a described object needs (bytes), rounded up."""
    shapes = sum(SHAPE_BYTES + COPIES * array_bytes(shape) for shape, _ in d.shapes)
    meshes = [shape for shape, _ in d.shapes if isinstance(shape, Mesh)]
    leaves = sum(TILE_COPIES * each.face_count if isinstance(each, TiledSolid) else len(each.faces) for each in meshes)
    leaves += sum(len(shape.points) for shape, _ in d.shapes if isinstance(shape, Points))
    return OBJECT_BYTES + shapes + TREE_BYTES * leaves + ALLOWED_BYTES * len(d.allowed)


class MemoryUse:
    """The memory of each described object (bytes), by id, and of all together."""

    def __init__(self) -> None:
        self._of: dict[int, int] = {}
        self._total = 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MemoryUse) and self._of == other._of

    def check(self, d: ObjectDescription) -> None:
        """Check that there is room for an object, also in place of one with its id. Raises InputError."""
        total = self._total - self._of.get(d.object_id, 0) + object_memory(d)
        if total > MOST_MEMORY:
            raise InputError(
                f"object {d.object_id}: expected all objects together to need at most {MOST_MEMORY >> 20} MiB, got "
                f"{total / (1 << 20):.1f} MiB with {len(self._of) + (d.object_id not in self._of)} objects; "
                "remove objects, or describe them by simpler shapes"
            )

    def note(self, d: ObjectDescription) -> None:
        """Note that the object is described."""
        self.drop(d.object_id)
        self._of[d.object_id] = object_memory(d)
        self._total += self._of[d.object_id]

    def drop(self, object_id: int) -> None:
        """Note that the object is not described any more."""
        self._total -= self._of.pop(object_id, 0)

    def facts(self) -> dict[str, int]:
        """Return the state, for a snapshot."""
        return {str(object_id): size for object_id, size in self._of.items()}

    def restore(self, facts: Mapping[str, Any], ids: Iterable[int]) -> None:
        """Restore the state of these objects from `facts`; older sessions have none."""
        self._of = {object_id: int(facts.get(str(object_id), OBJECT_BYTES)) for object_id in ids}
        self._total = sum(self._of.values())
