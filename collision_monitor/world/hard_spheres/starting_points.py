"""Positions and velocities at the start: spheres without overlaps, and speeds in thermal equilibrium."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from collision_monitor.errors import InputError
from collision_monitor.world.hard_spheres.state import Floats

CLEARANCE: Final = 1e-3
"""Overlapping spheres are pushed to this distance from each other, as part of the sum of their radii."""
PUSHES: Final = 2000
"""Rounds of pushing after which the packing counts as impossible. Equal spheres at 0.5 take about 100."""


Pairs = NDArray[np.intp]


def place_spheres(radii: Floats, side: float, periodic: bool, random: np.random.Generator) -> Floats:
    """Return centres (N, 3) of spheres without overlaps in a cube (m). Raises InputError if they do not fit.

    The spheres begin on random sites of a face-centred cubic lattice. Overlapping pairs are then pushed apart.
    """
    lattice = _lattice(len(radii), random)
    if radii.min() < radii.max():
        random.shuffle(lattice)  # sizes must not depend on the place; equal spheres stay near neighbours in memory
    low, high = radii[:, None], side - radii[:, None]
    at = lattice * side if periodic else low + lattice / lattice.max(initial=1e-300) * (high - low)
    for _ in range(PUSHES):
        pairs = overlapping_spheres(at, radii, side if periodic else None)
        if not len(pairs):
            return at
        a, b = pairs.T
        offset = at[b] - at[a]
        offset -= side * np.rint(offset / side) if periodic else 0.0
        same = ~offset.any(axis=1)  # walls can press spheres of one size to the same point
        offset[same] = CLEARANCE * radii.min() * random.normal(size=(np.count_nonzero(same), 3))
        distance = np.linalg.norm(offset, axis=1, keepdims=True)
        push = offset * (((1.0 + CLEARANCE) * (radii[a] + radii[b])[:, None] / distance - 1.0) / 2.0)
        np.add.at(at, b, push)
        np.subtract.at(at, a, push)
        at = np.mod(at, side) if periodic else np.clip(at, low, high)
    raise InputError(
        f"packing: expected one at which {len(radii)} spheres of these radii fit between the walls, "
        f"found no place for all in {PUSHES} attempts; give a smaller packing"
    )


def _lattice(count: int, random: np.random.Generator) -> Floats:
    """Random sites of a face-centred cubic lattice in the order of their coordinates, (count, 3) from 0 to below 1."""
    along = int(np.ceil(round((count / 4.0) ** (1.0 / 3.0), 9)))
    corners = np.stack(np.meshgrid(*[np.arange(along)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    sites = corners + np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]])
    chosen = np.sort(random.permutation(4 * along**3)[:count])
    return np.asarray(sites.reshape(-1, 3)[chosen] / along)


def overlapping_spheres(positions: Floats, radii: Floats, period: float | None) -> Pairs:
    """Return the pairs (n, 2) of overlapping spheres; period: side of the cube with periodic walls (m)."""
    at = positions if period is None else np.mod(positions, period)
    at = np.where(at == period, 0.0, at)  # the remainder of a tiny negative number rounds up to the period
    pairs = cKDTree(at, boxsize=period).query_pairs(2.0 * float(radii.max()), output_type="ndarray")
    offset = at[pairs[:, 1]] - at[pairs[:, 0]]
    if period is not None:
        offset -= period * np.rint(offset / period)
    touching = (offset**2).sum(axis=1) < (radii[pairs[:, 0]] + radii[pairs[:, 1]]) ** 2
    found = pairs[touching]
    ordered: Pairs = found[np.lexsort(found.T)]
    return ordered


def thermal(masses: Floats, periodic: bool, random: np.random.Generator) -> Floats:
    """Return normally distributed velocities (N, 3), 1 m/s along each axis for the mean mass, at rest as a whole.

    Between reflecting walls, the momentum changes at each bounce, so it need not be 0 at the start.
    """
    velocities = random.normal(size=(len(masses), 3)) / np.sqrt(masses)[:, None]
    if periodic:
        velocities -= (masses[:, None] * velocities).sum(axis=0) / masses.sum()
    speed2 = (masses * (velocities**2).sum(axis=1)).sum() / (3.0 * masses.sum())
    return np.asarray(velocities / np.sqrt(speed2))
