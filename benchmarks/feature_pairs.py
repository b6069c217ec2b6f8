"""Measure how often each pair of features (vertex, edge, face) touches first, and what a vertex-face test alone misses.

The question of the slides "Collision detection for rigid bodies": which of the six pairs occur in practice? Each row
is COUNT first contacts of two moving solids. A test of vertices against faces alone sees a contact when the first
vertex is inside the other solid: later than the contact, or never, if only edges cross. Prints Markdown tables.

    python benchmarks/feature_pairs.py
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as Qhull

import collision_monitor as cm
from collision_monitor.geometry.contact_features import FeaturePair
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.world import make_scene

Array = NDArray[np.float64]
Solid = cm.Box | cm.ConvexHull
COUNT = 400
PARTS = 2000
"""Times at which the vertices are looked at, within LATEST seconds after the contact."""
LATEST = 2.0
TESTS = 200_000


def corners(solid: Solid) -> tuple[Array, Array]:
    """Return vertices (n, 3) and planes (m, 4: outward normal, offset) of a solid."""
    unit = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    points = unit * solid.size if isinstance(solid, cm.Box) else np.asarray(solid.points)
    hull = Qhull(points)
    return points[hull.vertices], np.unique(hull.equations.round(12), axis=0)


def tumbling(kind: str, random: np.random.Generator) -> tuple[Solid, cm.Motion, Solid, cm.Motion]:
    """Return two random solids of about 1 m that fly at each other, turning unless `kind` says otherwise."""

    def solid() -> Solid:
        if "boxes" in kind:
            return cm.Box(random.uniform(0.4, 1.2, 3))
        return cm.ConvexHull(random.normal(size=(12 if "12" in kind else 32, 3)) * 0.4)

    def turned() -> Array:
        q = random.normal(size=4) * [0, 0, 1, 1] if "upright" in kind else random.normal(size=4)
        return q / np.linalg.norm(q)

    offset = random.normal(size=3) * ([1, 1, 0] if "upright" in kind else [1, 1, 1])
    offset *= 4.0 / np.linalg.norm(offset)
    aim = offset + random.uniform(-0.7, 0.7, 3)
    spin = np.array([0, 0, 1]) if "upright" in kind else np.ones(3)
    spins = [random.uniform(-1, 1, 3) * spin for _ in range(2)]
    a = cm.Motion(cm.Pose((0, 0, 0), turned()), (0, 0, 0), spins[0])
    velocity = -aim * ([1, 1, 0] if "upright" in kind else [1, 1, 1])
    return solid(), a, solid(), cm.Motion(cm.Pose(offset, turned()), velocity, spins[1])


def landing(random: np.random.Generator) -> tuple[Solid, cm.Motion, Solid, cm.Motion]:
    """Return a level box that descends onto a larger one, as parts are put on a table."""
    lower, upper = cm.Box((4, 4, 1)), cm.Box(random.uniform(0.4, 1.2, 3))
    yaw = random.uniform(0, np.pi)
    above = cm.Pose((*random.uniform(-1, 1, 2), 3), (0, 0, np.sin(yaw), np.cos(yaw)))
    return lower, cm.Motion(cm.Pose()), upper, cm.Motion(above, (0, 0, -1))


def cases(kind: str) -> Iterator[tuple[Solid, cm.Motion, Solid, cm.Motion]]:
    """Yield pairs of moving solids without end."""
    random = np.random.default_rng(0)
    while True:
        yield landing(random) if kind == "boxes put on a table" else tumbling(kind, random)


def is_vertex_inside(vertices: Array, pose: cm.Pose, planes: Array, other: cm.Pose) -> bool:
    """Whether one of a solid's vertices is inside of the other solid's planes."""
    world = vertices @ rotation_matrix(pose.quaternion).T + pose.position
    local = (world - other.position) @ rotation_matrix(other.quaternion)
    return bool((local @ planes[:, :3].T + planes[:, 3] <= 1e-9).all(axis=1).any())


def first_contacts(kind: str) -> tuple[Counter[FeaturePair], Counter[FeaturePair], list[float]]:
    """Return how often each pair came first, how often no vertex was inside then or later, and the deepest overlaps.

    The overlap (m) is the one at the time at which the first vertex is inside, for edges that touch first.
    """
    pairs: Counter[FeaturePair] = Counter()
    never: Counter[FeaturePair] = Counter()
    depths: list[float] = []
    for a, motion_a, b, motion_b in cases(kind):
        impact = cm.time_of_impact(a, motion_a, b, motion_b, horizon=6.0)
        if impact.status != "hit" or impact.upper == 0.0:
            continue
        at = impact.upper
        contact = cm.contact(a, motion_a.at(at), b, motion_b.at(at))
        pair = cm.contact_features(contact, a, motion_a.at(at), b, motion_b.at(at)).pair
        pairs[pair] += 1
        if pair is FeaturePair.EE:
            (points_a, planes_a), (points_b, planes_b) = corners(a), corners(b)
            for part in range(PARTS):
                later = at + LATEST * part / PARTS
                pose_a, pose_b = motion_a.at(later), motion_b.at(later)
                now = cm.contact(a, pose_a, b, pose_b)
                if part and not now.overlaps and now.signed_distance > 1e-6:
                    never[pair] += 1
                    break
                if is_vertex_inside(points_a, pose_a, planes_b, pose_b) or is_vertex_inside(
                    points_b, pose_b, planes_a, pose_a
                ):
                    depths.append(max(-now.signed_distance, 0.0))
                    break
        if pairs.total() >= COUNT:
            return pairs, never, depths
    raise AssertionError("the cases are endless")


def monitored(name: str, steps: int) -> Counter[str]:
    """Count the pairs of features of the contacts that begin in a scene, as a monitor reports them."""
    from collision_monitor.monitor.monitor import Monitor
    from collision_monitor.records import Phase

    scene, monitor = make_scene(name), Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
    kinds = ["unknown", "vertex", "edge", "face", "surface"]
    found: Counter[str] = Counter()
    for _ in range(steps):
        contacts = monitor.step(round(scene.time * 1e9), scene.states()).contacts
        for c in contacts[contacts["phase"] == Phase.BEGIN]:
            found["-".join(kinds[k] for k in sorted((int(c["feature_type_a"]), int(c["feature_type_b"]))))] += 1
        scene.step()
    return found


def main() -> None:
    """Print the tables."""
    print("| first contacts of | " + " | ".join(pair.value for pair in FeaturePair) + " | overlap until a vertex is "
          "inside, for edge-edge | never |")  # fmt: skip
    print("|---|" + "---|" * (len(FeaturePair) + 2))
    for kind in ("tumbling boxes", "tumbling hulls of 12 points", "tumbling hulls of 32 points", "upright boxes",
                 "boxes put on a table"):  # fmt: skip
        pairs, never, depths = first_contacts(kind)
        share = " | ".join(f"{100 * pairs[pair] / COUNT:.1f} %" for pair in FeaturePair)
        depth = f"median {np.median(depths):.3f} m, most {max(depths):.3f} m" if depths else "–"
        print(f"| {kind} | {share} | {depth} | {100 * never.total() / COUNT:.1f} % |", flush=True)
    for name, steps in (("clutter", 300), ("fleet", 600)):
        found = monitored(name, steps)
        print(f"\nscene {name}: " + ", ".join(f"{k} {100 * n / found.total():.0f} %" for k, n in found.most_common()))
    queries = np.random.default_rng(0).normal(size=(TESTS, 8, 3))
    cost = {}
    for test, function in (("vertex-face", cm.vertex_face_impact), ("edge-edge", cm.edge_edge_impact)):
        function(queries[:10])  # loads its kernel
        begin = time.thread_time()
        function(queries)
        cost[test] = (time.thread_time() - begin) / TESTS * 1e6
    faces, edges = 2 * 8 * 12 * cost["vertex-face"], 12 * 12 * cost["edge-edge"]
    print(
        f"\none test of a moving vertex and triangle {cost['vertex-face']:.2f} µs, of two moving edges "
        f"{cost['edge-edge']:.2f} µs; all of two boxes: 192 vertex-face {faces:.0f} µs, 144 edge-edge {edges:.0f} µs"
    )


if __name__ == "__main__":
    main()
