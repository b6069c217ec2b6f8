"""Simple polygons for tests: random and hard ones."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray


def star_shaped(rng: np.random.Generator, corners: int) -> NDArray[np.float64]:
    """Random simple polygon (n, 2) around the origin, mostly concave, counter-clockwise."""
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.9, corners)) / corners
    return (rng.uniform(0.2, 1, corners) * np.array([np.cos(angle), np.sin(angle)])).T


def convex(rng: np.random.Generator, corners: int) -> NDArray[np.float64]:
    """Random convex polygon (n, 2) with its corners on an ellipse, counter-clockwise."""
    angle = np.sort(2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.9, corners)) / corners)
    return rng.normal(size=2) + np.array([np.cos(angle), 0.7 * np.sin(angle)]).T


@st.composite
def histograms(draw: st.DrawFn) -> NDArray[np.float64]:
    """Draw adjacent columns of integer heights: a simple polygon with right angles, straight corners and many ties."""
    heights = draw(st.lists(st.integers(1, 4), min_size=1, max_size=5))
    top = [(k + (1 - i % 2), h) for k, h in reversed(list(enumerate(heights))) for i in range(2)]
    base = [(k, 0) for k in range(len(heights) + 1)]
    polygon = [p for i, p in enumerate(base + top) if i == 0 or p != (base + top)[i - 1]]
    return np.array(polygon, float)


HARD = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "L": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    "straight corners": [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)],
    "needle": [(0, 0), (1e6, 1e-6), (1e6, 2e-6)],
    "comb": [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (5, 1), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (0, 3)],
    "spiral": [
        *[(0, 0), (6, 0), (6, 6), (1, 6), (1, 2), (4, 2), (4, 4)],
        *[(3, 4), (3, 3), (2, 3), (2, 5), (5, 5), (5, 1), (0, 1)],
    ],
    "arrow": [(0, 0), (4, 2), (0, 4), (1, 2)],
    "corner on a diagonal": [(0, 0), (4, 0), (4, 4), (2, 2), (0, 4)],
    "dent of one bit": [(0, 0), (2, 0), (2, 2), (1, 2 - 2.0**-52), (0, 2)],
}
