"""Snapshots: a restored pipeline gives the same bytes as the original one, from every moment."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator

import numpy as np
import pytest

from collision_monitor import records
from collision_monitor.codec import Removal, encode_descriptions, encode_states
from collision_monitor.errors import InputError
from collision_monitor.monitor import first_impacts
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Polygon,
    Shape,
    Sphere,
)

START, STEP = 1_000_000_000_000, 20_000_000
Answers = list[bytes | None]


def solids(rng: np.random.Generator) -> list[Shape]:
    """Solids; some are hulls of the same points, which share their vertices."""
    points = rng.uniform(-0.5, 0.5, (12, 3))
    tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    return [
        Sphere(0.4), Box((0.8, 0.5, 0.3)), Capsule(0.2, 0.6), Cylinder(0.3, 0.5), Cone(0.3, 0.6), Mesh(*tetrahedron),
        Ellipsoid((0.2, 0.3, 0.4)),
        ConvexHull(points), ConvexHull(points), ConvexHull(points[:8]),
    ]  # fmt: skip


def flats(rng: np.random.Generator) -> list[Shape]:
    square = [[-0.4, -0.4], [0.4, -0.4], [0.4, 0.4], [-0.4, 0.4]]
    return [Circle(0.4), Polygon(square), Polygon([[0, 0], [0.9, 0], [0.3, 0.3], [0, 0.9]]), Polygon(square, 0.1)]


def inputs(shapes: list[Shape], walls: list[ObjectDescription], steps: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Inputs ("shapes" or "states", message): objects that cross, appear, disappear and change; refused inputs."""
    rng = np.random.default_rng(seed)

    def described(i: int) -> ObjectDescription:
        shape = shapes[int(rng.integers(len(shapes)))]
        several = [(shape, Pose()), (shapes[0], Pose((0.5, 0.0, 0.0)))] if i % 5 == 0 else shape
        return ObjectDescription(i, several, name=f"body {i}", padding=0.02 * (i % 2), allowed=(1,) if i == 7 else ())

    ids = list(range(1, 21))
    yield "shapes", encode_descriptions(START, "", [*walls, *map(described, ids)], snapshot=True)
    start, velocity = rng.uniform(-2, 2, (20, 3)), rng.uniform(-2, 2, (20, 3))
    stamp = START
    for k in range(steps):
        stamp += STEP
        if k == steps // 2:
            stamp += 60_000_000_000  # the clock restarts, once a second message agrees
        states = np.zeros(20, records.STATE)
        states["id"], states["quaternion"][:, 3] = ids, 1.0
        turned = 0.02 * k * velocity
        states["position"] = 2.0 * np.sin(start + turned)
        states["linear"] = 2.0 * velocity * np.cos(start + turned)
        states["angular"][:, 2] = 0.5
        states["position_stddev"][::3] = 0.02 if k > 10 else 0.0
        if k % 7 == 3:
            yield "shapes", encode_descriptions(stamp, "", [Removal(1 + k % 20), described(1 + (k + 5) % 20)])
        if k % 9 == 4:
            yield "states", encode_states(stamp, "elsewhere", k, states)
        yield "states", encode_states(stamp, "", k + 1 + k // 8, states[k % 3 :])


def take(pipeline: Pipeline, topic: str, data: bytes) -> Answers:
    if topic == "shapes":
        pipeline.on_shapes(data)
        return [pipeline.status()]
    outputs = pipeline.on_states(data)
    return [pipeline.status()] + ([outputs.contacts, outputs.predictions] if outputs else [None])


WALL = ObjectDescription(90, Box((0.2, 6, 6)), name="wall", static=True, pose=Pose((1.5, 0, 0), (0, 0, 0.1, 0.995)))
FLOOR = ObjectDescription(91, HalfSpace((0, 0, 1), -1.5), name="floor", static=True, pose=Pose())
FENCE = ObjectDescription(90, Circle(1.0), name="post", static=True, pose=Pose())


@pytest.mark.parametrize("planar", [False, True])
def test_from_every_moment_the_bytes_are_the_same(planar: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_impacts, "FEWEST_PAIRS_FOR_THREADS", 2)
    make, walls = (flats, [FENCE]) if planar else (solids, [WALL, FLOOR])
    messages = list(inputs(make(np.random.default_rng(3)), walls, steps=60, seed=5))
    pipeline = Pipeline(Profile(uncertainty_samples=64))  # 1,024 would take most of the time
    frozen, answers = list[bytes](), list[Answers]()
    for message in messages:
        frozen.append(pipeline.snapshot().encode())
        answers.append(take(pipeline, *message))
    assert sum(len(a[1] or b"") > 300 for a in answers if len(a) == 3) > 30, "there are contacts"
    for k, data in enumerate(frozen):
        end = len(messages) if k % 16 == 0 else k + 4
        thawed = Pipeline.restored(Snapshot.decode(data), "world", {"threads": 1 + k % 2})
        for message, expected in zip(messages[k:end], answers[k:end], strict=True):
            assert take(thawed, *message) == expected
        if end == len(messages):
            assert thawed.monitor.digest == pipeline.monitor.digest
            assert thawed.monitor.ids == pipeline.monitor.ids


def test_what_goes_on_is_not_seen_in_a_snapshot_and_it_serves_twice() -> None:
    messages = list(inputs(solids(np.random.default_rng(3)), [], steps=10, seed=1))
    pipeline = Pipeline()
    for message in messages[:5]:
        take(pipeline, *message)
    snapshot = pipeline.snapshot()
    before = snapshot.encode()
    expected = [take(pipeline, *message) for message in messages[5:]]
    assert snapshot.encode() == before
    for _ in range(2):
        thawed = Pipeline.restored(snapshot, "world")
        assert [take(thawed, *message) for message in messages[5:]] == expected


def test_a_snapshot_is_a_numpy_file() -> None:
    pipeline = Pipeline()
    for message in inputs(solids(np.random.default_rng(3)), [], steps=10, seed=1):
        take(pipeline, *message)
    assert pipeline.monitor.last is not None
    with np.load(io.BytesIO(pipeline.snapshot().encode()), allow_pickle=False) as file:
        assert json.loads(file["facts"].tobytes())["monitor"]["step"] == pipeline.monitor.last.step
        assert file["bodies.position"].shape == (20, 3)


def broken(change: str, snapshot: Snapshot) -> Snapshot:
    """Snapshot with which a kernel would read out of bounds, or that another version wrote."""
    arrays, facts = dict(snapshot.arrays), {name: dict(each) for name, each in snapshot.facts.items()}
    match change:
        case "an array is missing":
            del arrays["events"]
        case "an array is of another type":
            arrays["bodies.position"] = arrays["bodies.position"].astype(np.float32)
        case "an array is shorter":
            arrays["bodies.position"] = arrays["bodies.position"][:-1]
        case "an event of a body that is not there":
            arrays["events"] = arrays["events"].copy()
            arrays["events"]["j"][0] = 1_000_000
        case "vertices that are not there":
            arrays["shapes.vertex_start"] = arrays["shapes.vertex_start"] + 1_000_000
        case "shapes in a circle":
            arrays["parts.next"] = np.zeros_like(arrays["parts.next"])
        case "a slot that is free and used":
            facts["monitor"]["free"] = [0]
        case "facts are missing":
            del facts["monitor"]["digest"]
        case "facts of another kind":
            facts["monitor"]["last"] = [1, 2, {"strange": 3}]
        case "an object of infinite size":
            facts["monitor"]["memory"] = dict.fromkeys(facts["monitor"]["memory"], float("inf"))
        case "a time that is no number" | "a time that is infinite" | "a time that is a text" | "a time of 65 bits":
            values = {"no number": math.nan, "infinite": math.inf, "a text": "now", "of 65 bits": 2**64}
            facts["monitor"]["now_ns"] = next(value for name, value in values.items() if change.endswith(name))
        case "origin_ns" | "jumps" | "late_ns" | "step" | "orphans":
            wrong = {"jumps": [math.nan], "late_ns": [0, math.nan], "orphans": [[-1.5, 0.0]]}
            facts["monitor"][change] = wrong.get(change, math.nan)
        case "no facts of the pipeline":
            del facts["pipeline"]
    return Snapshot(arrays, facts)


@pytest.mark.parametrize(
    "change",
    [
        "an array is missing", "an array is of another type", "an array is shorter", "vertices that are not there",
        "an event of a body that is not there", "shapes in a circle", "a slot that is free and used",
        "facts are missing", "facts of another kind", "an object of infinite size",
        "no facts of the pipeline", "a time that is no number", "a time that is infinite", "a time that is a text",
        "a time of 65 bits", "origin_ns", "jumps", "late_ns", "step", "orphans",
    ],
)  # fmt: skip
def test_a_snapshot_that_does_not_fit_is_refused(change: str) -> None:
    pipeline = Pipeline()
    for message in inputs(solids(np.random.default_rng(3)), [], steps=5, seed=1):
        take(pipeline, *message)
    with pytest.raises(InputError, match="snapshot"):
        Pipeline.restored(broken(change, pipeline.snapshot()), "world")


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04" + bytes(100), b"\x93NUMPY" + bytes(50), b"facts"])
def test_bytes_that_are_no_snapshot_are_refused(data: bytes) -> None:
    with pytest.raises(InputError, match=r"snapshot: expected an \.npz file"):
        Snapshot.decode(data)
