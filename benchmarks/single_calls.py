"""Time of one call for one pair of shapes as users make it, beside python-fcl, and coal and trimesh where installed.

    python benchmarks/single_calls.py            1 min
    python benchmarks/single_calls.py --quick    15 s
    python benchmarks/single_calls.py --pairs box-capsule

Each call gets another place, apart or overlapping, of places that are drawn before. Every library makes new pose
objects from the same numbers in each call, and python-fcl also gives its nearest points. Beside that, the table has
calls with poses of other types, with new shapes of other sizes, and with the same objects again. All take turns in one
process. Prints microseconds of processor time, the best and the median round, and the ratio of the best to that of
python-fcl's `distance` with a new Transform.
"""

from __future__ import annotations

import argparse
import itertools
import time
import timeit
from collections.abc import Callable
from typing import Any, Final

import fcl
import numpy as np
import trimesh
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import collision_monitor as cm

CALLS: Final = 512
PLACES: Final = 256
POINTS = np.random.default_rng(0).normal(size=(30, 3))
POINTS /= np.linalg.norm(POINTS, axis=1)[:, None]


def _fcl_hull(s: float = 1.0) -> Any:
    triangles = ConvexHull(s * POINTS).simplices
    faces = np.concatenate([np.full((len(triangles), 1), 3), triangles], axis=1).ravel()
    return fcl.Convex(s * POINTS, len(triangles), faces)


Make = Callable[..., Any]

KINDS: Final[dict[str, tuple[Make, Make, Make]]] = {
    "box": (
        lambda s=1.0: cm.Box((s, 1.2 * s, 0.8 * s)),
        lambda s=1.0: fcl.Box(s, 1.2 * s, 0.8 * s),
        lambda: trimesh.creation.box((1, 1.2, 0.8)),
    ),
    "sphere": (
        lambda s=1.0: cm.Sphere(0.6 * s),
        lambda s=1.0: fcl.Sphere(0.6 * s),
        lambda: trimesh.creation.icosphere(radius=0.6),
    ),
    "capsule": (
        lambda s=1.0: cm.Capsule(0.3 * s, s),
        lambda s=1.0: fcl.Capsule(0.3 * s, s),
        lambda: trimesh.creation.capsule(1, 0.3),
    ),
    "cylinder": (
        lambda s=1.0: cm.Cylinder(0.4 * s, s),
        lambda s=1.0: fcl.Cylinder(0.4 * s, s),
        lambda: trimesh.creation.cylinder(0.4, 1),
    ),
    "hull": (lambda s=1.0: cm.ConvexHull(s * POINTS), _fcl_hull, lambda: trimesh.convex.convex_hull(POINTS)),
}
"""Name -> makers of our shape and of fcl's, for a factor of the size, and of trimesh's."""

PAIRS: Final = ("box-capsule", "box-box", "sphere-sphere", "cylinder-box", "hull-box", "hull-hull")
REFERENCE: Final = "fcl.distance, new Transform"


class Places:
    """The same poses of A and of B in every form in which a user may have them, one after the other without end."""

    def __init__(self) -> None:
        rng = np.random.default_rng(7)
        direction = rng.normal(size=(PLACES, 3))
        direction *= (rng.uniform(0.5, 3.0, PLACES) / np.linalg.norm(direction, axis=1))[:, None]
        at = rng.uniform(-5.0, 5.0, (PLACES, 3))
        turns = Rotation.random(2 * PLACES, rng=rng)
        quaternions, matrices = turns.as_quat(), np.tile(np.eye(4), (2 * PLACES, 1, 1))
        positions = np.concatenate([at, at + direction])
        matrices[:, :3, :3], matrices[:, :3, 3] = turns.as_matrix(), positions
        first, second = slice(PLACES), slice(PLACES, None)

        def of(values: list[Any]) -> itertools.cycle[tuple[Any, Any]]:
            return itertools.cycle(list(zip(values[first], values[second], strict=True)))

        pairs = list(zip(positions, quaternions, strict=True))
        self.tuples = of([(tuple(x.tolist()), tuple(q.tolist())) for x, q in pairs])
        self.lists = of([(x.tolist(), q.tolist()) for x, q in pairs])
        self.arrays = of(pairs)
        self.rows = of([np.concatenate(pair) for pair in pairs])
        self.matrices = of(list(matrices))
        self.poses = of([cm.Pose(*pair) for pair in pairs])
        wxyz = quaternions[:, [3, 0, 1, 2]]
        self.fcl = of([(q, x) for x, q in zip(positions, wxyz, strict=True)])
        self.sizes = of(rng.uniform(0.5, 1.5, 2 * PLACES).tolist())
        twists = rng.normal(size=(PLACES, 3))
        self.motions = itertools.cycle(
            [
                (*pair, tuple(v.tolist()), tuple(w.tolist()))
                for pair, v, w in zip(
                    zip(self._tuples(pairs, first), self._tuples(pairs, second), strict=True),
                    -1.5 * direction, twists, strict=True,
                )
            ]
        )  # fmt: skip

    @staticmethod
    def _tuples(pairs: list[Any], which: slice) -> list[Any]:
        return [(tuple(x.tolist()), tuple(q.tolist())) for x, q in pairs[which]]


def candidates(a: str, b: str) -> dict[str, Callable[[], Any]]:
    """Calls to compare for one pair of kinds; each takes the next place."""
    place = Places()
    A, B = KINDS[a][0](), KINDS[b][0]()

    def with_poses(call: Callable[..., Any], places: Any, make: Callable[[Any], Any]) -> Callable[[], Any]:
        def run() -> Any:
            x, y = next(places)
            return call(A, make(x), B, make(y))

        return run

    def new_pose(numbers: Any) -> cm.Pose:
        return cm.Pose(*numbers)

    def impact() -> Any:
        x, y, v, w = next(place.motions)
        return cm.time_of_impact(A, cm.Motion(cm.Pose(*x), angular=w), B, cm.Motion(cm.Pose(*y), v))

    def new_shapes() -> Any:
        x, y = next(place.tuples)
        s, t = next(place.sizes)
        return cm.contact(KINDS[a][0](s), cm.Pose(*x), KINDS[b][0](t), cm.Pose(*y))

    F, G = (fcl.CollisionObject(KINDS[kind][1]()) for kind in (a, b))

    def fcl_distance() -> Any:
        x, y = next(place.fcl)
        F.setTransform(fcl.Transform(*x))
        G.setTransform(fcl.Transform(*y))
        return fcl.distance(F, G, fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult())

    def fcl_new_shapes() -> Any:
        x, y = next(place.fcl)
        s, t = next(place.sizes)
        first = fcl.CollisionObject(KINDS[a][1](s), fcl.Transform(*x))
        second = fcl.CollisionObject(KINDS[b][1](t), fcl.Transform(*y))
        return fcl.distance(first, second, fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult())

    calls = {
        REFERENCE: fcl_distance,
        "fcl.distance, same objects": lambda: fcl.distance(
            F, G, fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult()
        ),
        "fcl.distance, new shapes": fcl_new_shapes,
        "contact, Pose of tuples": with_poses(cm.contact, place.tuples, new_pose),
        "contact, Pose of lists": with_poses(cm.contact, place.lists, new_pose),
        "contact, Pose of arrays": with_poses(cm.contact, place.arrays, new_pose),
        "contact, 7 numbers": with_poses(cm.contact, place.rows, lambda row: row),
        "contact, matrix (4, 4)": with_poses(cm.contact, place.matrices, lambda matrix: matrix),
        "contact, same Pose objects": with_poses(cm.contact, place.poses, lambda pose: pose),
        "contact, new shapes": new_shapes,
        "distance, Pose of tuples": with_poses(cm.distance, place.tuples, new_pose),
        "overlap, Pose of tuples": with_poses(cm.overlap, place.tuples, new_pose),
        "time_of_impact, new Motion": impact,
    }
    _add_others(calls, place, a, b)
    return calls


def _add_others(calls: dict[str, Callable[[], Any]], place: Places, a: str, b: str) -> None:
    """Add trimesh's CollisionManager, and coal where it is installed."""
    manager = trimesh.collision.CollisionManager()
    for name, kind in (("a", a), ("b", b)):
        manager.add_object(name, KINDS[kind][2]())

    def trimesh_distance() -> Any:
        x, y = next(place.matrices)
        manager.set_transform("a", x)
        manager.set_transform("b", y)
        return manager.min_distance_internal()

    calls["trimesh CollisionManager"] = trimesh_distance
    try:
        import coal
    except ImportError:
        return
    own = {
        "box": (coal.Box, 1, 1.2, 0.8), "sphere": (coal.Sphere, 0.6), "capsule": (coal.Capsule, 0.3, 1),
        "cylinder": (coal.Cylinder, 0.4, 1),
    }  # fmt: skip
    if a in own and b in own:
        first, second = (own[kind][0](*own[kind][1:]) for kind in (a, b))

        def coal_distance() -> Any:
            x, y = next(place.matrices)
            at = [coal.Transform3s(each[:3, :3], each[:3, 3]) for each in (x, y)]
            return coal.distance(first, at[0], second, at[1], coal.DistanceRequest(), coal.DistanceResult())

        calls["coal distance, new Transform3s"] = coal_distance


def compare(a: str, b: str, rounds: int) -> None:
    """Print the table of one pair."""
    calls = candidates(a, b)
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        timeit.timeit(call, number=PLACES)
    for _ in range(rounds):
        for name, call in calls.items():
            times[name].append(timeit.timeit(call, number=CALLS, timer=time.process_time) / CALLS * 1e6)
    reference = min(times[REFERENCE])
    print(f"\n{a} and {b}\n  {'':32s}{'best µs':>9s}{'median µs':>11s}{'/ fcl':>7s}")
    for name, each in times.items():
        print(f"  {name:32s}{min(each):9.2f}{float(np.median(each)):11.2f}{min(each) / reference:7.2f}")


def main() -> None:
    """Print one table for each pair, and the time of a Pose."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a quarter of the rounds")
    parser.add_argument("--pairs", nargs="+", choices=PAIRS, default=PAIRS, help="pairs of kinds (default: all)")
    args = parser.parse_args()
    rounds = 10 if args.quick else 40
    place = Places()
    for name, make in {
        "tuples": lambda: cm.Pose(*next(place.tuples)[0]),
        "lists": lambda: cm.Pose(*next(place.lists)[0]),
        "arrays": lambda: cm.Pose(*next(place.arrays)[0]),
        "a matrix": lambda: cm.Pose.from_matrix(next(place.matrices)[0]),
    }.items():
        best = min(timeit.repeat(make, number=CALLS, repeat=rounds, timer=time.process_time)) / CALLS * 1e6
        print(f"A Pose of {name}: {best:.2f} µs")
    for pair in args.pairs:
        compare(*pair.split("-"), rounds)


if __name__ == "__main__":
    main()
