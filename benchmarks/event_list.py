"""Measure the gain of the event list over plain recomputation of every prediction.

    python benchmarks/event_list.py                    # 10,000 boxes at 100 Hz, six kinds of motion
    python benchmarks/event_list.py --objects 1000 --seconds 60 --every 1   # compared at every step of a minute
    python benchmarks/event_list.py --distance-tolerance 0.001 --moves rest,slow     # keeps contacts that hardly move
    python benchmarks/event_list.py --shape sphere --objects 100,1000,10000,100000 --moves steady,turns   # growth

CPU ms: median of the processor time, which depends less on the load of the machine; growth: its ratio to the row above.
Both monitors get the same states in one run. At every --every th step the reference monitor recomputes everything, and
the answers are compared: no collision may be missed, late or invented, within the stated bounds.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from collision_monitor import Box, Monitor, Sphere, records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor, disagreements
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import from_rotation_vector, multiply

RATE = 100.0
MOVES = ("steady", "turns", "noise", "jumps", "slow", "rest")
SPEEDS = {"slow": 0.01, "rest": 0.0}
"""Kinds of motion that are slower than the others, as a part of their speeds."""


class Boxes:
    """Boxes of 0.4 to 1.2 m that bounce inside a cube; each overlaps half a neighbour on average."""

    def __init__(self, n: int, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.size = rng.uniform(0.4, 1.2, (n, 3))
        a, b, c = (self.size / 2).T
        volume, surface, curvature = 8 * a * b * c, 8 * (a * b + b * c + c * a), 2 * np.pi * (a + b + c)
        density = 0.5 / (2 * volume.mean() + 2 * surface.mean() * curvature.mean() / (4 * np.pi))
        self.side = (n / density) ** (1 / 3)
        self.position = rng.uniform(0, self.side, (n, 3))
        self.quaternion = rng.normal(size=(n, 4))
        self.quaternion /= np.linalg.norm(self.quaternion, axis=1, keepdims=True)
        self.linear, self.angular = rng.uniform(-1, 1, (n, 3)), rng.uniform(-1, 1, (n, 3))

    def states(self, noise: float) -> NDArray[np.void]:
        """States (N,) of records.STATE with random errors of up to `noise` in position, orientation and twist."""

        def shake() -> NDArray[np.float64]:
            return noise * self.rng.uniform(-1, 1, self.position.shape) / np.sqrt(3) if noise else np.zeros(3)

        states = np.zeros(len(self.size), records.STATE)
        states["id"] = np.arange(len(self.size))
        states["position"] = self.position + shake()
        states["quaternion"] = multiply(from_rotation_vector(shake()), self.quaternion) if noise else self.quaternion
        states["linear"], states["angular"] = self.linear + shake(), self.angular + shake()
        return states

    def move(self, dt: float, turning: float) -> None:
        """Move all boxes by dt seconds, then give the fraction `turning` of them a new twist."""
        self.position += self.linear * dt
        self.quaternion = multiply(from_rotation_vector(self.angular * dt), self.quaternion)
        chosen = self.rng.random(len(self.size)) < turning
        for velocity in (self.linear, self.angular):
            velocity[chosen] = self.rng.uniform(-1, 1, (int(chosen.sum()), 3))

    def walls(self) -> None:
        """Reverse the boxes that have left the cube."""
        out = (self.position < 0) & (self.linear < 0) | (self.position > self.side) & (self.linear > 0)
        self.linear[out] *= -1


def run(move: str, objects: int, args: argparse.Namespace) -> dict[str, Any]:
    """Measure one kind of motion; returns the row of the table."""
    boxes = Boxes(objects, args.seed)
    answers = {"distance_tolerance": args.distance_tolerance, "contact_details": not args.no_details}
    profile = Profile(threads=args.threads, **answers)
    boxes.linear, boxes.angular = SPEEDS.get(move, 1.0) * boxes.linear, SPEEDS.get(move, 1.0) * boxes.angular
    # half of the declared tolerances, so that two noisy states stay within them
    noise = 0.49 * profile.position_tolerance if move == "noise" else 0.0
    turning = {"turns": 0.01, "jumps": 1.0}.get(move, 0.0)
    mine, plain = Monitor(profile), ReferenceMonitor(profile.replace(distance_tolerance=0.0))
    for monitor in (mine, plain):
        for i, size in enumerate(boxes.size):
            monitor.add(i, Box(size) if args.shape == "box" else Sphere(0.5 * size.mean()))
    spent: dict[str, list[float]] = {"event list": [], "plain": []}
    cpu: list[float] = []
    wrong: list[str] = []
    moved = compared = 0
    steps = int(args.seconds * RATE)
    for step in track(range(steps), description=f"{move:8}", console=Console(stderr=True), transient=True):
        states, stamp = boxes.states(noise), round(step * 1e9 / RATE)
        began, used = time.perf_counter(), time.thread_time()
        answer = mine.step(stamp, states)
        cpu.append(time.thread_time() - used)
        spent["event list"].append(time.perf_counter() - began)
        moved += answer.status.objects_moved
        if step % args.every == 0:
            began = time.perf_counter()
            truth = plain.step(stamp, states)
            spent["plain"].append(time.perf_counter() - began)
            wrong += [f"step {step}: {text}" for text in disagreements(answer, truth, profile.horizon)]
            compared += 1
        boxes.move(1 / RATE, turning)
        if move not in ("steady", *SPEEDS):
            boxes.walls()
    warm = min(10, steps // 4)
    own, full = 1e3 * np.array(spent["event list"][warm:]), 1e3 * np.array(spent["plain"][1:] or spent["plain"])
    return {
        "move": move,
        "objects": objects,
        "threads": args.threads,
        "mean_ms": own.mean(),
        "median_ms": float(np.median(own)),
        "best_ms": float(own.min()),
        "cpu_ms": 1e3 * float(np.median(cpu[warm:])),
        "p99_ms": float(np.percentile(own, 99)),
        "plain_ms": float(np.median(full)),
        "ratio": float(np.median(full) / own.mean()),
        "moved_per_step": moved / steps,
        "compared_steps": compared,
        "contacts": answer.status.contacts,
        "predictions": answer.status.predictions,
        "disagreements": len(wrong),
        "first_disagreement": wrong[0] if wrong else "",
    }


def main() -> int:
    """Return exit code 3 if the two monitors disagree."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", default="10000", help="number of objects, or several: 100,1000,10000")
    parser.add_argument("--shape", choices=("box", "sphere"), default="box")
    parser.add_argument("--seconds", type=float, default=5.0, help="simulated time at 100 Hz")
    parser.add_argument("--every", type=int, default=25, help="compare with recomputation at every K-th step")
    parser.add_argument("--distance-tolerance", type=float, default=0.0, help="distance_tolerance of the profile (m)")
    parser.add_argument("--no-details", action="store_true", help="no witness points and features (contact_details)")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--moves", default=",".join(MOVES), help=f"kinds of motion: {', '.join(MOVES)}")
    parser.add_argument("--json", action="store_true", help="print one JSON line instead of a table")
    args = parser.parse_args()
    rows = [run(move, int(n), args) for move in args.moves.split(",") for n in args.objects.split(",")]
    if args.json:
        print(json.dumps({"load": os.getloadavg()[0], "rows": rows}))
    else:
        table = Table(title=f"{args.shape}, {RATE:.0f} Hz, contacts and all predictions within 2 s")
        names = ("best ms", "CPU ms", "median ms", "mean ms", "p99 ms", "plain ms", "plain / mean", "moved/step")
        for name in ("move", "objects", *names, "growth", "compared", "wrong"):
            table.add_column(name, justify="left" if name == "move" else "right")
        keys = ("best_ms", "cpu_ms", "median_ms", "mean_ms", "p99_ms", "plain_ms", "ratio", "moved_per_step")
        for row, last in zip(rows, [None, *rows], strict=False):
            numbers = [f"{row[key]:.2f}" for key in keys]
            grows = last is not None and last["move"] == row["move"]
            numbers.append(f"×{row['cpu_ms'] / last['cpu_ms']:.1f}" if last and grows else "")
            ends = str(row["compared_steps"]), str(row["disagreements"])
            table.add_row(str(row["move"]), str(row["objects"]), *numbers, *ends)
        Console(width=None if sys.stdout.isatty() else 160).print(table)
        for row in rows:
            if row["first_disagreement"]:
                print(f"{row['move']}: {row['first_disagreement']}", file=sys.stderr)
    return 3 if any(row["disagreements"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
