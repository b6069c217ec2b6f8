"""Table of the scenes, and their construction by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from collision_monitor.errors import InputError
from collision_monitor.world.arm import Arm
from collision_monitor.world.clutter import Clutter
from collision_monitor.world.crossing import Crossing
from collision_monitor.world.fleet import Fleet
from collision_monitor.world.measured import Measured
from collision_monitor.world.scene import Scene
from collision_monitor.world.swarm import Swarm
from collision_monitor.world.trajectory import Trajectory


@dataclass(frozen=True)
class _RegisteredScene:
    make: Callable[[int | None, int, float | None, Path | None], Scene]
    description: str


def _particles(objects: int | None, seed: int, rate: float | None, _path: Path | None) -> Scene:
    from collision_monitor.world.particles import Particles  # here, so that names and help do not wait for its kernel

    return Particles(objects, seed, rate)


def _hard_spheres(objects: int | None, seed: int, rate: float | None, _path: Path | None) -> Scene:
    from collision_monitor.world.hard_spheres.scene import HardSpheresScene  # here for the same reason

    return HardSpheresScene(objects, seed, rate)


_SCENES = {
    "fleet": _RegisteredScene(
        lambda objects, seed, rate, path: Fleet(objects, seed, rate),
        "robots and people in a hall with racks, pillars and walls; some of them collide",
    ),
    "particles": _RegisteredScene(
        _particles,
        "spheres in a closed box that bounce off the walls and off each other",
    ),
    "hard_spheres": _RegisteredScene(
        _hard_spheres,
        "the same with every collision at its exact time, simulated from event to event",
    ),
    "clutter": _RegisteredScene(
        lambda objects, seed, rate, path: Clutter(objects, seed, rate),
        "boxes, spheres, capsules and cylinders that drift and turn through each other",
    ),
    "crossing": _RegisteredScene(
        lambda objects, seed, rate, path: Crossing(objects, rate),
        "nine pairs with known times of contact, repeated every 8 s",
    ),
    "swarm": _RegisteredScene(
        lambda objects, seed, rate, path: Swarm(objects, seed, rate),
        "drones that circle through each other's space; none flies straight",
    ),
    "arm": _RegisteredScene(
        lambda objects, seed, rate, path: Arm(objects, rate),
        "a robot arm over a table with bottles, all of concave meshes",
    ),
    "trajectory": _RegisteredScene(
        lambda objects, seed, rate, path: Trajectory(objects, rate, path),
        "plays recorded tracks of people and carts from CSV files (needs a path)",
    ),
}


def scene_names() -> list[str]:
    """Names that `make_scene` accepts."""
    return list(_SCENES)


def _registered(name: str) -> _RegisteredScene:
    if name not in _SCENES:
        raise InputError(f"scene: expected one of {', '.join(_SCENES)}, got {name!r}")
    return _SCENES[name]


def describe(name: str) -> str:
    """One-line description of a scene for users. Raises InputError with the list of names."""
    return _registered(name).description


def make_scene(
    name: str,
    *,
    objects: int | None = None,
    seed: int = 1,
    rate: float | None = None,
    path: str | Path | None = None,
    noise: float = 0.0,
) -> Scene:
    """Create the scene of this name, at time 0.

    objects: number of moving objects (None: the scene's default); rate: Hz (None: the scene's default); path: recorded
    tracks, for the scene "trajectory"; noise: standard deviation of the states, as a localiser reports them
    (`Measured`). Raises InputError for an unknown name (with the list of names) and for values that the scene does not
    accept.
    """
    registered = _registered(name)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InputError(f"seed: expected a whole number from 0, got {seed!r}")
    scene = registered.make(objects, seed, rate, None if path is None else Path(path))
    return scene if noise == 0.0 else Measured(scene, noise, seed)
