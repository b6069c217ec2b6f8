"""What the node monitors, published for viewers over real DDS: objects and states of its topics and of its sources."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from foreign_bag import SECOND, START, STORE, odometry, pose_stamped
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry

from collision_monitor import codec, records
from collision_monitor.codec import Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.endpoints import subscription
from collision_monitor.session import Session
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere
from collision_monitor.view.topic_content import TopicContent

SOURCES = """
frame: map
objects:
  robot: {topic: /odom, shape: {box: [1.2, 0.8, 0.5]}}
  person: {topic: /person, shape: {capsule: [0.3, 1.1]}}
"""


CLASSES = {"/odom": Odometry, "/person": PoseStamped}


class Watcher:
    """A viewer: the messages of both topics in the order of their arrival, and the scene that they make."""

    def __init__(self, team: Any) -> None:
        self.scene = TopicContent()
        self.messages: list[tuple[Topic, bytes]] = []
        self._node = team.node
        self._subscriptions = [
            subscription(team.node, topic, self._taking(topic), topic.of())
            for topic in (Topic.MONITORED_SHAPES, Topic.MONITORED_STATES, Topic.CONTACTS)
        ]

    def _taking(self, topic: Topic) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            self.messages.append((topic, data))
            self.scene.take(topic.message, data)

        return take

    def of(self, topic: Topic) -> list[bytes]:
        return [data for each, data in self.messages if each is topic]

    @property
    def snapshots(self) -> list[codec.ObjectDescriptionArray]:
        return [each for data in self.of(Topic.MONITORED_SHAPES) if (each := codec.decode_descriptions(data)).snapshot]

    @property
    def names(self) -> list[str]:
        """Names of the objects that the view shows, by id."""
        return [each.name for each in self.scene.moment().bodies.descriptions]

    def leave(self) -> None:
        for each in self._subscriptions:
            self._node.destroy_subscription(each)


def state(object_id: int, x: float) -> np.void:
    row = np.zeros((), records.STATE)
    row["id"], row["position"][0], row["quaternion"] = object_id, x, (0, 0, 0, 1)
    return row[()]


def test_objects_of_a_sources_file_are_published_as_they_are_recorded(
    start: Callable[..., Any], team: Any, tmp_path: Path
) -> None:
    (tmp_path / "sources.yaml").write_text(SOURCES)
    out = {topic: team.node.create_publisher(kind, topic, 10) for topic, kind in CLASSES.items()}
    process = start("run", "--sources", "sources.yaml", "--record", "live.mcap")
    team.until(lambda: team.statuses, 60.0)
    watcher = Watcher(team)
    team.until(lambda: all(each.get_subscription_count() for each in out.values()) and watcher.snapshots, 60.0)
    steps = count(1)

    def drive() -> bool:
        k = next(steps)
        stamp, at = START + k * SECOND // 20, (k / 20, 0, 0)
        odom = odometry("map", stamp, at, (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))
        for topic, (kind, message) in (("/odom", odom), ("/person", pose_stamped("map", stamp, (3, 0, 0)))):
            out[topic].publish(bytes(STORE.serialize_cdr(message, kind)))
        return len(watcher.of(Topic.MONITORED_STATES)) >= 10

    team.until(drive, 30.0)
    moment = watcher.scene.moment()
    assert watcher.names == ["robot", "person"]
    assert moment.state["position"][0, 0] > 0.0 and moment.state["position"][1].tolist() == [3, 0, 0]
    assert process.stop() == 0, process.words
    recorded = [bytes(m.data) for m in Session(tmp_path / "live.mcap").messages() if m.type == "ObjectStateArray"]
    seen = watcher.of(Topic.MONITORED_STATES)
    first = recorded.index(seen[0])
    assert set(seen) <= set(recorded[first:])


def test_each_new_viewer_gets_all_objects_and_then_the_changes(start: Callable[..., Any], team: Any) -> None:
    monitor = start("run")
    team.meet()
    wall = ObjectDescription(9, Box((0.2, 2, 2)), name="wall", static=True, pose=Pose((5, 0, 0)))
    team.describe(wall, ObjectDescription(1, Sphere(0.5), name="ball"))
    team.status(lambda status: status.objects == 2)
    first = Watcher(team)
    team.until(lambda: first.names == ["ball", "wall"])
    team.describe(ObjectDescription(2, Sphere(0.5), name="new"), ObjectDescription(3, Sphere(0.1), name="gone"))
    team.describe(Removal(3))
    team.ask(state(1, 0.0))
    team.until(lambda: first.names == ["ball", "new", "wall"] and first.of(Topic.MONITORED_STATES))
    assert len(first.snapshots) == 1
    first.leave()
    team.describe(Removal(1))  # nobody looks
    team.until(lambda: team.say(state(2, 3.0)) and team.statuses[-1].step > 1 and team.statuses[-1].objects == 2)
    second = Watcher(team)
    team.until(lambda: second.snapshots and second.names == ["new", "wall"])
    assert monitor.stop() == 0 and "Traceback" not in monitor.words


def test_what_the_monitor_refuses_is_not_published(start: Callable[..., Any], team: Any) -> None:
    start("run")
    team.meet()
    watcher = Watcher(team)
    team.until(lambda: watcher.snapshots)
    flat = codec.encode_descriptions(team.now, "map", [ObjectDescription(7, Sphere(1.0))])
    team.publish_shapes(flat)  # another frame
    team.status(lambda status: status.refused_frame == 1)
    team.describe(ObjectDescription(1, Sphere(1.0), name="ball"))
    team.until(lambda: watcher.names == ["ball"])
    team.say(state(1, 0.0), frame_id="map")
    team.ask(state(1, 1.0))
    team.until(lambda: watcher.of(Topic.MONITORED_STATES))
    (only,) = watcher.of(Topic.MONITORED_STATES)
    assert codec.decode_states(only).frame_id == "world"
