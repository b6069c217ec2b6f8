"""Compare predictions with what really happens: things that turn, brake, fall and swing, by what its states say.

Each encounter is simulated: a body moves as a real one does, another one stands, or crosses its way. The monitor gets
one state of each and predicts. A prediction is false if it is certain and the bodies do not meet within the horizon;
missed if they meet and nothing is predicted; late if contact comes before the predicted time. Prints a Markdown table.

    python benchmarks/motion_models.py                    2,000 encounters of each kind, 3 minutes
    python benchmarks/motion_models.py --quick            200 of each, half a minute
    python benchmarks/motion_models.py --png docs/images/motion_models.png

arm_models.py has the rows of an arm of seven joints, whose truth takes longer.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.records import STATE, PredictionStatus, StateFlag
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import from_rotation_vector, multiply

Array = NDArray[np.float64]

HORIZONS: Final = (0.5, 1.0, 2.0, 4.0)
TICK: Final = 0.004
"""s between the simulated poses; the time of contact is interpolated between two."""

NEAR: Final = 0.05
PARTS: Final = 8
"""Distance (m) below which the bodies are compared between two ticks too, and at how many parts of the tick."""

GRAVITY: Final = 9.81
VALID, BODY, STOPS = StateFlag.ACCELERATION_VALID, StateFlag.BODY_TWIST, StateFlag.STOPS
SECOND: Final = 1_000_000_000
UP: Final = np.array([0.0, 0.0, 1.0])
LATE: Final = 1e-3
"""s by which contact may come before the predicted time: the simulation's own error."""


@dataclass
class Path3:
    """Poses of a body at the ticks: positions (T, 3), quaternions (T, 4); and what is known at the first one."""

    position: Array
    quaternion: Array
    velocity: Array
    angular: Array
    acceleration: Array

    def poses(self) -> Array:
        """Poses (T, 7) at the ticks."""
        return np.concatenate([self.position, self.quaternion], axis=1)


@dataclass
class Encounter:
    """Two bodies; the path of the second one may be that of a body at rest."""

    shapes: tuple[Any, Any]
    paths: tuple[Path3, Path3]


Ticks = Array
Make = Callable[[np.random.Generator, Ticks], tuple[Any, Path3]]


def yawed(position: Array, yaw: Array, speed: Array, rate: Array, slowing: float) -> Path3:
    """A body on wheels, which moves where it looks. speed, rate (T,): m/s, rad/s; slowing: m/s^2."""
    quaternion = from_rotation_vector(yaw[:, None] * UP)
    ahead = np.stack([np.cos(yaw[0]), np.sin(yaw[0]), 0.0 * yaw[0]])
    turning = rate[0] * UP
    centripetal = np.cross(turning, speed[0] * ahead)
    return Path3(position, quaternion, speed[0] * ahead, turning, -slowing * ahead + centripetal)


def driven(speed: Array, rate: Array, ticks: Ticks, slowing: float = 0.0) -> Path3:
    """Integrate a body on wheels with a speed and a rate (T,) from the origin on, by the middle of each tick."""
    step = np.diff(ticks)
    yaw = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step)])
    middle, mean = 0.5 * (yaw[1:] + yaw[:-1]), 0.5 * (speed[1:] + speed[:-1])
    moved = (mean * step)[:, None] * np.stack([np.cos(middle), np.sin(middle), 0.0 * middle], axis=1)
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(moved, axis=0)])
    return yawed(position, yaw, speed, rate, slowing)


def still(position: Array, ticks: Ticks) -> Path3:
    """A body that stands."""
    n, zero = len(ticks), np.zeros(3)
    return Path3(np.tile(position, (n, 1)), np.tile([0.0, 0, 0, 1.0], (n, 1)), zero, zero, zero)


def walking(position: Array, velocity: Array, ticks: Ticks) -> Path3:
    """A body that keeps its velocity."""
    made = still(position, ticks)
    made.position = made.position + ticks[:, None] * velocity
    made.velocity = velocity
    return made


ROBOT: Final = cm.Box((0.8, 0.5, 0.6))
CAR: Final = cm.Box((4.2, 1.8, 1.5))
PERSON: Final = cm.Cylinder(0.25, 1.8)


def robot_in_a_bend(rng: np.random.Generator, ticks: Ticks) -> tuple[Any, Path3]:
    """A differential drive at 0.5 to 1.5 m/s that turns at 0.2 to 0.8 rad/s."""
    speed, rate = rng.uniform(0.5, 1.5), rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.8)
    return ROBOT, driven(np.full(len(ticks), speed), np.full(len(ticks), rate), ticks)


def braking_car(rng: np.random.Generator, ticks: Ticks, bends: bool = False) -> tuple[Any, Path3]:
    """A car at 3 to 10 m/s that brakes with 2 to 6 m/s^2 until it stands."""
    first, slowing = rng.uniform(3.0, 10.0), rng.uniform(2.0, 6.0)
    speed = np.maximum(first - slowing * ticks, 0.0)
    rate = (rng.uniform(-0.4, 0.4) if bends else 0.0) * speed / first
    return CAR, driven(speed, rate, ticks, slowing)


def car_that_brakes_in_a_bend(rng: np.random.Generator, ticks: Ticks) -> tuple[Any, Path3]:
    """The same, on a circle."""
    return braking_car(rng, ticks, bends=True)


def path_of_two_bends(rng: np.random.Generator, ticks: Ticks) -> tuple[Any, Path3]:
    """A robot at 0.8 m/s whose path bends one way, then the other."""
    rates, change = rng.uniform(-0.8, 0.8, 2), rng.uniform(0.5, 3.0)
    rate = np.where(ticks < change, *rates)
    return ROBOT, driven(np.full(len(ticks), 0.8), rate, ticks)


def gate(rng: np.random.Generator, ticks: Ticks) -> tuple[Any, Path3]:
    """A bar of 3 m that begins to turn down about its end later, at 0.5 to 1.5 rad/s, for a quarter of a turn."""
    begin, rate = rng.uniform(0.3, 3.0), rng.uniform(0.5, 1.5)
    angle = np.clip((ticks - begin) * rate, 0.0, np.pi / 2)
    return turned_rod(angle, 0.0, ticks, cm.Box((3.0, 0.1, 0.1)), 1.5)


def turned_rod(angle: Array, rate: float, ticks: Ticks, shape: Any, arm: float) -> tuple[Any, Path3]:
    """A rod that hangs on a hinge along y, its middle `arm` (m) from it."""
    quaternion = from_rotation_vector(angle[:, None] * np.array([0.0, 1.0, 0.0]))
    position = arm * np.stack([np.cos(angle), 0.0 * angle, -np.sin(angle)], axis=1)
    w = rate * np.array([0.0, 1.0, 0.0])
    v = np.cross(w, position[0])
    return shape, Path3(position, quaternion, v, w, np.cross(w, v))


def ball_with_drag(rng: np.random.Generator, ticks: Ticks) -> tuple[Any, Path3]:
    """A tennis ball in flight, thrown at 5 to 20 m/s; its drag is 0.02 1/m of the square of its speed."""
    v = rng.uniform(5.0, 20.0) * np.array([np.cos(a := rng.uniform(0.1, 0.9)), 0.0, np.sin(a)])
    first, position, at = v.copy(), np.zeros((len(ticks), 3)), np.zeros(3)
    fine = 8
    for k in range(1, len(ticks)):
        h = (ticks[k] - ticks[k - 1]) / fine
        for _ in range(fine):
            middle = v + 0.5 * h * (-GRAVITY * UP - 0.02 * np.linalg.norm(v) * v)
            at = at + h * middle
            v = v + h * (-GRAVITY * UP - 0.02 * np.linalg.norm(middle) * middle)
        position[k] = at
    quaternion = np.tile([0.0, 0, 0, 1.0], (len(ticks), 1))
    return cm.Sphere(0.033), Path3(position, quaternion, first, np.zeros(3), -GRAVITY * UP)


def pendulum(rng: np.random.Generator, ticks: Ticks) -> tuple[Any, Path3]:
    """A rod of 1 m that swings about its end."""
    angle, rate = np.pi / 2 + rng.uniform(-1.2, 1.2), rng.uniform(-2.0, 2.0)
    first, angles, fine = rate, np.zeros(len(ticks)), 8
    angles[0] = angle
    for k in range(1, len(ticks)):
        h = (ticks[k] - ticks[k - 1]) / fine
        for _ in range(fine):
            rate += 0.5 * h * 1.5 * GRAVITY * np.cos(angle)
            angle += h * rate
            rate += 0.5 * h * 1.5 * GRAVITY * np.cos(angle)
        angles[k] = angle
    return turned_rod(angles, first, ticks, cm.Capsule(0.03, 0.94), 0.5)


def along_z(path: Path3) -> Path3:
    """The path of a capsule, whose axis is z, in place of a rod along x."""
    across = from_rotation_vector(np.array([0.0, np.pi / 2, 0.0]))
    return Path3(path.position, multiply(path.quaternion, across), path.velocity, path.angular, path.acceleration)


@dataclass(frozen=True)
class Kind:
    """A kind of encounter: what moves, what it meets, and what its states may say of it."""

    name: str
    make: Make
    models: tuple[str, ...]
    meets: str = "stands"


KINDS: Final = (
    Kind("robot in a bend, posts", robot_in_a_bend, ("twist", "acceleration", "arc")),
    Kind("robot in a bend, people", robot_in_a_bend, ("twist", "acceleration", "arc"), "crosses"),
    Kind("braking car, posts", braking_car, ("twist", "acceleration", "stops")),
    Kind("braking car, people", braking_car, ("twist", "acceleration", "stops"), "crosses"),
    Kind("braking car, people behind", braking_car, ("twist", "acceleration", "stops"), "behind"),
    Kind("car that brakes in a bend", car_that_brakes_in_a_bend, ("twist", "acceleration", "arc that stops")),
    Kind("path of two bends", path_of_two_bends, ("twist", "acceleration", "arc", "plan")),
    Kind("gate that closes later", gate, ("twist", "plan")),
    Kind("ball with drag", ball_with_drag, ("twist", "acceleration", "plan")),
    Kind("pendulum", pendulum, ("twist", "acceleration", "arc", "plan")),
)

FLAGS: Final = {
    "twist": StateFlag(0),
    "acceleration": VALID,
    "arc": BODY,
    "stops": VALID | STOPS,
    "arc that stops": BODY | VALID | STOPS,
    "plan": StateFlag(0),
}

PLANNED: Final = 5
"""Ticks between two points of a plan, 0.02 s."""


def encounter(kind: Kind, rng: np.random.Generator, ticks: Ticks) -> Encounter:
    """A body and one that it meets, or misses by some decimetres, at some time."""
    shape, path = kind.make(rng, ticks)
    if isinstance(shape, cm.Capsule):
        path = along_z(path)
    near = path.position[rng.integers(len(ticks) // 16, len(ticks))]
    beside = rng.normal(size=3) * (0.0 if kind.make is ball_with_drag else 0.5)
    if kind.make in (ball_with_drag, gate, pendulum):
        where = near + beside + rng.normal(size=3) * 0.2
        return Encounter((shape, cm.Box((0.4, 0.4, 0.4))), (path, still(where, ticks)))
    beside[2] = 0.0
    if kind.meets == "stands":
        return Encounter((shape, PERSON), (path, still(near + beside * 2.0, ticks)))
    if kind.meets == "behind":
        back = path.position[0] - np.array([rng.uniform(2.6, 6.0), rng.uniform(-1.0, 1.0), 0.0])
        return Encounter((shape, PERSON), (path, still(back, ticks)))
    heading = rng.uniform(0.0, 2.0 * np.pi)
    velocity = rng.uniform(0.5, 1.8) * np.array([np.cos(heading), np.sin(heading), 0.0])
    when = ticks[rng.integers(len(ticks) // 16, len(ticks))]
    at = path.position[np.searchsorted(ticks, when)] + beside
    return Encounter((shape, PERSON), (path, walking(at - when * velocity, velocity, ticks)))


def between(poses: Array, at: Array, share: float) -> Array:
    """Poses between those of some ticks and the next ones."""
    mixed = (1.0 - share) * poses[at] + share * poses[at + 1]
    mixed[:, 3:] /= np.linalg.norm(mixed[:, 3:], axis=1, keepdims=True)
    return np.asarray(mixed)


def true_time(it: Encounter, ticks: Ticks) -> float:
    """First time (s) at which the bodies touch, infinite: never. Near each other, it looks between ticks."""
    poses = it.paths[0].poses(), it.paths[1].poses()
    found = cm.contacts(it.shapes[0], poses[0], it.shapes[1], poses[1]).signed_distance
    at = np.flatnonzero(np.minimum(found[1:], found[:-1]) < NEAR)
    times, gaps = [ticks], [found]
    for share in np.arange(1, PARTS) / PARTS if len(at) else ():
        one, other = between(poses[0], at, share), between(poses[1], at, share)
        gaps.append(cm.contacts(it.shapes[0], one, it.shapes[1], other).signed_distance)
        times.append(ticks[at] + share * (ticks[at + 1] - ticks[at]))
    time, gap = np.concatenate(times), np.concatenate(gaps)
    order = np.argsort(time)
    time, gap = time[order], gap[order]
    touching = np.flatnonzero(gap <= 0.0)
    if not len(touching):
        return inf
    k = int(touching[0])
    if k == 0:
        return 0.0
    share = gap[k - 1] / (gap[k - 1] - gap[k])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


def states_of(it: Encounter, model: str) -> NDArray[np.void]:
    """One state of each body, as the model tells them."""
    rows = np.zeros(2, STATE)
    rows["id"] = 1, 2
    for k, path in enumerate(it.paths):
        rows["position"][k], rows["quaternion"][k] = path.position[0], path.quaternion[0]
        rows["linear"][k], rows["angular"][k] = path.velocity, path.angular
        rows["acceleration"][k] = path.acceleration
    flags = FLAGS[model]
    rows["flags"][0] = flags
    if flags & BODY:
        R = cm.Pose((0, 0, 0), it.paths[0].quaternion[0]).rotation
        for name in ("linear", "angular", "acceleration"):
            rows[name][0] = R.T @ rows[name][0]
    return rows


def plan_of(path: Path3, ticks: Ticks) -> cm.Trajectory:
    """The path as a planner publishes it: a point every 0.02 s; of what does not turn, with its velocities."""
    velocities = np.gradient(path.position, ticks, axis=0)
    at = np.unique([*range(0, len(ticks), PLANNED), len(ticks) - 1])
    if (path.quaternion == path.quaternion[0]).all():
        return cm.Trajectory(ticks[at], path.poses()[at], velocities[at], then="go on")
    return cm.Trajectory(ticks[at], path.poses()[at], between="arc", then="go on")


@dataclass
class Score:
    """Counts over encounters, and the errors of the predicted times (s)."""

    certain: int = 0
    false: int = 0
    true: int = 0
    missed: int = 0
    late: int = 0
    errors: tuple[float, ...] = ()

    def shares(self) -> tuple[float, float, float]:
        """False of the certain ones, missed and late of the true ones."""
        return (
            self.false / max(self.certain, 1),
            self.missed / max(self.true, 1),
            self.late / max(self.true - self.missed, 1),
        )


def score(encounters: list[tuple[Encounter, float]], model: str, horizon: float, ticks: Ticks) -> Score:
    """Predict each encounter with a new monitor of two bodies, and compare with its true time."""
    found, errors = Score(), []
    profile = Profile.named("balanced").replace(horizon=horizon)
    for it, true in encounters:
        if true == 0.0:
            continue
        monitor = cm.Monitor(profile)
        for k in range(2):
            monitor.add(k + 1, it.shapes[k])
        if model == "plan":
            monitor.follow(1, plan_of(it.paths[0], ticks))
        rows = monitor.step(SECOND, states_of(it, model)).predictions
        is_certain = len(rows) > 0 and rows["status"][0] == PredictionStatus.HIT
        found.certain += is_certain
        found.false += is_certain and true > horizon + LATE
        if true <= horizon - LATE:
            found.true += 1
            found.missed += not len(rows)
            if len(rows):
                found.late += bool(rows["lower"][0] > true + LATE)
                if is_certain:
                    errors.append(abs(0.5 * (rows["lower"][0] + rows["upper"][0]) - true))
    found.errors = tuple(errors)
    return found


def line(kind: Kind, model: str, horizon: float, found: Score) -> str:
    """A row of the table."""
    shares = " | ".join(f"{100 * share:.0f} %" if share else "0" for share in found.shares())
    worst = f"{1e3 * float(np.quantile(found.errors, 0.99)):.1f}" if found.errors else "–"
    return f"| {kind.name} | {model} | {horizon:g} | {found.true} | {shares} | {worst} |"


def draw(results: dict[tuple[str, str, float], Score], path: Path) -> None:
    """A picture: false, missed and late shares at 2 s, by kind and model."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = [(kind, model) for kind in KINDS for model in kind.models]
    figure, axes = plt.subplots(1, 3, figsize=(11, 0.32 * len(rows) + 1.4), sharey=True)
    place = -np.arange(len(rows), dtype=float)
    for at, (kind, model) in enumerate(rows):
        shares = results[kind.name, model, 2.0].shares()
        is_last = model == kind.models[-1] and len(kind.models) > 1
        for axis, share in zip(axes, shares, strict=True):
            axis.barh(place[at], 100 * share, color="#1f77b4" if is_last else "#b0b7c0")
            axis.text(100 * share + 1.5, place[at], f"{100 * share:.0f}", va="center", fontsize=8)
    for axis, title in zip(
        axes, ("false, % of the certain", "missed, % of the true", "late, % of the predicted"), strict=True
    ):
        axis.set_title(title, fontsize=10, loc="left")
        axis.set_xlim(0, 115)
        axis.spines[["top", "right", "bottom"]].set_visible(False)
        axis.set_xticks([])
    axes[0].set_yticks(place, [f"{kind.name}: {model}" for kind, model in rows], fontsize=8)
    figure.suptitle("What a prediction is worth, by what the states say of the motion (2 s ahead)", x=0.01, ha="left")
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def main() -> int:
    """Run as a program; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000, help="encounters of each kind (default: 2000)")
    parser.add_argument("--quick", action="store_true", help="200 encounters of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds whose names contain this")
    parser.add_argument("--png", type=Path, help="draw the shares at 2 s")
    args = parser.parse_args()
    count, ticks = 200 if args.quick else args.count, np.arange(0.0, HORIZONS[-1] + TICK, TICK)
    results: dict[tuple[str, str, float], Score] = {}
    print("| What moves | its states say | horizon (s) | true | false | missed | late | error p99 (ms) |")
    print("|---|---|---|---|---|---|---|---|")
    for kind in KINDS:
        if args.only not in kind.name:
            continue
        rng = np.random.default_rng(args.seed)
        made = [encounter(kind, rng, ticks) for _ in range(count)]
        known = [(it, true_time(it, ticks)) for it in made]
        for model in kind.models:
            for horizon in HORIZONS:
                found = results[kind.name, model, horizon] = score(known, model, horizon, ticks)
                print(line(kind, model, horizon, found), flush=True)
    if args.png:
        draw(results, args.png)
        print(f"wrote {args.png}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
