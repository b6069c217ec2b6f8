"""Cost of probabilities: planes against the method that follows every sample, in turns, on the same steps.

For each scene with noisy states: ms a step of the profile `fast` (without probabilities), of `balanced`, and of
`balanced` with every sample followed; and how far the probabilities and times of both differ.

    python benchmarks/uncertain_states.py                    about two minutes
    python benchmarks/uncertain_states.py --scene fleet hall
    python benchmarks/uncertain_states.py --scene fleet "clutter of 100" --noise 0.05      larger errors
    python benchmarks/uncertain_states.py --scene "clutter of 1000" --threads 2
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.monitor import pair_probabilities
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import STATE
from collision_monitor.world import make_scene

States = NDArray[np.void]
Scene = tuple[Sequence[ObjectDescription], Iterator[States]]
PLANES, SAMPLES = pair_probabilities.FINEST_WITH_PLANES, float("inf")


def simulated(name: str, objects: int | None, noise: float) -> Scene:
    """Descriptions and states of a scene at 20 Hz, with the same noise in all quantities (m, rad, m/s and rad/s)."""
    scene = make_scene(name, objects=objects, noise=noise)

    def states() -> Iterator[States]:
        while True:
            yield scene.states()
            scene.step(0.05)

    return scene.descriptions, states()


def hall(people: int) -> Scene:
    """People that cross a hall at random, 0.125 for each square metre, uncertain by 0.05 m and 0.15 m/s."""
    random = np.random.default_rng(0)
    side = float(np.sqrt(8.0 * people))
    rows = np.zeros(people, STATE)
    rows["id"], rows["quaternion"][:, 3] = np.arange(people), 1.0
    rows["position"][:, :2] = random.uniform(0, side, (people, 2))
    rows["linear"][:, :2] = random.normal(0, 1, (people, 2))
    rows["position_stddev"], rows["velocity_stddev"] = 0.05, 0.15

    def states() -> Iterator[States]:
        while True:
            yield rows
            rows["position"] += 0.05 * rows["linear"]

    return [ObjectDescription(k, cm.Cylinder(0.25, 1.75)) for k in range(people)], states()


SCENES: dict[str, Callable[[float], Scene]] = {
    "fleet": lambda noise: simulated("fleet", None, noise),
    "fleet of 1000": lambda noise: simulated("fleet", 1000, noise),
    "hall": lambda noise: hall(200),
    "hall of 1000": lambda noise: hall(1000),
    "swarm of 100": lambda noise: simulated("swarm", 100, noise),
    "swarm of 1000": lambda noise: simulated("swarm", 1000, noise),
    "particles of 1000": lambda noise: simulated("particles", 1000, noise),
    "clutter of 100": lambda noise: simulated("clutter", 100, noise),
    "clutter of 300": lambda noise: simulated("clutter", 300, noise),
    "clutter of 1000": lambda noise: simulated("clutter", 1000, noise),
    "arm": lambda noise: simulated("arm", None, noise),
}


def measure(name: str, steps: int, noise: float, threads: int) -> str:
    """One row of the table."""
    descriptions, states = SCENES[name](noise)
    ways = {"fast": ("fast", PLANES), "planes": ("balanced", PLANES), "samples": ("balanced", SAMPLES)}
    profiles = {way: cm.Profile.named(name).replace(threads=threads) for way, (name, _) in ways.items()}
    monitors = {way: cm.Monitor(profile) for way, profile in profiles.items()}
    for monitor in monitors.values():
        for description in descriptions:
            monitor.describe(description)
    took: dict[str, list[float]] = {way: [] for way in ways}
    off: list[Any] = []
    for step in range(steps):
        rows = next(states)
        reported = {}
        for way, (_, finest) in ways.items():
            pair_probabilities.FINEST_WITH_PLANES = finest  # type: ignore[misc]
            began = time.perf_counter()
            result = monitors[way].step(50_000_000 * step, rows)
            took[way].append(1e3 * (time.perf_counter() - began))
            reported[way] = {(p["id_a"], p["id_b"]): p for p in result.predictions}
        for pair in reported["planes"].keys() & reported["samples"].keys():
            one, other = reported["planes"][pair], reported["samples"][pair]
            off.append([one[field] - other[field] for field in ("probability", "earliest", "most_likely")])
    ms = {way: np.array(times[2:]) for way, times in took.items()}
    apart = np.array(off)
    rms, worst = np.sqrt(np.mean(apart[:, 0] ** 2)), np.abs(apart[:, 0]).max()
    median = {way: float(np.median(times)) for way, times in ms.items()}
    return (
        f"| {name} | {len(descriptions)} | {median['fast']:.2f} | {median['planes']:.2f} "
        f"| {np.quantile(ms['planes'], 0.99):.1f} | {median['samples']:.1f} "
        f"| {median['samples'] / median['planes']:.1f} | {median['planes'] / median['fast']:.1f} "
        f"| {rms:.4f} | {worst:.3f} | {1e3 * np.median(np.abs(apart[:, 1])):.1f} |"
    )


def main() -> int:
    """Print a row for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=list(SCENES), metavar="NAME")
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--noise", type=float, default=0.005, help="of states, not in halls (m, rad, m/s, rad/s)")
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    print(
        "| scene | objects | fast (ms) | balanced (ms) | p99 (ms) | every sample (ms) | times as fast "
        "| balanced / fast | probability off by, RMS | worst | `earliest` off by, median (ms) |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|")
    for name in args.scene:
        print(measure(name, args.steps, args.noise, args.threads), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
