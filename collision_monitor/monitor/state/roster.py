"""The objects by id: their slots, names, shapes and allowed pairs, and the bodies that the kernels read."""

from __future__ import annotations

from collections.abc import Hashable
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import kernel
from collision_monitor._jit.settled import settled
from collision_monitor._jit.vectors import LANES
from collision_monitor.errors import InputError, UnsupportedError
from collision_monitor.impact.impact_record import pair_keys
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.meshes.trees.slot_trees import plant_trees
from collision_monitor.monitor.contacts.mesh_faces import MeshFaces, faces_of
from collision_monitor.monitor.state.memory_use import MemoryUse
from collision_monitor.monitor.state.mesh_snapshot import mesh_arrays, plant_meshes
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage, check_range
from collision_monitor.motion.bodies import DERIVED, BodyTable, Multibody, Parts, enlarge, make_bodies, make_parts
from collision_monitor.motion.body_layout import lay_out_body, note_plain
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.motion import MOTION
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import Modelled, monitored_model
from collision_monitor.records import Model, ShapeType
from collision_monitor.settings.by_name import Classes, value_of
from collision_monitor.shapes.cells.tiled_solid import is_unsure
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.shapes.planar import flat_pose, is_planar
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import HalfSpace, Mesh, Points
from collision_monitor.shapes.shape_table import SHARED, TREE, ShapeTable, ShapeTableBuilder

FIRST_CAPACITY = 64
"""Initial number of body slots; it is doubled when all are used."""


class Roster(Stage):
    """The described objects. A body keeps its slot as long as its object is described.

    bodies, parts: the arrays that the kernels read. top: number of slots that have been used so far. planar: the scene
    lies in the x-y plane. mesh_faces: of the convex meshes, which name their features. renewed: slots that the next
    step predicts anew, for example after a new description. unsure: slots of shapes that may not be there.
    """

    SAVED = (
        *("bodies", "parts", "top", "planar", "renewed"),
        *("mesh_faces", "unsure", "_shapes", "_slots", "_names", "_memory", "_free", "_allowed"),
    )
    CACHES = ("_last_ids", "_last_slots", "_allowed_keys", "_by_name")

    def __init__(self) -> None:
        self.bodies: BodyTable = make_bodies(FIRST_CAPACITY)
        self.parts = make_parts(FIRST_CAPACITY)
        self.top = 0
        self.planar = False
        self.renewed: set[int] = set()
        self.mesh_faces = MeshFaces()
        self.unsure: set[int] = set()
        self._shapes = ShapeTableBuilder()
        self._slots: dict[int, int] = {}
        self._names: dict[int, str] = {}
        self._memory = MemoryUse()
        self._free: list[int] = []
        self._allowed: dict[int, frozenset[int]] = {}
        self._allowed_keys: NDArray[np.uint64] | None = None  # None after a change
        self._last_ids, self._last_slots = np.zeros(0, np.uint32), np.zeros(0, np.int32)
        self._by_name: dict[tuple[Classes, float], NDArray[np.float64]] = {}  # of the names now

    # ------------------------------------------------------------------ reading

    @property
    def multibody(self) -> Multibody:
        """Shapes, parts and bodies as the kernels read them. Read it again after `describe`, which may replace them."""
        return Multibody(self._shapes.table, self.parts, self.bodies)

    @property
    def has_trees(self) -> bool:
        """Whether a shape had a tree so far, as meshes and clouds have."""
        return len(self._shapes.table.blocks) > 1

    @property
    def capacity(self) -> int:
        """Number of body slots."""
        return len(self.bodies.used)

    @property
    def allowed_keys(self) -> NDArray[np.uint64]:
        """Keys of the pairs that are never checked, sorted. Made when they are read, not at every description."""
        if self._allowed_keys is None:
            counts = [len(others) for others in self._allowed.values()]
            a = np.repeat(np.fromiter(self._allowed, np.uint32, len(counts)), counts)
            b = np.fromiter(chain.from_iterable(self._allowed.values()), np.uint32, sum(counts))
            self._allowed_keys = np.unique(pair_keys(np.minimum(a, b), np.maximum(a, b)))
        return self._allowed_keys

    def allows(self, id_a: int, id_b: int) -> bool:
        """Whether the contact of two objects is expected, so that their pair is never checked."""
        return id_b in self._allowed.get(id_a, ()) or id_a in self._allowed.get(id_b, ())

    @property
    def ids(self) -> list[int]:
        """The ids of all described objects, ascending."""
        return sorted(self._slots)

    @property
    def names(self) -> dict[int, str]:
        """The names of all described objects by id, for reading."""
        return self._names

    def __contains__(self, object_id: int) -> bool:
        """Whether the object is described."""
        return isinstance(object_id, Hashable) and object_id in self._slots

    def __len__(self) -> int:
        """Number of described objects."""
        return len(self._slots)

    def name(self, object_id: int) -> str:
        """Name of an object, for display. Raises InputError for an unknown id."""
        self.slot(object_id)
        return self._names[object_id]

    def slot(self, object_id: int) -> int:
        """Slot of an object. Raises InputError for an unknown id."""
        if object_id not in self:
            raise InputError(f"expected the id of an object that was described, got {object_id!r}")
        return self._slots[object_id]

    def slots_of(self, ids: NDArray[np.uint32]) -> NDArray[np.int32]:
        """Slot of each id, -1 where unknown. Cached, because messages usually name the same objects as the last one."""
        if len(ids) != len(self._last_ids) or np.count_nonzero(ids != self._last_ids):
            self._last_slots = self.find_slots(ids)
            self._last_ids = ids.copy()
        return self._last_slots

    def find_slots(self, ids: NDArray[np.uint32]) -> NDArray[np.int32]:
        """Slot of each id, -1 where unknown."""
        known = np.fromiter(self._slots, np.uint32, len(self._slots))
        slot_of = np.fromiter(self._slots.values(), np.int32, len(self._slots))
        order = np.argsort(known)
        known, slot_of = known[order], slot_of[order]
        at = np.searchsorted(known, ids)
        at[at == len(known)] = 0
        found = known[at] == ids if len(known) else np.zeros(len(ids), bool)
        return np.where(found, slot_of[at] if len(known) else -1, -1).astype(np.int32)

    def values_by_name(self, classes: Classes, otherwise: float) -> NDArray[np.float64]:
        """Value of the class of each body (N,), by slot, and `otherwise` without a class. Cached."""
        values = self._by_name.get((classes, otherwise))
        if values is None or len(values) != self.capacity:
            values = self._by_name[classes, otherwise] = np.full(self.capacity, otherwise)
            for object_id, slot in self._slots.items() if classes else ():
                values[slot] = value_of(classes, self._names[object_id], otherwise)
        return values

    def used(self) -> NDArray[np.intp]:
        """Slots of all described objects, ascending."""
        return np.flatnonzero(self.bodies.used[: self.top])

    def stale_ids(self, now: float, stale_after: float) -> list[int]:
        """Ids of the objects with a last state older than stale_after (s) at `now` (s), ascending."""
        bodies, used = self.bodies, self.used()
        is_stale = bodies.seen[used] & ~bodies.static[used] & (now - bodies.time[used] > stale_after)
        return sorted(bodies.id[used[is_stale]].tolist())

    def unseen_ids(self) -> list[int]:
        """Ids of the moving objects without any state, ascending."""
        bodies, used = self.bodies, self.used()
        return sorted(bodies.id[used[~bodies.seen[used] & ~bodies.static[used]]].tolist())

    # ------------------------------------------------------------------ changing

    def describe(self, d: ObjectDescription, model: Model, prepared: Modelled | None = None) -> int:
        """Add a new object, or replace the description of a known one and keep its state. Return its slot.

        prepared: the model of the object, if it is known already.
        Raises InputError, also if all objects together would need more than MOST_MEMORY; ShapeError; UnsupportedError
        for an unsupported shape or model.
        """
        self._memory.check(d)
        if not d.static and any(isinstance(shape, HalfSpace) for shape, _ in d.shapes):
            raise UnsupportedError(f"object {d.object_id}: a HalfSpace has no end and can only be static")
        planar = self._is_planar(d)
        pose = flat_pose(d.pose) if planar and d.pose is not None else d.pose
        modelled = monitored_model(d.shapes, model) if prepared is None else prepared
        slots = self._append_shapes(modelled, d.padding, planar)
        i = self._slots.get(d.object_id)
        if i is None:
            i = self._slots[d.object_id] = self._new_body()
        else:
            self._drop_shapes(i)
        if len(self.parts.next) < len(self._shapes.table.kind):
            parts = make_parts(len(self._shapes.table.kind))
            enlarge(self.parts, parts)
            self.parts = parts
        for k, slot in enumerate(slots):
            faces = faces_of(d, modelled, k)
            if faces is not None:
                self.mesh_faces.add(slot, faces)
        pieces = (piece for piece, _ in modelled.pieces)
        self.unsure.update(slot for slot, piece in zip(slots, pieces, strict=True) if is_unsure(piece))
        lay_out_body(self.multibody, i, slots, modelled.shapes)
        self.planar = planar
        self._write_body(i, d, pose, modelled)
        self._names[d.object_id] = d.name
        self._memory.note(d)
        self._allow(d.object_id, frozenset(d.allowed))
        self.renewed.add(i)
        self._forget_ids()
        return i

    def _append_shapes(self, modelled: Modelled, padding: float, planar: bool) -> list[int]:
        """Append the pieces of an object to the shape table, all or none. Return their slots. Raises ShapeError."""
        corners = modelled.corners or (None,) * len(modelled.pieces)
        slots: list[int] = []
        try:
            for (shape, offset), chosen in zip(modelled.pieces, corners, strict=True):
                tree = shape_tree(shape) if isinstance(shape, Mesh | Points) else None
                placed = flat_pose(offset) if planar else offset
                slots.append(self._shapes.append(shape, placed, padding, chosen, tree))
            plant_trees(self._shapes)
        except Exception:
            for slot in slots:
                self._shapes.remove(slot)
            raise
        return slots

    def _write_body(self, i: int, d: ObjectDescription, pose: Pose | None, modelled: Modelled) -> None:
        """Write the row of a body whose shapes are laid out. A static one gets its pose; another keeps its state."""
        bodies = self.bodies
        bodies.used[i] = True
        bodies.id[i] = d.object_id
        bodies.group[i], bodies.mask[i] = d.group, d.mask
        bodies.model[i], bodies.excess[i], bodies.concave[i] = modelled.model, modelled.excess, not modelled.convex
        note_plain(self.multibody, np.array([i]))
        if d.static:
            assert pose is not None
            bodies.position[i], bodies.quaternion[i] = pose.position, pose.quaternion
            bodies.linear[i] = bodies.angular[i] = bodies.acceleration[i] = 0.0
            bodies.course[i], bodies.rest[i] = STRAIGHT, np.inf
            bodies.seen[i] = True
        elif bodies.static[i]:
            bodies.seen[i] = False  # it moves from now on, and has no state yet
        bodies.static[i] = d.static
        bodies.version[i] += 1

    def remove(self, object_id: int) -> None:
        """Remove an object. Raises InputError for an unknown id."""
        i = self.slot(object_id)
        self._drop_shapes(i)
        self.bodies.used[i] = self.bodies.seen[i] = self.bodies.static[i] = False
        self.bodies.version[i] += 1
        self.renewed.discard(i)
        self._free.append(i)
        self._memory.drop(object_id)
        del self._slots[object_id], self._names[object_id]
        self._allow(object_id, frozenset())
        self._forget_ids()

    def renew_all(self) -> None:
        """Mark every object to be predicted anew in the next step."""
        self.renewed.update(self.used().tolist())

    def forget_states(self, which: NDArray[np.int32] | None = None) -> None:
        """Forget the states of the bodies `which`, of all by default: those that move are unseen until the next one."""
        bodies = self.bodies
        if which is not None:
            bodies.seen[which] = False
            bodies.version[which] += 1
            self.renewed.update(which.tolist())
            return
        bodies.seen[:] = bodies.static & bodies.used
        bodies.version[:] += 1
        self.renewed = set(self.used().tolist())

    def _is_planar(self, d: ObjectDescription) -> bool:
        """Whether the object lies in the plane. Raises UnsupportedError if the scene would mix plane and space."""
        kinds = {is_planar(shape) for shape, _ in d.shapes}
        if any(known != d.object_id for known in self._slots):
            kinds.add(self.planar)
        if len(kinds) > 1:
            raise UnsupportedError(
                f"object {d.object_id}: Circle and Polygon meet each other only; expected a scene in the plane or one "
                "in space, got shapes of both"
            )
        return kinds.pop()

    def _new_body(self) -> int:
        if self._free:
            return self._free.pop()
        if self.top == self.capacity:
            bodies = make_bodies(2 * self.top)
            enlarge(self.bodies._replace(pieces=bodies.pieces), bodies)
            self.bodies = bodies._replace(pieces=self.bodies.pieces)
        self.top += 1
        return self.top - 1

    def _drop_shapes(self, i: int) -> None:
        slot = int(self.bodies.first_shape[i])
        while slot >= 0:
            self._shapes.remove(slot)
            self.mesh_faces.drop(slot)
            self.unsure.discard(slot)
            slot, self.parts.next[slot] = int(self.parts.next[slot]), -1
        self.bodies.first_shape[i] = -1

    def _allow(self, object_id: int, others: frozenset[int]) -> None:
        if others == self._allowed.get(object_id, frozenset()):
            return
        self._allowed[object_id] = others
        if not others:
            del self._allowed[object_id]
        self._allowed_keys = None

    def _forget_ids(self) -> None:
        self._by_name = {}
        self._last_ids = np.zeros(0, np.uint32)

    # ------------------------------------------------------------------ snapshots

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        top, shapes = self.top, self._shapes.used
        free_shapes, free_blocks = self._shapes.free
        size = shapes.size.copy()
        size[shapes.kind != ShapeType.HALF_SPACE, TREE] = 0.0  # `restore` builds the trees again
        snapshot.arrays.update(
            {
                **{
                    f"bodies.{name}": column[:top].copy()
                    for name, column in self.bodies._asdict().items()
                    if name not in DERIVED
                },
                **{f"parts.{name}": column[: len(shapes.kind)].copy() for name, column in self.parts._asdict().items()},
                **{f"shapes.{name}": getattr(shapes, name).copy() for name in shapes._fields if name != "blocks"},
                "shapes.vertices": shapes.vertices.T.copy(),
                "shapes.size": size,
                **mesh_arrays(shapes),
                **self.mesh_faces.arrays(),
            }
        )
        facts |= {
            "names": {str(object_id): name for object_id, name in self._names.items()},
            "memory": self._memory.facts(),
            "allowed": {str(object_id): sorted(others) for object_id, others in self._allowed.items()},
            "planar": self.planar,
            "renewed": sorted(self.renewed),
            "unsure": sorted(self.unsure),
            "free": list(self._free),
            "free_shapes": free_shapes,
            "free_blocks": list(free_blocks.items()),
        }

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        self._restore_shapes(snapshot, facts)
        top = len(snapshot.array("bodies.used", self.bodies.used))
        count, capacity = len(self._shapes.used.kind), self.capacity
        while capacity < top:
            capacity *= 2
        saved = snapshot.columns("bodies", self.bodies, top, without=DERIVED)
        bodies = BodyTable(
            **saved, plain=np.zeros(top, np.uint8), planned=np.zeros(top, np.bool_), pieces=np.zeros(0, MOTION)
        )
        bodies.motion["until"], bodies.motion["piece"] = np.inf, 0  # `Plans` sets those of bodies that follow a plan
        parts = Parts(**snapshot.columns("parts", self.parts, count))
        _check_chains(bodies, parts, self._shapes.used.kind)
        self.top, self.bodies, self.parts = top, make_bodies(capacity), make_parts(len(self._shapes.table.kind))
        enlarge(bodies, self.bodies)
        enlarge(parts, self.parts)
        used = self.used()
        note_plain(self.multibody, used)
        self._slots = dict(zip(bodies.id[used].tolist(), used.tolist(), strict=True))
        self._names = {object_id: facts["names"][str(object_id)] for object_id in self._slots}
        self._memory.restore(facts.get("memory", {}), self._slots)
        for object_id, others in facts["allowed"].items():
            self._allow(int(object_id), frozenset(others))
        self.planar = facts["planar"]
        self._forget_ids()
        self._free, self.renewed = list(facts["free"]), set(facts["renewed"])
        if sorted([*self._free, *used.tolist()]) != list(range(top)) or not self.renewed <= set(used.tolist()):
            raise InputError("snapshot: expected every slot of a body to be either used or free, got others")

    def _restore_shapes(self, snapshot: Snapshot, facts: Facts) -> None:
        like = self._shapes.table
        kind = snapshot.array("shapes.kind", like.kind)
        vertices = snapshot.array("shapes.vertices", like.vertices.T).T
        index = snapshot.array("shapes.vertex_index", like.vertex_index, vertices.shape[1])
        rows = {
            name: snapshot.array(f"shapes.{name}", column, len(kind))
            for name, column in like._asdict().items()
            if name not in SHARED
        }
        table = ShapeTable(**rows, vertices=vertices, vertex_index=index, blocks=like.blocks)
        table.size[table.kind != ShapeType.HALF_SPACE, TREE] = 0.0
        check_range("shapes.kind", table.kind, 0, max(ShapeType) + 1)
        check_range("shapes.vertex_start", table.vertex_start, 0, len(index) + 1)
        check_range("shapes.vertex_count", table.vertex_count, 0, len(index) + 1)
        check_range("shapes.vertex_start", table.vertex_start + table.vertex_count, 0, len(index) + 1)
        hulls = np.isin(table.kind, (ShapeType.CONVEX_HULL, POLYGON))
        if (table.vertex_count[hulls] % LANES).any() or not table.vertex_count[hulls].all():
            raise InputError(f"snapshot, shapes.vertex_count: expected multiples of {LANES}, got others")
        corners = table.size[table.kind == POLYGON, 0]
        if not ((corners >= 1) & (corners <= table.vertex_count[table.kind == POLYGON])).all():
            raise InputError(f"snapshot, shapes.size: expected as many corners as there are, got {corners.tolist()}")
        free_blocks = {count: list(starts) for count, starts in facts["free_blocks"]}
        self._shapes = ShapeTableBuilder.restored(table, list(facts["free_shapes"]), free_blocks)
        plant_meshes(self._shapes, snapshot)
        self.mesh_faces = MeshFaces.restored(snapshot, table.kind)
        self.unsure = set(facts.get("unsure", ()))


def _check_chains(bodies: BodyTable, parts: Parts, kind: NDArray[Any]) -> None:
    """Check that every body in use has shapes, and that no chain of shapes is circular. Raises InputError."""
    check_range("bodies.first_shape", bodies.first_shape, -1, len(kind))
    check_range("parts.next", parts.next, -1, len(kind))
    following, left = parts.next.tolist(), len(kind)
    for slot in bodies.first_shape[bodies.used].tolist():
        if slot < 0:
            raise InputError("snapshot, bodies.first_shape: expected a shape of each body, got none")
        while slot >= 0:
            left -= 1
            if left < 0 or not kind[slot]:
                raise InputError("snapshot, parts.next: expected chains of shapes, each of one body, got others")
            slot = following[slot]


@settled
@kernel
def count_bodies(
    used: Any, static: Any, seen: Any, time: Any, count: int, now: float, stale_after: float
) -> tuple[int, int, int]:
    """Count the static, the unseen and the stale bodies in the first `count` slots of these columns of Bodies.

    Unseen: without any state. Stale: not static, and the last state is older than stale_after (s).
    """
    resting = unseen = stale = 0
    for i in range(count):
        if used[i]:
            resting += static[i]
            unseen += not seen[i]
            stale += seen[i] and not static[i] and now - time[i] > stale_after
    return resting, unseen, stale
