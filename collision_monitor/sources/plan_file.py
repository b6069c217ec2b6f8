"""Plan files: objects with plans, and a static world, as YAML or JSON.

objects:
  agv_1:
    shape: {box: [1.2, 0.8, 0.5]}                 # or `shapes: [...]`, as in a sources file
    times: [0, 10, 12]                            # s, of one clock of all files
    poses: [[0, 0, 0], [10, 0, 0], [10, 2, 0]]    # x y z, or x y z qx qy qz qw
    headings: [0, 0, 1.57]                        # rad about z, in place of quaternions
    between: straight                             # or arc, curve (with `twists`, `accelerations`): see Trajectory
    then: rest                                    # or go on, unknown
  shelf: {static: true, shape: {box: [8, 1, 3]}, pose: [4, 3, 1.5]}
ignore: [[agv_1, trailer_1]]                      # pairs that may touch
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.query.conflicts.planned_scene import DatedPlan, PlannedScene
from collision_monitor.settings.regular_file import read_regular
from collision_monitor.settings.yaml_file import key_lines, read_yaml
from collision_monitor.shapes.pose import Pose
from collision_monitor.sources.ground.mapping import located
from collision_monitor.sources.ground.yaml_table import SHAPES, numbers, pose, shape, table, truth

LARGEST_JSON: Final = 1 << 28
"""Bytes of a plan file in JSON: 10,000 plans of 200 points. One in YAML has the limits of all YAML files."""

_PLAN: Final = ("times", "poses", "headings", "twists", "accelerations", "between", "then")
_KEYS: Final = ("shape", "shapes", "static", "pose", *_PLAN)


def read_plan_file(path: Path) -> PlannedScene:
    """Read a plan file. Raises InputError with the file, the line (of YAML), the object and the key."""
    lines: dict[str, int] = {}
    if path.suffix.lower() == ".json":
        content = _read_json(path)
    else:
        content = read_yaml(path)
        lines = key_lines(path)
    try:
        return _scene(content)
    except CollisionMonitorError as error:
        raise InputError(located(str(error), str(path), lines)) from None


def _read_json(path: Path) -> Any:
    data = read_regular(path, "a plan file", most=LARGEST_JSON)
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: expected JSON, got: {error!s:.200}") from None


def _scene(content: Any) -> PlannedScene:
    top = table(content, "the file", ("objects", "ignore"))
    objects = top.get("objects")
    if not isinstance(objects, dict) or not objects:
        raise InputError(f"objects: expected a table of names, got {objects!r:.200}")
    scene = PlannedScene()
    for key, value in objects.items():
        name = str(key)
        given = table(value, name, _KEYS)
        parts = _parts(given, name)
        if truth(given.get("static", False), f"{name}, static"):
            for unused in _PLAN:
                if unused in given:
                    raise InputError(f"{name}, {unused}: expected none of a static object, which stands at its `pose`")
            scene.static[name] = parts, pose(given["pose"], f"{name}, pose") if "pose" in given else Pose()
        else:
            scene.shapes[name], scene.plans[name] = parts, DatedPlan(0, _plan(given, name))
    scene.ignored = _ignored(top.get("ignore", []))
    return scene


def _parts(given: dict[str, Any], name: str) -> Any:
    shapes = given.get("shapes", [given["shape"]] if "shape" in given else [])
    if ("shape" in given and "shapes" in given) or not isinstance(shapes, list) or not shapes:
        raise InputError(f"{name}, shape: expected `shape`, one of {', '.join(SHAPES)}, or `shapes`, a list of them")
    return tuple(shape(each, name) for each in shapes)


def _plan(given: dict[str, Any], name: str) -> Trajectory:
    for key in ("times", "poses"):
        if key not in given:
            raise InputError(f"{name}, {key}: expected those of its plan, or `static: true`, got none")
    if "pose" in given:
        raise InputError(f"{name}, pose: expected one of static objects only; a plan has `poses`")
    times, poses = (numbers(given[key], f"{name}, {key}") for key in ("times", "poses"))
    if "headings" in given:
        headings = numbers(given["headings"], f"{name}, headings")
        if poses.ndim != 2 or poses.shape[1] != 3 or headings.shape != poses.shape[:1]:
            raise InputError(
                f"{name}, headings: expected one for each of the `poses` [x, y, z], got shape {headings.shape} for "
                f"poses of shape {poses.shape}"
            )
        half = 0.5 * headings
        poses = np.column_stack([poses, np.zeros((len(half), 2)), np.sin(half), np.cos(half)])
    choices: dict[str, Any] = {key: given[key] for key in ("between", "then") if key in given}
    rates = (key for key in ("twists", "accelerations") if key in given)
    choices |= {key: numbers(given[key], f"{name}, {key}") for key in rates}
    try:
        return Trajectory(times, poses, **choices)
    except CollisionMonitorError as error:
        raise InputError(f"{name}, {error}") from None


def _ignored(given: Any) -> list[tuple[str, str]]:
    if not isinstance(given, list) or not all(isinstance(pair, list) and len(pair) == 2 for pair in given):
        raise InputError(f"ignore: expected a list of pairs of names, got {given!r:.200}")
    return [(str(a), str(b)) for a, b in given]
