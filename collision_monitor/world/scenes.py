"""Table of the scenes, and their construction by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final

from collision_monitor.errors import InputError
from collision_monitor.world.arm import Arm
from collision_monitor.world.clutter import Clutter
from collision_monitor.world.crossing import Crossing
from collision_monitor.world.fleet import Fleet
from collision_monitor.world.measured import Measured
from collision_monitor.world.recorded_tracks import RecordedTracks
from collision_monitor.world.rigid.response_choice import AS_USUAL, ResponseChoice
from collision_monitor.world.scene import Scene
from collision_monitor.world.swarm import Swarm

_TRACKS: Final = "trajectory"


@dataclass(frozen=True)
class _RegisteredScene:
    make: Callable[[int | None, int, float | None, Path | None], Scene]
    description: str
    respond: Callable[[int | None, int, float | None, ResponseChoice], Scene] | None = None
    """Makes the scene with options of the response, if it has any; then used in place of `make`."""


def _particles(objects: int | None, seed: int, rate: float | None, _path: Path | None) -> Scene:
    from collision_monitor.world.particles import Particles  # here, so that names and help do not wait for its kernel

    return Particles(objects, seed, rate)


def _hard_spheres(objects: int | None, seed: int, rate: float | None, _path: Path | None) -> Scene:
    from collision_monitor.world.hard_spheres.hard_spheres_scene import HardSpheresScene  # here for the same reason

    return HardSpheresScene(objects, seed, rate)


def _responding(module: str, scene: str, description: str) -> _RegisteredScene:
    """Register a scene with options of the response; imported when it is made, as it loads kernels."""

    def respond(objects: int | None, seed: int, rate: float | None, choice: ResponseChoice) -> Scene:
        made: Scene = getattr(import_module(f"collision_monitor.world.{module}"), scene)(objects, seed, rate, choice)
        return made

    return _RegisteredScene(lambda n, seed, rate, path: respond(n, seed, rate, AS_USUAL), description, respond)


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
    "billiards": _responding("billiards", "Billiards", "a cue ball hits a triangle of balls on a table with cushions"),
    "slope": _responding("slope", "Slope", "boxes and balls of different friction slide and roll down a slope"),
    "pile": _responding("pile", "Pile", "boxes and balls fall into a bin and come to rest on each other"),
    "pendulums": _responding("pendulums", "Pendulums", "rows of balls on rods, some of them pulled aside"),
    _TRACKS: _RegisteredScene(
        lambda objects, seed, rate, path: RecordedTracks(objects, rate, path),
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


def check_path(name: str, path: str | Path | None) -> None:
    """Raise InputError if a scene would ignore the path of recorded tracks."""
    if path is not None and name != _TRACKS:
        raise InputError(f"path: expected the scene {_TRACKS!r}, which plays recorded tracks, got {name!r} with {path}")


def make_scene(
    name: str,
    *,
    objects: int | None = None,
    seed: int = 1,
    rate: float | None = None,
    path: str | Path | None = None,
    noise: float = 0.0,
    restitution: float | None = None,
    gravity: float | None = None,
    response: str | None = None,
) -> Scene:
    """Create the scene of this name, at time 0.

    objects: number of moving objects (None: the scene's default); rate: Hz (None: the scene's default); path: recorded
    tracks, for the scene "trajectory"; noise: standard deviation of the states, as a localiser reports them
    (`Measured`). restitution (0 to 1), gravity (m/s²), response (impulse, penalty, damped or stick): for scenes of
    bodies that respond to each other (None: the scene's default). Raises InputError for an unknown name (with the list
    of names) and for values that the scene does not accept.
    """
    registered = _registered(name)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InputError(f"seed: expected a whole number from 0, got {seed!r}")
    check_path(name, path)
    choice = ResponseChoice(restitution, gravity, response)
    if choice == AS_USUAL:
        scene = registered.make(objects, seed, rate, None if path is None else Path(path))
    elif registered.respond is None:
        able = ", ".join(other for other, entry in _SCENES.items() if entry.respond is not None)
        raise InputError(f"restitution, gravity, response: expected one of the scenes {able}, got {name!r}")
    else:
        scene = registered.respond(objects, seed, rate, choice)
    return scene if noise == 0.0 else Measured(scene, noise, seed)
