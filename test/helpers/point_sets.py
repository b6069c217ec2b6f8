"""Point sets for tests of bounding volumes: random sets, and sets that break careless constructions."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotation(seed: int) -> Array:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * [1, 1, np.linalg.det(q)]


def _sets() -> dict[str, Array]:
    rng = np.random.default_rng(0)
    cube = np.array(list(product((-1.0, 1.0), repeat=3)))
    directions = rng.normal(size=(200, 3))
    return {
        "cube": cube,
        "turned box": cube * [3, 2, 0.5] @ rotation(1).T,
        "tetrahedron": cube[[0, 3, 5, 6]],
        "ball": directions / np.linalg.norm(directions, axis=1, keepdims=True),
        "cloud": rng.normal(size=(300, 3)) * [1, 2, 3] @ rotation(2).T,
        "crowded at one end": np.vstack([rng.normal(size=(500, 3)) * 0.1, [[10, 0, 0], [9, 1, 0]]]),
        "lattice": np.array(list(product(range(4), repeat=3)), float),
        "needle": rng.normal(size=(50, 3)) * [1e-6, 1e-6, 1] @ rotation(3).T,
        "pancake": rng.normal(size=(50, 3)) * [1, 1, 1e-9] @ rotation(4).T,
        "flat": rng.normal(size=(50, 3)) * [1, 1, 0],
        "line": np.linspace(0, 1, 9)[:, None] * np.array([1.0, 2.0, 3.0]),
        "one point": np.array([[1.0, 2.0, 3.0]]),
        "one point, often": np.full((7, 3), 0.1),
        "two points": np.array([[0.1, 0.2, 0.3], [0.7, -0.2, 0.4]]),
        "far from the origin": cube + np.array([1e8, -1e8, 1e8]),
        "every point twice": np.repeat(cube, 2, axis=0),
    }


SETS = _sets()
