"""Simulated hours of other programs before the sources: `make soak ARGS=--sources`, see soak.py.

A robot drives in a moving frame of tf, tracks come, fall silent and go, detections have no ids, markers appear and are
deleted, a scanner loses beams. Between them come hostile messages of all types on topics of their own. Each five
simulated minutes time goes back to the start, like a bag in a loop. In the steps between, each object that reports has
to be where it is, and what is gone has to be gone; no source may fail, and the memory stays flat.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np

TEST: Final = Path(__file__).parents[1] / "test"
sys.path[:0] = [str(TEST / "helpers"), str(TEST / "attacks")]

from foreign_bag import START, STORE, marker, markers, odometry, transforms  # noqa: E402
from foreign_messages import decoder, detection, detections, laser_scan, track, tracked_objects  # noqa: E402
from source_messages import MAKERS, hostile_source_message  # noqa: E402

from collision_monitor.codec import Removal, decode_descriptions, decode_states  # noqa: E402
from collision_monitor.pipeline.pipeline import Pipeline  # noqa: E402
from collision_monitor.pipeline.topics import Topic  # noqa: E402
from collision_monitor.sources import Feed, Input, RawMessage  # noqa: E402
from collision_monitor.sources.ground.mapping import make_mapping  # noqa: E402

PERIOD: Final = 200_000_000
"""ns between two steps."""

LOOP: Final = 300 * 1_000_000_000 // PERIOD
"""Steps after which time goes back."""

SETTLING: Final = 8
"""Steps after time went back, or after a hostile message, until all objects have to be there again: a stamp that is up
to 10 s ahead stops the steps for half a second, and the next messages have to confirm that it was none."""

ATTACKS: Final = 0.02
"""Hostile messages of each step. They come on topics of their own."""

LEAVING: Final = 5
"""Tracks that may still be there besides those that report: they are forgotten after a second."""

NEAR: Final = 1e-4
"""m by which a state may differ from the truth. A step brings the last state of the robot to its stamp."""


class SourceSoak:
    """A feed with a pipeline behind it, and the truth of what is sent. problems: what went wrong, as sentences."""

    def __init__(self, tracks: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.seed = seed
        self.problems: list[str] = []
        self.steps = self.states = self.refused = self.attacks = self.compared = self.loops = self.came = self.went = 0
        self.tracks = {number: self._place() for number in range(tracks)}
        self._next = tracks
        self._silent: dict[int, int] = {}
        self._before: dict[int, Any] = {}
        self._attacked = -SETTLING
        self._names: dict[int, str] = {}
        self._seen: dict[str, Any] = {}
        objects = {
            "robot": {"topic": "/robot", "shape": {"sphere": 0.4}},
            "cars": {"topic": "/cars", "forget_after": 1.0},
            "posts": {"topic": "/posts", "marker": {"ns": "posts"}},
            "people": {"topic": "/people"},
            "laser": {"topic": "/laser"},
            **_hostile_lines(),
        }
        self.feed = Feed(make_mapping({"frame": "map", "rate": 5, "objects": objects}), decoder())
        self.pipeline = Pipeline("balanced", "map", timed=False)
        self._bound: set[str] = set()
        self._give(self.feed.begin(START))

    def _place(self) -> Any:
        return np.array([*self.rng.uniform(-40, 40, 2), 0.0])

    def step(self, number: int) -> None:
        """Send the messages of one step, and compare what comes of them with the truth."""
        place, received = number % LOOP, START + number * PERIOD
        stamp = START + place * PERIOD
        self.loops += number > 0 and place == 0
        if self.rng.random() < 0.05:
            self._change()
        self._seen.clear()
        x, turn = 0.01 * place % 50.0, 0.002 * place
        frame = np.array([x, 2.0, 0.0]), (0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2))
        here = {n: p for n, p in self.tracks.items() if self._silent.get(n, -1) < number}
        self._send("/tf", received, transforms(stamp, ("map", "moving", *frame)))
        self._send("/cars", received, tracked_objects("map", stamp, *(track(n, p) for n, p in here.items())))
        self._send("/people", received, detections("map", stamp, detection((0, 60, 0)), detection((9, 60, 0))))
        post = marker("posts", 1, 3, (1, 1, 2), (-50, 0, 0), frame="map", stamp=stamp, action=2 * (place % 10 == 9))
        self._send("/posts", received, markers(post))
        ranges = np.where(self.rng.random(90) < 0.1, np.nan, 5.0)
        self._send("/laser", received, laser_scan("map", stamp, ranges, step=0.05))
        self._attack(number, received, stamp)
        self._send("/robot", received, odometry("moving", stamp, (1, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0)))
        self.steps += 1
        if min(place, number - self._attacked) < SETTLING:
            self._before = here
            return
        self.compared += 1
        self._compare(number, "robot", [frame[0] + [np.cos(turn), np.sin(turn), 0.0]])
        self._compare(number, "people_", [np.array([0, 60, 0.0]), np.array([9, 60, 0.0])])
        self._compare(number, "cars_", [p for n, p in here.items() if n in self._before])
        described = sum(name.startswith("cars_") for name in self._names.values())
        if described > len(self.tracks) + LEAVING:
            self.problems.append(f"step {number}: {described} tracks are there, expected {len(self.tracks)}")
        self._before = here

    def _change(self) -> None:
        """Let a track come in another's place, or fall silent for a while."""
        number = list(self.tracks)[int(self.rng.integers(len(self.tracks)))]
        if self.rng.random() < 0.5:
            self._silent[number] = self.steps + int(self.rng.integers(1, 25))
            return
        del self.tracks[number]
        self._silent.pop(number, None)
        self.tracks[self._next] = self._place()
        self._next += 1
        self.came, self.went = self.came + 1, self.went + 1

    def _attack(self, number: int, received: int, stamp: int) -> None:
        for k in range(int(self.rng.poisson(ATTACKS))):
            attack = hostile_source_message(self.seed, 10 * number + k, stamp)
            topic = f"/hostile{attack.topic}"
            if topic not in self.feed.mapping.topics:  # those of robots, and tf, which places the known objects
                continue
            self.attacks, self._attacked = self.attacks + 1, number
            self._bind(topic, attack.type)
            self._take(RawMessage(topic, attack.type, attack.data, received))

    def _send(self, topic: str, received: int, typed: tuple[str, Any]) -> None:
        kind, content = typed
        self._bind(topic, kind)
        self._take(RawMessage(topic, kind, bytes(STORE.serialize_cdr(content, kind)), received))

    def _bind(self, topic: str, kind: str) -> None:
        if topic not in self._bound and topic in self.feed.mapping.topics:
            self._bound.add(topic)
            self.feed.bind(topic, kind)

    def _take(self, raw: RawMessage) -> None:
        self._give(self.feed.take(raw))
        self.feed.scene.take_news()
        self.problems += [f"{each.line}: {each.text}" for each in self.feed.take_failures()]

    def _give(self, inputs: list[Input]) -> None:
        """Hand the inputs to the monitor, as a node does."""
        for each in inputs:
            if each.topic is Topic.SHAPES:
                self.pipeline.on_shapes(each.data)
                for change in decode_descriptions(each.data).objects:
                    if isinstance(change, Removal):
                        self._names.pop(change.object_id, None)
                    else:
                        self._names[change.object_id] = change.name
                continue
            states = decode_states(each.data).states
            self.states += len(states)
            for row in states:
                self._seen[self._names.get(int(row["id"]), "")] = row["position"].copy()
            if self.pipeline.on_states(each.data) is None:
                self.refused += 1

    def _compare(self, number: int, line: str, places: list[Any]) -> None:
        """Check that a line of the file has a state at each of these places."""
        there = np.array([place for name, place in self._seen.items() if name.startswith(line)]).reshape(-1, 3)
        for place in places:
            if not (np.abs(there - place).max(1) <= NEAR).any():
                self.problems.append(
                    f"step {number}: no state of {line} is at {place}, only at {there.tolist()!r:.200}"
                )


def _hostile_lines() -> dict[str, dict[str, Any]]:
    """Return a line for each type of message that the fuzzer sends, on topics that nothing else uses."""
    keys: dict[str, dict[str, Any]] = {"pose": {"shape": {"sphere": 0.3}}, "marker": {"marker": {"ns": "a"}}, "": {}}
    kinds = {
        "/odom": "pose",
        "/pose": "pose",
        "/pose_with_covariance": "pose",
        "/marker": "marker",
        "/markers": "marker",
    }
    others = ("/tracked", "/predicted", "/detections", "/footprint", "/scan", "/cloud", "/world", "/object")
    more = {topic: keys[kind] for topic, kind in {**kinds, **dict.fromkeys(others, "")}.items()}
    assert set(more) <= set(MAKERS)
    return {topic.replace("/", "hostile_"): {"topic": f"/hostile{topic}", **each} for topic, each in more.items()}
