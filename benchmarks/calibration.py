"""Compare probabilities and times of impact of uncertain states with 50,000 true futures in each random scene.

A scene has two bodies with random shapes, motions and uncertainties. For each future the errors of position, velocity,
orientation and angular velocity are drawn independently, and the resulting impact is compared with the prediction.
Prints a Markdown table and ends with exit code 1 if a probability is off by more than 0.03 and the sampling error.

    python benchmarks/calibration.py                              about a minute
    python benchmarks/calibration.py --png docs/images/calibration.png
    python benchmarks/calibration.py --scenes 1000 --futures 5000 --seed 7
    python benchmarks/calibration.py --near            bodies near each other now, at rest or spinning fast
    python benchmarks/calibration.py --spinning        bodies of 4 cm to 3 m that pass each other and may spin fast
    python benchmarks/calibration.py --arcs            bodies that drive and turn, so that errors turn their paths too
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.records import STATE, StateFlag
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import from_rotation_vector, multiply

Array = NDArray[np.float64]
Shape = cm.Sphere | cm.Box | cm.Capsule | cm.Cylinder | cm.Cone | cm.ConvexHull | cm.Ellipsoid
HORIZON = 2.0
UNCERTAIN = ("position", "orientation", "velocity", "angular_velocity")
MOST_OFF = 0.03
"""Largest acceptable error of a probability."""

KINDS: dict[str, Callable[[np.random.Generator], Shape]] = {
    "sphere": lambda rng: cm.Sphere(rng.uniform(0.1, 0.6)),
    "box": lambda rng: cm.Box(rng.uniform(0.1, 1.5, 3)),
    "capsule": lambda rng: cm.Capsule(rng.uniform(0.05, 0.4), rng.uniform(0.2, 1.5)),
    "cylinder": lambda rng: cm.Cylinder(rng.uniform(0.1, 0.4), rng.uniform(0.1, 1.8)),
    "hull": lambda rng: cm.ConvexHull(rng.normal(0, 0.3, (12, 3))),
}

SPINNING: dict[str, Callable[[np.random.Generator, Array], Shape]] = {
    "sphere": lambda rng, size: cm.Sphere(size[0] / 2),
    "box": lambda rng, size: cm.Box(size),
    "capsule": lambda rng, size: cm.Capsule(size[0] / 4, size[1]),
    "cylinder": lambda rng, size: cm.Cylinder(size[0] / 2, size[1]),
    "cone": lambda rng, size: cm.Cone(size[0] / 2, size[1]),
    "hull": lambda rng, size: cm.ConvexHull(rng.normal(0, size / 3, (rng.integers(4, 20), 3))),
    "ellipsoid": lambda rng, size: cm.Ellipsoid(size / 2),
}
"""Shapes of `spinning_scene`, from their extents (3,) in m."""


@dataclass(frozen=True)
class Scene:
    """Two bodies: kinds, shapes, states (13,) as pose and twist, standard deviations (4,) in the order of UNCERTAIN."""

    kinds: tuple[str, str]
    shapes: tuple[Shape, Shape]
    states: tuple[Array, Array]
    sigmas: tuple[Array, Array]
    arcs: bool = False  # the twists are along the bodies' own axes, and stay so


@dataclass(frozen=True)
class Row:
    """Result of one scene.

    reported: whether the monitor predicts the pair. too_early: part of the impacts before `earliest`. late: part of the
    futures without an impact until `latest`; NaN without a `latest`. us: cost of the uncertainty (µs of CPU).
    """

    kinds: str
    reported: bool
    status: int
    probability: float
    truth: float
    too_early: float
    late: float
    us: float


def random_scene(rng: np.random.Generator, turning: bool) -> Scene:
    """Two random bodies that come near each other in the next seconds and miss by up to 2 m."""
    names = list(KINDS)
    kinds = (names[rng.integers(len(names))], names[rng.integers(len(names))])
    shapes = (KINDS[kinds[0]](rng), KINDS[kinds[1]](rng))
    velocity = rng.normal(0, 1, 3)
    velocity *= rng.uniform(0.2, 3.0) / np.linalg.norm(velocity)
    across = np.cross(velocity, rng.normal(0, 1, 3))
    across /= np.linalg.norm(across)
    p = -velocity * rng.uniform(0.4, 2.6) + across * rng.uniform(0.0, 2.0)
    carried = rng.normal(0, 1, 3)
    states = []
    for position, linear in ((rng.uniform(-5, 5, 3), carried), (None, carried + velocity)):
        q = rng.normal(0, 1, 4)
        angular = rng.normal(0, 1.0, 3) if turning else np.zeros(3)
        at = position if position is not None else states[0][:3] + p
        states.append(np.concatenate([at, q / np.linalg.norm(q), linear, angular]))
    scale = rng.choice([0.05, 0.2, 0.5])
    most = scale * np.array([1.0, 0.5 if turning else 0.0, 1.0, 0.5 if turning else 0.0])
    return Scene(kinds, shapes, (states[0], states[1]), (most * rng.uniform(0.1, 1, 4), most * rng.uniform(0.1, 1, 4)))


def near_scene(rng: np.random.Generator) -> Scene:
    """Two bodies that are near each other now, half of them above a floor; errors are large, small or none."""
    names = list(KINDS)
    kind = names[rng.integers(1, len(names))]
    shape, floor = KINDS[kind](rng), bool(rng.random() < 0.5)
    direction = np.array([0.0, 0.0, 1.0]) if floor else rng.normal(0, 1, 3)
    direction *= (0.5 + rng.uniform(0, 1.2) if floor else rng.uniform(0.5, 2.5)) / np.linalg.norm(direction)
    q = rng.normal(0, 1, (2, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    velocity, spin = rng.normal(0, rng.choice([0, 0.1, 0.5]), 3), rng.choice([0, 0.3, 2.0, 5.0]) * rng.normal(0, 0.6, 3)
    own = np.concatenate([direction, q[0], velocity, spin])
    other = np.concatenate([np.zeros(3), (0.0, 0.0, 0.0, 1.0) if floor else q[1], np.zeros(6)])
    sigmas = rng.choice([0.0, 0.02, 0.1, 0.3], 4), np.zeros(4) if floor else rng.choice([0.0, 0.05], 4)
    if not sigmas[0].any():
        sigmas[0][0] = 0.1  # else nothing is uncertain
    if floor:
        return Scene((kind, "floor"), (shape, cm.Box((30, 30, 1))), (own, other), sigmas)
    beside = names[rng.integers(1, len(names))]
    return Scene((kind, beside), (shape, KINDS[beside](rng)), (own, other), sigmas)


def spinning_scene(rng: np.random.Generator) -> Scene:
    """Two bodies of 4 cm to 3 m that pass near each other and spin by up to 14 rad/s, with errors of 1 mm to 0.13 m."""
    kinds = tuple(list(SPINNING)[rng.integers(len(SPINNING))] for _ in range(2))
    shapes = tuple(SPINNING[kind](rng, rng.choice([0.2, 1, 3]) * rng.uniform(0.2, 1, 3)) for kind in kinds)
    q = rng.normal(0, 1, (2, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    toward, across = rng.normal(0, 1, (2, 3))
    toward /= np.linalg.norm(toward)
    across = np.cross(toward, across)
    across /= np.linalg.norm(across)
    reach, speed = rng.uniform(0.3, 2.0), rng.uniform(0.2, 2.0)
    p = toward * (reach + speed * rng.uniform(0.1, 1.5)) + across * reach * rng.uniform(0, 1)
    spin = rng.uniform(-1, 1, (2, 3)) * rng.choice([0, 0.5, 2, 8])
    states = (
        np.concatenate([np.zeros(3), q[0], np.zeros(3), spin[0]]),
        np.concatenate([p, q[1], -speed * toward, spin[1]]),
    )
    sigmas = 10 ** rng.uniform(-2.7, -1.2) * rng.uniform(0.2, 2, 4)
    if rng.random() < 0.3:
        sigmas[[1, 3]] = 0.0
    return Scene((kinds[0], kinds[1]), (shapes[0], shapes[1]), states, (sigmas, sigmas))


def arc_scene(rng: np.random.Generator, level: bool) -> Scene:
    """Two bodies that drive at up to 2 m/s and turn at up to 1 rad/s, and come near each other; level: in the plane."""
    names = list(KINDS)
    kinds = (names[rng.integers(len(names))], names[rng.integers(len(names))])
    shapes, states = (KINDS[kinds[0]](rng), KINDS[kinds[1]](rng)), []
    for _ in range(2):
        turn = np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]) if level else rng.normal(0, 1, 3)
        axis = np.array([0.0, 0.0, 1.0]) if level else rng.normal(0, 0.6, 3)
        linear = np.array([rng.uniform(0.2, 2.0), 0.0, 0.0])
        states.append(np.concatenate([np.zeros(3), from_rotation_vector(turn), linear, axis * rng.uniform(-1.0, 1.0)]))
    one, other = (cm.Motion(cm.Pose(s[:3], s[3:7]), s[7:10], s[10:], frame="body") for s in states)
    t = rng.uniform(0.4, 2.2)
    beside = rng.normal(0, 0.7, 3) * (1.0, 1.0, 0.0 if level else 1.0)
    states[1][:3] = one.at(t).position - other.at(t).position + beside
    most = rng.choice([0.05, 0.2]) * np.array([1.0, 0.5, 1.0, 0.5])
    sigmas = most * rng.uniform(0.1, 1, 4), most * rng.uniform(0.1, 1, 4)
    return Scene(kinds, shapes, (states[0], states[1]), sigmas, arcs=True)


def predicted(scene: Scene, profile: Profile) -> tuple[np.void | None, bool, float]:
    """The monitor's prediction of the pair or None, whether the pair touches now, and the cost of uncertainty.

    The cost is the difference of the median steps with and without uncertainty (µs of CPU).
    """
    monitors = [cm.Monitor(profile) for _ in range(2)]
    seconds = []
    result = None
    for monitor, certain in zip(monitors, (True, False), strict=True):
        for k, shape in enumerate(scene.shapes):
            monitor.add(k, shape)
        rows = np.zeros(2, STATE)
        rows["id"] = 0, 1
        for k, state in enumerate(scene.states):
            rows["position"][k], rows["quaternion"][k] = state[:3], state[3:7]
            rows["linear"][k], rows["angular"][k] = state[7:10], state[10:]
            for name, sigma in zip(UNCERTAIN, scene.sigmas[k], strict=True):
                rows[f"{name}_stddev"][k] = 0.0 if certain else sigma
        rows["flags"] = StateFlag.BODY_TWIST if scene.arcs else 0
        result = monitor.step(0, rows)
        took = []
        for k in range(20):
            begin = time.process_time()
            monitor.step(k + 1, rows)
            took.append(time.process_time() - begin)
        seconds.append(np.median(took))
    assert result is not None
    reported = result.predictions[0] if len(result.predictions) else None
    return reported, len(result.contacts) > 0, 1e6 * float(seconds[1] - seconds[0])


def impact_times(scene: Scene, futures: int, rng: np.random.Generator) -> Array:
    """Times of impact (futures,) in s; infinite: none within the horizon."""
    motions = []
    for state, sigma in zip(scene.states, scene.sigmas, strict=True):
        off = rng.normal(size=(4, futures, 3)) * sigma[:, None, None]
        turned = multiply(from_rotation_vector(off[1]), np.tile(state[3:7], (futures, 1)))
        poses = np.column_stack([state[:3] + off[0], turned])
        motions.append((poses, np.column_stack([state[7:10] + off[2], state[10:] + off[3]])))
    a, b = scene.shapes
    frame: Literal["body", "world"] = "body" if scene.arcs else "world"
    answers = cm.times_of_impact(a, *motions[0], b, *motions[1], HORIZON, tolerance=1e-5, frame=frame)
    return np.where(answers.status == "clear", inf, answers.lower)


def compare(scene: Scene, profile: Profile, futures: int, rng: np.random.Generator) -> Row | None:
    """Return one row, or None if the pair touches from the start, because contacts have no prediction."""
    reported, touching, us = predicted(scene, profile)
    if touching:
        return None
    times = impact_times(scene, futures, rng)
    hits = times[times < inf]
    kinds = "–".join(sorted(scene.kinds))
    if reported is None:
        return Row(kinds, False, -1, 0.0, len(hits) / futures, 0.0, np.nan, us)
    late = np.mean(times > reported["latest"]) if reported["latest"] < inf else np.nan
    early = np.mean(hits < reported["earliest"]) if len(hits) > 20 else np.nan
    return Row(
        kinds,
        True,
        int(reported["status"]),
        float(reported["probability"]),
        len(hits) / futures,
        float(early),
        float(late),
        us,
    )


def crowd(people: int = 200, side: float = 40.0, steps: int = 20) -> str:
    """Measure a step of a crowd without and with uncertainty (ms of CPU); returns a line of text."""
    costs = []
    for stddev in (0.0, 0.15):
        rng = np.random.default_rng(0)
        monitor = cm.Monitor()
        for k in range(people):
            monitor.add(k, cm.Cylinder(0.25, 1.75))
        rows = np.zeros(people, STATE)
        rows["id"], rows["quaternion"][:, 3] = np.arange(people), 1.0
        rows["position"][:, :2], rows["linear"][:, :2] = (
            rng.uniform(0, side, (people, 2)),
            rng.normal(0, 1, (people, 2)),
        )
        rows["velocity_stddev"], rows["position_stddev"] = stddev, stddev / 3
        took = []
        for step in range(steps):
            begin = time.process_time()
            count = len(monitor.step(step * 33_000_000, rows).predictions)
            took.append(time.process_time() - begin)
            rows["position"] += 0.033 * rows["linear"]
        costs.append(f"{1e3 * np.median(took):.2g} ms a step with {count} predictions")
    return f"{people} people on {side:g} m x {side:g} m: {costs[0]}; uncertain: {costs[1]}"


def table(rows: list[Row], confidence: float) -> list[str]:
    """Lines of the Markdown table."""
    groups: dict[str, list[Row]] = {
        "stated to meet": [r for r in rows if r.reported and r.status != 2],
        "stated to pass, predicted": [r for r in rows if r.reported and r.status == 2],
        "stated to pass, not predicted": [r for r in rows if not r.reported],
        "all": rows,
    }
    lines = [
        f"| scenes | | probability off by, worst | RMS | before `earliest`, worst (stated {1 - confidence:.2f}) | mean "
        f"| after `latest`, worst (stated {1 - confidence:.2f}) | µs of CPU, median | worst |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for name, group in groups.items():
        if not group:
            continue
        off = np.array([r.probability - r.truth for r in group])
        early = np.array([r.too_early for r in group if np.isfinite(r.too_early) and r.reported] or [np.nan])
        late = np.array([r.late for r in group if np.isfinite(r.late)] or [np.nan])
        us = np.array([r.us for r in group])
        lines.append(
            f"| {name} | {len(group)} | {np.abs(off).max():.3f} | {np.sqrt(np.mean(off**2)):.4f} | {early.max():.3f} "
            f"| {early.mean():.3f} | {late.max():.3f} | {np.median(us):.0f} | {us.max():.0f} |"
        )
    return lines


def draw(rows: list[Row], confidence: float, path: Path) -> None:
    """Draw the stated against the true probability, and how often impacts come before the earliest time."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(10, 4.4), layout="constrained")
        left, right = figure.subplots(1, 2)
        line = np.array([0.0, 1.0])
        left.fill_between(line, line - MOST_OFF, line + MOST_OFF, color="0.9", label=f"within {MOST_OFF:g}")
        left.plot(line, line, color="0.5", linewidth=0.8)
        for name, color, which in (
            ("stated to meet", "tab:red", lambda r: r.reported and r.status != 2),
            ("stated to pass each other", "tab:blue", lambda r: r.reported and r.status == 2),
            ("not predicted", "0.3", lambda r: not r.reported),
        ):
            chosen = [r for r in rows if which(r)]
            x, y = [r.truth for r in chosen], [r.probability for r in chosen]
            left.plot(x, y, "o", color=color, markersize=4, alpha=0.7, label=f"{name}: {len(chosen)} scenes")
        left.set_xlabel("part of the true futures with an impact within 2 s")
        left.set_ylabel("stated probability")
        left.legend(frameon=False)
        early = np.sort([r.too_early for r in rows if r.reported and np.isfinite(r.too_early)])[::-1]
        right.bar(np.arange(len(early)), early, width=1.0, color="tab:blue")
        right.axhline(1.0 - confidence, color="tab:red", linewidth=1, label=f"stated: at most {1 - confidence:.2f}")
        right.set_xlabel("scenes, sorted")
        right.set_ylabel("part of the impacts before `earliest`")
        right.legend(frameon=False)
        figure.savefig(path, dpi=110)


def main() -> int:
    """Return exit code 1 if a probability is off by more than MOST_OFF and the sampling error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=120)
    parser.add_argument("--futures", type=int, default=50_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", default="balanced", choices=Profile.names())
    parser.add_argument("--samples", type=int, help="samples for each pair (default: the profile's)")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--near", action="store_true", help="bodies near each other now, at rest or spinning fast")
    which.add_argument("--spinning", action="store_true", help="bodies of 4 cm to 3 m that pass and may spin fast")
    which.add_argument("--arcs", action="store_true", help="bodies that drive and turn")
    parser.add_argument("--png", type=Path)
    args = parser.parse_args()
    profile = Profile.named(args.profile).replace(horizon=HORIZON)
    if args.samples:
        profile = profile.replace(uncertainty_samples=args.samples)
    rng = np.random.default_rng(args.seed)
    rows: list[Row] = []
    while len(rows) < args.scenes:
        if args.near:
            scene = near_scene(rng)
        elif args.spinning:
            scene = spinning_scene(rng)
        elif args.arcs:
            scene = arc_scene(rng, level=len(rows) % 2 == 0)
        else:
            scene = random_scene(rng, turning=len(rows) % 2 == 1)
        row = compare(scene, profile, args.futures, rng)
        if row is not None:
            rows.append(row)
    print("\n".join(table(rows, profile.confidence)))
    print(crowd())
    if args.png:
        draw(rows, profile.confidence, args.png)
    noise = 4.0 * np.sqrt(0.25 / args.futures)
    return int(any(abs(r.probability - r.truth) > MOST_OFF + noise for r in rows))


if __name__ == "__main__":
    sys.exit(main())
