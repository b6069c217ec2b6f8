"""Arms among posts, by what is known of their links: their twists, or their joints. Prints rows for motion_models.py.

An arm of seven joints, the example's, moves at constant joint rates, and each joint stops at its limit. The truth is
exact forward kinematics at each tick, by SciPy's rotations, with distances by python-fcl. A post stands where a link
will be, or beside it. The monitor gets one state of each link, along its twist (before), or the plans of
`Robot.motions` too (by joints). A prediction of the arm and the post is false if it is certain and they do not meet
within the horizon; missed if they meet and nothing is predicted; late if contact comes before the predicted time.

    nice python benchmarks/arm_models.py                  # 1,000 encounters
    nice python benchmarks/arm_models.py --count 200
    nice python benchmarks/arm_models.py --steps          # the time of a step among 20 posts
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Final, NamedTuple

import fcl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor.records import STATE, PredictionStatus

Array = NDArray[np.float64]

ARM: Final = Path(__file__).parents[1] / "examples/arm/arm.urdf"
HORIZONS: Final = (0.5, 1.0, 2.0, 4.0)
TICK: Final = 0.01
"""s between two poses of the truth; contact between two is found by halves."""

SECOND: Final = 1_000_000_000
LATE: Final = 1e-3
POST: Final = (0.04, 1.0)
FASTEST: Final = 1.0
"""rad/s of a joint."""

AT_REST: Final = np.eye(1, 13, 6)[0]


class Truth:
    """The arm by SciPy: poses of its links at joint positions, with their shapes for FCL."""

    def __init__(self, robot: cm.Robot) -> None:
        self.robot, self.limits = robot, robot.tree.limits
        table = robot.tree.table
        self._fixed = [Rotation.from_quat(each) for each in np.array(table.quaternion)]
        self.shapes: dict[str, list[Any]] = {}
        for name, parts in zip(robot.links, robot.shapes, strict=True):
            self.shapes[name] = [
                (_fcl_shape(shape), Rotation.from_quat(np.array(at.quaternion)), np.array(at.position))
                for shape, at in parts
            ]

    def joints(self, q: Array, qd: Array, t: float) -> Array:
        """Positions of the joints at a time: each stops at its limit."""
        return np.asarray(np.clip(q + qd * t, self.limits[:, 0], self.limits[:, 1]))

    def poses(self, q: Array) -> list[tuple[Array, Rotation]]:
        """Position and rotation of each link of the tree."""
        table, found = self.robot.tree.table, [(np.zeros(3), Rotation.identity())]
        for i in range(1, len(table.parent)):
            position, rotation = found[table.parent[i]]
            position, rotation = position + rotation.apply(table.position[i]), rotation * self._fixed[i]
            if table.variable[i] >= 0:
                value = table.multiplier[i] * q[table.variable[i]] + table.offset[i]
                if table.kind[i] == 2:
                    position = position + rotation.apply(value * table.axis[i])
                else:
                    rotation = rotation * Rotation.from_rotvec(value * table.axis[i])
            found.append((position, rotation))
        return found

    def gap(self, q: Array, post: Array) -> float:
        """Least distance of a link that moves from the post at a position (m); 0: they touch."""
        other, least = fcl.CollisionObject(fcl.Cylinder(*POST), fcl.Transform(post)), inf
        poses = self.poses(q)
        for name, row in zip(self.robot.links[1:], self.robot.rows[1:], strict=True):
            position, rotation = poses[row]
            for shape, turned, offset in self.shapes[name]:
                at = fcl.Transform((rotation * turned).as_matrix(), position + rotation.apply(offset))
                one = fcl.CollisionObject(shape, at)
                if fcl.collide(one, other, fcl.CollisionRequest(), fcl.CollisionResult()):
                    return 0.0
                least = min(least, fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult()))
        return least

    def first_contact(self, q: Array, qd: Array, post: Array, until: float) -> float:
        """First time at which the arm touches the post (s); infinite: not until then."""
        t, before, fast = 0.0, 0.0, max(float(np.abs(qd).sum()), 1e-9)
        while t <= until:
            gap = self.gap(self.joints(q, qd, t), post)
            if gap <= 0.0:
                break
            before, t = t, t + max(TICK / 4.0, 0.5 * gap / (1.5 * fast))  # no point is faster than that
        else:
            return inf
        while t - before > 1e-5 and t > 0.0:
            middle = 0.5 * (before + t)
            if self.gap(self.joints(q, qd, middle), post) <= 0.0:
                t = middle
            else:
                before = middle
        return t


def _fcl_shape(shape: Any) -> Any:
    if isinstance(shape, cm.Box):
        return fcl.Box(*shape.size)
    if isinstance(shape, cm.Sphere):
        return fcl.Sphere(shape.radius)
    return fcl.Cylinder(shape.radius, shape.length)


class Encounter(NamedTuple):
    """Joints, their rates, the position of the post, and when they touch (s)."""

    q: Array
    qd: Array
    post: Array
    true: float


def encounter(truth: Truth, rng: np.random.Generator) -> Encounter:
    """An arm that will be where the post is at some time, or beside it; it does not touch it now."""
    while True:
        q = rng.uniform(truth.limits[:, 0], truth.limits[:, 1])
        qd = np.append(rng.uniform(-FASTEST, FASTEST, len(q) - 1), 0.0)
        later = truth.poses(truth.joints(q, qd, rng.uniform(0.1, HORIZONS[-1])))
        at = later[int(rng.choice(truth.robot.rows[4:]))][0] + rng.normal(0.0, 0.08, 3)
        post = np.array([at[0], at[1], at[2] + rng.uniform(-0.4, 0.4)])
        if truth.gap(q, post) > 0.0:
            return Encounter(q, qd, post, truth.first_contact(q, qd, post, HORIZONS[-1]))


@dataclass
class Watched:
    """A monitor of the arm alone; its links allow each other."""

    robot: cm.Robot
    horizon: float

    def __post_init__(self) -> None:
        self.monitor = cm.Monitor(cm.Profile.named("balanced").replace(horizon=self.horizon))
        self.names = self.robot.links[1:]
        for k, parts in enumerate(self.robot.shapes[1:]):
            self.monitor.add(k + 1, list(parts), group=1, mask=2)

    def post(self, number: int, place: Array) -> None:
        """Put up a post."""
        self.monitor.add(100 + number, cm.Cylinder(*POST), static=True, pose=cm.Pose(place), group=2, mask=1)

    def states(self, q: Array, qd: Array) -> NDArray[np.void]:
        """The states of all links."""
        poses, twists = self.robot.states(np.stack([q, qd], axis=1), AT_REST)
        rows, at = np.zeros(len(self.names), STATE), self.robot.rows[1:]
        rows["id"] = np.arange(len(at)) + 1
        rows["position"], rows["quaternion"] = poses[at, :3], poses[at, 3:]
        rows["linear"], rows["angular"] = twists[at, :3], twists[at, 3:]
        return rows

    def follow(self, q: Array, qd: Array, stamp: int) -> None:
        """Let the links follow the joints."""
        plans = self.robot.motions(q, qd, 1.25 * self.horizon, then="go on")
        for k, name in enumerate(self.names):
            self.monitor.follow(k + 1, plans[name], stamp_ns=stamp)


def score(robot: cm.Robot, encounters: list[Encounter], by_joints: bool, horizon: float) -> str:
    """The cells of a row: true ones; false, missed and late shares; p99 of the time by which a prediction is early."""
    certain = wrong = true = missed = late = open_ = 0
    early: list[float] = []
    for it in encounters:
        watched = Watched(robot, horizon)
        watched.post(0, it.post)
        if by_joints:
            watched.follow(it.q, it.qd, SECOND)
        rows = watched.monitor.step(SECOND, watched.states(it.q, it.qd)).predictions
        is_certain = bool((rows["status"] == PredictionStatus.HIT).any())
        certain += is_certain
        wrong += is_certain and it.true > horizon + LATE
        open_ += len(rows) > 0 and not is_certain and it.true > horizon + LATE
        if it.true <= horizon - LATE:
            true += 1
            missed += not len(rows)
            if len(rows):
                lower = float(rows["lower"].min())
                late += lower > it.true + LATE
                early.append(it.true - lower)
    shares = (wrong / max(certain, 1), missed / max(true, 1), late / max(true - missed, 1))
    cells = " | ".join(f"{100 * share:.1f} %" if share else "0" for share in shares)
    worst = f"{1e3 * float(np.quantile(early, 0.99)):.1f}" if early else "–"
    doubt = f"{100 * open_ / max(certain + open_, 1):.1f} %"
    return f"{true} | {cells} | {worst} | {doubt}"


def table(robot: cm.Robot, count: int, seed: int) -> None:
    """Print the rows of arms."""
    truth, rng = Truth(robot), np.random.default_rng(seed)
    encounters = [encounter(truth, rng) for _ in range(count)]
    head = (
        "| What moves | its states say | horizon (s) | true | false | missed | late | early p99 (ms) | open, not true |"
    )
    print(f"{head}\n|---|---|---|---|---|---|---|---|---|")
    for by_joints in (False, True):
        for horizon in HORIZONS:
            cells = score(robot, encounters, by_joints, horizon)
            name = "joints" if by_joints else "twist of each link"
            print(f"| arm of seven joints, posts | {name} | {horizon:g} | {cells} |", flush=True)


def steps(robot: cm.Robot, count: int, seed: int) -> None:
    """Print the time of a step of an arm that changes its rates all the time, among 20 posts (processor time)."""
    rng = np.random.default_rng(seed)
    for by_joints in (False, True):
        watched = Watched(robot, 2.0)
        for k in range(20):
            angle, r = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.45, 0.9)
            watched.post(k, np.array([r * np.cos(angle), r * np.sin(angle), 0.5]))
        q0, swing = np.array([0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.01]), rng.uniform(-1.0, 1.0, 8)
        swing[7] = 0.0
        planned, taken = [], []
        for k in range(count):
            t = 0.02 * k
            q, qd = q0 + 0.5 * swing * np.sin(2.0 * t), swing * np.cos(2.0 * t)
            stamp, rows = SECOND + k * SECOND // 50, watched.states(q, qd)
            began = time.process_time()
            if by_joints:
                watched.follow(q, qd, stamp)
            middle = time.process_time()
            watched.monitor.step(stamp, rows)
            planned.append(middle - began)
            taken.append(time.process_time() - middle)
        name = "joints" if by_joints else "twists"
        print(f"{name}: step {_text(taken)}; motions and follow {_text(planned)}", flush=True)


def _text(seconds: list[float]) -> str:
    """Median, 5 % and 99 % quantile in ms, without the first steps."""
    least, middle, most = 1e3 * np.quantile(seconds[10:], (0.05, 0.5, 0.99))
    return f"{middle:.2f} ms (5 %: {least:.2f}, 99 %: {most:.2f})"


def main() -> int:
    """Run as a program; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="encounters, or steps (default: 1000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", action="store_true", help="measure the time of steps")
    args = parser.parse_args()
    robot = cm.Robot(ARM, ARM.with_suffix(".srdf"))
    (steps if args.steps else table)(robot, args.count, args.seed)
    return 0


if __name__ == "__main__":
    sys.exit(main())
