"""Many of the random scenes of test/monitor/test_against_queries.py, most of their bodies meshes.

    python benchmarks/against_queries.py --seeds 500 --profile fast
    python benchmarks/against_queries.py --seeds 500 --set distance_tolerance=0.005 --set contact_margin=0.02

Six bodies drift, turn, jump and change their shape: meshes, open meshes, soups, compounds, clouds and convex shapes. At
each step, `contact` of every pair judges the contacts and their bounds, and each collision has to have been a contact
or a prediction before. Prints every disagreement, and exits with 1 if there is one.
"""

from __future__ import annotations

import argparse
import sys
import traceback
import warnings
from pathlib import Path

import numpy as np
import trimesh

import collision_monitor as cm
from collision_monitor.world.arm import link

sys.path.insert(0, str(Path(__file__).parents[1] / "test" / "monitor"))

from test_against_queries import KINDS, Scene

STEPS = 30
MESHES = ("ring", "star", "hollow", "link", "soup", "open")
_RING = trimesh.creation.torus(1.0, 0.3, major_sections=10, minor_sections=6)
_HALF = _RING.faces[_RING.triangles_center[:, 0] > -0.5]


def _soup(rng: np.random.Generator, size: float) -> cm.Shape:
    corners = rng.normal(size=(20, 1, 3)) + 0.3 * rng.normal(size=(20, 3, 3))
    return cm.Mesh(size * corners.reshape(-1, 3), np.arange(60).reshape(-1, 3))


ALL = KINDS | {
    "open": lambda rng, s: cm.Mesh(_RING.vertices * s, _HALF),
    "soup": _soup,
    "link": lambda rng, s: link(1.5 * s, 0.25 * s),
}


class MeshScene(Scene):
    """A scene with mostly meshes."""

    def _shape(self) -> object:
        kinds = MESHES if self.rng.random() < 0.6 else tuple(ALL)
        return ALL[self.rng.choice(kinds)](self.rng, 10 ** self.rng.uniform(-0.7, 0.5))


def main() -> int:
    """Run the scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--profile", default="fast")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=NUMBER", help="change a setting")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    changes = {name: float(value) for name, value in (each.split("=") for each in args.set)}
    steps = onsets = wrong = 0
    for seed in range(args.first, args.first + args.seeds):
        scene = MeshScene(seed, args.profile)
        scene.monitor.profile = scene.monitor.profile.replace(**changes)
        scene.slack = 2e-3
        try:
            for _ in range(STEPS):
                scene.step()
                scene.move()
                steps += 1
        except AssertionError as error:
            wrong += 1
            print(f"seed {seed}: {traceback.extract_tb(error.__traceback__)[-1].line} {error}", flush=True)
        onsets += scene.onsets
    print(f"{args.seeds} scenes, {steps} steps, {onsets} collisions began, {wrong} scenes disagree")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
