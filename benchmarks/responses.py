"""Compare the responses of simulated bodies: energy, penetration and cost, as Markdown tables and pictures.

    python benchmarks/responses.py                        # tables; some minutes
    python benchmarks/responses.py --pictures docs/images

Costs are processor time per simulated second.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.cli.output.progress import progress_bar
from collision_monitor.report.footprint import footprint
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world import make_scene
from collision_monitor.world.pendulums import Pendulums
from collision_monitor.world.rigid.impulse_response import ImpulseResponse
from collision_monitor.world.rigid.penalty_response import PenaltyResponse
from collision_monitor.world.rigid.response_choice import METHODS
from collision_monitor.world.rigid.responses import Response
from collision_monitor.world.rigid.rigid_bodies import RigidBodies
from collision_monitor.world.rigid.rigid_scene import RigidScene
from collision_monitor.world.rigid.stick_response import StickResponse

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


class View(NamedTuple):
    """How a scene is drawn: for how long (s), from above or from the side, ranges (m), and names of hidden bodies."""

    seconds: float
    from_above: bool
    x: tuple[float, float]
    y: tuple[float, float]
    left_out: tuple[str, ...] = ()


VIEWS: Final = {
    "billiards": View(1.2, True, (-1.45, 1.45), (-0.8, 0.8)),
    "pile": View(4.0, False, (-1.5, 1.5), (-0.25, 2.3), ("wall_left", "wall_right")),
    "slope": View(4.0, False, (-5.2, 3.5), (-0.3, 2.2)),
    "pendulums": View(1.2, False, (-0.45, 0.85), (0.0, 0.3)),
}
FROM_THE_SIDE: Final = Pose((0, 0, 0), (-np.sqrt(0.5), 0, 0, np.sqrt(0.5)))
"""Turns z to y, so that the view from above shows x and z."""
FINE: Final = 2e-5
"""Step (s) of the drawing of an impact, which takes a millisecond."""


def drop(response: Response, seconds: float, step: float = 1e-3) -> tuple[Array, float]:
    """Heights (n,) in m of a ball of 0.1 m dropped from 1 m, after each step (s), and the cost (s per s)."""
    shapes = [Sphere(0.1), Box((4, 4, 1))]
    world = RigidBodies(
        shapes, np.array([[0, 0, 1.1], [0, 0, -0.5]]), np.tile([0, 0, 0, 1.0], (2, 1)), np.arange(2) == 1, np.ones(2)
    )
    response.advance(world, 1e-6)
    begin, heights = time.process_time(), []
    for _ in range(int(seconds / step + 1e-6)):
        response.advance(world, step)
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

    figure, (far, near) = plt.subplots(1, 2, figsize=(11, 3.8), layout="constrained")
    for name, response in responses(0.8, GRAVITY, 5.0).items():
        heights, _ = drop(response, 2.5)
        far.plot(1e-3 * np.arange(1, len(heights) + 1), heights, label=name)
    landing = np.sqrt(2.0 / GRAVITY)
    for color, name in (("C1", "penalty"), ("C2", "damped")):
        heights, _ = drop(responses(0.8, GRAVITY, 5.0)[name], landing + 0.003, FINE)
        at = FINE * np.arange(1, len(heights) + 1) - landing
        near.plot(1e3 * at, 1e3 * heights, color)
    near.axhspan(-2.0, 0.0, color="0.9", zorder=0)
    near.text(2.95, -1.9, "ground", ha="right", va="bottom", color="0.4")
    far.set(xlabel="time (s)", ylabel="height (m)", title="A ball dropped from 1 m, restitution 0.8")
    near.set(xlabel="time since it reached the ground (ms)", ylabel="height (mm)", title="First impact of the springs")
    near.set(ylim=(-2.0, 4.0), xlim=(-1.0, 3.0))
    figure.legend(*far.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(folder / "responses.png", dpi=110)

    figure, panels = plt.subplots(2, 2, figsize=(11, 6.2), layout="constrained", width_ratios=(1.25, 1))
    for panel, (name, view) in zip(panels.ravel(), VIEWS.items(), strict=True):
        draw_scene(panel, name, view)
    figure.savefig(folder / "response_scenes.png", dpi=110)


def draw_scene(panel: Any, name: str, view: View) -> None:
    """Draw the paths of the bodies, and where they are in the end."""
    scene = make_scene(name, objects=5 if name == "pendulums" else None)
    states = [scene.step() for _ in range(int(view.seconds * scene.rate))]
    turn = Pose() if view.from_above else FROM_THE_SIDE
    moving = {int(state["id"]): Pose(state["position"], state["quaternion"]) for state in states[-1]}
    for described in scene.descriptions:
        pose = moving.get(described.object_id) or described.pose
        if pose is not None and described.name not in view.left_out:
            seen = turn @ pose
            still = described.object_id not in moving
            for outline in footprint(described, seen.position, seen.quaternion):
                colors = {"fc": "0.88", "ec": "0.5"} if still else {"fc": f"C{described.object_id % 10}", "ec": "k"}
                panel.fill(*outline.T, **colors, lw=0.6, zorder=1 if still else 3)
    tracks = np.array([state["position"] for state in states]) @ turn.rotation.T
    for k, each in enumerate(np.moveaxis(tracks, 1, 0)):
        panel.plot(each[:, 0], each[:, 1], lw=0.8, color=f"C{(k + 1) % 10}", zorder=2)
    panel.set(title=f"{name}, {view.seconds:g} s", xlabel="m", ylabel="m", aspect="equal", xlim=view.x, ylim=view.y)


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
