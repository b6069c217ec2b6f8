"""A sensor that fails leaves what it saw: stale and listed, never as free space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START, odometry, transforms
from foreign_messages import detection, detections, laser_scan, point_cloud, track, tracked_objects

from collision_monitor.shapes.pose import rotation_matrix

STEP = 50_000_000
NAN, INF = math.nan, math.inf
SPHERE = {"sphere": 1.0}


def at(k: int) -> int:
    return START + k * STEP


def scan(k: int, ranges: Any, **fields: float) -> tuple[str, int, tuple[str, Any]]:
    kind, content = laser_scan("map", at(k), ranges, start=0.0, step=0.5)
    for name, value in fields.items():
        setattr(content, name, value)
    return "/scan", at(k), (kind, content)


def points_of(fed: Fed) -> Any:
    """The points of the last scan in the monitor's frame; none if its object was removed."""
    last = fed.changes[-1]
    if not hasattr(last, "shapes"):
        return np.zeros((0, 3))
    ((cloud, _),) = last.shapes
    return cloud.points + last.pose.position  # type: ignore[union-attr]


FAILED: dict[str, tuple[Any, dict[str, float]]] = {
    "all NaN": ([NAN] * 4, {}),
    "all 0": ([0.0] * 4, {}),
    "all below range_min": ([0.05] * 4, {}),
    "all negative": ([-1.0] * 4, {}),
    "NaN and 0": ([NAN, 0.0, NAN, 0.05], {}),
    "no beam": ([], {}),
    "range_max 0": ([1.0, INF, 2.0, INF], {"range_max": 0.0}),
    "range_max NaN": ([1.0, INF, 2.0, INF], {"range_max": NAN}),
    "range_max below range_min": ([1.0, INF, 2.0, INF], {"range_max": 0.05}),
    "range_min NaN": ([1.0, INF, 2.0, INF], {"range_min": NAN}),
    "angle_increment NaN": ([1.0, INF, 2.0, INF], {"angle_increment": NAN}),
    "angle_increment infinite": ([1.0, INF, 2.0, INF], {"angle_increment": INF}),
    "angle_increment 1e-30": ([1.0, INF, 2.0, INF], {"angle_increment": 1e-30}),
    "angle_increment -1e-38": ([1.0, INF, 2.0, INF], {"angle_increment": -1e-38}),
    "angle_increment 0": ([1.0, INF, 2.0, INF], {"angle_increment": 0.0}),
    "angle_min NaN": ([1.0, INF, 2.0, INF], {"angle_min": NAN}),
    "angle_min of no angle": ([1.0, INF, 2.0, INF], {"angle_min": 1e30}),
    "all 0 with range_min 0": ([0.0] * 4, {"range_min": 0.0}),
    "negative with a negative range_min": ([-0.5] * 4, {"range_min": -1.0}),
    "a range of negative numbers": ([1.0] * 4, {"range_min": -2.0, "range_max": -1.0}),
}


@pytest.mark.parametrize("failure", FAILED)
def test_a_scan_that_measures_nothing_removes_nothing_and_is_listed(failure: str) -> None:
    ranges, fields = FAILED[failure]
    fed = Fed({"scan": {"topic": "/scan"}}, begin=START)
    fed.give(*scan(0, [1.0, INF, 2.0, INF]))
    before = points_of(fed)
    fed.give(*scan(1, ranges, **fields))
    assert len(fed.changes) == 1 and len(before) == 2
    assert sum(fed.refused.values()) == 1 and next(iter(fed.refused)).startswith("scan: ")
    assert [(row.line, row.what) for row in fed.feed.unmonitored] == [("scan", "/scan")]
    fed.give(*scan(2, [INF, INF, INF, 3.0]))
    assert not fed.feed.unmonitored and len(points_of(fed)) == 1
    fed.give(*scan(3, [INF] * 4))
    assert fed.names[-1].startswith("-")  # this scan says that nothing is there


def test_too_near_to_measure_is_something_at_the_least_range() -> None:
    fed = Fed({"scan": {"topic": "/scan"}})
    fed.give(*scan(0, [INF, -INF, INF, INF]))
    np.testing.assert_allclose(points_of(fed), [[0.1 * math.cos(0.5), 0.1 * math.sin(0.5), 0]], atol=1e-6)
    fed.give(*scan(1, [-INF] * 4))
    assert len(points_of(fed)) == 4 and not fed.refused


def test_each_beam_that_fails_keeps_what_it_met_in_the_world() -> None:
    """The robot drives on: what a beam met stays where it was, until the beam measures again."""
    fed = Fed({"scan": {"topic": "/scan"}})

    def see(k: int, x: float, ranges: Any) -> Any:
        fed.give("/tf", at(k), transforms(at(k), ("map", "laser", (x, 0, 0), (0, 0, 0, 1))))
        kind, content = laser_scan("laser", at(k), ranges, start=0.0, step=math.pi / 2)
        fed.give("/scan", at(k), (kind, content))
        return {tuple(np.round(point, 6)) for point in points_of(fed)}

    assert see(0, 0.0, [5, 2, INF, NAN]) == {(5, 0, 0), (0, 2, 0)}
    assert see(1, 1.0, [NAN, 3, INF, NAN]) == {(5, 0, 0), (1, 3, 0)}
    assert see(2, 2.0, [NAN, NAN, INF, NAN]) == {(5, 0, 0), (1, 3, 0)}
    assert see(3, 3.0, [INF, NAN, 1, 0]) == {(1, 3, 0), (2, 0, 0)}
    assert see(4, 3.0, [INF, INF, INF, INF]) == set()
    assert fed.feed.scene.points_dropped["scan"] == 1 + 2 + 3 + 2 + 0


def test_what_was_met_is_in_the_direction_from_where_the_scanner_is_now() -> None:
    """The robot turns: another beam looks at what was met, and that one says whether it is still there."""
    fed = Fed({"scan": {"topic": "/scan"}})

    def see(k: int, at_map: Any, yaw: float, ranges: Any) -> Any:
        turn = (0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
        fed.give("/tf", at(k), transforms(at(k), ("map", "laser", at_map, turn)))
        kind, content = laser_scan("/laser" if k % 2 else "laser", at(k), ranges, start=0.0, step=math.pi / 2)
        fed.give("/scan", at(k), (kind, content))
        points = points_of(fed)
        if len(points):
            cloud = fed.changes[-1].shapes[0][0].points @ rotation_matrix(np.array(turn)).T  # type: ignore[union-attr]
            points = cloud + at_map
        return {tuple(np.round(point, 6) + 0.0) for point in points}

    quarter = math.pi / 2
    assert see(0, (0, 0, 0), 0.0, [5, INF, INF, INF]) == {(5, 0, 0)}
    assert see(1, (0, 0, 0), quarter, [INF, INF, INF, NAN]) == {(5, 0, 0)}  # its last beam looks at it now, and fails
    assert see(2, (0, 0, 0), 2 * quarter, [NAN, INF, NAN, INF]) == {(5, 0, 0)}
    assert see(3, (5, 9, 0), quarter, [NAN, INF, NAN, INF]) == {(5, 0, 0)}  # from the north it is behind the robot
    assert see(4, (5, 9, 0), 0.0, [NAN, NAN, NAN, INF]) == set()  # and now at its right, where nothing is


LATER: dict[str, tuple[Any, float, float]] = {
    "another first angle": ([NAN, 1, NAN, NAN], 1e-5, 0.5),
    "more beams": ([NAN, NAN, 1, NAN, NAN, NAN, NAN, NAN], 0.0, 0.25),
    "fewer beams, the other way round": ([NAN, 1, NAN], 1.0, -0.5),
    "another turn": ([NAN, 1, NAN, NAN], 2.0 * math.pi, 0.5),
}


@pytest.mark.parametrize("later", LATER)
def test_beams_of_other_angles_that_fail_keep_what_was_met_in_their_direction(later: str) -> None:
    ranges, start, step = LATER[later]
    fed = Fed({"scan": {"topic": "/scan"}})
    fed.give(*scan(0, [2.0, 3.0, 4.0, INF]))
    first = points_of(fed)
    fed.give("/scan", at(1), laser_scan("map", at(1), ranges, start=start, step=step))
    now = points_of(fed)
    expected = [first[0], [math.cos(0.5), math.sin(0.5), 0.0], first[2]]
    np.testing.assert_allclose(now[np.argsort(np.arctan2(now[:, 1], now[:, 0]))], expected, atol=2e-5)
    fed.give("/scan", at(2), laser_scan("map", at(2), [INF, NAN], start=math.pi, step=step))
    assert fed.names[-1].startswith("-")  # the scanner looks elsewhere


BLOCKED = [INF, 2, 0, 2]
"""A scanner that sees to its left and right, nothing in front, and whose robot hides what is behind."""


def drive(fed: Fed, steps: int, *, first: int = 0) -> Any:
    """Drive straight on, 3 m at a time, and return the places of the points along the way at the end, in m."""
    for k in range(first, first + steps):
        fed.give("/tf", at(k), transforms(at(k), ("map", "laser", (3 * k, 0, 0), (0, 0, 0, 1))))
        kind, content = laser_scan("laser", at(k), BLOCKED, start=0.0, step=math.pi / 2)
        fed.give("/scan", at(k), (kind, content))
    return sorted(np.round(points_of(fed)[:, 0]).tolist())


@pytest.mark.parametrize(("entry", "behind"), [({}, [0, 3, 6, 9]), ({"max_range": 5.0}, [0, 3])])
def test_what_a_robot_leaves_behind_is_held_as_far_as_its_scanner_sees(entry: Any, behind: list[float]) -> None:
    """It would grow for ever on a straight way, where the beams to the rear never measure."""
    fed = Fed({"scan": {"topic": "/scan", **entry}})
    points = drive(fed, 200)
    assert points == sorted([597.0 - each for each in behind] * 2)
    assert not fed.refused


def test_too_many_points_of_failed_beams_are_the_farthest_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    fed = Fed({"scan": {"topic": "/scan"}}, begin=START)
    monkeypatch.setattr("collision_monitor.sources.messages.laser_scans.MOST_HELD", 2)
    assert drive(fed, 20) == [54.0, 54.0, 57.0, 57.0]
    assert "scan: expected at most 100000 points of beams that failed" in next(iter(fed.refused))
    assert [row.line for row in fed.feed.unmonitored] == ["scan"]


def test_what_was_met_before_the_time_went_back_is_not_held_after_it() -> None:
    fed = Fed({"scan": {"topic": "/scan"}})
    drive(fed, 100, first=2)
    assert drive(fed, 4) == [3.0, 3.0, 6.0, 6.0, 9.0, 9.0]  # the first message alone does not set the time back


def test_what_is_nearer_than_the_file_allows_hides_what_is_behind_it() -> None:
    """Dirt before the scanner does not make the wall behind it free."""
    fed = Fed({"scan": {"topic": "/scan", "min_range": 0.6}})
    fed.give(*scan(0, [2.0, 3.0, 0.5, INF]))
    first = points_of(fed)
    assert len(first) == 2
    fed.give(*scan(1, [0.5, -INF, 0.5, 0.5]))  # refused: it measured nothing that counts
    fed.give(*scan(2, [0.5, INF, 0.5, 0.5]))
    np.testing.assert_allclose(points_of(fed), first[:1], atol=1e-9)
    assert sum(fed.refused.values()) == 1


def test_a_driver_that_writes_nan_for_nothing_can_say_so() -> None:
    fed = Fed({"scan": {"topic": "/scan", "nan_is_free": True}, "cloud": {"topic": "/cloud", "nan_is_free": True}})
    fed.give(*scan(0, [1.0, NAN, 2.0, NAN]))
    fed.give("/cloud", at(0), point_cloud("map", at(0), [(1, 0, 0)]))
    assert len(points_of(fed)) == 1
    fed.give(*scan(1, [NAN] * 4))
    fed.give("/cloud", at(1), point_cloud("map", at(1), [(NAN, 0, 0)]))
    assert fed.names == ["scan", "cloud", "-1", "-2"] and not fed.refused
    fed.give(*scan(2, [1.0, NAN, 2.0, NAN]))
    fed.give(*scan(3, [0.0, NAN, NAN, INF]))  # 0 is another failure
    np.testing.assert_allclose(points_of(fed), [[1, 0, 0]], atol=1e-6)


def test_a_cloud_without_a_finite_point_removes_nothing_and_an_empty_one_does() -> None:
    fed = Fed({"cloud": {"topic": "/cloud"}})
    fed.give("/cloud", at(0), point_cloud("map", at(0), [(1, 0, 0)]))
    fed.give("/cloud", at(1), point_cloud("map", at(1), [(NAN, 0, 0), (INF, 0, 0)]))
    assert fed.names == ["cloud"] and "expected finite ones, got none of 2" in next(iter(fed.refused))
    fed.give("/cloud", at(2), point_cloud("map", at(2), [(3e38, 0, 0), (0, -1e30, 0)]))
    kind, content = point_cloud("map", at(3), [(5, 0, 0)])
    content.height = 0
    fed.give("/cloud", at(3), (kind, content))
    assert fed.names == ["cloud"] and sum(fed.refused.values()) == 3
    fed.give("/cloud", at(4), point_cloud("map", at(4), []))
    assert fed.names == ["cloud", "-1"]


NOTHING_SEEN: dict[str, tuple[Any, dict[str, Any]]] = {
    "all too near": ([(0.1, 0, 0), (0, 0.05, 0)], {"min_range": 0.2}),
    "too near or NaN": ([(0.1, 0, 0), (NAN, 0, 0)], {"min_range": 0.2}),
    "too near, and NaN is free": ([(0.1, 0, 0), (NAN, 0, 0)], {"min_range": 0.2, "nan_is_free": True}),
    "all 0": ([(0, 0, 0)] * 5, {}),
    "all beyond all numbers": ([(3e38, 0, 0), (0, -3e38, 0)], {}),
}


@pytest.mark.parametrize("kind", NOTHING_SEEN)
def test_a_cloud_of_points_that_are_no_measurement_removes_nothing(kind: str) -> None:
    points, entry = NOTHING_SEEN[kind]
    fed = Fed({"cloud": {"topic": "/cloud", **entry}}, begin=START)
    fed.give("/cloud", at(0), point_cloud("map", at(0), [(1, 2, 3)]))
    fed.give("/cloud", at(1), point_cloud("map", at(1), points))
    assert fed.names == ["cloud"] and [row.what for row in fed.feed.unmonitored] == ["/cloud"]
    fed.give("/cloud", at(2), point_cloud("map", at(2), [*points, (1, 2, 4)]))
    assert not fed.feed.unmonitored and fed.names == ["cloud"] * 2


@pytest.mark.parametrize("name", ["", "a"])
def test_a_detection_without_a_place_keeps_its_track(name: str) -> None:
    fed = Fed({"people": {"topic": "/d", "forget_after": 0.5}})
    fed.give(
        "/d", at(0), detections("map", at(0), detection((1, 0, 0), name=name), detection((9, 0, 0), name=name * 2))
    )
    for k in range(1, 40):
        nowhere = detection((NAN if k % 2 else 1e30, 0, 0), name=name)
        fed.give("/d", at(k), detections("map", at(k), nowhere, detection((9, 0, 0), name=name * 2)))
    assert len(fed.names) == 2 and sum(fed.refused.values()) == 39
    for k in range(40, 60):
        fed.give("/d", at(k), detections("map", at(k), detection((9, 0, 0), name=name * 2)))
    assert len(fed.names) == 3 and fed.names[2].startswith("-")  # it is gone, now that no detection may be it


def test_detections_beyond_the_bound_keep_their_tracks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("collision_monitor.sources.messages.detections.MOST_DETECTIONS", 2)
    fed = Fed({"people": {"topic": "/d", "forget_after": 0.5}})
    a, b, c = (detection((k, 0, 0), name=name) for k, name in enumerate("abc"))
    fed.give("/d", at(0), detections("map", at(0), a, b))
    for k in range(1, 30):
        fed.give("/d", at(k), detections("map", at(k), b, c, a))
    assert fed.names == ["people_person_a", "people_person_b", "people_person_c"]
    assert sum(fed.refused.values()) == 29


@pytest.mark.parametrize("kind", ["tracks", "detections", "scan"])
def test_a_sensor_that_falls_silent_leaves_what_it_saw_and_is_listed(kind: str) -> None:
    seen = {
        "tracks": lambda k: tracked_objects("map", at(k), track(1, (0, 0, 0))),
        "detections": lambda k: detections("map", at(k), detection((0, 0, 0), name="1")),
        "scan": lambda k: laser_scan("map", at(k), [1.0, 2.0]),
    }[kind]
    objects = {"robot": {"topic": "/odom", "shape": SPHERE}, "it": {"topic": "/it"}}
    fed = Fed(objects, begin=START, rate=20)
    for k in range(200):
        fed.give("/odom", at(k), odometry("map", at(k), (k, 9, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        if k < 40:
            fed.give("/it", at(k), seen(k))
        elif k == 55:
            assert not fed.feed.unmonitored
    assert not any(name.startswith("-") for name in fed.names)
    (row,) = fed.feed.unmonitored
    assert (row.line, row.what, row.reason) == (
        "it", "/it", "no message on /it for more than 1 s: what it held last stays"
    )  # fmt: skip
    assert row.since_ns == at(39)
    fed.give("/it", at(200), seen(200))
    assert not fed.feed.unmonitored


def test_a_tracker_that_sends_an_empty_message_says_that_nothing_is_there() -> None:
    fed = Fed({"it": {"topic": "/it", "forget_after": 0.2}})
    fed.give("/it", at(0), tracked_objects("map", at(0), track(1, (0, 0, 0))))
    for k in range(1, 8):
        fed.give("/it", at(k), tracked_objects("map", at(k)))
    assert [name.startswith("-") for name in fed.names] == [False, True]
