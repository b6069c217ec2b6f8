"""Check meshes against brute force: distances against all triangles, times of impact against samples of the motion.

    nice python benchmarks/mesh_oracle.py                    # 100,000 distances and 10,000 impacts of each kind
    nice python benchmarks/mesh_oracle.py --pairs 1000       # a quick look

Each kind of surface meets itself, convex solids and clouds of points. The kinds take turns, a hundredth of the work at
a time, and the counts so far are in benchmarks/results/mesh_oracle.json. Two meshes are compared with FCL, others with
the pair tests of all triangles. Impacts: a motion that overlaps at a sampled time before the stated lower end is late,
one that overlaps although it is clear is missed. A hit must overlap at its upper end.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import fcl
import numpy as np
import trimesh
from mesh_pairs import Surface, matrices
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.cli.progress import progress_bar
from collision_monitor.geometry.shape_table import ShapeTableBuilder, join, triangle_table
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.world.arm import lathe

Array = NDArray[np.float64]
Other = cm.Mesh | cm.Sphere | cm.Box | cm.Capsule | cm.Cylinder | cm.Cone | cm.ConvexHull | cm.Ellipsoid | cm.Points

SAMPLES = 24
"""Times at which a motion is sampled."""

ROUNDS = 100
"""Turns of each kind."""

EXACT = 1e-12
CURVED = 1e-9
"""Largest difference of two distances, as part of the size of both shapes; of a solid with a curved side GJK ends when
the distance is certain to 1e-10 of it."""

RESULTS = Path(__file__).parent / "results" / "mesh_oracle.json"


def surfaces() -> dict[str, Surface]:
    """Small surfaces of each kind."""
    rng = np.random.default_rng(0)
    ring = trimesh.creation.torus(1.0, 0.4, major_sections=10, minor_sections=8)
    link = lathe([(0.3, -1.0), (0.3, -0.6), (0.15, -0.5), (0.15, 0.5), (0.3, 0.6), (0.3, 1.0)], 10)
    soup = rng.normal(size=(80, 1, 3)) * 0.5 + 0.15 * rng.normal(size=(80, 3, 3))
    x, y = np.meshgrid(np.linspace(-1, 1, 12), np.linspace(-1, 1, 12), indexing="ij")
    z = 0.2 * np.sin(3 * x) * np.cos(2 * y) + 0.02 * rng.normal(size=x.shape)
    k = np.arange(144).reshape(12, 12)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    return {
        "torus": Surface(ring.vertices, ring.faces),
        "link": Surface(link.vertices, link.faces),
        "scan": Surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)),
        "open": Surface(ring.vertices, ring.faces[ring.triangles_center[:, 0] > 0]),
        "soup": Surface(soup.reshape(-1, 3), np.arange(240).reshape(-1, 3)),
    }


def solids(rng: np.random.Generator) -> list[Other]:
    """One convex solid of each kind."""
    return [
        cm.Sphere(0.3),
        cm.Box((0.5, 0.3, 0.8)),
        cm.Capsule(0.2, 0.6),
        cm.Cylinder(0.3, 0.5),
        cm.Cone(0.4, 0.6),
        cm.ConvexHull(0.4 * rng.normal(size=(12, 3))),
        cm.Ellipsoid((0.2, 0.3, 0.5)),
    ]


class Kind:
    """A surface and the shapes that it meets, with the counts so far."""

    def __init__(self, name: str, surface: Surface, others: list[Other], seed: int) -> None:
        self.name, self.others = name, others
        self.corners = surface.vertices[surface.faces]
        self.mesh = cm.Mesh(surface.vertices, surface.faces)
        self.rng = np.random.default_rng(seed)
        self.reach = float(np.linalg.norm(surface.vertices, axis=1).max())
        self.worst = 0.0
        self.counts: Counter[str] = Counter()
        model = fcl.BVHModel()
        model.beginModel(len(surface.faces), len(surface.vertices))
        model.addSubModel(surface.vertices, surface.faces)
        model.endModel()
        self._objects = [fcl.CollisionObject(model, fcl.Transform()) for _ in range(2)]

    def surface_distance(self, X: cm.Pose, other: Other, Y: cm.Pose) -> tuple[float, float]:
        """Distance of the surface and another shape, 0 if they meet, and its error bound (m)."""
        if isinstance(other, cm.Mesh):
            for each, pose in zip(self._objects, (X, Y), strict=True):
                each.setTransform(fcl.Transform(*matrices(np.concatenate([pose.position, pose.quaternion]))))
            if fcl.collide(*self._objects, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
                return 0.0, 0.0
            return float(fcl.distance(*self._objects, fcl.DistanceRequest(), fcl.DistanceResult())), 0.0
        table = triangle_table(self.corners @ X.rotation.T)
        places = [Y.position - X.position]
        if isinstance(other, cm.Points):
            places = list(other.points @ Y.rotation.T + places[0])
            other = cm.Sphere(other.radius)
        builder = ShapeTableBuilder(slots=len(places))
        for _ in places:
            builder.append(other)
        n, m = len(self.corners), len(places)
        position = np.concatenate([np.zeros((n, 3)), places])
        rotation = np.concatenate([np.tile(np.eye(3), (n, 1, 1)), np.tile(Y.rotation, (m, 1, 1))])
        pairs = np.stack([np.repeat(np.arange(n), m), n + np.tile(np.arange(m), n)], axis=1).astype(np.int32)
        rows = contact_batch(join([table, builder.used]), position, rotation, pairs)
        best = int(rows[:, 0].argmin())
        return max(float(rows[best, 0]), 0.0), float(rows[best, 10])

    def check_distance(self) -> None:
        """Compare one distance, and whether the two overlap."""
        other = self.others[self.rng.integers(len(self.others))]
        q = Rotation.random(2, rng=self.rng).as_quat()
        p = self.rng.normal(size=3)
        X = cm.Pose((0, 0, 0), q[0])
        Y = cm.Pose(p * self.rng.uniform(0.0, 3.0) * self.reach / np.linalg.norm(p), q[1])
        expected, bound = self.surface_distance(X, other, Y)
        found = cm.contact(self.mesh, X, other, Y)
        self.counts["distances"] += 1
        if expected <= bound:
            self.counts["overlap"] += 1
            self.counts["wrong overlap"] += found.signed_distance > 2 * bound + EXACT * self.reach
            return
        # below 0, one is inside the other, which the surfaces do not tell
        difference = abs(abs(found.signed_distance) - expected) / (2 * self.reach)
        if found.signed_distance > 0.0 or isinstance(other, cm.Mesh):
            curved = isinstance(other, cm.Cylinder | cm.Cone | cm.Ellipsoid)
            self.worst = self.worst if curved else max(self.worst, difference)
            self.counts["wrong distance"] += difference > (CURVED if curved else EXACT)

    def check_impact(self) -> None:
        """Sample the motion of one pair that turns."""
        other = self.others[self.rng.integers(len(self.others))]
        q = Rotation.random(2, rng=self.rng).as_quat()
        p = self.rng.normal(size=3)
        p *= self.rng.uniform(1.5, 3.0) * self.reach / np.linalg.norm(p)
        aim = self.reach * self.rng.normal(size=3) - p
        a = cm.Motion(cm.Pose((0, 0, 0), q[0]), (0, 0, 0), 2 * self.rng.normal(size=3))
        b = cm.Motion(cm.Pose(p, q[1]), aim * self.rng.uniform(0.3, 1.5), 2 * self.rng.normal(size=3))
        impact = cm.time_of_impact(self.mesh, a, other, b)
        self.counts["impacts"] += 1
        self.counts[impact.status] += 1
        until = min(impact.lower, 2.0)
        if until > 0.0:
            times = np.append(np.linspace(0.0, until, SAMPLES, endpoint=False), until * (1 - 1e-9))
            overlaps = any(self.surface_distance(a.at(t), other, b.at(t))[0] == 0.0 for t in times)
            self.counts["missed" if impact.status == "clear" else "late"] += overlaps
        if impact.status == "hit":
            # round-off of the pose at the upper end: the depth there is about the tolerance
            gap = impact.contact.signed_distance if impact.contact else np.inf
            self.counts["not sure"] += gap > EXACT * self.reach

    @property
    def wrong(self) -> int:
        """Number of wrong answers."""
        return sum(self.counts[key] for key in ("wrong overlap", "wrong distance", "missed", "late", "not sure"))

    def __str__(self) -> str:
        counts = ", ".join(f"{key} {count}" for key, count in self.counts.items())
        return f"{self.name:15s} worst {self.worst:.1e} of the size; {counts}"


def take_turns(kinds: list[Kind], pairs: int, done: Callable[[int], None]) -> None:
    """Check all kinds in turn, with the counts so far in a file."""
    RESULTS.parent.mkdir(exist_ok=True)
    for _ in range(ROUNDS):
        for kind in kinds:
            for k in range(-(-pairs // ROUNDS)):
                kind.check_distance()
                if k % 10 == 0:
                    kind.check_impact()
            done(1)
        found = {kind.name: {"worst": kind.worst, **kind.counts} for kind in kinds}
        RESULTS.write_text(json.dumps(found, indent=1))


def main() -> int:
    """Print a line for each kind; return 1 if an answer is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000, help="distances of each kind; impacts: a tenth")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    kinds = []
    for name, surface in surfaces().items():
        mesh = cm.Mesh(surface.vertices, surface.faces)
        cloud = cm.Points(0.4 * rng.normal(size=(20, 3)), 0.02)
        partners: dict[str, list[Other]] = {name: [mesh], "solid": solids(rng), "cloud": [cloud]}
        kinds += [Kind(f"{name}, {other}", surface, shapes, args.seed) for other, shapes in partners.items()]
    with progress_bar("mesh oracle", ROUNDS * len(kinds)) as done:
        take_turns(kinds, args.pairs, done)
    for kind in kinds:
        print(kind)
    return int(sum(kind.wrong for kind in kinds) > 0)


if __name__ == "__main__":
    sys.exit(main())
