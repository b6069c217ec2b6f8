"""Sessions of the demo scenes, recorded like the node's, with the same step times in every run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorder
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.world import make_scene
from collision_monitor.world.scene import Scene, States, state_array

NODE = "/object_monitor"
TYPES = {
    f"{NODE}/objects/shapes": "ObjectDescriptionArray",
    f"{NODE}/objects/states": "ObjectStateArray",
    f"{NODE}/contacts": "ContactArray",
    f"{NODE}/predictions": "PredictedCollisionArray",
    f"{NODE}/status": "MonitorStatus",
}
SHAPES, STATES, CONTACTS, PREDICTIONS, STATUS = TYPES
START = 1_700_000_000_000_000_000


def record_states(
    path: Path,
    descriptions: list[ObjectDescription],
    states: Iterable[tuple[float, States]],
    *,
    profile: str = "balanced",
    answers: bool = True,
    start: int = START,
) -> Path:
    """Record a session of states (s, records.STATE) from `start` (ns) on. answers: also record the answers."""
    pipeline = Pipeline(profile)
    recorder = Recorder(path, TYPES, pipeline.metadata(node=NODE), patient=True)
    shapes = encode_descriptions(start, "world", descriptions, snapshot=True)
    pipeline.on_shapes(shapes)
    recorder.write(SHAPES, shapes, start, start)
    for k, (seconds, rows) in enumerate(states):
        now = start + round(seconds * 1e9)
        data = encode_states(now, "world", k + 1, rows)
        outputs = pipeline.on_states(data)
        recorder.write(STATES, data, now, now)
        if answers and outputs is not None:
            recorder.write(CONTACTS, outputs.contacts, now, now)
            recorder.write(PREDICTIONS, outputs.predictions, now, now)
            status = pipeline.status(step_duration=0.001 + 0.0001 * (k % 7), recording=1)
            recorder.write(STATUS, status, now, now)
    recorder.close()
    return path


def played(scene: Scene, seconds: float) -> Iterable[tuple[float, States]]:
    """Times (s) and states of a scene, step by step."""
    yield scene.time, scene.states()
    while scene.time < seconds and not scene.finished:
        states = scene.step()
        yield scene.time, states


def record_scene(
    path: Path,
    name: str,
    seconds: float,
    *,
    objects: int | None = None,
    profile: str = "balanced",
    rename: Callable[[str], str] = str,
) -> Path:
    """Record a session of the named scene. rename: maps the names of its objects."""
    scene = make_scene(name, objects=objects)
    descriptions = [replace(each, name=rename(each.name)) for each in scene.descriptions]
    return record_states(path, descriptions, played(scene, seconds), profile=profile)


NASTY = "<script>alert('$x$ & y')</script>"
"""A name that must not be interpreted as HTML or TeX."""


def record_drive(path: Path, seconds: float = 3.0, *, speed: float = 1.0, **options: Any) -> Path:
    """Record a session of `drive_states`."""
    return record_states(path, *drive_states(seconds, speed), profile="exact", **options)


def drive_states(seconds: float, speed: float = 1.0) -> tuple[list[ObjectDescription], list[tuple[float, States]]]:
    """Objects and states of a compound cart (1), named NASTY, that drives into a post (2) 1.5 m ahead.

    A ball (3) approaches the cart until 0.5 s, then turns back before it hits. speed: of the cart (m/s).
    """
    objects = [
        ObjectDescription(1, [(Box((1, 0.6, 0.4)), Pose()), (Sphere(0.2), Pose((0.5, 0, 0)))], name=NASTY),
        ObjectDescription(2, Sphere(0.5), name="post", static=True, pose=Pose((2.7, 0, 0))),
        ObjectDescription(3, Sphere(0.3), name="ball"),
    ]
    states = []
    for t in np.arange(0.0, seconds, 0.02):
        rows = state_array(np.array([1, 3], np.uint32))
        rows["position"][0], rows["linear"][0] = (speed * t, 0, 0), (speed, 0, 0)
        rows["position"][1] = (1.5, 2.2 - min(t, 0.5) + max(t - 0.5, 0.0), 0)
        rows["linear"][1] = (0, 1 if t > 0.5 else -1, 0)
        states.append((float(t), rows))
    return objects, states
