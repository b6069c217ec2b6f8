"""Check meshes against brute force: distances against all triangles, times of impact against samples of the motion.

    nice python benchmarks/mesh_oracle.py                    # 100,000 distances and 10,000 impacts of each kind
    nice python benchmarks/mesh_oracle.py --pairs 1000       # a quick look

Each kind of surface meets itself, convex solids and clouds of points. The kinds take turns, a hundredth of the work at
a time, on all cores; a hundredth has its own seed, so that the answers do not depend on their number. The counts so far
are in benchmarks/results/mesh_oracle.json. Two meshes are compared with FCL, spheres and clouds with the closest points
of all triangles (Ericson, Real-Time Collision Detection, 5.1.5), other solids with the pair tests of all triangles.
Impacts: a motion that overlaps at a sampled time before the stated lower end is late, one that overlaps although it is
clear is missed. A hit must overlap at its upper end.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from math import inf, sqrt
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import fcl
import numpy as np
import trimesh
from mesh_pairs import Surface, matrices
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.cli.output.progress import progress_bar
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.shape_table import ShapeTableBuilder, join, triangle_table
from collision_monitor.world.arm import lathe

Array = NDArray[np.float64]
Other = cm.Mesh | cm.Sphere | cm.Box | cm.Capsule | cm.Cylinder | cm.Cone | cm.ConvexHull | cm.Ellipsoid | cm.Points

SAMPLES = 24
"""Times at which a motion is sampled."""

ROUNDS = 100
"""Turns of each kind."""

ROUND_OFF = 64 * np.finfo(float).eps
"""Error of a distance from a point, as part of the coordinates."""

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


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True)
def _squared_distance(p, a, b, c):
    """Squared distance of a point from a triangle, by the region of the triangle that the point is in."""
    ab, ac, ap = _minus(b, a), _minus(c, a), _minus(p, a)
    bp, cp = _minus(p, b), _minus(p, c)
    d1, d2, d3, d4, d5, d6 = _dot(ab, ap), _dot(ac, ap), _dot(ab, bp), _dot(ac, bp), _dot(ab, cp), _dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v = w = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    away = (
        ap[0] - v * ab[0] - w * ac[0],
        ap[1] - v * ab[1] - w * ac[1],
        ap[2] - v * ab[2] - w * ac[2],
    )
    return _dot(away, away)


@njit(cache=True)
def nearest_of_all(points, corners):
    """Least distance (m) of points (n, 3) from triangles (m, 3, 3)."""
    least = inf
    for i in range(len(points)):
        p = points[i, 0], points[i, 1], points[i, 2]
        for k in range(len(corners)):
            a = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
            b = corners[k, 1, 0], corners[k, 1, 1], corners[k, 1, 2]
            c = corners[k, 2, 0], corners[k, 2, 1], corners[k, 2, 2]
            least = min(least, _squared_distance(p, a, b, c))
    return sqrt(least)


class Found(NamedTuple):
    """What a hundredth of the work of a kind found: largest difference, as part of the size, and counts."""

    kind: str
    worst: float
    counts: Counter[str]


class Kind:
    """A surface and the shapes that it meets, with the counts of a hundredth of the work."""

    def __init__(self, name: str, surface: Surface, others: list[Other]) -> None:
        self.name, self.others = name, others
        self.corners = surface.vertices[surface.faces]
        self.mesh = cm.Mesh(surface.vertices, surface.faces)
        self.reach = float(np.linalg.norm(surface.vertices, axis=1).max())
        model = fcl.BVHModel()
        model.beginModel(len(surface.faces), len(surface.vertices))
        model.addSubModel(surface.vertices, surface.faces)
        model.endModel()
        self._objects = [fcl.CollisionObject(model, fcl.Transform()) for _ in range(2)]
        self._triangles = triangle_table(self.corners)

    def check(self, pairs: int, seed: tuple[int, ...]) -> Found:
        """Check so many distances, and a tenth as many impacts."""
        self.rng, self.worst, self.counts = np.random.default_rng(seed), 0.0, Counter[str]()
        for k in range(pairs):
            self.check_distance()
            if k % 10 == 0:
                self.check_impact()
        return Found(self.name, self.worst, self.counts)

    def surface_distance(self, X: cm.Pose, other: Other, Y: cm.Pose) -> tuple[float, float]:
        """Distance of the surface and another shape, 0 if they meet, and its error bound (m)."""
        if isinstance(other, cm.Mesh):
            for each, pose in zip(self._objects, (X, Y), strict=True):
                each.setTransform(fcl.Transform(*matrices(np.concatenate([pose.position, pose.quaternion]))))
            if fcl.collide(*self._objects, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
                return 0.0, 0.0
            return float(fcl.distance(*self._objects, fcl.DistanceRequest(), fcl.DistanceResult())), 0.0
        p = Y.position - X.position
        if isinstance(other, cm.Points | cm.Sphere):
            points = other.points if isinstance(other, cm.Points) else np.zeros((1, 3))
            found = nearest_of_all((points @ Y.rotation.T + p) @ X.rotation, self.corners) - other.radius
            return max(found, 0.0), ROUND_OFF * (self.reach + float(np.abs(p).sum()) + float(np.abs(points).max()))
        n = len(self.corners)
        builder = ShapeTableBuilder(slots=1)
        builder.append(other)
        position = np.concatenate([np.zeros((n, 3)), p[None]])
        rotation = np.concatenate([np.tile(X.rotation, (n, 1, 1)), Y.rotation[None]])
        pairs = np.stack([np.arange(n), np.full(n, n)], axis=1).astype(np.int32)
        rows = contact_batch(join([self._triangles, builder.used]), position, rotation, pairs)
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


WRONG = ("wrong overlap", "wrong distance", "missed", "late", "not sure")
"""Counts of wrong answers."""

_KINDS: dict[str, Kind] = {}
"""The kinds of a process, which cannot be sent to it."""


def make_kinds(seed: int) -> list[str]:
    """Make the kinds of this process; return their names."""
    rng = np.random.default_rng(seed)
    for name, surface in surfaces().items():
        mesh = cm.Mesh(surface.vertices, surface.faces)
        cloud = cm.Points(0.4 * rng.normal(size=(20, 3)), 0.02)
        partners: dict[str, list[Other]] = {name: [mesh], "solid": solids(rng), "cloud": [cloud]}
        for other, shapes in partners.items():
            _KINDS[f"{name}, {other}"] = Kind(f"{name}, {other}", surface, shapes)
    return list(_KINDS)


def check_round(name: str, number: int, turn: int, pairs: int, seed: int) -> Found:
    """Do a hundredth of the work of a kind."""
    return _KINDS[name].check(pairs, (seed, number, turn))


def take_turns(names: list[str], pairs: int, seed: int, jobs: int) -> Iterator[Found]:
    """Check all kinds in turn on several processes, each with one thread."""
    os.environ["NUMBA_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=make_kinds, initargs=(seed,)) as pool:
        own = -(-pairs // ROUNDS)
        tasks = [
            pool.submit(check_round, name, number, turn, own, seed)
            for turn in range(ROUNDS)
            for number, name in enumerate(names)
        ]
        for task in as_completed(tasks):
            yield task.result()


def main() -> int:
    """Print a line for each kind; return 1 if an answer is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000, help="distances of each kind; impacts: a tenth")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    args = parser.parse_args()
    worst: dict[str, float] = {name: 0.0 for name in make_kinds(args.seed)}
    counts: dict[str, Counter[str]] = {name: Counter() for name in worst}
    RESULTS.parent.mkdir(exist_ok=True)
    with progress_bar("mesh oracle", ROUNDS * len(worst)) as done:
        for k, found in enumerate(take_turns(list(worst), args.pairs, args.seed, args.jobs), start=1):
            worst[found.kind] = max(worst[found.kind], found.worst)
            counts[found.kind] += found.counts
            if k % ROUNDS == 0:
                so_far = {name: {"worst": worst[name], **counts[name]} for name in worst}
                RESULTS.write_text(json.dumps(so_far, indent=1))
            done(1)
    for name in worst:
        listed = ", ".join(f"{key} {counts[name][key]}" for key in sorted({*counts[name], *WRONG}))
        print(f"{name:15s} worst {worst[name]:.1e} of the size; {listed}")
    return int(any(counts[name][key] for name in worst for key in WRONG))


if __name__ == "__main__":
    sys.exit(main())
