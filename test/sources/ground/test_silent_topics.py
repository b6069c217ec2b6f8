"""Topics with groups of objects that fall silent, after the time that the file and the topic itself allow."""

from __future__ import annotations

from collision_monitor.sources.ground.silent_topics import SilentTopics

SECOND = 1_000_000_000


def silent(topics: SilentTopics, seconds: float) -> list[tuple[str, str, int]]:
    return [(each.line, each.reason, each.last_ns) for each in topics.find(round(seconds * SECOND))]


def test_a_group_is_silent_after_the_age_that_the_file_allows() -> None:
    topics = SilentTopics(1.0, ["cart"])
    assert silent(topics, 100.0) == []  # nothing was heard yet: that is another list
    for k in range(20):
        for topic, line in (("/tracks", "traffic"), ("/tracks", "crowd"), ("/odom", "cart")):
            topics.heard(topic, line, k * SECOND // 10)
    assert silent(topics, 2.9) == []
    text, last = "no message on /tracks for more than 1 s: what it held last stays", 19 * SECOND // 10
    assert silent(topics, 2.91) == [("traffic", text, last), ("crowd", text, last)]  # /odom: its object is stale
    topics.latched.add("/tracks")
    assert silent(topics, 2.91) == []
    topics.latched.clear()
    topics.heard("/tracks", "crowd", 3 * SECOND)
    topics.heard("/tracks", "traffic", 3 * SECOND)
    assert silent(topics, 3.1) == []


def test_a_slow_topic_has_three_times_its_longest_period_but_not_forever() -> None:
    topics = SilentTopics(1.0)
    for seconds in (0, 2, 4):
        topics.heard("/slow", "slow", seconds * SECOND)
    assert silent(topics, 9.9) == []
    assert [each[0] for each in silent(topics, 10.1)] == ["slow"]
    topics.heard("/slow", "slow", 5000 * SECOND)
    assert silent(topics, 5029.0) == []
    assert len(silent(topics, 5031.0)) == 1


def test_a_clock_that_goes_back_begins_anew() -> None:
    topics = SilentTopics(1.0)
    topics.heard("/scan", "scan", 100 * SECOND)
    assert silent(topics, 5.0) == []
    assert [each[0] for each in silent(topics, 6.1)] == ["scan"]
