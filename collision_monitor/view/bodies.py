"""Bodies: descriptions of objects as arrays of pieces, by form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import multiply, rotation_matrix
from collision_monitor.view.instanced_forms import PLANE, Form, Piece, pieces_of

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_FORMS: Final = 256
"""Hulls, meshes and polygons with points of their own that are drawn. The browser draws each with a call of its own;
further ones are drawn as their bounding boxes."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """All pieces of one form.

    body (n,): ascending rows of the bodies. position (n, 3) m and quaternion (n, 4): in the body's frame.
    scale (n, 3): m.
    """

    form: Form
    body: Indices
    position: Floats
    quaternion: Floats
    scale: Floats

    def of(self, bodies: Indices) -> tuple[Indices, Indices]:
        """Return the pieces of bodies (k,), with repeats, as two arrays (m,): the piece, and the index in `bodies`."""
        begin, end = np.searchsorted(self.body, bodies, "left"), np.searchsorted(self.body, bodies, "right")
        count = end - begin
        which = np.repeat(np.arange(len(bodies)), count)
        return np.repeat(begin - np.cumsum(count) + count, count) + np.arange(len(which)), which

    def placed(self, piece: Indices, position: Floats, quaternion: Floats) -> tuple[Floats, Floats]:
        """Return positions (m, 3) and quaternions (m, 4) of pieces (m,), each of a body at this pose."""
        turned = np.einsum("nij,nj->ni", rotation_matrix(quaternion), self.position[piece])
        return position + turned, multiply(quaternion, self.quaternion[piece])


class DescribedBodies:
    """Described objects (n,), ascending by id: ids (n,), static (n,), reach (n,) m, and their pieces by form's name.

    pieces_by_id: as of `described_pieces`. The reach is the radius about an object's origin of a ball that contains it,
    without half-spaces. boxed: pieces that are drawn as their bounding boxes, because there are more than MOST_FORMS.
    """

    def __init__(
        self, descriptions: Sequence[ObjectDescription] = (), pieces_by_id: dict[int, list[Piece]] | None = None
    ) -> None:
        self.descriptions = tuple(sorted(descriptions, key=lambda each: each.object_id))
        self.ids = np.array([each.object_id for each in self.descriptions], np.uint32)
        self.static = np.array([each.static for each in self.descriptions], np.bool_)
        self.reach = np.zeros(len(self.ids))
        self.boxed = 0
        own: set[str] = set()
        found: dict[str, list[tuple[int, Piece]]] = {}
        for body, each in enumerate(self.descriptions):
            known = (pieces_by_id or {}).get(each.object_id)
            for piece in described_pieces(each) if known is None else known:
                if piece.form.own and piece.form.name not in own:
                    if len(own) >= MOST_FORMS:
                        piece = piece.boxed()
                        self.boxed += 1
                    else:
                        own.add(piece.form.name)
                found.setdefault(piece.form.name, []).append((body, piece))
        self.pieces = {name: self._joined(rows) for name, rows in found.items()}

    def _joined(self, rows: list[tuple[int, Piece]]) -> Pieces:
        form = rows[0][1].form
        body = np.array([body for body, _ in rows], np.intp)
        position = np.array([piece.pose.position for _, piece in rows])
        scale = np.array([piece.scale for _, piece in rows], np.float64)
        if form.name != PLANE:
            centre, half = form.bounds
            far = np.linalg.norm(position, axis=1) + np.linalg.norm((np.abs(centre) + half) * scale, axis=1)
            np.maximum.at(self.reach, body, far)
        return Pieces(form, body, position, np.array([piece.pose.quaternion for _, piece in rows]), scale)


def described_pieces(description: ObjectDescription) -> list[Piece]:
    """Return the pieces of all shapes of an object."""
    return [piece for shape, pose in description.shapes for piece in pieces_of(shape, pose)]
