"""Time meshes against FCL and Coal: distance, yes/no overlap, time of impact with both turning, building and memory.

    python benchmarks/mesh_pairs.py              all surfaces, about 3 minutes
    python benchmarks/mesh_pairs.py --quick      a few poses of each

Each query is asked of us and of FCL in turn, and just before, of Coal (installed by `make bench-peers`) in a second
process with the same poses, which every library makes anew for each query. The figures are means in µs over all poses,
each the best of three. The ratios are to the faster of the two: below 1 we are faster. All answers are compared. Ours
are `cm.contact`, `cm.overlap` and `cm.time_of_impact`, with all that Python adds.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
PEERS = ROOT / ".venv-peers" / "bin" / "python"
PLACES = {"deep": (0.0, 0.3), "touching": (0.5, 1.0), "near": (1.0, 1.15), "far": (1.5, 3.0)}
"""Distances of the centres, as parts of both bounding radii together."""


class Surface(NamedTuple):
    """Vertices (n, 3) in m and faces (m, 3)."""

    vertices: Array
    faces: NDArray[np.int32]


def surfaces() -> dict[str, Surface]:
    """The surfaces by name: closed, concave, open, a soup, and one like a scan."""
    import trimesh

    from collision_monitor.world.arm import lathe

    found = {}
    for n in (16, 46, 128):
        ring = trimesh.creation.torus(1.0, 0.4, major_sections=n, minor_sections=n)
        found[f"torus {len(ring.faces)}"] = Surface(ring.vertices, ring.faces)
    for segments in (16, 40, 128):
        shape = lathe([(0.06, -0.2), (0.06, -0.12), (0.03, -0.1), (0.03, 0.1), (0.06, 0.12), (0.06, 0.2)], segments)
        found[f"link {len(shape.faces)}"] = Surface(shape.vertices, shape.faces)
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-1, 1, 224), np.linspace(-1, 1, 224), indexing="ij")
    z = 0.1 * np.sin(5 * x) * np.cos(4 * y) + 0.002 * rng.normal(size=x.shape)
    k = np.arange(224 * 224).reshape(224, 224)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    scan = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    found[f"scan {len(scan)}"] = Surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), scan)
    half = ring.faces[ring.triangles_center[:, 0] > 0]
    found[f"open {len(half)}"] = Surface(ring.vertices, half)
    for name, count, size in (("soup", 2000, 0.05), ("soup", 20_000, 0.05), ("dense soup", 2000, 0.15)):
        soup = rng.normal(size=(count, 1, 3)) * 0.4 + size * rng.normal(size=(count, 3, 3))
        found[f"{name} {count}"] = Surface(soup.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    return found


def poses(surface: Surface, count: int, seed: int) -> Array:
    """Pairs of poses (places * count, 2, 7): the surfaces are deep in each other, touch, are near, and far apart."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(seed)
    reach = 2 * float(np.linalg.norm(surface.vertices, axis=1).max())
    rows = []
    for low, high in PLACES.values():
        for _ in range(count):
            p = rng.normal(size=3)
            p *= rng.uniform(low, high) * reach / np.linalg.norm(p)
            q = Rotation.random(2, rng=rng).as_quat()
            rows.append([[0, 0, 0, *q[0]], [*p, *q[1]]])
    return np.array(rows, dtype=np.float64)


def matrices(pose: Array) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,) of a pose."""
    x, y, z, w = pose[3:]
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rotation), pose[:3].copy()


def timed(function: Callable[[], Any]) -> tuple[Any, float]:
    """Result and the best of three times (s)."""
    best = np.inf
    for _ in range(3):
        begin = time.perf_counter()
        result = function()
        best = min(best, time.perf_counter() - begin)
    return result, best


def coal_answers(file: Path) -> dict[str, Any]:
    """Times (s) and answers of Coal for the poses of a surface in a file; runs in the peers' environment."""
    import coal

    data = np.load(file)
    vertices, faces = data["vertices"], data["faces"]
    begin = time.perf_counter()
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    model.addVertices(vertices)
    model.addTriangles(faces.astype(np.int64))
    model.endModel()
    rows: dict[str, Any] = {"build": time.perf_counter() - begin, "distance": [], "overlap": []}
    for a, b in data["poses"]:
        X, Y = matrices(a), matrices(b)

        def collide(X: Any = X, Y: Any = Y) -> bool:
            at = coal.Transform3s(*X), coal.Transform3s(*Y)
            return bool(coal.collide(model, at[0], model, at[1], coal.CollisionRequest(), coal.CollisionResult()))

        def distance(X: Any = X, Y: Any = Y) -> float:
            at = coal.Transform3s(*X), coal.Transform3s(*Y)
            return float(coal.distance(model, at[0], model, at[1], coal.DistanceRequest(), coal.DistanceResult()))

        rows["overlap"].append(timed(collide))
        rows["distance"].append((0.0, np.nan) if rows["overlap"][-1][0] else timed(distance))
    return rows


def asked_of_coal(peers: Path, surface: Surface, rows: Array) -> dict[str, Any]:
    """`coal_answers` of a second process."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mesh.npz"
        np.savez(file, vertices=surface.vertices, faces=surface.faces, poses=rows)
        command = [str(peers), __file__, "--coal", str(file)]
        answers: dict[str, Any] = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return answers


def measure(surface: Surface, rows: Array) -> dict[str, Any]:
    """Times (s) and answers of ours and of FCL, asked in turn."""
    import fcl

    import collision_monitor as cm
    from collision_monitor.meshes.trees.shape_trees import made_tree

    mesh = cm.Mesh(surface.vertices, surface.faces)
    tree, ours = timed(lambda: made_tree(mesh))

    def fcl_model() -> Any:
        model = fcl.BVHModel()
        model.beginModel(len(surface.vertices), len(surface.faces))
        model.addSubModel(surface.vertices, surface.faces)
        model.endModel()
        return model

    model, theirs = timed(fcl_model)
    found: dict[str, Any] = {"build": (ours, theirs), "bytes": tree.nbytes, "distance": [], "overlap": [], "impact": []}
    objects = [fcl.CollisionObject(model, fcl.Transform()) for _ in range(2)]
    rng = np.random.default_rng(1)
    for pair in rows:
        placed = [matrices(pose) for pose in pair]

        def at(pair: Array = pair) -> tuple[cm.Pose, cm.Pose]:
            return cm.Pose(pair[0, :3], pair[0, 3:]), cm.Pose(pair[1, :3], pair[1, 3:])

        def place(placed: Any = placed) -> None:
            for each, numbers in zip(objects, placed, strict=True):
                each.setTransform(fcl.Transform(*numbers))

        def overlap(at: Any = at) -> bool:
            X, Y = at()
            return bool(cm.overlap(mesh, X, mesh, Y))

        def collide(place: Any = place) -> bool:
            place()
            return bool(fcl.collide(*objects, fcl.CollisionRequest(), fcl.CollisionResult()) > 0)

        def contact(at: Any = at) -> float:
            X, Y = at()
            return float(cm.contact(mesh, X, mesh, Y).signed_distance)

        def distance(place: Any = place) -> float:
            place()
            return float(fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult()))

        found["overlap"].append((*timed(overlap), *timed(collide)))
        if found["overlap"][-1][0]:
            continue
        found["distance"].append((*timed(contact), *timed(distance)))
        spins = rng.normal(size=(2, 3))

        def meet(at: Any = at, v: Array = -pair[1, :3] / 1.5, spins: Array = spins) -> Any:
            X, Y = at()
            return cm.time_of_impact(mesh, cm.Motion(X, angular=spins[0]), mesh, cm.Motion(Y, v, spins[1]))

        impact = timed(meet)
        found["impact"].append((impact[0].status, impact[1]))
    return found


def main() -> int:
    """Print a table of all surfaces, and save it to benchmarks/results/."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a few poses of each surface")
    parser.add_argument("--coal", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--peers", type=Path, default=PEERS, help="a Python with the package coal")
    args = parser.parse_args()
    if args.coal:
        print(json.dumps(coal_answers(args.coal)))
        return 0
    every = surfaces()
    asked = {name: poses(surface, 3 if args.quick else 12, k) for k, (name, surface) in enumerate(every.items())}
    has_coal = args.peers.exists()
    if not has_coal:
        print(f"no Coal: there is no Python at {args.peers} (make bench-peers); FCL alone", file=sys.stderr)
    header = "surface, triangles | distance: ours  FCL  Coal ratio | overlap: ours  FCL  Coal ratio | "
    print(header + "impact /distance | build ms: ours  FCL ratio | bytes/triangle | differ")
    table = []
    for name, surface in every.items():
        coal = asked_of_coal(args.peers, surface, asked[name]) if has_coal else None
        row = summary(measure(surface, asked[name]), coal, len(surface.faces))
        table.append({"surface": name, **row})
        print("{:18s} | {:7.1f} {:7.1f} {:7.1f} {:5.2f} | {:7.1f} {:7.1f} {:7.1f} {:5.2f} | {:7.0f} {:6.1f} | "
              "{:8.2f} {:8.2f} {:5.2f} | {:5.0f} | {}".format(name, *row.values()))  # fmt: skip
    results = ROOT / "benchmarks" / "results"
    results.mkdir(exist_ok=True)
    (results / "mesh_pairs.json").write_text(json.dumps(table, indent=1))
    return 0


def summary(ours: dict[str, Any], coal: dict[str, Any] | None, triangles: int) -> dict[str, Any]:
    """The figures of a surface, in the order of the table."""
    row: dict[str, Any] = {}
    differ = 0
    for query in ("distance", "overlap"):
        answers = np.array(ours[query], dtype=np.float64).reshape(-1, 4)
        differ += int((np.abs(answers[:, 0] - answers[:, 2]) > 1e-9).sum())
        mine, fcl = 1e6 * np.mean(answers[:, 1]), 1e6 * np.mean(answers[:, 3])
        third = 1e6 * np.nanmean([each[1] for each in coal[query]]) if coal else np.nan
        row |= {f"{query}_us": mine, f"{query}_fcl": fcl, f"{query}_coal": third}
        row[f"{query}_ratio"] = mine / np.nanmin([fcl, third])
    impact = 1e6 * float(np.mean([seconds for _, seconds in ours["impact"]]))
    built, theirs = (1e3 * seconds for seconds in ours["build"])
    row |= {"impact_us": impact, "impact_in_distances": impact / row["distance_us"], "build_ms": built}
    return row | {
        "build_fcl": theirs, "build_ratio": built / theirs, "bytes": ours["bytes"] / triangles, "differ": differ
    }  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
