"""A picture of a step for RViz or Foxglove: shapes coloured by their state, contacts, and predicted impacts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import Change, Removal
from collision_monitor.monitor.result import StepResult
from collision_monitor.pipeline.catalogue import Catalogue
from collision_monitor.ros.monitor.marker_bytes import Color, Marker, MarkerKind, encode
from collision_monitor.shapes.pose import Pose, rotation_matrix
from collision_monitor.shapes.registry import kind_of

_STATIC: Final[Color] = (0.55, 0.57, 0.60, 0.35)
_CALM: Final[Color] = (0.35, 0.55, 0.85, 0.9)
_PREDICTED: Final[Color] = (0.95, 0.70, 0.15, 1.0)
_TOUCHING: Final[Color] = (0.85, 0.15, 0.15, 1.0)
_CONTACT: Final[Color] = (1.0, 1.0, 1.0, 1.0)

_NORMAL_LENGTH = 0.5
"""Length of the line that shows a contact's normal (m)."""
_LABELS = 10
"""Number of soonest impacts that are labelled with the time left."""

Vertices = NDArray[np.float64]


class MarkerView:
    """Draws the objects of a catalogue at their last poses. Builds their surfaces only when it draws."""

    def __init__(self, catalogue: Catalogue, frame_id: str) -> None:
        self._catalogue = catalogue
        self._frame_id = frame_id
        self._unbuilt: set[int] = set()
        self._changed = False
        self._surfaces: dict[int, Vertices] = {}
        self._static: dict[int, Vertices] = {}
        self._ids = np.empty(0, np.uint32)
        self._vertices = np.empty((0, 3))
        self._owner = np.empty(0, np.intp)
        self._poses: dict[int, NDArray[np.float64]] = {}

    def update(self, changes: Iterable[Change]) -> None:
        """Note which objects of the catalogue are new, changed or removed."""
        self._changed = True
        for each in changes:
            if isinstance(each, Removal):
                self._forget(each.object_id)
            else:
                self._unbuilt.add(each.object_id)

    def _forget(self, object_id: int) -> None:
        for known in (self._surfaces, self._static, self._poses):
            known.pop(object_id, None)
        self._unbuilt.discard(object_id)

    def _build(self) -> None:
        """Build the surfaces of the objects that changed since the last picture."""
        for object_id in self._unbuilt:
            it = self._catalogue.descriptions[object_id]
            self._surfaces.pop(object_id, None)
            self._static.pop(object_id, None)
            corners = [_placed(kind_of(shape).triangles(shape).reshape(-1, 3), pose) for shape, pose in it.shapes]
            vertices = np.concatenate(corners)
            if it.static and it.pose is not None:
                self._static[object_id] = _placed(vertices, it.pose)
            else:
                self._surfaces[object_id] = vertices
        self._unbuilt.clear()
        self._ids = np.array(sorted(self._surfaces), np.uint32)
        surfaces = [self._surfaces[int(i)] for i in self._ids]
        self._vertices = np.concatenate(surfaces) if surfaces else np.empty((0, 3))
        self._owner = np.repeat(np.arange(len(surfaces)), [len(s) for s in surfaces])
        self._changed = False

    def draw(self, states: NDArray[np.void], result: StepResult) -> bytes:
        """Return the bytes of a MarkerArray. Objects without a state are left out.

        states (n,): those of the step (records.STATE).
        """
        if self._changed:
            self._build()
        for state in states[np.isin(states["id"], self._ids)]:  # refused states may have any id
            self._poses[int(state["id"])] = np.r_[state["position"], state["quaternion"]]
        contacts = result.contacts
        touching = np.isin(self._ids, [contacts["id_a"], contacts["id_b"]])
        predicted = np.isin(self._ids, [result.predictions["id_a"], result.predictions["id_b"]]) & ~touching
        seen = np.array([int(i) in self._poses for i in self._ids], bool)
        world = self._world_vertices()

        def surface(namespace: str, color: Color, which: NDArray[np.bool_]) -> Marker:
            return Marker(namespace, MarkerKind.TRIANGLE_LIST, color, world[(which & seen)[self._owner]])

        static = np.concatenate(list(self._static.values())) if self._static else np.empty((0, 3))
        markers = [
            Marker("static", MarkerKind.TRIANGLE_LIST, _STATIC, static),
            surface("clear", _CALM, ~touching & ~predicted),
            surface("predicted", _PREDICTED, predicted),
            surface("touching", _TOUCHING, touching),
            *_contact_markers(contacts),
            *_prediction_markers(result.predictions),
        ]
        return encode(result.stamp_ns, self._frame_id, markers)

    def _world_vertices(self) -> Vertices:
        nowhere = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        poses = np.array([self._poses.get(int(i), nowhere) for i in self._ids]).reshape(-1, 7)
        rotations = rotation_matrix(poses[:, 3:])
        turned = np.einsum("nij,nj->ni", rotations[self._owner], self._vertices)
        world: Vertices = turned + poses[self._owner, :3]
        return world


def _placed(vertices: Vertices, pose: Pose) -> Vertices:
    placed: Vertices = vertices @ pose.rotation.T + pose.position
    return placed


def _contact_markers(contacts: NDArray[np.void]) -> list[Marker]:
    known = contacts[np.isfinite(contacts["point_a"]).all(axis=1)]
    start = known["point_a"]
    lines = np.stack([start, start + _NORMAL_LENGTH * known["normal"]], axis=1).reshape(-1, 3)
    return [
        Marker("contact points", MarkerKind.SPHERE_LIST, _CONTACT, start, (0.1, 0.1, 0.1)),
        Marker("contact normals", MarkerKind.LINE_LIST, _CONTACT, lines, (0.03, 0.0, 0.0)),
    ]


def _prediction_markers(predictions: NDArray[np.void]) -> list[Marker]:
    known = predictions[np.isfinite(predictions["point"]).all(axis=1)]
    markers = [Marker("predicted impacts", MarkerKind.SPHERE_LIST, _PREDICTED, known["point"], (0.15, 0.15, 0.15))]
    for i in range(_LABELS):
        label = Marker("time left", MarkerKind.TEXT, _PREDICTED, scale=(0.0, 0.0, 0.4), number=i)
        if i < len(known):
            x, y, z = (float(c) for c in known["point"][i])
            label = replace(label, position=(x, y, z + 0.5), text=f"{known['lower'][i]:.2f} s")
        markers.append(label)
    return markers
