"""Compare the responses of simulated bodies: energy, penetration and cost, as Markdown tables and pictures.

    python benchmarks/responses.py                        # tables; some minutes
    python benchmarks/responses.py --pictures docs/images

Costs are processor time per simulated second.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.cli.progress import progress_bar
from collision_monitor.geometry.shapes import Box, Sphere
from collision_monitor.world import make_scene
from collision_monitor.world.impulse_response import ImpulseResponse
from collision_monitor.world.penalty_response import PenaltyResponse
from collision_monitor.world.pendulums import Pendulums
from collision_monitor.world.response_choice import METHODS
from collision_monitor.world.responses import Response
from collision_monitor.world.rigid_bodies import RigidBodies
from collision_monitor.world.rigid_scene import RigidScene
from collision_monitor.world.stick_response import StickResponse

Array = NDArray[np.float64]
SCENES: Final = ("billiards", "slope", "pile", "pendulums")
GRAVITY: Final = 9.81
SECONDS: Final = 10.0


def responses(restitution: float, gravity: float, speed: float) -> dict[str, Response]:
    """One of each."""
    return {
        "impulse": ImpulseResponse(restitution, gravity),
        "penalty": PenaltyResponse(1.0, gravity, speed),
        "damped": PenaltyResponse(restitution, gravity, speed),
        "stick": StickResponse(gravity),
    }


def drop(response: Response, seconds: float) -> tuple[Array, float]:
    """Heights (n,) of a ball of 0.1 m dropped from 1 m, every millisecond (m), and the cost (s per s)."""
    shapes = [Sphere(0.1), Box((4, 4, 1))]
    world = RigidBodies(
        shapes, np.array([[0, 0, 1.1], [0, 0, -0.5]]), np.tile([0, 0, 0, 1.0], (2, 1)), np.arange(2) == 1, np.ones(2)
    )
    response.advance(world, 1e-6)
    begin, heights = time.process_time(), []
    for _ in range(int(1000 * seconds)):
        response.advance(world, 1e-3)
        heights.append(world.position[0, 2] - 0.1)
    return np.array(heights), (time.process_time() - begin) / seconds


def stack(response: Response, seconds: float) -> tuple[float, float, float]:
    """Ten boxes of 1 m on each other: largest motion, largest speed in the last second, cost (s per s)."""
    places = [(0.02 * (-1) ** i, 0.01 * (i % 3), 0.5 + i) for i in range(10)] + [(0.0, 0.0, -0.5)]
    shapes = [Box((1, 1, 1))] * 10 + [Box((10, 10, 1))]
    turned = np.tile([0, 0, 0, 1.0], (11, 1))
    world = RigidBodies(shapes, np.array(places), turned, np.arange(11) == 10, np.full(11, 0.5))
    response.advance(world, 1e-6)
    start, begin, fastest = world.position.copy(), time.process_time(), 0.0
    steps = int(100 * seconds)
    for step in range(steps):
        response.advance(world, 0.01)
        if step >= steps - 100:
            fastest = max(fastest, float(np.abs(world.velocity).max()))
    return float(np.abs(world.position - start).max()), fastest, (time.process_time() - begin) / seconds


def play(name: str, method: str, seconds: float) -> tuple[float, float, float]:
    """A scene: part of the energy that is left, deepest penetration (m), cost (s per s)."""
    scene = make_scene(name, response=method)
    assert isinstance(scene, RigidScene | Pendulums)
    start, deepest = scene.energy, 0.0
    scene.step(1e-3)
    begin = time.process_time()
    for _ in range(int(seconds * scene.rate)):
        scene.step()
        if isinstance(scene, RigidScene):
            deepest = max(deepest, -float(scene.world.touching(0.0).gap.min(initial=0.0)))
        else:
            deepest = max(deepest, scene.penetration)
    return scene.energy / start, deepest, (time.process_time() - begin) / seconds


def tables() -> None:
    """Print all tables."""
    print("| ball dropped from 1 m, restitution 0.8 | second height (0.64 m) | deepest (m) | ms per s |")
    print("|---|---:|---:|---:|")
    for name, response in responses(0.8, GRAVITY, 5.0).items():
        heights, cost = drop(response, 1.3)
        bounce = int(np.argmax(np.diff(heights) > 0.0)) if name != "stick" else 0
        second = f"{heights[bounce:].max():.4f}" if bounce else "–"
        print(f"| {name} | {second} | {max(-heights.min(), 0.0):.1e} | {1e3 * cost:.0f} |", flush=True)
    print("\n| ten boxes on each other for 60 s | moved (m) | speed at the end (m/s) | ms per s |")
    print("|---|---:|---:|---:|")
    for name, response in responses(0.3, GRAVITY, 5.0).items():
        if name != "penalty":
            moved, speed, cost = stack(response, 60.0)
            print(f"| {name} | {moved:.1e} | {speed:.1e} | {1e3 * cost:.0f} |", flush=True)
    print(f"\n| scene, {SECONDS:g} s | response | energy left | deepest (m) | ms per s |")
    print("|---|---|---:|---:|---:|")
    with progress_bar("scenes", len(SCENES) * len(METHODS)) as done:
        for name in SCENES:
            for method in METHODS:
                left, deepest, cost = play(name, method, SECONDS)
                print(f"| {name} | {method} | {100 * left:.4g} % | {deepest:.1e} | {1e3 * cost:.0f} |", flush=True)
                done(1)


def draw(folder: Path) -> None:
    """Draw the heights of a dropped ball, and the scenes."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained")
    for name, response in responses(0.8, GRAVITY, 5.0).items():
        heights, _ = drop(response, 2.5)
        at = 1e-3 * np.arange(1, len(heights) + 1)
        axes[0].plot(at, heights, label=name)
        axes[1].plot(at, np.maximum(-heights, 0.0) * 1e3, label=name)
    axes[0].set(xlabel="time (s)", ylabel="height (m)", title="a ball dropped from 1 m, restitution 0.8")
    axes[1].set(xlabel="time (s)", ylabel="penetration (mm)", title="penetration of the ground")
    axes[0].legend()
    figure.savefig(folder / "responses.png", dpi=110)

    figure, panels = plt.subplots(2, 2, figsize=(11, 7), layout="constrained")
    views = {"billiards": ((0, 1), 1.2), "slope": ((0, 2), 4.0), "pile": ((0, 2), 4.0), "pendulums": ((0, 2), 1.2)}
    for panel, (name, ((x, y), seconds)) in zip(panels.ravel(), views.items(), strict=True):
        scene = make_scene(name, objects=5 if name == "pendulums" else None)
        tracks = np.array([scene.step()["position"] for _ in range(int(seconds * scene.rate))])
        panel.plot(tracks[:, :, x], tracks[:, :, y], lw=0.8, alpha=0.8)
        panel.plot(tracks[-1, :, x], tracks[-1, :, y], "k.", ms=5)
        panel.set(title=f"{name}, {seconds:g} s", xlabel="m", ylabel="m", aspect="equal")
    figure.savefig(folder / "response_scenes.png", dpi=110)


def main() -> None:
    """Measure and print, or draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw the pictures into this folder instead")
    folder = parser.parse_args().pictures
    if folder is None:
        tables()
    else:
        draw(folder)


if __name__ == "__main__":
    main()
