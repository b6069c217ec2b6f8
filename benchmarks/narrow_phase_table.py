"""Measure the errors and the speed of every shape pair: the first table of docs/narrow_phase.md.

    nice python benchmarks/narrow_phase_table.py                  # 100,000 random pairs of each, about 6 minutes
    nice python benchmarks/narrow_phase_table.py --pairs 1000     # a quick look

Each answer is checked against definitions in NumPy that the kernels do not use:

- Shapes that are apart: the answer is its own proof. Both witness points must lie in their shapes, so that the true
  distance is at most the distance of the points. The two support functions must leave a gap along the normal, so that
  the true distance is at least that gap. The error is the larger of the two differences.
- Shapes that overlap: translation by the depth along the normal must separate them, by the support functions, and no
  other direction may separate them sooner. For polytopes and polygons all face normals and edge crosses are tested
  (exact), for curved shapes a search from 200 directions.

FCL's distance is a second opinion for pairs that are apart by more than 5 % of the size. FCL is not accurate enough for
closer and overlapping pairs. concave_pairs.py checks compounds, meshes and concave polygons.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import fcl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as Qhull
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.cli.output.progress import progress_bar
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.registry import Shape
from collision_monitor.shapes.shape_table import ShapeTableBuilder, take

Array = NDArray[np.float64]
ROOT = Path(__file__).parents[1]
SOLIDS = ("sphere", "box", "capsule", "cylinder", "cone", "convex hull")
SIZES = 20
"""Number of random shapes of each kind; a row has so many pairs of shapes."""


class Row(NamedTuple):
    """One row of the table; errors relative to the sum of the two bounding radii, times in µs."""

    pair: str
    cases: str
    checked: int
    apart: float
    overlapping: float
    refuted: int
    fcl_checked: int
    fcl: float
    scalar: float
    batch: float


def make(kind: str, rng: np.random.Generator) -> Shape:
    """A random shape of a kind, about 1 m in size."""
    size = rng.uniform(0.2, 1.0, 3)
    match kind:
        case "sphere":
            return cm.Sphere(size[0])
        case "box":
            return cm.Box(2 * size)
        case "capsule":
            return cm.Capsule(size[0] / 2, 2 * size[1])
        case "cylinder":
            return cm.Cylinder(size[0], 2 * size[1])
        case "cone":
            return cm.Cone(size[0], 2 * size[1])
        case "convex hull":
            points = rng.normal(size=(rng.integers(4, 13), 3))
            return cm.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None] * size)
        case "half-space":
            return cm.HalfSpace(rng.normal(size=3), rng.uniform(-1, 1))
        case "circle":
            return cm.Circle(size[0])
        case "polygon":
            points = rng.normal(size=(rng.integers(3, 9), 2))
            return cm.Polygon(points[Qhull(points).vertices])
    raise AssertionError(kind)


def radius(shape: Shape) -> float:
    """Radius of a sphere about the origin that contains the shape (m); 0 for a half-space."""
    match shape:
        case cm.Sphere() | cm.Circle():
            return float(shape.radius)
        case cm.Box():
            return float(np.linalg.norm(shape.size)) / 2
        case cm.ConvexHull() | cm.Polygon():
            return float(np.linalg.norm(shape.points, axis=1).max())
        case cm.Capsule():
            return float(shape.radius + shape.length / 2)
        case cm.Cylinder() | cm.Cone():
            return float(np.hypot(shape.radius, shape.length / 2))
    return 0.0


def support(shape: Shape, d: Array) -> Array:
    """Support values max d . x of a shape in its own frame, for directions d (..., 3)."""
    rim, along = np.hypot(d[..., 0], d[..., 1]), d[..., 2]
    match shape:
        case cm.Sphere():
            return shape.radius * np.linalg.norm(d, axis=-1)
        case cm.Box():
            return np.abs(d) @ np.array(shape.size) / 2
        case cm.Capsule():
            return np.abs(along) * shape.length / 2 + shape.radius * np.linalg.norm(d, axis=-1)
        case cm.Cylinder():
            return np.abs(along) * shape.length / 2 + shape.radius * rim
        case cm.Cone():
            return np.maximum(along * shape.length / 2, shape.radius * rim - along * shape.length / 2)
        case cm.ConvexHull():
            return (d @ shape.points.T).max(axis=-1)
        case cm.Circle():
            return shape.radius * rim
        case cm.Polygon():
            return (d[..., :2] @ shape.points.T).max(axis=-1)
        case cm.HalfSpace():
            return np.where(d @ shape.normal > 1 - 1e-12, shape.offset, np.inf)
    raise AssertionError(shape)


def outside(shape: Shape, x: Array) -> Array:
    """Bounds (n,) in m on how far points (n, 3) in the shape's frame are outside it; <= 0 inside."""
    rim, height = np.hypot(x[:, 0], x[:, 1]), np.abs(x[:, 2])
    match shape:
        case cm.Sphere():
            return np.linalg.norm(x, axis=1) - shape.radius
        case cm.Box():
            return (np.abs(x) - np.array(shape.size) / 2).max(axis=1)
        case cm.Capsule():
            over = np.maximum(height - shape.length / 2, 0)
            return np.hypot(rim, over) - shape.radius
        case cm.Cylinder():
            return np.maximum(rim - shape.radius, height - shape.length / 2)
        case cm.Cone():
            slant = np.hypot(shape.radius, shape.length)
            side = (rim * shape.length + (x[:, 2] - shape.length / 2) * shape.radius) / slant
            return np.maximum(side, -x[:, 2] - shape.length / 2)
        case cm.ConvexHull():
            planes = Qhull(shape.points).equations
            return (x @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        case cm.Circle():
            return rim - shape.radius
        case cm.Polygon():
            normal, offset = sides(shape)
            return (x[:, :2] @ normal.T - offset).max(axis=1)
        case cm.HalfSpace():
            return x @ shape.normal - shape.offset
    raise AssertionError(shape)


def sides(shape: cm.Polygon) -> tuple[Array, Array]:
    """Outward unit normals (n, 2) of a convex polygon's sides and their offsets (n,) in m."""
    along = np.roll(shape.points, -1, axis=0) - shape.points
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    normal *= np.sign((normal * (shape.points - shape.points.mean(axis=0))).sum(axis=1))[:, None]
    return normal, (normal * shape.points).sum(axis=1)


def polytope_axes(shape: Shape) -> tuple[Array, Array] | None:
    """Unit face normals (f, 3) and edge directions (e, 3) of a polytope; None for a curved shape."""
    if isinstance(shape, cm.Box):
        return np.eye(3), np.eye(3)
    if not isinstance(shape, cm.ConvexHull):
        return None
    hull = Qhull(shape.points)
    edges = np.unique(np.sort(hull.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    along = shape.points[edges[:, 1]] - shape.points[edges[:, 0]]
    return hull.equations[:, :3], along / np.linalg.norm(along, axis=1)[:, None]


def unit(v: Array) -> Array:
    """Normalise vectors along the last axis; zero vectors stay."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0, length, 1)


def least_depth(a: Shape, R_A: Array, b: Shape, R_B: Array, p: Array) -> Array:
    """Shortest translations (n,) in m that separate the shapes by the definitions, for n poses."""

    def reach(d: Array) -> Array:  # (n, k, 3) -> (n, k): distance by which B must move along d
        return support(a, d @ R_A) + support(b, -d @ R_B) - (d * p[:, None]).sum(axis=-1)

    if isinstance(b, cm.HalfSpace):
        return np.asarray(reach(-(R_B @ b.normal)[:, None])[:, 0])
    if isinstance(a, cm.Circle | cm.Polygon):
        directions = [unit(p)[:, None]]
        for shape, R, sign in ((a, R_A, 1.0), (b, R_B, -1.0)):
            if isinstance(shape, cm.Polygon):
                normal = np.pad(sides(shape)[0], ((0, 0), (0, 1)))
                directions.append(sign * normal @ np.swapaxes(R, 1, 2))
        return np.asarray(reach(np.concatenate(directions, axis=1)).min(axis=1))
    axes_a, axes_b = polytope_axes(a), polytope_axes(b)
    if axes_a is not None and axes_b is not None:
        faces = [axes_a[0] @ np.swapaxes(R_A, 1, 2), axes_b[0] @ np.swapaxes(R_B, 1, 2)]
        edges_a, edges_b = axes_a[1] @ np.swapaxes(R_A, 1, 2), axes_b[1] @ np.swapaxes(R_B, 1, 2)
        crossed = np.cross(edges_a[:, :, None], edges_b[:, None]).reshape(len(p), -1, 3)
        length = np.linalg.norm(crossed, axis=-1, keepdims=True)
        crossed = np.where(length > 1e-6, crossed / np.where(length > 0, length, 1), faces[0][:, :1])
        directions = np.concatenate([*faces, crossed], axis=1)
        return np.asarray(np.minimum(reach(directions).min(axis=1), reach(-directions).min(axis=1)))
    # curved: descend from the best of many directions, with shrinking steps
    k = np.arange(200) + 0.5
    z, turn = 1 - 2 * k / 200, np.pi * (1 + 5**0.5) * k
    every = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    axes = np.stack([R_A[:, :, 2], -R_A[:, :, 2], R_B[:, :, 2], -R_B[:, :, 2], unit(p)], axis=1)
    every = np.concatenate([np.broadcast_to(every, (len(p), 200, 3)), axes], axis=1)
    found = reach(every)
    best = np.argsort(found, axis=1)[:, :2]
    d = np.take_along_axis(every, best[..., None], axis=1)
    depth = np.take_along_axis(found, best, axis=1)
    step = np.full(depth.shape, 0.1)
    u = unit(np.cross(d, np.eye(3)[np.abs(d).argmin(axis=-1)]))
    for _ in range(80):
        v = np.cross(d, u)
        tries = unit(d[:, :, None] + step[..., None, None] * np.stack([u, -u, v, -v], axis=2))
        values = reach(tries.reshape(len(p), -1, 3)).reshape(*depth.shape, 4)
        chosen = values.argmin(axis=-1)
        value = np.take_along_axis(values, chosen[..., None], axis=-1)[..., 0]
        better = value < depth
        d = np.where(better[..., None], np.take_along_axis(tries, chosen[..., None, None], axis=2)[:, :, 0], d)
        depth, step = np.where(better, value, depth), np.where(better, step, 0.5 * step)
        u = unit(u - (u * d).sum(axis=-1, keepdims=True) * d)
        u = unit(u + 0.7 * np.cross(d, u))  # so that the descent also follows a valley along neither axis
    return np.asarray(depth.min(axis=1))


class Batch(NamedTuple):
    """n poses of two shapes: B relative to A's origin, in world axes."""

    a: Shape
    b: Shape
    R_A: Array
    R_B: Array
    p: Array


def batches(kinds: tuple[str, str], count: int, rng: np.random.Generator) -> list[Batch]:
    """Random shapes of two kinds at random poses, about half of them overlapping."""
    result = []
    planar = kinds[0] in ("circle", "polygon")
    for _ in range(SIZES):
        a, b = (make(kind, rng) for kind in kinds)
        n = count // SIZES
        if planar:
            R_A, R_B = (Rotation.from_rotvec(rng.uniform(0, 7, (n, 1)) * [0, 0, 1]).as_matrix() for _ in "ab")
        else:
            R_A, R_B = (Rotation.random(n, rng=rng).as_matrix() for _ in "ab")
        towards = unit(rng.normal(size=(n, 3)) * [1, 1, 0 if planar else 1])
        far = rng.uniform(0, 1.4, (n, 1)) * (radius(a) + radius(b))
        result.append(Batch(a, b, R_A, R_B, towards * far))
    return result


def answers(batch: Batch) -> tuple[Array, float]:
    """Contacts (n, 15) of a batch by the compiled kernels, and the processor time for each (s)."""
    builder, n = ShapeTableBuilder(slots=2), len(batch.p)
    for shape in (batch.a, batch.b):
        builder.append(shape)
    position = np.concatenate([np.zeros((n, 3)), batch.p])
    rotation = np.concatenate([batch.R_A, batch.R_B])
    pairs = np.stack([np.arange(n), n + np.arange(n)], axis=1).astype(np.int32)
    table = take(builder.table, np.repeat([0, 1], n))
    contact_batch(table, position, rotation, pairs[:1])
    begin = time.process_time()
    rows = contact_batch(table, position, rotation, pairs)
    return rows, (time.process_time() - begin) / n


def check(batch: Batch, rows: Array) -> tuple[Array, Array, int]:
    """Errors (n,) by the definitions (m), whether each pair (n,) is apart, and the number of refuted bounds."""
    d, normal, on_a, on_b = rows[:, 0], rows[:, 1:4], rows[:, 4:7], rows[:, 7:10]
    in_a, in_b = normal[:, None] @ batch.R_A, -normal[:, None] @ batch.R_B
    gap = (normal * batch.p).sum(axis=1) - support(batch.a, in_a)[:, 0] - support(batch.b, in_b)[:, 0]
    error = np.abs(d - gap)
    apart = d > 0
    out_a = outside(batch.a, (on_a[:, None] @ batch.R_A)[:, 0])
    out_b = outside(batch.b, ((on_b - batch.p)[:, None] @ batch.R_B)[:, 0])
    out = np.maximum(np.maximum(out_a, out_b), 0.0)
    error = np.maximum(error, np.where(apart, out, 0.0))
    # the true distance is at least the gap; if apart, it is at most the distance of two points in the shapes
    round_off = 1e-14 * (radius(batch.a) + radius(batch.b))
    refuted = int((d + rows[:, 10] < gap - round_off).sum())
    inside = np.flatnonzero(~apart)
    for some in np.array_split(inside, len(inside) // 250 + 1):
        if len(some):
            least = least_depth(batch.a, batch.R_A[some], batch.b, batch.R_B[some], batch.p[some])
            error[some] = np.maximum(error[some], -d[some] - least)
            refuted += int((-d[some] - rows[some, 10] > least + round_off).sum())
    return error, apart, refuted


def in_fcl(shape: Shape) -> Any:
    """FCL's geometry of a shape, or None if FCL has none."""
    match shape:
        case cm.Sphere():
            return fcl.Sphere(shape.radius)
        case cm.Box():
            return fcl.Box(*shape.size)
        case cm.Capsule():
            return fcl.Capsule(shape.radius, shape.length)
        case cm.Cylinder():
            return fcl.Cylinder(shape.radius, shape.length)
        case cm.Cone():
            return fcl.Cone(shape.radius, shape.length)
        case cm.ConvexHull():
            hull = convex_hull(shape.points)
            return fcl.Convex(hull.vertices, len(hull.faces), np.insert(hull.faces, 0, 3, axis=1).ravel())
        case cm.Mesh():
            model = fcl.BVHModel()
            model.beginModel(len(shape.vertices), len(shape.faces))
            model.addSubModel(shape.vertices, shape.faces)
            model.endModel()
            return model
    return None


def fcl_distance(a: Any, X_A: Any, b: Any, X_B: Any) -> float:
    """FCL's distance of two geometries that are apart (m)."""
    result = fcl.DistanceResult()
    objects = fcl.CollisionObject(a, X_A), fcl.CollisionObject(b, X_B)
    return float(fcl.distance(*objects, fcl.DistanceRequest(), result))


def conformance() -> dict[tuple[str, str], tuple[int, int]]:
    """Numbers of passed and of all conformance cases, by kinds of shape.

    Runs the project's own test of each case, also swapped and moved.
    """
    sys.path[:0] = [str(ROOT / "test" / folder) for folder in ("narrow_phase", "helpers")]
    import test_conformance as conformance_test

    names = {"halfspace": "half-space"}
    count: dict[tuple[str, str], tuple[int, int]] = {}
    for case in conformance_test.supported():
        a, b = (names.get(case[key]["type"], case[key]["type"]) for key in ("shapeA", "shapeB"))
        try:
            for swap, moved in itertools.product((False, True), repeat=2):
                conformance_test.test_case(case, swap, moved)
            passed = 1
        except AssertionError:
            passed = 0
        done, total = count.get((a, b), (0, 0))
        count[a, b] = count[b, a] = done + passed, total + 1
    return count


def scalar_cost(batch: Batch) -> float:
    """Mean processor time of one call of `contact` with two new poses over up to 300 calls (s)."""
    n = min(len(batch.p), 300)
    turns = [Rotation.from_matrix(R[:n]).as_quat().tolist() for R in (batch.R_A, batch.R_B)]
    begin = time.process_time()
    for p, q_a, q_b in zip(batch.p[:n].tolist(), *turns, strict=True):
        cm.contact(batch.a, cm.Pose((0.0, 0.0, 0.0), q_a), batch.b, cm.Pose(p, q_b))
    return (time.process_time() - begin) / n


def convex_row(kinds: tuple[str, str], count: int, cases: str, done: Callable[[int], None]) -> Row:
    """Measure the row of two kinds of convex shapes."""
    rng = np.random.default_rng(sum(map(ord, "".join(kinds))))
    worst = {True: 0.0, False: 0.0}
    refuted, seconds, fcl_worst, fcl_count = 0, [], 0.0, 0
    every = batches(kinds, count, rng)
    for batch in every:
        rows, cost = answers(batch)
        seconds.append(cost)
        error, apart, wrong = check(batch, rows)
        size = radius(batch.a) + radius(batch.b)
        for which in (True, False):
            worst[which] = max(worst[which], float(error[apart == which].max(initial=0.0)) / size)
        refuted += wrong
        a, b = in_fcl(batch.a), in_fcl(batch.b)
        if a is not None and b is not None:
            for k in np.flatnonzero(rows[:, 0] > 0.05 * size):
                X_A, X_B = fcl.Transform(batch.R_A[k], np.zeros(3)), fcl.Transform(batch.R_B[k], batch.p[k])
                fcl_worst = max(fcl_worst, abs(fcl_distance(a, X_A, b, X_B) - rows[k, 0]) / size)
                fcl_count += 1
        done(len(batch.p))
    checked = sum(len(batch.p) for batch in every)
    return Row(
        f"{kinds[0]} – {kinds[1]}", cases, checked, worst[True], worst[False], refuted, fcl_count, fcl_worst,
        1e6 * scalar_cost(every[0]), 1e6 * float(np.median(seconds)),
    )  # fmt: skip


def main() -> None:
    """Measure all rows and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000, help="random pairs for each two kinds (default 100,000)")
    parser.add_argument("--only", default="", help="only rows whose name contains this, as 'box – box'")
    parser.add_argument("--json", type=Path, help="also write the rows as JSON")
    arguments = parser.parse_args()
    count = max(arguments.pairs // SIZES, 1) * SIZES
    every = [
        *itertools.combinations_with_replacement(SOLIDS, 2),
        *((kind, "half-space") for kind in SOLIDS),
        ("circle", "circle"), ("circle", "polygon"), ("polygon", "polygon"),
    ]  # fmt: skip
    every = [kinds for kinds in every if arguments.only in f"{kinds[0]} – {kinds[1]}"]
    cases = conformance()
    rows = []
    with progress_bar("shape pairs", len(every) * count) as done:
        for kinds in every:
            passed, total = cases.get(kinds, (0, 0))
            rows.append(convex_row(kinds, count, f"{passed} of {total}" if total else "", done))
            print(rows[-1], file=sys.stderr, flush=True)
    columns = [
        "cases",
        "pairs",
        "worst apart",
        "worst overlapping",
        "bounds refuted",
        "FCL",
        "worst",
        "scalar µs",
        "batch µs",
    ]
    print("| " + " | ".join(["pair", *columns]) + " |")
    print("|---" + "|---:" * len(columns) + "|")
    for row in rows:
        cells = [row.pair, row.cases, f"{row.checked:,}", *(error(x) for x in (row.apart, row.overlapping))]
        cells += [str(row.refuted), f"{row.fcl_checked:,}" if row.fcl_checked else ""]
        cells += [error(row.fcl) if row.fcl_checked else "", f"{row.scalar:.0f}"]
        cells += ["" if np.isnan(row.batch) else f"{row.batch:.2g}"]
        print("| " + " | ".join(cells) + " |")
    if arguments.json:
        arguments.json.write_text(json.dumps([row._asdict() for row in rows], indent=1))


def error(x: float) -> str:
    """Text of an error with one significant digit; empty for NaN."""
    return "" if np.isnan(x) else f"{x:.0e}".replace("e-0", "e-")


if __name__ == "__main__":
    main()
