"""Check planned motions against samples: poses by SciPy's splines, rotations and exponentials, overlaps by FCL.

    nice python benchmarks/plan_oracle.py                    # 4,000 pairs
    nice python benchmarks/plan_oracle.py --pairs 200        # a quick look

Random bodies (spheres, boxes, capsules, hulls, meshes, compounds, clouds, half-spaces) follow random plans along lines,
arcs or curves, with stops, that begin in the past or in the future, end before the horizon, and go on in each way; or
one of them follows a Motion. The scenes are as large as a room, as a grain of dust or as a town, hours or milliseconds
long, and some are 1,000 km from the origin. A body that overlaps by more than 1e-6 of the scene at a sampled time is
missed if `time_of_impact` is clear, late if its lower end is later, and lost if the time is in no interval of
`impacts`. A hit is false if the bodies, larger by some 1e-6 of the scene, are apart at its upper end, and so is a time
within an interval, where a curve may be off its pieces by their tubes. The pair swapped, and turned as a whole, has to
meet at the same time. Exit code 1: an answer is wrong.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from multiprocessing import get_context
from typing import Any, NamedTuple

import fcl
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm, logm
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation, Slerp

import collision_monitor as cm
from collision_monitor.cli.output.progress import progress_bar

Array = NDArray[np.float64]
WRONG = ("missed", "late", "lost", "false hit", "false interval", "swapped", "moved")
SAMPLES = 150
"""Times at which each pair is sampled, and some more shortly before the stated times."""

DEEP = 1e-6
"""In scenes: how deep a sampled overlap is that counts, and by how much a body grows whose contact is in doubt."""

UNIT = Rotation.identity()
RING = trimesh.creation.torus(0.4, 0.15, major_sections=10, minor_sections=6)
RING_NORMALS = np.array(RING.vertex_normals)


class Piece(NamedTuple):
    """A convex solid or a ring, with its numbers, at a position in a body."""

    kind: str
    numbers: Any
    at: Any = (0.0, 0.0, 0.0)

    def shape(self, scale: float) -> Any:
        """The shape of the library."""
        n = np.asarray(self.numbers) * scale
        if self.kind == "half-space":
            return cm.HalfSpace(self.numbers[:3], n[3])
        if self.kind == "ring":
            return cm.Mesh(RING.vertices * scale, RING.faces)
        kinds = {"sphere": cm.Sphere, "box": cm.Box, "capsule": cm.Capsule, "hull": cm.ConvexHull}
        return kinds[self.kind](*n) if self.kind in ("sphere", "capsule") else kinds[self.kind](n)

    def geometry(self, grow: float) -> Any:
        """The shape of FCL, larger by at least that, or smaller."""
        n = np.asarray(self.numbers)
        if self.kind == "sphere":
            return fcl.Sphere(n[0] + grow)
        if self.kind == "box":
            return fcl.Box(*(n + 2.0 * grow))
        if self.kind == "capsule":
            return fcl.Capsule(n[0] + grow, n[1])
        if self.kind == "half-space":
            return fcl.Halfspace(n[:3], n[3] + grow)
        if self.kind == "ring":
            model = fcl.BVHModel()
            model.beginModel(len(RING.faces), len(RING.vertices))
            model.addSubModel(RING.vertices + 1.2 * grow * RING_NORMALS, RING.faces)
            model.endModel()
            return model
        hull = ConvexHull(n)
        centre = n[hull.vertices].mean(axis=0)
        least = -(hull.equations[:, :3] @ centre + hull.equations[:, 3]).max()
        points = centre + (n - centre) * (1.0 + grow / least)
        faces = [
            face if np.cross(n[face[1]] - n[face[0]], n[face[2]] - n[face[0]]) @ plane[:3] > 0 else face[::-1]
            for face, plane in zip(hull.simplices, hull.equations, strict=True)
        ]
        return fcl.Convex(points, len(faces), np.concatenate([[3, *face] for face in faces]).astype(np.int32))


class Body:
    """A body as the library has it, and as FCL has it: smaller, larger, or as it is."""

    def __init__(self, name: str, pieces: list[Piece], scale: float) -> None:
        self.name, self.pieces, self.scale = name, pieces, scale
        parts = [(piece.shape(scale), cm.Pose(np.asarray(piece.at) * scale)) for piece in pieces]
        self.shape: Any = parts if name == "compound" else parts[0][0]
        if name == "cloud":
            points = np.array([piece.at for piece in pieces], float)
            self.shape = cm.Points(points * scale, pieces[0].numbers[0] * scale)
        self._objects: dict[float, list[Any]] = {}

    def objects(self, grow: float) -> list[Any]:
        """FCL's objects of the body, each with its position in it."""
        if grow not in self._objects:
            self._objects[grow] = [(fcl.CollisionObject(each.geometry(grow)), each.at) for each in self.pieces]
        return self._objects[grow]


def random_body(rng: np.random.Generator, kind: str, scale: float) -> Body:
    """A body of a kind, some tenths of a scene large."""
    own: dict[str, list[Piece]] = {
        "sphere": [Piece("sphere", [rng.uniform(0.1, 0.5)])],
        "box": [Piece("box", rng.uniform(0.05, 1.0, 3))],
        "capsule": [Piece("capsule", [rng.uniform(0.05, 0.3), rng.uniform(0.2, 1.0)])],
        "hull": [Piece("hull", rng.normal(0.0, 0.3, (12, 3)))],
        "ring": [Piece("ring", [1.0])],
        "compound": [Piece("box", (0.8, 0.2, 0.2), (0.3, 0, 0)), Piece("sphere", [0.2], (-0.4, 0.3, 0.1)),
                     Piece("capsule", [0.1, 0.6], (0, -0.3, 0.2))],
        "cloud": [Piece("sphere", [0.05], at) for at in rng.normal(0.0, 0.3, (8, 3))],
    }  # fmt: skip
    if kind == "half-space":
        normal = rng.normal(size=3)
        own[kind] = [Piece(kind, [*(normal / np.linalg.norm(normal)), rng.uniform(-1.0, -0.3)])]
    return Body(kind, own[kind], scale)


def overlap(a: Body, b: Body, poses: tuple[Array, Rotation, Array, Rotation], grow: float) -> bool:
    """Whether two bodies overlap when both have grown by that, in scenes; of rings the surfaces."""
    p_a, r_a, p_b, r_b = poses
    R = r_a.as_matrix(), r_b.as_matrix()
    for geometry, at in a.objects(grow):
        geometry.setTransform(fcl.Transform(R[0], R[0] @ at))
        for other, other_at in b.objects(grow):
            other.setTransform(fcl.Transform(R[1], R[1] @ other_at + (p_b - p_a)))
            if fcl.collide(geometry, other, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
                return True
    return False


def _turns_around(point: Array) -> bool:
    """Whether the ring's triangles turn around a point once, by their solid angles (van Oosterom, Strackee, 1983)."""
    a, b, c = np.moveaxis(np.array(RING.triangles) - point, 1, 0)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", *each) for each in ((a, b), (b, c), (c, a))]
    under = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return abs(float(np.arctan2(over, under).sum())) > np.pi


def is_within_ring(a: Body, b: Body, poses: tuple[Array, Rotation, Array, Rotation]) -> bool:
    """Whether some point of one is inside the ring that the other is, or the ring's first corner inside the other."""
    p_a, r_a, p_b, r_b = poses
    for ring, other, p, r, q, s in ((a, b, p_a, r_a, p_b, r_b), (b, a, p_b, r_b, p_a, r_a)):
        if ring.name == "ring":
            points = np.array([piece.at for piece in other.pieces], float)
            corner = RING.vertices[:1] if other.name == "ring" else points
            local = r.inv().apply(s.apply(corner) + q - p)
            if any(_turns_around(point) for point in local):
                return True
            corner_of_ring = fcl.CollisionObject(fcl.Sphere(1e-6), fcl.Transform(r.apply(RING.vertices[0]) + p - q))
            for geometry, at in other.objects(0.0):
                geometry.setTransform(fcl.Transform(s.as_matrix(), s.as_matrix() @ at))
                if fcl.collide(geometry, corner_of_ring, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
                    return True
    return False


@dataclass
class Plan:
    """A plan in scenes and parts of the horizon, or a Motion, and its poses by other means than the library's."""

    between: str
    then: str
    times: Array
    position: Array
    rotation: Rotation
    velocity: Array
    turning: Array
    change: float = 0.0  # of the velocity, in parts of it per second
    stops: bool = False

    @property
    def until(self) -> float:
        """When it ends to be known."""
        return float(self.times[-1]) if self.then == "unknown" else inf

    def motion(self, scale: float, second: float, to: Rotation = UNIT, off: Any = (0.0, 0.0, 0.0)) -> Any:
        """What the library takes: lengths in m, times in s; moved by a rotation and an offset (m)."""
        position, rotation = to.apply(self.position) * scale + off, to * self.rotation
        poses = np.concatenate([position, rotation.as_quat()], axis=1)
        if self.between in ("world", "body"):
            v, w = self.velocity[0] * scale / second, self.turning / second
            a = v * self.change / second
            turned = self.rotation[0].inv() if self.between == "body" else to
            return cm.Motion(poses[0], *(turned.apply(each) for each in (v, w, a)), self.between, self.stops)  # type: ignore[arg-type]
        twists = to.apply(self.velocity) * scale / second if self.between == "curve" else None
        return cm.Trajectory(self.times * second, poses, twists, between=self.between, then=self.then)  # type: ignore[arg-type]

    def poses(self, t: Array) -> tuple[Array, Rotation]:
        """Positions (n, 3) and rotations at times (n,)."""
        if self.between in ("world", "body"):
            return self._course(t)
        k = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        t = np.maximum(t, self.times[0])
        t = t if self.then == "go on" else np.minimum(t, self.times[-1])
        s = (t - self.times[k]) / (self.times[k + 1] - self.times[k])
        if self.between == "arc":
            return self._screws(k, s)
        inside, beyond = np.minimum(t, self.times[-1]), np.maximum(t - self.times[-1], 0.0)[:, None]
        last = self.times[-1] - self.times[-2]
        whole = (self.rotation[-1] * self.rotation[-2].inv()).as_rotvec() / last
        rotation = Rotation.from_rotvec(beyond * whole) * Slerp(self.times, self.rotation)(inside)
        if self.between == "curve":
            spline = CubicHermiteSpline(self.times, self.position, self.velocity)
            return spline(inside) + beyond * self.velocity[-1], rotation
        steps = np.diff(self.position, axis=0)
        return self.position[k] + s[:, None] * steps[k], rotation

    def _screws(self, k: NDArray[np.int_], s: Array) -> tuple[Array, Rotation]:
        X = np.tile(np.eye(4), (len(self.times), 1, 1))
        X[:, :3, :3], X[:, :3, 3] = self.rotation.as_matrix(), self.position
        logs = np.array([np.real(logm(np.linalg.inv(a) @ b)) for a, b in pairwise(X)])
        found = X[k] @ expm(s[:, None, None] * logs[k])
        return found[:, :3, 3], Rotation.from_matrix(found[:, :3, :3])

    def _course(self, t: Array) -> tuple[Array, Rotation]:
        c = self.change
        t = np.minimum(t, -1.0 / c) if self.stops and c < 0.0 else t
        s = t + 0.5 * c * t * t
        v, w = self.velocity[0], self.turning
        if self.between == "world":
            turned = s if self.stops and c < 0.0 else t
            return self.position[0] + s[:, None] * v, Rotation.from_rotvec(turned[:, None] * w) * self.rotation[0]
        twist = np.zeros((4, 4))
        twist[:3, :3], twist[:3, 3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]], v
        found = expm(s[:, None, None] * twist)  # about the first position, in axes of the world
        rotation = Rotation.from_matrix(found[:, :3, :3]) * self.rotation[0]
        return self.position[0] + found[:, :3, 3], rotation


def random_plan(rng: np.random.Generator, turns: bool, is_motion: bool) -> Plan:
    """A plan through a scene, for about as long as the horizon, 3."""
    count = int(rng.integers(2, 9))
    steps = rng.uniform(0.1, 0.9, count)
    steps[:-1][rng.random(count - 1) < 0.1] *= 1e-5  # not the last, which goes on: round-off would grow with it
    times = np.cumsum(steps) + rng.choice([-1.0, -0.2, 0.5])
    moved = rng.normal(0.0, 0.8, (count, 3)) * np.minimum(steps * 5.0, 1.0)[:, None]
    stays = rng.random(count) < 0.2
    moved[stays] = 0.0
    position = rng.normal(0.0, 0.6, 3) + np.cumsum(moved, axis=0)
    angles = np.clip(rng.normal(0.0, rng.choice([0.1, 0.7]), (count, 3)), -1.7, 1.7)
    angles *= turns * np.minimum(steps * 5.0, 1.0)[:, None]
    angles[stays | (rng.random(count) < 0.2)] = 0.0
    rotation = [Rotation.random(rng=rng) if turns or rng.random() < 0.5 else UNIT]
    for each in angles[1:]:
        rotation.append(Rotation.from_rotvec(each) * rotation[-1])
    velocity = rng.normal(size=(count, 3)) * rng.choice([0.3, 2.0])
    velocity[rng.random(count) < 0.2] = 0.0
    between = str(rng.choice(["world", "body"] if is_motion else ["straight", "arc", "curve"]))
    then = "rest" if is_motion else str(rng.choice(["rest", "go on", "unknown"]))
    plan = Plan(between, then, times, position, Rotation.concatenate(rotation), velocity, 0.5 * turns * velocity[-1])
    if is_motion and np.any(velocity[0]):
        plan.stops = rng.random() < 0.5
        plan.change = float(rng.choice([-0.7, -0.2, 0.0, 0.4]))
        if plan.between == "world" and not turns:
            plan.between = str(rng.choice(["world", "body"]))
    return plan


class Scene(NamedTuple):
    """Two bodies with plans, and how large and long it is."""

    a: Body
    b: Body
    plans: tuple[Plan, Plan]
    scale: float  # m
    second: float  # s
    off: Array  # m
    separation: float  # scenes
    horizon: float  # seconds of the scene

    def arguments(self, to: Rotation = UNIT, off: Any = None) -> tuple[Any, Any, Any, Any]:
        """What the library takes."""
        off = self.off if off is None else off
        one, other = (plan.motion(self.scale, self.second, to, off) for plan in self.plans)
        return self.a.shape, one, self.b.shape, other

    def at(self, t: Array) -> list[tuple[Array, Rotation, Array, Rotation]]:
        """Poses of both at times (n,) in seconds of the scene."""
        (p_a, r_a), (p_b, r_b) = (plan.poses(t) for plan in self.plans)
        return [(p_a[k], r_a[k], p_b[k], r_b[k]) for k in range(len(t))]

    def touch(self, t: Array, grow: float) -> NDArray[np.bool_]:
        """Whether both overlap at times when they have grown by that, in seconds of the scene and scenes."""
        half = 0.5 * self.separation + grow
        found = [overlap(self.a, self.b, each, half) for each in self.at(t)]
        return np.array(found, bool)


KINDS = ("sphere", "box", "capsule", "hull", "ring", "compound", "cloud", "half-space")


def random_scene(rng: np.random.Generator) -> Scene:
    """One pair of bodies with their plans."""
    scale, second, off = 1.0, 1.0, np.zeros(3)
    where = rng.random()
    if where < 0.1:
        scale = 1e-6
    elif where < 0.2:
        scale = 1e3
    elif where < 0.3:
        off = rng.normal(size=3) * 1e6
    if rng.random() < 0.2:
        second = float(rng.choice([1e-3, 1e3])) if scale <= 1.0 else 1e3
    kinds = list(rng.choice(KINDS, 2))
    if kinds[0] == kinds[1] == "half-space":
        kinds[0] = "box"
    round_ones = ("sphere", "capsule", "cloud")
    separation = 0.1 if rng.random() < 0.5 and all(kind in round_ones for kind in kinds) else 0.0
    is_motion = rng.random(2) < 0.25
    if is_motion.all():
        is_motion[1] = False
    one, other = (random_plan(rng, kinds[k] != "half-space", bool(is_motion[k])) for k in range(2))
    for plan in (one, other):
        if plan.change > second:  # a body that gains speed so fast does not stay on its arc
            plan.change = 0.0
    bodies = [random_body(rng, kind, scale) for kind in kinds]
    return Scene(*bodies, (one, other), scale, second, off, separation, float(rng.choice([0.5, 3.0])))


def check(scene: Scene, rng: np.random.Generator) -> Counter[str]:
    """Compare the answers for a scene with samples of it."""
    counts: Counter[str] = Counter(pairs=1)
    length, second, horizon = scene.scale, scene.second, scene.horizon
    given, long, separation = scene.arguments(), horizon * second, scene.separation * length
    impact = cm.time_of_impact(*given, long, 1e-6 * length, separation)
    found = cm.impacts(*given, long, 1e-7 * length, separation)
    counts[impact.status] += 1
    counts["intervals"] += len(found)
    until = min(horizon, *(plan.until for plan in scene.plans))
    lower = impact.lower / second
    ends = [t / second for each in found for t in (each.entry[0], each.exit[1]) if 0.0 < t < inf]
    near = [
        t + sign * part for t in (lower, *ends) if t < inf for part in 0.5 ** np.arange(3, 21, 3) for sign in (-1, 1)
    ]
    t = np.concatenate([np.linspace(0.0, until, SAMPLES), rng.uniform(0.0, max(until, 0.0), SAMPLES // 3), near])
    t = np.unique(t[(t >= 0.0) & (t <= until)])
    deep = t[scene.touch(t, -DEEP)]
    counts["overlaps"] += len(deep)
    off = 1e-9 * horizon
    if len(deep):
        counts["missed"] += impact.status == "clear"
        counts["late"] += lower < inf and bool((deep < lower - off).any())
    allowed = np.zeros(len(deep), bool)
    for each in found:
        allowed |= (deep >= each.entry[0] / second - off) & (deep <= each.exit[1] / second + off)
    counts["lost"] += len(found) < 100 and not allowed.all()
    if impact.upper < inf:
        counts["false hit"] += not _is_contact(scene, impact.upper / second)
    inner = [
        each.entry[1] + part * (each.exit[0] - each.entry[1])
        for each in found
        for part in (0.0, *rng.random(3), 1.0)
        if each.entry[1] < inf
    ]
    tubes = sum(float(each.tubes.max()) for each in given[1::2] if isinstance(each, cm.Trajectory))
    counts["false interval"] += not all(_is_contact(scene, each / second, 2.0 * tubes / length) for each in inner)
    if not (scene.off.any() and "half-space" in (scene.a.name, scene.b.name)):  # whose offset is from the origin
        to = Rotation.random(rng=rng)
        moved = cm.time_of_impact(*scene.arguments(to, to.apply(scene.off)), long, 1e-6 * length, separation)
        counts["moved"] += not _agree(impact, moved, long)
    swapped = cm.time_of_impact(*given[2:], *given[:2], long, 1e-6 * length, separation)
    counts["swapped"] += not _agree(impact, swapped, long)
    return counts


def _is_contact(scene: Scene, t: float, tubes: float = 0.0) -> bool:
    times = np.array([t])
    return bool(scene.touch(times, 4.0 * DEEP + tubes)[0]) or is_within_ring(scene.a, scene.b, scene.at(times)[0])


def _agree(one: cm.Impact, other: cm.Impact, horizon: float) -> bool:
    """Whether two answers can be of one impact; one that is unresolved agrees with all that come later."""
    for first, second in ((one, other), (other, one)):
        if first.upper < inf and not second.lower <= first.upper + 1e-9 * horizon:
            return False
    return True


def check_pair(seed: int, number: int) -> tuple[int, str, Counter[str]]:
    """Check one pair; return its number, what it is, and the counts."""
    rng = np.random.default_rng((seed, number))
    scene = random_scene(rng)
    plans = " and ".join(f"{plan.between}, then {plan.then}" for plan in scene.plans)
    size = f"{scene.scale:g} m, {scene.second:g} s, {np.abs(scene.off).max():.0f} m off"
    return number, f"{scene.a.name}, {scene.b.name}; {plans}; {size}", check(scene, rng)


def main() -> int:
    """Print the counts; return 1 if an answer is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    args = parser.parse_args()
    os.environ["NUMBA_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    total: Counter[str] = Counter()
    with (
        progress_bar("plan oracle", args.pairs) as done,
        ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool,
    ):
        for task in as_completed([pool.submit(check_pair, args.seed, k) for k in range(args.pairs)]):
            number, what, counts = task.result()
            total += counts
            for name in WRONG:
                if counts[name]:
                    print(f"pair {number}: {name}; {what}", file=sys.stderr)
            done(1)
    names = ("pairs", "hit", "unresolved", "clear", "intervals", "overlaps", *WRONG)
    print(", ".join(f"{name} {total[name]}" for name in names))
    return int(any(total[name] for name in WRONG))


if __name__ == "__main__":
    sys.exit(main())
