"""Measure the event-driven simulation of hard spheres, and draw it beside simulations with a time step.

    python benchmarks/hard_spheres.py                     # Markdown tables; about 5 minutes
    python benchmarks/hard_spheres.py --png docs/images   # and hard_spheres_steps.png, hard_spheres_pressure.png

1. Conservation over 10 million collisions: energy, momentum, overlaps.
2. Pressure against Carnahan and Starling, and against the first eleven virial coefficients.
3. Cost and error against the step: event-driven; the scene "particles", which backs up to each contact; and a
   simulation that only looks for overlaps at the end of each step, as that scene did before.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from collision_monitor.response.two_bodies import collide
from collision_monitor.world.hard_spheres.simulation import HardSpheres, carnahan_starling
from collision_monitor.world.hard_spheres.starting_points import overlapping_spheres
from collision_monitor.world.hard_spheres.time_step import step_spheres
from collision_monitor.world.rigid.collision_response import bounce_between_walls

Array = NDArray[np.float64]
PACKINGS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45)
VIRIAL = (1, 4, 10, 18.364768, 28.2244, 39.8151, 53.3444, 68.538, 85.813, 105.775, 127.9)
"""Coefficients of the powers of the packing: N. Clisby and B. M. McCoy, J. Stat. Phys. 122 (2006), and later."""
STEPS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
SPHERES, PACKING, DURATION = 500, 0.2, 4.0


def conservation(collisions: int) -> None:
    """Print the drifts over this many collisions."""
    spheres = HardSpheres(4000, 0.45, walls="periodic")
    energy, deepest, begin = spheres.energy, 0.0, time.thread_time()
    while spheres.collisions < collisions:
        spheres.run(1.0)
        deepest = max(deepest, deepest_overlap(spheres))
    seconds = time.thread_time() - begin
    moved = (spheres.masses * np.linalg.norm(spheres.velocities, axis=1)).sum()
    print(f"collisions                {spheres.collisions:,} in {seconds:.1f} s of one core")
    print(f"relative energy drift     {spheres.energy / energy - 1:.1e}")
    print(f"relative momentum         {np.linalg.norm(spheres.momentum) / moved:.1e}")
    print(f"deepest overlap           {deepest:.1e} diameters\n")


def deepest_overlap(spheres: HardSpheres) -> float:
    """Return the deepest overlap (m), 0 without any."""
    at, side = np.mod(spheres.positions, spheres.side), spheres.side
    pairs = cKDTree(at, boxsize=side).query_pairs(2 * spheres.radii.max(), output_type="ndarray")
    offset = at[pairs[:, 1]] - at[pairs[:, 0]]
    offset -= side * np.rint(offset / side)
    return float((2 * spheres.radii[0] - np.linalg.norm(offset, axis=1)).max(initial=0.0))


def pressures(collisions: int) -> list[tuple[float, float, float]]:
    """Return packing, compressibility and its standard error, each over about this many collisions."""
    rows = []
    print("| packing | measured | Carnahan–Starling | difference | virial series |")
    print("|---|---|---|---|---|")
    for packing in PACKINGS:
        spheres = HardSpheres(4000, packing, walls="periodic")
        spheres.run(4.0)
        block = 4.0 * collisions / 10 / spheres.collisions
        values = []
        for _ in range(10):
            spheres.run(block)
            values.append(spheres.compressibility)
        mean, error = float(np.mean(values)), float(np.std(values) / 3)
        theory, series = carnahan_starling(packing), sum(b * packing**k for k, b in enumerate(VIRIAL))
        rows.append((packing, mean, error))
        print(
            f"| {packing:g} | {mean:.4f} ± {error:.4f} | {theory:.4f} | {100 * (mean / theory - 1):+.2f} % "
            f"| {series:.4f} |",
            flush=True,
        )
    print()
    return rows


def overlap_step(at: Array, moving: Array, radii: Array, masses: Array, side: float, dt: float) -> tuple[Array, Array]:
    """Fly for `dt`, then let the pairs that overlap at the end collide: what the lecture's first loop does."""
    at, moving = bounce_between_walls(at, moving, radii[:, None], side - radii[:, None], dt)
    for a, b in overlapping_spheres(at, radii, None).tolist():
        moving[a], moving[b] = collide(moving[a], moving[b], at[b] - at[a], masses[a], masses[b])
    return at, moving


def against_the_step() -> dict[str, list[float]]:
    """Return cost (s per simulated second) and the part of missed collisions for each step and method.

    The error is measured where chaos has not begun: each step starts from the exact state, and a sphere is wrong if
    its velocity at the end of the step is not that of the event-driven simulation.
    """
    result: dict[str, list[float]] = {name: [] for name in ("events", "backed up", "overlaps", "right", "missed")}
    print(
        "| step (s) | event-driven | step, backing up | step, overlaps at its end | collided spheres wrong: backing up "
        "| overlaps |"
    )
    print("|---|---|---|---|---|---|")
    for dt in STEPS:
        spheres = HardSpheres(SPHERES, PACKING, 3)
        cost = np.zeros(3)
        hit = wrong_back = wrong_overlap = 0
        steps = math.ceil(min(DURATION, 400 * dt) / dt)
        step_spheres(spheres.positions, spheres.velocities, spheres.radii, spheres.masses, spheres.side, dt, 1.0)
        for _ in range(steps):
            start = spheres.positions, spheres.velocities, spheres.radii, spheres.masses, spheres.side, dt
            clock = [time.thread_time()]
            spheres.run(dt)
            clock.append(time.thread_time())
            backed_up = step_spheres(*start, 1.0)[1]
            clock.append(time.thread_time())
            overlaps = overlap_step(*start)[1]
            clock.append(time.thread_time())
            cost += np.diff(clock)
            collided = (np.abs(spheres.velocities - start[1]) > 1e-9).any(axis=1)
            hit += np.count_nonzero(collided)
            wrong_back += np.count_nonzero((np.abs(backed_up - spheres.velocities) > 1e-6).any(axis=1))
            wrong_overlap += np.count_nonzero((np.abs(overlaps - spheres.velocities) > 0.05).any(axis=1))
        cost /= steps * dt
        result["events"].append(cost[0])
        result["backed up"].append(cost[1])
        result["overlaps"].append(cost[2])
        result["right"].append(wrong_back / max(hit, 1))
        result["missed"].append(min(wrong_overlap / max(hit, 1), 1.0))
        print(
            f"| {dt:g} | {cost[0]:.4f} s | {cost[1]:.4f} s | {cost[2]:.4f} s | {100 * result['right'][-1]:.2f} % "
            f"| {100 * result['missed'][-1]:.1f} % |",
            flush=True,
        )
    return result


def draw(folder: Path, rows: list[tuple[float, float, float]], steps: dict[str, list[float]]) -> None:
    """Save the two pictures."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for name, label, style in (
        ("overlaps", "overlaps at the step's end", "C1o-"),
        ("backed up", "backing up to each contact", "C2s-"),
        ("events", "event-driven", "C0^-"),
    ):
        left.loglog(STEPS, steps[name], style, label=label)
    left.set(xlabel="step (s)", ylabel="CPU time per simulated second (s)", title="Cost")
    right.semilogx(STEPS, 100 * np.array(steps["missed"]), "C1o-", label="overlaps at the step's end")
    right.semilogx(STEPS, 100 * np.array(steps["right"]), "C2s-", label="backing up to each contact")
    right.set(xlabel="step (s)", ylabel="spheres with a wrong velocity\n(% of those that collided)")
    right.set_title("Error of a step")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.suptitle(f"{SPHERES} hard spheres at packing {PACKING:g}, mean speed 1.6 diameters per second")
    figure.savefig(folder / "hard_spheres_steps.png", dpi=110)

    packing, measured, error = np.array(rows).T
    theory = carnahan_starling(packing)
    dense = np.linspace(0.0, 0.46, 200)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    left.plot(dense, carnahan_starling(dense), "C0-", label="Carnahan–Starling")
    left.plot(packing, measured, "C3o", label="measured")
    left.set(xlabel="packing", ylabel="compressibility P V / N kT", title="Pressure")
    sparse = dense[dense < 0.36]
    series = sum(b * sparse**k for k, b in enumerate(VIRIAL))
    right.axhspan(-0.5, 0.5, color="C0", alpha=0.1, label="0.5 %")
    right.plot(sparse, 100 * (series / carnahan_starling(sparse) - 1), "C2--", label="virial series")
    right.errorbar(packing, 100 * (measured / theory - 1), 100 * error / theory, fmt="C3o", label="measured")
    right.set(xlabel="packing", ylabel="difference from Carnahan–Starling (%)", title="Difference")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(loc="lower right")
    figure.savefig(folder / "hard_spheres_pressure.png", dpi=110)


def main() -> None:
    """Run all three measurements."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--collisions", type=int, default=10_000_000, help="collisions of 1. (default: 10 million)")
    parser.add_argument("--png", type=Path, metavar="FOLDER", help="save the pictures in this folder")
    args = parser.parse_args()
    conservation(args.collisions)
    rows = pressures(args.collisions // 5)
    steps = against_the_step()
    if args.png:
        draw(args.png, rows, steps)


if __name__ == "__main__":
    main()
