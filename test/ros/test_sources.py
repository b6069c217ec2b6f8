"""The sources of a running node: real messages over real DDS, with the bytes of an import of the same bag."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from foreign_bag import SECOND, START, STORE, odometry, pose_stamped, transforms, write_bag
from rclpy.qos import DurabilityPolicy, QoSProfile

from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag, load_mapping

STEP = 20_000_000
Messages = list[tuple[str, int, tuple[str, Any]]]
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Player:
    """Publishes the messages of a bag one after the other, each when the last one has been delivered."""

    def __init__(self, node: Any, messages: Messages) -> None:
        self._node, self._messages = node, messages
        self._publishers = {
            topic: node.create_publisher(
                getattr(import_module(f"{kind.split('/')[0]}.msg"), kind.split("/")[2]),
                topic,
                LATCHED if topic.endswith("static") else QoSProfile(depth=10),
            )
            for topic, _, (kind, _) in messages
        }

    def wait(self, team: Any) -> None:
        team.until(lambda: all(p.get_subscription_count() for p in self._publishers.values()), 60.0)
        team.listen(0.2)

    def play(self, gap: float = 0.04) -> None:
        for k, (topic, _, (kind, message)) in enumerate(self._messages):
            self._publishers[topic].publish(bytes(STORE.serialize_cdr(message, kind)))
            time.sleep(0.3 if k < 5 else gap)  # the first ones find the code cold; they must not wait beside each other


def inputs_of(path: Path) -> list[tuple[str, bytes]]:
    kinds = ("ObjectStateArray", "ObjectDescriptionArray")
    return [(m.type, bytes(m.data)) for m in Session(path).messages() if m.type in kinds]


def drive(steps: int = 15) -> Messages:
    """A robot that drives a circle, and a person that it sees."""
    found: Messages = [("/tf_static", START, transforms(START, ("map", "hall", (1, 2, 0), (0, 0, 0, 1))))]
    for k in range(steps):
        t, stamp = k * STEP / SECOND, START + k * STEP
        q = (0, 0, np.sin(t / 2), np.cos(t / 2))
        p = (2 * np.sin(t), 2 - 2 * np.cos(t), 0)
        found += [
            ("/tf", stamp, transforms(stamp, ("hall", "base", p, q))),
            ("/odom", stamp, odometry("hall", stamp, p, q, (2, 0, 0), (0, 0, 1))),
            ("/person", stamp, pose_stamped("base", stamp + 7, (3 - t, 0.25, 0))),
        ]
    return found


SOURCES = {
    "frame": "map",
    "rate": 25,
    "objects": {
        "robot": {"topic": "/odom", "shape": {"box": [1.2, 0.8, 0.5]}},
        "person": {"topic": "/person", "shape": {"capsule": [0.3, 1.1]}},
    },
}


@pytest.mark.parametrize("stepping", [{"rate": 25}, {"step": "/odom"}, {}])
def test_a_bag_over_dds_gives_the_bytes_of_its_import(
    stepping: dict[str, Any], start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    messages = drive()
    content = {key: value for key, value in SOURCES.items() if key != "rate"} | stepping
    (tmp_path / "sources.yaml").write_text(yaml.safe_dump(content))
    player = Player(team.node, messages)
    process = start("run", "--sources", "sources.yaml", "--record", "live.mcap")
    team.until(lambda: team.statuses, 60.0)
    player.wait(team)
    player.play()
    team.listen(0.5)
    assert process.stop() == 0, process.words
    bag = write_bag(tmp_path / "bag", messages)
    imported = import_bag(bag, tmp_path / "imported.mcap", load_mapping(tmp_path / "sources.yaml"))
    assert imported.whole, imported
    assert inputs_of(tmp_path / "live.mcap") == inputs_of(tmp_path / "imported.mcap"), process.words
    assert len(inputs_of(tmp_path / "live.mcap")) > 7
    report = replay(Session(tmp_path / "live.mcap"))
    assert report.verdict is Verdict.IDENTICAL
