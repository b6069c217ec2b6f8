"""Check meshes against FCL, and times of impact against dense samples of the motion.

    nice python benchmarks/mesh_oracle.py                    # 100,000 distances and 10,000 impacts of each kind
    nice python benchmarks/mesh_oracle.py --pairs 1000       # a quick look

Distances: the difference to FCL, relative to the size of both. Impacts: a motion that overlaps at a sampled time before
the stated lower end is late, one that overlaps although it is clear is missed. A hit must overlap at its upper end.
"""

from __future__ import annotations

import argparse
import sys

import fcl
import numpy as np
import trimesh
from mesh_pairs import Surface, matrices
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.cli.progress import progress_bar
from collision_monitor.world.arm import lathe

SAMPLES = 24
"""Times at which a motion is sampled."""


def surfaces() -> dict[str, Surface]:
    """Small surfaces of each kind."""
    rng = np.random.default_rng(0)
    ring = trimesh.creation.torus(1.0, 0.4, major_sections=10, minor_sections=8)
    link = lathe([(0.3, -1.0), (0.3, -0.6), (0.15, -0.5), (0.15, 0.5), (0.3, 0.6), (0.3, 1.0)], 10)
    soup = rng.normal(size=(80, 1, 3)) * 0.5 + 0.15 * rng.normal(size=(80, 3, 3))
    return {
        "closed": Surface(ring.vertices, ring.faces),
        "link": Surface(link.vertices, link.faces),
        "open": Surface(ring.vertices, ring.faces[ring.triangles_center[:, 0] > 0]),
        "soup": Surface(soup.reshape(-1, 3), np.arange(240).reshape(-1, 3)),
    }


def check_distances(surface: Surface, count: int, rng: np.random.Generator, done: object) -> tuple[float, int]:
    """Largest relative difference to FCL, and how often the two disagree on whether they overlap."""
    mesh = cm.Mesh(surface.vertices, surface.faces)
    model = fcl.BVHModel()
    model.beginModel(len(surface.vertices), len(surface.faces))
    model.addSubModel(surface.vertices, surface.faces)
    model.endModel()
    objects = [fcl.CollisionObject(model, fcl.Transform()) for _ in range(2)]
    reach = float(np.linalg.norm(surface.vertices, axis=1).max())
    worst, disagree = 0.0, 0
    turns, moves = Rotation.random(2 * count, rng=rng).as_quat(), rng.normal(size=(count, 3))
    moves *= (rng.uniform(0.0, 3.0, count) * reach / np.linalg.norm(moves, axis=1))[:, None]
    for k in range(count):
        X, Y = cm.Pose((0, 0, 0), turns[2 * k]), cm.Pose(moves[k], turns[2 * k + 1])
        for each, pose in zip(objects, (X, Y), strict=True):
            each.setTransform(fcl.Transform(*matrices(np.concatenate([pose.position, pose.quaternion]))))
        meets = fcl.collide(*objects, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        found = cm.contact(mesh, X, mesh, Y) if not meets else None
        if meets or found is None:
            disagree += not cm.overlap(mesh, X, mesh, Y)
        elif found.signed_distance > 0.0:  # else one is inside the other, which FCL does not know
            expected = fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult())
            worst = max(worst, abs(found.signed_distance - expected) / (2 * reach))
        done(1)  # type: ignore[operator]
    return worst, disagree


def check_impacts(surface: Surface, count: int, rng: np.random.Generator, done: object) -> dict[str, int]:
    """Number of motions by status, and of those that are missed, late, or not sure at their upper end."""
    mesh = cm.Mesh(surface.vertices, surface.faces)
    reach = float(np.linalg.norm(surface.vertices, axis=1).max())
    found = {"hit": 0, "clear": 0, "unresolved": 0, "missed": 0, "late": 0, "not sure": 0}
    for _ in range(count):
        q = Rotation.random(2, rng=rng).as_quat()
        p = rng.normal(size=3)
        p *= rng.uniform(1.5, 3.0) * reach / np.linalg.norm(p)
        aim = reach * rng.normal(size=3) - p
        a = cm.Motion(cm.Pose((0, 0, 0), q[0]), (0, 0, 0), 2 * rng.normal(size=3))
        b = cm.Motion(cm.Pose(p, q[1]), aim * rng.uniform(0.3, 1.5), 2 * rng.normal(size=3))
        impact = cm.time_of_impact(mesh, a, mesh, b)
        found[impact.status] += 1
        until = min(impact.lower, 2.0)
        if until > 0.0:
            times = np.linspace(0.0, until, SAMPLES, endpoint=False)
            overlaps = any(cm.overlap(mesh, a.at(t), mesh, b.at(t)) for t in times)
            found["missed" if impact.status == "clear" else "late"] += overlaps
        if impact.status == "hit":
            # round-off of the pose at the upper end: the depth there is about the tolerance
            gap = impact.contact.signed_distance if impact.contact else np.inf
            found["not sure"] += gap > 1e-12 * reach
        done(1)  # type: ignore[operator]
    return found


def main() -> int:
    """Print a line for each kind; return 1 if an answer is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000, help="distances of each kind; impacts: a tenth")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    wrong = 0
    for name, surface in surfaces().items():
        rng = np.random.default_rng(args.seed)
        with progress_bar(name, args.pairs + args.pairs // 10) as done:
            worst, disagree = check_distances(surface, args.pairs, rng, done)
            impacts = check_impacts(surface, args.pairs // 10, rng, done)
        wrong += disagree + impacts["missed"] + impacts["late"] + impacts["not sure"] + (worst > 1e-12)
        print(f"{name:8s} worst distance {worst:.1e} of the size, overlap differs {disagree}; impacts {impacts}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
