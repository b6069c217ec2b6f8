"""Measure the guard where something is wrong: randomised encounters, each with one fault, with real nodes over DDS.

A simulated robot drives at a crate behind its guard; a monitor reads both from topics. While it drives, one thing goes
wrong: no rule, rules of another robot, NaN in a component of the commands, a monitor that is late, stopped, killed or
not alone, a source that is silent, a mesh or a frame that is missing, old commands, a flood. The robot has to stand,
and must never be nearer to the crate than the distance that it needs to stop. One encounter in five has no fault, and a
crate beside the lane (nothing may stop the robot) or one that appears ahead.

    python benchmarks/guard_encounters.py --count 300 --png docs/images/guard_faults.png
    python benchmarks/guard_encounters.py --quick             # one encounter of each fault
    python benchmarks/guard_encounters.py --read a.json b.json      # the table of earlier runs

Runs side by side need a ROS_DOMAIN_ID each.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
from encounter_faults import Fault, History, all_faults
from encounter_nodes import PATIENCE, RADIUS_CRATE, RADIUS_ROBOT, WHOLE_RACK, Nodes
from encounter_report import FRESH, LATE, draw, table

ACCELERATION, DECELERATION = 1.0, 1.0  # m/s^2 of the base; the guard's default is the same
STANDS: Final = 0.01  # m/s
TICK, STATES_EVERY, COMMANDS_EVERY = 0.02, 2, 3  # s; ticks
AWAY: Final = 40.0  # m: where the crate rests
GIVE_UP = 6.0  # s after a fault, and before it
HOLD = 0.8  # s that a standstill has to last
AGAIN: Final = 5
"""How often an encounter is played whose simulation does not keep up."""

CALM: Final = 0.8  # s for which the machine has to keep up before an encounter begins
SHARE_WITHOUT: Final = 0.2


@dataclass
class Outcome:
    """What an encounter showed. Times in s after the fault, lengths in m, speeds in m/s; None: it did not come to it.

    margin: the least of distance - braking distance while the robot moves; nearest: the least distance while it moves.
    needless: commands to stop before the fault; oldest: the largest age of an answer until then. recovered: s until the
    guard passes commands after the fault. lag: the most time between two ticks of the simulation.
    """

    fault: str
    scene: str
    speed: float
    stops: bool
    met_at: float = 0.0
    met_gap: float = 0.0
    commanded: float | None = None
    stood: float | None = None
    margin: float = np.inf
    nearest: float = np.inf
    contact: float = 0.0
    broke: bool = False
    needless: int = 0
    said: str = ""
    why_needless: str = ""
    oldest: float = 0.0
    lag: float = 0.0
    recovered: float | None = None


class World:
    """The robot on the x axis and the crate. Positions in m, velocities in m/s."""

    def __init__(self) -> None:
        self.x = self.v = 0.0
        self.crate, self.walk = np.array([AWAY, 0.0]), np.zeros(2)

    @property
    def gap(self) -> float:
        """Distance of the surfaces."""
        return float(np.hypot(*(self.crate - (self.x, 0.0)))) - RADIUS_ROBOT - RADIUS_CRATE

    @property
    def closing(self) -> float:
        """Part of the robot's speed toward the crate."""
        ahead, side = self.crate - (self.x, 0.0)
        return float(max(0.0, self.v * ahead / max(np.hypot(ahead, side), 1e-9)))

    def advance(self, command: float, dt: float) -> None:
        """Move both; the base follows the command as fast as it can."""
        self.v += float(np.clip(command - self.v, -DECELERATION * dt, ACCELERATION * dt))
        self.x += self.v * dt
        self.crate = self.crate + self.walk * dt


class Encounter:
    """One encounter: drawn from the generator, and played in real time."""

    def __init__(self, generator: np.random.Generator, fault: Fault, nodes: Nodes, world: World) -> None:
        self._fault, self._nodes, self._world = fault, nodes, world
        self._latency = generator.uniform(0.02, 0.08)  # s, of the base
        self._history = History()
        self._since: float | None = None  # monotonic s at which the fault began
        self._begun = 0.0
        self._is_met = False  # whether the crate is there, as the monitor can know
        self._stood_at: float | None = None
        self._tick = self._applied = 0
        self._lag = 0.0
        self._now = time.monotonic()
        if fault.stops:
            scene, speed = str(generator.choice(["stands", "walks"], p=[0.7, 0.3])), generator.uniform(0.3, 1.2)
            self._drives, self._at_gap = generator.uniform(0.8, 1.6), generator.uniform(0.65, 2.6)
        elif type(fault) is Fault and generator.random() < 0.7:
            scene, speed = "passes", generator.uniform(0.3, 1.2)
            self._drives = generator.uniform(0.5, 1.0)
        else:
            scene, speed = "appears", generator.uniform(0.2, 0.7)
            self._drives = generator.uniform(0.9, 1.3)
        self._draw(generator, scene, speed)
        self.outcome = Outcome(fault.name, scene, speed, fault.stops)

    def _draw(self, generator: np.random.Generator, scene: str, speed: float) -> None:
        """Draw where the crate is, or appears, before the robot, and how it walks."""
        side = generator.choice([-1.0, 1.0])
        reach, self._walk = RADIUS_ROBOT + RADIUS_CRATE, np.zeros(2)
        if scene == "stands":
            angle = generator.uniform(-0.2, 0.2)
            ahead = self._at_gap + speed * self._drives * 0.8 + reach
            self._place = ahead * np.array([np.cos(angle), 0.3 * np.sin(angle)])
        elif scene == "walks":
            ahead = speed * self._drives + generator.uniform(1.5, 2.5)
            self._place = np.array([ahead, side * generator.uniform(2.0, 3.0)])
            self._walk = generator.uniform(0.3, 1.3) * np.array([generator.uniform(-0.6, 0.2), -side])
        elif scene == "passes":
            self._place = np.array([generator.uniform(1.5, 4.0), side * (reach + generator.uniform(0.65, 1.5))])
            self._walk = np.array([generator.uniform(-0.8, 0.8), 0.0])
        else:
            self._place = np.array([0.0, 0.0])
            least = speed**2 / (2 * DECELERATION) + 0.4 * speed + 0.05
            self._appears = least + generator.uniform(0.0, 0.4) + reach

    # -- the world in real time

    def _step(self, speed: float) -> None:
        """Let a tick pass. speed: of the planner's commands (m/s)."""
        nodes, world = self._nodes, self._world
        self._tick += 1
        wait = self._now + TICK - time.monotonic()
        time.sleep(max(wait, 0.001))
        until = time.monotonic()
        self._lag = until - self._now
        self.outcome.lag = max(self.outcome.lag, self._lag)
        while self._now < until:
            dt = min(0.005, until - self._now)
            self._now += dt
            kept = nodes.commands
            while self._applied + 1 < len(kept) and kept[self._applied + 1][0] + self._latency <= self._now:
                self._applied += 1
            obeyed = kept[self._applied][1] if kept and kept[self._applied][0] + self._latency <= self._now else 0.0
            world.advance(obeyed, dt)
            self._watch()
        if self._tick % STATES_EVERY == 0:
            self._tell()
        if self._tick % COMMANDS_EVERY == 0:
            active = self._fault if self._since is not None else _NOTHING
            for each in active.commands(nodes, speed):
                nodes.send(each)

    def _tell(self) -> None:
        nodes, world = self._nodes, self._world
        stamp = nodes.now
        walk = (float(self._world.walk[0]), float(self._world.walk[1]))
        self._history.keep(self._now, (stamp, world.x, world.v, tuple(world.crate.tolist()), walk))
        active = self._fault if self._since is not None else _NOTHING
        told = self._history.newest(self._now - active.delay(self._now - (self._since or self._now)))
        if told is None:
            return
        stamp, x, v, crate, walk = told
        nodes.odometry("odom", stamp, (x, 0.0), (v, 0.0))
        active.crate(lambda: nodes.odometry("crate", stamp, crate, walk), lambda: nodes.lost(stamp, crate))

    def _watch(self) -> None:
        """Keep what the world shows now."""
        outcome, world = self.outcome, self._world
        gap, v = world.gap, world.v
        if not self._is_met:
            return
        if v > STANDS:
            outcome.margin = min(outcome.margin, gap - world.closing**2 / (2 * DECELERATION))
            outcome.nearest = min(outcome.nearest, gap)
            outcome.contact = max(outcome.contact, v) if gap <= 0.0 else outcome.contact

    # -- the course of an encounter

    def play(self) -> Outcome:
        """Drive, inject the fault, wait for a standstill, take the fault back."""
        outcome = self.outcome
        self._fault.prepare(self._nodes)
        self._rest()
        self._nodes.forget()
        outcome.lag = 0.0
        self._applied = 0
        self._world.crate = self._world.x * np.array([1.0, 0.0]) + self._place
        if outcome.scene == "appears":
            self._world.crate = np.array([self._world.x + AWAY, 0.0])
        self._world.walk, self._is_met = self._walk, outcome.scene != "appears"
        self._drive()
        if outcome.scene == "passes":
            return self._finish()
        self._begin()
        while self._now - self._begun < GIVE_UP and not self._is_over():
            self._step(outcome.speed)
        return self._finish()

    def _drive(self) -> None:
        """Drive until the fault is due; all of an encounter beside the lane."""
        outcome, begun = self.outcome, self._now
        while self._now - begun < GIVE_UP:
            self._step(outcome.speed)
            outcome.oldest = max(outcome.oldest, self._nodes.age)
            passed = [speed for _, speed in self._nodes.commands]
            first = next((k for k, speed in enumerate(passed) if speed > 0.0), None)
            if first is not None and outcome.scene != "walks":  # before a crate that comes a stop is not needless
                stops = sum(speed == 0.0 for speed in passed[first:])
                if stops > outcome.needless:
                    outcome.needless, outcome.why_needless = stops, outcome.why_needless or self._nodes.said
            driven = self._now - begun
            if outcome.scene == "passes":
                if driven > 4.0:
                    return
            elif outcome.scene == "stands":
                if driven > self._drives and self._world.gap <= max(self._at_gap, 0.65):
                    return
            elif driven > self._drives:
                return

    def _begin(self) -> None:
        outcome, world = self.outcome, self._world
        if outcome.scene == "appears":
            world.crate, world.walk = np.array([world.x + self._appears, 0.0]), np.zeros(2)
            self._is_met = True
        outcome.met_at, outcome.met_gap = world.v, world.gap
        self._begun = self._since = time.monotonic()
        self._fault.begin(self._nodes)

    def _is_over(self) -> bool:
        """Note the first stop and the standstill. Return whether the standstill has been held."""
        outcome, nodes = self.outcome, self._nodes
        if outcome.fault == "two monitors" and nodes.others is not None:
            self._since = nodes.others
        assert self._since is not None
        if outcome.commanded is None:
            stop = next((at for at, speed in nodes.commands if at >= self._since and speed == 0.0), None)
            outcome.commanded = None if stop is None else stop - self._since
            outcome.said = nodes.said
        if outcome.commanded is None:
            return False
        if self._world.v >= STANDS:
            outcome.broke = outcome.broke or self._stood_at is not None
            return False
        if self._stood_at is None:
            self._stood_at = self._now
            outcome.stood = max(0.0, self._now - self._since)
        outcome.said = nodes.said if nodes.said.startswith("stops") else outcome.said
        return self._now - self._stood_at > HOLD

    def _finish(self) -> Outcome:
        """Take the fault back, drive away the crate, and wait until the guard passes commands."""
        self._is_met = False
        had, self._since = self._since, None
        if had is not None:
            self._fault.end(self._nodes)
        lag = self.outcome.lag
        self.outcome.recovered = self._rest()
        self.outcome.lag = lag
        return self.outcome

    def _rest(self) -> float | None:
        """Stand with the crate away until the guard passes commands, and the machine keeps up for a while.

        Return after how long (s) the guard passed commands; None: it did not.
        """
        world, begun, passed = self._world, self._now, None
        world.crate, world.walk = np.array([world.x + AWAY, 0.0]), np.zeros(2)
        calm = 0.0
        while self._now - begun < PATIENCE:
            self._step(0.0)
            stands = self._nodes.passes and world.v < STANDS
            passed = self._now - begun if stands and passed is None else passed
            calm = calm + self._lag if stands and self._lag < LATE and self._nodes.age < FRESH else 0.0
            if calm > CALM:
                break
        return passed


_NOTHING: Final = Fault(np.random.default_rng(0))


def drawn_faults(generator: np.random.Generator, count: int) -> list[Fault]:
    """Return one fault for each encounter: each kind as often as the others, and one in five without, in any order."""
    without = max(1, round(SHARE_WITHOUT * count))
    found: list[Fault] = [Fault(generator) for _ in range(without)]
    while len(found) < count:
        found += all_faults(generator)
    found = found[:count]
    return [found[k] for k in generator.permutation(len(found))]


def play_all(count: int, seed: int, words: Path | None, results: Path | None) -> list[Outcome]:
    """Play encounters with one set of nodes. words: where to keep what the nodes print; results: the outcomes."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    generator, done = np.random.default_rng(seed), []
    bar = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with tempfile.TemporaryDirectory() as folder:
        nodes, world = Nodes(words or Path(folder)), World()
        try:
            nodes.rack(WHOLE_RACK)
            with bar:
                task = bar.add_task("encounters", total=count)
                for fault in drawn_faults(generator, count):
                    bar.update(task, description=f"{fault.name:<20}")
                    for _ in range(AGAIN):
                        done.append(Encounter(generator, fault, nodes, world).play())
                        if done[-1].lag <= LATE:
                            break  # else the world did not move in real time
                    bar.advance(task)
                    if not sys.stderr.isatty():
                        print(_line(done[-1]), flush=True)
                    if results is not None:  # a run that is ended early keeps what it has
                        results.write_text(json.dumps([asdict(each) for each in done]))
        finally:
            nodes.close()
    return done


def _line(outcome: Outcome) -> str:
    seconds = "did not stand" if outcome.stood is None else f"stood after {outcome.stood:.2f} s"
    return (
        f"{outcome.fault:<20} {outcome.scene:<8} {seconds}, margin {outcome.margin:.2f} m, needless {outcome.needless}"
        f" {outcome.why_needless[:80]!r}, recovered {outcome.recovered}, said {outcome.said[:80]!r}"
    )


def main() -> None:
    """Play the encounters, or read those of earlier runs, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300, help="encounters (default: 300)")
    parser.add_argument("--quick", action="store_true", help="about one encounter of each fault")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--read", type=Path, nargs="+", default=[], help="results of --json, in place of a run")
    parser.add_argument("--json", type=Path, help="write the outcomes to this file")
    parser.add_argument("--png", type=Path, help="draw the times and the distances")
    parser.add_argument("--words", type=Path, help="an empty folder for what the nodes print")
    args = parser.parse_args()
    if args.read:
        done = [Outcome(**each) for path in args.read for each in json.loads(path.read_text())]
    else:
        done = play_all(22 if args.quick else args.count, args.seed, args.words, args.json)
    print("\n".join(table(done)))
    if args.png is not None:
        draw(done, args.png)


if __name__ == "__main__":
    main()
