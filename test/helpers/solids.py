"""Closed meshes for tests, counter-clockwise from outside, on integers so that rational oracles stay quick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Solid = tuple[NDArray[np.float64], NDArray[np.int64]]


def voxels(filled: NDArray[np.bool_]) -> Solid:
    """Surface of the filled unit cubes (i, j, k), two triangles for each side between a filled and an empty cube."""
    filled = np.pad(filled, 1)
    quads = []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        for cell in np.argwhere(filled):
            for step in (0, 1):
                beside = cell.copy()
                beside[axis] += 2 * step - 1
                if not filled[tuple(beside)]:
                    corner = cell - 1 + step * np.eye(3, dtype=int)[axis]
                    quad = [corner, corner + u, corner + u + v, corner + v]
                    quads.append(quad if step else quad[::-1])
    points, index = np.unique(np.array(quads).reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    return points.astype(float), np.vstack([index[:, [0, 1, 2]], index[:, [0, 2, 3]]])


def cube() -> Solid:
    return voxels(np.ones((1, 1, 1), bool))


def bar(*size: int) -> Solid:
    return voxels(np.ones(size, bool))


def u_shape() -> Solid:
    filled = np.ones((3, 1, 3), bool)
    filled[1, 0, 1:] = False
    return voxels(filled)


def ring() -> Solid:
    filled = np.ones((3, 3, 1), bool)
    filled[1, 1, 0] = False
    return voxels(filled)


def hollow() -> Solid:
    filled = np.ones((3, 3, 3), bool)
    filled[1, 1, 1] = False
    return voxels(filled)


def octahedron() -> Solid:
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    return points, np.array(faces)


CONCAVE = {"U": u_shape, "ring": ring, "hollow": hollow}
CONVEX = {"cube": cube, "bar": lambda: bar(1, 2, 3), "octahedron": octahedron}

# integer maps that turn the grid's planes and the rays along them
SKEWS = {
    "upright": np.eye(3),
    "turned about z": np.array([[1, -1, 0], [1, 1, 0], [0, 0, 1]], float),
    "on a corner": np.array([[1, -1, 1], [1, 1, 1], [-2, 0, 1]], float),
}
