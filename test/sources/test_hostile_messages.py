"""Damaged messages of every kind are refused or pass as states that the monitor refuses; nothing is raised."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START, STORE, marker, markers, odometry, pose_stamped, transforms
from foreign_messages import POLYGON, detection, detections, footprint, track, tracked_objects

from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.sources import RawMessage

SPHERE = {"sphere": 1.0}
CORNERS = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)]
KINDS: dict[str, tuple[dict[str, Any], tuple[str, Any]]] = {
    "odometry": ({"shape": SPHERE}, odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))),
    "pose": ({"shape": SPHERE}, pose_stamped("map", START, (0, 0, 0))),
    "frame": ({"shape": SPHERE, "frame": "base"}, transforms(START, ("map", "base", (0, 0, 0), (0, 0, 0, 1)))),
    "marker": ({"marker": {"ns": "a"}}, markers(marker("a", 1, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=START))),
    "tracks": (
        {},
        tracked_objects("map", START, track(1, (0, 0, 0), kind=POLYGON, footprint=CORNERS), track(2, (9, 0, 0))),
    ),
    "detections": ({}, detections("map", START, detection((0, 0, 0), variance=0.1), detection((3, 0, 0), name="7"))),
    "footprint": ({"height": 1.0}, footprint("map", START, [c[:2] for c in CORNERS])),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("stepping", [{}, {"rate": 20}])
def test_damaged_messages_raise_nothing(kind: str, stepping: dict[str, Any]) -> None:
    entry, (name, message) = KINDS[kind]
    fed = Fed({"it": {"topic": "/it", **entry}}, **stepping)
    assert not fed.feed.bind("/it", name)
    data = np.frombuffer(STORE.serialize_cdr(message, name), np.uint8)
    pipeline = Pipeline("fast", frame_id="map", timed=False)
    rng = np.random.default_rng(len(kind))
    for k in range(150):
        damaged = data.copy()
        places = rng.integers(4, len(data), rng.integers(1, 6))
        damaged[places] = rng.choice([0, 1, 127, 128, 255, int(rng.integers(0, 256))], len(places))
        size = len(data) if k % 5 else int(rng.integers(0, len(data)))
        for given in fed.feed.take(RawMessage("/it", name, damaged[:size].tobytes(), START + k)):
            (pipeline.on_states if given.topic is Topic.STATES else pipeline.on_shapes)(given.data)
    good = RawMessage("/it", name, data.tobytes(), START)
    assert isinstance(fed.feed.take(good), list)


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_of_another_type_is_refused_by_the_name_of_the_type(kind: str) -> None:
    entry, (name, message) = KINDS[kind]
    fed = Fed({"it": {"topic": "/it", **entry}})
    fed.give("/it", START, (name, message))
    before = len(fed.steps), len(fed.changes)
    others = {other: each for other, each in (content for _, content in KINDS.values()) if other != name}
    for other, content in others.items():
        fed.give("/it", START, (other, content))
    assert (len(fed.steps), len(fed.changes)) == before
    assert sorted(fed.refused) == sorted(f"/it: expected {name}, got {other}" for other in others)
    assert not fed.feed.take_failures() and [row.what for row in fed.feed.unmonitored] == ["/it"]
