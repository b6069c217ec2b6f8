"""Scene of concave meshes that drift through each other: rings, links and bottles of 300 to 1,000 triangles.

Each keeps its twist for 2 s in the mean, turns back at the walls of a room, and passes through the others. The room
grows with their number, so that about one in ten touches another one at a time. Every second one may be a convex solid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
import trimesh

from collision_monitor.accuracy.inputs import Workload
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import from_rotation_vector, multiply
from collision_monitor.shapes.registry import Box, Cone, ConvexHull, Cylinder, Ellipsoid, Mesh, Shape, Sphere
from collision_monitor.world.arm import lathe, link
from collision_monitor.world.scene import state_array

RATE: Final = 50.0
"""Hz."""
ROOM: Final = 1.1
"""Edge of the room (m) for one object: its volume is that of as many such cubes as there are objects."""
TURNS: Final = 0.5
"""Hz, how often an object changes its twist."""


SOLIDS: Final[dict[str, Callable[[float, float], Shape]]] = {
    "cylinder": Cylinder,
    "cone": Cone,
    "ellipsoid": lambda r, length: Ellipsoid((r, 0.5 * length, 0.5 * (r + 0.5 * length))),
    "ball": lambda r, _: Sphere(r),
    "box": lambda r, length: Box((2 * r, r, length)),
    "hull": lambda r, length: ConvexHull(trimesh.creation.icosphere(1).vertices * (r, r, 0.5 * length)),
}
"""Solids by a radius and a length (m)."""


def shapes(rng: np.random.Generator) -> list[Mesh]:
    """Twelve meshes, four of each kind, of 288 to 1,000 triangles."""
    found = []
    for k in range(4):
        ring = trimesh.creation.torus(rng.uniform(0.2, 0.35), rng.uniform(0.03, 0.06), 16 + 4 * k, 9 + 3 * k)
        found.append(Mesh(ring.vertices, ring.faces))
        found.append(link(rng.uniform(0.3, 0.6), rng.uniform(0.05, 0.1)))
        outline = [(0, 0), (0.04, 0), (0.045, 0.08), (0.04, 0.16), (0.036, 0.18), (0.02, 0.2), (0.018, 0.26), (0, 0.26)]
        scale = rng.uniform(1.0, 2.0)
        found.append(lathe([(scale * r, scale * (z - 0.13)) for r, z in outline], 24 + 12 * k))
    return found


def solids(rng: np.random.Generator, kinds: Sequence[str]) -> list[Shape]:
    """Twelve solids of these kinds in turn, as large as the meshes."""
    found: list[Shape] = []
    for k in range(12):
        radius, length = rng.uniform(0.05, 0.3), rng.uniform(0.1, 0.6)
        found.append(SOLIDS[kinds[k % len(kinds)]](radius, length))
    return found


def drifting_meshes(
    objects: int, seconds: float, *, seed: int = 1, turns: float = TURNS, kinds: Sequence[str] = ()
) -> Workload:
    """Descriptions and steps of that many objects.

    turns: how often each changes its twist (Hz). kinds: of the solids (SOLIDS) in place of every second mesh.
    """
    rng = np.random.default_rng(seed)
    meshes, ids = shapes(rng), np.arange(1, objects + 1, dtype=np.uint32)
    others = solids(np.random.default_rng(seed), kinds) if kinds else meshes
    half = 0.5 * ROOM * objects ** (1 / 3)
    states = state_array(ids)
    states["position"] = rng.uniform(-half, half, (objects, 3))
    q = rng.normal(size=(objects, 4))
    states["quaternion"] = q / np.linalg.norm(q, axis=1, keepdims=True)
    states["linear"], states["angular"] = rng.normal(0, 0.6, (objects, 3)), rng.normal(0, 0.5, (objects, 3))
    steps = []
    for k in range(round(seconds * RATE)):
        steps.append((round(k * 1e9 / RATE), states.copy()))
        states["position"] += states["linear"] / RATE
        turn = from_rotation_vector(states["angular"] / RATE)
        states["quaternion"] = [multiply(*each) for each in zip(turn, states["quaternion"], strict=True)]
        outward = (np.abs(states["position"]) > half) & (states["position"] * states["linear"] > 0)
        states["linear"] = np.where(outward, -states["linear"], states["linear"])
        new = rng.random(objects) < turns / RATE
        states["linear"][new] = rng.normal(0, 0.6, (new.sum(), 3))
        states["angular"][new] = rng.normal(0, 0.5, (new.sum(), 3))
    by_turn = [(others if i % 2 else meshes)[i % len(meshes)] for i in ids.tolist()]
    descriptions = [ObjectDescription(i, shape) for i, shape in zip(ids.tolist(), by_turn, strict=True)]
    return Workload(f"meshes ({objects:,})", descriptions, steps)
