"""The faces of convex meshes, which name the features of their contacts as the user numbered them.

A convex mesh is tested as the hull of its vertices, which has numbers of its own. The kernels that find contacts never
read the faces. Only where the details of a step's contacts are written, those on such a hull are named anew.
"""

from __future__ import annotations

from hashlib import blake2b
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.errors import InputError
from collision_monitor.geometry.vector import Vector, opposite, plus, rotate_back
from collision_monitor.impact.body_contact import SHAPE_I, SHAPE_J
from collision_monitor.meshes.distance.feature import IN_FACE, feature_in_triangle, off_triangle, slot_tie
from collision_monitor.meshes.distance.triangle_pair import Corners
from collision_monitor.monitor.contacts.contact_details import core_point, origin_now
from collision_monitor.monitor.state.snapshot import Snapshot, check_range
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.last_state import rotation_now
from collision_monitor.narrow_phase.contact_row import (
    FEATURE_INDEX_A,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
)
from collision_monitor.objects.closed_parts import separated
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import Modelled
from collision_monitor.records import Model
from collision_monitor.shapes.feature_types import FACE, UNKNOWN
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, Mesh
from collision_monitor.tolerances import LARGEST_INPUT

Array = NDArray[np.float64]

NONE: Final = IN_FACE + 1
"""Rank of no feature."""


class FaceTable(NamedTuple):
    """Faces by slot of the shape table, as the kernel reads them. Equal meshes share their faces."""

    first: Any  # (K,) int64
    count: Any  # (K,) int64; 0: the slot holds no convex mesh
    corners: Any  # (F, 3, 3): of each face, in the frame of the slot (m)
    planes: Any  # (F, 4): outward unit normal and offset (m)


class MeshFaces:
    """The faces of the convex meshes in the slots of a shape table."""

    def __init__(self) -> None:
        self._of: dict[int, bytes] = {}  # slot -> digest of its faces
        self._users: dict[bytes, int] = {}  # number of slots with these faces
        self._faces: dict[bytes, tuple[Array, Array]] = {}  # their corners and planes
        self._packed: tuple[dict[bytes, int], Array, Array] | None = None  # where each begins; None after a change
        self._table: FaceTable | None = None  # None after a change

    def __len__(self) -> int:
        """Number of slots with faces."""
        return len(self._of)

    def __eq__(self, other: object) -> bool:
        """Whether the same slots have the same faces."""
        return isinstance(other, MeshFaces) and self._of == other._of

    __hash__ = None  # type: ignore[assignment]

    def add(self, slot: int, corners: Array) -> None:
        """Give a slot without faces those of a convex mesh, by their corners (n, 3, 3) in its frame (m)."""
        key = blake2b(corners.tobytes(), digest_size=16).digest()
        if key not in self._faces:
            self._faces[key] = corners, _planes(corners)
            self._packed = None
        self._of[slot] = key
        self._users[key] = self._users.get(key, 0) + 1
        self._table = None

    def drop(self, slot: int) -> None:
        """Forget the faces of a slot, if it has some."""
        key = self._of.pop(slot, None)
        if key is None:
            return
        self._table = None
        self._users[key] -= 1
        if not self._users[key]:
            del self._users[key], self._faces[key]
            self._packed = None

    def table(self, slots: int) -> FaceTable:
        """The faces of the slots up to this number, as the kernel reads them. Cached."""
        if self._packed is None:
            counts = [len(corners) for corners, _ in self._faces.values()]
            begin = dict(zip(self._faces, (np.cumsum(counts) - counts).tolist(), strict=True))
            every, planes = (np.concatenate(each) for each in zip(*self._faces.values(), strict=True))
            for (key, at), n in zip(begin.items(), counts, strict=True):
                self._faces[key] = every[at : at + n], planes[at : at + n]  # so that they are in memory once
            self._packed = begin, every, planes
        if self._table is None or len(self._table.first) != slots:
            begin, every, planes = self._packed
            first, count = np.zeros(slots, np.int64), np.zeros(slots, np.int64)
            for slot, key in self._of.items():
                first[slot], count[slot] = begin[key], len(self._faces[key][0])
            self._table = FaceTable(first, count, every, planes)
        return self._table

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays of a snapshot; none without faces.

        faces.slot, faces.of: each slot and its mesh. faces.count: the number of faces of each mesh. faces.corners.
        """
        if not self._of:
            return {}
        slots = sorted(self._of)
        keys = list(dict.fromkeys(self._of[slot] for slot in slots))
        place = {key: k for k, key in enumerate(keys)}
        meshes = [self._faces[key][0] for key in keys]
        return {
            "faces.slot": np.array(slots, np.int32),
            "faces.of": np.array([place[self._of[slot]] for slot in slots], np.int32),
            "faces.count": np.array([len(corners) for corners in meshes], np.int32),
            "faces.corners": np.concatenate(meshes),
        }

    @classmethod
    def restored(cls, snapshot: Snapshot, kind: NDArray[np.uint8]) -> MeshFaces:
        """Restore what `arrays` saved. kind: of each slot of the shape table. Raises InputError for other content."""
        faces = cls()
        if "faces.slot" not in snapshot.arrays:  # of older sessions, too
            return faces
        slots = snapshot.array("faces.slot", np.zeros(0, np.int32))
        of = snapshot.array("faces.of", np.zeros(0, np.int32), len(slots))
        counts = snapshot.array("faces.count", np.zeros(0, np.int32))
        check_range("faces.slot", slots, 0, len(kind))
        check_range("faces.of", of, 0, len(counts))
        check_range("faces.count", counts, 1, 1 << 31)
        corners = snapshot.array("faces.corners", np.zeros((0, 3, 3)), int(counts.sum()))
        if not (len(set(slots.tolist())) == len(slots) and (kind[slots] == CONVEX_HULL).all()):
            raise InputError("snapshot, faces.slot: expected the slots of different hulls, got others")
        if not (np.abs(corners) <= LARGEST_INPUT).all():
            raise InputError(f"snapshot, faces: expected finite coordinates up to {LARGEST_INPUT:g}, got others")
        meshes = np.split(corners, np.cumsum(counts)[:-1])
        for slot, mesh in zip(slots.tolist(), of.tolist(), strict=True):
            faces.add(slot, meshes[mesh])
        return faces


def faces_of(d: ObjectDescription, modelled: Modelled, k: int) -> Array | None:
    """Corners (n, 3, 3) of the faces of the convex mesh that piece k of an object's model is exactly, in its frame.

    None if it is another shape.
    """
    piece, pose = modelled.pieces[k]
    shape, at = d.shapes[modelled.shapes[k]]
    if not (isinstance(piece, ConvexHull) and isinstance(shape, Mesh)) or modelled.excess > 0.0:
        return None
    is_part = modelled.shapes.count(modelled.shapes[k]) > 1 and len(separated(shape)) == 1
    if is_part or (modelled.model is Model.CONVEX_HULL and len(d.shapes) > 1):
        return None  # a part of it, or the hull of several
    return _in_frame(shape, at, pose)


def _in_frame(mesh: Mesh, at: Pose, frame: Pose) -> Array:
    vertices = mesh.vertices
    if not ((at.position == frame.position).all() and (at.quaternion == frame.quaternion).all()):
        vertices = (vertices @ at.rotation.T + at.position - frame.position) @ frame.rotation
    corners: Array = np.ascontiguousarray(vertices[mesh.faces])
    return corners


def _planes(corners: Array) -> Array:
    """Outward unit normals and offsets (n, 4) of the faces of a convex solid; a face without an area has none."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    offset = np.einsum("ij,ij->i", normal, corners[:, 0])
    inward = normal @ corners.reshape(-1, 3).mean(axis=0) > offset
    planes = np.column_stack([normal, offset])
    planes[inward] *= -1.0
    planes[length == 0.0] = 0.0, 0.0, 0.0, np.inf
    return planes


@device
def _feature(faces: Any, s: int, x: Vector, n: Vector, reach: float) -> tuple[float, float]:
    """Type and index of the feature of the convex mesh in slot s at a point x of its surface, for a normal n.

    As `triangle_feature`, of the best rank of all faces at the point; of equal ones, the lowest face.
    """
    first, count = faces.first[s], faces.count[s]
    rank, kind, index = _best_at(faces, first, count, x, n, reach)
    if rank < NONE:
        return kind, index
    top = -inf
    for f in range(first, first + count):
        top = max(top, _height(faces, f, x))
    nearest, foot = inf, x  # the point is off the surface by its error
    for f in range(first, first + count):
        if _height(faces, f, x) >= top - max(abs(top), reach):
            off, on = off_triangle(x, _triangle(faces, f))
            if off < nearest:
                nearest, foot = off, on
    _, kind, index = _best_at(faces, first, count, foot, n, reach)
    return kind, index


@device
def _best_at(faces: Any, first: int, count: int, x: Vector, n: Vector, reach: float) -> tuple[int, float, float]:
    """Rank, type and index of the best feature of the faces that contain a point; NONE if no face does."""
    best, kind, index = NONE, FACE, 0.0
    for f in range(first, first + count):
        if _height(faces, f, x) < -reach:
            continue
        T = _triangle(faces, f)
        off, _ = off_triangle(x, T)
        if off > reach * reach:
            continue
        rank, own, c = feature_in_triangle(T, x, n, reach)
        if rank < best:
            best, kind, index = rank, own, float(f - first) if own == FACE else 3.0 * (f - first) + c
    return best, kind, index


@inlined
def _height(faces: Any, f: int, x: Vector) -> float:
    return float(faces.planes[f, 0] * x[0] + faces.planes[f, 1] * x[1] + faces.planes[f, 2] * x[2] - faces.planes[f, 3])


@device
def _triangle(faces: Any, f: int) -> Corners:
    c = faces.corners
    return Corners(
        (c[f, 0, 0], c[f, 0, 1], c[f, 0, 2]), (c[f, 1, 0], c[f, 1, 1], c[f, 1, 2]), (c[f, 2, 0], c[f, 2, 1], c[f, 2, 2])
    )


@device
def _name(multibody: Any, pair: Any, side: int, now: float, faces: Any, scratch: Any, row: Any) -> None:
    """Name the feature of the first body (side 0) or the second (1) of a pair in its result row."""
    table, parts, bodies = multibody
    quaternion, R = scratch
    i, s = (pair.i, int(row[SHAPE_I])) if side == 0 else (pair.j, int(row[SHAPE_J]))
    rotation_now(bodies, i, now, quaternion, R[0])
    o = plus(origin_now(bodies, i, now), place_shape(table, parts, s, R[0], R[1]))
    at, p = (FEATURE_TYPE_A, POINT_A) if side == 0 else (FEATURE_TYPE_B, POINT_B)
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    d = rotate_back(R[1], n if side == 0 else opposite(n))
    x, round_off = core_point(table, s, R[1], o, (row[p], row[p + 1], row[p + 2]), d)
    reach = slot_tie(table, int(row[SHAPE_I]), int(row[SHAPE_J])) * table.radius[s] + round_off
    row[at], row[at + FEATURE_INDEX_A - FEATURE_TYPE_A] = _feature(faces, s, x, d, reach)


@kernel
def name_mesh_features(multibody: Any, pairs: Any, results: Any, now: float, faces: Any, scratch: Any) -> None:
    """Name the features on convex meshes in the results (n, RESULT) of the pairs that touch by their faces (FaceTable).

    Those that are UNKNOWN stay so. scratch: a quaternion (1, 4) and rotations (2, 3, 3).
    """
    for k in range(pairs.size):
        if pairs[k].touching == 0:
            continue
        row = results[k]
        if faces.count[int(row[SHAPE_I])] > 0 and row[FEATURE_TYPE_A] != UNKNOWN:
            _name(multibody, pairs[k], 0, now, faces, scratch, row)
        if faces.count[int(row[SHAPE_J])] > 0 and row[FEATURE_TYPE_B] != UNKNOWN:
            _name(multibody, pairs[k], 1, now, faces, scratch, row)
