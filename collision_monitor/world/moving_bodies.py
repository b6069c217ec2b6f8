"""Bodies that move and turn at random at a fixed contact density: the scenes of the benchmark.

Each body overlaps 0.5 others on average, at any number of bodies. The numbers, their order and the file format
equal those of the benchmark of other systems, so that all run the same frames.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from math import acos, pi
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.geometry.qhull import qhull
from collision_monitor.settings.regular_file import open_regular
from collision_monitor.shapes.pose import from_rotation_vector, multiply
from collision_monitor.shapes.registry import Box, Capsule, ConvexHull, Cylinder, Shape, Sphere

Array = NDArray[np.float64]

BENCHMARK_SCENES: Final = ("boxes", "spheres", "mixed", "hulls")
"""Names of the scenes; their order is part of the seed."""

FRAMES: Final = 12
TIME_STEP: Final = 0.05
"""Time between frames (s)."""
HALF_EXTENTS: Final = (0.2, 0.6)
"""Range (m) of half extents, radii and half lengths."""
MAX_RATE: Final = 1.0
"""Largest component of velocity (m/s) and angular velocity (rad/s)."""
MEAN_OVERLAPS: Final = 0.5
"""Mean number of bodies that a body overlaps."""
LARGEST_SCENE: Final = 1 << 30
"""Bytes of the file of a scene: a million bodies."""
HULLS: Final = 64
HULL_POINTS: Final = 32

_BOX, _SPHERE, _CAPSULE, _CYLINDER, _HULL = range(5)


@dataclass(frozen=True, eq=False)
class MovingBodies:
    """N bodies in F frames."""

    name: str
    seed: int
    shapes: list[Shape]
    positions: Array
    """(F, N, 3) m."""
    quaternions: Array
    """(F, N, 4), x, y, z, w."""
    arrays: dict[str, Any]
    """The content of the scene's file."""

    def save(self, path: Path) -> None:
        """Write the scene for `load_moving_bodies` and for other programs."""
        np.savez(path, **self.arrays)


def _hull_measures(points: Array) -> tuple[float, float, float]:
    hull = qhull(points)
    assert hull is not None  # random points on a sphere
    curvature = 0.0
    for facet, around in enumerate(hull.neighbors):
        for corner, other in enumerate(around):
            if other > facet:
                a, b = np.delete(hull.simplices[facet], corner)
                cosine = float(np.clip(hull.equations[facet, :3] @ hull.equations[other, :3], -1.0, 1.0))
                curvature += 0.5 * float(np.linalg.norm(points[a] - points[b])) * acos(cosine)
    return float(hull.volume), float(hull.area), curvature


def _density(kind: NDArray[np.uint8], size: Array, hull_id: NDArray[np.int32], hulls: Array) -> float:
    """Number of bodies per m^3 at which one overlaps MEAN_OVERLAPS others.

    It follows from the mean excluded volume of two convex bodies in random orientations with volumes V, surfaces S and
    integrals of mean curvature M: V1 + V2 + (S1 M2 + S2 M1) / 4 pi. (Isihara, 1950)
    """
    a, b, c = size.T
    choices = (
        (8 * a * b * c, 8 * (a * b + b * c + c * a), 2 * pi * (a + b + c)),
        (4 / 3 * pi * a**3, 4 * pi * a**2, 4 * pi * a),
        (4 / 3 * pi * a**3 + 2 * pi * a**2 * b, 4 * pi * a**2 + 4 * pi * a * b, 4 * pi * a + 2 * pi * b),
        (2 * pi * a**2 * b, 2 * pi * a**2 + 4 * pi * a * b, 2 * pi * b + pi**2 * a),
    )
    volume, surface, curvature = (
        np.choose(np.minimum(kind, _CYLINDER), column) for column in zip(*choices, strict=True)
    )
    if len(hulls):
        volume, surface, curvature = np.array([_hull_measures(points) for points in hulls])[hull_id].T
    excluded = 2 * volume.mean() + 2 * surface.mean() * curvature.mean() / (4 * pi)
    return MEAN_OVERLAPS / float(excluded)


def make_moving_bodies(name: str, n: int, seed: int = 1, frames: int = FRAMES) -> MovingBodies:
    """Create the scene `name` of BENCHMARK_SCENES with n bodies. Raises InputError."""
    if name not in BENCHMARK_SCENES:
        raise InputError(f"scene: expected one of {', '.join(BENCHMARK_SCENES)}, got {name!r}")
    for what, value, least in (("n", n, 1), ("seed", seed, 0), ("frames", frames, 1)):
        if value < least:
            raise InputError(f"{what}: expected a whole number from {least}, got {value}")
    rng = np.random.default_rng([seed, BENCHMARK_SCENES.index(name), n])
    kinds = {"boxes": [_BOX], "spheres": [_SPHERE], "mixed": [_BOX, _SPHERE, _CAPSULE, _CYLINDER], "hulls": [_HULL]}
    kind = np.resize(np.array(kinds[name], np.uint8), n)
    rng.shuffle(kind)
    size = rng.uniform(*HALF_EXTENTS, (n, 3))
    size[kind == _SPHERE, 1:] = 0.0
    size[(kind == _CAPSULE) | (kind == _CYLINDER), 2] = 0.0
    hull_id, hulls = np.full(n, -1, np.int32), np.zeros((0, HULL_POINTS, 3))
    if name == "hulls":
        directions = rng.normal(size=(HULLS, HULL_POINTS, 3))
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        hulls = (directions * rng.uniform(*HALF_EXTENTS, (HULLS, 1, 3))).astype(np.float32).astype(np.float64)
        hull_id = rng.integers(0, HULLS, n).astype(np.int32)
        size[:] = np.abs(hulls).max(axis=1)[hull_id]
    density = _density(kind, size, hull_id, hulls)
    position = rng.uniform(0.0, (n / density) ** (1 / 3), (n, 3))
    quaternion = rng.normal(size=(n, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    linear = rng.uniform(-MAX_RATE, MAX_RATE, (n, 3))
    angular = rng.uniform(-MAX_RATE, MAX_RATE, (n, 3))
    time = (np.arange(frames) * TIME_STEP)[:, None, None]
    turned = multiply(from_rotation_vector(angular * time), np.roll(quaternion, -1, axis=1))
    return _from_arrays(
        scene=name, n=n, seed=seed, kind=kind, size=size, hull_id=hull_id, hull_verts=hulls,
        pos=position + linear * time, quat=np.roll(turned, 1, axis=-1), vel=linear, omega=angular, dt=TIME_STEP,
        rho=density,
    )  # fmt: skip


def load_moving_bodies(path: Path) -> MovingBodies:
    """Load a saved scene. Raises InputError if the file is not one."""
    try:
        with open_regular(path, "a scene", most=LARGEST_SCENE) as stream, np.load(stream) as file:
            arrays = {key: file[key] for key in file.files}
        return _from_arrays(**arrays)
    except (OSError, KeyError, TypeError, ValueError, IndexError, zipfile.BadZipFile) as error:
        if isinstance(error, InputError):
            raise
        text = f"no entry {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: expected a scene (.npz with kind, size, pos, quat, …): {text}") from None


def _from_arrays(**arrays: Any) -> MovingBodies:
    kind, size, positions, quaternions = (np.asarray(arrays[key]) for key in ("kind", "size", "pos", "quat"))
    n = len(kind)
    if size.shape != (n, 3) or positions.shape[1:] != (n, 3) or quaternions.shape != (*positions.shape[:2], 4):
        raise ValueError(
            f"{n} bodies do not go with size {size.shape}, pos {positions.shape} and quat {quaternions.shape}"
        )
    hulls = [ConvexHull(points) for points in arrays["hull_verts"]] if (kind == _HULL).any() else []
    makers: dict[int, Callable[[int], Shape]] = {
        _BOX: lambda i: Box(2 * size[i]),
        _SPHERE: lambda i: Sphere(float(size[i, 0])),
        _CAPSULE: lambda i: Capsule(float(size[i, 0]), float(2 * size[i, 1])),
        _CYLINDER: lambda i: Cylinder(float(size[i, 0]), float(2 * size[i, 1])),
        _HULL: lambda i: hulls[arrays["hull_id"][i]],
    }
    return MovingBodies(
        name=str(arrays.get("scene", "scene")),
        seed=int(arrays.get("seed", -1)),
        shapes=[makers[k](i) for i, k in enumerate(kind.tolist())],
        positions=np.ascontiguousarray(positions, dtype=np.float64),
        quaternions=np.ascontiguousarray(np.roll(quaternions, -1, axis=-1), dtype=np.float64),
        arrays=arrays,
    )
