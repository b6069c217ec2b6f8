"""A small scene, run through the pipeline and the recorder like in the node."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from collision_monitor import records
from collision_monitor.codec import Removal, encode_descriptions, encode_states
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorder
from collision_monitor.session.recording.recorder import FLUSH_PERIOD
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Sphere

NODE = "/object_monitor"
TYPES = {
    f"{NODE}/objects/shapes": "ObjectDescriptionArray",
    f"{NODE}/objects/states": "ObjectStateArray",
    f"{NODE}/contacts": "ContactArray",
    f"{NODE}/predictions": "PredictedCollisionArray",
    f"{NODE}/status": "MonitorStatus",
}
SHAPES, STATES, CONTACTS, PREDICTIONS, STATUS = TYPES
SETTINGS = f"{NODE}/settings"
START = 1_700_000_000_000_000_000
STEP = 10_000_000


def inputs(steps: int) -> Iterator[tuple[str, bytes]]:
    """Inputs (topic, bytes): three kinds of bodies that swing along x through each other, and invalid messages."""
    shapes = [Sphere(0.5), Box((1.0, 0.6, 0.4)), Capsule(0.3, 0.8)]
    objects = [ObjectDescription(k, shapes[k % 3], name=f"body {k}") for k in range(1, 7)]
    wall = ObjectDescription(9, Box((0.2, 8, 8)), name="wall", static=True, pose=Pose((4, 0, 0)))
    yield SHAPES, encode_descriptions(START, "world", [*objects, wall], snapshot=True)
    generator = np.random.default_rng(7)
    phase, speed = generator.uniform(0, 6.28, 6), generator.uniform(0.5, 3.0, 6)
    states = np.zeros(6, records.STATE)
    states["id"] = np.arange(1, 7)
    states["quaternion"][:, 3] = 1.0
    for k in range(steps):
        t = k * STEP * 1e-9
        states["position"][:, 0] = 4.2 * np.sin(phase + speed * t)
        states["linear"][:, 0] = 4.2 * speed * np.cos(phase + speed * t)
        states["angular"][:, 2] = 0.3
        data = encode_states(START + k * STEP, "world", k + 1, states)
        if k == 10:
            yield STATES, data[:50]  # cut
            yield STATES, encode_states(START + k * STEP, "elsewhere", k + 1, states)
        if k == 20:
            yield SHAPES, encode_descriptions(START, "world", [Removal(3)])
        if k == 30:
            yield SHAPES, encode_descriptions(START, "world", [objects[2]])
        yield STATES, data


def record(
    path: Path,
    steps: int = 50,
    *,
    close: bool = True,
    pipeline: Pipeline | None = None,
    switches: Mapping[int, Profile] | None = None,
    pauses: Collection[int] = (),
    **options: Any,
) -> Recorder:
    """Record the scene like the node. switches: profile by the number of the input before which it is set.
    pauses: numbers of the inputs before which it waits for the recorder's flush, which ends a chunk of the file.
    options: arguments of the recorder."""
    pipeline = pipeline or Pipeline("balanced")
    switches = switches or {}
    types = {**TYPES, SETTINGS: "ParameterEvent"} if switches else TYPES
    recorder = Recorder(path, types, pipeline.metadata(node=NODE), **options)
    now = START
    recorder.write(STATUS, pipeline.status(), now, now)
    for k, (topic, data) in enumerate(inputs(steps)):
        now += STEP
        if k in pauses:
            time.sleep(2.0 * FLUSH_PERIOD)
        if k in switches:
            change = pipeline.change_settings(switches[k], now, NODE)
            recorder.write(SETTINGS, change.settings, now, now, settings=pipeline.settings())
            if change.shapes is not None:
                recorder.write(SHAPES, change.shapes, now, now, objects=tuple(pipeline.catalogue.descriptions.values()))
        if topic == SHAPES:
            pipeline.on_shapes(data)
            recorder.write(topic, data, now, now, objects=tuple(pipeline.catalogue.descriptions.values()))
            continue
        outputs = pipeline.on_states(data)
        recorder.write(topic, data, now, now)
        if outputs is not None:
            stamp = outputs.result.stamp_ns
            begins = bool((outputs.result.contacts["phase"] == records.Phase.BEGIN).any())
            recorder.write(CONTACTS, outputs.contacts, now, stamp, event=begins)
            recorder.write(PREDICTIONS, outputs.predictions, now, stamp)
            if outputs.result.step % 5 == 0:
                recorder.write(STATUS, pipeline.status(recording=1, rate=100.0), now, now)
        if recorder.snapshot_due:
            recorder.write_snapshot(pipeline.snapshot())
    if close:
        recorder.close()
    return recorder
