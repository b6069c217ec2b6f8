"""Topics with groups of objects that fall silent, after the time that the file and the topic itself allow."""

from __future__ import annotations

from collision_monitor.ros.monitor.silent_topics import SilentTopics
from collision_monitor.sources.ground.mapping import make_mapping

SECOND = 1_000_000_000
FILE = {
    "frame": "map",
    "max_age": 1.0,
    "objects": {
        "traffic": {"topic": "/tracks"},
        "crowd": {"topic": "/tracks"},
        "cart": {"topic": "/odom", "shape": {"sphere": 1.0}},
        "walls": {"topic": "/walls", "marker": {"ns": "walls"}, "static": True},
        "slow": {"topic": "/slow"},
    },
}


def silent(topics: SilentTopics, seconds: float, **latched: tuple[str, ...]) -> list[tuple[str, str, int]]:
    rows = topics.rows(round(seconds * SECOND), **latched)
    return [(row.line, row.reason, row.since_ns) for row in rows]


def test_a_group_is_silent_after_the_age_that_the_file_allows() -> None:
    topics = SilentTopics(make_mapping(FILE))
    assert silent(topics, 100.0) == []  # nothing was heard yet: that is another list
    for k in range(20):
        for topic in ("/tracks", "/odom", "/walls"):
            topics.heard(topic, k * SECOND // 10)
    assert silent(topics, 2.9) == []
    text, last = "no message on /tracks any more", 19 * SECOND // 10
    assert silent(topics, 2.91) == [("traffic", text, last), ("crowd", text, last)]  # /odom: its object is stale
    assert silent(topics, 2.91, latched=("/tracks",)) == []
    topics.heard("/tracks", 3 * SECOND)
    assert silent(topics, 3.1) == []


def test_a_slow_topic_has_three_times_its_longest_period_but_not_forever() -> None:
    topics = SilentTopics(make_mapping(FILE))
    for seconds in (0, 2, 4):
        topics.heard("/slow", seconds * SECOND)
    assert silent(topics, 9.9) == []
    assert [each[0] for each in silent(topics, 10.1)] == ["slow"]
    topics.heard("/slow", 5000 * SECOND)
    assert silent(topics, 5029.0) == []
    assert len(silent(topics, 5031.0)) == 1
