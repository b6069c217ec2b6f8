"""An object of a query: a shape or a compound, or the model that represents it, laid out in the library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.errors import PoseError
from collision_monitor.geometry.bounded_cache import bounded_cache
from collision_monitor.meshes.trees.shape_trees import CERTAIN, NEVER, UNCERTAIN, kept_tree
from collision_monitor.objects.models import containing_kdop, containing_model, exact_model, parse_model
from collision_monitor.query.library import LIBRARY, WITH_TREE, Slots
from collision_monitor.records import Model
from collision_monitor.shapes.cells.tiled_solid import is_unsure
from collision_monitor.shapes.compound import Compound, shape_pairs
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Mesh, Shape, kind_of
from collision_monitor.shapes.shape import array_bytes
from collision_monitor.tolerances import UNIT_QUATERNION

PosedShapes = Sequence[tuple[Shape, Pose]]

REMEMBERED_COMPOUNDS: Final = 16 << 20
"""Bytes of compounds that are remembered. Less: a compound that is given again is laid out again, 10 µs a part."""

PIECE_BYTES: Final = 1000
"""Memory of a piece with its pose and its slot."""

_HERE: Final = Pose()


class KeptSlots:
    """What a shape keeps of its layout, as its attribute `kept_slots`.

    pieces: None for the shape itself. inside: CERTAIN or NEVER if a kernel's answer of a distance needs no completion.
    """

    __slots__ = ("first", "has_mesh", "inside", "is_bounded", "is_convex", "is_planted", "pieces", "slots")

    def __init__(self, shape: Shape) -> None:
        kind = kind_of(shape)
        self.is_bounded, self.is_planted = kind.bounded, False
        self.pieces: PosedShapes | None = None
        if kind.planar or isinstance(shape, WITH_TREE):
            found = exact_model(((shape, _HERE),)).pieces
            self.slots = laid_out(found)
            self.has_mesh = any(isinstance(each, WITH_TREE) for each, _ in found)
            self.is_convex = len(found) == 1 and not self.has_mesh
            # a plane shape, whose pose has to be checked, and several pieces are completed like what is uncertain
            is_answered = len(found) == 1 and isinstance(shape, Mesh) and not is_unsure(found[0][0])
            self.inside = kept_tree(shape).inside if is_answered else UNCERTAIN
            if not (len(found) == 1 and found[0][0] is shape):
                self.pieces = found
        else:
            self.slots = LIBRARY.lay_out(((shape, None),))
            self.has_mesh, self.is_convex, self.inside = False, True, CERTAIN
        self.first = self.slots.first


def kept_slots(shape: object) -> KeptSlots | None:
    """Return the layout of a shape, made at the first call; None for anything else."""
    if not isinstance(shape, Shape):
        return None
    known: KeptSlots | None = shape.__dict__.get("kept_slots")
    if known is None:
        known = shape.__dict__["kept_slots"] = KeptSlots(shape)
    return known


def plant(kept: KeptSlots, shape: Shape) -> None:
    """Give the convex pieces of a shape the trees that pairs with meshes need."""
    LIBRARY.plant(kept.pieces or ((shape, _HERE),), kept.slots)
    kept.is_planted = True


@dataclass(frozen=True, eq=False)
class QueryBody:
    """An object as the kernels of queries see it. pieces: convex shapes, concave meshes and clouds in its frame."""

    shapes: PosedShapes
    pieces: PosedShapes
    slots: Slots
    model: Model = Model.EXACT
    excess: float = 0.0

    @property
    def is_planar(self) -> bool:
        """Whether it lies in the x-y plane."""
        return any(kind_of(shape).planar for shape, _ in self.shapes)

    @cached_property
    def has_mesh(self) -> bool:
        """Whether it has a concave mesh or a cloud, which trees answer."""
        return any(isinstance(shape, WITH_TREE) for shape, _ in self.pieces)

    @cached_property
    def is_concave(self) -> bool:
        """Whether it has several pieces, or a mesh or a cloud among them."""
        return self.has_mesh or len(self.pieces) > 1

    @cached_property
    def certain(self) -> QueryBody | None:
        """The object without what may not be there, as unknown cells of a map; None: nothing of it is certain."""
        pieces = [(shape, pose) for shape, pose in self.pieces if not is_unsure(shape)]
        if len(pieces) == len(self.pieces):
            return self
        return QueryBody(pieces, pieces, laid_out(pieces), self.model, self.excess) if pieces else None

    @cached_property
    def stands_for_concave(self) -> bool:
        """Whether the object itself has several convex pieces, whatever its model is."""
        shapes = self.shapes
        return len(shapes) > 1 or is_concave_mesh(shapes[0][0]) or len(exact_model(shapes).pieces) > 1

    @cached_property
    def inside(self) -> int:
        """What is known of the inside of its meshes: CERTAIN, NEVER or UNCERTAIN (meshes/trees/shape_trees.py)."""
        if self.model is not Model.EXACT:
            return CERTAIN
        known = [kept_tree(shape).inside for shape, _ in self.pieces if isinstance(shape, Mesh)]
        return UNCERTAIN if UNCERTAIN in known else NEVER if NEVER in known else CERTAIN

    @cached_property
    def radius(self) -> float:
        """Radius (m) of a sphere about its origin that holds it; infinite for one with a half-space."""
        table, slots = LIBRARY.tuples[0], self.slots.numbers
        return float((np.linalg.norm(table.local_position[slots], axis=1) + table.radius[slots]).max())

    def plant(self) -> None:
        """Give its convex pieces the trees that their pairs with meshes need."""
        LIBRARY.plant(self.pieces, self.slots)


def laid_out(pieces: PosedShapes) -> Slots:
    """Give slots to the pieces of an object."""
    return LIBRARY.lay_out([(shape, None if pose.numbers == _HERE.numbers else pose) for shape, pose in pieces])


class _Key:
    """A compound, equal to another one of the same shapes at equal poses."""

    def __init__(self, pairs: PosedShapes) -> None:
        self.pairs = pairs
        self._numbers = tuple((id(shape), *pose.numbers) for shape, pose in pairs)

    def __hash__(self) -> int:
        return hash(self._numbers)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._numbers == other._numbers


def _memory(body: QueryBody, key: _Key) -> int:
    return PIECE_BYTES * len(body.pieces) + sum(array_bytes(shape) for shape, _ in key.pairs)


@bounded_cache(REMEMBERED_COMPOUNDS, _memory)
def _compound(key: _Key) -> QueryBody:
    pieces = exact_model(key.pairs).pieces
    return QueryBody(key.pairs, pieces, laid_out(pieces))


def exact_body(shape: Compound, what: str) -> QueryBody:
    """Return an object as it is. Raises as `contact` does; what: name of the argument."""
    kept = kept_slots(shape)
    if kept is None:
        return _compound(_Key(shape_pairs(shape, what)))
    pairs = shape_pairs(shape, what)
    return QueryBody(pairs, kept.pieces or pairs, kept.slots)


def query_body(shape: Compound, model: Model | str | ArrayLike, what: str) -> QueryBody:
    """Return an object that is represented by a model; directions (k/2, 3) are a k-DOP. Raises as `contact` does."""
    if not isinstance(model, str | int):
        pairs = shape_pairs(shape, what)
        modelled = containing_kdop(pairs, model)
    elif parse_model(model) in (Model.AUTO, Model.EXACT):
        return exact_body(shape, what)
    else:
        pairs = shape_pairs(shape, what)
        modelled = containing_model(pairs, model)
    return QueryBody(pairs, modelled.pieces, laid_out(modelled.pieces), modelled.model, modelled.excess)


def check_in_plane(pose: Pose) -> None:
    """Check the pose of an object of the x-y plane. Raises PoseError."""
    if float(pose.rotation[2, 2]) < 1.0 - UNIT_QUATERNION:
        raise PoseError(f"expected a turn about z for a shape of the plane, got the quaternion {pose.quaternion}")
