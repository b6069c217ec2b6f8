"""What a file asks for and is not monitored is one list, in which no text hides another."""

from __future__ import annotations

from pathlib import Path

from fed import Fed
from foreign_bag import SECOND, START, odometry, transforms
from played_sources import Played

from collision_monitor.sources.ground.unmonitored import MOST_ROWS, Unmonitored, UnmonitoredList

SPHERE = {"sphere": 1.0}
ROBOT = """<robot name="two"><link name="base"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="a" type="fixed"><parent link="base"/><child link="forearm"/></joint><link name="forearm"><collision>
<geometry><mesh filename="package://nowhere/forearm.stl"/></geometry></collision><collision>
<geometry><mesh filename="package://nowhere/cable.stl"/></geometry></collision></link>
<joint name="b" type="fixed"><parent link="forearm"/><child link="hand"/></joint><link name="hand"><collision>
<geometry><mesh filename="package://nowhere/hand.stl"/></geometry></collision></link></robot>"""


def texts(fed: Fed) -> list[str]:
    return [row.text for row in fed.feed.unmonitored]


def test_a_topic_without_a_message_is_listed_until_the_first_one() -> None:
    fed = Fed({"cart": {"topic": "/odm", "shape": SPHERE}, "other": {"topic": "/odom", "shape": SPHERE}}, begin=START)
    assert texts(fed) == ["cart: no message on /odm yet", "other: no message on /odom yet"]
    fed.give("/odom", START + SECOND, odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0)))
    assert fed.feed.unmonitored == (Unmonitored("cart", "/odm", "no message on /odm yet", START),)
    fed.feed.miss_topic("/odm", "/odm has no publisher", START + 2 * SECOND)
    assert fed.feed.unmonitored == (Unmonitored("cart", "/odm", "/odm has no publisher", START),)  # since it began


def test_a_static_object_in_a_frame_that_comes_by_tf_is_listed_with_what_to_do() -> None:
    fed = Fed({"shelf": {"static": True, "frame": "odom", "shape": SPHERE}}, begin=START)
    (text,) = texts(fed)
    assert text == "shelf: expected static transforms from 'map' to 'odom'; there are frames none"
    fed.give("/tf", START, transforms(START, ("map", "odom", (0, 0, 0), (0, 0, 0, 1))))
    fed.give("/tf_static", START, transforms(START, ("odom", "lamp", (0, 0, 0), (0, 0, 0, 1))))
    (text,) = texts(fed)
    assert "'odom' comes by /tf and may move" in text and "`topic: /tf` instead of `static: true`" in text
    fed.give("/tf_static", START, transforms(START, ("map", "odom", (0, 0, 0), (0, 0, 0, 1))))
    assert not fed.feed.unmonitored and fed.names == ["shelf"]


def test_links_whose_meshes_are_missing_are_listed_one_by_one(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(ROBOT)
    played = Played({"urdf": str(tmp_path / "robot.urdf"), "base": {"pose": [0, 0, 0]}})
    rows = {row.what: row.reason for row in played.feed.unmonitored}
    assert set(rows) == {"arm/forearm", "arm/hand"}
    assert (
        "forearm.stl" in rows["arm/forearm"] and "cable.stl" in rows["arm/forearm"] and "line 3" in rows["arm/forearm"]
    )
    assert "hand.stl" in rows["arm/hand"]


def test_the_list_is_bounded_and_says_so() -> None:
    rows = UnmonitoredList()
    for k in range(MOST_ROWS + 5):
        rows.lacks("arm", f"arm/{k}", "x" * 100_000, k)
    assert len(rows.rows()) == MOST_ROWS + 1 and rows.rows()[-1].reason == "5 further ones are not listed"
    assert max(len(row.reason) for row in rows.rows()) <= 500
    rows.drop("arm", "arm/1")
    assert all(not row.what.startswith("arm/1") for row in rows.rows())
