"""Measure the gate: randomised executions of an arm and of a base among obstacles, with real nodes over DDS.

A simulated controller follows what the gate passes; a monitor with a sources file reads the joints of the arm, the
odometry of the base, and an obstacle. Half of the executions are of an arm with eleven links (a joint trajectory of 2
to 3.5 s through random postures), half of a base with a load (a path of 2.5 m). While a plan is executed, an obstacle
appears on its way, crosses it, stands beside it, or is not there at all. The truth is the simulation's own:
distances of the shapes at 40 Hz, by `cm.contact`. A stop is needless where no obstacle comes within 0.3 m of the
planned way.

    python benchmarks/gate_executions.py --count 300 --json gate.json
    python benchmarks/gate_executions.py --quick             # ten executions
    python benchmarks/gate_executions.py --read a.json b.json      # the table of earlier runs

Runs side by side need a ROS_DOMAIN_ID each.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from gate_nodes import PLACE, URDF, GateNodes

import collision_monitor as cm

STANDS: Final = 0.01  # m/s
TICK: Final = 0.025  # s
PATIENCE: Final = 600.0  # s for the nodes; a first start compiles kernels
HOLDS: Final = 0.3  # s that an obstacle stays after the robot stands
SEEN: Final = 0.02  # m
IN_TIME: Final = 1.0
"""s: an encounter that comes sooner than this after the appearance is drawn again, as nothing can stop for it: 0.3 s of
reaction, 0.5 s of braking, and the delays of the monitor and of the controller."""

MARGIN: Final = 0.05  # m
NEEDED: Final = 0.3  # m: an obstacle that comes no nearer to the planned way needs no stop
LATE: Final = 0.15  # s: a simulation that was late by more did not move in real time
AGAIN: Final = 5
RESUMES: Final = 0.3
"""Share of the stops after which the obstacle goes away and the plan is completed."""

SCENES: Final = ("appears", "crosses", "beside", "empty")
FAR: Final = np.array([30.0, 0.0, 0.5])
CRATE: Final = cm.Cylinder(0.1, 2.0)
WAY: Final = 2.5  # m
CART, LOAD = cm.Cylinder(0.3, 0.4), cm.Box((0.3, 0.9, 0.3))


@dataclass
class Outcome:
    """What an execution showed. Times in s, lengths in m, speeds in m/s; None: it did not come to it.

    told: from the appearance (or from when the obstacle starts to cross) to the first message of the gate that slows
    the robot down. stood: to its standstill. contact: the largest speed of the robot's nearest object while the
    surfaces touch. near: the least distance while the robot moves. planned: the least distance of the obstacle from
    all of the planned way. needless: it was slowed or stopped although `planned` is above NEEDED. ended: whether the
    plan was completed. resumed: whether it went on after the obstacle was gone.
    """

    robot: str
    scene: str
    told: float | None = None
    stood: float | None = None
    contact: float = 0.0
    near: float = np.inf
    planned: float = np.inf
    needless: bool = False
    ended: bool = False
    stopped: bool = False
    said: str = ""
    lag: float = 0.0
    admitted: bool = False


class ArmRobot:
    """The arm of the example with its controller."""

    name = "arm"

    def __init__(self, nodes: GateNodes, generator: np.random.Generator) -> None:
        self._nodes, self._robot = nodes, cm.Robot(URDF)
        self._limits = np.clip(self._robot.tree.limits, -2.5, 2.5)
        self._generator = generator
        self.points: list[Any] = []
        self.q, self.qd = PLACE.copy(), np.zeros(8)
        self._shapes = self.shapes(self.q)

    def plan(self) -> None:
        """Draw a joint trajectory through one posture to another one, at rest at both ends."""
        g = self._generator
        self.seconds = float(g.uniform(2.0, 3.5))
        middle, end = (self._posture() for _ in range(2))
        speed = (end - self.q) / self.seconds
        times = [0.5 * self.seconds, self.seconds]
        self.points = [(times[0], middle, 0.5 * speed), (times[1], end, np.zeros(8))]

    def _posture(self) -> Any:
        q = PLACE + self._generator.uniform(-0.7, 0.7, 8) * [1.6, 0.5, 0.6, 0.6, 0.6, 0.6, 0.6, 0.0]
        return np.clip(q, self._limits[:, 0], self._limits[:, 1])

    def send(self) -> None:
        """Give the plan to the gate."""
        self._nodes.send_trajectory(self.points)

    def way(self, count: int = 40) -> list[list[tuple[Any, cm.Pose]]]:
        """Shapes with their places along the plan."""
        from scipy.interpolate import CubicHermiteSpline

        times = [0.0, *(t for t, _, _ in self.points)]
        spline = CubicHermiteSpline(
            times, [self.q, *(p for _, p, _ in self.points)], [0 * self.q, *(v for _, _, v in self.points)]
        )
        return [self.shapes(spline(t)) for t in np.linspace(0.0, self.seconds, count)]

    def shapes(self, q: Any) -> list[tuple[Any, cm.Pose]]:
        """Shapes of the links that move, with their places."""
        poses = self._robot.states(np.stack([q, np.zeros(8)], axis=1), np.eye(1, 13, 6)[0])[0]
        found = []
        for row, name, shapes in zip(self._robot.rows, self._robot.links, self._robot.shapes, strict=True):
            if name != "base":
                where = cm.Pose.of_numbers(poses[row].tolist())
                found += [(shape, where @ at) for shape, at in shapes]
        return found

    def now(self) -> list[tuple[Any, cm.Pose]]:
        """Shapes with their places now."""
        return self._shapes

    def advance(self, now: float, dt: float) -> float:
        """Move, and return the largest speed of a point of it (m/s)."""
        before = self._shapes
        self.q, self.qd = self._nodes.controller.at(now)
        self._shapes = self.shapes(self.q)
        moved = [np.linalg.norm(a[1].position - b[1].position) for a, b in zip(before, self._shapes, strict=True)]
        return float(max(moved)) / dt

    def state(self) -> None:
        """Tell the monitor where it is."""
        self._nodes.joints(self.q, self.qd)

    def is_done(self) -> bool:
        """Whether it is at the end of its plan."""
        return bool(np.abs(self.q - self.points[-1][1]).max() < 1e-3)

    def stop(self) -> None:
        """End the plan."""
        self._nodes.send_trajectory([])


class BaseRobot:
    """A base with a load that follows a path; its follower drives along x at a constant speed."""

    name = "base"

    def __init__(self, nodes: GateNodes, generator: np.random.Generator) -> None:
        self._nodes, self._generator = nodes, generator
        self.x = self.v = self.begin = 0.0
        self.speed, self.latency = 0.0, 0.05

    def plan(self) -> None:
        """Draw the speed of a drive."""
        self.speed = float(self._generator.uniform(0.5, 1.0))
        self.begin = self.x
        self.seconds = WAY / self.speed
        self.latency = float(self._generator.uniform(0.02, 0.08))

    def send(self) -> None:
        """Give the plan to the gate."""
        self._nodes.send_path(self.begin, self.begin + WAY)

    def shapes(self, x: float) -> list[tuple[Any, cm.Pose]]:
        """Shapes with their places."""
        return [(CART, cm.Pose((x, 20.0, 0.25))), (LOAD, cm.Pose((x, 20.0, 0.65)))]

    def way(self, count: int = 40) -> list[list[tuple[Any, cm.Pose]]]:
        """Shapes with their places along the plan."""
        return [self.shapes(float(x)) for x in np.linspace(self.begin, self.begin + WAY, count)]

    def now(self) -> list[tuple[Any, cm.Pose]]:
        """Shapes with their places now."""
        return self.shapes(self.x)

    def advance(self, now: float, dt: float) -> float:
        """Move, and return the speed (m/s)."""
        told = self._nodes.command(now - self.latency)
        self.v += float(np.clip(told - self.v, -2.0 * dt, 1.0 * dt))
        self.x += self.v * dt
        return abs(self.v)

    def state(self) -> None:
        """Tell the monitor where it is, and the gate how the follower drives."""
        self._nodes.odometry(self.x, self.v)
        if self._nodes.used == self.name:
            self._nodes.drive(min(self.speed, max(0.0, 2.0 * (self.begin + WAY - self.x))))

    def is_done(self) -> bool:
        """Whether it is at the end of its plan."""
        return self.x > self.begin + WAY - 0.1

    def stop(self) -> None:
        """End the plan."""
        self._nodes.send_path(0.0, None)


class Execution:
    """One execution: drawn from the generator, and played in real time."""

    def __init__(self, generator: np.random.Generator, robot: Any, nodes: GateNodes, scene: str) -> None:
        self._robot, self._nodes, self._scene, self._generator = robot, nodes, scene, generator
        self.outcome = Outcome(robot.name, scene)
        self._crate, self._walk = FAR.copy(), np.zeros(3)
        self._now, self._speed = time.monotonic(), 0.0
        self._met: float | None = None

    def _step(self) -> None:
        """Let a tick pass."""
        time.sleep(max(self._now + TICK - time.monotonic(), 0.0005))
        until = time.monotonic()
        dt = until - self._now
        self.outcome.lag = max(self.outcome.lag, dt)
        self._speed = self._robot.advance(until, dt)
        self._crate = self._crate + self._walk * dt
        self._now = until
        for each in self._nodes.robots.values():
            each.state()
        self._nodes.crate(self._crate, self._walk)
        self._watch()

    def _gap(self, shapes: Any) -> float:
        at = cm.Pose(self._crate)
        near = [(s, p) for s, p in shapes if np.linalg.norm((p.position - self._crate)[:2]) < 2.0]
        return min((cm.contact(s, p, CRATE, at).signed_distance for s, p in near), default=np.inf)

    def _watch(self) -> None:
        outcome = self.outcome
        if self._met is None or np.array_equal(self._crate, FAR):
            return
        gap = self._gap(self._robot.now())
        if self._speed <= STANDS:
            if gap < SEEN:  # a person who walks does not walk into a robot that stands
                self._walk = np.zeros(3)
            return
        outcome.near = min(outcome.near, gap)
        if gap <= 0.0:
            outcome.contact = max(outcome.contact, self._speed)

    def _until(self, condition: Callable[[], Any], timeout: float) -> bool:
        end = self._now + timeout
        while self._now < end:
            self._step()
            if condition():
                return True
        return False

    def _place(self, way: list[Any], now: float) -> None:
        """Draw where the obstacle is: on the way, toward it, or beside it. now: share of the plan that is over."""
        outcome = self.outcome
        for _ in range(60 if self._scene != "empty" else 0):
            self._draw(way)
            if self._is_fair(way, now):
                break
        else:
            outcome.scene, self._crate, self._walk = "empty", FAR.copy(), np.zeros(3)
        outcome.planned = min(self._gap(each) for each in way) if outcome.scene != "crosses" else 0.0

    def _draw(self, way: list[Any]) -> None:
        g = self._generator
        shapes = way[int(len(way) * g.uniform(0.4, 0.95))]
        _, at = shapes[int(g.integers(len(shapes)))]
        there = np.array([*at.position[:2], 0.5])
        self._walk = np.zeros(3)
        if self._scene == "appears":
            self._crate = there + np.append(g.uniform(-0.05, 0.05, 2), 0.0)
        elif self._scene == "crosses":
            side = g.uniform(-np.pi, np.pi)
            self._walk = np.array([np.cos(side), np.sin(side), 0.0]) * g.uniform(0.3, 1.0)
            self._crate = there - self._walk * g.uniform(1.0, 2.0)
        else:
            self._crate = there + np.append(g.uniform(-1.5, 1.5, 2), 0.0)

    def _is_fair(self, way: list[Any], now: float) -> bool:
        """Whether nothing meets too soon for any stop; beside the way: whether it stays there."""
        if self._scene == "beside":
            return NEEDED < min(self._gap(each) for each in way) < 0.9
        here, seconds = self._crate, self._robot.seconds
        is_fair = True
        for t in np.linspace(0.0, IN_TIME, 11):
            self._crate = here + self._walk * t
            k = min(int((now + t / seconds) * (len(way) - 1) + 0.5), len(way) - 1)
            is_fair &= min(self._gap(way[k]), self._gap(self._robot.now())) > MARGIN
        self._crate = here
        return is_fair

    def play(self) -> Outcome:
        """Let the robot execute a plan, and the obstacle appear while it does."""
        outcome, nodes, robot = self.outcome, self._nodes, self._robot
        robot.stop()
        self._until(lambda: nodes.said.startswith("stops") and self._speed < STANDS and nodes.is_ready, PATIENCE)
        outcome.lag = 0.0
        robot.plan()
        way = robot.way()
        nodes.forget()
        robot.send()
        outcome.admitted = self._until(lambda: nodes.is_passed, 5.0)
        if not outcome.admitted:
            outcome.said = nodes.said
            return outcome
        over = float(self._generator.uniform(0.1, 0.3))
        self._until(lambda: False, over * robot.seconds)
        self._place(way, over)
        self._met, nodes.told = self._now, None
        self._goes_on()
        self._crate, self._walk = FAR.copy(), np.zeros(3)
        if outcome.stopped and self._generator.random() < RESUMES:
            outcome.ended = self._until(robot.is_done, robot.seconds + 5.0)
        return outcome

    def _goes_on(self) -> None:
        """Play until the plan is done, or the robot has stood for a while."""
        outcome, robot, nodes = self.outcome, self._robot, self._nodes
        assert self._met is not None
        stood: float | None = None
        while self._now - self._met < robot.seconds + 4.0:
            self._step()
            if nodes.told is not None and outcome.told is None and "no plan" not in nodes.said:  # that is its end
                outcome.told, outcome.said = nodes.told - self._met, nodes.said
            if robot.is_done():
                outcome.ended = True
                break
            if outcome.told is None or self._speed > STANDS:
                stood = None
                continue
            stood = self._now if stood is None else stood
            if outcome.stood is None:
                outcome.stood, outcome.stopped, outcome.said = stood - self._met, True, nodes.said
            if self._now - stood > HOLDS:
                break
        outcome.needless = outcome.told is not None and outcome.planned > NEEDED


def play_all(count: int, seed: int, words: Path | None, results: Path | None) -> list[Outcome]:
    """Play executions with one set of nodes. words: where to keep what the nodes print; results: the outcomes."""
    generator, done = np.random.default_rng(seed), []
    with tempfile.TemporaryDirectory() as folder:
        nodes = GateNodes(words or Path(folder))
        try:
            nodes.robots.update({kind.name: kind(nodes, generator) for kind in (ArmRobot, BaseRobot)})
            for k in range(count):
                robot = nodes.robots["arm" if k % 2 else "base"]
                nodes.use(robot.name)
                for _ in range(AGAIN):
                    done.append(Execution(generator, robot, nodes, SCENES[int(generator.integers(len(SCENES)))]).play())
                    print(_line(k, done[-1]), flush=True)
                    if results is not None:
                        results.write_text(json.dumps([asdict(each) for each in done]))
                    if done[-1].lag <= LATE and done[-1].admitted:
                        break
        finally:
            nodes.close()
    return done


def _line(k: int, o: Outcome) -> str:
    told = "not told" if o.told is None else f"told after {o.told:.2f} s"
    stood = "" if o.stood is None else f", stood after {o.stood:.2f} s"
    return (
        f"{k:>3} {o.robot:<4} {o.scene:<8} {told}{stood}, near {o.near:.3f} m, contact {o.contact:.3f} m/s, "
        f"needless {o.needless}, ended {o.ended}, lag {o.lag:.2f} s, {o.said[:90]!r}"
    )


def table(done: list[Outcome]) -> list[str]:
    """Lines of a Markdown table of the executions that count."""
    kept = [each for each in done if each.lag <= LATE and each.admitted]
    lines = [
        f"{len(kept)} of {len(done)} executions count",
        "| Robot | Obstacle | executions | slowed or stopped | appearance to the gate's message: median, most (s) | "
        "to standstill: median, most (s) | nearest (m) | contacts above 1 cm/s | needless | completed |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for robot in ("arm", "base"):
        for scene in SCENES:
            rows = [each for each in kept if each.robot == robot and each.scene == scene]
            if rows:
                lines.append(f"| {robot} | {scene} | {_cells(rows)} |")
    lines.append(f"| all | | {_cells(kept)} |")
    return lines


def _cells(rows: list[Outcome]) -> str:
    def spread(values: list[float]) -> str:
        return f"{np.median(values):.2f}, {max(values):.2f}" if values else "-"

    told, stood = (
        [each.told for each in rows if each.told is not None],
        [each.stood for each in rows if each.stood is not None],
    )
    near = min(each.near for each in rows)
    return (
        f"{len(rows)} | {len(told)} | {spread(told)} | {spread(stood)} | {'-' if near == np.inf else f'{near:.3f}'} | "
        f"{sum(each.contact > STANDS for each in rows)} | {sum(each.needless for each in rows)} | "
        f"{sum(each.ended for each in rows)}"
    )


def main() -> None:
    """Play the executions, or read those of earlier runs, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300, help="executions (default: 300)")
    parser.add_argument("--quick", action="store_true", help="ten executions")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--read", type=Path, nargs="+", default=[], help="results of --json, in place of a run")
    parser.add_argument("--json", type=Path, help="write the outcomes to this file")
    parser.add_argument("--words", type=Path, help="an empty folder for what the nodes print")
    args = parser.parse_args()
    if args.read:
        done = [Outcome(**each) for path in args.read for each in json.loads(path.read_text())]
    else:
        done = play_all(10 if args.quick else args.count, args.seed, args.words, args.json)
    print("\n".join(table(done)))


if __name__ == "__main__":
    main()
