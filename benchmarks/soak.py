"""Run the monitor for simulated hours of change, and compare its answers with plain recomputation.

    make soak                            # 24 simulated hours
    make soak ARGS="--hours 1"
    make soak ARGS="--sources"           # messages of other programs before the monitor, see soak_sources.py
    python benchmarks/soak.py --hours 0.02 --every 20

Objects come, change their shape and go; they steer and turn; their states have noise and gaps of up to 5 s; settings
switch; once an hour the monitor is replaced by one restored from a snapshot's bytes. Every --every steps all objects
report, and a monitor that reuses nothing has to agree on contacts and impacts. Half-way between two such steps, while
some objects are silent, no pair that truly overlaps may be missing from the contacts and the predictions.
Exit code 3: they disagree, or the memory grows.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TimeRemainingColumn

from collision_monitor.accuracy.reference_monitor import ReferenceMonitor, disagreements
from collision_monitor.codec import Removal, decode_status, encode_descriptions, encode_states
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.settings_event import encode_settings
from collision_monitor.records import STATE, Phase
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Cone, ConvexHull, Cylinder, Mesh, Shape, Sphere
from collision_monitor.warm_up import warm_up_monitor

RATE: Final = 10
"""Hz of the states."""
HOUR: Final = 3600 * RATE
"""Steps of a simulated hour."""

ARENA: Final = 9.0
"""m: objects beyond this distance from the middle turn back."""
STEERING: Final = 0.8
"""m/s^2: largest acceleration. Less than `stale_acceleration`, which widens the bounds of silent objects."""
SPEED: Final = 1.5
"""m/s: speed above which objects brake."""

LONGEST_GAP: Final = 5 * RATE
"""Steps for which an object may be silent."""
NOISE: Final = (1e-3, 1e-3)
"""m and m/s: standard deviation of positions and velocities."""
DEEP: Final = 0.05
"""m of true overlap that may not be missed. Larger than what the noise does to a motion during the longest gap."""

CHANGES: Final = 0.03
"""Probability, for each step, that an object comes, changes or goes."""
SWITCHES: Final = 0.005
"""Probability, for each step, that settings change."""

GROWTH: Final = 24e6
"""Bytes by which the resident memory may grow after the first tenth of the time."""

FAILED: Final = 3
"""Exit code if something is wrong."""

_CORNERS: Final = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
_SIDES: Final = "013 032 467 475 045 051 237 276 026 064 157 173"
_NOTCHED: Final = Mesh([*_CORNERS[:7], [0.1, 0.1, 0.1]], [[int(k) for k in side] for side in _SIDES.split()])
"""A cube with one corner pushed in, which is monitored as its convex hull."""


@dataclass
class Report:
    """What a run did and found."""

    steps: int = 0
    compared: int = 0
    silent_compared: int = 0
    came: int = 0
    went: int = 0
    changed: int = 0
    switched: int = 0
    restored: int = 0
    contacts: int = 0
    predictions: int = 0
    problems: list[str] = field(default_factory=list)
    memory: list[tuple[float, float]] = field(default_factory=list)  # simulated h, MB


def resident() -> float:
    """Resident memory of this process (bytes)."""
    gc.collect()
    return float(int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE"))


class Traffic:
    """The moving objects: columns by slot. Every acceleration is at most STEERING."""

    def __init__(self, count: int, rng: np.random.Generator) -> None:
        self.rng = rng
        self.count = count
        self.states = np.zeros(count, STATE)
        self.silent_until = np.zeros(count, np.int64)  # step
        self._steering = np.zeros((count, 3))
        self._next_id = 1
        for slot in range(count):
            self.replace(slot)

    def replace(self, slot: int) -> tuple[int, int]:
        """Put a new object with a new id into the slot. Return the old id and the new one."""
        row, old = self.states[slot], int(self.states["id"][slot])
        row["id"] = self._next_id
        self._next_id += 1
        row["position"], row["linear"] = self.rng.uniform(-ARENA, ARENA, 3), self.rng.normal(0, 0.5, 3)
        quaternion = self.rng.normal(size=4)
        row["quaternion"], row["angular"] = quaternion / np.linalg.norm(quaternion), self.rng.normal(0, 0.3, 3)
        self.silent_until[slot] = 0
        return old, int(row["id"])

    def move(self, dt: float) -> None:
        """Move all objects by dt (s)."""
        rows, rng = self.states, self.rng
        new = rng.random(self.count) < 0.3 * dt
        self._steering[new] = rng.normal(0, 0.4, (int(new.sum()), 3))
        push = self._steering - np.where(np.abs(rows["position"]) > ARENA, np.sign(rows["position"]), 0.0)
        push -= 0.5 * rows["linear"] * (np.linalg.norm(rows["linear"], axis=1) > SPEED)[:, None]
        size = np.linalg.norm(push, axis=1, keepdims=True)
        push *= np.minimum(1.0, STEERING / np.maximum(size, 1e-9))
        rows["position"] += rows["linear"] * dt + 0.5 * push * dt * dt
        rows["linear"] += push * dt
        rows["quaternion"] = _turned(rows["quaternion"], rows["angular"] * dt)

    def observed(self, step: int) -> NDArray[np.void]:
        """Return the noisy states of those that are not silent; some fall silent."""
        rng = self.rng
        quiet = rng.random(self.count) < 0.002
        self.silent_until[quiet] = step + rng.integers(1, LONGEST_GAP, int(quiet.sum()))
        rows = self.states[self.silent_until <= step].copy()
        rows["position"] += rng.normal(0, NOISE[0], (len(rows), 3))
        rows["linear"] += rng.normal(0, NOISE[1], (len(rows), 3))
        return rows


def _turned(q: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternions (n, 4) turned by rotation vectors (n, 3) in the world frame."""
    angle = np.linalg.norm(by, axis=1, keepdims=True)
    axis = by * np.where(angle > 1e-12, np.sin(angle / 2) / np.maximum(angle, 1e-12), 0.5)
    x, y, z, w = axis[:, 0], axis[:, 1], axis[:, 2], np.cos(angle[:, 0] / 2)
    a, b, c, d = q.T
    turned = np.stack(
        [w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a, w * c + x * b - y * a + z * d,
         w * d - x * a - y * b - z * c],
        axis=1,
    )  # fmt: skip
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def any_shape(rng: np.random.Generator) -> Shape | list[tuple[Shape, Pose]]:
    """Return a shape of 0.4 to 1.6 m, or a compound."""
    a, b, c = rng.uniform(0.2, 0.8, 3)
    kinds: list[Any] = [
        Sphere(a), Box((2 * a, 2 * b, 2 * c)), Capsule(0.5 * a, 2 * b), Cylinder(a, 2 * b), Cone(a, 2 * b),
        ConvexHull(rng.normal(0, 0.4, (int(rng.integers(6, 20)), 3))), _NOTCHED,
        [(Box((2 * a, 0.2, 0.2)), Pose()), (Sphere(0.3), Pose((a, 0, 0)))],
    ]  # fmt: skip
    return kinds[int(rng.integers(len(kinds)))]  # type: ignore[no-any-return]


def any_profile(rng: np.random.Generator) -> Profile:
    """Return settings that a running monitor may switch to."""
    changes: dict[str, Any] = {
        "horizon": float(rng.choice([0.5, 1.0, 2.0, 4.0])),
        "contact_margin": float(rng.choice([0.0, 0.0, 0.05])),
        "contact_points": int(rng.choice([1, 4])),
        "threads": int(rng.choice([1, 2])),
        "uncertainty": bool(rng.random() < 0.5),
        "position_tolerance": float(rng.choice([1e-4, 1e-3, 1e-2])),
        "velocity_tolerance": float(rng.choice([1e-4, 1e-3, 1e-2])),
    }
    if rng.random() < 0.2:
        changes |= {"region_min": (-6.0, -6.0, -9.0), "region_max": (6.0, 6.0, 9.0)}
    return Profile(**changes)


def plainly(profile: Profile) -> Profile:
    """Return the profile without tolerances, and without a limit of the time between two comparisons."""
    tolerances = ("position", "orientation", "velocity", "angular_velocity")
    return profile.replace(max_time_step=1e9, **{f"{name}_tolerance": 0.0 for name in tolerances})


class Soak:
    """The monitor, the plain recomputation beside it, and the traffic that both observe."""

    def __init__(self, objects: int, seed: int, every: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.traffic = Traffic(objects, self.rng)
        self.profile = Profile()
        self.pipeline = Pipeline(self.profile, timed=False)
        self.plain: Monitor = ReferenceMonitor()
        self.plain.profile = plainly(self.profile)
        self.report = Report()
        self.every = every
        self.stamp = 1_700_000_000_000_000_000
        floor = ObjectDescription(4_000_000_000, Box((30, 30, 1)), name="floor", static=True, pose=Pose((0, 0, -10.5)))
        self.describe([floor, *map(self.described, self.traffic.states["id"].tolist())])

    def described(self, object_id: int) -> ObjectDescription:
        """Return the description of an object with any shape."""
        return ObjectDescription(object_id, any_shape(self.rng), name=f"object number {object_id}")

    def describe(self, changes: list[ObjectDescription | Removal]) -> None:
        """Change the objects of both monitors."""
        made = self.pipeline.on_shapes(encode_descriptions(self.stamp, "world", changes))
        if len(made) != len(changes):
            self.report.problems.append(f"a description was refused: {self.pipeline.monitor.last_refusal}")
        for change in made:
            if isinstance(change, Removal):
                self.plain.remove(change.object_id)
            else:
                self.plain.describe(change)

    def change_objects(self) -> None:
        """Let an object come in another's place, or give it another shape."""
        slot = int(self.rng.integers(self.traffic.count))
        if self.rng.random() < 0.5:
            self.describe([self.described(int(self.traffic.states["id"][slot]))])
            self.report.changed += 1
        else:
            old, new = self.traffic.replace(slot)
            self.describe([Removal(old), self.described(new)])
            self.report.came += 1
            self.report.went += 1

    def switch(self) -> None:
        """Change settings of both monitors, as a session does."""
        new = any_profile(self.rng)
        self.pipeline.on_settings(encode_settings(self.stamp, "", self.profile.differences(new)))
        self.profile = new
        self.plain.profile = plainly(new)
        self.report.switched += 1

    def restart(self) -> None:
        """Continue with a monitor restored from a snapshot's bytes."""
        snapshot = Snapshot.decode(self.pipeline.snapshot().encode())
        self.pipeline = Pipeline.restored(snapshot, "world")
        self.report.restored += 1

    def step(self, number: int) -> None:
        """Move, change what changes, and take a step; compare if it is time."""
        self.stamp += 1_000_000_000 // RATE
        self.traffic.move(1.0 / RATE)
        if self.rng.random() < CHANGES:
            self.change_objects()
        if self.rng.random() < SWITCHES:
            self.switch()
        if number % HOUR == HOUR - 1:
            self.restart()
        is_complete = number % self.every == self.every - 1
        states = self.traffic.states.copy() if is_complete else self.traffic.observed(number)
        outputs = self.pipeline.on_states(encode_states(self.stamp, "world", number + 1, states))
        report = self.report
        report.steps += 1
        if outputs is None:
            report.problems.append(f"step {number} was refused: {self.pipeline.monitor.last_refusal}")
            return
        mine = outputs.result
        report.contacts += mine.status.contacts
        report.predictions += mine.status.predictions
        if is_complete:
            self.traffic.silent_until[:] = 0
            truth = self.truth(states)
            found = disagreements(mine, truth, self.profile.horizon)
            report.compared += 1
            report.problems += [f"step {number}: {text}" for text in found]
            decode_status(self.pipeline.status())
        elif number % self.every == self.every // 2 and not self.profile.region_max[0] < ARENA:
            truth = self.truth(self.traffic.states.copy())
            report.silent_compared += 1
            report.problems += [f"step {number}: {text}" for text in missed(mine, truth)]

    def truth(self, states: NDArray[np.void]) -> StepResult:
        """Return the plain recomputation of these states."""
        result = self.plain.step(self.stamp, states)
        if not result.accepted:
            self.report.problems.append(f"the plain monitor refused a step: {self.plain.last_refusal}")
        return result


def missed(mine: StepResult, truth: StepResult) -> list[str]:
    """Return the pairs that truly overlap by more than DEEP and are in none of the answers, one sentence each."""
    reported = {(int(r["id_a"]), int(r["id_b"])) for r in mine.contacts[mine.contacts["phase"] != Phase.END]}
    reported |= {(int(r["id_a"]), int(r["id_b"])) for r in mine.predictions}
    rows = truth.contacts[truth.contacts["phase"] != Phase.END]
    true = {(int(r["id_a"]), int(r["id_b"])): float(r["signed_distance"]) for r in rows}
    deep = {pair: -depth for pair, depth in true.items() if depth < -DEEP}
    return [f"{pair} overlaps by {deep[pair]:.3f} m and is not reported" for pair in sorted(deep.keys() - reported)]


def run(args: argparse.Namespace) -> tuple[Report, float]:
    """Run with a progress bar. Return the report and the duration (s)."""
    warm_up_monitor()
    soak, report = Soak(args.objects, args.seed, args.every), Report()
    report = soak.report
    steps, began = round(args.hours * HOUR), time.monotonic()
    marks = {round(steps * k / 10) for k in range(1, 11)} if steps < 10 * HOUR else set(range(HOUR, steps + 1, HOUR))
    console = Console(stderr=True)
    columns = ("soak", BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=steps)
        for number in range(steps):
            soak.step(number)
            if (number + 1) % 500 == 0:
                bar.update(task, completed=number)
            if number + 1 in marks:
                report.memory.append(((number + 1) / HOUR, resident() / 1e6))
                if not args.json:
                    console.print(f"{(number + 1) / HOUR:7.2f} h   {report.memory[-1][1]:7.1f} MB resident")
            if len(report.problems) >= 20:
                break
    growth = 1e6 * (report.memory[-1][1] - report.memory[0][1]) if report.memory else 0.0
    if growth > GROWTH:
        report.problems.append(f"the memory grew by {growth / 1e6:.1f} MB in {args.hours} simulated hours")
    return report, time.monotonic() - began


def run_sources(args: argparse.Namespace) -> dict[str, Any]:
    """Run the sources for simulated hours. Return what was done, and the problems."""
    from soak_sources import PERIOD, SourceSoak

    warm_up_monitor()
    soak, began = SourceSoak(args.objects, args.seed), time.monotonic()
    steps, memory = round(args.hours * 3.6e12 / PERIOD), []
    marks = {round(steps * k / 10) for k in range(1, 11)}
    for number in range(steps):
        soak.step(number)
        if number + 1 in marks:
            memory.append(((number + 1) * PERIOD / 3.6e12, resident() / 1e6))
            print(f"{memory[-1][0]:7.2f} h   {memory[-1][1]:7.1f} MB resident", file=sys.stderr, flush=True)
        if len(soak.problems) >= 20:
            break
    if memory and (growth := memory[-1][1] - memory[0][1]) > GROWTH / 1e6:
        soak.problems.append(f"the memory grew by {growth:.1f} MB in {args.hours} simulated hours")
    names = ("steps", "compared", "states", "attacks", "loops", "came", "went", "refused")
    counts = {name: getattr(soak, name) for name in names}
    return {**counts, "problems": soak.problems, "memory": memory, "seconds": round(time.monotonic() - began, 1)}


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated hours")
    parser.add_argument("--objects", type=int, default=25)
    parser.add_argument("--every", type=int, default=200, help="compare at every K-th step")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print one JSON line")
    parser.add_argument("--sources", action="store_true", help="messages of other programs before the monitor")
    args = parser.parse_args()
    if args.sources:
        result = run_sources(args)
        print(json.dumps(result) if args.json else "\n".join(f"{name:10} {each}" for name, each in result.items()))
        return FAILED if result["problems"] else 0
    report, seconds = run(args)
    if args.json:
        print(json.dumps(vars(report) | {"seconds": seconds}))
    else:
        verdict, steps = f"{len(report.problems)} problems" if report.problems else "agree", max(1, report.steps)
        print(
            f"{report.steps:,} steps in {seconds:.0f} s, {report.compared:,} compared and {report.silent_compared:,} "
            f"with silent objects: {verdict}; {report.came:,} objects came and went, {report.changed:,} changed, "
            f"settings switched {report.switched:,} times, {report.restored} snapshots, "
            f"{report.contacts / steps:.1f} contacts and {report.predictions / steps:.1f} predictions a step"
        )
        print("\n".join(report.problems[:20]), end="\n" if report.problems else "")
    return FAILED if report.problems else 0


if __name__ == "__main__":
    sys.exit(main())
