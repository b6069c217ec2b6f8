"""What a reader of a mesh file returns, and the limits that all readers keep."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FREE_FACES: Final = 1 << 20
"""Triangles that a file of any size may stand for, which take 50 to 100 MB. A larger file: one for each 4 bytes. A
scene that places one mesh many times has more triangles than its file has bytes for."""

MOST_PARTS: Final = 100_000
"""Parts of a scene, with those that it places many times."""


def check_words(words: Iterable[bytes]) -> None:
    """Raise ValueError for an underscore in words that are to be numbers: Python takes 1_0 as 10, no format does."""
    if (word := next((each for each in words if b"_" in each), None)) is not None:
        raise ValueError(f"{word[:40].decode(errors='replace')!r} is no number")


class RawMesh(NamedTuple):
    """vertices (n, 3) and faces (m, 3) as in the file. unit: length in metres of 1 in the file."""

    vertices: Array
    faces: Indices
    unit: float = 1.0


class MeshParts:
    """Collects the parts of a scene. size: of the file (bytes)."""

    def __init__(self, size: int) -> None:
        self._most = max(FREE_FACES, size // 4)
        self._vertices: list[Array] = []
        self._faces: list[Indices] = []
        self._count = self._corners = 0

    def add(self, vertices: Array, faces: Indices, X: Array | None = None) -> None:
        """Add a part. X (4, 4): its pose and scale in the scene, None for the identity.

        A transform that mirrors turns the faces, so that they are counter-clockwise from outside again.
        Raises ShapeError for corners out of range, or for more triangles than the size of the file justifies.
        """
        self._corners += len(vertices)
        self._count += len(faces)
        if max(self._count, self._corners // 3) > self._most or len(self._faces) >= MOST_PARTS:
            limits = f"at most {self._most} triangles and {MOST_PARTS} parts"
            raise ShapeError(f"expected {limits} of a file of this size, got more")
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise ShapeError(f"expected corners from 0 to {len(vertices) - 1}, got {faces.min()} to {faces.max()}")
        if X is not None:
            vertices = vertices @ X[:3, :3].T + X[:3, 3]
            faces = faces if np.linalg.det(X[:3, :3]) >= 0.0 else faces[:, ::-1]
        self._faces.append(faces + (self._corners - len(vertices)))
        self._vertices.append(vertices)

    def mesh(self, unit: float = 1.0) -> RawMesh:
        """Return all parts as one mesh."""
        vertices = np.concatenate([np.zeros((0, 3)), *self._vertices])
        return RawMesh(vertices, np.concatenate([np.zeros((0, 3), np.int64), *self._faces]), unit)
