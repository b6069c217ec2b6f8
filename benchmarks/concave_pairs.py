"""Measure the errors of compounds, meshes and concave polygons: the second table of docs/narrow_phase.md.

    nice python benchmarks/concave_pairs.py                  # 100,000 random pairs of each, about an hour
    nice python benchmarks/concave_pairs.py --pairs 1000     # a quick look

Every object is the union of known convex parts: the shapes of a compound, the cells of a grid whose outer faces form
the mesh, the triangles about the middle of a star. `contact` gets the mesh's triangles and the star's outline. The
oracle gets only the parts, and uses the definitions of narrow_phase_table.py.

- Objects that are apart: both witness points must lie in a part, and each two parts must leave a gap along some
  direction, which the kernels propose and NumPy's support functions verify. The error is what these leave unproved.
- Objects that overlap: the least translation that separates them is at least the depth of the deepest pair of parts,
  and at most the shortest of many translations along axes of both after which no parts meet. A bound is refuted if this
  range and the stated range are disjoint, and proved if the stated range contains this range. In the plane the least
  translation is known exactly: it ends on the outline of the union of all differences of two parts.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import fcl
import numpy as np
from narrow_phase_table import SOLIDS, Array, in_fcl, least_depth, make, outside, polytope_axes, radius, support, unit
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as Qhull
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.cli.output.progress import progress_bar
from collision_monitor.geometry.bounding_volumes import KDOP_DIRECTIONS
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.shapes.registry import Shape
from collision_monitor.shapes.shape_table import ShapeTableBuilder, take

SHAPES = 20
"""Number of different objects of each kind."""
TOUCHING = 1e-9
"""Part of the size: a translation that leaves parts nearer than this does not separate them."""
POLYTOPES = cm.Box | cm.ConvexHull | cm.Polygon | cm.HalfSpace
ROUND = 2e-6
"""Part of the size to which the kernels certify the depth of round parts."""
AXES = np.array([sign * np.array(d) / np.linalg.norm(d) for d in KDOP_DIRECTIONS[26] for sign in (1.0, -1.0)])

Part = tuple[Shape, Array, Array]  # rotation (3, 3) and position (3,) in the object's frame


class Object(NamedTuple):
    """Argument of `contact`, its convex parts, and the radius of its bounding sphere about the origin (m)."""

    given: Shape | list[tuple[Shape, cm.Pose]]
    parts: list[Part]
    radius: float


class Row(NamedTuple):
    """One row of the table; lengths relative to the sum of the two bounding radii."""

    pair: str
    checked: int
    overlapping: int
    apart: float
    refuted: int
    proved: int
    bound: float
    fcl_checked: int
    fcl: float
    scalar: float


def make_object(kind: str, rng: np.random.Generator) -> Object:
    """A random object of a kind, about 1 m in size."""
    match kind:
        case "compound":
            shapes = [make(rng.choice(SOLIDS), rng) for _ in range(rng.integers(2, 5))]
            poses = [cm.Pose(rng.normal(size=3) * 0.7, unit(rng.normal(size=4))) for _ in shapes]
            parts = [(shape, pose.rotation, pose.position) for shape, pose in zip(shapes, poses, strict=True)]
            return Object(list(zip(shapes, poses, strict=True)), parts, reach_of(parts))
        case "mesh":
            return cells(rng)
        case "star":
            count = int(rng.integers(5, 10))
            angle = np.sort(rng.uniform(0, 2 * np.pi / count * 0.8, count)) + 2 * np.pi * np.arange(count) / count
            ring = rng.uniform(0.3, 1.5, (count, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            corners = zip(ring, np.roll(ring, -1, axis=0), strict=True)
            parts = [(cm.Polygon([(0.0, 0.0), a, b]), np.eye(3), np.zeros(3)) for a, b in corners]
            return Object(cm.Polygon(ring), parts, reach_of(parts))
    shape = make(kind, rng)
    return Object(shape, [(shape, np.eye(3), np.zeros(3))], radius(shape))


def reach_of(parts: list[Part]) -> float:
    """Radius of a sphere about the object's origin that contains the parts (m)."""
    return max(radius(shape) + float(np.linalg.norm(p)) for shape, _, p in parts)


def cells(rng: np.random.Generator) -> Object:
    """Mesh of the outer faces, two triangles each, of some of the 3 x 2 x 2 cells of an uneven grid."""
    lines = [np.cumsum(rng.uniform(0.3, 0.8, n + 1)) for n in (3, 2, 2)]
    lines = [line - line.mean() for line in lines]
    filled = np.zeros((5, 4, 4), bool)  # with a layer of empty cells all around
    inside = list(itertools.product((1, 2, 3), (1, 2), (1, 2)))
    for k in rng.choice(len(inside), rng.integers(3, 8), replace=False):
        filled[inside[k]] = True
    parts, quads = [], []
    for cell in np.argwhere(filled):
        low = np.array([line[k - 1] for line, k in zip(lines, cell, strict=True)])
        high = np.array([line[k] for line, k in zip(lines, cell, strict=True)])
        parts.append((cm.Box(high - low), np.eye(3), (low + high) / 2))
        for axis, side in itertools.product(range(3), (0, 1)):
            beside = cell.copy()
            beside[axis] += 2 * side - 1
            if not filled[tuple(beside)]:
                u, v = ((axis + 1) % 3, (axis + 2) % 3) if side else ((axis + 2) % 3, (axis + 1) % 3)
                quad = np.tile(cell - 1, (4, 1))
                quad[:, axis] += side
                quad[[1, 2], u] += 1
                quad[[2, 3], v] += 1
                quads.append(quad)
    corners, index = np.unique(np.concatenate(quads), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    vertices = np.stack([line[k] for line, k in zip(lines, corners.T, strict=True)], axis=1)
    faces = np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]])
    return Object(cm.Mesh(vertices, faces), parts, reach_of(parts))


class Batch(NamedTuple):
    """n poses of two objects, B relative to A's origin in world axes, and their contacts by `contact`."""

    a: Object
    b: Object
    R_A: Array
    R_B: Array
    p: Array
    distance: Array
    normal: Array
    on_a: Array
    on_b: Array
    bound: Array


def answers(a: Object, b: Object, n: int, planar: bool, rng: np.random.Generator) -> tuple[Batch, float]:
    """Contacts at n random poses, about half of them overlapping, and the processor time for all (s)."""
    about_z = [Rotation.from_rotvec(rng.uniform(0, 7, (n, 1)) * [0, 0, 1]) for _ in "ab"]
    turns = about_z if planar else [Rotation.random(n, rng=rng) for _ in "ab"]
    p = unit(rng.normal(size=(n, 3)) * [1, 1, 0 if planar else 1]) * rng.uniform(0, 1, (n, 1)) * (a.radius + b.radius)
    q_A, q_B = (turn.as_quat() for turn in turns)
    poses = [(cm.Pose((0, 0, 0), x), cm.Pose(at, y)) for x, y, at in zip(q_A, q_B, p, strict=True)]
    begin = time.process_time()
    found = [cm.contact(a.given, X, b.given, Y) for X, Y in poses]
    seconds = time.process_time() - begin
    names = ("signed_distance", "normal", "point_a", "point_b", "error_bound")
    said = [np.array([getattr(c, name) for c in found]) for name in names]
    return Batch(a, b, turns[0].as_matrix(), turns[1].as_matrix(), p, *said), seconds


class Pair(NamedTuple):
    """A part of A and a part of B in some poses of a batch, with the arguments of narrow_phase_table's functions."""

    a: Shape
    R_A: Array
    b: Shape
    R_B: Array
    p: Array

    def reach(self, d: Array) -> Array:
        """Distances (n, k) by which B must move along the directions (n, k, 3) to leave A; below 0: the gap."""
        return np.asarray(
            support(self.a, d @ self.R_A) + support(self.b, -d @ self.R_B) - (d * self.p[:, None]).sum(-1)
        )


def pairs_of(batch: Batch, some: NDArray[np.int_]) -> list[Pair]:
    """All pairs of a part of A and a part of B."""
    R_A, R_B = batch.R_A[some], batch.R_B[some]
    return [
        Pair(a, R_A @ Ra, b, R_B @ Rb, batch.p[some] + R_B @ pb - R_A @ pa)
        for (a, Ra, pa), (b, Rb, pb) in itertools.product(batch.a.parts, batch.b.parts)
    ]


def check_apart(batch: Batch, some: NDArray[np.int_]) -> tuple[Array, int]:
    """Errors (n,) in m of pairs that `contact` reports as apart, and the number of refuted bounds."""
    d, bound = batch.distance[some], batch.bound[some]

    def out(parts: list[Part], R: Array, x: Array) -> Array:
        own = (x[:, None] @ R)[:, 0]
        return np.asarray(np.min([outside(shape, (own - p) @ Rp) for shape, Rp, p in parts], axis=0))

    beside = np.maximum(out(batch.a.parts, batch.R_A[some], batch.on_a[some]), 0.0)
    beside = np.maximum(beside, out(batch.b.parts, batch.R_B[some], batch.on_b[some] - batch.p[some]))
    gap = np.full(len(some), np.inf)
    for pair in pairs_of(batch, some):
        gap = np.minimum(gap, -pair.reach(by_kernels(pair)[:, None, 1:4])[:, 0])
    far = np.linalg.norm(batch.on_b[some] - batch.on_a[some], axis=1) + 2 * beside
    round_off = 1e-14 * (batch.a.radius + batch.b.radius)
    refuted = (d - bound > far + round_off) | (d + bound < gap - round_off)
    return np.maximum(np.abs(d - gap), beside), int(refuted.sum())


def by_kernels(pair: Pair) -> Array:
    """Contacts (n, 15) of the two parts by the compiled kernels."""
    builder, n = ShapeTableBuilder(slots=2), len(pair.p)
    builder.append(pair.a)
    builder.append(pair.b)
    position = np.concatenate([np.zeros((n, 3)), pair.p])
    indices = np.stack([np.arange(n), n + np.arange(n)], axis=1).astype(np.int32)
    table = take(builder.table, np.repeat([0, 1], n))
    return contact_batch(table, position, np.concatenate([pair.R_A, pair.R_B]), indices)


def deepest(batch: Batch, some: NDArray[np.int_]) -> Array:
    """Lower bounds (n,) on the depth of the deepest pair of parts: no shorter translation separates the objects.

    The depth of polytopes follows from the definition. For round parts it is certified by the kernels, which
    narrow_phase_table.py checks.
    """

    def depth(pair: Pair) -> Array:
        if all(isinstance(shape, POLYTOPES) for shape in (pair.a, pair.b)):
            return least_depth(*pair)
        rows = by_kernels(pair)
        return np.asarray(-rows[:, 0] - rows[:, 10])

    return np.asarray(np.max([depth(pair) for pair in pairs_of(batch, some)], axis=0))


def shortest_parting(batch: Batch, some: NDArray[np.int_]) -> Array:
    """Lengths (n,) of the shortest of many translations of B that certainly separate the objects."""
    n, size = len(some), batch.a.radius + batch.b.radius
    sign = batch.normal[some][:, None] * np.array([[1.0], [-1.0]])
    planar = isinstance(batch.a.parts[0][0], cm.Polygon)
    axes = AXES[AXES[:, 2] == 0.0] if planar else AXES
    u = np.concatenate([axes @ np.swapaxes(R, 1, 2) for R in (batch.R_A[some], batch.R_B[some])] + [sign], axis=1)
    for shape, Rp, _ in batch.b.parts:
        if isinstance(shape, cm.HalfSpace):
            u = np.concatenate([u, -(batch.R_B[some] @ Rp @ shape.normal)[:, None]], axis=1)
    first, last = [], []
    for pair in pairs_of(batch, some):
        # interval of t in which the parts meet, moved by t u: by the planes n . t u <= reach(n), never too short
        low, high = np.full(u.shape[:2], -np.inf), pair.reach(u)
        for normals in planes(pair):
            along, room = u @ np.swapaxes(normals, 1, 2), pair.reach(normals)[:, None]
            with np.errstate(divide="ignore", invalid="ignore"):
                t = room / along
            high = np.minimum(high, np.where(along > 1e-9, t, np.inf).min(axis=-1))
            low = np.maximum(low, np.where(along < -1e-9, t, -np.inf).max(axis=-1))
            low[((np.abs(along) <= 1e-9) & (room < 0.0)).any(axis=-1)] = np.inf
        first.append(low)
        last.append(high)
    low, high = np.stack(first, -1), np.stack(last, -1)
    order = np.argsort(low, axis=-1)
    low, high = np.take_along_axis(low, order, -1), np.take_along_axis(high, order, -1)
    end = np.zeros((n, u.shape[1]))
    for k in range(low.shape[-1]):  # an interval that begins before the end of the last one extends it
        blocked = (low[..., k] <= end + TOUCHING * size) & (high[..., k] > end) & (low[..., k] < high[..., k])
        end = np.where(blocked, high[..., k], end)
    return np.asarray(end.min(axis=1))


def planes(pair: Pair) -> list[Array]:
    """Normals (n, k, 3) of planes that bound the difference of two parts: their faces, and edge crosses of boxes."""
    found = []
    for shape, R, sign in ((pair.a, pair.R_A, 1.0), (pair.b, pair.R_B, -1.0)):
        axes = polytope_axes(shape)
        if isinstance(shape, cm.Box):
            found += [np.swapaxes(R, 1, 2), -np.swapaxes(R, 1, 2)]
        elif axes is not None:
            found.append(sign * axes[0] @ np.swapaxes(R, 1, 2))
        elif not isinstance(shape, cm.HalfSpace):
            found.append(AXES @ np.swapaxes(R, 1, 2))
    if isinstance(pair.a, cm.Box) and isinstance(pair.b, cm.Box):
        edges = pair.R_A.swapaxes(1, 2)[:, :, None], pair.R_B.swapaxes(1, 2)[:, None]
        crossed = unit(np.cross(*edges).reshape(-1, 9, 3))
        found += [crossed, -crossed]
    if isinstance(pair.b, cm.HalfSpace):
        found = [-(pair.R_B @ pair.b.normal)[:, None]]
    return found


def parting_in_plane(batch: Batch, k: int) -> float:
    """Least translation that separates two unions of polygons: the origin's shortest way out of all differences."""
    differences = []
    for (a, *_), (b, *_) in itertools.product(batch.a.parts, batch.b.parts):
        ours, theirs = a.points @ batch.R_A[k, :2, :2].T, batch.p[k, :2] + b.points @ batch.R_B[k, :2, :2].T
        corners = (ours[:, None] - theirs).reshape(-1, 2)
        differences.append(corners[Qhull(corners).vertices])
    start = np.concatenate(differences)
    along = np.concatenate([np.roll(each, -1, axis=0) - each for each in differences])
    first, last = np.full((2, len(start), len(differences)), -np.inf)
    for j, each in enumerate(differences):  # interval of each edge that another difference covers
        side = np.roll(each, -1, axis=0) - each
        normal = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.linalg.norm(side, axis=1)[:, None]
        out = start @ normal.T - (normal * each).sum(axis=1) + 1e-12  # inside by more than round-off
        rate = along @ normal.T
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -out / rate
        first[:, j] = np.where(rate < -1e-15, t, -np.inf).max(axis=1)
        last[:, j] = np.where(rate > 1e-15, t, np.inf).min(axis=1)
        never = ((np.abs(rate) <= 1e-15) & (out >= 0.0)).any(axis=1) | (first[:, j] >= last[:, j])
        first[never, j] = last[never, j] = np.inf
    best = np.inf
    for p, d, begins, ends in zip(start, along, first, last, strict=True):
        free = np.unique(np.clip(np.concatenate([[0.0, 1.0], begins, ends]), 0.0, 1.0))
        foot = np.clip(-(p @ d) / (d @ d), 0.0, 1.0)
        for t in np.append(free, foot):
            if not ((begins < t) & (t < ends)).any():
                best = min(best, float(np.linalg.norm(p + t * d)))
    return best


def fcl_check(batch: Batch) -> list[float]:
    """Differences (m) to FCL's distance, for two single shapes or meshes that are more than 5 % of the size apart."""
    size = batch.a.radius + batch.b.radius
    ours, theirs = (in_fcl(each.given) if isinstance(each.given, Shape) else None for each in (batch.a, batch.b))
    if ours is None or theirs is None or not isinstance(batch.b.given, cm.Mesh):
        return []  # FCL's distance of a mesh and a solid is coarse
    found = []
    for k in np.flatnonzero(batch.distance > 0.05 * size):
        objects = (
            fcl.CollisionObject(ours, fcl.Transform(batch.R_A[k], np.zeros(3))),
            fcl.CollisionObject(theirs, fcl.Transform(batch.R_B[k], batch.p[k])),
        )
        distance = fcl.distance(*objects, fcl.DistanceRequest(), fcl.DistanceResult())
        found.append(abs(float(distance) - batch.distance[k]))
    return found


def row(kinds: tuple[str, str], count: int, done: Callable[[int], None]) -> Row:
    """Measure one row of the table."""
    rng = np.random.default_rng(sum(map(ord, "".join(kinds))))
    planar = kinds[0] == "star"
    refuted = proved = overlapping = checked = 0
    worst, cost, bounds, other = 0.0, 0.0, [], []
    for _ in range(SHAPES):
        a, b = (make_object(kind, rng) for kind in kinds)
        batch, seconds = answers(a, b, count // SHAPES, planar, rng)
        size = a.radius + b.radius
        cost += seconds
        apart, inside = np.flatnonzero(batch.distance > 0.0), np.flatnonzero(batch.distance <= 0.0)
        for some in np.array_split(apart, len(apart) // 500 + 1):
            error, wrong = check_apart(batch, some)
            worst, refuted = max(worst, float(error.max(initial=0.0)) / size), refuted + wrong
        for some in np.array_split(inside, len(inside) // 100 + 1):
            if not len(some):
                continue
            least = deepest(batch, some)
            if planar and kinds[1] != "circle":
                most = np.array([parting_in_plane(batch, k) for k in some])
                least = most
            else:
                most = shortest_parting(batch, some)
            depth, bound, slack = -batch.distance[some], batch.bound[some], 1e-9 * size
            refuted += int(((depth - bound > most + slack) | (depth + bound < least - slack)).sum())
            if not all(isinstance(shape, POLYTOPES) for shape, *_ in (*a.parts, *b.parts)):
                slack = ROUND * size
            proved += int(((depth - bound <= least + slack) & (most <= depth + bound + slack)).sum())
            bounds += (bound / size).tolist()
        other += [each / size for each in fcl_check(batch)]
        overlapping, checked = overlapping + len(inside), checked + len(batch.p)
        done(len(batch.p))
    return Row(
        f"{kinds[0]} – {kinds[1]}", checked, overlapping, worst, refuted, proved, float(np.median(bounds)),
        len(other), max(other, default=np.nan), 1e6 * cost / checked,
    )  # fmt: skip


EVERY = (
    *(("mesh", kind) for kind in ("mesh", "compound", *SOLIDS, "half-space")),
    *(("compound", kind) for kind in ("compound", *SOLIDS, "half-space")),
    *(("star", kind) for kind in ("star", "polygon", "circle")),
)


def main() -> None:
    """Measure all rows and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100_000, help="random pairs for each two kinds (default 100,000)")
    parser.add_argument("--only", default="", help="only rows whose name contains this, as 'mesh – box'")
    parser.add_argument("--json", type=Path, help="also write the rows as JSON, each as soon as it is measured")
    arguments = parser.parse_args()
    every = [kinds for kinds in EVERY if arguments.only in f"{kinds[0]} – {kinds[1]}"]
    count = max(arguments.pairs // SHAPES, 1) * SHAPES
    rows = []
    with progress_bar("concave pairs", len(every) * count) as done:
        for kinds in every:
            rows.append(row(kinds, count, done))
            print(rows[-1], file=sys.stderr, flush=True)
            if arguments.json:
                arguments.json.write_text(json.dumps([each._asdict() for each in rows], indent=1))
    print("| pair | pairs | worst apart | overlapping | bounds refuted | proved | median bound | FCL | worst | µs |")
    print("|---" + "|---:" * 9 + "|")
    for r in rows:
        other = (f"{r.fcl_checked:,}", f"{r.fcl:.0e}") if r.fcl_checked else ("", "")
        cells = [r.pair, f"{r.checked:,}", f"{r.apart:.0e}", f"{r.overlapping:,}", r.refuted, f"{r.proved:,}"]
        cells += [f"{r.bound:.2f}", *other, f"{r.scalar:.0f}"]
        print("| " + " | ".join(str(cell).replace("e-0", "e-") for cell in cells) + " |")


if __name__ == "__main__":
    main()
