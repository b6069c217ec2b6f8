"""What a message can cost and leave behind: every loop, text and table of the sources has a bound.

The times are bounds against hangs, ten times as long as a slow machine needs.
"""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import SECOND, START, STORE, marker, markers, odometry, pose_stamped, transforms
from foreign_messages import decoder, detection, detections, track, tracked_objects
from planning_messages import REMOVE, SCENE, a_scene, an_object, attached, matrix, ready, solid
from played_sources import Played
from ros_messages import message
from scipy.optimize import linear_sum_assignment

from collision_monitor.sources import Feed, RawMessage
from collision_monitor.sources.ground.frames import (
    MOST_FRAMES,
    MOST_LINKS_BETWEEN,
    MOST_SAMPLES_IN_ALL,
    FrameMotion,
    FrameTree,
    MissingFrame,
)
from collision_monitor.sources.ground.mapping import make_mapping
from collision_monitor.sources.ground.nearest_tracks import LARGEST_BLOCK, assigned
from collision_monitor.sources.ground.source_scene import MOST_TEXTS
from collision_monitor.sources.robot.robot_preparation import RobotPreparation

SPHERE = {"sphere": 1.0}
STEP = 100_000_000
SLOW = 5.0
"""s of the processor that no message of these may take."""


def cpu(work: Callable[[], Any]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def kept_of(send: Callable[[int], None], count: int) -> int:
    """Bytes that Python holds for the inputs 1 to count - 1, after the first one."""
    send(0)
    tracemalloc.start()
    try:
        for k in range(1, count):
            send(k)
        gc.collect()  # what is garbage is not kept
        return tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()


def give(fed: Fed, topic: str, received: int, kind_and_content: tuple[str, Any]) -> float:
    """Give a message, and return the seconds of the processor that it took without its making."""
    kind, content = kind_and_content
    data = bytes(STORE.serialize_cdr(content, kind))
    return cpu(lambda: fed.give(topic, received, (kind, data)))  # with the time to bind the topic


# -- time


def test_a_thousand_detections_without_ids_keep_their_tracks_in_little_time() -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(0, 1, (1000, 3))
    fed = Fed({"people": {"topic": "/d", "gate": 1.0}})
    for k in range(4):
        each = [detection(p) for p in places + rng.normal(0, 0.002, places.shape)]
        assert give(fed, "/d", START, detections("map", START + k * STEP, *each)) < SLOW
    assert len(fed.changes) == 1000 and len(fed.rows) == 4000
    last = fed.rows[-1000:]
    assert np.linalg.norm(last["linear"], axis=1).mean() < 0.2  # the tracks are not exchanged


def test_six_thousand_markers_and_ten_thousand_transforms_in_little_time() -> None:
    fed = Fed({"m": {"topic": "/m", "marker": {"ns": "a"}}, "t": {"topic": "/tf", "frame": "f7", "shape": SPHERE}})
    for k in range(2):
        stamp = START + k * STEP
        each = [marker("a", i, 1, (1, 1, 1), (i, k, 0), frame="map", stamp=stamp) for i in range(6000)]
        assert give(fed, "/m", stamp, markers(*each)) < SLOW
        links = [("map", f"f{i}", (i, 0, 0), (0, 0, 0, 1)) for i in range(10_000)]
        assert give(fed, "/tf", stamp, transforms(stamp, *links)) < SLOW
    assert len(fed.changes) == 6001 and len(fed.rows) == 12_002
    fed.give("/tf", START, transforms(START, *[("map", f"f{i}", (0, 0, 0), (0, 0, 0, 1)) for i in range(10_001)]))
    assert any("expected at most 10000 transforms in a message" in text for text in fed.refused)


@pytest.mark.parametrize(
    ("links", "known"), [(MOST_LINKS_BETWEEN, True), (MOST_LINKS_BETWEEN + 1, False), (9000, False)]
)
def test_a_long_chain_of_frames_is_walked_up_to_a_bound(links: int, known: bool) -> None:
    fed = Fed({"thing": {"topic": "/p", "shape": SPHERE}})
    chain = [(f"f{i - 1}" if i else "map", f"f{i}", (0.001, 0, 0), (0, 0, 0, 1)) for i in range(links)]
    assert give(fed, "/tf", START, transforms(START, *chain)) < SLOW
    assert cpu(lambda: fed.give("/p", START, pose_stamped(f"f{links - 1}", START, (0, 0, 0)))) < SLOW
    if known:
        assert fed.rows["position"][0, 0] == pytest.approx(0.001 * links)
    else:
        assert f"expected at most {MOST_LINKS_BETWEEN} transforms between 'map' and" in next(iter(fed.refused))


def test_new_frames_in_a_full_tree_are_refused_in_little_time_until_others_are_silent() -> None:
    fed = Fed({"t": {"topic": "/tf", "frame": "f7", "shape": SPHERE}})
    for k in range(2):
        links = [("map", f"{k}_{i}", (i, 0, 0), (0, 0, 0, 1)) for i in range(MOST_FRAMES)]
        assert give(fed, "/tf", START, transforms(START + k, *links)) < SLOW
    assert fed.feed.scene.refused_by_name["/tf"] == MOST_FRAMES
    fed.give("/tf", START, transforms(START + 9 * SECOND, ("map", "late", (0, 0, 0), (0, 0, 0, 1))))
    assert fed.feed.scene.refused_by_name["/tf"] == MOST_FRAMES + 1
    fed.give("/tf", START, transforms(START + 11 * SECOND, ("map", "f7", (3, 0, 0), (0, 0, 0, 1))))
    assert fed.rows["position"][:, 0].tolist() == [3.0]


@pytest.mark.parametrize("where", ["a pose", "a transform", "a marker", "joints"])
def test_long_names_are_not_kept(where: str) -> None:
    """A publisher may send another name with every message."""
    objects = {"thing": {"topic": "/p", "shape": SPHERE}, "m": {"topic": "/m", "marker": {"ns": "a"}}}
    played = Played({**ROBOT, "joint_states": "/joint_states"}, objects=objects)
    played.send("/u", "std_msgs/msg/String", message("std_msgs/msg/String", data=robot_of(2)))

    def send(k: int) -> None:
        stamp, name = START + k * STEP, f"{k}" + "x" * 100_000
        if where == "a pose":
            played.give("/p", stamp, pose_stamped(name, stamp, (0, 0, 0)))
        elif where == "a transform":
            played.give("/tf", stamp, transforms(stamp, ("map", name, (0, 0, 0), (0, 0, 0, 1))))
        elif where == "a marker":
            each = marker(name, k, 1, (1, 1, 1), (0, 0, 0), frame=name, stamp=stamp)
            played.give("/m", stamp, markers(each))
        else:
            played.joints(stamp, [0.0], names=[name])

    assert kept_of(send, 100) < 1_000_000  # of 9.9 MB


def test_a_loop_of_frames_and_frames_that_refer_to_themselves_end() -> None:
    fed = Fed({"thing": {"topic": "/p", "shape": SPHERE}, "frame": {"topic": "/tf", "frame": "a", "shape": SPHERE}})
    fed.give("/tf", START, transforms(START, *((a, b, (0, 0, 0), (0, 0, 0, 1)) for a, b in ("ab", "bc", "ca", "aa"))))
    fed.give("/p", START, pose_stamped("a", START, (0, 0, 0)))
    assert not len(fed.steps[-1].states) if fed.steps else True
    assert any("no transform from 'map' to 'a'" in text for text in fed.refused)


def robot_of(links: int, *, mimic: bool = False, boxes: int = 1, kind: str = "revolute", geometry: str = "") -> str:
    shape = geometry or '<box size="1 1 1"/>'
    parts = ['<robot name="r">']
    for k in range(links):
        parts.append(f'<link name="l{k}">{f"<collision><geometry>{shape}</geometry></collision>" * boxes}</link>')
        if k:
            follows = f'<mimic joint="j{k - 1}"/>' if mimic and k > 1 else ""
            ends = f'<parent link="l{k - 1}"/><child link="l{k}"/>'
            parts.append(f'<joint name="j{k}" type="{kind}">{ends}<axis xyz="0 0 1"/>{follows}</joint>')
    return "\n".join([*parts, "</robot>"])


ROBOT = {"urdf_topic": "/u", "joint_states": "/joint_states", "base": {"pose": [0, 0, 0]}}


def told(text: str) -> tuple[Played, float]:
    played = Played(ROBOT)
    content = message("std_msgs/msg/String", data=text)
    return played, cpu(lambda: played.send("/u", "std_msgs/msg/String", content))


def test_two_thousand_mimic_joints_are_followed_in_little_time() -> None:
    played, took = told(robot_of(2000, mimic=True))
    assert took < SLOW and len(played.objects) == 2000
    played, _ = told(robot_of(40, mimic=True).replace("<mimic ", '<mimic multiplier="1e10" '))
    assert any("mimic: expected a position up to 1e+18" in text for text in played.refusals)


def test_links_of_robots_that_are_gone_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("collision_monitor.sources.robot.robot_source.MOST_IDS", 50)
    played, name = Played(ROBOT), "l" * 200

    def send(k: int) -> None:
        text = robot_of(20).replace('"l', f'"{name}_{k}_')
        played.send("/u", "std_msgs/msg/String", message("std_msgs/msg/String", data=text))
        played.changes.clear()

    tracemalloc.start()
    try:
        for k in range(30):
            send(k)
        gc.collect()  # what is garbage is not kept
        before, _ = tracemalloc.get_traced_memory()
        for k in range(30, 90):
            send(k)
        gc.collect()
        assert tracemalloc.get_traced_memory()[0] - before < 150_000  # of 370 kB of names and ids
    finally:
        tracemalloc.stop()
    assert len(played.objects) == len({it.object_id for it in played.objects.values()}) == 20


def test_the_mesh_of_many_links_is_loaded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import collision_monitor.robots.link_shapes as shapes

    loaded = []
    load_mesh = shapes.load_mesh

    def counting(path: Path, scale: float = 1.0) -> Any:
        loaded.append(path)
        return load_mesh(path, scale)

    monkeypatch.setattr(shapes, "load_mesh", counting)
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    text = robot_of(20, geometry=f'<mesh filename="{tmp_path}/part.obj"/>')
    played, _ = told(text)
    assert len(played.objects) == 20 and len(loaded) == 1
    played.send("/u", "std_msgs/msg/String", message("std_msgs/msg/String", data=text))
    assert len(loaded) == 1  # the same text again
    played, _ = told(robot_of(20, geometry=f'<mesh filename="{tmp_path}/none.obj"/>'))
    assert not played.objects and len(loaded) == 1


def test_rigid_links_and_disabled_pairs_beyond_a_bound_are_refused() -> None:
    played, took = told(robot_of(600, kind="fixed"))
    text = "pairs of links with shapes that fixed joints connect"
    assert took < SLOW and any(text in refusal for refusal in played.refusals)
    played, _ = told(robot_of(1, boxes=1025))
    assert any("expected at most 1024 geometries of a link, got 1025" in text for text in played.refusals)


def test_a_robot_that_takes_long_is_made_beside_the_monitoring() -> None:
    preparation = RobotPreparation()
    feed = Feed(make_mapping({"frame": "map", "robots": {"arm": ROBOT}}), decoder(), preparation=preparation)
    feed.begin(START)
    text = robot_of(500, boxes=2)
    data = bytes(STORE.serialize_cdr(message("std_msgs/msg/String", data=text), "std_msgs/msg/String"))
    raw = RawMessage("/u", "std_msgs/msg/String", data, START)
    try:
        assert not feed.take(raw) and feed.is_behind
        assert "it is made beside the monitoring" in {row.what: row.reason for row in feed.unmonitored}["arm"]
        deadline = time.monotonic() + 120
        while not (inputs := feed.go_on(START)):
            assert time.monotonic() < deadline and not feed.scene.refused
            time.sleep(0.05)
        assert len(inputs) == 1 and "arm" not in {row.what for row in feed.unmonitored}
        broken = RawMessage("/u", "std_msgs/msg/String", data.replace(b"</robot>", b"</robut>"), START)
        feed.take(broken)
        while feed.is_behind:
            assert time.monotonic() < deadline
            feed.go_on(START)
            time.sleep(0.05)
        assert any("expected XML" in text for text in feed.scene.refused)
    finally:
        preparation.close()


def test_new_objects_beyond_the_allowance_follow_and_are_listed_until_then() -> None:
    objects = {"m": {"topic": "/m", "marker": {"ns": "a"}}, "t": {"topic": "/t"}}
    feed = Feed(make_mapping({"frame": "map", "objects": objects}), decoder(), allowance=100)
    feed.begin(START)
    described = 0
    for topic, (kind, content) in {
        "/m": markers(*[marker("a", i, 1, (1, 1, 1), (i, 0, 0), frame="map", stamp=START) for i in range(250)]),
        "/t": tracked_objects("map", START, *[track(i, (i, 9, 0)) for i in range(250)]),
    }.items():
        feed.bind(topic, kind)
        raw = RawMessage(topic, kind, bytes(STORE.serialize_cdr(content, kind)), START)
        feed.take(raw)
        assert feed.is_behind and len(feed.unmonitored) >= 150
        for _ in range(3):
            feed.take(raw) if topic == "/t" else feed.go_on(START)
        described += 250
        assert not feed.is_behind and len(feed.scene.states) == described
        assert not [row for row in feed.unmonitored if "waits" in row.reason]


def test_markers_that_wait_have_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("collision_monitor.sources.messages.markers.MOST_TRACKS", 50)
    fed = Fed({"m": {"topic": "/m", "marker": {"ns": "a"}}}, begin=START, allowance=2)
    for k in range(20):
        each = [marker("a", 30 * k + i, 1, (1, 1, 1), (i, 0, 0), frame="map", stamp=START + k) for i in range(30)]
        fed.give("/m", START, markers(*each))
    assert any("expected at most 50 objects of one entry, with those that wait" in text for text in fed.refused)
    for _ in range(40):
        fed._keep(fed.feed.go_on(START))
    assert len(fed.changes) == 50 and not fed.feed.is_behind


@pytest.mark.parametrize("entry", [{}, {"forget_after": 0.5}])
def test_markers_that_cannot_be_used_are_listed_until_they_are_gone(entry: dict[str, float]) -> None:
    """Arrows and texts with a new id each would fill the list, and nothing else would be found in it."""
    fed = Fed({"m": {"topic": "/m", "marker": {"ns": "a"}, **entry}}, begin=START)
    for k in range(100):
        stamp = START + k * STEP
        arrow = marker("a", k, 0, (1, 1, 1), (0, 0, 0), frame="map", stamp=stamp)
        arrow.lifetime.nanosec = 0 if entry else 500_000_000
        fed.give("/m", stamp, markers(arrow))
    assert [row.what for row in fed.feed.unmonitored] == [f"m_{k}" for k in range(94, 100)]


def test_a_large_matrix_is_applied_in_little_time_and_a_larger_one_refused() -> None:
    played, _ = ready()
    names = ["hand", *(f"o{k}" for k in range(1500))]
    objects = [an_object(name, solid(2, 0.1)) for name in names[1:]]
    content = a_scene(*objects, allowed_collision_matrix=matrix(names, np.ones((1501, 1501), bool)))
    assert cpu(lambda: played.send("/scene", "moveit_msgs/msg/PlanningScene", content)) < 4 * SLOW
    assert len(played.objects["arm/hand"].allowed) >= 1500
    names = [f"o{k}" for k in range(5001)]
    content.allowed_collision_matrix = matrix(names, np.ones((5001, 0), bool))
    played.send("/scene", "moveit_msgs/msg/PlanningScene", content)
    assert any("expected at most 5000 names" in text for text in played.refusals)


# -- the assignment


@pytest.mark.parametrize("count", [1, 7, 60])
def test_the_assignment_has_the_least_sum_within_the_gate(count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(20):
        a, b = rng.uniform(0, 2, (count, 3)), rng.uniform(0, 2, (count + int(rng.integers(-1, 3)), 3))
        i, j = assigned(a, b, 0.7)
        squared = ((a[:, None] - b) ** 2).sum(2)
        cost = np.minimum(squared, 0.49)
        best = cost[linear_sum_assignment(cost)].sum()
        lost = min(len(a), len(b)) - len(i)
        assert squared[i, j].sum() + 0.49 * lost == pytest.approx(best)
        assert (squared[i, j] <= 0.49).all() and len({*i}) == len(i) and len({*j}) == len(j)


def test_more_detections_than_one_block_are_assigned_once_each() -> None:
    rng = np.random.default_rng(3)
    for places in (rng.uniform(0, 1, (1000, 3)), np.zeros((1000, 3)), rng.integers(0, 3, (1000, 3)).astype(float)):
        i, j = assigned(places, places[::-1].copy(), 1.0)
        assert len({*i.tolist()}) == len(i) == len({*j.tolist()})
        assert len(i) >= 1000 - 1000 // LARGEST_BLOCK


# -- memory


def test_names_of_objects_that_are_gone_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("collision_monitor.sources.ground.source_scene.MOST_COUNTED", 500)
    objects = {"m": {"topic": "/m", "marker": {"ns": "a"}}, "t": {"topic": "/t", "forget_after": 0.1}}
    fed = Fed(objects, begin=START, rate=10)
    for k in range(50):
        stamp = START + k * STEP
        each = [marker("a", 40 * k + i, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=stamp) for i in range(40)]
        for it in each:
            it.lifetime.nanosec = 50_000_000
        fed.give("/m", stamp, markers(*each))
        fed.give("/t", stamp, tracked_objects("map", stamp, track(k, (0, 0, 0))))
    scene = fed.feed.scene
    assert len(scene.states) <= 501 and scene.line_states["m"] == 2000
    assert sum(scene.states.values()) == 2050 and not fed.refused
    (source,) = (each for each in fed.feed._sources if each.name == "m")
    assert len(source._tracks) <= 80  # type: ignore[attr-defined]


def test_lifetimes_of_markers_that_are_not_shown_leave_nothing_behind() -> None:
    fed = Fed({"m": {"topic": "/m", "marker": {"ns": "a"}}}, begin=START)
    each = [marker("a", i, 10, (1, 1, 1), (0, 0, 0), frame="map", stamp=START) for i in range(8000)]
    for it in each:
        it.lifetime.sec = 2**31 - 1
    fed.give("/m", START, markers(*each))
    (source,) = (each for each in fed.feed._sources if each.name == "m")
    assert not len(source._tracks) and not source._waiting  # type: ignore[attr-defined]
    assert len(fed.feed.unmonitored) in (1000, 1001) and fed.feed.unmonitored[-1].reason.endswith("are not listed")


def test_texts_that_quote_messages_are_short_and_few() -> None:
    fed = Fed({"thing": {"topic": "/p", "shape": SPHERE}})
    for k in range(2 * MOST_TEXTS):
        fed.give("/p", START, pose_stamped(f"{k}" + 1000 * "x", START + k, (0, 0, 0)))
    fed.give("/p", START, pose_stamped(1_000_000 * "y", START + 3 * MOST_TEXTS, (0, 0, 0)))
    assert len(fed.refused) <= MOST_TEXTS + 1 and max(map(len, fed.refused)) < 1100
    assert sum(fed.refused.values()) == 2 * MOST_TEXTS + 1


def test_the_history_of_tf_is_bounded_in_all_and_silent_frames_make_room() -> None:
    tree = FrameTree(1.0)
    q = np.array([0.0, 0.0, 0.0, 1.0])
    for k in range(300):
        for frame in range(200):
            assert tree.put("map", f"f{frame}", np.zeros(3), q, START + k * 10_000_000, static=False) is None
    assert sum(len(link.stamps) for link in tree._links.values()) == 200 * 300 <= MOST_SAMPLES_IN_ALL
    for k in range(MOST_FRAMES + 500):
        stamp = START + 60 * SECOND + k * 10_000_000
        assert tree.put("map", f"track_{k}", np.zeros(3), q, stamp, static=False) is None
    assert len(tree._links) <= MOST_FRAMES
    assert isinstance(tree.motion("map", f"track_{MOST_FRAMES + 499}", stamp), FrameMotion)
    assert isinstance(tree.motion("map", "f0", stamp), MissingFrame)


def test_the_last_id_of_all_leaves_ids_for_tracks() -> None:
    objects = {"last": {"topic": "/p", "shape": SPHERE, "id": 4294967295}, "t": {"topic": "/t"}, "m": {"topic": "/m", "marker": {"ns": "a"}}}  # fmt: skip  # noqa: E501
    fed = Fed(objects, begin=START)
    fed.give("/t", START, tracked_objects("map", START, track(1, (0, 0, 0)), track(2, (9, 0, 0))))
    fed.give("/m", START, markers(marker("a", 1, 1, (1, 1, 1), (0, 0, 0), frame="map", stamp=START)))
    fed.give("/p", START, odometry("map", START, (0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
    ids = [change.object_id for change in fed.changes]
    assert len({*ids}) == 4 and max(ids) == 4294967295 and not fed.refused


# -- planning scenes


BALL = solid(2, 0.1)


def test_attached_objects_and_those_that_were_detached_have_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """A new name with every message, attached, and then left in the world."""
    monkeypatch.setattr("collision_monitor.sources.robot.planning_scene.MOST_HELD", 5)
    monkeypatch.setattr("collision_monitor.sources.robot.planning_scene.MOST_OBJECTS", 8)
    played, _ = ready()
    links = len(played.objects)
    for k in range(20):
        held = attached("hand", an_object(f"o{k}", BALL, frame="hand"))
        played.send("/scene", SCENE, a_scene(held=[held]))
        assert len(played.objects) <= links + 5
    assert any("expected at most 5 attached objects" in text for text in played.refusals)
    for k in range(30):
        for operation in (REMOVE, 0):  # the first one detaches what is there
            name = "" if operation == REMOVE else f"n{k}"
            each = an_object(name, BALL, frame="hand", operation=operation)
            played.send("/scene", SCENE, a_scene(held=[attached("hand", each)]))
    assert len(played.objects) == links + 8 + 1
    assert any("n28: it was detached, and the world has 8 objects, which is the most" in it for it in played.refusals)
    assert "arm/n28" in [row.what for row in played.feed.unmonitored]


def test_as_many_attached_objects_as_there_may_be_take_little_time() -> None:
    played, _ = ready()
    held = [attached("hand", an_object(f"o{k}", BALL, frame="hand")) for k in range(600)]
    assert cpu(lambda: played.send("/scene", SCENE, a_scene(held=held))) < SLOW
    assert played.feed.scene.refused_by_name["arm"] == 100


def test_an_object_that_could_not_be_used_is_listed_until_a_whole_scene_is_without_it() -> None:
    played, _ = ready()
    bad = an_object("bad", solid(2, np.nan))
    for whole in (a_scene(bad, is_diff=False), a_scene(), a_scene(bad, is_diff=False)):
        played.send("/scene", SCENE, whole)
        assert [row.what for row in played.feed.unmonitored if "bad" in row.what] == ["arm/bad"]
    played.send("/scene", SCENE, a_scene(an_object("good", BALL), is_diff=False))
    assert not any("bad" in row.what for row in played.feed.unmonitored)


@pytest.mark.parametrize("where", ["touch links", "more touch links", "a link", "a matrix", "defaults", "paddings"])
def test_long_names_in_a_planning_scene_are_not_kept(where: str) -> None:
    played, _ = ready() if where != "a link" else (Played({"urdf_topic": "/u", "planning_scene": "/scene"}), None)

    def send(k: int) -> None:
        name = f"{k}" + "x" * 100_000
        ball = an_object(f"o{k % 5}", BALL, frame="hand", operation=2 if where == "more touch links" else 0)
        padding = message("moveit_msgs/msg/LinkPadding", link_name=name, padding=0.1)
        fields: dict[str, dict[str, Any]] = {
            "touch links": {"held": [attached("hand", ball, "hand", name)]},
            "more touch links": {"held": [attached("hand", ball, name)]},
            "a link": {"held": [attached(name, ball)]},
            "a matrix": {"allowed_collision_matrix": matrix([name], [[True]])},
            "defaults": {"allowed_collision_matrix": matrix([], [], **{name: True})},
            "paddings": {"link_padding": [padding]},
        }
        played.send("/scene", SCENE, a_scene(**fields[where]))

    assert kept_of(send, 40) < 1_000_000  # of 3.9 MB


def test_more_touch_links_than_a_robot_has_links_are_refused() -> None:
    played, _ = ready()
    touch = [f"link {k}" for k in range(2001)]
    played.send("/scene", SCENE, a_scene(held=[attached("hand", an_object("cup", BALL, frame="hand"), *touch)]))
    assert any("cup: touch_links: expected at most 2000 links, got 2001" in text for text in played.refusals)


def test_a_frame_of_a_megabyte_is_not_kept_with_its_object() -> None:
    played, _ = ready()
    played.send("/scene", SCENE, a_scene(an_object("far", BALL, frame="x" * 1_000_000)))
    assert any("frame_id: expected at most 256 characters" in text for text in played.refusals)
