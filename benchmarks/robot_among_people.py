"""A robot with an arm among tracked people, with a scan: recorded as a bag, played over DDS, answered, and replayed.

    .venv/bin/python benchmarks/robot_among_people.py ../shared/data/citr/front_interaction_01 [--picture robot.png]

The argument is a clip of the CITR data without its ending `_ped.csv`. The recorded cart becomes a robot base with
odometry (30 Hz) that carries the arm of examples/arm (joint states at 500 Hz), which waves, and a laser scanner (10 Hz)
in a yard with walls. The recorded people become TrackedObjects (10 Hz) with covariances. The bag is played in real time
to a node with a sources file. Printed are the answers, the latency from the stamp of each Odometry to its
predictions, whether the session replays to the same bytes, and how many inputs equal those of `import` of the same bag.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "test" / "helpers"))

from arm_cost import ARM, joint_state
from foreign_bag import START, odometry, transforms, write_bag
from foreign_messages import CYLINDER, laser_scan, track, tracked_objects

from collision_monitor.cli.child import Child
from collision_monitor.codec import decode_predictions
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.endpoints import message_class, subscription
from collision_monitor.ros.process import ros_context, stay_on_this_machine
from collision_monitor.session import Session
from collision_monitor.session.replaying.replay import replay
from collision_monitor.sources import load_mapping
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.importing import import_bag
from collision_monitor.world.track_file import TrackFile, read_track_file

FRAMES: Final = 29.97
"""Frames a second of the data."""
HEIGHT: Final = 0.9
"""m: the arm stands on a cart of this height."""
SCANNER: Final = (1.25, 0.0, -0.5)
"""m, in the base of the arm."""
BEAMS: Final = 360
DELAY: Final = 3_000_000
"""ns from a stamp to the receipt of its odometry, which is the last one to arrive."""
MARGIN: Final = 3.0
"""m from the outermost track to the walls."""
COVARIANCE: Final = np.diag([0.01] * 6)
PERSON: Final = 0.25
"""m: radius of a person."""
SOURCES: Final = f"""\
frame: map
step: /odom
objects:
  cart:   {{topic: /odom, shapes: [{{box: [2.4, 1.2, 0.88], at: [0, 0, -0.46]}}], group: 1}}
  people: {{topic: /tracks, group: 2}}
  scan:   {{topic: /scan, radius: 0.03, without: [cart], clearance: 0.05, group: 4, mask: 1}}
robots:
  arm:
    urdf: {ARM / "arm.urdf"}
    srdf: {ARM / "arm.srdf"}
    joint_states: /joint_states
    base: {{odometry: /odom}}
    group: 1
    allowed: {{base: [cart]}}
"""

Floats = NDArray[np.float64]
Message = tuple[str, int, tuple[str, Any]]


class Clip(NamedTuple):
    """The tracks of a clip. walls: (4,) xmin, ymin, xmax, ymax of the yard, m."""

    people: TrackFile
    cart: TrackFile
    walls: Floats


class Played(NamedTuple):
    """What came back. latencies: s; answers: predictions by stamp."""

    latencies: Floats
    answers: dict[int, NDArray[np.void]]
    names: dict[int, str]


def read_clip(path: Path) -> Clip:
    """Read the two files of a clip. Raises InputError."""
    people = read_track_file(Path(f"{path}_ped.csv"), ("x_est", "y_est", "vx_est", "vy_est"))
    cart = read_track_file(Path(f"{path}_veh.csv"), ("x_est", "y_est", "psi_est", "vel_est"))
    places = np.concatenate([people.values[:, :2], cart.values[:, :2]])
    return Clip(people, cart, np.concatenate([places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN]))


def recorded(clip: Clip) -> Iterator[Message]:
    """Yield the messages of the bag by the time of receipt, as (topic, time, (type, message))."""
    first, last = clip.cart.frame[0], clip.cart.frame[-1]
    turning = np.gradient(np.unwrap(clip.cart.values[:, 2])) * FRAMES
    yield "/tf_static", START, transforms(START, ("base", "laser", SCANNER, (0, 0, 0, 1)))
    joint = 0
    for k, frame in enumerate(clip.cart.frame):
        t = (frame - first) / FRAMES
        while joint / 500.0 <= t:
            stamp = START + round(joint * 2e6)
            yield "/joint_states", stamp, ("sensor_msgs/msg/JointState", joint_state(stamp, 0.5 * joint / 500.0))
            joint += 1
        stamp = START + round(1e9 * t)
        x, y, heading, speed = clip.cart.values[k]
        q = (0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2))
        rows = clip.people.frame == frame
        if k % 3 == 0:
            yield "/tracks", stamp, tracked(clip.people.id[rows], clip.people.values[rows], stamp)
            yield "/scan", stamp, scan(clip, x, y, heading, clip.people.values[rows], stamp)
        yield "/tf", stamp, transforms(stamp, ("map", "base", (x, y, HEIGHT), q))
        yield "/odom", stamp + DELAY, odometry("map", stamp, (x, y, HEIGHT), q, (speed, 0, 0), (0, 0, turning[k]))
    assert frame == last


def tracked(ids: NDArray[np.int64], rows: Floats, stamp: int) -> tuple[str, Any]:
    """TrackedObjects of the people."""
    each = [
        track(int(i) + 1, (x, y, 0.875), linear=(vx, vy, 0), kind=CYLINDER, size=(2 * PERSON, 2 * PERSON, 1.75),
              label=7, pose_covariance=COVARIANCE, twist_covariance=COVARIANCE)
        for i, (x, y, vx, vy) in zip(ids, rows, strict=True)
    ]  # fmt: skip
    return tracked_objects("map", stamp, *each)


def scan(clip: Clip, x: float, y: float, heading: float, rows: Floats, stamp: int) -> tuple[str, Any]:
    """LaserScan of the walls; a beam that a person stops has no echo, since the people are tracked."""
    angles = -np.pi + 2 * np.pi / BEAMS * np.arange(BEAMS)
    origin = np.array([x, y]) + SCANNER[0] * np.array([np.cos(heading), np.sin(heading)])
    way = np.stack([np.cos(angles + heading), np.sin(angles + heading)], axis=1)
    with np.errstate(divide="ignore"):
        walls = np.where(way > 0, clip.walls[2:] - origin, clip.walls[:2] - origin) / way
    ranges = walls.min(axis=1)
    for person in rows[:, :2] - origin:
        along = way @ person
        stopped = (along > 0) & (np.abs(way @ (-person[1], person[0])) < PERSON) & (along < ranges)
        ranges[stopped] = np.inf
    return laser_scan("laser", stamp, ranges, start=float(angles[0]), step=2 * np.pi / BEAMS)


def play(bag: Path, child: Child) -> Played:
    """Play a bag in real time and collect the predictions."""
    import rclpy
    from rclpy.qos import DurabilityPolicy, QoSProfile

    node = rclpy.create_node("bag")
    messages: list[Any]
    with Bag(bag) as opened:
        topics, messages = opened.topics, list(opened.messages(opened.topics))
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    outs = {
        topic: node.create_publisher(message_class(kind), topic, latched if topic == "/tf_static" else 100)
        for topic, kind in topics.items()
    }
    latencies: list[float] = []
    answers: dict[int, NDArray[np.void]] = {}
    names: dict[int, str] = {}
    began = 0

    def receive(data: bytes) -> None:
        message = decode_predictions(data)
        latencies.append((time.monotonic_ns() - began - message.stamp_ns + START) * 1e-9)
        answers[message.stamp_ns] = message.predictions.copy()
        names.update(zip(message.ids.tolist(), message.names, strict=True))

    subscription(node, Topic.PREDICTIONS, receive, Topic.PREDICTIONS.of())
    while not all(out.get_subscription_count() for out in outs.values()) and child.running():
        rclpy.spin_once(node, timeout_sec=0.1)
    time.sleep(0.5)
    began = time.monotonic_ns()
    for each in messages:
        while (left := began + each.received - START - time.monotonic_ns()) > 0:
            rclpy.spin_once(node, timeout_sec=left * 1e-9)
        outs[each.topic].publish(each.data)
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    return Played(np.array(latencies), answers, names)


def inputs(session: Path) -> list[bytes]:
    """Return the states of a session."""
    return [bytes(each.data) for each in Session(session).messages() if each.type == Topic.STATES.message]


def draw(path: Path, clip: Clip, played: Played) -> None:
    """Draw the tracks with the places of collisions that are predicted with 0.05 or more, and the latencies."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (above, right) = plt.subplots(1, 2, figsize=(11, 4.5), width_ratios=[1.5, 1], layout="constrained")
    label: str | None = "people"
    for person in np.unique(clip.people.id):
        above.plot(*clip.people.values[clip.people.id == person, :2].T, color="0.6", lw=1, label=label)
        label = None
    above.plot(*clip.cart.values[:, :2].T, color="tab:blue", lw=2, label="robot")
    x0, y0, x1, y1 = clip.walls
    above.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color="k", lw=1, label="walls (scan)")
    found = [rows[rows["probability"] >= 0.05] for rows in played.answers.values()]
    rows = np.concatenate(found) if found else np.zeros(0)
    place = above.scatter(rows["point"][:, 0], rows["point"][:, 1], c=rows["probability"], s=9, cmap="autumn_r",
                          vmin=0, vmax=1, zorder=3)  # fmt: skip
    above.plot([], [], "o", ms=4, color="tab:orange", label="predicted collisions")
    figure.colorbar(place, ax=above, label="probability", shrink=0.8)
    above.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="A robot with an arm among people, seen from above")
    above.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4, fontsize=8)
    right.hist(played.latencies * 1e3, bins=60, color="tab:blue")
    right.set(xlabel="from an Odometry to its predictions over DDS, ms", ylabel="steps")
    figure.savefig(path, dpi=110)


def report(clip: Clip, played: Played, folder: Path) -> None:
    """Print what was found."""
    session, again = folder / "live.mcap", folder / "imported.mcap"
    ms = played.latencies * 1e3
    print(f"steps: {len(ms)} of {len(clip.cart.frame)} odometry messages")
    print(f"from Odometry to predictions: median {np.median(ms):.1f} ms, p99 {np.percentile(ms, 99):.1f} ms")
    soonest: dict[tuple[str, str], tuple[float, float]] = {}
    for rows in played.answers.values():
        for row in rows:
            pair = played.names[int(row["id_a"])], played.names[int(row["id_b"])]
            lead, probability = soonest.get(pair, (np.inf, 0.0))
            soonest[pair] = min(lead, float(row["lower"])), max(probability, float(np.nan_to_num(row["probability"])))
    print(f"pairs that were predicted: {len(soonest)}; the likeliest:")
    for pair, (lead, probability) in sorted(soonest.items(), key=lambda item: -item[1][1])[:5]:
        print(f"  {pair[0]} and {pair[1]}: soonest in {lead:.2f} s, probability up to {probability:.2f}")
    verdict = replay(Session(session))
    print(f"replay: {verdict.verdict.name}, {verdict.steps} steps")
    import_bag(folder / "bag", again, load_mapping(folder / "sources.yaml"))
    live, imported = inputs(session), inputs(again)
    print(f"inputs: {sum(a in set(imported) for a in live)} of {len(live)} equal those of `import`, to the byte")


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clip", type=Path, help="path of the clip without _ped.csv")
    parser.add_argument("--profile", default="balanced")
    parser.add_argument("--executor", choices=("single", "events"), default="events", help="parameter of the node")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep bag, session and sources file here")
    parser.add_argument("--picture", type=Path, help="draw the scene and the latencies")
    arguments = parser.parse_args()
    clip = read_clip(arguments.clip)
    os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    stay_on_this_machine()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "sources.yaml").write_text(SOURCES)
        write_bag(folder / "bag", recorded(clip))
        options = ["--ros-args", "-p", f"profile:={arguments.profile}", "-p", f"executor:={arguments.executor}"]
        words = ["run", "--sources", str(folder / "sources.yaml"), "--record", str(folder / "live.mcap"), *options]
        with ros_context(["bag"]), Child(*words) as child:
            played = play(folder / "bag", child)
            child.finish()
            print(child.words())
        report(clip, played, folder)
        if arguments.picture:
            draw(arguments.picture, clip, played)


if __name__ == "__main__":
    main()
