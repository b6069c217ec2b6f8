"""The names of every topic, and that no other module repeats them."""

from __future__ import annotations

from pathlib import Path

import pytest

from collision_monitor.pipeline import topics
from collision_monitor.pipeline.topics import NODE, RECORDED, Topic

PACKAGE = Path(topics.__file__).parents[1]


def test_a_topic_has_the_names_that_its_users_need() -> None:
    topic = Topic.SHAPES
    assert (topic.private, topic.of(), topic.of("cell/monitor")) == (
        "~/objects/shapes",
        "/object_monitor/objects/shapes",
        "/cell/monitor/objects/shapes",
    )
    assert (topic.type_name, topic.message) == (
        "collision_monitor_msgs/msg/ObjectDescriptionArray",
        "ObjectDescriptionArray",
    )


def test_all_is_recorded_but_a_picture_and_what_other_messages_tell() -> None:
    assert set(Topic) - set(RECORDED) == {
        Topic.MARKERS,
        Topic.RAISED_ALERTS,
        Topic.MONITORED_SHAPES,
        Topic.MONITORED_STATES,
        Topic.MONITORED_PLANS,
    }


@pytest.mark.parametrize("name", [f'"{NODE}"', f'"/{NODE}', "~/objects", '"objects/s', '"~/'])
def test_names_stand_in_one_place(name: str) -> None:
    """Help texts may contain them."""
    users = [path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py") if name in path.read_text()]
    places = ("settings/parameter_file.py", "pipeline/topics.py", "cli/run.py")
    assert [user for user in users if user not in places] == []
