"""Measure the guard in randomised encounters: real nodes over real DDS, simulated robots and people.

Robots drive in lanes of their own, each behind its guard; one monitor watches all. Kinds of encounters:
  appears  a person stands up in the stop zone ahead: time until the robot stands, and how long the stop is held
  crosses  a person walks across the lane or toward the robot: no contact while the robot moves
  passes   a person stands or walks beside the lane: the robot has to drive on

    python benchmarks/guard.py --rounds 50 --png docs/images/guard.png
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
ROBOTS = 4
SECONDS = 3.5
RATE, STATES_EVERY, COMMANDS_EVERY = 200, 7, 10  # Hz of the simulation; states at 29 Hz, commands at 20 Hz
ROBOT, PERSON = 0.3, 0.25  # m, radii
ACCELERATION, DECELERATION = 1.0, 2.0  # m/s^2 of the base
LANE = 50.0  # m
STANDS = 0.01  # m/s
KINDS = ("appears", "crosses", "passes")


@dataclass
class Encounter:
    """One robot's encounter; person: position and velocity from `begin` (s) on."""

    kind: str
    speed: float
    begin: float
    offset: np.ndarray
    walk: np.ndarray
    x: float = 0.0
    v: float = 0.0
    person: np.ndarray = field(default_factory=lambda: np.array([-20.0, 0.0]))
    here: bool = False
    met_at: float = 0.0  # speed at the appearance
    command: float = 0.0
    stood: float | None = None  # s after the appearance
    held: int = 0
    after: int = 0
    stops: int = 0
    contact: float = 0.0  # largest speed of the robot in contact
    trace: list[tuple[float, float, float, float]] = field(default_factory=list)

    @property
    def gap(self) -> float:
        """Distance of the surfaces (m)."""
        return float(np.hypot(self.person[0] - self.x, self.person[1])) - ROBOT - PERSON

    def advance(self, t: float, dt: float) -> None:
        """Move robot and person."""
        target = max(0.0, self.command)
        change = np.clip(target - self.v, -DECELERATION * dt, ACCELERATION * dt)
        self.v = max(0.0, self.v + float(change))
        self.x += self.v * dt
        if not self.here and t >= self.begin:
            self.here, self.met_at = True, self.v
            self.person = np.array([self.x, 0.0]) + self.offset
        elif self.here:
            self.person = self.person + self.walk * dt
        self.trace.append((t, self.v, self.command, self.gap))
        if not self.here:
            return
        if self.gap <= 0.0:
            self.contact = max(self.contact, self.v)
        if self.stood is None and self.v < STANDS:
            self.stood = t - self.begin
        elif self.stood is not None:
            self.after += 1
            self.held += self.v < STANDS
        self.stops += self.command == 0.0


def drawn(generator: np.random.Generator) -> Encounter:
    """Draw an encounter. Lengths in m, speeds in m/s."""
    kind = str(generator.choice(KINDS, p=[0.45, 0.3, 0.25]))
    begin = generator.uniform(0.9, 1.3)
    if kind == "appears":
        speed = generator.uniform(0.2, 0.7)
        least = speed**2 / (2 * DECELERATION) + 0.25 * speed + 0.05
        gap = generator.uniform(least, 0.48)
        angle = generator.uniform(-0.3, 0.3)
        offset = (gap + ROBOT + PERSON) * np.array([np.cos(angle), np.sin(angle)])
        return Encounter(kind, speed, begin, offset, np.zeros(2))
    speed = generator.uniform(0.3, 1.2)
    if kind == "crosses":
        side = generator.choice([-1.0, 1.0])
        ahead = generator.uniform(1.3, 2.4)
        walk = generator.uniform(0.5, 1.3) * np.array([generator.uniform(-0.6, 0.2), -side])
        return Encounter(kind, speed, begin, np.array([ahead, side * generator.uniform(1.5, 2.5)]), walk)
    side = generator.choice([-1.0, 1.0])
    offset = np.array([generator.uniform(0.5, 2.5), side * (ROBOT + PERSON + generator.uniform(0.65, 1.5))])
    return Encounter(kind, speed, begin, offset, np.array([generator.uniform(-0.8, 0.8), 0.0]))


class Nodes:
    """The monitor and the guards as processes, and the topics to them."""

    def __init__(self, folder: Path) -> None:
        import rclpy
        from geometry_msgs.msg import Twist
        from rclpy.executors import SingleThreadedExecutor

        from collision_monitor.pipeline.topics import Topic
        from collision_monitor.ros.endpoints import publisher

        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        rules = ["-p", f"rules:={ROOT / 'config/guard_rules.yaml'}"]
        self._processes = [self._start(folder, environment, "monitor", rules)]
        for k in range(ROBOTS):
            arguments = ["-r", f"__node:=guard_{k}", "-p", f"robot:=robot_{k}", "-p", f"deceleration:={DECELERATION}"]
            for way in ("in", "out"):
                arguments += ["-r", f"cmd_vel_{way}:=/robot_{k}/cmd_vel_{way}"]
            self._processes.append(self._start(folder, environment, "guard", arguments))
        rclpy.init()
        self.node = rclpy.create_node("encounters")
        self.commands = [0.0] * ROBOTS
        self._twist = Twist
        self._out = [self.node.create_publisher(Twist, f"/robot_{k}/cmd_vel_in", 1) for k in range(ROBOTS)]
        for k in range(ROBOTS):
            self.node.create_subscription(Twist, f"/robot_{k}/cmd_vel_out", self._keep(k), 1)
        self.shapes, self.states = (publisher(self.node, t, t.of()) for t in (Topic.SHAPES, Topic.STATES))
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        threading.Thread(target=executor.spin, daemon=True).start()

    @staticmethod
    def _start(folder: Path, environment: dict[str, str], name: str, arguments: list[str]) -> subprocess.Popen[bytes]:
        program = f"import sys; from collision_monitor.ros.executables import {name}; sys.exit({name}())"
        log = (folder / f"{name}_{time.monotonic_ns()}.log").open("w")
        command = [sys.executable, "-c", program, "--ros-args", *arguments]
        return subprocess.Popen(command, env=environment, stdout=log, stderr=log)

    def _keep(self, k: int) -> Callable[[Any], None]:
        def keep(message: Any) -> None:
            self.commands[k] = message.linear.x

        return keep

    def command(self, k: int, speed: float) -> None:
        """Send one robot's command to its guard."""
        message = self._twist()
        message.linear.x = speed
        self._out[k].publish(message)

    def now(self) -> int:
        """Return the time in ns."""
        return int(self.node.get_clock().now().nanoseconds)

    def close(self) -> None:
        """End the processes."""
        for process in self._processes:
            process.send_signal(signal.SIGINT)
        for process in self._processes:
            process.wait(10.0)


def play(nodes: Nodes, encounters: list[Encounter], sequence: int) -> int:
    """Play one encounter of each robot at once, in real time. Return the next sequence number."""
    from collision_monitor.codec import encode_states
    from collision_monitor.records import STATE

    begun, frame, dt = time.perf_counter(), 0, 1.0 / RATE
    nodes.commands = [0.0] * ROBOTS
    states = np.zeros(2 * ROBOTS, STATE)
    states["id"], states["quaternion"][:, 3] = np.arange(2 * ROBOTS), 1.0
    was_here = [False] * ROBOTS
    while frame < SECONDS * RATE:
        t = frame * dt
        for k, each in enumerate(encounters):
            each.command = nodes.commands[k]
            each.advance(t, dt)
            if frame % COMMANDS_EVERY == 0:
                nodes.command(k, each.speed)
        if frame % STATES_EVERY == 0:
            for k, each in enumerate(encounters):
                states["position"][k, :2], states["linear"][k, 0] = (each.x, LANE * k), each.v
                states["position"][ROBOTS + k, :2] = each.person[0], each.person[1] + LANE * k
                states["linear"][ROBOTS + k, :2] = each.walk if each.here else 0.0
                jumps = frame == 0 or each.here != was_here[k]
                states["flags"][[k, ROBOTS + k]] = 4 if frame == 0 else 0, 4 if jumps else 0
                was_here[k] = each.here
            nodes.states.publish(encode_states(nodes.now(), "world", sequence, states))
            sequence += 1
        frame += 1
        wait = begun + frame * dt - time.perf_counter()
        if wait > 0.0:
            time.sleep(wait)
    return sequence


def describe(nodes: Nodes) -> None:
    """Describe robots and people."""
    from collision_monitor.codec import encode_descriptions
    from collision_monitor.objects.description import ObjectDescription
    from collision_monitor.shapes.registry import Cylinder

    robots = [ObjectDescription(k, Cylinder(ROBOT, 1.0), name=f"robot_{k}") for k in range(ROBOTS)]
    people = [ObjectDescription(ROBOTS + k, Cylinder(PERSON, 1.75), name=f"person_{k}") for k in range(ROBOTS)]
    nodes.shapes.publish(encode_descriptions(nodes.now(), "world", [*robots, *people]))


def report(done: list[Encounter]) -> None:
    """Print the figures."""
    counts = {kind: sum(e.kind == kind for e in done) for kind in KINDS}
    print(f"{len(done)} encounters: " + ", ".join(f"{count} {kind}" for kind, count in counts.items()))
    appears = [e for e in done if e.kind == "appears"]
    print(f"speed of the robots when a person appears: {min(e.met_at for e in done):.2f} m/s or more")
    times = np.array([e.stood if e.stood is not None else np.inf for e in appears])
    print(
        f"appearance to standstill: median {np.median(times):.3f} s, 95 % {np.quantile(times, 0.95):.3f} s, most "
        f"{times.max():.3f} s; within 0.6 s: {100 * (times <= 0.6).mean():.1f} %"
    )
    held = [e.held / max(e.after, 1) for e in appears if e.stood is not None]
    print(f"held: {100 * np.mean(held):.2f} % of the time on average, least {100 * min(held):.2f} %")
    passes = [e for e in done if e.kind == "passes"]
    false = [e for e in passes if e.stops > 2]
    print(f"false stops: {len(false)} of {len(passes)} ({100 * len(false) / max(len(passes), 1):.1f} %)")
    for kind in KINDS:
        speeds = [round(e.contact, 3) for e in done if e.kind == kind and e.contact > STANDS]
        print(f"contacts of a robot faster than 1 cm/s, {kind}: {len(speeds)} {speeds or ''}")


def draw(encounter: Encounter, path: Path) -> None:
    """Draw one encounter over time."""
    from matplotlib.figure import Figure

    t, v, command, gap = np.array(encounter.trace).T
    t = t - encounter.begin
    figure = Figure(figsize=(7.6, 4.2), layout="constrained")
    above, below = figure.subplots(2, sharex=True)
    above.plot(t, np.full_like(t, encounter.speed), color="#8a8a8a", linestyle=":", label="command of the planner")
    above.plot(t, command, color="#3b82c4", drawstyle="steps-post", label="command of the guard")
    above.plot(t, v, color="#d1493f", label="speed of the robot")
    above.set_ylabel("m/s")
    above.legend(frameon=False, fontsize=9)
    seen = t >= 0.0
    below.plot(t[seen], gap[seen], color="#2e9e5b", label="distance to the person")
    below.axhline(0.5, color="#c0302b", linewidth=0.9, linestyle="--", label="critical: 0.5 m")
    below.set_ylim(0.0)
    below.set_ylabel("m")
    below.set_xlabel("s after the person appeared")
    below.legend(frameon=False, fontsize=9)
    for axes in (above, below):
        axes.axvline(0.0, color="#010101", linewidth=0.8)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150, metadata={"Software": None})


def main() -> None:
    """Play the encounters and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=50, help=f"rounds of {ROBOTS} encounters each (default: 50)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--png", type=Path, help="draw one encounter")
    args = parser.parse_args()
    generator = np.random.default_rng(args.seed)
    done: list[Encounter] = []
    with tempfile.TemporaryDirectory() as folder:
        nodes = Nodes(Path(folder))
        try:
            time.sleep(8.0)
            describe(nodes)
            sequence = play(nodes, [drawn(generator) for _ in range(ROBOTS)], 0)  # the first round only warms up
            for number in range(args.rounds):
                encounters = [drawn(generator) for _ in range(ROBOTS)]
                sequence = play(nodes, encounters, sequence)
                done += encounters
                print(f"\r{number + 1} of {args.rounds}", end="", file=sys.stderr, flush=True)
        finally:
            nodes.close()
            for log in sorted(Path(folder).glob("*.log")):
                print(log.name, log.read_text()[-600:], file=sys.stderr)
    report(done)
    if args.png is not None:
        draw(next(e for e in done if e.kind == "appears" and e.stood is not None), args.png)


if __name__ == "__main__":
    main()
