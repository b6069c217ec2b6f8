"""Time of one call for one pair of shapes, beside python-fcl, coal and trimesh's CollisionManager, where installed.

    python benchmarks/single_calls.py            20 s
    python benchmarks/single_calls.py --quick    5 s

All answer the same pairs in turns in one process, so that a busy machine slows all alike. Prints microseconds, the best
and the median round, and the ratio of the best to that of python-fcl's `distance`.
"""

from __future__ import annotations

import argparse
import timeit
from collections.abc import Callable
from typing import Any, Final

import fcl
import numpy as np
import trimesh
from scipy.spatial import ConvexHull

import collision_monitor as cm

CALLS: Final = 500
PLACE, TURN = np.array([0.3, 0.1, 2.4]), np.array([0.1, 0.5, -0.3, 0.8]) / np.sqrt(0.99)
POINTS = np.random.default_rng(0).normal(size=(30, 3))
POINTS /= np.linalg.norm(POINTS, axis=1)[:, None]


def _fcl_hull() -> Any:
    triangles = ConvexHull(POINTS).simplices
    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1).ravel()
    return fcl.Convex(POINTS, len(triangles), faces)


KINDS: Final[dict[str, tuple[Any, Callable[[], Any], Callable[[], Any]]]] = {
    "box": (cm.Box((1, 1.2, 0.8)), lambda: fcl.Box(1, 1.2, 0.8), lambda: trimesh.creation.box((1, 1.2, 0.8))),
    "sphere": (cm.Sphere(0.6), lambda: fcl.Sphere(0.6), lambda: trimesh.creation.icosphere(radius=0.6)),
    "capsule": (cm.Capsule(0.3, 1), lambda: fcl.Capsule(0.3, 1), lambda: trimesh.creation.capsule(1, 0.3)),
    "hull": (cm.ConvexHull(POINTS), _fcl_hull, lambda: trimesh.convex.convex_hull(POINTS)),
}
"""Name -> our shape, and makers of fcl's and of trimesh's."""

PAIRS: Final = (("box", "capsule"), ("box", "box"), ("sphere", "sphere"), ("hull", "box"), ("hull", "hull"))


def candidates(a: str, b: str) -> dict[str, Callable[[], Any]]:
    """Calls to compare for one pair of kinds."""
    A, B, pose_a, pose_b = KINDS[a][0], KINDS[b][0], cm.Pose(), cm.Pose(PLACE, TURN)
    still = cm.Motion(pose_a, angular=(0.1, 0.2, 1.0))
    towards = cm.Motion(pose_b, linear=(0.0, 0.0, -1.5), angular=(1.0, 0.0, 0.5))
    calls: dict[str, Callable[[], Any]] = {
        "cm.contact": lambda: cm.contact(A, pose_a, B, pose_b),
        "cm.distance": lambda: cm.distance(A, pose_a, B, pose_b),
        "cm.overlap": lambda: cm.overlap(A, pose_a, B, pose_b),
        "cm.time_of_impact": lambda: cm.time_of_impact(A, still, B, towards),
    }
    turn = TURN[[3, 0, 1, 2]]
    objects = [
        fcl.CollisionObject(KINDS[kind][1](), transform)
        for kind, transform in ((a, fcl.Transform()), (b, fcl.Transform(turn, PLACE)))
    ]
    calls["python-fcl distance"] = lambda: fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult())
    manager = trimesh.collision.CollisionManager()
    for name, kind, pose in (("a", a, pose_a), ("b", b, pose_b)):
        manager.add_object(name, KINDS[kind][2](), pose.matrix)
    calls["trimesh CollisionManager"] = manager.min_distance_internal
    try:
        import coal
    except ImportError:
        return calls
    own = {"box": (coal.Box, 1, 1.2, 0.8), "sphere": (coal.Sphere, 0.6), "capsule": (coal.Capsule, 0.3, 1)}
    if a in own and b in own:
        first, second = (own[kind][0](*own[kind][1:]) for kind in (a, b))
        at = coal.Transform3s(pose_b.rotation, PLACE)
        identity, request = coal.Transform3s(), coal.DistanceRequest()
        calls["coal distance"] = lambda: coal.distance(first, identity, second, at, request, coal.DistanceResult())
    return calls


def main() -> None:
    """Print one table for each pair."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a quarter of the rounds")
    rounds = 10 if parser.parse_args().quick else 40
    for a, b in PAIRS:
        calls = candidates(a, b)
        times: dict[str, list[float]] = {name: [] for name in calls}
        for call in calls.values():
            call()
        for _ in range(rounds):
            for name, call in calls.items():
                times[name].append(timeit.timeit(call, number=CALLS) / CALLS * 1e6)
        reference = min(times["python-fcl distance"])
        print(f"\n{a} and {b}\n  {'':26s}{'best µs':>9s}{'median µs':>11s}{'/ fcl':>7s}")
        for name, each in sorted(times.items(), key=lambda item: min(item[1])):
            print(f"  {name:26s}{min(each):9.2f}{float(np.median(each)):11.2f}{min(each) / reference:7.2f}")


if __name__ == "__main__":
    main()
